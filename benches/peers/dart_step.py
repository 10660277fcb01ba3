"""Times DART's world step on the shipped character standing on its eight points.

Usage: dart_step.py DIR

The hinge block of DART's mass matrix must equal the golden one to 1e-9. A computed-torque controller holds the
standing pose (first row of DIR/standing.f64) once, and its torques are kept; the timed run replays them, so that nothing
but World.step is timed, called from Python. By default DART puts a body at rest to sleep, and the step then costs
nothing: deactivation is switched off here. Only `standing`: the ground of this peer does not turn.
"""

import sys

import dartpy as dart
import numpy as np

import character

STEP_S = 1e-3
STEPS = 2000
STIFFNESS, DAMPING = 400.0, 40.0  # 1/s2, 1/s
FRICTION = 1.0


def inertia(body):
    return dart.dynamics.Inertia(body.mass, body.com, np.diag(body.inertia))


def placed(position):
    transform = dart.math.Isometry3()
    transform.set_translation(position)
    return transform


def joint_of(skeleton, parent, body):
    """The joint and body node of `body`: one DART joint for all its hinges, which turn in file order."""
    axes = [axis for _, axis, _ in body.joints]
    if not body.parent:
        return skeleton.createFreeJointAndBodyNodePair()
    if len(axes) == 1:
        joint, node = skeleton.createRevoluteJointAndBodyNodePair(parent)
        joint.setAxis(axes[0])
    elif len(axes) == 2:
        joint, node = skeleton.createUniversalJointAndBodyNodePair(parent)
        joint.setAxis1(axes[0])
        joint.setAxis2(axes[1])
    else:
        joint, node = skeleton.createEulerJointAndBodyNodePair(parent)  # its order is x, y, z
    joint.setTransformFromParentBodyNode(placed(body.position))
    return joint, node


def build():
    skeleton, nodes = dart.dynamics.Skeleton("character"), {}
    for body in character.bodies():
        joint, node = joint_of(skeleton, nodes.get(body.parent), body)
        joint.setName(body.name)
        node.setName(body.name)
        node.setInertia(inertia(body))
        nodes[body.name] = node
        for _, position, radius in body.spheres:
            shape = node.createShapeNode(dart.dynamics.SphereShape(radius))
            shape.setRelativeTranslation(position)
            shape.createCollisionAspect()
            shape.createDynamicsAspect().setFrictionCoeff(FRICTION)
    return skeleton


def ground():
    skeleton = dart.dynamics.Skeleton("ground")
    _, node = skeleton.createWeldJointAndBodyNodePair()
    shape = node.createShapeNode(dart.dynamics.BoxShape([4, 4, 0.2]))
    shape.setRelativeTranslation([0, 0, -0.1])
    shape.createCollisionAspect()
    shape.createDynamicsAspect().setFrictionCoeff(FRICTION)
    return skeleton


def order_of(skeleton):
    """Index of each of our hinges among DART's degrees of freedom."""
    pairs = [(skeleton.getJoint(body.name), k) for body in character.bodies() for k in range(len(body.joints))]
    return np.array([joint.getIndexInSkeleton(k) for joint, k in pairs])


def set_configuration(skeleton, order, qpos):
    q = np.zeros(skeleton.getNumDofs())
    root = placed(qpos[:3])
    root.set_rotation(character.rotation(qpos[3:7]))
    q[:6] = dart.dynamics.FreeJoint.convertToPositions(root)
    q[order] = qpos[7:]
    skeleton.setPositions(q)
    return q


def check(skeleton, order):
    worst = 0.0
    armature = np.array([extra for body in character.bodies() for _, _, extra in body.joints])
    for index in range(6):
        qpos, *_, mass = character.golden(index)
        set_configuration(skeleton, order, qpos)
        theirs = skeleton.getMassMatrix()[np.ix_(order, order)]
        worst = max(worst, abs(theirs - (mass[6:, 6:] - np.diag(armature))).max())
    print(f"dart: hinge block of M at 6 golden states to {worst:.1e}, without armature", file=sys.stderr)
    if not worst < 1e-9:
        sys.exit(f"dart: not the same model, {worst:.1e} apart")


def world_with(skeleton, standing):
    """A world in which the character stands, awake, and the pose in DART's coordinates."""
    world = dart.simulation.World()
    world.setTimeStep(STEP_S)
    world.setGravity([0, 0, -9.81])
    options = world.getDeactivationOptions()
    options.mEnabled = False
    world.setDeactivationOptions(options)
    world.addSkeleton(skeleton)
    world.addSkeleton(ground())
    return world, set_configuration(skeleton, order_of(skeleton), standing)


def torques_to_stand(skeleton, pose):
    """Computed torque towards the pose; the root's rows are carried by least-norm forces at the eight points."""
    wanted = STIFFNESS * (pose - skeleton.getPositions()) - DAMPING * skeleton.getVelocities()
    # FreeJoint: positions are rotation vector and place, velocities a twist in root axes.
    to_root = skeleton.getBodyNode("pelvis").getWorldTransform().rotation().T
    wanted[3:6] += STIFFNESS * (to_root - np.eye(3)) @ (pose - skeleton.getPositions())[3:6]
    force = skeleton.getMassMatrix() @ wanted + skeleton.getCoriolisAndGravityForces()
    points = [(body.name, at - [0, 0, radius]) for body in character.bodies() for _, at, radius in body.spheres]
    rows = np.vstack([skeleton.getLinearJacobian(skeleton.getBodyNode(name), at) for name, at in points])
    carried = np.linalg.lstsq(rows[:, :6].T, force[:6], rcond=None)[0]
    torques = force - rows.T @ carried
    torques[:6] = 0
    return torques


def main(folder):
    skeleton = build()
    check(skeleton, order_of(skeleton))
    standing = np.fromfile(f"{folder}/standing.f64")[1:43]
    world, pose = world_with(skeleton, standing)
    torques = []
    for _ in range(STEPS):
        torques.append(torques_to_stand(skeleton, pose))
        skeleton.setForces(torques[-1])
        world.step()
    skeleton = build()
    world, _ = world_with(skeleton, standing)
    times = np.empty(STEPS)
    for k, torque in enumerate(torques):
        skeleton.setForces(torque)
        times[k] = character.timed(world.step, [()])[0]
    character.report("dart", "standing", "step", times)
    character.report("dart", "standing", "call", character.timed(world.getTime, [()] * STEPS))
    contacts, offset = world.getLastCollisionResult().getNumContacts(), skeleton.getPositions()[3:6] - pose[3:6]
    offset_mm = np.linalg.norm(offset) * 1e3
    print(f"dart: {contacts} contacts, pelvis {offset_mm:.2f} mm from where it started", file=sys.stderr)
    if not offset_mm < 50 or contacts == 0:
        sys.exit("dart: it did not stand, so the load is not the same")


if __name__ == "__main__":
    main(*sys.argv[1:])
