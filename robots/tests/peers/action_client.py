"""A client of the action /fibonacci of an ESL program by eclipse-zenoh alone."""

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


def call(name, body):
    """Returns the payload of the answer."""
    attachment = struct.pack("<qqB16s", 7, 9, 16, b"c" * 16)
    for reply in session.get(f"{ACTION}/{name}/**", payload=HEADER + body, attachment=attachment, timeout=60):
        if reply.ok is None:
            return b"error"
        # The number and the name are those of the request.
        assert reply.ok.attachment.to_bytes()[:8] == struct.pack("<q", 7)
        assert reply.ok.attachment.to_bytes()[16:] == b"\x10" + b"c" * 16
        return reply.ok.payload.to_bytes()[4:]
    return b"none"


def heard(sample):
    payload = sample.payload.to_bytes()
    (count,) = struct.unpack_from("<I", payload, 20)
    say("feedback", *struct.unpack_from(f"<{count}i", payload, 24))


feedback = session.declare_subscriber(f"{ACTION}/feedback/**", heard)
# The server declares its services one by one, that of goals last.
while not any("send_goal" in str(reply.ok.key_expr) for reply in session.liveliness().get("@ros2_lv/0/*/*/*/SS/**")):
    time.sleep(0.1)
say("ready")
for line in sys.stdin:
    words = line.split()
    uuid = bytes([int(words[1])]) * 16
    if words[0] == "goal":
        accepted = call("send_goal", uuid + struct.pack("<i", int(words[2])))[0]
        say("accepted" if accepted else "rejected")
    elif words[0] == "cancel":
        say("cancel", call("cancel_goal", uuid + struct.pack("<iI", 0, 0))[0])
    elif words[0] == "result":
        answer = call("get_result", uuid)
        (count,) = struct.unpack_from("<I", answer, 4)
        say("status", answer[0], "result", *struct.unpack_from(f"<{count}i", answer, 8))
    elif words[0] == "garbage":
        for body in (b"", b"\x01", b"\xff" * 30):
            say("garbage", call("send_goal", body)[:5].decode())
