"""Logs of PX4 (ULog) as rows of robots: read through `pyulog`.

Positions, headings and setpoints of PX4 have the axes north, east and down; tables have east, north and up. An attitude turns the axes
forward, right and down of the body into those of the world in PX4, and forward, left and up in a table.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from murmuration.importers._tracks import EPOCH_NS, LogError, Notes, Options, Run, Samples, Track, at_rate, in_force, no_overlap, usable, wrapped

# The first bytes of every ULog file.
MAGIC = b"ULog\x01\x12\x35"

_POSE = "vehicle_local_position"
_ATTITUDE = "vehicle_attitude_setpoint"
_LANDED = "vehicle_land_detected"
_GPS = ("vehicle_gps_position", "sensor_gps")
# Where each kind of command is found: topics and their fields (north, east, down), the first that the log has being taken.
# The setpoints of the position controller are complete; those of the trajectory may be what is added to its own.
_VECTORS = {
    "velocity": (
        ("vehicle_local_position_setpoint", ("vx", "vy", "vz")),
        ("trajectory_setpoint", ("velocity[0]", "velocity[1]", "velocity[2]")),
        ("trajectory_setpoint", ("vx", "vy", "vz")),
    ),
    "acceleration": (
        ("vehicle_local_position_setpoint", ("acceleration[0]", "acceleration[1]", "acceleration[2]")),
        ("trajectory_setpoint", ("acceleration[0]", "acceleration[1]", "acceleration[2]")),
    ),
}
_COLUMNS = {
    "velocity": ("cmd_vx_mps", "cmd_vy_mps", "cmd_vz_mps"),
    "acceleration": ("cmd_ax_mps2", "cmd_ay_mps2", "cmd_az_mps2"),
    "thrust": ("cmd_thrust_n", "cmd_roll_rad", "cmd_pitch_rad", "cmd_yaw_rad"),
}
KINDS = tuple(_COLUMNS)
_SETPOINTS = (*{topic: None for sources in _VECTORS.values() for topic, _ in sources}, _ATTITUDE)
_TOPICS = (_POSE, _LANDED, *_GPS, *_SETPOINTS)
_SOUGHT = (
    "commands are velocities or accelerations of vehicle_local_position_setpoint or trajectory_setpoint, "
    "or vehicle_attitude_setpoint with thrust_n"
)

Fields = dict[str, Any]


@dataclass(frozen=True)
class ULogOptions(Options):
    """The options of `read_ulog`."""

    command: str | None
    thrust_n: float | None


@dataclass(frozen=True)
class _Log:
    """A ULog file."""

    path: Path
    topics: dict[str, Fields]
    """For each topic its fields, each an array over the messages."""
    vehicle: tuple[Any, Any]
    """The identifier of the hardware, and the number of the system."""


def runs_of(path: Path, options: ULogOptions, vehicles: dict[tuple[Any, Any], int], notes: Notes) -> Iterable[Run]:
    """The runs of a log: one, or several if the estimator reset its position. `vehicles` has the number of each vehicle so far."""
    log = _load(path, notes, options.bad)
    name = str(vehicles.setdefault(log.vehicle, len(vehicles)))
    poses = log.topics.get(_POSE)
    if poses is None:
        raise LogError(f"{path} has no {_POSE}, from which positions are taken{_listing(log)}")
    kept, place_m, heading_rad = _poses(log, options, notes.left_out)
    kind, topic, commands, others = _commands(log, options, notes.left_out)
    epoch_ns = _epoch_ns(log)
    commands = Samples(commands.times_ns + epoch_ns, commands.values)
    times_ns = _times_ns(poses)[kept] + epoch_ns
    landed = log.topics.get(_LANDED)
    tracks: list[Track] = []
    n_rows = n_down = n_old = n_unset = 0
    parts = _between_resets(log, kept, times_ns, notes)
    for part in parts:
        at_ns, at_m, at_rad = at_rate(times_ns[part], place_m[part], heading_rad[part], options)
        held, is_recent = in_force(at_ns, commands, options)
        is_set = np.isfinite(held).all(axis=1)
        is_flying = np.full(at_ns.size, True) if landed is None else ~_is_on_ground(landed, at_ns - epoch_ns)
        keep = is_flying & is_recent & is_set
        n_rows += at_ns.size
        n_down += int((~is_flying).sum())
        n_old += int((is_flying & ~is_recent).sum())
        n_unset += int((is_flying & is_recent & ~is_set).sum())
        columns = {"x_m": at_m[:, 0], "y_m": at_m[:, 1], "z_m": at_m[:, 2]}
        if not np.isnan(heading_rad).all():
            columns["heading_rad"] = at_rad
        columns |= dict(zip(_COLUMNS[kind], held.T, strict=True))
        columns = {column: values[keep] for column, values in columns.items()}
        described = f"{_POSE} ({poses['timestamp'].size} messages)"
        also = f"; also in the log: {' and '.join(others)}" if others else ""
        tracks.append(Track(kind, at_ns[keep], columns, described, f"{kind} of {topic} ({log.topics[topic]['timestamp'].size} messages){also}"))
    rejected = [
        (n_down, f"while the vehicle was on the ground ({_LANDED})"),
        (n_old, f"without a command on {topic} in the {options.within_ns / 1e9:g} s before"),
        (n_unset, f"whose command on {topic} is not set (NaN)"),
    ]
    reasons = [f"{path}: {n} of {n_rows} rows {reason}" for n, reason in rejected if n]
    if not any(track.times_ns.size for track in tracks):
        if n_old == n_rows:
            raise LogError(no_overlap(str(path), _POSE, times_ns - epoch_ns, topic, commands.times_ns - epoch_ns, options))
        raise LogError(f"no row of {path} is left: {'; '.join(reasons)}")
    notes.left_out.extend(reasons)
    return [Run(path, {name: track}) for track in tracks if track.times_ns.size]


def _load(path: Path, notes: Notes, bad: str) -> _Log:
    """Reads the topics that are needed."""
    if not path.exists():
        raise LogError(f"{path} does not exist")
    log = _open(path, list(_TOPICS))
    topics: dict[str, Fields] = {}
    for data in sorted(log.data_list, key=lambda data: data.multi_id):
        topics.setdefault(data.name, data.data)
    if log.file_corruption:
        text = f"{path} is damaged: parts of it cannot be read"
        if bad == "raise":
            raise LogError(f'{text}. bad="drop" reads the rest')
        notes.left_out.append(text)
    dropouts_ms = [dropout.duration for dropout in log.dropouts if dropout.duration]
    if dropouts_ms:
        whole, longest = sum(dropouts_ms) / 1e3, max(dropouts_ms) / 1e3
        notes.left_out.append(f"{path}: the logger lost all messages for {whole:g} s in {len(dropouts_ms)} dropouts, the longest {longest:g} s")
    vehicle = (log.msg_info_dict.get("sys_uuid"), log.initial_parameters.get("MAV_SYS_ID"))
    return _Log(path, topics, vehicle)


def _open(path: Path, topics: list[str] | None) -> Any:
    """The log as pyulog has it; `topics` None: all of them."""
    from pyulog import ULog

    try:
        # pyulog prints what it finds damaged; `file_corruption` says it as well.
        with contextlib.redirect_stdout(io.StringIO()):
            return ULog(str(path), topics)
    except Exception as error:  # noqa: BLE001: a damaged file makes pyulog fail in many ways
        raise LogError(f"{path} cannot be read as ULog: {error}") from error


def _poses(log: _Log, options: ULogOptions, left_out: list[str]) -> tuple[Any, Any, Any]:
    """The indices of the usable messages of positions; their places (m: east, north, up) and headings (rad)."""
    fields = log.topics[_POSE]
    what = f"{_POSE} ({log.path})"
    n = fields["timestamp"].size
    is_valid = np.full(n, True)
    for flag, lacks in (("xy_valid", "horizontal position"), ("z_valid", "height")):
        is_set = fields[flag] != 0 if flag in fields else is_valid
        if not is_set.any():
            raise LogError(f"{what}: {flag} is 0 in all {n} messages: the vehicle had no estimate of its {lacks}")
        is_valid = is_valid & is_set
    place_m = _east_north_up(fields, ("x", "y", "z"))
    is_finite = np.isfinite(place_m).all(axis=1)
    # Of invalid positions, numbers do not matter.
    keep = usable(what, _times_ns(fields), is_finite | ~is_valid, options, left_out) & is_valid
    if not is_valid.all():
        left_out.append(f"{what}: {int((~is_valid).sum())} of {n} messages without a valid position (xy_valid or z_valid is 0)")
    if not keep.any():
        raise LogError(f"{what}: no message has a valid position")
    if keep.sum() > 1 and (np.ptp(place_m[keep, :2], axis=0) == 0).all():
        x_m, y_m = place_m[keep][0, :2]
        raise LogError(
            f"{what}: x and y are {y_m:g} and {x_m:g} m in all {int(keep.sum())} valid messages: the vehicle had no measured position"
        )
    yaw = fields.get("heading", fields.get("yaw"))
    heading_rad = np.full(n, np.nan) if yaw is None else _heading(np.asarray(yaw, dtype=float))
    return np.flatnonzero(keep), place_m[keep], heading_rad[keep]


def _commands(log: _Log, options: ULogOptions, left_out: list[str]) -> tuple[str, str, Samples, list[str]]:
    """The kind of the commands, their topic, the commands (NaN: not set), and the other kinds that the log has."""
    found = _vectors(log)
    share = _thrust_share(log)
    # With `thrust_n`, thrust is meant.
    wanted = options.command or ("thrust" if options.thrust_n is not None else next(iter(found), None))
    others = [kind for kind in found if kind != wanted]
    if wanted == "thrust" or (wanted is None and share is not None):
        if share is None:
            raise LogError(f"{log.path} commands no thrust: {_SOUGHT}{_listing(log)}")
        if options.thrust_n is None:
            only = "" if found else ", and no other commands"
            raise LogError(f"{log.path} has attitude and thrust setpoints ({_ATTITUDE}){only}; {_needs_thrust_n(log, share)}")
        fields, topic = log.topics[_ATTITUDE], _ATTITUDE
        _check_quadrotor(log.path, fields)
        kind, values = "thrust", np.column_stack([options.thrust_n * share, _attitude(fields)])
    elif wanted in found:
        kind, (topic, values) = wanted, found[wanted]
        others += ["thrust"] if share is not None else []
    else:
        raise LogError(f"{log.path} has no commands{f' of {wanted}' if wanted else ''}: {_SOUGHT}{_listing(log)}")
    times_ns = _times_ns(log.topics[topic])
    # Numbers that are not finite are no damage: PX4 writes NaN for what it does not control.
    keep = usable(f"{topic} ({log.path})", times_ns, np.full(times_ns.size, True), options, left_out)
    return kind, topic, Samples(times_ns[keep], values[keep]), others


def _vectors(log: _Log) -> dict[str, tuple[str, Any]]:
    """For each kind of commands that are vectors the topic, and the vectors (east, north, up)."""
    found = {}
    for kind, sources in _VECTORS.items():
        for topic, names in sources:
            fields = log.topics.get(topic, {})
            if set(names) <= set(fields):
                values = _east_north_up(fields, names)
                if np.isfinite(values).all(axis=1).any():
                    found[kind] = (topic, values)
                    break
    return found


def _thrust_share(log: _Log) -> Any:
    """Commanded thrust as a share of the full thrust; None if the log has none that is not 0."""
    fields = log.topics.get(_ATTITUDE, {})
    if "thrust_body[2]" in fields:
        share = -fields["thrust_body[2]"].astype(float)
    elif "thrust" in fields:
        share = fields["thrust"].astype(float)
    else:
        return None
    return share if (share > 0).any() else None


def _needs_thrust_n(log: _Log, share: Any) -> str:
    """Why a thrust in newtons has to be stated, and how to find it."""
    landed = log.topics.get(_LANDED)
    is_usual = share > 0
    if landed is not None:
        is_flying = is_usual & ~_is_on_ground(landed, _times_ns(log.topics[_ATTITUDE]))
        is_usual = is_flying if is_flying.any() else is_usual
    usual = np.median(share[is_usual])
    return (
        "its thrust is a share of the full thrust, not newtons: give thrust_n, the thrust (N) of all motors together at a share of 1. "
        f"Thrust balances the weight in hover; the median share in this log is {usual:.3f}, "
        f"so thrust_n is about mass (kg) * 9.81 / {usual:.3f}"
    )


def _check_quadrotor(path: Path, fields: Fields) -> None:
    """Refuses thrust that does not point along the vertical axis of the body, upwards."""
    names = [name for name in ("thrust_body[0]", "thrust_body[1]") if name in fields]
    aside = max((float(np.nanmax(np.abs(fields[name]))) for name in names), default=0.0)
    if aside > 0:
        raise LogError(
            f"{_ATTITUDE} ({path}) commands up to {aside:.3g} of the full thrust along the x or y axis of the body, which a quadrotor lacks"
        )
    down = float(np.nanmax(fields["thrust_body[2]"])) if "thrust_body[2]" in fields else 0.0
    if down > 0:
        raise LogError(f"{_ATTITUDE} ({path}) commands up to {down:.3g} of the full thrust downwards, which a quadrotor lacks")


def _attitude(fields: Fields) -> Any:
    """Roll, pitch and yaw (rad) as tables have them; NaN where the attitude is not set. Shape (messages, 3)."""
    n = fields["timestamp"].size
    angles = np.full((n, 3), np.nan)
    if "roll_body" in fields:
        angles = np.column_stack([fields[f"{name}_body"] for name in ("roll", "pitch", "yaw")]).astype(float)
    if "q_d[0]" in fields:
        w, x, y, z = (fields[f"q_d[{k}]"].astype(float) for k in range(4))
        length = w * w + x * x + y * y + z * z
        is_rotation = (length >= 0.8) & (length <= 1.25)
        scale = np.where(is_rotation, length, 1.0)
        roll = np.arctan2(2 * (w * x + y * z) / scale, 1 - 2 * (x * x + y * y) / scale)
        pitch = np.arcsin(np.clip(2 * (w * y - z * x) / scale, -1, 1))
        yaw = np.arctan2(2 * (w * z + x * y) / scale, 1 - 2 * (y * y + z * z) / scale)
        angles = np.where(is_rotation[:, None], np.column_stack([roll, pitch, yaw]), angles)
    return np.column_stack([angles[:, 0], -angles[:, 1], _heading(angles[:, 2])])


def _is_on_ground(fields: Fields, times_ns: Any) -> Any:
    """Whether the vehicle was on the ground at each time, by the last message before it."""
    is_down = fields["landed"] != 0
    # Ground vehicles have contact at all times.
    contact = fields.get("ground_contact")
    if contact is not None and not contact.all():
        is_down = is_down | (contact != 0)
    last = np.searchsorted(_times_ns(fields), times_ns, side="right") - 1
    return is_down[np.maximum(last, 0)]


def _between_resets(log: _Log, kept: Any, times_ns: Any, notes: Notes) -> list[slice]:
    """Parts of the usable poses between two resets of the estimated position."""
    fields = log.topics[_POSE]
    is_reset = np.full(kept.size, False)
    shift_m = np.zeros(kept.size)
    for counter, shifts in (("xy_reset_counter", ("delta_xy[0]", "delta_xy[1]")), ("z_reset_counter", ("delta_z",))):
        if counter in fields:
            is_new = np.concatenate([[False], np.diff(fields[counter][kept].astype(int)) != 0])
            is_reset |= is_new
            size_m = np.sqrt(sum(fields[name][kept].astype(float) ** 2 for name in shifts if name in fields))
            shift_m = np.where(is_new, np.hypot(shift_m, size_m), shift_m)
    resets = np.flatnonzero(is_reset)
    if resets.size:
        first_s = (times_ns[resets[0]] - times_ns[0]) / 1e9
        largest = f"by {shift_m.max():.2f} m at most, first {first_s:.1f} s after the first position"
        notes.remarks.append(f"{log.path}: the estimator moved its position {resets.size} times ({largest}); rows after that are a run of their own")
    edges = [0, *resets.tolist(), kept.size]
    return [slice(begin, end) for begin, end in zip(edges[:-1], edges[1:], strict=True)]


def _epoch_ns(log: _Log) -> int:
    """What to add to times since the start of the system to make them epoch times, by GPS; 0 if the log does not tell."""
    for topic in _GPS:
        fields = log.topics.get(topic, {})
        if "time_utc_usec" not in fields:
            continue
        utc_us = fields["time_utc_usec"].astype(np.int64)
        is_known = utc_us * 1000 >= EPOCH_NS
        if is_known.any():
            at_us = fields["timestamp"].astype(np.int64) + fields.get("timestamp_time_relative", np.zeros(utc_us.size)).astype(np.int64)
            return int(np.median((utc_us - at_us)[is_known])) * 1000
    return 0


def _listing(log: _Log) -> str:
    """The topics of a log with their numbers of messages: setpoints one a line, with the commands that they have, then the others."""
    counts: dict[str, int] = {}
    for data in _open(log.path, None).data_list:
        counts[data.name] = counts.get(data.name, 0) + data.data["timestamp"].size
    if not counts:
        return ". It has no messages"
    has: dict[str, list[str]] = {topic: [] for topic in _SETPOINTS}
    for kind, (topic, _) in _vectors(log).items():
        has[topic].append(kind)
    if _thrust_share(log) is not None:
        has[_ATTITUDE].append("thrust")
    text = ". It has"
    others = []
    for name, n in sorted(counts.items()):
        if "setpoint" in name:
            usable_kinds = f", with {' and '.join(has[name]) or 'no usable command'}" if name in has else ""
            text += f"\n    {name}  {n} messages{usable_kinds}"
        else:
            others.append(name)
    return f"{text}\n    {', '.join(others)}"


def _east_north_up(fields: Fields, names: tuple[str, ...]) -> Any:
    """Vectors (north, east, down) as vectors (east, north, up). Shape (messages, 3)."""
    north, east, down = (fields[name].astype(float) for name in names)
    return np.column_stack([east, north, -down])


def _heading(yaw_rad: Any) -> Any:
    """Angles from north towards east as angles from east towards north."""
    return wrapped(np.pi / 2 - yaw_rad)


def _times_ns(fields: Fields) -> Any:
    """Times of the messages since the start of the system."""
    return fields["timestamp"].astype(np.int64) * 1000
