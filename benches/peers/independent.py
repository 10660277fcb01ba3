"""The independent reference of the standing study: its compiled twin, and its observer and controller as brains.

The reference is not part of this repository; `cross_engine.sh` is told where it is, copies it to a scratch folder and
builds it there.
"""

import pathlib
import subprocess
import sys

import mujoco
import numpy as np

RADIUS = 0.005  # of the contact spheres, m
SOFTNESS = 1e-4  # of our force distribution (src/balance/cone.rs)
FINER = 4
STEP_S = 1e-3


class Reference:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        sys.path.insert(0, str(folder))
        import controller
        import model
        import observer

        self.controller, self.model, self.observer = controller, model, observer

    def run(self, xml_settings=None, spin_s=15.0, **parameters):
        """Rows of the compiled twin with the columns of `cross_engine run`, feet not known (NaN)."""
        xml = self.model.mjcf(dt=STEP_S, **(xml_settings or {}))
        (self.folder / "twin.xml").write_text(xml)
        pose = self.model.nominal_pose(mujoco.MjModel.from_xml_string(xml))
        np.savetxt(self.folder / "pose.txt", pose)
        keys = dict(rpm=30, t_spin=spin_s, t_end=spin_s + 28, save=round(0.02 / STEP_S), **parameters)
        command = ["./fast", "twin.xml", "pose.txt", "pose.txt", "twin.csv", *(f"{k}={v}" for k, v in keys.items())]
        subprocess.run(command, cwd=self.folder, check=True, capture_output=True)
        t = np.genfromtxt(self.folder / "twin.csv", delimiter=",", names=True)
        # Its platform axes are those of the end of the step: turned back by one step, ours are of the start.
        back = t["omega"] * STEP_S
        turned = []
        for x, y in (("cx", "cy"), ("zx", "zy"), ("gx", "gy")):
            turned.append(np.cos(back) * t[x] - np.sin(back) * t[y])
            turned.append(np.sin(back) * t[x] + np.cos(back) * t[y])
        cx, cy, zx, zy, gx, gy = turned
        unknown = np.full(len(cx), np.nan)
        rest = [t[name] for name in ("thc", "thg", "omega", "wx", "wy", "wz")]
        return np.array([t["t"], cx, cy, t["cz"], zx, zy, gx, gy, t["gz"], *rest, unknown, unknown, unknown]).T


class Mixed:
    """A brain that takes observer and controller from us or from the reference, and can compare on equal inputs.

    `mended` moves the reference's ground forces from the centres of the contact spheres, where its last step applies them,
    to their lowest points, where its own distribution (and ours) has them.
    """

    def __init__(self, reference, ours, model, start, observer=False, controller=False, mended=False, compare_every=0):
        self.reference, self.ours, self.model = reference, ours, model
        self.take_observer, self.take_controller, self.mended = observer, controller, mended
        self.compare_every, self.count = compare_every, 0
        self.head, self.feet = model.body("head").id, [model.body(name).id for name in ("foot_l", "foot_r")]
        pose = np.concatenate([[0.0], start])
        self.momentum = reference.controller.Momentum(model, None, reference.controller.Gains(), pose)
        self.newman = self.fine = self.last = None
        self.differences = []

    def __call__(self, data, platform, gyro, force, dt):
        head = data.xmat[self.head].reshape(3, 3)
        their_gravity, their_omega, fine_gravity = self.believe(head, gyro, -force, dt)
        asked = their_gravity if self.take_observer else (np.nan,) * 3
        torques, gravity, omega = self.ours(data, platform, gyro, force, dt, asked)
        compare = self.compare_every and self.count % self.compare_every == 0
        self.count += 1
        if compare:
            raw = self.momentum(data, gravity, None, platform[1], platform[2])
            mended = raw + self.mending(data)
            softness, no_choice = self.softened(data)
            self.differences.append([
                angle_deg(gravity, their_gravity), angle_deg(gravity, fine_gravity), np.abs(omega - their_omega).max(),
                np.abs(torques - raw).max(), np.abs(torques - mended).max(), np.abs(torques - mended - softness).max(), np.abs(raw).max(), no_choice])
        if self.take_observer:
            gravity, omega = their_gravity, their_omega
        if self.take_controller:
            torques = self.momentum(data, gravity, None, platform[1], platform[2])
            if self.mended:
                torques = torques + self.mending(data)
        return torques, gravity, omega

    def believe(self, head, gyro, gif, dt):
        """The reference's belief; and, when comparing, that of the same code with inputs linear over four smaller steps."""
        start = head.T @ self.model.opt.gravity
        if self.newman is None:
            self.newman = self.reference.observer.Newman(start, dt)
            self.fine = self.reference.observer.Newman(start, dt / FINER)
        elif self.compare_every:
            for share in np.arange(1, FINER + 1) / FINER:
                self.fine.step(*(a + share * (b - a) for a, b in zip(self.last, (gyro, gif))))
        self.last = (gyro, gif)
        self.newman.step(gyro, gif)
        return head @ self.newman.g, self.newman.w.copy(), head @ self.fine.g

    def mending(self, data):
        """Torques of the ground forces' couple between the centre and the lowest point of their spheres."""
        rows, torques = np.zeros((3, self.model.nv)), np.zeros(self.model.nv)
        forces = self.momentum.dbg["F"]
        for foot, of_foot in zip(self.feet, (forces[:4], forces[4:])):
            mujoco.mj_jac(self.model, data, None, rows, data.xpos[foot], foot)
            torques += rows.T @ np.cross([0, 0, RADIUS], of_foot.sum(axis=0))
        return torques[7:]

    def softened(self, data):
        """Torques our distribution adds because it supplies the wrench only up to its softness, for least-norm forces.

        Also whether the reference's forces are the least-norm ones and inside our circular cones, so that ours must be them.
        """
        forces = self.momentum.dbg["F"]
        points = data.geom_xpos[self.momentum.pts] - [0, 0, RADIUS]
        turned = [np.cross(point - data.qpos[1:4], np.eye(3)).T for point in points]
        rows = np.vstack([np.hstack([np.eye(3)] * 8), np.hstack(turned)])
        wrench = rows @ forces.ravel()
        exact, soft = ((rows.T @ np.linalg.solve(rows @ rows.T + delta * np.eye(6), wrench)).reshape(8, 3) for delta in (0, SOFTNESS))
        inside = np.hypot(forces[:, 0], forces[:, 1]) <= 0.707 * forces[:, 2]
        torques, jacobian = np.zeros(self.model.nv), np.zeros((3, self.model.nv))
        for i, point in enumerate(points):
            mujoco.mj_jac(self.model, data, jacobian, None, point, self.feet[i // 4])
            torques -= jacobian.T @ (soft[i] - exact[i])
        return torques[7:], inside.all() and np.abs(exact - forces).max() < 1e-6


def angle_deg(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
