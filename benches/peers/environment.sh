# Sourced by run.sh and cross_engine.sh: Python environments with the pinned peers, in a scratch folder.
# shellcheck shell=sh disable=SC2034,SC2094,SC2154 # names shared with the scripts; pip only reads the constraints

scratch=${TMPDIR:-/tmp}/otolith-peers
venv=$scratch/venv
venv_tsid=$scratch/venv-tsid

# environment FOLDER REQUIREMENTS: installs what can be installed; a peer that cannot is named and left out.
environment() {
    [ -x "$1/bin/python" ] || python3 -m venv "$1"
    if cmp -s "$2" "$1/installed.txt"; then return; fi
    while read -r package; do
        "$1/bin/pip" install --quiet --disable-pip-version-check --only-binary :all: --constraint "$2" "$package" </dev/null ||
            echo "not here: $package could not be installed" >&2
    done <"$2"
    cp "$2" "$1/installed.txt"
}

# executable BENCH: builds it and prints its path (`cargo bench --no-run` names what it built).
executable() {
    path=$(cd "$root" && cargo bench --no-run --bench "$1" 2>&1 | sed -n 's/.*Executable.*(\(.*\))$/\1/p')
    case $path in
    '') echo "cargo bench --no-run --bench $1 failed" >&2 && return 1 ;;
    /*) echo "$path" ;;
    *) echo "$root/$path" ;;
    esac
}

machine() {
    echo "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -n 1), $(nproc) CPUs, $(uname -sm), $(rustc --version | cut -d ' ' -f 1-2)"
}

# versions FOLDER NAME...: the named packages as they are installed.
versions() {
    folder=$1
    shift
    for name in "$@"; do
        "$folder/bin/pip" --disable-pip-version-check list --format=freeze 2>/dev/null | grep -i "^$name==" | sed 's/==/ /' || true
    done | paste -s -d , - | sed 's/,/, /g'
}
