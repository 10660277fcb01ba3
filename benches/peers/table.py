"""Puts the measured lines `WHO PHASE PART min median p99` side by side.

Usage: table.py TIMES.txt DOCUMENT.md LINE...

Over the rounds: the least minimum, the middle of the medians, the middle of the 99th percentiles. Prints the table and
writes it, with the given lines above it, between the markers in the document. Standard library only.
"""

import pathlib
import statistics
import sys
from collections import defaultdict

BEGIN, END = "<!-- peers:begin -->", "<!-- peers:end -->"
ALL, ONE = ("standing", "spinning", "swaying"), ("swaying",)

# Title, our part, peer, its part, calls from Python in it, phases.
ROWS = [
    ("whole tick / MuJoCo `mj_step`", "tick", "mujoco", "step", 1, ALL),
    ("whole tick / the same in a C++ loop, means of 50", "tick", "mujoco_loop", "step", 0, ALL),
    ("physics step / MuJoCo `mj_step`", "step", "mujoco", "step", 1, ALL),
    ("physics step / the same in a C++ loop, means of 50", "step", "mujoco_loop", "step", 0, ALL),
    ("physics step / DART `World.step`", "step", "dart", "step", 1, ("standing",)),
    ("momentum solve / TSID", "solve", "tsid", "solve", 3, ALL),
    ("kinematics / Pinocchio `forwardKinematics(q, v, a)`", "kinematics", "pinocchio", "kinematics", 1, ONE),
    ("mass matrix / Pinocchio `crba`", "mass_matrix", "pinocchio", "mass_matrix", 1, ONE),
    ("inverse dynamics / Pinocchio `rnea`", "inverse_dynamics", "pinocchio", "inverse_dynamics", 1, ONE),
    ("bias / Pinocchio `nonLinearEffects`", "bias", "pinocchio", "bias", 1, ONE),
    ("J and dJ/dt q̇ of both feet / Pinocchio", "feet", "pinocchio", "feet", 6, ONE),
    ("all of these / Pinocchio `computeAllTerms` and feet", "all_terms", "pinocchio", "all_terms", 6, ONE),
]
HEAD = [
    "| ours / theirs | phase | ours, us | theirs, us | call, us | ratio of minima | of medians | of medians less calls |",
    "|---|---|---|---|---|---|---|---|",
]


def summary(path):
    """(who, phase, part) to (least minimum, middle median, middle 99th percentile)."""
    rounds = defaultdict(list)
    for line in pathlib.Path(path).read_text().splitlines():
        who, phase, part, *values = line.split()
        rounds[who, phase, part].append([float(value) for value in values])
    middle = statistics.median_low
    return {key: (min(lows), middle(medians), middle(highs)) for key, (lows, medians, highs) in
            ((key, zip(*values)) for key, values in rounds.items())}


def row(times, title, part, peer, peer_part, calls, phase):
    ours, theirs = times["ours", phase, part], times.get((peer, phase, peer_part))
    show = lambda values: " / ".join(f"{value:.2f}" if value < 10 else f"{value:.1f}" for value in values)
    if theirs is None:
        return f"| {title} | {phase} | {show(ours)} | not here | | | | |"
    call = times.get((peer, phase, "call"), (0.0, 0.0, 0.0))[1]
    ratio = lambda value: f"{value:.2f}" if value > 0.1 else f"{value:.3f}"
    low, middle, less = ratio(ours[0] / theirs[0]), ratio(ours[1] / theirs[1]), ratio(ours[1] / (theirs[1] - calls * call))
    cost = f"{calls} x {call:.2f}" if calls else "none"
    return f"| {title} | {phase} | {show(ours)} | {show(theirs)} | {cost} | {low} | **{middle}** | {less} |"


def main(path, document, *lines):
    times = summary(path)
    table = [row(times, *fixed, phase) for *fixed, phases in ROWS for phase in phases]
    text = "\n".join([" ".join(lines), "", *HEAD, *table])
    print(text)
    document = pathlib.Path(document)
    before, rest = document.read_text().split(BEGIN)
    after = rest.split(END)[1]
    document.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}")


if __name__ == "__main__":
    main(*sys.argv[1:])
