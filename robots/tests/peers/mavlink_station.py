"""A ground station by pymavlink, with its own helpers for parameters and missions: python mavlink_station.py PORT"""

import sys
import time

from pymavlink import mavparm, mavutil, mavwp

MAV = mavutil.mavlink
link = mavutil.mavlink_connection(
    f"udpout:127.0.0.1:{sys.argv[1]}", source_system=255, source_component=190, dialect="ardupilotmega"
)


def beat():
    link.mav.heartbeat_send(MAV.MAV_TYPE_GCS, MAV.MAV_AUTOPILOT_INVALID, 0, 0, 4)


def wait_for(kind, condition=lambda message: True, seconds=10):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        message = link.recv_match(type=kind, blocking=True, timeout=0.5)
        beat()
        if message is not None and condition(message):
            return message
    raise SystemExit(f"no {kind}")


beat()
heartbeat = link.wait_heartbeat(timeout=10)
print("ready", flush=True)
print("heartbeat", link.target_system, link.target_component, heartbeat.type, heartbeat.autopilot, flush=True)

link.set_mode("GUIDED")
wait_for("HEARTBEAT", lambda message: mavutil.mode_string_v10(message) == "GUIDED")
link.arducopter_arm()
link.motors_armed_wait()
print("armed", flush=True)
link.mav.command_long_send(1, 1, MAV.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 0, 3)
print("takeoff", wait_for("COMMAND_ACK", lambda message: message.command == MAV.MAV_CMD_NAV_TAKEOFF).result, flush=True)
wait_for("GLOBAL_POSITION_INT", lambda message: message.relative_alt > 2900)
print("height", flush=True)

parameters = mavparm.MAVParmDict()
print("set", parameters.mavset(link, "RTL_ALT", 2500, retries=3), flush=True)
link.param_fetch_all()
names = set()
while len(names) < 3:
    names.add(wait_for("PARAM_VALUE").param_id)
print("parameters", *sorted(names), flush=True)

loader = mavwp.MAVWPLoader()
for place in range(4):
    loader.add(
        MAV.MAVLink_mission_item_message(1, 1, place, 3, MAV.MAV_CMD_NAV_WAYPOINT, 0, 1, 0, 0, 0, 0, 47 + place / 1000, 8, 20)
    )
link.waypoint_count_send(loader.count())
for place in range(loader.count()):
    request = wait_for(["MISSION_REQUEST_INT", "MISSION_REQUEST"], lambda message: message.seq == place)
    point = loader.wp(request.seq)
    link.mav.mission_item_int_send(
        1, 1, point.seq, 6, point.command, 0, 1, 0, 0, 0, 0, round(point.x * 1e7), round(point.y * 1e7), point.z
    )
print("mission", wait_for("MISSION_ACK").type, flush=True)
link.waypoint_request_list_send()
count = wait_for("MISSION_COUNT").count
link.mav.mission_request_int_send(1, 1, 2, 0)
item = wait_for("MISSION_ITEM_INT")
print("item", count, item.seq, item.x, item.z, flush=True)
link.set_mode("LAND")
link.motors_disarmed_wait()
print("landed", flush=True)
