#!/usr/bin/env python3
"""A spacecraft simulated by Basilisk, commanded by lines of JSON over TCP.

    pip install bsk
    python3 simulator.py [--port 7070] [--speed 20] [--seed 1] [--faults none|some]

Basilisk integrates the attitude and four reaction wheels; battery, sun, camera and radio are models of a few
lines. The executive sends a command a line, and gets an answer with the same number when it is done:

    > {"id": 1, "do": "slew", "target": "crater"}
    < {"id": 1, "ok": true}
    < {"id": 2, "fault": "wheel-stuck", "about": [2]}

"stop" with the number of a command ends it; the command's answer is the fault "cancelled". Each second of
simulated time a line of telemetry comes without being asked for, before the answers of that second:

    < {"time": 12.0, "attitude": "turning", "battery": 68.5, "error": 0.31}

SPEED is how many seconds are simulated in one. Faults come by SEED: a wheel sticks, the star tracker is
blinded, the camera hangs, a transmission is lost, the spacecraft is pushed, the battery drains. The main pair
of thrusters always fails when it has fired for half of its time. Now and then the connection drops and cannot
be made for a while; what was under way is stopped then, without an answer.

The simulator ends when its executive has been away for 200 seconds of simulated time. Its exit status is 0 if the
spacecraft points at the sun then, and the executive has broken no rule: two commands to the wheels at
once, an empty battery.
"""

import argparse
import json
import random
import selectors
import socket
import sys
import time

import numpy as np
from Basilisk.architecture import messaging
from Basilisk.fswAlgorithms import attTrackingError, inertial3D, mrpFeedback, rwMotorTorque
from Basilisk.simulation import extForceTorque, reactionWheelStateEffector, simpleNav, spacecraft
from Basilisk.utilities import SimulationBaseClass, macros, orbitalMotion, simIncludeGravBody, simIncludeRW

STEP = 0.25
"""Seconds between two steps of the integrator."""

ATTITUDES = {
    "sun": [0.0, 0.0, 0.0],
    "earth": [0.2, -0.1, 0.1],
    "crater": [0.1, 0.2, -0.1],
    "ridge": [0.1, 0.25, -0.05],
    "dunes": [-0.15, 0.1, 0.2],
    "volcano": [-0.2, 0.0, 0.15],
    "canyon": [0.0, -0.3, 0.1],
    "pole": [0.3, 0.1, 0.0],
    "course": [-0.1, 0.1, 0.25],
}
"""Attitudes by name, as modified Rodrigues parameters."""

DURATIONS = {"slew": 5, "reset-wheel": 5, "switch-tracker": 2, "expose": 4, "cycle-camera": 8, "transmit": 6,
             "fire": 0, "warm": 25}
"""Seconds that each command takes; a slew also takes as long as the turn does, and thrusters fire for as long as
they are told."""

THRUST = 20.0
"""Newtons of a pair of thrusters."""


class Body:
    """Attitude, wheels and their control."""

    def __init__(self):
        self.sim = SimulationBaseClass.SimBaseClass()
        self.sim.CreateNewProcess("process").addTask(self.sim.CreateNewTask("task", macros.sec2nano(STEP)))
        inertia = [900.0, 0.0, 0.0, 0.0, 800.0, 0.0, 0.0, 0.0, 600.0]

        hub = spacecraft.Spacecraft()
        hub.ModelTag = "spacecraft"
        hub.hub.mHub = 750.0
        hub.hub.r_BcB_B = [[0.0], [0.0], [0.0]]
        hub.hub.IHubPntBc_B = [inertia[0:3], inertia[3:6], inertia[6:9]]
        gravity = simIncludeGravBody.gravBodyFactory()
        earth = gravity.createEarth()
        earth.isCentralBody = True
        gravity.addBodiesTo(hub)
        orbit = orbitalMotion.ClassicElements()
        orbit.a, orbit.e, orbit.i = 1e7, 0.01, 33.3 * macros.D2R
        orbit.Omega, orbit.omega, orbit.f = 48.2 * macros.D2R, 347.8 * macros.D2R, 85.3 * macros.D2R
        hub.hub.r_CN_NInit, hub.hub.v_CN_NInit = orbitalMotion.elem2rv(earth.mu, orbit)
        hub.hub.sigma_BNInit = [[0.0], [0.0], [0.0]]
        hub.hub.omega_BN_BInit = [[0.0], [0.0], [0.0]]

        # Three wheels along the axes and a skewed spare.
        factory = simIncludeRW.rwFactory()
        axes = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]) / np.array([[1], [1], [1], [3**0.5]])
        for axis in axes:
            factory.create("Honeywell_HR16", list(axis), maxMomentum=100.0, Omega=0.0, u_max=4.0)
        wheels = reactionWheelStateEffector.ReactionWheelStateEffector()
        wheels.ModelTag = "wheels"
        factory.addToSpacecraft(hub.ModelTag, wheels, hub)
        self.push = extForceTorque.ExtForceTorque()
        hub.addDynamicEffector(self.push)

        navigation = simpleNav.SimpleNav()
        self.reference = inertial3D.inertial3D()
        self.error = attTrackingError.attTrackingError()
        control = mrpFeedback.mrpFeedback()
        control.K, control.Ki, control.P, control.integralLimit = 200.0, -1.0, 500.0, 0.0
        torque = rwMotorTorque.rwMotorTorque()
        torque.controlAxes_B = [1, 0, 0, 0, 1, 0, 0, 0, 1]

        vehicle = messaging.VehicleConfigMsgPayload()
        vehicle.ISCPntB_B = inertia
        parameters = factory.getConfigMessage()
        self.available = messaging.RWAvailabilityMsgPayload()
        self.availability = messaging.RWAvailabilityMsg().write(self.available)
        navigation.scStateInMsg.subscribeTo(hub.scStateOutMsg)
        self.error.attNavInMsg.subscribeTo(navigation.attOutMsg)
        self.error.attRefInMsg.subscribeTo(self.reference.attRefOutMsg)
        control.guidInMsg.subscribeTo(self.error.attGuidOutMsg)
        self.vehicle = messaging.VehicleConfigMsg().write(vehicle)
        control.vehConfigInMsg.subscribeTo(self.vehicle)
        control.rwParamsInMsg.subscribeTo(parameters)
        control.rwSpeedsInMsg.subscribeTo(wheels.rwSpeedOutMsg)
        torque.vehControlInMsg.subscribeTo(control.cmdTorqueOutMsg)
        torque.rwParamsInMsg.subscribeTo(parameters)
        torque.rwAvailInMsg.subscribeTo(self.availability)
        wheels.rwMotorCmdInMsg.subscribeTo(torque.rwMotorTorqueOutMsg)
        # What Python no longer refers to is gone for Basilisk, too.
        self.parts = [hub, gravity, factory, wheels, navigation, control, torque, parameters]
        for part in [hub, wheels, self.push, navigation, self.reference, self.error, control, torque]:
            self.sim.AddModelToTask("task", part)
        self.point("sun")
        self.sim.InitializeSimulation()
        self.now = 0.0

    def point(self, target):
        self.reference.sigma_R0N = ATTITUDES[target]

    def turn_wheel(self, wheel, is_available):
        """Lets a wheel stick, or frees it."""
        state = messaging.AVAILABLE if is_available else messaging.UNAVAILABLE
        wheels = list(self.available.wheelAvailability)
        wheels[wheel] = state
        self.available.wheelAvailability = wheels
        self.availability.write(self.available, macros.sec2nano(self.now))

    def step(self, seconds):
        self.now += seconds
        self.sim.ConfigureStopTime(macros.sec2nano(self.now))
        self.sim.ExecuteSimulation()

    def deviation(self):
        """Returns the error of the attitude and the rate of turning."""
        guidance = self.error.attGuidOutMsg.read()
        return float(np.linalg.norm(guidance.sigma_BR)), float(np.linalg.norm(guidance.omega_BR_B))


class Spacecraft:
    """What the executive sees: commands under way, and telemetry."""

    def __init__(self, has_faults):
        self.body = Body()
        self.has_faults = has_faults
        self.target = "sun"
        self.battery = 70.0
        self.draining = 0.05
        self.next_push = 60.0
        self.next_drop = random.uniform(60, 180)
        self.back_at = 0.0
        self.broken = []
        self.under_way = {}
        self.answers = []

    def chance(self, percent):
        return self.has_faults and random.uniform(0, 100) < percent

    def attitude(self):
        error, rate = self.body.deviation()
        return self.target if error < 0.02 and rate < 0.01 else "turning"

    def command(self, line):
        try:
            command = json.loads(line)
            number, do = command["id"], command["do"]
        except (ValueError, KeyError, TypeError):
            return self.answers.append({"fault": "not-understood", "about": [str(line)[:80]]})
        if do == "stop":
            if self.under_way.pop(number, None):
                self.fail(number, "cancelled")
            return
        if do == "slew" and command.get("target") not in ATTITUDES:
            return self.fail(number, "no-such-target", command.get("target"))
        if do not in DURATIONS:
            return self.fail(number, "not-understood", do)
        command["until"] = self.body.now + DURATIONS[do]
        if do == "slew":
            if any(other["do"] == "slew" for other in self.under_way.values()):
                self.broken.append("two commands to the wheels")
            self.target = command["target"]
            self.body.point(self.target)
            if self.chance(8):
                command["fault"] = ("wheel-stuck", random.randrange(3))
                self.body.turn_wheel(command["fault"][1], False)
            elif self.chance(5):
                command["fault"] = ("tracker-blinded",)
        elif do == "fire":
            seconds = float(command.get("seconds", 0))
            if self.attitude() != "course":
                return self.fail(number, "misaligned")
            if self.has_faults and command.get("pair") == "main":
                seconds /= 2
                command["fault"] = ("thruster-failed", "main")
            command["until"] = self.body.now + seconds
        elif do == "expose" and self.chance(12):
            command["until"] = float("inf")
        elif do == "transmit" and self.chance(15):
            command["fault"] = ("link-lost",)
        self.under_way[number] = command

    def fail(self, number, fault, *about):
        self.answers.append({"id": number, "fault": fault, "about": list(about)})

    def finish(self, command):
        number, do = command["id"], command["do"]
        if "fault" in command:
            return self.fail(number, *command["fault"])
        if do == "reset-wheel":
            self.body.turn_wheel(int(command["wheel"]) % 4, True)
        elif do == "expose" and self.attitude() != command.get("target"):
            return self.fail(number, "blurred", command.get("target"))
        elif do == "transmit" and self.attitude() != "earth":
            return self.fail(number, "link-lost")
        self.answers.append({"id": number, "ok": True})

    def drops_link(self):
        """Returns whether the connection drops now, for a while."""
        if not self.has_faults or self.body.now < self.next_drop:
            return False
        self.back_at = self.body.now + random.uniform(5, 20)
        self.next_drop = self.back_at + random.uniform(60, 180)
        return True

    def step(self):
        """Simulates a second."""
        self.body.step(1.0)
        self.battery += (0.4 if self.attitude() == "sun" else 0.0) - self.draining
        self.battery = max(0.0, min(100.0, self.battery))
        if self.battery == 0.0:
            self.broken.append("the battery is empty")
        if self.has_faults and self.body.now > self.next_push:
            self.next_push = self.body.now + random.uniform(60, 240)
            self.draining = random.choice([0.05, 0.05, 0.2])
            self.body.push.extTorquePntB_B = [[random.uniform(-20, 20)] for _ in range(3)]
        else:
            self.body.push.extTorquePntB_B = [[0.0], [0.0], [0.0]]
        is_firing = any(command["do"] == "fire" for command in self.under_way.values())
        self.body.push.extForce_B = [[0.0], [0.0], [THRUST if is_firing else 0.0]]
        self.answers.append({
            "time": round(self.body.now, 1),
            "attitude": self.attitude(),
            "battery": round(self.battery, 1),
            "error": round(self.body.deviation()[0], 4),
        })
        for number, command in list(self.under_way.items()):
            is_over = self.body.now >= command["until"]
            if is_over and (command["do"] != "slew" or "fault" in command or self.attitude() == self.target):
                del self.under_way[number]
                self.finish(command)


class Link:
    """The connection to the executive; there may be none."""

    def __init__(self, port):
        self.listener = socket.create_server(("127.0.0.1", port))
        self.selector = selectors.DefaultSelector()
        self.selector.register(self.listener, selectors.EVENT_READ)
        self.connection = None
        self.received, self.unsent = b"", b""

    def drop(self):
        if self.connection:
            self.selector.unregister(self.connection)
            self.connection.close()
        self.connection = None

    def wait(self, seconds, craft):
        """Waits, at most so long, for something to come, and has CRAFT take it."""
        for key, _ in self.selector.select(seconds):
            if key.fileobj is self.listener:
                connection, _ = self.listener.accept()
                if self.connection or craft.body.now < craft.back_at:
                    connection.close()
                else:
                    # The executive may be back before the next step notices that it was away.
                    craft.under_way.clear()
                    connection.setblocking(False)
                    self.selector.register(connection, selectors.EVENT_READ)
                    self.connection, self.received, self.unsent = connection, b"", b""
            elif key.fileobj is self.connection:
                try:
                    data = self.connection.recv(65536)
                except ConnectionError:
                    data = b""
                if data:
                    *lines, self.received = (self.received + data).split(b"\n")
                    for line in lines:
                        craft.command(line)
                else:
                    self.drop()

    def send(self, objects):
        self.unsent += b"".join(json.dumps(each).encode() + b"\n" for each in objects)
        try:
            self.unsent = self.unsent[self.connection.send(self.unsent):]
        except BlockingIOError:
            pass
        except ConnectionError:
            self.drop()


def serve(port, speed, has_faults):
    """Serves an executive until it has been away for 200 seconds of simulated time."""
    link = Link(port)
    print(f"listening on port {link.listener.getsockname()[1]}", flush=True)
    craft = Spacecraft(has_faults)
    while not link.connection:
        link.wait(None, craft)
    seen = 0.0
    due = time.monotonic()
    while craft.body.now < seen + 200.0:
        due += 1.0 / speed
        while (wait := due - time.monotonic()) > 0:
            link.wait(wait, craft)
        craft.step()
        if craft.drops_link():
            link.drop()
        if link.connection:
            link.send(craft.answers)
            seen = craft.body.now
        else:
            craft.under_way.clear()
        craft.answers.clear()
    return craft


def main():
    parser = argparse.ArgumentParser(description="A simulated spacecraft for examples/spacecraft.")
    parser.add_argument("--port", type=int, default=7070, help="port on the loopback; 0 takes a free one")
    parser.add_argument("--speed", type=float, default=20.0, help="seconds simulated in a second")
    parser.add_argument("--seed", type=int, default=1, help="seed of the faults")
    parser.add_argument("--faults", choices=["none", "some"], default="some")
    arguments = parser.parse_args()
    random.seed(arguments.seed)
    craft = serve(arguments.port, arguments.speed, arguments.faults == "some")
    rules = ", ".join(sorted(set(craft.broken))) or "no rule"
    print(f"the executive has gone; attitude {craft.attitude()}, battery {craft.battery:.0f} %, {rules} broken")
    return 0 if craft.attitude() == "sun" and not craft.broken else 1


if __name__ == "__main__":
    sys.exit(main())
