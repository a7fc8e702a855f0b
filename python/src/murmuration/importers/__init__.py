"""Logs of robots and radios as the tables that `compare`, `diagnose`, `extend`, `simulate` and `power` take.

    import murmuration
    from murmuration import importers

    drive = importers.read_bag("drive/", robots={"car": {"pose": "/pf/pose/odom", "command": "/drive"}})
    murmuration.diagnose("car.toml", drive)

`read_bag` reads bags of ROS 1 and ROS 2 and MCAP files, `read_ulog` logs of PX4 (ULog).
`python -m murmuration.importers LOG… --output table.csv` writes the tables of both into a file.
`convert` makes tables of CSV files, packet logs, K7 traces and data frames, as `murmuration convert` does (docs/importing.md).
"""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from murmuration._files import Config, DataFrame, config_file, private_folder, table_file
from murmuration._program import InvalidInput, call
from murmuration._tables import read_table, table_of
from murmuration._terms import in_python_terms
from murmuration.importers import _bag_tracks, _bags, _ulog
from murmuration.importers._bag_tracks import BagOptions, Robots
from murmuration.importers._tracks import Imported, LogError, Notes, Run, gather, listed
from murmuration.importers._ulog import ULogOptions

__all__ = ["RowsLeftOut", "bag_topics", "convert", "find_robots", "read_bag", "read_ulog"]

Logs = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


def __dir__() -> list[str]:
    return sorted(__all__)


class RowsLeftOut(UserWarning):
    """Messages of a log that became no row of the table, with the reason and their number."""


@in_python_terms
def bag_topics(bag: str | os.PathLike[str]) -> DataFrame:
    """Lists the topics of a bag.

    Parameters
    ----------
    bag : str or os.PathLike
        A folder with a bag of ROS 2, a file .mcap or .db3, or a bag of ROS 1 (.bag).

    Returns
    -------
    polars.DataFrame or pandas.DataFrame
        One row for each topic: `topic`, `type` and `messages`, their number.

    Raises
    ------
    InvalidInput
        The bag cannot be read.
    """
    with _refusing(), _bags.open_bag(bag) as opened:
        topics = opened.topics
        return table_of({
            "topic": [topic.name for topic in topics],
            "type": [topic.type for topic in topics],
            "messages": [topic.messages for topic in topics],
        })  # fmt: skip


@in_python_terms
def find_robots(bag: str | os.PathLike[str]) -> dict[str, dict[str, str]]:
    """Finds the robots of a bag with their topics: the mapping `robots` of `read_bag`, to read or to change.

    Robots are found by namespaces: `/robot_0/odom` and `/robot_0/cmd_vel` make the robot `robot_0`. Where there is one topic of poses and
    one of commands, their names play no part. Transforms count where no other topic has poses: each child frame is a robot.

    Parameters
    ----------
    bag : str or os.PathLike
        A folder with a bag of ROS 2, a file .mcap or .db3, or a bag of ROS 1 (.bag).

    Returns
    -------
    dict
        The topics of each robot by its name.

    Raises
    ------
    InvalidInput
        The bag cannot be read, or a namespace has several topics of poses or of commands. The text lists the topics.
    """
    with _refusing(), _bags.open_bag(bag) as opened:
        return _bag_tracks.find_robots(opened)


@in_python_terms
def read_bag(
    bag: Logs,
    robots: Robots | None = None,
    *,
    twist: Literal["unicycle", "velocity"] = "unicycle",
    command_frame: Literal["robot", "world"] | None = None,
    time: Literal["header", "recorded"] = "header",
    within_s: float = 1.0,
    rate_hz: float | None = None,
    bad: Literal["raise", "drop"] = "raise",
) -> DataFrame:
    """Reads robot samples from a bag, or from several, each of which becomes a run: one row for each pose, with the command in force.

    Parameters
    ----------
    bag : str, os.PathLike or a sequence of them
        A folder with a bag of ROS 2, a file .mcap or .db3, or a bag of ROS 1 (.bag); or a list of them.
    robots : Mapping, optional
        For each robot its topics, `{"car": {"pose": "/pf/pose/odom", "command": "/drive"}}`, or its namespace, `{0: "/robot_0"}`.
        With transforms, `{"pose": "/tf", "frame": "base_link"}`: `frame` is the child frame, whose transform counts as the message has
        it, from its parent frame. Robots without a command need no `command`. By default, `find_robots` finds them. Names that are
        whole numbers are the numbers of the robots; others are numbered from 0 in natural order (`robot_2` before `robot_10`).
    twist : {"unicycle", "velocity"}
        What a Twist commands. "unicycle": `linear.x` is the speed, `angular.z` the yaw rate. "velocity": `linear` is a velocity, for
        robots that move in all directions.
    command_frame : {"robot", "world"}, optional
        The axes of commanded velocities. By default those of the robot, or those of the world where a TwistStamped names the frame of
        the poses. In the axes of the robot they are turned by its heading.
    time : {"header", "recorded"}
        "header" takes the time of a message from its header, if it has one that is not 0, "recorded" always the time at which the bag
        recorded it.
    within_s : float
        Greatest age of the command of a row (s). Poses without such a command are left out, with a warning.
    rate_hz : float, optional
        Rows at this rate (Hz), with poses interpolated linearly between two at most `within_s` apart, and headings along the shorter
        arc. By default, rows are the poses as recorded. Commands are held, never interpolated.
    bad : {"raise", "drop"}
        What to do with messages that hold no finite numbers, or whose time goes back. "raise" reports all of them in one error,
        "drop" leaves them out, with a warning.

    Returns
    -------
    polars.DataFrame or pandas.DataFrame
        The columns `run` (with several bags), `time_s`, `start_epoch_s` (where times are epoch times; `time_s` then counts from the
        first row of the run), `agent`, `x_m`, `y_m`, `z_m`, `heading_rad` and those of the command.

    Raises
    ------
    InvalidInput
        Bags, topics or messages are unusable. The text names all problems.

    Examples
    --------
    >>> drive = importers.read_bag("drive/", robots={"car": {"pose": "/pf/pose/odom", "command": "/drive"}})
    """
    options = {"twist": twist, "command_frame": command_frame, "time": time, "within_s": within_s, "rate_hz": rate_hz, "bad": bad}
    return _table(_import_bags(_paths("read_bag", bag), robots, **options))


@in_python_terms
def read_ulog(
    log: Logs,
    *,
    command: Literal["velocity", "acceleration", "thrust"] | None = None,
    thrust_n: float | None = None,
    within_s: float = 1.0,
    rate_hz: float | None = None,
    bad: Literal["raise", "drop"] = "raise",
) -> DataFrame:
    """Reads robot samples from a log of PX4 (ULog), or from several: one row for each position, with the command in force.

    Rows are the messages of `vehicle_local_position` with a valid position, except while the vehicle is on the ground. PX4's axes (north,
    east, down) become east, north and up. Each log is a run. If the estimator moved its position, the rows after that are a run of their own.

    Parameters
    ----------
    log : str, os.PathLike or a sequence of them
        A file, or a list of files.
    command : {"velocity", "acceleration", "thrust"}, optional
        The kind of command. "velocity" and "acceleration" are those of `vehicle_local_position_setpoint`, or of
        `trajectory_setpoint` if the former has none. "thrust" is attitude and thrust of `vehicle_attitude_setpoint`, and needs
        `thrust_n`. By default, the first of these kinds that the log has; "thrust" if `thrust_n` is given.
    thrust_n : float, optional
        Thrust of all motors together (N) that corresponds to a thrust of 1 in the log. PX4 commands thrust as a share.
    within_s : float
        Greatest age of the command of a row (s). A setpoint that is not set (NaN) ends the command before it.
    rate_hz : float, optional
        Rows at this rate (Hz), interpolated as by `read_bag`. By default, rows are the positions as recorded.
    bad : {"raise", "drop"}
        What to do with messages that hold no finite numbers, or whose time goes back. "raise" reports all of them in one error,
        "drop" leaves them out, with a warning, and reads what is left of a damaged log.

    Returns
    -------
    polars.DataFrame or pandas.DataFrame
        A table as from `read_bag`. `time_s` counts from the first row of the run, and `start_epoch_s` is its epoch time by GPS, if the
        log has it. `agent` is 0, or numbers the vehicles of the logs in the order in which they come.

    Raises
    ------
    InvalidInput
        The logs are unusable. The text names all problems. If a log has no commands, it lists its topics.
    """
    return _table(_import_ulogs(_paths("read_ulog", log), command=command, thrust_n=thrust_n, within_s=within_s, rate_hz=rate_hz, bad=bad))


@in_python_terms
def convert(
    mapping: Config, *, allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (), memory_budget: str | None = None,
) -> DataFrame:
    """Makes a table of links, robots or packets from logs, by a mapping (docs/mapping.md).

    Rows that cannot be used are counted by reason on standard error.

    Parameters
    ----------
    mapping : str, os.PathLike or Mapping
        The mapping: a file (TOML), or a dictionary of the same form. In a dictionary, `files` may be a data frame of polars or pandas,
        and paths are relative to the working directory.
    allow_file : str, os.PathLike or a sequence of them
        Logs outside of the mapping file's folder that it may read, or folders with all that is in them.
    memory_budget : str, optional
        How much memory the logs may take while they are read, such as "2GiB". By default 1 GiB.

    Returns
    -------
    polars.DataFrame or pandas.DataFrame
        The table; of polars if it is installed.

    Raises
    ------
    InvalidInput
        The mapping or a log is invalid. The text names all problems.

    Examples
    --------
    >>> importers.convert({"table": "packets", "input": [{"files": "root.log.gz", "format": "openwsn-packets"}]})
    >>> columns = {"time_s": "t", "agent": "id", "x_m": "x", "y_m": "y"}
    >>> importers.convert({"table": "robots", "input": [{"files": frame, "columns": columns}]})
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


def _import_bags(
    paths: Sequence[Path], robots: Robots | None = None, *, twist: str = "unicycle", command_frame: str | None = None, time: str = "header",
    **shared: Any,
) -> Imported:  # fmt: skip
    """`read_bag` before its data frame."""
    _check_choice("twist", twist, ("unicycle", "velocity"))
    _check_choice("command_frame", command_frame, (None, "robot", "world"))
    _check_choice("time", time, ("header", "recorded"))
    options = BagOptions(*_shared(**shared), twist, command_frame, time)

    def read(path: Path, notes: Notes) -> Iterator[Run]:
        with _bags.open_bag(path) as opened:
            yield Run(path, _bag_tracks.tracks_of(opened, robots, options, notes))

    return gather(paths, read, one_kind="give some robots in robots=…")


def _import_ulogs(paths: Sequence[Path], *, command: str | None = None, thrust_n: float | None = None, **shared: Any) -> Imported:
    """`read_ulog` before its data frame."""
    _check_choice("command", command, (None, *_ulog.KINDS))
    if thrust_n is not None:
        _check_positive("thrust_n", thrust_n, "1e6")
        if command not in (None, "thrust"):
            raise InvalidInput(f'thrust_n belongs to command="thrust", got command="{command}"')
    options = ULogOptions(*_shared(**shared), command, thrust_n)
    vehicles: dict[tuple[Any, Any], int] = {}

    def read(path: Path, notes: Notes) -> Iterable[Run]:
        return _ulog.runs_of(path, options, vehicles, notes)

    return gather(paths, read, one_kind='select one that all logs have, such as command="velocity"', is_from_first_row=True)


def _paths(function: str, paths: Logs) -> list[Path]:
    """A path or several as a list."""
    found = [Path(paths)] if isinstance(paths, (str, os.PathLike)) else [Path(one) for one in paths]
    if not found:
        raise InvalidInput(f"{function} needs at least one log")
    return found


def _shared(*, within_s: float = 1.0, rate_hz: float | None = None, bad: str = "raise") -> tuple[int, float | None, str]:
    """The options that all readers have, checked."""
    _check_choice("bad", bad, ("raise", "drop"))
    _check_positive("within_s", within_s)
    if rate_hz is not None:
        _check_positive("rate_hz", rate_hz)
    return round(within_s * 1e9), rate_hz, bad


def _table(imported: Imported) -> DataFrame:
    """The data frame, with a warning about each row that is not in it."""
    notes = imported.notes
    if notes.left_out:
        warnings.warn(listed("left out", notes.left_out), RowsLeftOut, stacklevel=4)
    for remark in notes.remarks:
        warnings.warn(remark, stacklevel=4)
    return table_of(imported.columns)


@contextlib.contextmanager
def _refusing() -> Iterator[None]:
    """What is wrong with a bag as InvalidInput."""
    try:
        yield
    except LogError as error:
        raise InvalidInput(str(error)) from None


def _check_choice(name: str, value: Any, allowed: tuple[Any, ...]) -> None:
    if value not in allowed:
        raise InvalidInput(f"{name} must be one of {', '.join(map(repr, allowed))}, got {value!r}")


def _check_positive(name: str, value: Any, most: str = "1e9") -> None:
    if not isinstance(value, (int, float)) or not 0 < value <= float(most):
        raise InvalidInput(f"{name} must be greater than 0 and at most {most}, got {value!r}")
