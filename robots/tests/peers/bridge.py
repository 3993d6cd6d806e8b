"""A robot behind zenoh-bridge-ros2dds, by eclipse-zenoh and the keys and payloads of the bridge: names without their first
slash, CDR with its header, requests without an attachment, or with the one by which two bridges know a request.

It says what it hears; `call` on its input has it call /multiply as a client behind the bridge does.
"""

import struct
import sys
import threading

import zenoh

HEADER = b"\x00\x01\x00\x00"
LOCK = threading.Lock()


def say(*words):
    """Prints a line at once: those of other threads do not come between."""
    with LOCK:
        sys.stdout.write(" ".join(map(str, words)) + "\n")
        sys.stdout.flush()


config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["tcp/127.0.0.1:{sys.argv[1]}"]')
session = zenoh.open(config)


def text_of(payload):
    (length,) = struct.unpack_from("<I", payload, 4)
    return payload[8 : 8 + length - 1].decode()


def text(value):
    data = value.encode() + b"\0"
    return HEADER + struct.pack("<I", len(data)) + data


def hear(sample):
    say("heard", sample.key_expr, text_of(sample.payload.to_bytes()), "attachment", sample.attachment is not None)
    session.put("echo", text("echo: " + text_of(sample.payload.to_bytes())))


def add(query):
    a, b = struct.unpack_from("<qq", query.payload.to_bytes(), 4)
    say("asked", query.key_expr, a, b, "attachment", query.attachment is not None)
    query.reply(query.key_expr, HEADER + struct.pack("<q", a + b))
    query.drop()


goals = {}


def send_goal(query):
    payload = query.payload.to_bytes()
    uuid, (order,) = payload[4:20], struct.unpack_from("<i", payload, 20)
    goals[uuid] = order
    say("goal", order)
    query.reply(query.key_expr, HEADER + struct.pack("<B3xiI", True, 1, 0))
    query.drop()
    session.put("fibonacci/_action/feedback", HEADER + uuid + struct.pack("<I2i", 2, 0, 1))


def get_result(query):
    uuid = query.payload.to_bytes()[4:20]

    def answer():
        query.reply(query.key_expr, HEADER + struct.pack("<b3xI3i", 4, 3, 0, 1, goals[uuid]))
        query.drop()

    # After the feedback.
    threading.Timer(0.3, answer).start()


parts = [
    session.declare_subscriber("chatter", hear),
    session.declare_queryable("add_two_ints", add),
    session.declare_queryable("fibonacci/_action/send_goal", send_goal),
    session.declare_queryable("fibonacci/_action/get_result", get_result),
]
say("ready")
for line in sys.stdin:
    # The attachment of a bridge: a word, the client, the number of the request, and the order of its bytes.
    attachment = b"rqh" + struct.pack("<QQB", 7, 1, 1)
    request = HEADER + struct.pack("<qq", 6, 7)
    for reply in session.get("multiply", payload=request, attachment=attachment, timeout=10):
        say("product", struct.unpack_from("<q", reply.ok.payload.to_bytes(), 4)[0])
