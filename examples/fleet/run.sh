#!/bin/sh
# Runs the mission as four processes with a store of leases, and kills one rover by SIGKILL. Needs `etcd`
# (Debian: etcd-server). Ports and speed: FLEET_PORT, FLEET_STORE, FLEET_PEERS, FLEET_SPEED.
set -eu
cd "$(dirname "$0")"
port=${FLEET_PORT:-7447}
store=http://127.0.0.1:${FLEET_STORE:-2379}
peers=http://127.0.0.1:${FLEET_PEERS:-2380}
speed=${FLEET_SPEED:-1}
data=$(mktemp -d)
processes=""
trap 'kill -9 $processes 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$data"' EXIT
trap 'exit 1' HUP INT TERM

etcd --data-dir "$data/store" --unsafe-no-fsync=true --listen-client-urls "$store" --advertise-client-urls "$store" \
    --listen-peer-urls "$peers" --initial-advertise-peer-urls "$peers" --initial-cluster "default=$peers" \
    >/dev/null 2>&1 &
processes="$processes $!"

# agent NAME PLACE: starts an agent, whose process is $started.
agent() {
    "${ESLVM:-eslvm}" run --speed "$speed" --allow-net=127.0.0.1 --allow-read=. \
        agent.esl "$1" "$2" "$port" "${store##*:}" &
    started=$!
    processes="$processes $started"
}

agent base 0
base=$started
agent rover-1 0
# The second rover is killed when it has its first sample.
mkfifo "$data/lines"
while IFS= read -r line; do
    echo "$line"
    case $line in *"has the"*) echo "killing rover-2" && kill -9 "$(cat "$data/victim")" ;; esac
done <"$data/lines" &
agent rover-2 30 >"$data/lines"
echo "$started" >"$data/victim"
agent rover-3 60
wait "$base"
