"""The shipped character and the recorded motion, for peers that do not read our model file themselves."""

import json
import pathlib
import time
import xml.etree.ElementTree as xml
from dataclasses import dataclass

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
MODEL = ROOT / "configs/characters/standing.xml"
JOINTS, DOF = 35, 41


@dataclass
class Body:
    name: str
    parent: str  # "" for the root
    position: np.ndarray
    mass: float
    com: np.ndarray
    inertia: np.ndarray  # diagonal, about the centre of mass
    joints: list  # (name, axis, armature)
    spheres: list  # (name, position, radius): the points that touch the ground


def numbers(text):
    return np.array([float(word) for word in text.split()])


def bodies():
    """All bodies of the character, depth first, as in the file."""
    found = []

    def walk(node, parent):
        inertial = node.find("inertial")
        joints = [(j.get("name"), numbers(j.get("axis")), float(j.get("armature"))) for j in node.findall("joint")]
        touching = [g for g in node.findall("geom") if g.get("name", "").startswith("c")]
        spheres = [(g.get("name"), numbers(g.get("pos")), float(g.get("size"))) for g in touching]
        body = Body(node.get("name"), parent, numbers(node.get("pos")), float(inertial.get("mass")),
                    numbers(inertial.get("pos")), numbers(inertial.get("diaginertia")), joints, spheres)
        found.append(body)
        for child in node.findall("body"):
            walk(child, body.name)

    roots = [b for b in xml.parse(MODEL).getroot().find("worldbody") if b.tag == "body" and b.find("freejoint") is not None]
    walk(roots[0], "")
    return found


def golden(index):
    """A golden state: configuration, velocity, acceleration, mass matrix, bias, inverse dynamics."""
    data = json.loads((ROOT / f"tests/golden/dynamics/state_{index}.json").read_text())
    mass = np.zeros((DOF, DOF))
    for i, row in enumerate(data["M"]):
        mass[i, : i + 1] = mass[: i + 1, i] = row
    fields = [np.array(data[key]) for key in ("qpos", "qvel", "qdd", "bias", "inverse_dynamics")]
    return (*fields, mass)


def motion(folder, phase):
    """Configurations (42) and velocities (41) of one phase as seen by someone who turns with the platform.

    Static contact then means feet at rest, which is what peers without a moving ground can be asked for.
    """
    rows = np.fromfile(f"{folder}/{phase}.f64").reshape(-1, 2 + 42 + 41)
    rate, configuration, velocity = rows[:, 43], rows[:, 1:43], rows[:, 44:].copy()
    axis = np.zeros((len(rows), 3))
    axis[:, 2] = rate
    velocity[:, :3] -= np.cross(axis, configuration[:, :3])
    for k, quaternion in enumerate(configuration[:, 3:7]):
        velocity[k, 3:6] -= rotation(quaternion).T @ axis[k]
    return configuration, velocity


def rotation(quaternion):
    """Body-to-world matrix of a unit quaternion w x y z."""
    w, v = quaternion[0], quaternion[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def timed(work, arguments):
    """Microseconds of `work(*a)` for each a of `arguments`."""
    times = np.empty(len(arguments))
    for k, argument in enumerate(arguments):
        begin = time.perf_counter_ns()
        work(*argument)
        times[k] = time.perf_counter_ns() - begin
    return times * 1e-3


def report(who, phase, part, times):
    """The line `WHO PHASE PART min median p99` that `table.py` reads."""
    low, median, high = np.percentile(times, [0, 50, 99])
    print(f"{who} {phase} {part} {low:.3f} {median:.3f} {high:.3f}", flush=True)
