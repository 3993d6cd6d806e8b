#!/usr/bin/env bash
# Starts the simulated copter and its executive: examples/copter/run.sh [OPTION OF copter.py…]
# With --install alone, it installs the simulator, as the first run does.
# SIGTERM or Ctrl-C ends both, the executive first, which has the copter return.
set -euo pipefail
cd "$(dirname "$0")"
venv=${COPTER_VENV:-.venv}
port=${COPTER_PORT:-14550}
eslvm=${ESLVM:-eslvm}

if ! "$venv/bin/python" -c 'import jsbsim, pymavlink' 2>/dev/null; then
    echo "installing the simulator into $venv"
    python3 -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet jsbsim==1.3.3 pymavlink==2.4.50
fi

if [ "${1:-}" = --install ]; then
    exit
fi
if ! command -v "$eslvm" >/dev/null; then
    echo "$eslvm is not there: cargo install --path commands/eslvm --features robots" >&2
    exit 1
fi

"$venv/bin/python" -B copter.py --port "$port" "$@" &
copter=$!
trap 'kill "$copter" 2>/dev/null; wait "$copter" 2>/dev/null || true' EXIT
"$eslvm" run --allow-net=127.0.0.1 ${EXECUTIVE_OPTIONS:-} fly.esl "$port" &
executive=$!
trap 'kill -TERM "$executive" 2>/dev/null || true' TERM INT
status=0
# A signal interrupts `wait`: the executive then still needs time to have the copter return.
while kill -0 "$executive" 2>/dev/null; do
    wait "$executive" && status=0 || status=$?
done
exit "$status"
