"""A server of the action /fibonacci by eclipse-zenoh alone, made of the pieces that an action consists of.

The order of a goal says what becomes of it: 1 is rejected; 2 succeeds after two feedbacks; 3 is aborted; 4 goes on until
it is cancelled; 5 refuses to be cancelled, and succeeds after two seconds; 6 is accepted after a second only, and goes on
until it is cancelled; 7 ends this process.
"""

import os
import struct
import sys
import threading
import time

import zenoh

LOCK = threading.Lock()


def say(*words):
    """Prints a line at once: those of other threads do not come between."""
    with LOCK:
        sys.stdout.write(" ".join(map(str, words)) + "\n")
        sys.stdout.flush()


port = int(sys.argv[1])
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["tcp/127.0.0.1:{port}"]')
session = zenoh.open(config)
HEADER = b"\x00\x01\x00\x00"
ACTION = "0/fibonacci/_action"
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


class Goal:
    def __init__(self, order):
        self.order = order
        self.status = 0
        self.ended = threading.Event()
        self.cancelled = threading.Event()

    def end(self, status):
        self.status = status
        say("goal", self.order, {4: "succeeded", 5: "cancelled", 6: "aborted"}[status])
        self.ended.set()


goals = {}


def feedback_key():
    """Returns the key of the feedback, which the subscription of the client has in its sign of life."""
    for reply in session.liveliness().get("@ros2_lv/0/*/*/*/MS/**"):
        parts = str(reply.ok.key_expr).split("/")
        if parts[9] == "%fibonacci%_action%feedback":
            return f"{ACTION}/feedback/{parts[10]}/{parts[11]}"
    raise RuntimeError("nobody listens to the feedback")


def numbers(count):
    found = [0, 1]
    while len(found) < count:
        found.append(found[-1] + found[-2])
    return struct.pack(f"<I{count}i", count, *found[:count])


def attachment():
    return struct.pack("<qqB16s", 1, time.time_ns(), 16, b"p" * 16)


def answer(query, body):
    query.reply(query.key_expr, HEADER + body, attachment=query.attachment)
    query.drop()


def pursue(goal, uuid):
    if goal.order == 2:
        key = feedback_key()
        for count in (2, 3):
            session.put(key, HEADER + uuid + numbers(count), attachment=attachment())
            # Feedback on the goal of somebody else.
            session.put(key, HEADER + b"\x01" * 16 + numbers(9), attachment=attachment())
            time.sleep(0.2)
        goal.end(SUCCEEDED)
    elif goal.order == 3:
        goal.end(ABORTED)
    elif goal.order == 5:
        time.sleep(2)
        goal.end(SUCCEEDED)
    elif goal.order == 7:
        time.sleep(0.5)
        os._exit(1)
    else:
        goal.cancelled.wait()
        time.sleep(0.3)
        goal.end(CANCELED)


def send_goal(query):
    payload = query.payload.to_bytes()
    uuid, (order,) = payload[4:20], struct.unpack_from("<i", payload, 20)
    if order == 6:
        time.sleep(1)
    accepted = order != 1
    if accepted:
        goal = goals[uuid] = Goal(order)
    answer(query, struct.pack("<B3xiI", accepted, 1, 0))
    if accepted:
        pursue(goal, uuid)


def get_result(query):
    goal = goals[query.payload.to_bytes()[4:20]]
    goal.ended.wait()
    answer(query, struct.pack("<b3x", goal.status) + numbers(3))


def cancel_goal(query):
    uuid = query.payload.to_bytes()[4:20]
    goal = goals.get(uuid)
    code = 2 if goal is None else 1 if goal.order == 5 else 0
    say("cancel", goal.order if goal else None, code)
    if code == 0:
        body = struct.pack("<b3xI16siI", code, 1, uuid, 1, 0)
        goal.cancelled.set()
    else:
        body = struct.pack("<b3xI", code, 0)
    answer(query, body)


def in_thread(function):
    return lambda query: threading.Thread(target=function, args=(query,), daemon=True).start()


servers = [
    session.declare_queryable(f"{ACTION}/{name}/**", in_thread(function), complete=True)
    for name, function in [("send_goal", send_goal), ("get_result", get_result), ("cancel_goal", cancel_goal)]
]
# The sign of life of a server, so that it is seen.
HASH = "RIHS01_" + 64 * "0"
token = session.liveliness().declare_token(
    f"@ros2_lv/0/{session.zid()}/1/2/SS/%/%/peer/%fibonacci%_action%send_goal/"
    f"example_interfaces::action::dds_::Fibonacci_SendGoal_/{HASH}/::,10:,:,:,,"
)
say("ready")
sys.stdin.read()
