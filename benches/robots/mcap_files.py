"""The program of benches/robots/mcap for Python."""

import sys

from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as RosWriter

TWIST = """geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
SECOND = 1_000_000_000


def write_bytes(count):
    with open("bytes.mcap", "wb") as out:
        writer = Writer(out)
        writer.start()
        channel = writer.register_channel("/a", "text", 0)
        data = b"x" * 100
        for n in range(count):
            writer.add_message(channel, n * SECOND, data, n * SECOND, n)
        writer.finish()


def write_ros(count):
    with open("ros.mcap", "wb") as out:
        writer = RosWriter(out)
        schema = writer.register_msgdef("geometry_msgs/msg/Twist", TWIST)
        message = {"linear": {"x": 0.5, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.25}}
        for n in range(count):
            writer.write_message("/a", schema, message, n * SECOND, n * SECOND, n)
        writer.finish()


def read(path):
    count = 0
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        if path == "ros.mcap":
            for _ in reader.iter_decoded_messages():
                count += 1
        else:
            for _ in reader.iter_messages():
                count += 1
    print(count)


what, count = sys.argv[1], int(sys.argv[2])
if what == "write-bytes":
    write_bytes(count)
elif what == "write-ros":
    write_ros(count)
else:
    read("bytes.mcap" if what == "read-bytes" else "ros.mcap")
