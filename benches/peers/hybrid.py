"""MuJoCo's body under a brain of choice, ours or the reference's: the engine and the brain are exchanged one at a time.

Our observer and controller run in another process, `cross_engine serve` (cross_engine.rs). The order of events in a tick
is that of our own loop and of the reference: sense, believe, control, step.
"""

import subprocess

import mujoco
import numpy as np

JOINTS, EVERY_S = 35, 0.02
FALLEN_HEIGHT, FALLEN_DEG = 0.6, 25.0  # of the centre of mass, m, and its sway: the reference's
PLATFORM_INERTIA = 1e6 + 1000.0  # of the platform in the model file: it does not feel what it carries


def profile(t, spin_s):
    """Rate and acceleration of the turntable: 30 rpm for `spin_s` from 2 s on, with ramps of 1 s."""
    top, slowing = np.pi, 2 + spin_s
    if t < 2 or t >= slowing + 1:
        return 0.0, 0.0
    if t < 3:
        return top * (t - 2), top
    if t < slowing:
        return top, 0.0
    return top * (slowing + 1 - t), -top


class Ours:
    """Our observer and controller. Called with what a tick knows; returns torques, believed gravity (world), omega (head)."""

    def __init__(self, executable, settings=()):
        self.process = subprocess.Popen([executable, "serve", *settings], stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def __call__(self, data, platform, gyro, force, dt, gravity=(np.nan,) * 3):
        request = np.concatenate([data.qpos[1:], data.qvel[1:], platform, gyro, force, [dt], gravity])
        self.process.stdin.write(request.tobytes())
        self.process.stdin.flush()
        answer = np.frombuffer(self.process.stdout.read(8 * (JOINTS + 6)))
        return np.split(answer, [JOINTS, JOINTS + 3])

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def run(model, start, brain, step_s, spin_s):
    """Rows at 50 Hz with the columns of `cross_engine run`: the green character up to 25 s after the spin, or to its fall."""
    model.opt.timestep = step_s
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a run that diverges has fallen
    data = mujoco.MjData(model)
    data.qpos[1:] = start
    mujoco.mj_forward(model, data)
    head, pelvis = model.body("head").id, model.body("pelvis").id
    points = [model.geom(f"c{side}{i}").id for side in "lr" for i in range(4)]
    angle, rows, wrench, every = 0.0, [], np.zeros(6), round(EVERY_S / step_s)
    for k in range(round((spin_s + 28) / step_s)):
        t = k * step_s
        rate, acceleration = profile(t, spin_s)
        data.qpos[0], data.qvel[0] = angle, rate
        data.qfrc_applied[0] = PLATFORM_INERTIA * acceleration
        mujoco.mj_step1(model, data)
        if not data.subtree_com[pelvis, 2] > FALLEN_HEIGHT:
            break
        rot_head = data.xmat[head].reshape(3, 3)
        gyro, force = data.sensordata[:3].copy(), data.sensordata[3:6].copy()
        if k == 0:
            force = -rot_head.T @ model.opt.gravity
        platform = (angle, rate, acceleration)
        torques, gravity, omega = brain(data, platform, gyro, force, step_s)
        keep = k % every == 0
        if keep:
            support = data.geom_xpos[points].mean(axis=0) * [1, 1, 0]
            com = data.subtree_com[pelvis] - support
            lift = (data.geom_xpos[points, 2] - model.geom_size[points, 0]).max()
        data.ctrl[:] = torques
        mujoco.mj_step2(model, data)
        if keep:
            load, moment = 0.0, np.zeros(3)
            for i, contact in enumerate(data.contact[: data.ncon]):
                mujoco.mj_contactForce(model, data, i, wrench)
                load += wrench[0]
                moment += wrench[0] * contact.pos
            cop = moment / load - support if load > 20 else np.full(3, np.nan)
            s, c = np.sin(angle), np.cos(angle)
            to_platform = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
            c, z, g, p = (to_platform @ v for v in (com, cop, gravity, support))
            sway = np.degrees(np.arctan2(np.hypot(c[0], c[1]), c[2]))
            down = model.opt.gravity
            tilt = np.degrees(np.arctan2(np.linalg.norm(np.cross(gravity, down)), gravity @ down))
            rows.append([t, *c, *z[:2], *g, sway, tilt, rate, *omega, *p[:2], lift])
            if sway > FALLEN_DEG:
                break
        angle += rate * step_s
    return np.array(rows)
