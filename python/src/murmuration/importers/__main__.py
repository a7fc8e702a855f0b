"""Writes the robot samples of bags or ULog files as a table: `python -m murmuration.importers LOG… --output table.csv`."""

from __future__ import annotations

import argparse
import csv
import gzip
import io
import json
import os
import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from murmuration import importers
from murmuration._program import InvalidInput
from murmuration._tables import table_of
from murmuration.importers import _ulog
from murmuration.importers._tracks import Imported, listed, natural

_ENDINGS = (".csv", ".csv.gz", ".parquet")
_LOG_ENDINGS = (".bag", ".mcap", ".db3", ".ulg")
# Options of one reader, and how it is called.
_OF_BAGS = ("robots", "twist", "command_frame", "time")
_OF_ULOGS = ("command", "thrust_n")
# The body (`robotsim.dynamics.kind`) that takes each kind of command, as docs/measured-files.md lists them.
_BODIES = {
    "velocity": '"point-mass"',
    "speed and yaw rate": '"unicycle"',
    "speed and steering angle": '"car"',
    "acceleration": '"double-integrator" or "quadrotor"',
    "thrust": '"quadrotor" and its mass_kg',
}


class _WrongRequest(Exception):
    """A request that no log can fulfil: exit status 2."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit status: 0, 1 if the logs are not usable, 2 if the request is wrong."""
    options = vars(_parser().parse_args(arguments))
    logs, output, is_replacing = options.pop("log"), Path(options.pop("output")), options.pop("replace")
    given = {name: value for name, value in options.items() if value is not None}
    try:
        _check_output(output, is_replacing)
        paths = _expanded(logs)
        imported = _read(paths, given)
        _write(imported.columns, output)
    except (InvalidInput, _WrongRequest, ImportError, OSError) as error:
        print(f"error: {_as_options(str(error))}", file=sys.stderr)
        return 2 if isinstance(error, _WrongRequest) or type(error) is InvalidInput else 1
    try:
        print(_summary(imported, output), flush=True)
    except BrokenPipeError:
        # Nobody reads it; the table is written. Nor may the interpreter fail to write it at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    notes = imported.notes
    if notes.left_out:
        print(f"warning: {listed('left out', notes.left_out)}", file=sys.stderr)
    for remark in notes.remarks:
        print(f"warning: {remark}", file=sys.stderr)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m murmuration.importers",
        description="Write the robot samples of bags of ROS, MCAP files or ULog files of PX4 as a table of measurements.",
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("log", nargs="+", metavar="LOG", help="a bag (folder, .bag, .mcap or .db3), a ULog file (.ulg), or a folder of them; each log is a run")
    add("--output", required=True, metavar="FILE", help="write the table to this file (.csv, .csv.gz or .parquet)")
    add("--replace", action="store_true", help="replace the file of --output if it exists")
    add("--within-s", type=float, metavar="S", help="greatest age of the command of a row (s); 1 by default")
    add("--rate-hz", type=float, metavar="HZ", help="interpolate positions to this rate; by default rows are the recorded positions")
    add("--bad", choices=("raise", "drop"), help="refuse logs with bad messages (the default), or leave such messages out")
    bags = parser.add_argument_group("bags and MCAP files").add_argument
    bags("--robots", metavar="JSON", help='topics of the robots, such as \'{"car": {"pose": "/odom", "command": "/drive"}}\'')
    bags("--twist", choices=("unicycle", "velocity"), help="what a Twist commands: speed and yaw rate (the default), or a velocity")
    bags("--command-frame", choices=("robot", "world"), help="the axes of commanded velocities")
    bags("--time", choices=("header", "recorded"), help="take times from headers (the default), or those of recording")
    ulogs = parser.add_argument_group("ULog files").add_argument
    ulogs("--command", choices=_ulog.KINDS, help="the kind of command; by default the first of these that the log has")
    ulogs("--thrust-n", type=float, metavar="N", help="thrust (N) of all motors together at a thrust of 1 in the log; selects --command thrust")
    return parser


def _check_output(output: Path, is_replacing: bool) -> None:
    """Refuses an output that cannot or must not be written, before logs are read."""
    if not output.name.endswith(_ENDINGS):
        raise _WrongRequest(f"--output {output}: the file name must end in .csv, .csv.gz or .parquet; use {output.with_suffix('.csv')}")
    if not output.parent.is_dir():
        raise _WrongRequest(f"--output {output}: the folder {output.parent} does not exist")
    if output.is_dir() or (output.exists() and not is_replacing):
        raise _WrongRequest(f"--output {output}: the file exists; give another name, or --replace")


def _expanded(logs: Sequence[str]) -> list[Path]:
    """The logs, and in place of a folder of logs those that are in it."""
    paths: list[Path] = []
    wrong: list[str] = []
    for log in map(Path, logs):
        if not log.exists():
            wrong.append(f"{log} does not exist")
        elif not log.is_dir() or _is_bag(log):
            paths.append(log)
        else:
            found = [path for path in log.iterdir() if _is_bag(path) or (path.is_file() and path.name.endswith(_LOG_ENDINGS))]
            if not found:
                wrong.append(f"{log} is no bag and has no bag in it (a folder with metadata.yaml, {', '.join(_LOG_ENDINGS)})")
            paths += sorted(found, key=lambda path: natural(path.name))
    if wrong:
        raise _WrongRequest(listed("cannot import", wrong))
    return paths


def _is_bag(path: Path) -> bool:
    """Whether this is the folder of a bag of ROS 2."""
    return (path / "metadata.yaml").is_file()


def _is_ulog(path: Path) -> bool:
    if path.is_dir():
        return False
    with path.open("rb") as file:
        return path.suffix == ".ulg" or file.read(len(_ulog.MAGIC)) == _ulog.MAGIC


def _read(paths: list[Path], given: dict[str, Any]) -> Imported:
    """Reads the logs, which must all be bags or all be ULog files."""
    ulogs = [path for path in paths if _is_ulog(path)]
    bags = [path for path in paths if path not in ulogs]
    if ulogs and bags:
        raise _WrongRequest(f"{ulogs[0]} is a ULog file and {bags[0]} is not; import them into tables of their own")
    foreign = [name for name in (_OF_BAGS if ulogs else _OF_ULOGS) if name in given]
    if foreign:
        named = " and ".join(f"--{name.replace('_', '-')}" for name in foreign)
        raise _WrongRequest(f"{named}: only for {'bags and MCAP files' if ulogs else 'ULog files'}, and {paths[0]} is none")
    if ulogs:
        return importers._import_ulogs(ulogs, **given)
    if "robots" in given:
        try:
            given["robots"] = json.loads(given["robots"])
        except json.JSONDecodeError as error:
            raise _WrongRequest(f"--robots: not JSON: {error}") from None
        if not isinstance(given["robots"], dict):
            raise _WrongRequest("--robots: must be a JSON object with a key for each robot")
    return importers._import_bags(bags, **given)


def _write(columns: dict[str, Any], output: Path) -> None:
    """Writes the table: to a temporary file, which then takes the place of `output`."""
    partial = output.with_name(f".{output.name}.{os.getpid()}.partial")
    try:
        with partial.open("xb") as file:
            if output.name.endswith(".parquet"):
                frame = table_of(columns)
                (frame.write_parquet if hasattr(frame, "write_parquet") else frame.to_parquet)(file)
            elif output.name.endswith(".gz"):
                with gzip.GzipFile("", "wb", fileobj=file, mtime=0) as packed:
                    _write_csv(columns, packed)
            else:
                _write_csv(columns, file)
        partial.replace(output)
    finally:
        partial.unlink(missing_ok=True)


def _write_csv(columns: dict[str, Any], file: IO[bytes]) -> None:
    """CSV, with an empty field where there is no number."""
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    fields = [["" if is_absent else value for value, is_absent in zip(own.tolist(), np.isnan(own), strict=True)] for own in columns.values()]
    writer.writerows(zip(*fields, strict=True))
    text.detach()


def _summary(imported: Imported, output: Path) -> str:
    """The rows and columns of the table, the topics that they are from, and the next command."""
    n_rows = len(imported.columns["time_s"])
    logs = list(dict.fromkeys(run.path for run in imported.runs))
    lines = [
        f"{output}: {n_rows} rows of robots from {len(logs)} log{'s' * (len(logs) > 1)}",
        f"  columns   {', '.join(imported.columns)}",
    ]
    for number, run in enumerate(imported.runs, start=1):
        lines.append(f"  {f'run {number}':8}  {run.path}")
        for name, track in run.tracks.items():
            agent = imported.numbers[name]
            named = "" if name == str(agent) else f" ({name})"
            lines.append(f"            agent {agent}{named}: {track.times_ns.size} rows")
            lines.append(f"              poses     {track.poses}")
            lines.append(f"              commands  {track.commands or 'none'}")
    kind = next(track.kind for run in imported.runs for track in run.tracks.values())
    if kind is None:
        lines.append("next: this table has no commands, which a comparison with a model needs: name their topics in --robots")
    else:
        lines.append(f"next: murmuration compare MODEL --data {shlex.quote(str(output))}")
        lines.append(f"  MODEL is a configuration with [robotsim.dynamics] kind = {_BODIES[kind]}")
    return "\n".join(lines)


def _as_options(text: str) -> str:
    """A text about arguments of `read_bag` and `read_ulog`, with the options of this command."""
    text = re.sub(r"\brobots=(\{.*?\}\})", r"--robots '\1'", text)
    text = re.sub(r"\brobots=", "--robots ", text)
    text = re.sub(r'\b(twist|command_frame|command|time|bad)="(\w+)"', lambda found: f"--{found[1].replace('_', '-')} {found[2]}", text)
    return re.sub(r"\b(thrust_n|within_s|rate_hz)\b", lambda found: f"--{found[1].replace('_', '-')}", text)


if __name__ == "__main__":
    sys.exit(main())
