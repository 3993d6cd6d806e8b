#!/usr/bin/env bash
# Starts the simulated arm and its executive: examples/manipulator/run.sh [OPTION OF arm.py…]
# With --install alone, it installs the simulator, as the first run does.
# SIGTERM or Ctrl-C ends both, the executive first, which stops the motors.
set -euo pipefail
cd "$(dirname "$0")"
venv=${MANIPULATOR_VENV:-.venv}
port=${MANIPULATOR_PORT:-7447}
eslvm=${ESLVM:-eslvm}

if ! "$venv/bin/python" -c 'import pybullet, zenoh_ros2_sdk' 2>/dev/null; then
    echo "installing the simulator into $venv"
    python3 -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet pybullet==3.2.7 numpy==2.4.6 zenoh-ros2-sdk==0.1.8 \
        eclipse-zenoh==1.10.2 rosbags==0.11.9
fi

if [ "${1:-}" = --install ]; then
    exit
fi
if ! command -v "$eslvm" >/dev/null; then
    echo "$eslvm is not there: cargo install --path commands/eslvm --features robots" >&2
    exit 1
fi

"$venv/bin/python" -B arm.py --port "$port" "$@" &
arm=$!
trap 'kill "$arm" 2>/dev/null; wait "$arm" 2>/dev/null || true' EXIT
"$eslvm" run --allow-net=127.0.0.1 ${EXECUTIVE_OPTIONS:-} arm.esl "$port" &
executive=$!
trap 'kill -TERM "$executive" 2>/dev/null || true' TERM INT
status=0
# A signal interrupts `wait`: the executive then still needs time to stop the motors.
while kill -0 "$executive" 2>/dev/null; do
    wait "$executive" && status=0 || status=$?
done
exit "$status"
