"""The shortest spin at 30 rpm after which green falls, of our program and of the reference.

Found as `otolith reproduce --sensitivity` finds it, by halving a range between a recovery and a fall. A run ends early
when its character falls.
"""

RANGE_S = (15.0, 21.0)  # recovers, falls: whichever way of the table
RESOLUTION_S = 0.05
AFTER_SPIN_S = 26.0
CRITICAL = {10: 6.32, 11: 6.63, 12: 6.93}  # kp_l, 1/s², and kd_l = 2 sqrt(kp_l), 1/s
DEFAULT = 11
EXACT = "reference, exact controller"


def shortest_fall(run):
    """Of `run(spin_s)`, whose rows begin with the time."""
    recovers_s, falls_s = RANGE_S
    while falls_s - recovers_s > RESOLUTION_S:
        middle_s = 0.5 * (recovers_s + falls_s)
        if run(middle_s)[-1, 0] < 2 + middle_s + AFTER_SPIN_S - 0.1:
            falls_s = middle_s
        else:
            recovers_s = middle_s
    return falls_s


def threshold_table(bench):
    """Lines of the table. The exact controller is slow and runs with the default stiffness only."""
    def gains(kp, kd):
        return f"balance.com_stiffness={kp}.0", f"balance.com_damping={kd}"

    ways = {
        "ours": lambda kp, kd, s: bench.ours(*gains(kp, kd), spin_s=s),
        "our brain in MuJoCo": lambda kp, kd, s: bench.hybrid(*gains(kp, kd), spin_s=s),
        EXACT: lambda kp, kd, s: bench.hybrid(observer=True, controller=True, spin_s=s),
        "reference, compiled twin": lambda kp, kd, s: bench.reference.run(kp_l=kp, kd_l=kd, spin_s=s),
        "ours, least force 2 N": lambda kp, kd, s: bench.ours(*gains(kp, kd), "balance.least_point_force=2.0", spin_s=s),
    }
    lines = ["| run | " + " | ".join(f"kp_l = {kp}" for kp in CRITICAL) + " |", "|---" * (1 + len(CRITICAL)) + "|"]
    for name, run in ways.items():
        cells = []
        for kp, kd in CRITICAL.items():
            known = kp == DEFAULT or name != EXACT
            cells.append(f"{shortest_fall(lambda s: run(kp, kd, s)):.2f} s" if known else "")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines
