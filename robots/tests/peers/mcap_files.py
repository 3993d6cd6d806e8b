"""Files of MCAP by the libraries of others: `write FOLDER` writes some in every form, `read FILE` prints the messages
of one, and `bag FOLDER` writes a bag of rosbag2 of two files."""

import json
import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap.well_known import SchemaEncoding
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as RosWriter

SECOND = 1_000_000_000

STRING = "string data"
RANGE = """std_msgs/Header header
float32 radiation
float32[] ranges
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def write_forms(folder):
    """Writes a file in each compression, without chunks, and without indexes, with the same messages."""
    forms = {
        "zstd": {"compression": CompressionType.ZSTD},
        "lz4": {"compression": CompressionType.LZ4},
        "none": {"compression": CompressionType.NONE},
        "loose": {"use_chunking": False},
        "bare": {
            "index_types": IndexType.NONE,
            "use_statistics": False,
            "use_summary_offsets": False,
            "repeat_channels": False,
            "repeat_schemas": False,
        },
        "nosums": {"enable_crcs": False},
    }
    for name, options in forms.items():
        with open(folder / f"{name}.mcap", "wb") as out:
            writer = Writer(out, chunk_size=500, **options)
            writer.start("ros2", "a peer")
            text = writer.register_schema("State", SchemaEncoding.JSONSchema, b'{"type":"object"}')
            state = writer.register_channel("/state", "json", text)
            raw = writer.register_channel("/raw", "bytes", 0, {"by": "a peer"})
            for n in range(50):
                data = json.dumps({"n": n, "ok": n % 2 == 0}).encode()
                writer.add_message(state, (100 + n) * SECOND, data, (100 + n) * SECOND, n)
                writer.add_message(raw, (100 + n) * SECOND + 5, bytes([n, 0, 255]), 7, n)
            writer.add_attachment(SECOND, SECOND, "a.txt", "text/plain", b"attached")
            writer.add_metadata("robot", {"name": "r2"})
            writer.finish()
    with open(folder / "ros.mcap", "wb") as out:
        writer = RosWriter(out, chunk_size=1000)
        # Types that no installation has: they are only in the file.
        strings = writer.register_msgdef("peer_msgs/msg/Text", STRING)
        ranges = writer.register_msgdef("peer_msgs/msg/Range", RANGE)
        for n in range(20):
            writer.write_message("/text", strings, {"data": f"text {n}"}, n * SECOND, n * SECOND, n)
            header = {"stamp": {"sec": n, "nanosec": 5}, "frame_id": "laser"}
            message = {"header": header, "radiation": n / 4, "ranges": [0.5, n]}
            writer.write_message("/range", ranges, message, n * SECOND + 1, n * SECOND + 1, n)
        writer.finish()


def read(path):
    """Prints what is in a file."""
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        header = reader.get_header()
        print("header", header.profile, header.library.split()[0])
        summary = reader.get_summary()
        if summary and summary.statistics:
            print("count", summary.statistics.message_count, "chunks", summary.statistics.chunk_count > 0)
        for schema, channel, message in reader.iter_messages(log_time_order=True):
            name = schema.name if schema else "-"
            if channel.message_encoding == "cdr":
                decoded = DecoderFactory().decoder_for("cdr", schema)(message.data)
                text = plain(decoded)
            else:
                text = message.data.decode()
            print(channel.topic, name, message.log_time, message.publish_time, message.sequence, text)
        for attachment in reader.iter_attachments():
            print("attachment", attachment.name, attachment.media_type, attachment.data.decode())
        for metadata in reader.iter_metadata():
            print("metadata", metadata.name, json.dumps(metadata.metadata, sort_keys=True))


def plain(message):
    """Returns a decoded message as text."""
    if hasattr(message, "__slots__"):
        fields = (f"{name}={plain(getattr(message, name))}" for name in message.__slots__)
        return "{" + " ".join(fields) + "}"
    if isinstance(message, (list, tuple)):
        return "[" + " ".join(map(plain, message)) + "]"
    if isinstance(message, float):
        return f"{message:.6g}"
    return str(message)


def write_bag(folder):
    """Writes a bag of rosbag2, and cuts its file in two by another library."""
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as BagWriter
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    battery = store.types["sensor_msgs/msg/BatteryState"]
    header = store.types["std_msgs/msg/Header"]
    time = store.types["builtin_interfaces/msg/Time"]
    import numpy

    with BagWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/battery", battery.__msgtype__, typestore=store)
        for n in range(10):
            nothing = numpy.array([], dtype=numpy.float32)
            message = battery(
                header(time(1000 + n, 0), "base"), 13.0 - n, 20.0, 1.0, 1.0, 1.0, 1.0, 0.5, 1, 1, 1, True,
                nothing, nothing, "here", "42",
            )
            stamp = (1000 + n) * SECOND
            writer.write(connection, stamp, store.serialize_cdr(message, battery.__msgtype__))
    whole = next(Path(folder).glob("*.mcap"))
    split(whole, [whole.with_name("part_0.mcap"), whole.with_name("part_1.mcap")])
    listed = (Path(folder) / "metadata.yaml").read_text()
    assert f"  - {whole.name}\n" in listed, listed
    listed = listed.replace(f"  - {whole.name}\n", "  - part_0.mcap\n  - part_1.mcap\n")
    (Path(folder) / "metadata.yaml").write_text(listed)
    whole.unlink()


def split(whole, parts):
    """Writes the messages of a file into two, by turns."""
    outputs = [open(part, "wb") for part in parts]
    writers = [Writer(out) for out in outputs]
    with open(whole, "rb") as stream:
        reader = make_reader(stream)
        channels = []
        for schema, channel, _ in list(reader.iter_messages())[:1]:
            for writer in writers:
                writer.start("ros2")
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels.append(
                    writer.register_channel(channel.topic, channel.message_encoding, number, channel.metadata)
                )
        for n, (_, _, message) in enumerate(reader.iter_messages()):
            writers[n % 2].add_message(
                channels[n % 2], message.log_time, message.data, message.publish_time, message.sequence
            )
    for writer, out in zip(writers, outputs):
        writer.finish()
        out.close()


if __name__ == "__main__":
    command, path = sys.argv[1:]
    {"write": lambda: write_forms(Path(path)), "read": lambda: read(path), "bag": lambda: write_bag(path)}[command]()
