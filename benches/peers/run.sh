#!/bin/sh
# One character's whole tick (sensors, observer, controller, physics) against MuJoCo's bare mj_step on the same model
# and the same motion, in alternating rounds so that both see the same machine. Needs Python 3 with venv and a network
# (or an environment with MuJoCo in $OTOLITH_PEERS_VENV). Numbers are indicative: read the ratio, not the microseconds.
#
# Usage: benches/peers/run.sh [ROUNDS]
set -eu
rounds=${1:-5}
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
scratch=${TMPDIR:-/tmp}/otolith-peers
venv=${OTOLITH_PEERS_VENV:-$scratch/venv}
model=$root/configs/characters/standing.xml
phases="standing spinning swaying"

mkdir -p "$scratch"
if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet mujoco==4.0.0
fi
# `cargo bench --no-run` names the executable it built.
ours=$(cd "$root" && cargo bench --no-run --bench peers 2>&1 | sed -n 's/.*Executable.*(\(.*\))$/\1/p')
case $ours in /*) ;; *) ours=$root/$ours ;; esac

echo "machine: $(uname -srm), $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -n 1), $(nproc) CPUs"
rustc --version
"$venv/bin/python" -c 'import sys, mujoco; print("Python", sys.version.split()[0] + ", MuJoCo", mujoco.__version__)'

: >"$scratch/ours.txt"
: >"$scratch/theirs.txt"
round=0
while [ "$round" -lt "$rounds" ]; do
    "$ours" "$scratch" >>"$scratch/ours.txt"
    # shellcheck disable=SC2086 # the phases are separate words
    "$venv/bin/python" "$here/mj_step.py" "$model" "$scratch" $phases >>"$scratch/theirs.txt"
    round=$((round + 1))
done

# Over the rounds: the least minimum, the middle of the medians, the middle of the 99th percentiles.
awk -v rounds="$rounds" '
function middle(values, n,    i, j, t) {
    for (i = 2; i <= n; i++) for (j = i; j > 1 && values[j - 1] > values[j]; j--) {
        t = values[j]; values[j] = values[j - 1]; values[j - 1] = t
    }
    return values[int((n + 1) / 2)]
}
function summary(who, phase, column,    i, list) {
    for (i = 1; i <= count[who, phase]; i++) list[i] = value[who, phase, column, i]
    return middle(list, count[who, phase])
}
{
    who = FILENAME ~ /ours/ ? "ours" : "theirs"
    i = ++count[who, $1]
    for (c = 2; c <= NF; c++) value[who, $1, c, i] = $c
    if (i == 1 || $2 < least[who, $1]) least[who, $1] = $2
    if (who == "ours" && i == 1) order[++phases] = $1
}
END {
    printf "%d rounds; microseconds; ratio = whole tick / mj_step\n", rounds
    printf "%-10s %-34s %-34s %-9s %s\n", "", "whole tick min/median/p99", "mj_step (from Python) min/median/p99", "in C++", "ratio: min, median, to C++"
    for (p = 1; p <= phases; p++) {
        n = order[p]
        o = summary("ours", n, 3); t = summary("theirs", n, 3); c = summary("theirs", n, 5)
        printf "%-10s %6.2f / %6.2f / %6.2f           %6.2f / %6.2f / %6.2f             %6.2f    %.2f, %.2f, %.2f\n", n,
            least["ours", n], o, summary("ours", n, 4), least["theirs", n], t, summary("theirs", n, 4), c,
            least["ours", n] / least["theirs", n], o / t, o / c
    }
}' "$scratch/ours.txt" "$scratch/theirs.txt"
