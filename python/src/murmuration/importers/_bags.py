"""Bags of ROS 1 and ROS 2, and MCAP files, as columns of numbers: read through `rosbags`."""

from __future__ import annotations

import contextlib
import difflib
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from murmuration.importers._tracks import MOST_MESSAGES, LogError

ODOMETRY = "nav_msgs/msg/Odometry"
TF = "tf2_msgs/msg/TFMessage"
TWIST = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
ACKERMANN = ("ackermann_msgs/msg/AckermannDrive", "ackermann_msgs/msg/AckermannDriveStamped")

# Definitions for bags that hold none: as ackermann_msgs publishes these messages.
_ACKERMANN_DRIVE = (
    "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
)
_ACKERMANN_STAMPED = "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n"

# A message becomes rows: the child frame (of transforms), the header or None, and numbers.
Row = tuple[str, Any, tuple[float, ...]]


def _pose(pose: Any) -> tuple[float, ...]:
    at, turn = pose.position, pose.orientation
    return (at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)


def _transform(stamped: Any) -> Row:
    at, turn = stamped.transform.translation, stamped.transform.rotation
    return stamped.child_frame_id.lstrip("/"), stamped.header, (at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)


def _twist(twist: Any) -> tuple[float, ...]:
    return (twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.z)


def _drive(drive: Any) -> tuple[float, ...]:
    return (drive.speed, drive.steering_angle)


POSES: dict[str, Callable[[Any], list[Row]]] = {
    ODOMETRY: lambda m: [("", m.header, _pose(m.pose.pose))],
    "geometry_msgs/msg/PoseStamped": lambda m: [("", m.header, _pose(m.pose))],
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: [("", m.header, _pose(m.pose.pose))],
    "geometry_msgs/msg/TransformStamped": lambda m: [("", m.header, _transform(m)[2])],
    TF: lambda m: [_transform(stamped) for stamped in m.transforms],
}
COMMANDS: dict[str, Callable[[Any], list[Row]]] = {
    TWIST[0]: lambda m: [("", None, _twist(m))],
    TWIST[1]: lambda m: [("", m.header, _twist(m.twist))],
    ACKERMANN[0]: lambda m: [("", None, _drive(m))],
    ACKERMANN[1]: lambda m: [("", m.header, _drive(m.drive))],
}


@dataclass(frozen=True)
class Topic:
    """A topic of a bag."""

    name: str
    type: str
    messages: int


@dataclass
class Series:
    """The messages of one topic, and of one child frame where they are transforms, in the order of the bag."""

    frames: set[str] = field(default_factory=set)
    """Frames that their headers name."""
    stamps_ns: Any = field(default_factory=list)
    """Times of their headers; -1 where there is none."""
    recorded_ns: Any = field(default_factory=list)
    """Times at which the bag recorded them."""
    values: Any = field(default_factory=list)
    """Numbers: shape (messages, 7) of poses (x, y, z, then the quaternion x, y, z, w), (messages, 4) of twists, (messages, 2) of cars."""

    def add(self, header: Any, recorded_ns: int, values: tuple[float, ...]) -> None:
        """Adds a message."""
        self.stamps_ns.append(-1 if header is None else header.stamp.sec * 1_000_000_000 + header.stamp.nanosec)
        if header is not None and header.frame_id:
            self.frames.add(header.frame_id.lstrip("/"))
        self.recorded_ns.append(recorded_ns)
        self.values.append(values)

    def as_arrays(self) -> Series:
        """The same with arrays of numpy."""
        stamps, recorded = (np.array(times, dtype=np.int64) for times in (self.stamps_ns, self.recorded_ns))
        return Series(self.frames, stamps, recorded, np.array(self.values, dtype=float))


class Bag:
    """An open bag."""

    def __init__(self, path: Path, reader: Any) -> None:
        self.path = path
        self._reader = reader
        counts: dict[tuple[str, str], int] = {}
        for connection in reader.connections:
            key = (connection.topic, connection.msgtype)
            counts[key] = counts.get(key, 0) + connection.msgcount
        self.topics = [Topic(*key, messages) for key, messages in sorted(counts.items())]

    def topic(self, name: str, types: dict[str, Any]) -> Topic:
        """The topic of this name, which must be of one of the types and hold messages."""
        found = [topic for topic in self.topics if topic.name == name]
        if not found:
            nearest = difflib.get_close_matches(name, [topic.name for topic in self.topics], n=1, cutoff=0.0)
            raise LogError(f"{self.path} has no topic {name}" + (f"; the nearest name is {nearest[0]}" if nearest else ""))
        fitting = [topic for topic in found if topic.type in types]
        if not fitting:
            allowed = ", ".join(types)
            raise LogError(f"the topic {name} of {self.path} is of type {found[0].type}; it must be one of {allowed}")
        if len(found) > 1:
            raise LogError(f"the topic {name} of {self.path} has several types: {', '.join(topic.type for topic in found)}")
        if found[0].messages == 0:
            raise LogError(f"the topic {name} of {self.path} has no messages")
        return found[0]

    def read(self, names: set[str]) -> dict[str, dict[str, Series]]:
        """The messages of these topics, by topic and child frame ("" where they are no transforms)."""
        wanted = [connection for connection in self._reader.connections if connection.topic in names]
        rows: dict[str, dict[str, Series]] = {name: {} for name in names}
        n_messages = 0
        if not wanted:
            return rows
        try:
            for connection, recorded_ns, data in self._reader.messages(connections=wanted):
                n_messages += 1
                if n_messages > MOST_MESSAGES:
                    raise LogError(f"{self.path} has more than {MOST_MESSAGES} messages on these topics; split the bag")
                read = POSES.get(connection.msgtype) or COMMANDS[connection.msgtype]
                of_topic = rows[connection.topic]
                for child, header, values in read(self._reader.deserialize(data, connection.msgtype)):
                    of_topic.setdefault(child, Series()).add(header, recorded_ns, values)
        except LogError:
            raise
        except Exception as error:  # noqa: BLE001: a damaged file makes rosbags fail in many ways
            raise LogError(f"{self.path} cannot be read after {n_messages} messages, is it damaged? rosbags says: {error}") from error
        return {name: {child: series.as_arrays() for child, series in of_topic.items()} for name, of_topic in rows.items()}


@contextlib.contextmanager
def open_bag(path: str | os.PathLike[str]) -> Iterator[Bag]:
    """Opens a folder with a bag of ROS 2, a file .mcap or .db3, or a bag of ROS 1 (.bag)."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    path = Path(path)
    if not path.exists():
        raise LogError(f"{path} does not exist")
    types = get_typestore(Stores.LATEST)
    for name, text in (("AckermannDrive", _ACKERMANN_DRIVE), ("AckermannDriveStamped", _ACKERMANN_STAMPED)):
        types.register(get_types_from_msg(text, f"ackermann_msgs/msg/{name}"))
    try:
        reader = AnyReader([path], default_typestore=types)
        reader.open()
    except Exception as error:  # noqa: BLE001: a damaged file makes rosbags fail in many ways
        kinds = "a folder with a bag of ROS 2, a file .mcap or .db3, or a bag of ROS 1 (.bag)"
        raise LogError(f"{path} cannot be opened as {kinds}: {error}") from error
    try:
        yield Bag(path, reader)
    finally:
        reader.close()
