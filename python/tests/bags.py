"""Bags for the tests, written by rosbags: poses and commands of robots that are made here."""

from dataclasses import dataclass, field

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS2 = get_typestore(Stores.ROS2_HUMBLE)
DRIVE = "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
for store in (ROS1, ROS2):
    store.register(get_types_from_msg(DRIVE, "ackermann_msgs/msg/AckermannDrive"))
    stamped = "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n"
    store.register(get_types_from_msg(stamped, "ackermann_msgs/msg/AckermannDriveStamped"))

START_NS = 1_700_000_000_250_000_000
START_S = 1_700_000_000.25


@dataclass
class BagWriter:
    """Messages of a bag, in any order; `write` sorts them by the time at which they are recorded."""

    ros1: bool = False
    messages: list = field(default_factory=list)
    silent: list = field(default_factory=list)
    """Topics without messages, with their type."""

    @property
    def types(self):
        return (ROS1 if self.ros1 else ROS2).types

    def header(self, time_ns, frame="map"):
        stamp = self.types["builtin_interfaces/msg/Time"](sec=int(time_ns // 10**9), nanosec=int(time_ns % 10**9))
        more = {"seq": 0} if self.ros1 else {}
        return self.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **more)

    def pose(self, x, y, heading=0.0, z=0.0, quaternion=None):
        quaternion = quaternion or (0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2))
        return self.types["geometry_msgs/msg/Pose"](
            position=self.types["geometry_msgs/msg/Point"](x=float(x), y=float(y), z=float(z)),
            orientation=self.types["geometry_msgs/msg/Quaternion"](*map(float, quaternion)),
        )

    def twist(self, x=0.0, y=0.0, z=0.0, turn=0.0):
        vector = self.types["geometry_msgs/msg/Vector3"]
        return self.types["geometry_msgs/msg/Twist"](linear=vector(float(x), float(y), float(z)), angular=vector(0.0, 0.0, float(turn)))

    def add(self, topic, kind, message, recorded_ns):
        self.messages.append((int(recorded_ns), topic, kind, message))

    def add_odometry(self, topic, time_ns, x, y, heading=0.0, recorded_ns=None, frame="odom", **pose):
        types = self.types
        with_covariance = types["geometry_msgs/msg/PoseWithCovariance"](pose=self.pose(x, y, heading, **pose), covariance=np.zeros(36))
        moving = types["geometry_msgs/msg/TwistWithCovariance"](twist=self.twist(), covariance=np.zeros(36))
        kind = "nav_msgs/msg/Odometry"
        message = types[kind](header=self.header(time_ns, frame), child_frame_id="base_link", pose=with_covariance, twist=moving)
        self.add(topic, kind, message, time_ns if recorded_ns is None else recorded_ns)

    def add_pose(self, topic, time_ns, x, y, heading=0.0, covariance=False, **pose):
        types, own = self.types, self.pose(x, y, heading, **pose)
        kind = f"geometry_msgs/msg/Pose{'WithCovariance' * covariance}Stamped"
        if covariance:
            own = types["geometry_msgs/msg/PoseWithCovariance"](pose=own, covariance=np.zeros(36))
        self.add(topic, kind, types[kind](header=self.header(time_ns), pose=own), time_ns)

    def transform(self, child, time_ns, x, y, heading=0.0, parent="map"):
        types, own = self.types, self.pose(x, y, heading)
        turned = types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](float(x), float(y), 0.0), rotation=own.orientation
        )
        return types["geometry_msgs/msg/TransformStamped"](header=self.header(time_ns, parent), child_frame_id=child, transform=turned)

    def add_transforms(self, topic, time_ns, transforms):
        kind = "tf2_msgs/msg/TFMessage"
        self.add(topic, kind, self.types[kind](transforms=transforms), time_ns)

    def add_twist(self, topic, time_ns, x=0.0, y=0.0, z=0.0, turn=0.0, frame=None, recorded_ns=None):
        message, kind = self.twist(x, y, z, turn), "geometry_msgs/msg/Twist"
        if frame is not None:
            kind = "geometry_msgs/msg/TwistStamped"
            message = self.types[kind](header=self.header(time_ns, frame), twist=message)
        self.add(topic, kind, message, time_ns if recorded_ns is None else recorded_ns)

    def add_drive(self, topic, time_ns, speed, steer, stamped=True):
        message = self.types["ackermann_msgs/msg/AckermannDrive"](float(steer), 0.0, float(speed), 0.0, 0.0)
        kind = f"ackermann_msgs/msg/AckermannDrive{'Stamped' * stamped}"
        if stamped:
            message = self.types[kind](header=self.header(time_ns, "base_link"), drive=message)
        self.add(topic, kind, message, time_ns)

    def write(self, path, storage=StoragePlugin.MCAP):
        """Writes the bag and returns its path: a folder, or a file .bag."""
        store = ROS1 if self.ros1 else ROS2
        path = path.with_suffix(".bag") if self.ros1 else path
        with Writer1(path) if self.ros1 else Writer(path, version=8, storage_plugin=storage) as writer:
            kinds = {topic: kind for _, topic, kind, _ in self.messages} | dict(self.silent)
            own = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
            for recorded_ns, topic, kind, message in sorted(self.messages, key=lambda one: one[0]):
                data = store.serialize_ros1(message, kind) if self.ros1 else store.serialize_cdr(message, kind)
                writer.write(own[topic], recorded_ns, bytes(data))
        return path
