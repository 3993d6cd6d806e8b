"""A simulated arm on a table with blocks, as a node of ROS 2: a Franka Panda by pybullet.

    arm.py [--port 7447] [--speed 1] [--seed 1] [--no-faults] [--picture FILE]

topics:   /joint_states (50 Hz), /battery (2 Hz), /camera/blocks (5 Hz, silent while the camera hangs): the poses of the
          red, the green, the blue and the yellow block
services: /solve_ik, /gripper/close (data: whether to close), /dock (data: whether to charge), /camera/reset, /stop
actions:  /arm_controller/follow_joint_trajectory

Things go wrong: the camera hangs, a grip slips, the battery gets low. With --speed N a second takes 1/N s.
"""

import argparse
import concurrent.futures
import math
import os
import queue
import random
import signal
import struct
import time
import zlib

import numpy
import pybullet
import pybullet_data

from node import ABORTED, SUCCEEDED, ActionServer, Node

STEP = 1 / 240
JOINTS = [f"panda_joint{number}" for number in range(1, 8)]
FINGERS = [9, 10]
GRASP = 11
HOME = [0.0, -0.3, 0.0, -2.2, 0.0, 2.0, 0.785]
BLOCKS = {"red": ((0.45, 0.10), (0.9, 0.2, 0.2, 1)), "green": ((0.55, -0.05), (0.2, 0.8, 0.3, 1)),
          "blue": ((0.42, 0.24), (0.2, 0.4, 0.9, 1)), "yellow": ((0.58, 0.18), (0.95, 0.8, 0.2, 1))}
# So near to the blue block that a finger does not fit between.
WALL = ((0.42, 0.282), (0.07, 0.01, 0.04))
TRAY = (0.40, -0.38)
LOW, HIGH = numpy.array([-2.9, -1.7, -2.9, -3.0, -2.9, 0.0, -2.9]), numpy.array([2.9, 1.7, 2.9, -0.1, 2.9, 3.7, 2.9])
FOLLOW = "control_msgs/action/FollowJointTrajectory"


class World:
    """The physics, which only the thread of the main loop touches."""

    def __init__(self, arguments):
        self.random = random.Random(arguments.seed)
        self.client = pybullet.connect(pybullet.DIRECT)
        pybullet.setAdditionalSearchPath(pybullet_data.getDataPath())
        pybullet.setGravity(0, 0, -9.81)
        pybullet.setTimeStep(STEP)
        pybullet.loadURDF("plane.urdf", [0, 0, -0.65])
        pybullet.loadURDF("table/table.urdf", [0.5, 0, -0.65], useFixedBase=True)
        self.arm = self.load_arm(self.client)
        # Inverse kinematics moves the joints of another arm, in a world of its own.
        self.ghost_client = pybullet.connect(pybullet.DIRECT)
        pybullet.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=self.ghost_client)
        self.ghost = self.load_arm(self.ghost_client)
        self.blocks = {}
        for name, ((x, y), color) in BLOCKS.items():
            block = pybullet.loadURDF("cube_small.urdf", [x, y, 0.025])
            pybullet.changeVisualShape(block, -1, rgbaColor=color)
            pybullet.changeDynamics(block, -1, mass=0.08, lateralFriction=1.2, spinningFriction=0.01)
            self.blocks[name] = block
        (x, y), half = WALL
        shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half)
        look = pybullet.createVisualShape(pybullet.GEOM_BOX, halfExtents=half, rgbaColor=(0.5, 0.5, 0.55, 1))
        pybullet.createMultiBody(0, shape, look, [x, y, half[2] - 0.025])
        pybullet.loadURDF("tray/tray.urdf", [*TRAY, 0.0], globalScaling=0.6, useFixedBase=True)
        for finger in FINGERS:
            pybullet.changeDynamics(self.arm, finger, lateralFriction=1.5, spinningFriction=0.05)
        self.time = 0.0
        self.target = list(HOME)
        self.trajectory = None
        self.is_closed = False
        self.slips_until = -1.0
        self.battery = 1.0
        self.is_docked = False
        self.power = 0.0
        self.camera_hangs = False
        self.faults = not arguments.no_faults
        self.looks = self.lifts = 0
        self.has_lifted = False

    @staticmethod
    def load_arm(client):
        arm = pybullet.loadURDF("franka_panda/panda.urdf", [0, 0, 0], useFixedBase=True, physicsClientId=client)
        for joint, position in enumerate(HOME):
            pybullet.resetJointState(arm, joint, position, physicsClientId=client)
        for finger in FINGERS:
            pybullet.resetJointState(arm, finger, 0.04, physicsClientId=client)
        return arm

    def step(self):
        self.follow()
        for joint, position in enumerate(self.target):
            pybullet.setJointMotorControl2(self.arm, joint, pybullet.POSITION_CONTROL, targetPosition=position,
                                           force=200, maxVelocity=2.5)
        slips = self.time < self.slips_until
        gap, force = (0.04, 30) if slips or not self.is_closed else (0.0, 25)
        for finger in FINGERS:
            pybullet.setJointMotorControl2(self.arm, finger, pybullet.POSITION_CONTROL, targetPosition=gap, force=force,
                                           maxVelocity=0.15)
        pybullet.stepSimulation()
        self.time += STEP
        is_moving = self.trajectory is not None
        self.power += ((4.0 if is_moving else 1.0) - self.power) * STEP
        self.battery = min(1.0, max(0.0, self.battery + (0.12 if self.is_charging() else -0.0035 * self.power) * STEP))

    def is_charging(self):
        return self.is_docked and max(abs(a - b) for a, b in zip(self.joints()[0], HOME)) < 0.1

    def joints(self):
        states = pybullet.getJointStates(self.arm, [*range(7), *FINGERS])
        return [state[0] for state in states], [state[1] for state in states]

    def follow(self):
        """Sets the target that the trajectory has now."""
        if self.trajectory is None:
            return
        began, times, points = self.trajectory
        now = self.time - began
        self.target = [float(numpy.interp(now, times, points[:, joint])) for joint in range(7)]

    def begin(self, goal):
        """Begins the trajectory of a goal; returns whether it can be followed."""
        points = goal.trajectory.points
        if list(goal.trajectory.joint_names) != JOINTS or not points:
            return False
        times = [point.time_from_start.sec + point.time_from_start.nanosec * 1e-9 for point in points]
        positions = numpy.array([point.positions for point in points], dtype=float)
        if positions.shape != (len(points), 7) or sorted(times) != times or times[0] <= 0:
            return False
        if (positions < LOW - 0.01).any() or (positions > HIGH + 0.01).any():
            return False
        start = numpy.array([self.joints()[0][:7]])
        self.trajectory = (self.time, [0.0, *times], numpy.vstack([start, positions]))
        return True

    def stop(self):
        self.trajectory = None
        self.target = self.joints()[0][:7]

    def solve(self, place, yaw):
        downward = pybullet.getQuaternionFromEuler([math.pi, 0, yaw])
        here = self.joints()[0]
        for start in (here[:7], HOME):
            for joint, position in enumerate(start):
                pybullet.resetJointState(self.ghost, joint, position, physicsClientId=self.ghost_client)
            for _ in range(60):
                found = pybullet.calculateInverseKinematics(
                    self.ghost, GRASP, place, downward, lowerLimits=list(LOW), upperLimits=list(HIGH),
                    jointRanges=list(HIGH - LOW), restPoses=list(start), maxNumIterations=50,
                    physicsClientId=self.ghost_client)[:7]
                for joint, position in enumerate(found):
                    pybullet.resetJointState(self.ghost, joint, position, physicsClientId=self.ghost_client)
                state = pybullet.getLinkState(self.ghost, GRASP, computeForwardKinematics=True,
                                              physicsClientId=self.ghost_client)
                if math.dist(state[4], place) < 0.003:
                    break
            is_inside = (numpy.array(found) >= LOW).all() and (numpy.array(found) <= HIGH).all()
            if math.dist(state[4], place) < 0.006 and is_inside:
                return True, list(found)
        return False, [0.0] * 7

    def holds(self):
        return self.is_closed and sum(self.joints()[0][7:]) > 0.015

    def note_lift(self):
        """The second block that is lifted slips out of the fingers."""
        if not self.holds():
            self.has_lifted = False
        elif not self.has_lifted and pybullet.getLinkState(self.arm, GRASP)[0][2] > 0.12:
            self.has_lifted = True
            self.lifts += 1
            if self.faults and self.lifts == 2:
                self.slips_until = self.time + 0.6

    def picture(self, path, width=960, height=640):
        view = pybullet.computeViewMatrix([1.25, 0.75, 0.62], [0.33, -0.03, 0.22], [0, 0, 1])
        projection = pybullet.computeProjectionMatrixFOV(48, width / height, 0.05, 5)
        pixels = pybullet.getCameraImage(width, height, view, projection, lightDirection=[1, 1, 2], shadow=1,
                                         renderer=pybullet.ER_TINY_RENDERER)[2]
        rows = numpy.reshape(pixels, (height, width, 4))[:, :, :3].astype(numpy.uint8)
        chunk = lambda kind, data: (struct.pack(">I", len(data)) + kind + data
                                    + struct.pack(">I", zlib.crc32(kind + data)))
        header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
        data = zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows), 9)
        with open(path, "wb") as file:
            file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b""))


class Arm:
    """The node around the world: services run in the thread of the main loop."""

    def __init__(self, arguments):
        self.world = World(arguments)
        self.requests = queue.Queue()
        self.node = node = Node("panda", arguments.port)
        self.joint_states = node.advertise("/joint_states", "sensor_msgs/msg/JointState")
        self.battery = node.advertise("/battery", "sensor_msgs/msg/BatteryState")
        self.seen = node.advertise("/camera/blocks", "geometry_msgs/msg/PoseArray")
        self.serve("/solve_ik", "manipulator_interfaces/srv/SolveIk", self.solve_ik)
        self.serve("/gripper/close", "std_srvs/srv/SetBool", self.close_gripper)
        self.serve("/dock", "std_srvs/srv/SetBool", self.dock)
        self.serve("/camera/reset", "std_srvs/srv/Trigger", self.reset_camera)
        self.serve("/stop", "std_srvs/srv/Trigger", self.stop)
        self.action = ActionServer(node, "/arm_controller/follow_joint_trajectory", FOLLOW,
                                   lambda goal: self.call(lambda: self.world.begin(goal)),
                                   lambda: self.call(self.world.stop))
        self.picture = arguments.picture

    def call(self, function):
        """Calls a function in the main loop and returns its value."""
        future = concurrent.futures.Future()
        self.requests.put((function, future))
        return future.result(timeout=10)

    def serve(self, service, kind, function):
        self.node.serve(service, kind, lambda request: self.call(
            lambda: self.node.make(f"{kind}_Response", **function(request))))

    def solve_ik(self, request):
        is_reachable, positions = self.world.solve([request.place.x, request.place.y, request.place.z], request.yaw)
        return {"is_reachable": is_reachable, "positions": numpy.array(positions)}

    def close_gripper(self, request):
        world = self.world
        world.is_closed = bool(request.data)
        # The fingers need half a second, in which nothing else is served.
        for _ in range(int(0.5 / STEP)):
            world.step()
        held = world.holds()
        say(world, f"gripper {'closes' if request.data else 'opens'}{', holds a block' if held else ''}")
        return {"success": held == bool(request.data), "message": "holds a block" if held else "holds nothing"}

    def dock(self, request):
        self.world.is_docked = bool(request.data)
        return {"success": True, "message": "docked" if request.data else "undocked"}

    def reset_camera(self, _):
        say(self.world, "camera is reset")
        self.world.camera_hangs = False
        return {"success": True, "message": "camera is reset"}

    def stop(self, _):
        self.world.stop()
        self.action.end(ABORTED, error_code=-1, error_string="stopped")
        say(self.world, "motors are stopped")
        return {"success": True, "message": "motors are stopped"}

    def publish_joints(self):
        positions, velocities = self.world.joints()
        names = [*JOINTS, "panda_finger_joint1", "panda_finger_joint2"]
        self.joint_states(header=self.node.header(), name=names, position=numpy.array(positions),
                          velocity=numpy.array(velocities), effort=numpy.array([]))

    def publish_battery(self):
        percentage = self.world.battery
        status = 1 if self.world.is_charging() else 2
        self.battery(header=self.node.header(), voltage=21.0 + 4.2 * percentage, percentage=percentage, present=True,
                     power_supply_status=status)

    def publish_blocks(self):
        world = self.world
        world.looks += 1
        if world.faults and world.looks in (25, 130):
            say(world, "camera hangs")
            world.camera_hangs = True
        if world.camera_hangs:
            return
        poses = []
        for block in world.blocks.values():
            (x, y, z), turn = pybullet.getBasePositionAndOrientation(block)
            place = self.node.make("geometry_msgs/msg/Point", x=x, y=y, z=z)
            turn = self.node.make("geometry_msgs/msg/Quaternion", x=turn[0], y=turn[1], z=turn[2], w=turn[3])
            poses.append(self.node.make("geometry_msgs/msg/Pose", position=place, orientation=turn))
        self.seen(header=self.node.header(), poses=poses)

    def check_goal(self):
        world = self.world
        if world.trajectory is None:
            return
        began, times, points = world.trajectory
        here = numpy.array(world.joints()[0][:7])
        error = float(numpy.abs(here - world.target).max())
        self.feed(here)
        if error > 0.6:
            world.stop()
            self.action.end(ABORTED, error_code=-4, error_string=f"{error:.2f} rad from the path")
        elif world.time - began > times[-1] and float(numpy.abs(here - points[-1]).max()) < 0.02:
            world.trajectory = None
            self.action.end(SUCCEEDED, error_code=0)
        elif world.time - began > times[-1] + 2.0:
            world.stop()
            self.action.end(ABORTED, error_code=-5, error_string=f"{error:.2f} rad from the goal")

    def feed(self, here):
        point = lambda positions: self.node.make("trajectory_msgs/msg/JointTrajectoryPoint", positions=positions)
        self.action.publish_feedback(header=self.node.header(), joint_names=JOINTS, actual=point(here),
                                     desired=point(numpy.array(self.world.target)))

    def run(self, speed):
        world = self.world
        due = {self.publish_joints: 0.0, self.publish_battery: 0.0, self.publish_blocks: 0.0, self.check_goal: 0.0}
        periods = {self.publish_joints: 1 / 50, self.publish_battery: 1 / 2, self.publish_blocks: 1 / 5,
                   self.check_goal: 1 / 20}
        began = time.monotonic()
        while True:
            try:
                # Physics that is behind does not catch up: time is then slower.
                lag = world.time / speed - (time.monotonic() - began)
                if lag < -0.2:
                    began -= lag
                function, future = self.requests.get(timeout=max(lag, 0) or 1e-6)
                try:
                    future.set_result(function())
                except Exception as error:
                    future.set_exception(error)
                continue
            except queue.Empty:
                pass
            world.step()
            world.note_lift()
            for publish, at in due.items():
                if world.time >= at:
                    due[publish] = max(at + periods[publish], world.time)
                    publish()
            if self.picture and world.lifts == 1 and pybullet.getLinkState(world.arm, GRASP)[0][2] > 0.25:
                world.picture(self.picture)
                self.picture = None


def say(world, text):
    print(f"{world.time:7.1f} s  arm: {text}", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=7447)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--no-faults", action="store_true")
    parser.add_argument("--picture")
    arguments = parser.parse_args()
    # Threads of the session would outlive an exit by an exception.
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    arm = Arm(arguments)
    say(arm.world, "ready")
    arm.run(arguments.speed)


main()
