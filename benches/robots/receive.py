"""Messages taken by a callback: `receive.py bytes|least|one ADDRESS`, by eclipse-zenoh, and rosbags with numpy. Prints
their number and the microseconds of the processor for each."""

import sys
import threading
import time

import zenoh

kind, address = sys.argv[1:]
config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("scouting/multicast/enabled", "false")
config.insert_json5("listen/endpoints", f'["tcp/{address}"]')
session = zenoh.open(config)
count, begun = 0, None
ended = threading.Event()
if kind == "bytes":
    key = "data"

    def look(sample):
        len(sample.payload.to_bytes())
else:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    key = "0/scan/**"

    def look(sample):
        scan = store.deserialize_cdr(sample.payload.to_bytes(), "sensor_msgs/msg/LaserScan")
        return scan.ranges.min() if kind == "least" else scan.ranges[540]


def take(sample):
    global count, begun
    if begun is None:
        begun = time.process_time()
    look(sample)
    count += 1


data = session.declare_subscriber(key, take)
end = session.declare_subscriber("end", lambda sample: ended.set())
print("ready", flush=True)
ended.wait()
print(count, (time.process_time() - (begun or 0)) * 1e6 / max(count, 1), flush=True)
session.close()
