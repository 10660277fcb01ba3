#!/bin/sh
# This program against MuJoCo, DART, TSID and Pinocchio: same character, same states, one run, in alternating rounds so
# that all see the same machine. Prints the table and writes it into docs/performance.md. Needs Python 3 with venv and,
# the first time, a package index; a peer that cannot be installed or stops is reported and the rest still runs. Numbers
# are indicative: read the ratio, not the microseconds.
#
# Usage: benches/peers/run.sh [ROUNDS]
set -eu
rounds=${1:-5}
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
# shellcheck source=benches/peers/environment.sh
. "$here/environment.sh"
phases="standing spinning swaying"

mkdir -p "$scratch"
environment "$venv" "$here/requirements.txt"
environment "$venv_tsid" "$here/requirements-tsid.txt"
ours=$(executable peers)

export PYTHONDONTWRITEBYTECODE=1
# peer NAME PYTHON SCRIPT ARGUMENT...: what it says besides its numbers is shown in the first round.
peer() {
    name=$1
    shift
    if ! "$@" >>"$scratch/times.txt" 2>"$scratch/$name.log"; then
        echo "not here: $name: $(tail -n 1 "$scratch/$name.log")" >&2
    elif [ "$round" -eq 1 ]; then
        cat "$scratch/$name.log"
    fi
}

: >"$scratch/times.txt"
round=0
while [ "$round" -lt "$rounds" ]; do
    round=$((round + 1))
    "$ours" "$scratch" >>"$scratch/times.txt"
    # shellcheck disable=SC2086 # the phases are separate words
    {
        peer mujoco "$venv/bin/python" "$here/mj_step.py" "$root/configs/characters/standing.xml" "$scratch" $phases
        peer pinocchio "$venv/bin/python" "$here/pinocchio_terms.py" "$scratch" $phases
        peer tsid "$venv_tsid/bin/python" "$here/tsid_solve.py" "$scratch" $phases
    }
    peer dart "$venv/bin/python" "$here/dart_step.py" "$scratch"
done

"$venv/bin/python" "$here/table.py" "$scratch/times.txt" "$root/docs/performance.md" \
    "\`benches/peers/run.sh $rounds\`, $(date +%Y-%m-%d): $(machine)." \
    "Python $("$venv/bin/python" -c 'import platform; print(platform.python_version())'), $(versions "$venv" mujoco dartpy pin), TSID with $(versions "$venv_tsid" tsid pin)."
