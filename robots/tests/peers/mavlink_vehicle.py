"""A vehicle by pymavlink, for tests: python mavlink_vehicle.py PORT|PATH [LOSS SEED]

It prints what it gets. A PATH becomes the near end of a serial line, at whose far end the vehicle is; it needs the package
pyserial. With LOSS, so many of the messages of each direction are lost, as many come twice, and as many
come later than the next one.
"""

import os
import random
import select
import sys
import threading
import time
import tty

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil

MAV = mavutil.mavlink
place, loss = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 0.0
chance = random.Random(int(sys.argv[3]) if len(sys.argv) > 3 else 0)


class Lossy:
    """The way of messages: some are lost, some come twice, some late."""

    def __init__(self):
        self.late = []

    def pass_on(self, message):
        due, self.late = self.late, []
        if chance.random() < loss:
            return due
        if chance.random() < loss:
            self.late.append(message)
            return due
        return [message] + ([message] if chance.random() < loss else []) + due


class Line:
    """A serial line: two terminals, and a thread that copies from one to the other."""

    def __init__(self, path):
        self.path = path
        self.far, self.far_end = self.terminal()
        self.is_pulled = False
        self.plug()
        threading.Thread(target=self.copy, daemon=True).start()

    def terminal(self):
        near, end = os.openpty()
        tty.setraw(end)
        os.set_blocking(near, False)
        return near, end

    def plug(self):
        self.near, self.near_end = self.terminal()
        os.symlink(os.ttyname(self.near_end), self.path + ".new")
        os.replace(self.path + ".new", self.path)

    def copy(self):
        while True:
            if self.is_pulled:
                os.close(self.near_end)
                os.close(self.near)
                time.sleep(1.5)
                self.plug()
                self.is_pulled = False
            ready, _, _ = select.select([self.near, self.far], [], [], 0.05)
            for end in ready:
                try:
                    os.write(self.far if end == self.near else self.near, os.read(end, 4096))
                except OSError:
                    # Nobody reads it.
                    pass


source = {"source_system": 1, "source_component": 1, "dialect": "ardupilotmega"}
if place.isdigit():
    link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{place}", **source)
else:
    line = Line(place)
    link = mavutil.mavlink_connection(os.ttyname(line.far_end), baud=57600, **source)
there, here = Lossy(), Lossy()
socket_write = link.write


def write(frame):
    for part in there.pass_on(bytes(frame)):
        socket_write(part)


link.write = write
link.mav.file = link
items, upload = [], None
parameters = {"WPNAV_SPEED": (500.0, MAV.MAV_PARAM_TYPE_REAL32), "RTL_ALT": (1500, MAV.MAV_PARAM_TYPE_INT32)}
parameters |= {f"SERVO{n}_MIN": (1000 + n, MAV.MAV_PARAM_TYPE_INT16) for n in range(1, 40)}
state = {"armed": False, "mode": 0, "calibrating": None, "asked": {}}
print("ready", flush=True)


def say(text):
    print(text, flush=True)


def acknowledge(message, result, progress=255):
    link.mav.command_ack_send(
        message.command, result, progress, 0, message.get_srcSystem(), message.get_srcComponent()
    )


def tell_parameter(name):
    value, kind = parameters[name]
    names = list(parameters)
    link.mav.param_value_send(name.encode(), value, kind, len(names), names.index(name))


def take_command(message):
    command = message.command
    if command == MAV.MAV_CMD_COMPONENT_ARM_DISARM:
        state["armed"] = message.param1 == 1
    elif command == MAV.MAV_CMD_DO_SET_MODE:
        state["mode"] = int(message.param2)
    elif command == MAV.MAV_CMD_NAV_TAKEOFF:
        say(f"takeoff {message.param7} {message.param4} {message.confirmation if loss == 0 else '-'}")
    elif command == MAV.MAV_CMD_DO_REPOSITION:
        say(f"reposition {message.get_type()} {message.x} {message.y} {message.z} {message.frame}")
    elif command == MAV.MAV_CMD_DO_SET_SERVO:
        return acknowledge(message, MAV.MAV_RESULT_DENIED)
    elif command == MAV.MAV_CMD_USER_1:
        count = state["asked"][command] = state["asked"].get(command, 0) + 1
        say(f"user-1 {message.confirmation}")
        if count < 3:
            return None
    elif command == MAV.MAV_CMD_USER_2:
        return None
    elif command == MAV.MAV_CMD_USER_4:
        # The line is pulled out, and plugged in again.
        threading.Timer(0.3, lambda: setattr(line, "is_pulled", True)).start()
    elif command == MAV.MAV_CMD_PREFLIGHT_CALIBRATION:
        state["calibrating"] = (time.monotonic(), message)
        return acknowledge(message, MAV.MAV_RESULT_IN_PROGRESS, 0)
    elif command == MAV.MAV_CMD_REQUEST_MESSAGE and message.param1 == 148:
        acknowledge(message, MAV.MAV_RESULT_ACCEPTED)
        return link.mav.autopilot_version_send(0, 1, 2, 3, 4, [0] * 8, [0] * 8, [0] * 8, 5, 6, 7)
    elif command == MAV.MAV_CMD_USER_3:
        # A storm: garbage, broken frames, and another system that claims to be a vehicle.
        for _ in range(200):
            socket_write(bytes(chance.randrange(256) for _ in range(300)))
        other = MAV.MAVLink(None, srcSystem=7, srcComponent=1)
        heartbeat = other.heartbeat_encode(2, 3, 128, 9, 4).pack(other)
        socket_write(heartbeat)
        socket_write(heartbeat[:-1] + bytes([heartbeat[-1] ^ 1]))
        socket_write(b"boot message\r\n" + other.statustext_encode(6, b"from another system").pack(other))
    else:
        return acknowledge(message, MAV.MAV_RESULT_UNSUPPORTED)
    return acknowledge(message, MAV.MAV_RESULT_ACCEPTED)


def take(message):
    global upload, items
    kind = message.get_type()
    back = (message.get_srcSystem(), message.get_srcComponent())
    if kind in ("COMMAND_LONG", "COMMAND_INT"):
        take_command(message)
    elif kind == "UNKNOWN_80":
        # The definitions of pymavlink lack COMMAND_CANCEL and the result 6, cancelled.
        say("cancel")
        if state["calibrating"]:
            acknowledge(state["calibrating"][1], 6)
            state["calibrating"] = None
    elif kind == "MISSION_COUNT":
        if upload is None or upload["count"] != message.count:
            upload = {"count": message.count, "items": [], "back": back, "at": time.monotonic()}
        link.mav.mission_request_int_send(*back, len(upload["items"]), message.mission_type)
    elif kind == "MISSION_ITEM_INT":
        if upload is None:
            if items and message.seq == len(items) - 1:
                link.mav.mission_ack_send(*back, MAV.MAV_MISSION_ACCEPTED, message.mission_type)
        elif message.seq == len(upload["items"]):
            upload["items"].append(message)
            upload["at"] = time.monotonic()
            if len(upload["items"]) == upload["count"]:
                items, upload = upload["items"], None
                link.mav.mission_ack_send(*back, MAV.MAV_MISSION_ACCEPTED, message.mission_type)
                say(f"mission {len(items)}")
            else:
                link.mav.mission_request_int_send(*back, message.seq + 1, message.mission_type)
    elif kind == "MISSION_ACK" and message.type == MAV.MAV_MISSION_OPERATION_CANCELLED:
        say("mission cancelled")
        upload = None
    elif kind == "MISSION_REQUEST_LIST":
        link.mav.mission_count_send(*back, len(items), message.mission_type)
    elif kind == "MISSION_REQUEST_INT" and message.seq < len(items):
        item = items[message.seq]
        fields = [getattr(item, name) for name in item.fieldnames[2:]]
        link.mav.mission_item_int_send(*back, *fields)
    elif kind == "MISSION_CLEAR_ALL":
        items = []
        link.mav.mission_ack_send(*back, MAV.MAV_MISSION_ACCEPTED, message.mission_type)
    elif kind == "PARAM_REQUEST_LIST":
        for name in parameters:
            tell_parameter(name)
    elif kind == "PARAM_REQUEST_READ":
        name = message.param_id if message.param_index < 0 else list(parameters)[message.param_index]
        if name in parameters:
            tell_parameter(name)
    elif kind == "PARAM_SET" and message.param_id in parameters:
        kind = parameters[message.param_id][1]
        value = message.param_value if kind == MAV.MAV_PARAM_TYPE_REAL32 else int(message.param_value)
        # A speed has a limit.
        parameters[message.param_id] = (min(value, 2000), kind)
        tell_parameter(message.param_id)


def ask_again():
    if upload is not None and time.monotonic() - upload["at"] > 0.3:
        upload["at"] = time.monotonic()
        link.mav.mission_request_int_send(*upload["back"], len(upload["items"]), 0)


beat = 0.0
while True:
    if time.monotonic() - beat > 0.5:
        beat = time.monotonic()
        flags = 1 | (128 if state["armed"] else 0)
        link.mav.heartbeat_send(MAV.MAV_TYPE_QUADROTOR, MAV.MAV_AUTOPILOT_PX4 if "px4" in sys.argv else MAV.MAV_AUTOPILOT_ARDUPILOTMEGA, flags, state["mode"], 4)
        link.mav.global_position_int_send(0, 470000000, 80000000, 400000, 0, 1, 2, 3, 65535)
    ask_again()
    message = link.recv_match(blocking=True, timeout=0.05)
    if message is not None and message.get_type() != "BAD_DATA":
        for each in here.pass_on(message):
            take(each)
