"""Times TSID's whole-body inverse dynamics on the shipped character in the states of our motion.

Usage: tsid_solve.py DIR PHASE...

The same class of problem as our momentum controller: floating base, two static foot contacts of four points with
friction cones (TSID: pyramids), tasks for the centre of mass, the angular momentum and the posture, joint torques as
the answer. Part `solve` is computeProblemData, the quadratic programme (eiquadprog) and the torques, called from
Python; part `call` is a TSID call that does next to nothing, and `solve` makes three of them.
"""

import glob
import os
import pathlib
import sys
import sysconfig

import numpy as np

LIBRARIES = pathlib.Path(sysconfig.get_paths()["purelib"], "cmeel.prefix", "lib")


path = os.environ.get("LD_LIBRARY_PATH", "")
if str(LIBRARIES) not in path.split(":"):
    os.environ["LD_LIBRARY_PATH"] = f"{LIBRARIES}:{path}"
    os.execv(sys.executable, [sys.executable, *sys.argv])
# The wheel of TSID 1.7.1 leaves its compiled module where `import tsid` does not find it.
sys.path += glob.glob(str(LIBRARIES / "python3*/site-packages/tsid"))

import pinocchio as pin  # noqa: E402 (its libraries must be found first)
import tsid_pywrap as tsid  # noqa: E402

import character  # noqa: E402
import pinocchio_terms  # noqa: E402

FRICTION, LEAST_FORCE, LARGEST_FORCE = 0.707, 8.0, 2000.0


def contact_points(name):
    (foot,) = [body for body in character.bodies() if body.name == name]
    return np.array([position - [0, 0, radius] for _, position, radius in foot.spheres]).T


class Problem:
    def __init__(self, start):
        model, feet = pinocchio_terms.build()
        pinocchio_terms.check(model)
        for name, joint in zip(("foot_l", "foot_r"), feet):
            model.addFrame(pin.Frame(name, joint, 0, pin.SE3.Identity(), pin.FrameType.BODY))
        self.robot = tsid.RobotWrapper(model, tsid.FLOATING_BASE_SYSTEM, False)
        self.formulation = tsid.InverseDynamicsFormulationAccForce("tsid", self.robot, False)
        self.formulation.computeProblemData(0.0, *start)
        data = self.formulation.data()
        self.contacts = [self.contact(name, data) for name in ("foot_l", "foot_r")]
        # Gains of our own controller: 11 and 6.63, 100 and 20.
        com = tsid.TaskComEquality("com", self.robot)
        com.setKp(11.0 * np.ones(3))
        com.setKd(6.63 * np.ones(3))
        momentum = tsid.TaskAMEquality("momentum", self.robot)
        momentum.setKp(np.zeros(3))
        momentum.setKd(np.ones(3))
        posture = tsid.TaskJointPosture("posture", self.robot)
        posture.setKp(100.0 * np.ones(character.JOINTS))
        posture.setKd(20.0 * np.ones(character.JOINTS))
        for task, weight in ((com, 1.0), (momentum, 0.1), (posture, 0.03)):
            self.formulation.addMotionTask(task, weight, 1, 0.0)
        com.setReference(tsid.TrajectoryEuclidianConstant("com", self.robot.com(data)).computeNext())
        posture.setReference(tsid.TrajectoryEuclidianConstant("posture", start[0][7:]).computeNext())
        momentum.setReference(tsid.TrajectorySample(3))
        self.tasks = (com, momentum, posture)
        self.solver = tsid.SolverHQuadProgFast("quadratic programme")
        sizes = (self.formulation.nVar, self.formulation.nEq, self.formulation.nIn)
        self.solver.resize(*sizes)
        print("tsid: {} variables, {} equalities, {} inequalities".format(*sizes), file=sys.stderr)

    def contact(self, name, data):
        contact = tsid.Contact6d(name, self.robot, name, contact_points(name), np.array([0, 0, 1.0]), FRICTION,
                                 LEAST_FORCE, LARGEST_FORCE)
        contact.setKp(np.zeros(6))
        contact.setKd(20.0 * np.ones(6))
        contact.setReference(self.robot.framePosition(data, self.robot.model().getFrameId(name)))
        self.formulation.addRigidContact(contact, 1e-5)
        return contact

    def solve(self, q, v):
        solution = self.solver.solve(self.formulation.computeProblemData(0.0, q, v))
        return solution.status, self.formulation.getActuatorForces(solution)


def main(folder, *phases):
    standing = character.motion(folder, phases[0])
    problem = Problem(pinocchio_terms.converted(standing[0][0], standing[1][0]))
    for phase in phases:
        states = [pinocchio_terms.converted(*row) for row in zip(*character.motion(folder, phase))][::2]
        character.report("tsid", phase, "solve", character.timed(problem.solve, states))
        character.report("tsid", phase, "call", character.timed(lambda q, v: problem.formulation.nVar, states))
        unsolved = sum(problem.solve(*state)[0] != 0 for state in states[::10])
        if unsolved:
            sys.exit(f"tsid: {phase}: {unsolved} of {len(states[::10])} problems not solved")


if __name__ == "__main__":
    main(*sys.argv[1:])
