"""Kills the robot of a node at random moments, and counts what becomes of the calls under way and of the connection.

    kill.py PYTHON ESLVM [KILLS [MODE [SEED]]]

PYTHON has the package eclipse-zenoh. Each time the service call and the goal under way have to fail, and after a new robot
has come all has to go on: messages, calls, goals, and what the node has declared. It ends with 1 if they do not.
"""

import collections
import json
import pathlib
import queue
import random
import socket
import subprocess
import sys
import threading
import time

PATIENCE = 30
FOLDER = pathlib.Path(__file__).parent
python, eslvm = sys.argv[1:3]
kills = int(sys.argv[3]) if len(sys.argv) > 3 else 100
mode = sys.argv[4] if len(sys.argv) > 4 else "peer"
seed = int(sys.argv[5]) if len(sys.argv) > 5 else 1
chance = random.Random(seed)
with socket.create_server(("127.0.0.1", 0)) as free:
    port = str(free.getsockname()[1])


def start(command):
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    lines = queue.Queue()

    def read():
        for line in process.stdout:
            lines.put((time.monotonic(), line.split()))

    threading.Thread(target=read, daemon=True).start()
    return process, lines


def start_robot():
    return start([python, str(FOLDER / "peers/killed.py"), port])


robot, declared = start_robot()
node, said = start([eslvm, "run", "--allow-net=127.0.0.1", str(FOLDER / "programs/killed.esl"), port, mode])
failures = {name: collections.Counter() for name in ["topic", "service", "action"]}
slowest = {"failure": 0.0, "again": 0.0}


def take(what, since, is_enough):
    """Takes what the node says from a time on, until it is enough; counts failures."""
    deadline = time.monotonic() + PATIENCE
    while not is_enough():
        try:
            at, words = said.get(timeout=max(0, deadline - time.monotonic()))
        except queue.Empty:
            sys.exit(f"{what} after {PATIENCE} s, kill {kill}, seed {seed}: {json.dumps(failures)}")
        if at >= since and len(words) == 2:
            yield words


try:
    for kill in range(kills + 1):
        begun = time.monotonic()
        well = set()
        for name, outcome in take("it does not go on", begun, lambda: len(well) == 3):
            if outcome == "OK":
                well.add(name)
        try:
            declared.get(timeout=PATIENCE)
        except queue.Empty:
            sys.exit(f"what the node has declared is not there after {PATIENCE} s, kill {kill}, seed {seed}")
        if kill:
            slowest["again"] = max(slowest["again"], time.monotonic() - begun)
        if kill == kills:
            break
        time.sleep(chance.uniform(0, 0.7))
        killed = time.monotonic()
        robot.kill()
        robot.wait()
        failed = set()
        for name, outcome in take("a call does not fail", killed, lambda: len(failed) == 3):
            # The first failure is that of the call under way; others follow until the robot is back.
            if outcome != "OK" and name not in failed:
                failures[name][outcome] += 1
                failed.add(name)
                if name != "topic":
                    slowest["failure"] = max(slowest["failure"], time.monotonic() - killed)
        time.sleep(chance.uniform(0, 0.5))
        robot, declared = start_robot()
finally:
    robot.kill()
    node.kill()
print(json.dumps({"kills": kills, "mode": mode, "seed": seed, **failures}))
print(json.dumps({name: round(seconds, 2) for name, seconds in slowest.items()}))
