"""Nodes of ROS 2 by zenoh-ros2-sdk, as a robot and its tools have them: a simulator's clock, transforms, a watch of the
log and of diagnostics, and a manager of lifecycles. Does what its input says."""

import pathlib
import struct
import sys
import tempfile
import threading
import time

from zenoh_ros2_sdk.message_registry import get_registry

# Definitions without their comments, and with the constants on which the hash does not depend left out.
DEFINITIONS = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/msg/Int32": "int32 data",
    "rosgraph_msgs/msg/Clock": "builtin_interfaces/Time clock",
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/msg/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1",
    "geometry_msgs/msg/Transform": "Vector3 translation\nQuaternion rotation",
    "geometry_msgs/msg/TransformStamped":
        "std_msgs/Header header\nstring child_frame_id\nTransform transform",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "rcl_interfaces/msg/Log":
        "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line",
    "diagnostic_msgs/msg/KeyValue": "string key\nstring value",
    "diagnostic_msgs/msg/DiagnosticStatus":
        "byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values",
    "diagnostic_msgs/msg/DiagnosticArray":
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status",
    "bond/msg/Status":
        "std_msgs/Header header\nstring id\nstring instance_id\nbool active\n"
        "float32 heartbeat_timeout\nfloat32 heartbeat_period",
    "lifecycle_msgs/msg/State": "uint8 id\nstring label",
    "lifecycle_msgs/msg/Transition": "uint8 id\nstring label",
    "lifecycle_msgs/srv/ChangeState": "lifecycle_msgs/Transition transition\n---\nbool success",
}
folder = pathlib.Path(tempfile.mkdtemp(prefix="esl-definitions-"))
for name, text in DEFINITIONS.items():
    package, kind, base = name.split("/")
    (folder / package / kind).mkdir(parents=True, exist_ok=True)
    (folder / package / kind / f"{base}.{kind}").write_text(text + "\n")
    if kind == "srv":
        # The library looks for the parts of a service there too.
        for part, fields in zip(("Request", "Response"), text.split("---\n")):
            (folder / package / kind / f"{base}_{part}.msg").write_text(fields)
get_registry(str(folder))

from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber  # noqa: E402
from zenoh_ros2_sdk.message_registry import get_message_class  # noqa: E402
from zenoh_ros2_sdk.session import ZenohSession  # noqa: E402

LOCK = threading.Lock()


def say(*words):
    """Prints a line at once: those of other threads do not come between."""
    with LOCK:
        sys.stdout.write(" ".join(map(str, words)) + "\n")
        sys.stdout.flush()


port = int(sys.argv[1])
# The one session of the process, which the first call makes.
SESSION = ZenohSession.get_instance("127.0.0.1", port)
publishers = {}


def publish(topic, kind, qos=None, **fields):
    if topic not in publishers:
        publishers[topic] = ROS2Publisher(topic, kind, node_name="robot", router_port=port, qos=qos)
        # The subscription of the program hears of the publisher.
        time.sleep(0.5)
    publishers[topic].publish(**fields)


def stamp(seconds, nanoseconds):
    return get_message_class("builtin_interfaces/msg/Time")(sec=int(seconds), nanosec=int(nanoseconds))


def transform(parent, child, time, x):
    of = lambda name: get_message_class(f"geometry_msgs/msg/{name}")  # noqa: E731
    header = get_message_class("std_msgs/msg/Header")(stamp=time, frame_id=parent)
    turn = of("Quaternion")(x=0.0, y=0.0, z=0.0, w=1.0)
    place = of("Vector3")(x=float(x), y=0.0, z=0.0)
    return of("TransformStamped")(
        header=header, child_frame_id=child, transform=of("Transform")(translation=place, rotation=turn)
    )


def tell_statuses(message):
    for status in message.status:
        say("status", status.level, status.name, "|", status.message)


def call(service, kind, **fields):
    request, response = DEFINITIONS[kind].split("---\n")
    # The types within are known before.
    for name in ("State", "Transition"):
        get_message_class(f"lifecycle_msgs/msg/{name}")
    client = ROS2ServiceClient(service, kind, request.strip() or None, response, node_name="manager",
                               router_port=port, timeout=10.0)
    for _ in range(50):
        response = client.call(**fields)
        if response is not None:
            break
        time.sleep(0.2)
    client.close()
    return response


class Bond:
    """A bond with a managed node, as the lifecycle manager of Nav2 has it."""

    def __init__(self, name):
        self.name, self.instance, self.other = name, "manager", None
        self.beats, self.is_alive = 0, True
        self.subscription = ROS2Subscriber("/bond", "bond/msg/Status", node_name="manager", router_port=port,
                                           callback=self.hear)
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def tell(self, is_alive):
        header = get_message_class("std_msgs/msg/Header")(stamp=stamp(0, 0), frame_id="")
        publish("/bond", "bond/msg/Status", header=header, id=self.name, instance_id=self.instance,
                active=is_alive, heartbeat_timeout=4.0, heartbeat_period=0.25)

    def run(self):
        while self.is_alive:
            self.tell(True)
            time.sleep(0.25)

    def hear(self, message):
        if message.id != self.name or message.instance_id == self.instance:
            return
        if not message.active:
            if self.other is not None:
                self.other = None
                say("bond ended")
            return
        self.beats += 1
        if self.other != message.instance_id:
            self.other = message.instance_id
            say("bond formed")

    def end(self):
        self.is_alive = False
        self.thread.join()
        self.tell(False)


bond = None
subscriptions = []
say("ready")
for line in sys.stdin:
    words = line.split()
    if words[0] == "clock":
        publish("/clock", "rosgraph_msgs/msg/Clock", clock=stamp(*words[1:]))
    elif words[0] == "transform":
        publish("/tf", "tf2_msgs/msg/TFMessage", transforms=[transform(words[1], words[2], stamp(*words[3:5]), words[5])])
    elif words[0] == "static":
        publish("/tf_static", "tf2_msgs/msg/TFMessage", ":1:,1:,:,:,,",
                transforms=[transform(words[1], words[2], stamp(0, 0), words[3])])
    elif words[0] == "level":
        publish("/level", "std_msgs/msg/Int32", data=int(words[1]))
    elif words[0] == "watch":
        subscriptions.append(ROS2Subscriber(
            "/rosout", "rcl_interfaces/msg/Log", node_name="tools", router_port=port,
            callback=lambda m: say("log", m.level, m.name, m.msg)))
        subscriptions.append(ROS2Subscriber(
            "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", node_name="tools", router_port=port,
            callback=tell_statuses))
    elif words[0] == "state":
        # The library has no services with empty requests.
        for reply in SESSION.session.get(
            "0/executive/get_state/**",
            payload=b"\x00\x01\x00\x00\x00",
            attachment=struct.pack("<qqB16s", 1, 2, 16, b"s" * 16),
        ):
            payload = reply.ok.payload.to_bytes()
            (length,) = struct.unpack_from("<I", payload, 8)
            say("state", payload[4], payload[12 : 11 + length].decode())
    elif words[0] == "bond":
        bond = Bond(words[1])
        say("bonding")
    elif words[0] == "beats":
        before = bond.beats
        time.sleep(2)
        say("beats", "come" if bond.beats - before >= 4 else "are missing")
    elif words[0] == "unbond":
        bond.end()
    elif words[0] == "change":
        wanted = get_message_class("lifecycle_msgs/msg/Transition")(id=int(words[1]), label="")
        response = call("/executive/change_state", "lifecycle_msgs/srv/ChangeState", transition=wanted)
        say("changed", bool(response.success))
