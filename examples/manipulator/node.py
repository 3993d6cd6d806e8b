"""A node of ROS 2 without ROS: topics, services and actions by zenoh-ros2-sdk, with the keys of rmw_zenoh.

rosbags computes the hashes of the types; the SDK, which looks for definitions in the network, gets them from here.
"""

import pathlib
import threading
import time

import zenoh
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceServer
from zenoh_ros2_sdk.session import ZenohSession

HERE = pathlib.Path(__file__).resolve().parent
FOLDERS = [HERE / "interfaces", HERE.parents[1] / "robots" / "interfaces"]
SERVICES = {
    "std_srvs/srv/Trigger": "---\nbool success\nstring message\n",
    "std_srvs/srv/SetBool": "bool data\n---\nbool success\nstring message\n",
    "action_msgs/srv/CancelGoal": "GoalInfo goal_info\n---\nint8 return_code\nGoalInfo[] goals_canceling\n",
}
PARTS = {"msg": [""], "srv": ["_Request", "_Response"], "action": ["_Goal", "_Result", "_Feedback"]}
ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = 1, 2, 3, 4, 5, 6


def nested(name):
    return (Nodetype.NAME, name)


class Node:
    """A node, with its session and its types. In place of the router of rmw_zenoh it listens itself."""

    def __init__(self, name, port):
        self.name = name
        self.port = port
        config = zenoh.Config()
        config.insert_json5("mode", '"router"')
        config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{port}"]')
        config.insert_json5("scouting/multicast/enabled", "false")
        self.router = zenoh.open(config)
        self.session = ZenohSession.get_instance("127.0.0.1", port)
        self.store = self.session.store = get_typestore(Stores.ROS2_JAZZY)
        # To ROS 2 `char` is another name of `uint8`; rosbags makes a type of its own of it.
        constants, fields = self.store.fielddefs["service_msgs/msg/ServiceEventInfo"]
        byte = (Nodetype.BASE, ("uint8", 0))
        fields = [(name, (Nodetype.ARRAY, (byte, 16)) if name == "client_gid" else kind) for name, kind in fields]
        self.store.fielddefs["service_msgs/msg/ServiceEventInfo"] = (constants, fields)
        for name, text in SERVICES.items():
            self.define(name, text)
        for folder in FOLDERS:
            for kind in ("msg", "srv", "action"):
                for path in sorted(folder.glob(f"*/{kind}/*.{kind}")):
                    full = f"{path.parents[1].name}/{kind}/{path.stem}"
                    if full not in self.store.fielddefs:
                        self.define(full, path.read_text(encoding="utf-8"))

    def define(self, name, text):
        package, kind, base = name.split("/")
        lines = [[]]
        for line in text.splitlines():
            if line.strip() == "---":
                lines.append([])
            else:
                lines[-1].append(line)
        for suffix, part in zip(PARTS[kind], lines):
            # rosbags has messages only: parts of services and actions are read as such, and renamed.
            types = get_types_from_msg("\n".join(part) + "\n", f"{package}/msg/{base}{suffix}")
            self.add(name + suffix, list(types.values())[0])
        if kind == "action":
            self.define_action(name)
        elif kind == "srv":
            self.define_service(name)

    def add(self, name, definition):
        self.store.register({name: definition})

    def define_service(self, name):
        for suffix in ("_Request", "_Response"):
            self.session._registered_types[name + suffix] = name + suffix
            # The SDK says `srv` for the parts of actions too.
            self.session._registered_types[(name + suffix).replace("/action/", "/srv/")] = name + suffix
        one = lambda suffix: (Nodetype.SEQUENCE, (nested(name + suffix), 1))
        self.add(name + "_Event", ([], [("info", nested("service_msgs/msg/ServiceEventInfo")),
                                        ("request", one("_Request")), ("response", one("_Response"))]))
        self.add(name, ([], [("request_message", nested(name + "_Request")),
                             ("response_message", nested(name + "_Response")),
                             ("event_message", nested(name + "_Event"))]))

    def define_action(self, name):
        goal_id = ("goal_id", nested("unique_identifier_msgs/msg/UUID"))
        base = lambda kind: (Nodetype.BASE, (kind, 0))
        self.add(name + "_SendGoal_Request", ([], [goal_id, ("goal", nested(name + "_Goal"))]))
        self.add(name + "_SendGoal_Response", ([], [("accepted", base("bool")),
                                                    ("stamp", nested("builtin_interfaces/msg/Time"))]))
        self.add(name + "_GetResult_Request", ([], [goal_id]))
        self.add(name + "_GetResult_Response", ([], [("status", base("int8")), ("result", nested(name + "_Result"))]))
        self.add(name + "_FeedbackMessage", ([], [goal_id, ("feedback", nested(name + "_Feedback"))]))
        self.define_service(name + "_SendGoal")
        self.define_service(name + "_GetResult")

    def make(self, kind, **fields):
        """Returns a message; fields that are not given are zero or empty."""
        values = {name: fields[name] if name in fields else self.zero(of) for name, of in self.store.fielddefs[kind][1]}
        unknown = set(fields) - set(values)
        assert not unknown, f"{kind} has no {unknown}"
        return self.store.types[kind](**values)

    def zero(self, description):
        import numpy

        node, of = description
        if node == Nodetype.NAME:
            return self.make(of)
        if node == Nodetype.BASE:
            return "" if of[0] == "string" else False if of[0] == "bool" else 0.0 if of[0].startswith("float") else 0
        item, size = of
        count = size if node == Nodetype.ARRAY else 0
        if item[0] == Nodetype.BASE and item[1][0] != "string":
            return numpy.zeros(count, dtype=item[1][0])
        return [self.zero(item) for _ in range(count)]

    def now(self):
        nanoseconds = time.time_ns()
        return self.make("builtin_interfaces/msg/Time", sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)

    def header(self, frame="panda_link0"):
        return self.make("std_msgs/msg/Header", stamp=self.now(), frame_id=frame)

    def advertise(self, topic, kind):
        self.session._registered_types[kind] = kind
        publisher = ROS2Publisher(topic, kind, msg_definition="", node_name=self.name, router_port=self.port,
                                  type_hash=self.store.hash_rihs01(kind))
        return lambda **fields: publisher.publish(**vars(self.make(kind, **fields)))

    def serve(self, service, kind, callback, mode="callback"):
        return ROS2ServiceServer(service, kind, callback=callback, request_definition="", response_definition="",
                                 node_name=self.name, router_port=self.port, mode=mode,
                                 type_hash=self.store.hash_rihs01(kind))


class ActionServer:
    """An action whose goals are pursued one at a time by `begin(goal)`, until `end(status, **result)` is called."""

    def __init__(self, node, action, kind, begin, stop):
        self.node, self.kind, self.begin, self.stop = node, kind, begin, stop
        self.lock = threading.RLock()
        self.goals = {}
        self.waiting = {}
        self.current = None
        self.feedback = node.advertise(f"{action}/_action/feedback", f"{kind}_FeedbackMessage")
        self.status = node.advertise(f"{action}/_action/status", "action_msgs/msg/GoalStatusArray")
        node.serve(f"{action}/_action/send_goal", f"{kind}_SendGoal", self.take_goal)
        node.serve(f"{action}/_action/cancel_goal", "action_msgs/srv/CancelGoal", self.cancel)
        self.results = node.serve(f"{action}/_action/get_result", f"{kind}_GetResult", None, mode="queue")
        threading.Thread(target=self.take_results, daemon=True).start()

    def take_goal(self, request):
        # The main loop takes the lock too, so nothing is asked of it under the lock.
        name = bytes(request.goal_id.uuid)
        accepted = self.current is None and self.begin(request.goal)
        with self.lock:
            if accepted:
                self.current = name
                self.goals[name] = [EXECUTING, None]
                self.tell()
            return self.node.make(f"{self.kind}_SendGoal_Response", accepted=accepted, stamp=self.node.now())

    def cancel(self, request):
        name = bytes(request.goal_info.goal_id.uuid)
        cancelled = []
        current = self.current
        if current is not None and (name == current or not any(name)):
            self.stop()
            with self.lock:
                if self.current == current:
                    cancelled.append(self.node.make("action_msgs/msg/GoalInfo", goal_id=self.uuid(current)))
                    self.end(CANCELED)
        code = 0 if cancelled else 2
        return self.node.make("action_msgs/srv/CancelGoal_Response", return_code=code, goals_canceling=cancelled)

    def uuid(self, name):
        import numpy

        return self.node.make("unique_identifier_msgs/msg/UUID", uuid=numpy.frombuffer(name, dtype=numpy.uint8))

    def publish_feedback(self, **fields):
        with self.lock:
            if self.current is not None:
                feedback = self.node.make(f"{self.kind}_Feedback", **fields)
                self.feedback(goal_id=self.uuid(self.current), feedback=feedback)

    def end(self, status, **result):
        with self.lock:
            if self.current is None:
                return
            name, self.current = self.current, None
            self.goals[name] = [status, self.node.make(f"{self.kind}_Result", **result)]
            self.tell()
            for key in self.waiting.pop(name, []):
                self.answer(key, name)

    def tell(self):
        statuses = [self.node.make("action_msgs/msg/GoalStatus", status=status,
                                   goal_info=self.node.make("action_msgs/msg/GoalInfo", goal_id=self.uuid(name)))
                    for name, (status, _) in list(self.goals.items())[-10:]]
        self.status(status_list=statuses)

    def take_results(self):
        while True:
            key, request = self.results.take_request()
            with self.lock:
                name = bytes(request.goal_id.uuid)
                if name in self.goals and self.goals[name][1] is None:
                    self.waiting.setdefault(name, []).append(key)
                else:
                    self.answer(key, name)

    def answer(self, key, name):
        status, result = self.goals.get(name, [0, None])
        result = result or self.node.make(f"{self.kind}_Result")
        self.results.send_response(key, self.node.make(f"{self.kind}_GetResult_Response", status=status, result=result))
