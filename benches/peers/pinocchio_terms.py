"""Times Pinocchio's algorithms on the shipped character in the states of our motion.

Usage: pinocchio_terms.py DIR PHASE...

The model is built hinge by hinge from our model file, with the joint types Pinocchio is fastest with, and must give the
golden mass matrix, bias and inverse dynamics to 1e-9 before anything is timed. Every call goes through Python;
the part `call` is a Pinocchio call with the same arguments that does next to nothing.
"""

import sys

import numpy as np
import pinocchio as pin

import character

TOLERANCE = 1e-9  # relative to max(1, |value|)
AXES = {(1, 0, 0): pin.JointModelRX, (0, 1, 0): pin.JointModelRY, (0, 0, 1): pin.JointModelRZ}


def build():
    """The model, its hinges in the order of our file, and the joints that carry the feet."""
    model, carrier = pin.Model(), {}
    model.gravity.linear = np.array([0, 0, -9.81])
    armature = []
    for body in character.bodies():
        place = pin.SE3(np.eye(3), body.position)
        if body.parent:
            joint = carrier[body.parent]
            for name, axis, extra in body.joints:
                joint = model.addJoint(joint, AXES[tuple(axis.astype(int))](), place, name)
                place = pin.SE3.Identity()
                armature.append(extra)
        else:
            joint = model.addJoint(0, pin.JointModelFreeFlyer(), place, "root")
        model.appendBodyToJoint(joint, pin.Inertia(body.mass, body.com, np.diag(body.inertia)), pin.SE3.Identity())
        carrier[body.name] = joint
    model.armature[6:] = armature
    return model, [carrier["foot_l"], carrier["foot_r"]]


def converted(qpos, qvel):
    """Our state in Pinocchio's convention: quaternion x y z w, root velocity in root axes."""
    q = np.concatenate([qpos[:3], qpos[4:7], qpos[3:4], qpos[7:]])
    v = qvel.copy()
    v[:3] = character.rotation(qpos[3:7]).T @ qvel[:3]
    return q, v


def check(model):
    """Stops unless this is the same character."""
    data = model.createData()
    worst = 0.0
    for index in range(6):
        qpos, qvel, qdd, bias, inverse, mass = character.golden(index)
        q, v = converted(qpos, qvel)
        to_root = np.eye(character.DOF)
        to_root[:3, :3] = character.rotation(qpos[3:7]).T
        theirs = np.triu(pin.crba(model, data, q))
        theirs = theirs + np.triu(theirs, 1).T
        # d/dt(Rᵀ v) = Rᵀ v̇ - ω × Rᵀ v
        a = to_root @ qdd
        a[:3] -= np.cross(v[3:6], v[:3])
        still = np.zeros(character.DOF)
        still[:3] = -np.cross(v[3:6], v[:3])
        pairs = [
            (to_root.T @ theirs @ to_root, mass),
            (to_root.T @ pin.rnea(model, data, q, v, still), bias),
            (to_root.T @ pin.rnea(model, data, q, v, a), inverse),
        ]
        worst = max(worst, *(np.max(abs(x - y) / np.maximum(1, abs(y))) for x, y in pairs))
    print(f"pinocchio: M, bias, inverse dynamics at 6 golden states to {worst:.1e}", file=sys.stderr)
    if not worst < TOLERANCE:
        sys.exit(f"pinocchio: not the same model, {worst:.1e} apart")


def main(folder, *phases):
    model, feet = build()
    check(model)
    data = model.createData()
    still = np.zeros(character.DOF)
    acceleration = np.full(character.DOF, 0.1)
    axes = pin.LOCAL_WORLD_ALIGNED

    def foot_rows(q, v):
        pin.forwardKinematics(model, data, q, v, still)
        for foot in feet:
            pin.getJointJacobian(model, data, foot, axes)
            pin.getClassicalAcceleration(model, data, foot, axes)

    def feet_alone(q, v):
        pin.computeJointJacobians(model, data, q)
        foot_rows(q, v)

    def all_terms(q, v):
        pin.computeAllTerms(model, data, q, v)
        foot_rows(q, v)

    parts = {
        "call": lambda q, v: pin.isNormalized(model, q),
        "kinematics": lambda q, v: pin.forwardKinematics(model, data, q, v, still),
        "mass_matrix": lambda q, v: pin.crba(model, data, q),
        "inverse_dynamics": lambda q, v: pin.rnea(model, data, q, v, acceleration),
        "bias": lambda q, v: pin.nonLinearEffects(model, data, q, v),
        "feet": feet_alone,
        "all_terms": all_terms,
    }
    for phase in phases:
        states = [converted(*row) for row in zip(*character.motion(folder, phase))][::2]
        for part, work in parts.items():
            character.report("pinocchio", phase, part, character.timed(work, states))


if __name__ == "__main__":
    main(*sys.argv[1:])
