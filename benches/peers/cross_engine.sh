#!/bin/sh
# The spin of 30 rpm for 15 s in our program and in the project's independent reference in MuJoCo: same character, same
# controller equations, other engine, other code. Writes docs/cross-engine.md (between its markers) and
# docs/cross-engine.svg. Needs Python 3 with venv, a C++ compiler and, the first time, a package index.
#
# Usage: benches/peers/cross_engine.sh [REFERENCE_FOLDER]      (default: ../shared/oracle/balance beside this repository)
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
# shellcheck source=benches/peers/environment.sh
. "$here/environment.sh"
reference=${1:-$root/../shared/oracle/balance}
if [ ! -f "$reference/fast.cpp" ]; then
    echo "no reference in $reference; usage: $0 REFERENCE_FOLDER" >&2
    exit 2
fi

mkdir -p "$scratch/reference"
environment "$venv" "$here/requirements.txt"
cp "$reference"/*.py "$reference"/*.cpp "$reference"/*.sh "$scratch/reference/"
(cd "$scratch/reference" && sh build.sh "$venv/bin/python")
ours=$(executable cross_engine)

export PYTHONDONTWRITEBYTECODE=1
cd "$scratch" # where MuJoCo writes its log: its warnings are of runs that fall
"$venv/bin/python" "$here/cross_engine.py" "$ours" "$scratch/reference" "$root/docs/cross-engine.md" \
    "$root/docs/cross-engine.svg" \
    "\`benches/peers/cross_engine.sh\`, $(date +%Y-%m-%d): $(machine), $(versions "$venv" mujoco numpy)."
