"""A node of ROS 2 by zenoh-ros2-sdk: echoes /chatter under /echo, adds two integers, and does what its input says."""

import sys
import threading
import time

from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2ServiceServer, ROS2Subscriber

LOCK = threading.Lock()


def say(*words):
    """Prints a line at once: those of other threads do not come between."""
    with LOCK:
        sys.stdout.write(" ".join(map(str, words)) + "\n")
        sys.stdout.flush()


port = int(sys.argv[1])
STRING = dict(msg_type="std_msgs/msg/String", msg_definition="string data", router_port=port)
ADD = dict(
    srv_type="example_interfaces/srv/AddTwoInts",
    request_definition="int64 a\nint64 b",
    response_definition="int64 sum",
    router_port=port,
)

echo = ROS2Publisher("/echo", node_name="peer", **STRING)
chatter = ROS2Subscriber("/chatter", callback=lambda m: echo.publish(data="echo: " + m.data), **STRING)


def add(request):
    if request.a == 666:
        raise ValueError("that number is refused")
    return server.response_msg_class(sum=request.a + request.b)


server = ROS2ServiceServer("/add_two_ints", callback=add, node_name="peer", **ADD)
say("ready")
for line in sys.stdin:
    words = line.split()
    if words[0] == "call":
        client = ROS2ServiceClient(words[1], node_name="caller", timeout=10.0, **ADD)
        # The querier learns of servers a moment after it is declared.
        for _ in range(50):
            response = client.call(a=int(words[2]), b=int(words[3]))
            if response is not None:
                break
            time.sleep(0.2)
        say("sum", response.sum if response is not None else None)
        client.close()
    elif words[0] == "garbage":
        # Payloads that are no CDR, that end early, and that claim more than there is.
        for payload in [b"", b"\x00", b"\x00\x01\x00\x00\x06", b"\x00\x01\x00\x00\xff\xff\xff\xff", b"\xff" * 1000]:
            echo.pub.put(payload)
        echo.publish(data="after garbage")
        say("sent")
    elif words[0] == "latched":
        latched = ROS2Publisher("/latched", node_name="peer", qos=":1:,1:,:,:,,", **STRING)
        latched.publish(data="early")
        say("published")
