"""Stand-ins of the classes of ROS 2 that robotsim/examples/ros2/node.py uses, and a world of unicycles behind them."""

import math
import sys
import threading
import types
from types import SimpleNamespace as Record

ODOMETRY_EVERY = 20


def message(**fields):
    """A class of messages with these fields, each made anew by its function."""

    class Message(Record):
        def __init__(self, **given):
            super().__init__(**({name: make() for name, make in fields.items()} | given))

    return Message


def point():
    return Record(x=0.0, y=0.0, z=0.0)


Twist = message(linear=point, angular=point)
String = message(data=str)
WorldControl = message(pause=bool, multi_step=int, reset=lambda: Record(all=False))
ControlWorld = Record(Request=message(world_control=WorldControl))


class World:
    """Unicycles, `n` of them on a line 3 m apart, which move only while they are stepped."""

    def __init__(self, n, silent=(), physics_step_ns=1_000_000):
        self.n, self.silent, self.physics_step_ns = n, set(silent), physics_step_ns
        self.heard, self.subscriptions = [[] for _ in range(n)], {}
        self.stepped_ns = []
        self.lock = threading.RLock()
        self.restart()

    def restart(self):
        self.time_ns = 0
        self.pose = [[3.0 * robot, 0.0, math.pi / 2] for robot in range(self.n)]
        self.command = [(0.0, 0.0)] * self.n

    def step(self, count):
        with self.lock:
            for _ in range(count):
                self.time_ns += self.physics_step_ns
                for pose, (speed, rate) in zip(self.pose, self.command):
                    pose[0] += speed * math.cos(pose[2]) * self.physics_step_ns / 1e9
                    pose[1] += speed * math.sin(pose[2]) * self.physics_step_ns / 1e9
                    pose[2] += rate * self.physics_step_ns / 1e9
                if self.time_ns // self.physics_step_ns % ODOMETRY_EVERY == 0:
                    self.publish_odometry()
            self.tell("/clock", Record(clock=self.stamp()))

    def stamp(self):
        return Record(sec=self.time_ns // 1_000_000_000, nanosec=self.time_ns % 1_000_000_000)

    def publish_odometry(self):
        for robot, (x, y, yaw) in enumerate(self.pose):
            if robot not in self.silent:
                at = Record(position=Record(x=x, y=y, z=0.0), orientation=Record(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)))
                self.tell(f"/robot{robot}/odom", Record(header=Record(stamp=self.stamp()), pose=Record(pose=at)))

    def tell(self, topic, what):
        if topic in self.subscriptions:
            self.subscriptions[topic](what)

    def receive(self, topic, what):
        robot, name = topic.removeprefix("/robot").split("/")
        with self.lock:
            if name == "heard":
                self.heard[int(robot)].append(what.data)
            else:
                self.command[int(robot)] = (what.linear.x, what.angular.z)

    def control(self, request):
        with self.lock:
            if request.world_control.reset.all:
                self.restart()
            if request.world_control.multi_step:
                self.stepped_ns.append(request.world_control.multi_step * self.physics_step_ns)
                self.step(request.world_control.multi_step)


class Future:
    """The reply to a call, which another thread brings."""

    def __init__(self, work):
        self.callbacks, self.done = [], threading.Event()
        threading.Thread(target=self.run, args=[work], daemon=True).start()

    def run(self, work):
        work()
        self.done.set()
        for callback in self.callbacks:
            callback(self)

    def add_done_callback(self, callback):
        self.callbacks.append(callback)
        if self.done.is_set():
            callback(self)

    def result(self):
        return Record(success=True)


class Node:
    """What node.py asks of a node."""

    def __init__(self, world):
        self.world = world

    def create_subscription(self, _, topic, callback, __):
        self.world.subscriptions[topic] = callback

    def create_publisher(self, _, topic, __):
        return Record(publish=lambda what: self.world.receive(topic, what))

    def create_client(self, _, name):
        call = lambda request: Future(lambda: self.world.control(request))  # noqa: E731
        return Record(srv_name=name, wait_for_service=lambda timeout_sec: True, call_async=call)


def install():
    """Puts modules of these names where `import` finds them."""
    names = {
        "rclpy": {}, "rclpy.executors": {"SingleThreadedExecutor": object}, "rclpy.qos": {"qos_profile_sensor_data": None},
        "geometry_msgs.msg": {"Twist": Twist}, "nav_msgs.msg": {"Odometry": object}, "rosgraph_msgs.msg": {"Clock": object},
        "std_msgs.msg": {"String": String}, "ros_gz_interfaces.srv": {"ControlWorld": ControlWorld},
    }  # fmt: skip
    for name, content in names.items():
        for known in (name.split(".")[0], name):
            sys.modules.setdefault(known, types.ModuleType(known))
        vars(sys.modules[name]).update(content)
