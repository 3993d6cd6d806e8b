"""Calls of a service by way of a router, by zenoh-ros2-sdk: `service.py server ADDRESS`, `service.py client ADDRESS
COUNT`."""

import sys
import time

from zenoh_ros2_sdk import ROS2ServiceClient, ROS2ServiceServer

role, address, *rest = sys.argv[1:]
ADD = dict(
    srv_type="example_interfaces/srv/AddTwoInts",
    request_definition="int64 a\nint64 b",
    response_definition="int64 sum",
    router_port=int(address.split(":")[1]),
)
if role == "server":
    server = ROS2ServiceServer(
        "/add", callback=lambda request: server.response_msg_class(sum=request.a + request.b), node_name="adder", **ADD
    )
    print("ready", flush=True)
    while True:
        time.sleep(1000)
client = ROS2ServiceClient("/add", node_name="client", timeout=10.0, **ADD)


def calls(count):
    for i in range(count):
        # The first ones may come before the server is known.
        while client.call(a=i, b=1) is None:
            time.sleep(0.1)


calls(50)
begun = time.perf_counter()
calls(int(rest[0]))
print((time.perf_counter() - begun) * 1e6 / int(rest[0]), flush=True)
