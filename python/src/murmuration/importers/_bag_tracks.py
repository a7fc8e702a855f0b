"""Robots of a bag: which topics belong to which robot, and their poses and commands as rows."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from murmuration.importers._bags import ACKERMANN, COMMANDS, POSES, TF, TWIST, Bag, Series, Topic
from murmuration.importers._tracks import LogError, Notes, Options, Samples, Track, at_rate, in_force, natural, no_overlap, usable

Robots = Mapping[Any, "str | Mapping[str, str]"]


@dataclass(frozen=True)
class BagOptions(Options):
    """The options of `read_bag`."""

    twist: str
    command_frame: str | None
    time: str


def tracks_of(bag: Bag, robots: Robots | None, options: BagOptions, notes: Notes) -> dict[str, Track]:
    """The robots of a bag. Errors and ignored topics and messages are added to `notes`."""
    problems = notes.problems
    topics = _topics_of(bag, robots, problems)
    wanted: dict[str, dict[str, str]] = {}
    for name, own in topics.items():
        try:
            bag.topic(own["pose"], POSES)
            if "command" in own:
                bag.topic(own["command"], COMMANDS)
            wanted[name] = own
        except LogError as error:
            problems.append(f"robot {name}: {error}")
    series = bag.read({own[key] for own in wanted.values() for key in ("pose", "command") if key in own})
    topics_by_name = {topic.name: topic for topic in bag.topics}
    tracks = {}
    for name, own in wanted.items():
        try:
            tracks[name] = _track(f"robot {name} of {bag.path}", own, series, topics_by_name, options, notes.left_out)
        except LogError as error:
            problems.append(str(error))
    if any(track.kind is None for track in tracks.values()) and any(track.kind for track in tracks.values()):
        lacking = ", ".join(name for name, track in tracks.items() if track.kind is None)
        problems.append(f"{bag.path} has no commands for {lacking}, but for other robots; give the robots in robots=…")
    return tracks


def _topics_of(bag: Bag, robots: Robots | None, problems: list[str]) -> dict[str, dict[str, str]]:
    """For each robot the topics of its poses and commands, and the child frame of transforms."""
    if robots is None:
        return find_robots(bag)
    topics = {}
    for key, own in robots.items():
        name = str(key)
        if name in topics:
            problems.append(f"robot {name} is there twice")
        elif isinstance(own, str):
            try:
                topics[name] = _of_namespace(bag, own)
            except LogError as error:
                problems.append(f"robot {name}: {error}")
        elif not isinstance(own, Mapping) or "pose" not in own or set(own) - {"pose", "command", "frame"}:
            form = "a namespace or a mapping with pose, command and frame (the last two optional)"
            problems.append(f"robot {name}: must be {form}, got {own!r}")
        else:
            topics[name] = {part: str(topic) for part, topic in own.items() if topic is not None}
    return topics


def _of_namespace(bag: Bag, namespace: str) -> dict[str, str]:
    """The topics of poses and of commands below a namespace."""
    below = namespace.rstrip("/") + "/"
    found = {}
    for part, types in (("pose", POSES), ("command", COMMANDS)):
        names = [t.name for t in bag.topics if t.name.startswith(below) and t.type in types and t.type != TF and t.messages]
        if len(names) > 1:
            raise LogError(f"{below} has several topics of {part}s, name one of them:{listing(bag)}")
        found.update({part: name for name in names})
    if "pose" not in found:
        raise LogError(f"{bag.path} has no poses below {below}{listing(bag)}")
    return found


def find_robots(bag: Bag) -> dict[str, dict[str, str]]:
    """The robots of a bag, by namespaces."""
    usable = [topic for topic in bag.topics if topic.messages]
    poses = [topic.name for topic in usable if topic.type in POSES and topic.type != TF]
    commands = [topic.name for topic in usable if topic.type in COMMANDS]
    frames = {}
    if not poses:
        transforms = [topic.name for topic in usable if topic.type == TF and not topic.name.endswith("tf_static")]
        for topic, children in bag.read(set(transforms)).items():
            frames.update({f"/{child}": topic for child in children})
        poses = sorted(frames)
    if not poses:
        raise LogError(f"{bag.path} has no topic with poses ({', '.join(POSES)}){listing(bag)}")
    # A child frame may be the name of a robot; a topic is below its namespace.
    grouped = _by_namespace(poses, commands, 0 if frames else 1)
    if grouped is None:
        form = '{"car": {"pose": "/odom", "command": "/cmd_vel"}}'
        raise LogError(f"which topics of {bag.path} belong together? Name them, robots={form}:{listing(bag)}")
    return {
        name: ({"pose": frames[pose], "frame": pose[1:]} if frames else {"pose": pose}) | ({"command": command} if command else {})
        for name, (pose, command) in sorted(grouped.items(), key=lambda item: natural(item[0]))
    }  # fmt: skip


def _by_namespace(poses: list[str], commands: list[str], n_below: int) -> dict[str, tuple[str, str | None]] | None:
    """For each robot the topics of its poses and commands, by the shortest namespaces that tell all robots apart; None where none do.

    `n_below`: parts that the name of a topic of poses has below its namespace, at least.
    """
    if len(poses) == 1 and len(commands) <= 1:
        return {"robot": (poses[0], commands[0] if commands else None)}
    parts = {name: name.strip("/").split("/") for name in (*poses, *commands)}
    for depth in range(1, min(len(parts[pose]) for pose in poses) - n_below + 1):
        keys = [tuple(parts[pose][:depth]) for pose in poses]
        own = [[command for command in commands if tuple(parts[command][:depth]) == key] for key in keys]
        is_told_apart = len(set(keys)) == len(poses) and all(len(some) <= 1 for some in own)
        if is_told_apart and sum(map(len, own)) == len(commands):
            last = [key[-1] for key in keys]
            names = last if len(set(last)) == len(last) else ["/".join(key) for key in keys]
            return {name: (pose, some[0] if some else None) for name, pose, some in zip(names, poses, own, strict=True)}
    return None


def listing(bag: Bag) -> str:
    """The topics of a bag, one a line."""
    return "".join(f"\n    {topic.name}  {topic.type}  {topic.messages} messages" for topic in bag.topics) or "\n    (no topics)"


def _track(
    who: str, own: Mapping[str, str], series: Mapping[str, Mapping[str, Series]], topics: Mapping[str, Topic], options: BagOptions,
    left_out: list[str],
) -> Track:  # fmt: skip
    """The rows of one robot: its poses, each with the command in force."""
    topic = topics[own["pose"]]
    poses = _usable(f"{topic.name} ({who})", _of_frame(own, series[topic.name], topic.type), options, left_out)
    described = f"{topic.name} ({topic.type}, {topic.messages} messages)"
    if "command" not in own:
        kind, commands, command = None, None, None
    else:
        command = topics[own["command"]]
        of_twist = "speed and yaw rate" if options.twist == "unicycle" else "velocity"
        kind = "speed and steering angle" if command.type in ACKERMANN else of_twist
        if not series[command.name]:
            raise LogError(f"{command.name} ({who}) holds no command")
        commands = _usable(f"{command.name} ({who})", series[command.name][""], options, left_out)
        if kind == "speed and yaw rate":
            _check_unicycle(command.name, who, commands)
    # Of bodies that turn, and of commands in their axes, the heading is needed.
    frame = _command_frame(command.type if command else "", poses, commands, options)
    heading_rad = _headings(poses.values[:, 3:])
    is_needed = kind in ("speed and yaw rate", "speed and steering angle") or (kind == "velocity" and frame == "robot")
    if is_needed and np.isnan(heading_rad).any():
        is_bad = np.isnan(heading_rad)
        text = f"{topic.name} ({who}): the orientation is no rotation, or points up, in {is_bad.sum()} of {is_bad.size} messages"
        if options.bad == "raise" or is_bad.all():
            raise LogError(f"{text}; the commands need a heading")
        left_out.append(text)
        poses = Samples(poses.times_ns[~is_bad], poses.values[~is_bad], poses.frames)
        heading_rad = heading_rad[~is_bad]
    times_ns, place_m, heading_rad = at_rate(poses.times_ns, poses.values[:, :3], heading_rad, options)
    columns = {"x_m": place_m[:, 0], "y_m": place_m[:, 1], "z_m": place_m[:, 2]}
    if not np.isnan(heading_rad).all():
        columns["heading_rad"] = heading_rad
    if commands is None or command is None:
        return Track(None, times_ns, columns, described, None)
    held, has_command = in_force(times_ns, commands, options)
    if not has_command.any():
        text = no_overlap(who, topic.name, times_ns, command.name, commands.times_ns, options)
        if options.time == "header":
            text += '; if headers and the bag have different clocks, time="recorded" takes all times from the bag'
        raise LogError(text)
    if not has_command.all():
        n_without = int((~has_command).sum())
        before = f"on {command.name} in the {options.within_ns / 1e9:g} s before"
        left_out.append(f"{who}: {n_without} of {has_command.size} rows without a command {before}")
    if kind == "speed and steering angle":
        columns |= {"cmd_speed_mps": held[:, 0], "cmd_steer_rad": held[:, 1]}
    elif kind == "speed and yaw rate":
        columns |= {"cmd_speed_mps": held[:, 0], "cmd_yaw_rate_radps": held[:, 3]}
    else:
        ahead, left = held[:, 0], held[:, 1]
        if frame == "robot":
            cos, sin = np.cos(heading_rad), np.sin(heading_rad)
            ahead, left = ahead * cos - left * sin, ahead * sin + left * cos
        columns |= {"cmd_vx_mps": ahead, "cmd_vy_mps": left, "cmd_vz_mps": held[:, 2]}
    columns = {name: values[has_command] for name, values in columns.items()}
    return Track(kind, times_ns[has_command], columns, described, f"{command.name} ({command.type}, {command.messages} messages)")


def _usable(what: str, series: Series, options: BagOptions, left_out: list[str]) -> Samples:
    """The messages of a topic in order of time; bad ones are refused, or left out."""
    has_stamps = series.stamps_ns.max() > 0
    times_ns = series.stamps_ns if options.time == "header" and has_stamps else series.recorded_ns
    is_finite = np.isfinite(series.values).all(axis=1)
    keep = usable(what, times_ns, is_finite, options, left_out, ', time="recorded" takes the times of the bag')
    return Samples(times_ns[keep], series.values[keep], frozenset(series.frames))


def _of_frame(own: Mapping[str, str], children: Mapping[str, Series], kind: str) -> Series:
    """The poses of a robot on a topic: of transforms those of its child frame."""
    if not children:
        raise LogError(f"{own['pose']} holds no pose")
    if kind != TF:
        return children[""]
    frame = own.get("frame", "").lstrip("/")
    if frame in children:
        return children[frame]
    if not frame and len(children) == 1:
        return next(iter(children.values()))
    near = difflib.get_close_matches(frame, children, n=1, cutoff=0.0)
    wrong = f"has no child frame {frame}; the nearest is {near[0]}" if frame and near else "needs frame, the child frame of the robot"
    raise LogError(f"{own['pose']} {wrong}. Its child frames: {', '.join(sorted(children))}")


def _check_unicycle(topic: str, who: str, commands: Samples) -> None:
    """Refuses commands that a unicycle cannot follow."""
    aside_mps = np.abs(commands.values[:, 1:3]).max()
    if aside_mps > 0:
        raise LogError(
            f"{topic} ({who}) commands up to {aside_mps:g} m/s along linear.y or linear.z, where a unicycle cannot move: "
            'write twist="velocity" for robots that move in all directions'
        )


def _command_frame(kind: str, poses: Samples, commands: Samples | None, options: BagOptions) -> str:
    """The axes of commanded velocities: "robot" or "world"."""
    if options.command_frame is not None or commands is None:
        return options.command_frame or "robot"
    return "world" if kind == TWIST[1] and commands.frames and commands.frames <= poses.frames else "robot"


def _headings(quaternions: Any) -> Any:
    """Angles (rad) from +x towards +y to where the x axis of the body points, seen from above; NaN where there is none.

    The rule of `murmuration convert`: the squared length of the quaternion (x, y, z, w) is 0.8 to 1.25, and the axis not vertical.
    """
    x, y, z, w = quaternions.T
    length = x * x + y * y + z * z + w * w
    sin, cos = 2.0 * (w * z + x * y), w * w + x * x - y * y - z * z
    is_rotation = (length >= 0.8) & (length <= 1.25) & (sin * sin + cos * cos > 1e-6)
    return np.where(is_rotation, np.arctan2(sin, cos), np.nan)
