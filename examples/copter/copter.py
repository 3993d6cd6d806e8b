"""A copter that speaks MAVLink as ArduPilot does: the quadcopter F450 of JSBSim, with an autopilot and a radio.

    python copter.py [--port 14550] [--speed 1] [--cut 18 30] [--trace FILE]
"""

import argparse
import json
import math
import os
import sys
import time

# Version 2 of the protocol from the first message on.
os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil

from flight import METRES, Flight

MAV = mavutil.mavlink
COPTER_MODES = {name: number for number, name in mavutil.mode_mapping_acm.items()}
# Seconds of the clock without a heartbeat of a ground station.
FAILSAFE = 5.0


class Radio:
    """A link, which nothing passes while it is cut."""

    def __init__(self, port, cut):
        self.link = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=1, source_component=1, dialect="ardupilotmega"
        )
        self.cut = cut
        self.mav = self.link.mav
        self.is_cut = False

    def look(self, seconds):
        self.is_cut = seconds is not None and self.cut[0] <= seconds < self.cut[1]

    def receive(self):
        while True:
            message = self.link.recv_match(blocking=False)
            if message is None:
                return
            if not self.is_cut and message.get_type() != "BAD_DATA":
                yield message

    def send(self, name, *arguments, **fields):
        if not self.is_cut:
            getattr(self.mav, f"{name}_send")(*arguments, **fields)


class Copter:
    """The autopilot."""

    def __init__(self, options):
        self.flight = Flight()
        self.radio = Radio(options.port, options.cut)
        self.mode = "STABILIZE"
        self.charge = 100.0
        self.heard = None
        self.failsafe = FAILSAFE * options.speed
        self.armed = None
        self.due = {}
        self.rates = {"heartbeat": 1.0, "global_position_int": 0.5, "sys_status": 1.0}
        self.capture = None
        self.captures = 0
        self.trace = []

    def note(self, text):
        print(f"{self.flight.time:7.1f} s  copter: {text}", flush=True)

    def set_mode(self, mode):
        if mode != self.mode:
            self.note(f"mode {mode.lower()}")
        self.mode = mode
        flight = self.flight
        if mode == "RTL":
            flight.target = (0.0, 0.0, max(15.0, flight.up))
        elif mode == "LAND":
            flight.target = (flight.north, flight.east, -2.0)
        elif flight.up > 0.5:
            flight.target = (flight.north, flight.east, flight.up)

    def fly(self):
        """Goes on with the mode after a step."""
        flight = self.flight
        if flight.is_armed:
            self.charge = max(0.0, self.charge - (0.004 if flight.up > 0.2 else 0.001))
            if self.heard is not None and flight.time - self.heard > self.failsafe and self.mode == "GUIDED":
                self.note("nothing is heard of the ground station")
                self.set_mode("RTL")
        if self.mode == "RTL" and flight.target is not None:
            north, east, up = flight.target
            there = math.hypot(flight.north - north, flight.east - east) < 0.5
            if there and up > 0 and abs(flight.up - up) < 0.5:
                flight.target = (0.0, 0.0, -2.0)
        if flight.is_armed and flight.target is not None and flight.target[2] < 0 and flight.up < 0.1:
            flight.is_armed = False
            flight.target = None
            self.note("landed")

    # ---- messages

    def command(self, message, place):
        """Performs a command; returns its result."""
        flight = self.flight
        command = message.command
        if command == MAV.MAV_CMD_COMPONENT_ARM_DISARM:
            if message.param1 != 1 and flight.up > 0.5 and message.param2 != 21196:
                return MAV.MAV_RESULT_DENIED
            flight.is_armed = message.param1 == 1
            if self.armed is None:
                self.armed = flight.time
            self.note("armed" if flight.is_armed else "disarmed")
        elif command == MAV.MAV_CMD_DO_SET_MODE:
            mode = mavutil.mode_mapping_acm.get(int(message.param2))
            if mode is None:
                return MAV.MAV_RESULT_DENIED
            self.set_mode(mode)
        elif command == MAV.MAV_CMD_NAV_TAKEOFF:
            if not flight.is_armed or self.mode != "GUIDED":
                return MAV.MAV_RESULT_DENIED
            flight.target = (flight.north, flight.east, message.param7)
        elif command == MAV.MAV_CMD_DO_REPOSITION:
            if place is None:
                return MAV.MAV_RESULT_COMMAND_INT_ONLY
            if not flight.is_armed or self.mode != "GUIDED":
                return MAV.MAV_RESULT_DENIED
            flight.target = place
        elif command == MAV.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self.set_mode("RTL")
        elif command == MAV.MAV_CMD_NAV_LAND:
            self.set_mode("LAND")
        elif command == MAV.MAV_CMD_SET_MESSAGE_INTERVAL:
            name = mavutil.mavlink.mavlink_map.get(int(message.param1))
            name = name.msgname.lower() if name else None
            if name not in self.rates:
                return MAV.MAV_RESULT_DENIED
            self.rates[name] = message.param2 / 1e6 if message.param2 > 0 else 1.0
        elif command == MAV.MAV_CMD_IMAGE_START_CAPTURE:
            self.captures += 1
            if self.captures in (2, 3):
                return MAV.MAV_RESULT_TEMPORARILY_REJECTED
            if self.capture is None:
                self.capture = (flight.time, message)
                self.trace.append({"picture": [flight.north, flight.east]})
            return MAV.MAV_RESULT_IN_PROGRESS
        else:
            return MAV.MAV_RESULT_UNSUPPORTED
        return MAV.MAV_RESULT_ACCEPTED

    def acknowledge(self, message, result, progress=255):
        self.radio.send(
            "command_ack", message.command, result, progress, 0, message.get_srcSystem(), message.get_srcComponent()
        )

    def take(self, message):
        kind = message.get_type()
        self.heard = self.flight.time
        if kind == "COMMAND_LONG":
            result = self.command(message, None)
            self.acknowledge(message, result, 0 if result == MAV.MAV_RESULT_IN_PROGRESS else 255)
        elif kind == "COMMAND_INT":
            north = (message.x / 1e7 - self.flight.home[0]) * METRES
            east = (message.y / 1e7 - self.flight.home[1]) * METRES * math.cos(math.radians(self.flight.home[0]))
            self.acknowledge(message, self.command(message, (north, east, message.z)))

    def finish_capture(self):
        if self.capture is not None and self.flight.time - self.capture[0] > 1.0:
            _, message = self.capture
            self.capture = None
            self.note("click")
            self.acknowledge(message, MAV.MAV_RESULT_ACCEPTED)

    def tell(self):
        flight = self.flight
        for name, seconds in self.rates.items():
            if flight.time < self.due.get(name, 0.0):
                continue
            self.due[name] = flight.time + seconds
            if name == "heartbeat":
                flags = MAV.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
                flags |= MAV.MAV_MODE_FLAG_SAFETY_ARMED if flight.is_armed else 0
                state = MAV.MAV_STATE_ACTIVE if flight.up > 0.5 else MAV.MAV_STATE_STANDBY
                arguments = (MAV.MAV_TYPE_QUADROTOR, MAV.MAV_AUTOPILOT_ARDUPILOTMEGA, flags, COPTER_MODES[self.mode], state)
            elif name == "global_position_int":
                velocity = [int(100 * part) for part in flight.velocity]
                heading = int(100 * math.degrees(flight.angles[2]) % 36000)
                place = [round(flight.latitude * 1e7), round(flight.longitude * 1e7)]
                heights = [round(1000 * (flight.altitude + flight.up)), round(1000 * flight.up)]
                arguments = (int(1000 * flight.time), *place, *heights, *velocity, heading)
            else:
                arguments = (0, 0, 0, 0, int(14000 + 28 * self.charge), -1, int(self.charge), 0, 0, 0, 0, 0, 0)
            self.radio.send(name, *arguments)

    def step(self):
        self.radio.look(None if self.armed is None else self.flight.time - self.armed)
        for message in self.radio.receive():
            self.take(message)
        self.flight.step()
        self.fly()
        self.finish_capture()
        self.tell()
        if self.flight.steps % 20 == 0:
            flight = self.flight
            self.trace.append({"at": [flight.north, flight.east, flight.up], "cut": self.radio.is_cut, "mode": self.mode})


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=14550)
    parser.add_argument("--speed", type=float, default=1.0, help="simulated seconds in one of the clock")
    parser.add_argument("--cut", type=float, nargs=2, default=(18.0, 30.0), help="seconds after arming: nothing passes")
    parser.add_argument("--trace", help="a file for the path, in JSON")
    options = parser.parse_args()
    copter = Copter(options)
    began = time.monotonic()
    try:
        while True:
            copter.step()
            ahead = copter.flight.time / options.speed - (time.monotonic() - began)
            if ahead > 0:
                time.sleep(ahead)
    except KeyboardInterrupt:
        pass
    finally:
        if options.trace:
            with open(options.trace, "w") as file:
                json.dump(copter.trace, file)


if __name__ == "__main__":
    import signal

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    main()
