"""Rows of robots: poses, each with the command in force. All readers of logs share these rules."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from murmuration._program import InvalidInput

# A log of more messages on the topics that are read is refused: the columns of so many would fill the memory.
MOST_MESSAGES = 20_000_000
# Times from here on (ns) are epoch times: March 1973. `murmuration convert` has the same limit.
EPOCH_NS = 10**17
# The order in which tables have their columns, as `murmuration convert` writes them.
_ORDER = (
    "run", "time_s", "start_epoch_s", "agent", "x_m", "y_m", "z_m", "heading_rad",
    "cmd_vx_mps", "cmd_vy_mps", "cmd_vz_mps", "cmd_speed_mps", "cmd_yaw_rate_radps", "cmd_steer_rad",
    "cmd_ax_mps2", "cmd_ay_mps2", "cmd_az_mps2", "cmd_thrust_n", "cmd_roll_rad", "cmd_pitch_rad", "cmd_yaw_rad",
)  # fmt: skip


class LogError(Exception):
    """A log cannot be read, or lacks what is asked of it."""


class UnusableLogs(InvalidInput):
    """No table can be made of these logs. The text has all reasons."""


@dataclass(frozen=True)
class Options:
    """The options that all readers have; `importers.read_bag` describes them."""

    within_ns: int
    rate_hz: float | None
    bad: str


@dataclass(frozen=True)
class Samples:
    """The usable messages of one topic in order of time."""

    times_ns: Any
    values: Any
    """Numbers: shape (messages, numbers of a message)."""
    frames: frozenset[str] = frozenset()
    """Frames that the headers of the messages name."""


@dataclass
class Track:
    """The rows of one robot in one run."""

    kind: str | None
    """Kind of the commands; None without commands."""
    times_ns: Any
    columns: dict[str, Any]
    poses: str
    """The topic of the poses, with its type and number of messages."""
    commands: str | None
    """The topic of the commands in the same form; None without commands."""


@dataclass
class Run:
    """The robots of one run by name."""

    path: Path
    tracks: dict[str, Track]


@dataclass
class Notes:
    """What a reader reports beside the rows."""

    problems: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    """Messages and rows that are not in the table, with the reason and their number."""
    remarks: list[str] = field(default_factory=list)
    """What a user should know about rows that are in the table."""


@dataclass(frozen=True)
class Imported:
    """A table of robot samples, and how it came about."""

    columns: dict[str, Any]
    runs: list[Run]
    numbers: dict[str, int]
    """The number of each robot by its name."""
    notes: Notes


def gather(
    paths: Sequence[Path], read: Callable[[Path, Notes], Iterable[Run]], *, one_kind: str, is_from_first_row: bool = False
) -> Imported:
    """Reads logs, and raises `UnusableLogs` with all that is wrong with them.

    `one_kind` says how a user selects one kind of command. With `is_from_first_row`, `time_s` counts from the first row of
    each run also where times are not epoch times.
    """
    notes = Notes()
    runs: list[Run] = []
    for path in paths:
        try:
            runs.extend(read(path, notes))
        except LogError as error:
            notes.problems.append(str(error))
    tracks = [track for run in runs for track in run.tracks.values()]
    kinds = {track.kind for track in tracks}
    if len(kinds) > 1:
        named = " and ".join(sorted(kind or "nothing" for kind in kinds))
        notes.problems.append(f"robots are commanded by {named}; one table holds one kind of command: {one_kind}")
    if not notes.problems and not any(track.times_ns.size for track in tracks):
        notes.problems.append("no row is left:\n  " + "\n  ".join(notes.left_out))
    if notes.problems:
        raise UnusableLogs(listed("cannot import", notes.problems))
    numbers = _robot_numbers({name for run in runs for name in run.tracks})
    return Imported(_columns(runs, numbers, is_from_first_row), runs, numbers, notes)


def usable(what: str, times_ns: Any, is_finite: Any, options: Options, left_out: list[str], more_fixes: str = "") -> Any:
    """The mask of the usable messages of a topic; bad ones are refused, or left out.

    `more_fixes` is added to the error where times go back.
    """
    reasons: list[str] = []
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
    if reasons and options.bad == "raise":
        fixes = 'bad="drop" leaves such messages out' + (more_fixes if is_late.any() else "")
        raise LogError(f"{what}: {'; '.join(reasons)}. {fixes}")
    # Of messages with equal times the first.
    is_twice = is_finite & (times_ns == before_ns)
    if is_twice.any():
        reasons.append(f"the time of the message before in {int(is_twice.sum())} of {is_twice.size} messages")
    left_out.extend(f"{what}: {reason}" for reason in reasons)
    keep = is_finite & ~is_late & ~is_twice
    if not keep.any():
        raise LogError(f"{what}: {'; '.join(reasons)}: no message is left")
    return keep


def at_rate(times_ns: Any, place_m: Any, heading_rad: Any, options: Options) -> tuple[Any, Any, Any]:
    """Poses at the rate of the options, interpolated between two poses at most `within_ns` apart; without a rate as they are."""
    rate_hz = options.rate_hz
    if rate_hz is None:
        return times_ns, place_m, heading_rad
    n = int((times_ns[-1] - times_ns[0]) * rate_hz / 1e9) + 1
    if n > MOST_MESSAGES:
        raise LogError(f"rate_hz = {rate_hz:g} makes {n} rows; at most {MOST_MESSAGES} are possible")
    at_ns = times_ns[0] + np.round(np.arange(n) * (1e9 / rate_hz)).astype(np.int64)
    at_ns = at_ns[at_ns <= times_ns[-1]]
    after = np.searchsorted(times_ns, at_ns, side="left")
    before = np.maximum(after - (times_ns[after] != at_ns), 0)
    gap_ns = times_ns[after] - times_ns[before]
    keep = gap_ns <= options.within_ns
    at_ns, after, before, gap_ns = at_ns[keep], after[keep], before[keep], gap_ns[keep]
    share = np.where(gap_ns > 0, (at_ns - times_ns[before]) / np.maximum(gap_ns, 1), 0.0)
    turn = wrapped(heading_rad[after] - heading_rad[before])
    heading = wrapped(heading_rad[before] + share * turn)
    return at_ns, place_m[before] + share[:, None] * (place_m[after] - place_m[before]), heading


def in_force(times_ns: Any, commands: Samples, options: Options) -> tuple[Any, Any]:
    """The last command at or before each time, and the mask of the times at which it is at most `within_ns` old."""
    last = np.searchsorted(commands.times_ns, times_ns, side="right") - 1
    is_recent = (last >= 0) & (times_ns - commands.times_ns[np.maximum(last, 0)] <= options.within_ns)
    return commands.values[last], is_recent


def no_overlap(who: str, pose: str, poses_ns: Any, command: str, commands_ns: Any, options: Options) -> str:
    """The error where no pose has a command. `pose` and `command` are the topics."""
    spans = [f"{times[0] / 1e9:.3f} to {times[-1] / 1e9:.3f} s" for times in (poses_ns, commands_ns)]
    within = f"in the {options.within_ns / 1e9:g} s before"
    return f"{who}: no pose of {pose} ({spans[0]}) has a command of {command} ({spans[1]}) {within}"


def wrapped(angle_rad: Any) -> Any:
    """The same angle from -pi on, below pi."""
    return (angle_rad + np.pi) % (2 * np.pi) - np.pi


def _columns(runs: list[Run], numbers: dict[str, int], is_from_first_row: bool) -> dict[str, Any]:
    """The columns of the table: run after run, robot after robot."""
    parts: list[dict[str, Any]] = []
    for run, tracks in enumerate((run.tracks for run in runs), start=1):
        firsts_ns = [track.times_ns[0] for track in tracks.values() if track.times_ns.size]
        if not firsts_ns:
            continue
        is_epoch = min(firsts_ns) >= EPOCH_NS
        start_ns = int(min(firsts_ns)) if is_epoch or is_from_first_row else 0
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
    names = sorted(names, key=natural)
    numbers = {name: int(name) for name in names if name.isdecimal()}
    if len(set(numbers.values())) == len(names):
        return numbers
    return {name: number for number, name in enumerate(names)}


def natural(name: str) -> list[tuple[int, Any]]:
    """A key that orders names with numbers by the values of the numbers."""
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in re.split(r"(\d+)", name) if part]


def listed(what: str, texts: list[str]) -> str:
    """Texts under a heading."""
    return f"{what}: {texts[0]}" if len(texts) == 1 else f"{what}, for {len(texts)} reasons:\n" + "\n".join(f"  {text}" for text in texts)
