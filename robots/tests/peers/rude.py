"""A peer by eclipse-zenoh alone that breaks the rules of ROS 2, as its input says: signs of life that do not fit, payloads
that are not messages, services that never answer or answer garbage, and more than anybody can take."""

import struct
import sys
import time

import zenoh

port = int(sys.argv[1])
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["tcp/127.0.0.1:{port}"]')
session = zenoh.open(config)
STRING = "std_msgs::msg::dds_::String_"
HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
OTHER = "RIHS01_" + 63 * "0" + "1"
TRIGGER = "std_srvs::srv::dds_::Trigger_"
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
kept = []


def sign(kind, node, rest=""):
    number = len(kept) + 10
    kept.append(session.liveliness().declare_token(f"@ros2_lv/0/{session.zid()}/{number}/{number}/{kind}/%/%/{node}{rest}"))


def attachment(number):
    return struct.pack("<qqB16s", number, time.time_ns(), 16, b"r" * 16)


def text(string):
    data = string.encode() + b"\0"
    return b"\x00\x01\x00\x00" + struct.pack("<I", len(data)) + data


def put(topic, payload, number=1):
    session.put(f"0/{topic}/{STRING}/{HASH}", payload, attachment=attachment(number),
                congestion_control=zenoh.CongestionControl.BLOCK)


def serve(name, function):
    kept.append(session.declare_queryable(f"0/{name}/**", function, complete=True))
    sign("SS", "rude", f"/%{name}/{TRIGGER}/{TRIGGER_HASH}/::,10:,:,:,,")


def answer_garbage(query):
    query.reply(query.key_expr, b"\x00\x01\x00\x00\x01\xff\xff\xff\xff", attachment=query.attachment)
    query.drop()


silent = []
print("ready", flush=True)
for line in sys.stdin:
    word = line.strip()
    if word == "hash":
        sign("MP", "old", f"/%chatter/{STRING}/{OTHER}/::,10:,:,:,,")
    elif word == "type":
        sign("MP", "wrong", f"/%chatter/std_msgs::msg::dds_::Bool_/{HASH}/::,10:,:,:,,")
    elif word == "qos":
        sign("MP", "hasty", f"/%chatter/{STRING}/{HASH}/2::,10:,:,:,,")
    elif word == "twin":
        sign("NN", "executive")
    elif word == "signs":
        # Signs of life of thousands, and some that are none.
        for n in range(3000):
            sign("MP", f"n{n}", f"/%t{n}/{STRING}/{HASH}/::,10:,:,:,,")
        for part in ("", "/x", "/%chatter", f"/%chatter/{STRING}/{HASH}/zz,,"):
            sign("MP", "broken", part)
    elif word == "garbage":
        for n in range(300):
            for payload in (b"", b"\x00", b"\x09\x09\x00\x00", text("long")[:9], b"\x00\x01\x00\x00\xff\xff\xff\xffabc",
                            b"\x00\x01\x00\x00\x02\x00\x00\x00\xff\x00"):
                put("chatter", payload, n)
        put("chatter", text("behind"))
    elif word == "flood":
        large = text("x" * 1_000_000)
        end, sent = time.monotonic() + 3, 0
        while time.monotonic() < end:
            put("image", large, sent)
            sent += 1
        put("chatter", text("flooded"))
        print("sent", sent > 20, flush=True)
    elif word == "serve":
        serve("silent", silent.append)
        serve("garbage", answer_garbage)
    print("done", word, flush=True)
