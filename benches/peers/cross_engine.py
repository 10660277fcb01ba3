"""The spin of 30 rpm for 15 s in our program and in MuJoCo under an independent reference: how far apart, and why.

Usage: cross_engine.py OUR_EXECUTABLE REFERENCE_FOLDER DOCUMENT.md FIGURE.svg LINE...

Writes tables between the markers of the document and the figure. See cross_engine.sh.
"""

import io
import json
import pathlib
import subprocess
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402

import character  # noqa: E402
import hybrid  # noqa: E402
from independent import Mixed, Reference  # noqa: E402
from thresholds import threshold_table  # noqa: E402

T, CX, CY, CZ, ZX, ZY, GX, GY, GZ, SWAY, TILT, RATE, WX, WY, WZ, PX, PY, LIFT = range(18)
START, PLATEAU_END, STOPPED = 2.0, 17.0, 18.0
LIFTED = (21, 24)  # a foot, where the controller lets it
PHASES = {"rest": (0, 2), "spin": (2, 17), "stop ramp": (17, 18), "sway": (18, 21), "a foot lifts": LIFTED, "recovery": (24, 43)}
EXACT, TWIN = "reference, exact controller", "reference, compiled twin"
ROUNDING = 1e-9
PLAIN, LEAD_S = "turntable.filter_s=0.0", 0.001  # the reference's turntable: no filter, no lag of a step
SIGNALS = [  # name, unit, columns, factor
    ("centre of mass x", "mm", CX, 1e3), ("centre of mass y", "mm", CY, 1e3),
    ("centre of pressure x", "mm", ZX, 1e3), ("centre of pressure y", "mm", ZY, 1e3),
    ("sway", "deg", SWAY, 1), ("gravity tilt", "deg", TILT, 1),
    ("believed gravity x", "m/s²", GX, 1), ("believed gravity y", "m/s²", GY, 1),
    ("believed angular velocity x", "rad/s", WX, 1), ("believed angular velocity y", "rad/s", WY, 1),
    ("believed angular velocity z", "rad/s", WZ, 1), ("turntable rate", "rad/s", RATE, 1),
]


class Bench:
    """Everything that can be run."""

    def __init__(self, executable, folder):
        self.executable, self.reference = executable, Reference(folder)
        pose = json.loads((character.ROOT / "tests/golden/dynamics/standing_pose.json").read_text())
        self.start = np.array(pose["qpos"])

    def ours(self, *settings, spin_s=15.0, lead_s=0.0, deaf_s=0.0):
        command = [self.executable, "run", str(spin_s), str(lead_s), str(deaf_s), *settings]
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        return np.genfromtxt(io.StringIO(text), delimiter=",", skip_header=1)

    def hybrid(self, *settings, step_s=1e-3, spin_s=15.0, solref=None, compare_every=0, **theirs):
        """MuJoCo's body; returns rows and, if asked for, the differences on equal inputs."""
        model = mujoco.MjModel.from_xml_path(str(character.MODEL))
        if solref:
            model.geom_solref[:] = solref
        ours = hybrid.Ours(self.executable, settings)
        brain = ours
        if theirs or compare_every:
            brain = Mixed(self.reference, ours, model, self.start, compare_every=compare_every, **theirs)
        rows = hybrid.run(model, self.start, brain, step_s, spin_s)
        ours.close()
        return (rows, np.array(brain.differences)) if compare_every else rows


def between(rows, start, end):
    return rows[(rows[:, T] >= start) & (rows[:, T] < end)]


def peaks(rows):
    """Peak tilt and sway after the stop, deg; time of the peak sway, s after the stop; drift of the feet up to it, mm."""
    after, before = between(rows, STOPPED, 99), between(rows, 0, STOPPED)
    drift = np.hypot(*(before[:, [PX, PY]] - before[0, [PX, PY]]).T).max() * 1e3
    top = after[:, SWAY].argmax()
    return after[:, TILT].max(), after[top, SWAY], after[top, T] - STOPPED, drift


def apart(a, b, column, start=0, end=99):
    n = min(len(a), len(b))
    difference = (between(a[:n], start, end) - between(b[:n], start, end))[:, column]
    return np.nanmax(abs(difference)), np.sqrt(np.nanmean(difference**2))


def phase_table(ours, theirs):
    lines = ["| signal | " + " | ".join(f"{name}, {a} to {b} s" for name, (a, b) in PHASES.items()) + " |", "|---" * 7 + "|"]
    for name, unit, column, factor in SIGNALS:
        cells = []
        for start, end in PHASES.values():
            largest, rms = apart(ours, theirs, column, start, end)
            largest, rms = (value if value > ROUNDING else 0.0 for value in (largest, rms))
            cells.append(f"{largest * factor:.3g} / {rms * factor:.2g}")
        lines.append(f"| {name}, {unit} | " + " | ".join(cells) + " |")
    return lines


def peak_table(runs):
    lines = ["| run | peak tilt, deg | peak sway, deg | peak sway after the stop, s | range x, y after the stop, mm | tilt in the spin up to, deg | "
             "sway at 43 s, deg | feet drift up to the stop, mm |", "|---" * 8 + "|"]
    for name, rows in runs.items():
        tilt, sway, when, drift = peaks(rows)
        after, spin = between(rows, STOPPED, 99), between(rows, START, PLATEAU_END)
        ranges = np.ptp(after[:, [CX, CY]], axis=0) * 1e3
        shown = "not recorded" if np.isnan(drift) else f"{drift:.2f}"
        lines.append(f"| {name} | {tilt:.3f} | {sway:.3f} | {when:.2f} | {ranges[0]:.1f}, {ranges[1]:.1f} | {spin[:, TILT].max():.3f} | "
                     f"{rows[-1, SWAY]:.3f} | {shown} |")
    return lines


def change_table(runs, baseline, baseline_name):
    """How peaks and the distance to `baseline` move with each change."""
    lines = ["| change | peak tilt, deg | peak sway, deg | feet drift up to the stop, mm | sole lifts up to, mm | "
             f"sway apart from {baseline_name} up to the stop, deg (max / rms) | 18 to 21 s | 21 to 24 s | 24 to 43 s |", "|---" * 9 + "|"]
    for name, rows in runs.items():
        tilt, sway, _, drift = peaks(rows)
        if rows[-1, T] < baseline[-1, T] - 0.1:
            lines.append(f"| {name} | falls at {rows[-1, T]:.1f} s | | | | | | | |")
            continue
        parts = [apart(rows, baseline, SWAY, *span) for span in ((0, STOPPED), (STOPPED, LIFTED[0]), LIFTED, (LIFTED[1], 99))]
        cells = " | ".join(f"{largest:.4f} / {rms:.4f}" for largest, rms in parts)
        known = ["" if np.isnan(value) else f"{value:.2f}" for value in (drift, rows[:, LIFT].max() * 1e3)]
        lines.append(f"| {name} | {tilt:.3f} | {sway:.3f} | {known[0]} | {known[1]} | {cells} |")
    return lines


def equal_input_table(runs):
    lines = ["| on equal inputs, our setting | quantity | largest | middle |", "|---" * 4 + "|"]
    for title, differences in runs.items():
        held, fine, omega, raw, mended, softened, scale, least = differences.T
        free, forced = least > 0, least == 0
        quantities = [
            ("believed gravity, deg", held, 1), ("the same, reference in steps four times finer, inputs linear", fine, 1),
            ("believed angular velocity, rad/s", omega, 1), ("torques, N m", raw, 1),
            (f"torques, couple mended, {free.sum()} ticks without a choice of forces", mended[free], free.any()),
            ("the same, and our distribution's softness taken off", softened[free], free.any() and title.startswith("least force 0 N")),
            (f"torques, couple mended, {forced.sum()} ticks with a choice", mended[forced], forced.any()),
        ]
        for name, values, known in quantities:
            if known:
                lines.append(f"| {title} | {name} | {values.max():.2g} | {np.median(values):.2g} |")
        lines.append(f"| {title} | size of the torques, N m | {scale.max():.3g} | {np.median(scale):.3g} |")
    return lines


def figure(runs, path):
    plt.rcParams.update({"svg.fonttype": "none", "font.size": 8, "svg.hashsalt": "cross-engine", "axes.grid": True, "grid.alpha": 0.3})
    styles = [("#56B4E9", "-", 2.4), ("#D55E00", "--", 1.2), ("#000000", ":", 1.2), ("#009E73", "-.", 1.0)]  # Okabe-Ito
    panels = [("sway, deg", SWAY, 1), ("gravity tilt, deg", TILT, 1), ("centre of mass forward, mm", CX, 1e3),
              ("centre of mass left, mm", CY, 1e3), ("centre of pressure left, mm", ZY, 1e3), ("highest point of a sole, mm", LIFT, 1e3)]
    drawing, axes = plt.subplots(4, 2, figsize=(9, 10), sharex=True, layout="constrained")
    for axis, (label, column, factor) in zip(axes.flat, panels):
        for (name, rows), (colour, dash, width) in zip(runs.items(), styles):
            axis.plot(rows[:, T], rows[:, column] * factor, color=colour, linestyle=dash, linewidth=width, label=name)
        axis.set_ylabel(label)
    ours, *others = runs.values()
    for axis, column, label in ((axes[3, 0], SWAY, "sway, minus ours, deg"), (axes[3, 1], TILT, "tilt, minus ours, deg")):
        for other, (colour, dash, width) in zip(others, styles[1:]):
            axis.plot(ours[:, T], other[:, column] - ours[:, column], color=colour, linestyle=dash, linewidth=width)
        axis.set_ylabel(label)
        axis.set_xlabel("time, s")
    for axis in axes.flat:
        axis.axvspan(START, STOPPED, color="#999999", alpha=0.15, linewidth=0)
        axis.axvspan(*LIFTED, color="#F0E442", alpha=0.2, linewidth=0)
        axis.margins(x=0)
    drawing.align_ylabels()
    drawing.get_layout_engine().set(wspace=0.04)
    drawing.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False, handlelength=4)
    drawing.savefig(path, metadata={"Date": None})


def write(document, blocks):
    path = pathlib.Path(document)
    text = path.read_text()
    for name, lines in blocks.items():
        begin, end = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
        before, rest = text.split(begin)
        text = f"{before}{begin}\n" + "\n".join(lines) + f"\n{end}" + rest.split(end)[1]
    path.write_text(text)


def engine_runs(bench, unanchored, anchored, in_mujoco, stiff):
    """Our observer and controller throughout; only the engine and its contacts change."""
    return {
        "our engine without anchors, turntable as the reference's": unanchored,
        "with anchors": anchored,
        "with anchors, contact rows 1000 times softer (0.1)": bench.ours(PLAIN, "contact.relative_compliance=0.1", lead_s=LEAD_S),
        "MuJoCo, contacts of the model file (solref 4 ms)": in_mujoco,
        "MuJoCo, solref 2 ms": stiff,
        "MuJoCo, solref 8 ms": bench.hybrid(solref=(0.008, 1)),
        "MuJoCo, solref 12 ms": bench.hybrid(solref=(0.012, 1)),
        "MuJoCo, step 0.25 ms": bench.hybrid(step_s=2.5e-4),
        "MuJoCo, step 0.25 ms, solref 1 ms": bench.hybrid(step_s=2.5e-4, solref=(0.001, 1)),
    }


def brain_runs(bench, exact, twin, their_observer, in_mujoco, without_least):
    """MuJoCo throughout; only observer and controller change."""
    return {
        EXACT: exact,
        "the same, couple mended": bench.hybrid(observer=True, controller=True, mended=True),
        "our observer, their exact controller": bench.hybrid(controller=True),
        "their observer, our controller, 0.2 N": their_observer,
        "our observer, our controller, 0.2 N": in_mujoco,
        "the same, least force 0 N": without_least,
        "the same, least force 2 N": bench.hybrid("balance.least_point_force=2.0"),
        TWIN: twin,
    }


def twin_runs(bench, twin):
    return {
        "compiled twin as it is": twin,
        "least-squares forces without cones": bench.reference.run(cone=0),
        "head acceleration by differences": bench.reference.run(fd=1),
        "solref 2 ms": bench.reference.run(dict(solref="0.002 1")),
    }


def own_runs(bench, ours, anchored):
    return {
        "ours as it is (least force 0.2 N)": ours,
        "chair not heard in the first second": bench.ours(deaf_s=1.0),
        "turntable without its 20 ms filter": bench.ours(PLAIN),
        "and 1 ms ahead: the reference's turntable": anchored,
        "least force 0 N": bench.ours("balance.least_point_force=0.0"),
        "least force 1 N": bench.ours("balance.least_point_force=1.0"),
        "least force 2 N": bench.ours("balance.least_point_force=2.0"),
        "least force 5 N": bench.ours("balance.least_point_force=5.0"),
    }


def main(executable, folder, document, drawing, *lines):
    bench = Bench(executable, folder)
    ours, twin = bench.ours(), bench.reference.run()
    exact = bench.hybrid(observer=True, controller=True)
    without_least, differences = bench.hybrid("balance.least_point_force=0.0", compare_every=20)
    in_mujoco, default_differences = bench.hybrid(compare_every=20)
    equal = {"least force 0 N, as the reference": differences, "least force 0.2 N, default": default_differences}
    anchored = bench.ours(PLAIN, lead_s=LEAD_S)
    unanchored = bench.ours(PLAIN, "contact.anchor_gain=0.0", lead_s=LEAD_S)
    their_observer = bench.hybrid(observer=True)
    stiff = bench.hybrid(solref=(0.002, 1))
    chain = {
        EXACT: exact,
        "with our controller, least force 0.2 N from here on": their_observer,
        "and our observer": in_mujoco,
        "and contacts twice as stiff (solref 2 ms)": stiff,
        "our engine instead of MuJoCo, without anchors": unanchored,
        "and with anchors": anchored,
        "and the turntable's filter: ours": ours,
    }
    four = {"ours": ours, EXACT: exact, TWIN: twin, "our brain in MuJoCo": in_mujoco}
    figure(four, drawing)
    blocks = {
        "run": lines, "peaks": peak_table(four), "phases-exact": phase_table(ours, exact), "phases-twin": phase_table(ours, twin),
        "chain": change_table(chain, ours, "ours"), "equal-inputs": equal_input_table(equal),
        "engine": change_table(engine_runs(bench, unanchored, anchored, in_mujoco, stiff), unanchored, "our engine without anchors"),
        "brain": change_table(brain_runs(bench, exact, twin, their_observer, in_mujoco, without_least), exact, "the exact controller"),
        "twin": change_table(twin_runs(bench, twin), twin, "the twin"),
        "own": change_table(own_runs(bench, ours, anchored), ours, "ours"),
        "thresholds": threshold_table(bench),
    }
    write(document, blocks)
    for name, block in blocks.items():
        print(f"\n{name}", *block, sep="\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
