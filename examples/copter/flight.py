"""The dynamics of a quadcopter, the F450 of JSBSim, and the loops that hold it at a place."""

import contextlib
import math
import os
import sys

import jsbsim

FEET = 0.3048
STEP = 0.002
GRAVITY = 9.81
METRES = 111319.5


@contextlib.contextmanager
def silence():
    """Keeps the remarks of JSBSim about its model from the output."""
    sys.stdout.flush()
    before, nowhere = [os.dup(1), os.dup(2)], os.open(os.devnull, os.O_WRONLY)
    for output in (1, 2):
        os.dup2(nowhere, output)
    try:
        yield
    finally:
        for output, real in zip((1, 2), before):
            os.dup2(real, output)
            os.close(real)
        os.close(nowhere)


def clamp(value, most):
    return max(-most, min(most, value))


class Flight:
    """A quadcopter that flies to a target: metres to the north, to the east and above the ground."""

    def __init__(self):
        jsbsim.FGJSBBase().debug_lvl = 0
        with silence():
            self.fdm = jsbsim.FGFDMExec(None)
            self.fdm.set_debug_level(0)
            self.fdm.load_model("F450")
            self.fdm.set_dt(STEP)
            self.fdm.load_ic("initGrnd", True)
            # The file has the height of the field twice.
            self.fdm["ic/h-agl-ft"] = 0.6
            self.fdm.run_ic()
        self.home = (self["position/lat-geod-deg"], self["position/long-gc-deg"])
        self.altitude = 285.2
        self.fdm["fcs/ScasEngage"] = 1.0
        self.is_armed = False
        self.target = None
        self.speed = 4.0
        self.hover = 0.49
        self.time = 0.0
        self.steps = 0
        self.propellers(0.0)
        for _ in range(1000):
            self.fdm.run()
        self.rest = self["position/h-agl-ft"] * FEET
        self.look()

    def __getitem__(self, name):
        return self.fdm[name]

    def propellers(self, throttle):
        self.fdm["fcs/throttle-cmd-norm"] = throttle

    def look(self):
        """Reads the sensors."""
        latitude, longitude = self["position/lat-geod-deg"], self["position/long-gc-deg"]
        self.latitude, self.longitude = latitude, longitude
        self.north = (latitude - self.home[0]) * METRES
        self.east = (longitude - self.home[1]) * METRES * math.cos(math.radians(self.home[0]))
        self.up = self["position/h-agl-ft"] * FEET - self.rest
        self.velocity = [self[f"velocities/v-{axis}-fps"] * FEET for axis in ("north", "east", "down")]
        self.angles = [self[f"attitude/{angle}-rad"] for angle in ("phi", "theta", "psi")]

    def step(self):
        """Advances by a hundredth of a second."""
        self.look()
        if self.is_armed and self.target is not None:
            self.control()
        else:
            self.propellers(0.0)
            for axis in ("aileron", "elevator", "rudder"):
                self.fdm[f"fcs/{axis}-cmd-norm"] = 0.0
        for _ in range(5):
            self.fdm.run()
        self.steps += 1
        self.time = self.steps * 5 * STEP

    def control(self):
        north, east, up = self.target
        phi, theta, psi = self.angles
        wanted = [0.8 * (north - self.north), 0.8 * (east - self.east)]
        fast = math.hypot(*wanted)
        if fast > self.speed:
            wanted = [part * self.speed / fast for part in wanted]
        north, east = (clamp(1.5 * (part - real), 3.0) for part, real in zip(wanted, self.velocity))
        ahead = math.cos(psi) * north + math.sin(psi) * east
        right = -math.sin(psi) * north + math.cos(psi) * east
        roll, pitch = clamp(right / GRAVITY, 0.3), clamp(-ahead / GRAVITY, 0.3)
        turn = clamp(math.remainder(math.pi / 2 - psi, 2 * math.pi), 1.0)
        for axis, rate in (("aileron", 5 * (roll - phi)), ("elevator", 5 * (pitch - theta)), ("rudder", turn)):
            self.fdm[f"fcs/{axis}-cmd-norm"] = clamp(rate / 0.75, 1.0)
        wanted = max(-1.2 if self.up > 3 else -0.5, min(2.0, up - self.up))
        climb = -self.velocity[2]
        error = wanted - climb
        self.hover = max(0.4, min(0.6, self.hover + 0.0003 * clamp(error, 1.0)))
        self.propellers(max(0.05, min(0.9, (self.hover + 0.08 * error) / math.cos(phi) / math.cos(theta))))
