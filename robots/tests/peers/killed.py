"""A robot that is killed: a router of Zenoh with a topic, a service, an action and a client, by eclipse-zenoh alone.

/tick is published every 20 ms; /slow answers after 30 ms; a goal of /fibonacci succeeds after 100 ms. When the node of the
other side has declared its service /mine and its subscription of /tick, and answers a call, it says `declared`.
"""

import struct
import sys
import threading
import time

import zenoh

HEADER = b"\x00\x01\x00\x00"
SLOW = "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"
GOAL = "RIHS01_d1a57fb2a4afe8c21e34fb10db206f16ce6729b28531141472df92277c55b557"
RESULT = "RIHS01_1b0de0d5d29dc955d92f546706568428632771db13ec84c15ec1c1a59f424a57"
TICK = "0/tick/std_msgs::msg::dds_::String_/RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
ACTION = "0/fibonacci/_action"

config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{sys.argv[1]}"]')
config.insert_json5("scouting/multicast/enabled", "false")
begun = time.time()
while True:
    try:
        session = zenoh.open(config)
        break
    except zenoh.ZError:
        # The port of the one before is not free yet.
        if time.time() > begun + 20:
            raise
        time.sleep(0.05)


def answer(query, body, delay):
    def reply():
        query.reply(query.key_expr, HEADER + body, attachment=query.attachment)
        query.drop()

    threading.Timer(delay, reply).start()


def slow(query):
    a, b = struct.unpack_from("<qq", query.payload.to_bytes(), 4)
    answer(query, struct.pack("<q", a + b), 0.03)


def send_goal(query):
    answer(query, struct.pack("<B3xiI", True, 1, 0), 0)


def get_result(query):
    answer(query, struct.pack("<b3xI3i", 4, 3, 0, 1, 1), 0.1)


def cancel_goal(query):
    answer(query, struct.pack("<b3xI", 0, 0), 0)


def sign(number, kind, name, of_type, hash):
    return (
        f"@ros2_lv/0/{session.zid()}/1/{number}/{kind}/%/%/robot/{name.replace('/', '%')}/{of_type}/{hash}/::,10:,:,:,,"
    )


parts = [
    session.declare_queryable("0/slow/**", slow, complete=True),
    session.declare_queryable(f"{ACTION}/send_goal/**", send_goal, complete=True),
    session.declare_queryable(f"{ACTION}/get_result/**", get_result, complete=True),
    session.declare_queryable(f"{ACTION}/cancel_goal/**", cancel_goal, complete=True),
] + [
    session.liveliness().declare_token(token)
    for token in [
        sign(2, "SS", "/slow", "example_interfaces::srv::dds_::AddTwoInts_", SLOW),
        sign(3, "SS", "/fibonacci/_action/send_goal", "example_interfaces::action::dds_::Fibonacci_SendGoal_", GOAL),
        sign(4, "SS", "/fibonacci/_action/get_result", "example_interfaces::action::dds_::Fibonacci_GetResult_", RESULT),
        sign(5, "MP", "/tick", "std_msgs::msg::dds_::String_", TICK.split("/")[-1]),
    ]
]


def look():
    """Waits until all that the other side has declared is there, and says so."""
    request = HEADER + struct.pack("<qq", 6, 7)
    attachment = struct.pack("<qqB16s", 1, time.time_ns(), 16, b"r" * 16)
    while True:
        signs = [str(reply.ok.key_expr).split("/") for reply in session.liveliness().get("@ros2_lv/0/**") if reply.ok]
        seen = {(parts[5], parts[9]) for parts in signs if len(parts) > 9}
        if {("SS", "%mine"), ("MS", "%tick")} <= seen:
            hash = next(parts[11] for parts in signs if len(parts) > 9 and parts[9] == "%mine" and parts[5] == "SS")
            key = f"0/mine/example_interfaces::srv::dds_::AddTwoInts_/{hash}"
            for reply in session.get(key, payload=request, attachment=attachment, timeout=2):
                if reply.ok and struct.unpack_from("<q", reply.ok.payload.to_bytes(), 4)[0] == 42:
                    print("declared", flush=True)
                    return
        time.sleep(0.02)


threading.Thread(target=look, daemon=True).start()
text = b"tick\0"
while True:
    attachment = struct.pack("<qqB16s", 1, time.time_ns(), 16, b"t" * 16)
    session.put(TICK, HEADER + struct.pack("<I", len(text)) + text, attachment=attachment)
    time.sleep(0.02)
