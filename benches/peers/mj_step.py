"""Times MuJoCo's bare mj_step on the shipped character under the load our own character had.

Usage: mj_step.py MODEL.xml DIR PHASE...

DIR/PHASE.f64 (written by tick.rs) holds the motion of our character: platform angle, configuration, platform rate,
velocity, one row per tick of 1 ms. A computed-torque controller lets MuJoCo's character follow it once, and its
torques are kept; the timed runs replay those torques, so that nothing but mj_step is timed. Two ways:

  mujoco       mj_step called from Python, each call timed; the part `call` is a call that does next to nothing
  mujoco_loop  mujoco.rollout: the loop over mj_step runs in C++ on one thread; means over blocks of 50 steps

Lines `WHO PHASE PART min median p99`; on standard error how far the pelvis ended from the motion it followed: if it
fell, the load is not the same, and the script fails.
"""

import sys
import time

import mujoco
import numpy as np
from mujoco import rollout

import character

STIFFNESS, DAMPING = 400.0, 40.0  # 1/s2, 1/s
BLOCK = 50  # steps of one call of rollout
FEET = [f"c{side}{i}" for side in "lr" for i in range(4)]


def contact_jacobian(model, data):
    """Rows of the eight lowest points of the feet, world axes."""
    rows = np.zeros((24, model.nv))
    for i, name in enumerate(FEET):
        geom = model.geom(name).id
        point = data.geom_xpos[geom] - [0, 0, model.geom_size[geom, 0]]
        mujoco.mj_jac(model, data, rows[3 * i : 3 * i + 3], None, point, model.geom_bodyid[geom])
    return rows


def follow(model, motion, velocity):
    """Torques that let the character follow the motion, how far off it ends, m, and its contacts.

    The platform turns on by itself: it weighs ten thousand times what it carries, and its rate is steady in each phase.
    """
    # The controller looks at a copy: what it computes must not touch the solver's warm start, or the replay differs.
    data, seen = mujoco.MjData(model), mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = motion[0], velocity[0]
    torques = np.zeros((len(motion) - 1, model.nu))
    mass = np.zeros((model.nv, model.nv))
    error = np.zeros(model.nv)
    for k in range(len(torques)):
        seen.qpos[:], seen.qvel[:] = data.qpos, data.qvel
        mujoco.mj_forward(model, seen)
        mujoco.mj_fullM(model, seen, mass)
        mujoco.mj_differentiatePos(model, error, 1.0, seen.qpos, motion[k])
        wanted = (velocity[k + 1] - velocity[k]) / model.opt.timestep
        wanted += STIFFNESS * error + DAMPING * (velocity[k] - seen.qvel)
        force = mass @ wanted + seen.qfrc_bias
        rows = contact_jacobian(model, seen)
        # The root's rows are carried by the ground: least-norm forces at the feet.
        ground = np.linalg.lstsq(rows[:, 1:7].T, force[1:7], rcond=None)[0]
        torques[k] = (force - rows.T @ ground)[7:]
        data.ctrl[:] = torques[k]
        mujoco.mj_step(model, data)
    return torques, np.linalg.norm(data.qpos[1:4] - motion[-1, 1:4]), data.ncon


def time_calls(model, start, torques):
    """Microseconds of each mj_step called from Python."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start
    times = np.zeros(len(torques))
    for k, torque in enumerate(torques):
        data.ctrl[:] = torque
        begin = time.perf_counter()
        mujoco.mj_step(model, data)
        times[k] = time.perf_counter() - begin
    return times * 1e6


def time_rollout(model, start, torques):
    """Microseconds per mj_step in a loop in C++: one mean for each block of BLOCK steps."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.zeros(mujoco.mj_stateSize(model, kind))
    means = []
    for block in np.split(torques[: len(torques) // BLOCK * BLOCK], len(torques) // BLOCK):
        mujoco.mj_getState(model, data, state, kind)
        warmstart = data.qacc_warmstart.copy()
        begin = time.perf_counter()
        rollout.rollout(model, data, state[None], block[None], initial_warmstart=warmstart[None])
        means.append((time.perf_counter() - begin) / BLOCK * 1e6)
    return means


def time_nothing(model, count):
    """Microseconds of a call of the library that only looks at its argument."""
    return character.timed(lambda: mujoco.mj_isPyramidal(model), [()] * count)


def main(model_path, folder, *phases):
    model = mujoco.MjModel.from_xml_path(model_path)
    for phase in phases:
        rows = np.fromfile(f"{folder}/{phase}.f64").reshape(-1, model.nq + model.nv)
        motion, velocity = rows[:, : model.nq], rows[:, model.nq :]
        torques, offset, contacts = follow(model, motion, velocity)
        start = (motion[0], velocity[0])
        character.report("mujoco", phase, "step", time_calls(model, start, torques))
        character.report("mujoco", phase, "call", time_nothing(model, len(torques)))
        character.report("mujoco_loop", phase, "step", time_rollout(model, start, torques))
        print(f"mujoco: {phase}: {contacts} contacts, pelvis {offset * 1e3:.2f} mm off the motion", file=sys.stderr)
        if not offset < 0.05:
            sys.exit(f"mujoco: {phase}: it did not follow the motion, so the load is not the same")


if __name__ == "__main__":
    main(*sys.argv[1:])
