"""Logs of robots and radios as the tables that `compare`, `diagnose`, `extend`, `simulate` and `power` take.

    import murmuration
    from murmuration import importers

    drive = importers.read_bag("drive/", robots={"car": {"pose": "/pf/pose/odom", "command": "/drive"}})
    murmuration.diagnose("car.toml", drive)

`read_bag` reads bags of ROS 1 and ROS 2 and MCAP files; it needs rosbags: pip install "murmuration-sim[rosbags]".
`convert` makes tables of CSV files, packet logs, K7 traces and data frames, as `murmuration convert` does (docs/importing.md).
"""

from __future__ import annotations

import contextlib
import difflib
import os
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from murmuration import _bags
from murmuration._answers import read_table, table_of
from murmuration._bags import ACKERMANN, COMMANDS, POSES, TF, TWIST, Bag, BagError, Series
from murmuration._files import Config, config_file, private_folder, table_file
from murmuration._program import InvalidInput, call

__all__ = ["RowsLeftOut", "bag_topics", "convert", "find_robots", "read_bag"]

Bags = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
Robots = Mapping[Any, "str | Mapping[str, str]"]

# Times from here on (ns) are epoch times: March 1973. `murmuration convert` has the same limit.
_EPOCH_NS = 10**17
# The order in which tables have their columns, as `murmuration convert` writes them.
_ORDER = (
    "run", "time_s", "start_epoch_s", "agent", "x_m", "y_m", "z_m", "heading_rad",
    "cmd_vx_mps", "cmd_vy_mps", "cmd_vz_mps", "cmd_speed_mps", "cmd_yaw_rate_radps", "cmd_steer_rad",
)  # fmt: skip


class RowsLeftOut(UserWarning):
    """Messages of a bag that became no row of the table, with the reason and their number."""


def bag_topics(bag: str | os.PathLike[str]) -> Any:
    """The topics of a bag as a data frame: `topic`, `type` and `messages`."""
    with _refusing(), _bags.open_bag(bag) as opened:
        topics = opened.topics
        return table_of({
            "topic": [topic.name for topic in topics],
            "type": [topic.type for topic in topics],
            "messages": [topic.messages for topic in topics],
        })  # fmt: skip


def find_robots(bag: str | os.PathLike[str]) -> dict[str, dict[str, str]]:
    """The robots of a bag with their topics, by name: the mapping `robots` of `read_bag`, to read or to change.

    Robots are found by namespaces: `/robot_0/odom` and `/robot_0/cmd_vel` make the robot `robot_0`. Where there is one topic of poses and
    one of commands, their names play no part. Transforms count where no other topic has poses: each child frame is a robot. Where
    a namespace has several topics of poses or of commands, `InvalidInput` lists the topics.
    """
    with _refusing(), _bags.open_bag(bag) as opened:
        return _find_robots(opened)


def read_bag(
    bag: Bags,
    robots: Robots | None = None,
    *,
    twist: Literal["unicycle", "velocity"] = "unicycle",
    command_frame: Literal["robot", "world"] | None = None,
    time: Literal["header", "recorded"] = "header",
    within_s: float = 1.0,
    rate_hz: float | None = None,
    bad: Literal["raise", "drop"] = "raise",
) -> Any:
    """Robot samples of a bag, or of several, each of which becomes a run: one row for each pose, with the command in force.

    Args:
        bag: A folder with a bag of ROS 2, a file .mcap or .db3, or a bag of ROS 1 (.bag); or a list of them.
        robots: For each robot its topics, `{"car": {"pose": "/pf/pose/odom", "command": "/drive"}}`, or its namespace,
            `{0: "/robot_0"}`. With transforms, `{"pose": "/tf", "frame": "base_link"}`: `frame` is the child frame, whose
            transform counts as the message has it, from its parent frame. Robots without a command need no `command`. By
            default, `find_robots` finds them. Names that are whole numbers are the numbers of the robots; others are numbered
            from 0 in natural order (`robot_2` before `robot_10`).
        twist: What a Twist commands. "unicycle": `linear.x` is the speed, `angular.z` the yaw rate. "velocity": `linear` is a
            velocity, for robots that move in all directions.
        command_frame: The axes of commanded velocities. By default those of the robot, or those of the world where a
            TwistStamped names the frame of the poses. In the axes of the robot they are turned by its heading.
        time: "header" takes the time of a message from its header, if it has one that is not 0, "recorded" always the time at
            which the bag recorded it.
        within_s: Greatest age (s) of the command of a row. Poses without such a command are left out, with a warning.
        rate_hz: Rows at this rate (Hz), with poses interpolated linearly between two at most `within_s` apart, and headings along
            the shorter arc. By default, rows are the poses as recorded. Commands are held, never interpolated.
        bad: What to do with messages that hold no finite numbers, or whose time goes back. "raise" reports all of them in one
            error, "drop" leaves them out, with a warning.

    Returns:
        A data frame of polars, or of pandas where polars is not installed: `run` (with several bags), `time_s`, `start_epoch_s`
        (where times are epoch times; `time_s` then counts from the first row of the run), `agent`, `x_m`, `y_m`, `z_m`,
        `heading_rad` and the columns of the command.

    Raises:
        InvalidInput: What is wrong with bags, topics and messages, all of it.
    """
    _check_choice("twist", twist, ("unicycle", "velocity"))
    _check_choice("command_frame", command_frame, (None, "robot", "world"))
    _check_choice("time", time, ("header", "recorded"))
    _check_choice("bad", bad, ("raise", "drop"))
    _check_positive("within_s", within_s)
    if rate_hz is not None:
        _check_positive("rate_hz", rate_hz)
    how = _How(twist, command_frame, time, round(within_s * 1e9), rate_hz, bad)
    paths = [Path(bag)] if isinstance(bag, (str, os.PathLike)) else [Path(one) for one in bag]
    if not paths:
        raise InvalidInput("read_bag needs at least one bag")
    problems: list[str] = []
    left_out: list[str] = []
    runs: list[dict[str, _Track]] = []
    for path in paths:
        try:
            with _bags.open_bag(path) as opened:
                runs.append(_tracks(opened, robots, how, problems, left_out))
        except BagError as error:
            problems.append(str(error))
    kinds = {track.kind for tracks in runs for track in tracks.values()}
    if len(kinds) > 1:
        named = " and ".join(sorted(kind or "nothing" for kind in kinds))
        problems.append(f"robots are commanded by {named}; one table holds one kind of command: give some robots in robots=…")
    if not problems and not any(track.times_ns.size for tracks in runs for track in tracks.values()):
        problems.append("no row is left:\n  " + "\n  ".join(left_out))
    if problems:
        raise InvalidInput(_listed("cannot import", problems))
    if left_out:
        warnings.warn(_listed("left out", left_out), RowsLeftOut, stacklevel=2)
    return table_of(_columns(runs))


def convert(
    mapping: Config, *, allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (), memory_budget: str | None = None,
) -> Any:
    """A table of links, robots or packets from logs, by a mapping: a TOML file, or a dictionary of the same form (docs/mapping.md).

        importers.convert({"table": "packets", "input": [{"files": "root.log.gz", "format": "openwsn-packets"}]})
        importers.convert({"table": "robots", "input": [{"files": frame, "columns": {"time_s": "t", "x_m": "x", …}}]})

    In a dictionary, `files` may be a data frame of polars or pandas, and paths are relative to the working directory. A mapping file
    may name logs in its own folder; `allow_file` are others that it may read, or folders with all that is in them.
    Rows that cannot be used are counted by reason on standard error. `memory_budget` is how much memory the logs may take while
    they are read, such as "2GiB"; 1 GiB by default.
    """
    with contextlib.ExitStack() as stack:
        if isinstance(mapping, Mapping):
            mapping = {**mapping, "input": [_with_file(stack, one) for one in mapping.get("input", [])]}
            # Paths that this program says need no other consent.
            allow_file = "/"
        path = stack.enter_context(config_file(mapping))
        output = stack.enter_context(private_folder()) / "table.parquet"
        files = [allow_file] if isinstance(allow_file, str | os.PathLike) else allow_file
        allowed = [word for file in files for word in ("--allow-file", os.fspath(file))]
        budget = [] if memory_budget is None else ["--memory-budget", memory_budget]
        call(["convert", path, "--output", output, *allowed, *budget])
        return read_table(output)


def _with_file(stack: contextlib.ExitStack, entry: Any) -> Any:
    """An entry of `input` whose `files` is a path: a data frame goes to a temporary file."""
    if not isinstance(entry, Mapping) or isinstance(entry.get("files"), (str, os.PathLike, type(None))):
        return entry
    return {**entry, "files": stack.enter_context(table_file(entry["files"]))}


@dataclass(frozen=True)
class _How:
    """The options of `read_bag`."""

    twist: str
    command_frame: str | None
    time: str
    within_ns: int
    rate_hz: float | None
    bad: str


@dataclass
class _Track:
    """The rows of one robot in one run."""

    kind: str | None
    """Kind of the commands; None without commands."""
    times_ns: Any
    columns: dict[str, Any]


@dataclass(frozen=True)
class _Samples:
    """The usable messages of one topic in order of time."""

    times_ns: Any
    values: Any
    frames: frozenset[str]


def _tracks(bag: Bag, robots: Robots | None, how: _How, problems: list[str], left_out: list[str]) -> dict[str, _Track]:
    """The robots of a bag. Errors are added to `problems`, ignored topics and messages to `left_out`."""
    topics = _topics_of(bag, robots, problems)
    wanted: dict[str, dict[str, str]] = {}
    for name, own in topics.items():
        try:
            bag.topic(own["pose"], POSES)
            if "command" in own:
                bag.topic(own["command"], COMMANDS)
            wanted[name] = own
        except BagError as error:
            problems.append(f"robot {name}: {error}")
    series = bag.read({own[key] for own in wanted.values() for key in ("pose", "command") if key in own})
    types = {topic.name: topic.type for topic in bag.topics}
    tracks = {}
    for name, own in wanted.items():
        try:
            tracks[name] = _track(f"robot {name} of {bag.path}", own, series, types, how, left_out)
        except BagError as error:
            problems.append(str(error))
    if any(track.kind is None for track in tracks.values()) and any(track.kind for track in tracks.values()):
        lacking = ", ".join(name for name, track in tracks.items() if track.kind is None)
        problems.append(f"{bag.path} has no commands for {lacking}, but for other robots; give the robots in robots=…")
    return tracks


def _topics_of(bag: Bag, robots: Robots | None, problems: list[str]) -> dict[str, dict[str, str]]:
    """For each robot the topics of its poses and commands, and the child frame of transforms."""
    if robots is None:
        return _find_robots(bag)
    topics = {}
    for key, own in robots.items():
        name = str(key)
        if name in topics:
            problems.append(f"robot {name} is there twice")
        elif isinstance(own, str):
            try:
                topics[name] = _of_namespace(bag, own)
            except BagError as error:
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
            raise BagError(f"{below} has several topics of {part}s, name one of them:{_listing(bag)}")
        found.update({part: name for name in names})
    if "pose" not in found:
        raise BagError(f"{bag.path} has no poses below {below}{_listing(bag)}")
    return found


def _find_robots(bag: Bag) -> dict[str, dict[str, str]]:
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
        raise BagError(f"{bag.path} has no topic with poses ({', '.join(POSES)}){_listing(bag)}")
    # A child frame may be the name of a robot; a topic is below its namespace.
    grouped = _by_namespace(poses, commands, 0 if frames else 1)
    if grouped is None:
        form = '{"car": {"pose": "/odom", "command": "/cmd_vel"}}'
        raise BagError(f"which topics of {bag.path} belong together? Name them, robots={form}:{_listing(bag)}")
    return {
        name: ({"pose": frames[pose], "frame": pose[1:]} if frames else {"pose": pose}) | ({"command": command} if command else {})
        for name, (pose, command) in sorted(grouped.items(), key=lambda item: _natural(item[0]))
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


def _listing(bag: Bag) -> str:
    """The topics of a bag, one a line."""
    return "".join(f"\n    {topic.name}  {topic.type}  {topic.messages} messages" for topic in bag.topics) or "\n    (no topics)"


def _track(
    who: str, own: Mapping[str, str], series: Mapping[str, Mapping[str, Series]], types: Mapping[str, str], how: _How, left_out: list[str]
) -> _Track:  # fmt: skip
    """The rows of one robot: its poses, each with the command in force."""
    poses = _usable(f"{own['pose']} ({who})", _of_frame(own, series[own["pose"]], types[own["pose"]]), how, left_out)
    if "command" not in own:
        kind, commands = None, None
    else:
        topic = own["command"]
        of_twist = "speed and yaw rate" if how.twist == "unicycle" else "velocity"
        kind = "speed and steering angle" if types[topic] in ACKERMANN else of_twist
        if not series[topic]:
            raise BagError(f"{topic} ({who}) holds no command")
        commands = _usable(f"{topic} ({who})", series[topic][""], how, left_out)
        if kind == "speed and yaw rate":
            _check_unicycle(topic, who, commands)
    # Of bodies that turn, and of commands in their axes, the heading is needed.
    frame = _command_frame(types.get(own.get("command", ""), ""), poses, commands, how)
    heading_rad = _headings(poses.values[:, 3:])
    is_needed = kind in ("speed and yaw rate", "speed and steering angle") or (kind == "velocity" and frame == "robot")
    if is_needed and np.isnan(heading_rad).any():
        is_bad = np.isnan(heading_rad)
        text = f"{own['pose']} ({who}): the orientation is no rotation, or points up, in {is_bad.sum()} of {is_bad.size} messages"
        if how.bad == "raise" or is_bad.all():
            raise BagError(f"{text}; the commands need a heading")
        left_out.append(text)
        poses = _Samples(poses.times_ns[~is_bad], poses.values[~is_bad], poses.frames)
        heading_rad = heading_rad[~is_bad]
    times_ns, place_m = poses.times_ns, poses.values[:, :3]
    if how.rate_hz is not None:
        times_ns, place_m, heading_rad = _at_rate(times_ns, place_m, heading_rad, how.rate_hz, how.within_ns)
    columns = {"x_m": place_m[:, 0], "y_m": place_m[:, 1], "z_m": place_m[:, 2]}
    if not np.isnan(heading_rad).all():
        columns["heading_rad"] = heading_rad
    if commands is None:
        return _Track(None, times_ns, columns)
    # The last command at or before each row.
    last = np.searchsorted(commands.times_ns, times_ns, side="right") - 1
    has_command = (last >= 0) & (times_ns - commands.times_ns[np.maximum(last, 0)] <= how.within_ns)
    if not has_command.any():
        raise BagError(_no_overlap(own, who, times_ns, commands.times_ns, how))
    if not has_command.all():
        n_without = int((~has_command).sum())
        before = f"on {own['command']} in the {how.within_ns / 1e9:g} s before"
        left_out.append(f"{who}: {n_without} of {has_command.size} rows without a command {before}")
    held = commands.values[last]
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
    return _Track(kind, times_ns[has_command], {name: values[has_command] for name, values in columns.items()})


def _of_frame(own: Mapping[str, str], children: Mapping[str, Series], kind: str) -> Series:
    """The poses of a robot on a topic: of transforms those of its child frame."""
    if not children:
        raise BagError(f"{own['pose']} holds no pose")
    if kind != TF:
        return children[""]
    frame = own.get("frame", "").lstrip("/")
    if frame in children:
        return children[frame]
    if not frame and len(children) == 1:
        return next(iter(children.values()))
    near = difflib.get_close_matches(frame, children, n=1, cutoff=0.0)
    wrong = f"has no child frame {frame}; the nearest is {near[0]}" if frame and near else "needs frame, the child frame of the robot"
    raise BagError(f"{own['pose']} {wrong}. Its child frames: {', '.join(sorted(children))}")


def _usable(what: str, series: Series, how: _How, left_out: list[str]) -> _Samples:
    """The messages of a topic in order of time; bad ones are refused, or left out."""
    has_stamps = series.stamps_ns.max() > 0
    times_ns = series.stamps_ns if how.time == "header" and has_stamps else series.recorded_ns
    reasons: list[str] = []
    is_finite = np.isfinite(series.values).all(axis=1)
    if not is_finite.all():
        first = int(np.argmin(is_finite))
        n_bad = int((~is_finite).sum())
        reasons.append(f"numbers that are not finite in {n_bad} of {is_finite.size} messages, first in message {first}")
    latest_ns = np.maximum.accumulate(np.where(is_finite, times_ns, np.iinfo(np.int64).min))
    before_ns = np.concatenate([[np.iinfo(np.int64).min], latest_ns[:-1]])
    is_late = is_finite & (times_ns < before_ns)
    if is_late.any():
        first = int(np.argmax(is_late))
        step = f"by {(before_ns[first] - times_ns[first]) / 1e9:.3f} s, to {times_ns[first] / 1e9:.3f} s"
        reasons.append(f"times that go back in {int(is_late.sum())} of {is_late.size} messages, first in message {first} ({step})")
    if reasons and how.bad == "raise":
        fixes = 'bad="drop" leaves such messages out' + (', time="recorded" takes the times of the bag' if is_late.any() else "")
        raise BagError(f"{what}: {'; '.join(reasons)}. {fixes}")
    # Of messages with equal times the first.
    is_twice = is_finite & (times_ns == before_ns)
    if is_twice.any():
        reasons.append(f"the time of the message before in {int(is_twice.sum())} of {is_twice.size} messages")
    left_out.extend(f"{what}: {reason}" for reason in reasons)
    keep = is_finite & ~is_late & ~is_twice
    if not keep.any():
        raise BagError(f"{what}: {'; '.join(reasons)}: no message is left")
    return _Samples(times_ns[keep], series.values[keep], frozenset(series.frames))


def _check_unicycle(topic: str, who: str, commands: _Samples) -> None:
    """Refuses commands that a unicycle cannot follow."""
    aside_mps = np.abs(commands.values[:, 1:3]).max()
    if aside_mps > 0:
        raise BagError(
            f"{topic} ({who}) commands up to {aside_mps:g} m/s along linear.y or linear.z, where a unicycle cannot move: "
            'write twist="velocity" for robots that move in all directions'
        )


def _command_frame(kind: str, poses: _Samples, commands: _Samples | None, how: _How) -> str:
    """The axes of commanded velocities: "robot" or "world"."""
    if how.command_frame is not None or commands is None:
        return how.command_frame or "robot"
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


def _at_rate(times_ns: Any, place_m: Any, heading_rad: Any, rate_hz: float, within_ns: int) -> tuple[Any, Any, Any]:
    """Poses at a rate, interpolated between two poses at most `within_ns` apart."""
    n = int((times_ns[-1] - times_ns[0]) * rate_hz / 1e9) + 1
    if n > _bags.MOST_MESSAGES:
        raise BagError(f"rate_hz = {rate_hz:g} makes {n} rows; at most {_bags.MOST_MESSAGES} are possible")
    at_ns = times_ns[0] + np.round(np.arange(n) * (1e9 / rate_hz)).astype(np.int64)
    at_ns = at_ns[at_ns <= times_ns[-1]]
    after = np.searchsorted(times_ns, at_ns, side="left")
    before = np.maximum(after - (times_ns[after] != at_ns), 0)
    gap_ns = times_ns[after] - times_ns[before]
    keep = gap_ns <= within_ns
    at_ns, after, before, gap_ns = at_ns[keep], after[keep], before[keep], gap_ns[keep]
    share = np.where(gap_ns > 0, (at_ns - times_ns[before]) / np.maximum(gap_ns, 1), 0.0)
    turn = (heading_rad[after] - heading_rad[before] + np.pi) % (2 * np.pi) - np.pi
    heading = (heading_rad[before] + share * turn + np.pi) % (2 * np.pi) - np.pi
    return at_ns, place_m[before] + share[:, None] * (place_m[after] - place_m[before]), heading


def _no_overlap(own: Mapping[str, str], who: str, poses_ns: Any, commands_ns: Any, how: _How) -> str:
    """The error where no pose has a command."""
    spans = [f"{times[0] / 1e9:.3f} to {times[-1] / 1e9:.3f} s" for times in (poses_ns, commands_ns)]
    pose, command = f"{own['pose']} ({spans[0]})", f"{own['command']} ({spans[1]})"
    text = f"{who}: no pose of {pose} has a command of {command} in the {how.within_ns / 1e9:g} s before"
    if how.time == "header":
        text += '; if headers and the bag have different clocks, time="recorded" takes all times from the bag'
    return text


def _columns(runs: list[dict[str, _Track]]) -> dict[str, Any]:
    """The columns of the table: run after run, robot after robot."""
    numbers = _robot_numbers({name for tracks in runs for name in tracks})
    parts: list[dict[str, Any]] = []
    for run, tracks in enumerate(runs, start=1):
        firsts_ns = [track.times_ns[0] for track in tracks.values() if track.times_ns.size]
        if not firsts_ns:
            continue
        is_epoch = min(firsts_ns) >= _EPOCH_NS
        start_ns = int(min(firsts_ns)) if is_epoch else 0
        for name in sorted(tracks, key=lambda name: numbers[name]):
            track = tracks[name]
            n = track.times_ns.size
            part = {"time_s": (track.times_ns - start_ns) / 1e9, "agent": np.full(n, numbers[name]), **track.columns}
            # Seconds and their fraction apart: nanoseconds since 1970 are more than a double holds.
            start_s = start_ns // 10**9 + (start_ns % 10**9) / 1e9 if is_epoch else np.nan
            parts.append({"run": np.full(n, run), "start_epoch_s": np.full(n, start_s), **part})
    names = {name for part in parts for name in part}
    columns = {
        name: np.concatenate([part[name] if name in part else np.full(part["agent"].size, np.nan) for part in parts])
        for name in _ORDER
        if name in names
    }
    if len(runs) == 1:
        del columns["run"]
    if np.isnan(columns["start_epoch_s"]).all():
        del columns["start_epoch_s"]
    return columns


def _robot_numbers(names: Iterable[str]) -> dict[str, int]:
    """The number of each robot: the name itself where all are whole numbers, else their place in natural order."""
    names = sorted(names, key=_natural)
    numbers = {name: int(name) for name in names if name.isdecimal()}
    if len(set(numbers.values())) == len(names):
        return numbers
    return {name: number for number, name in enumerate(names)}


def _natural(name: str) -> list[tuple[int, Any]]:
    """A key that orders names with numbers by the values of the numbers."""
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in re.split(r"(\d+)", name) if part]


@contextlib.contextmanager
def _refusing() -> Any:
    """What is wrong with a bag as InvalidInput."""
    try:
        yield
    except BagError as error:
        raise InvalidInput(f"error: {error}") from error


def _listed(what: str, texts: list[str]) -> str:
    """Texts under a heading."""
    return f"{what}: {texts[0]}" if len(texts) == 1 else f"{what}, for {len(texts)} reasons:\n" + "\n".join(f"  {text}" for text in texts)


def _check_choice(name: str, value: Any, allowed: tuple[Any, ...]) -> None:
    if value not in allowed:
        raise InvalidInput(f"{name} must be one of {', '.join(map(repr, allowed))}, got {value!r}")


def _check_positive(name: str, value: Any) -> None:
    if not isinstance(value, (int, float)) or not 0 < value <= 1e9:
        raise InvalidInput(f"{name} must be greater than 0 and at most 1e9, got {value!r}")
