"""The full digest of cosim/v1/common.proto: SHA-256 over everything that a side was asked and replied.

A part is the digest of one kind of message; what is absent counts as 32 zero bytes. Numbers are little-endian.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable
from typing import Any

import numpy as np

from murmuration._contract import common_pb2

ABSENT = bytes(32)
STATE_COLUMNS = ("x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps", "heading_rad")
# The number of each order's field in its message.
AGENT_ORDERS = {"velocity": 3, "waypoint": 4, "release": 5}
MOTE_ORDERS = {"kill": 2, "revive": 3, "add": 4, "jam": 5, "send": 6}


def sha256(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()


def column(values: Any, form: str) -> bytes:
    """A column of numbers after their number. `form`: the type of numpy, "<u4" for example."""
    array = np.asarray(values, dtype=form)
    return struct.pack("<Q", len(array)) + array.tobytes()


def counted(data: bytes | str) -> bytes:
    """Bytes or a text after their length in bytes."""
    data = data.encode() if isinstance(data, str) else bytes(data)
    return struct.pack("<Q", len(data)) + data


def listed(entries: Iterable[bytes]) -> bytes:
    """The part of a list of messages."""
    entries = list(entries)
    return sha256(struct.pack("<Q", len(entries)) + b"".join(entries)) if entries else ABSENT


def states(message: Any) -> bytes:
    data = [counted(message.alive), *(column(getattr(message, name), "<f8") for name in STATE_COLUMNS)]
    data.append(struct.pack("<Q", len(message.covariates)))
    data.extend(counted(covariate.name) + column(covariate.values, "<f8") for covariate in message.covariates)
    return sha256(b"".join(data))


def payloads(message: Any, n: int) -> bytes:
    """Of `n` agents. A message without lengths stands for as many empty payloads."""
    lengths = message.length_bytes if len(message.length_bytes) else np.zeros(n)
    return sha256(column(lengths, "<u4") + counted(message.data))


def moved_obstacles(messages: Any) -> bytes:
    return listed(counted(each.name) + struct.pack("<2d", each.x_m, each.y_m) for each in messages)


def agent_commands(messages: Any) -> bytes:
    def entry(message: Any) -> bytes:
        order = message.WhichOneof("order")
        data = struct.pack("<I", message.agent) + counted(message.source) + bytes([AGENT_ORDERS[order]])
        if order == "velocity":
            return data + struct.pack("<3d", message.velocity.vx_mps, message.velocity.vy_mps, message.velocity.vz_mps)
        if order == "waypoint":
            return data + struct.pack("<3d", message.waypoint.x_m, message.waypoint.y_m, message.waypoint.z_m)
        return data

    return listed(map(entry, messages))


def mote_commands(messages: Any) -> bytes:
    def entry(message: Any) -> bytes:
        order = message.WhichOneof("order")
        data, told = counted(message.source) + bytes([MOTE_ORDERS[order]]), getattr(message, order)
        if order == "jam":
            data += struct.pack("<IQQ", told.channel, told.from_ns, told.until_ns)
            return data + struct.pack("<3d", told.x_m, told.y_m, told.radius_m)
        data += struct.pack("<I", told.mote)
        return data + struct.pack("<I", told.destination) + counted(told.payload) if order == "send" else data

    return listed(map(entry, messages))


def figures(messages: Any) -> bytes:
    return listed(counted(each.name) + struct.pack("<d", each.value) for each in messages)


def deliveries(message: Any) -> bytes:
    """Three parts: transmissions, who heard them, what is known of each reception."""
    air = message.transmissions
    if not len(air.sender):
        return ABSENT * 3
    sent = column(air.sender, "<u4") + column(air.sent_ns, "<u8") + column(air.end_ns, "<u8")
    sent += column(air.payloads.length_bytes, "<u4") + counted(air.payloads.data) + column(air.destination, "<u4")
    heard = column(message.heard_end, "<u4") + column(message.heard, "<u4") + counted(message.heard_bitmap)
    medium = [each or common_pb2.MEDIUM_RADIO for each in message.medium]
    links = column(message.received_ns, "<u8") + column(message.rssi_dbm, "<f4") + column(message.hops, "<u4") + column(medium, "<u4")
    return sha256(sent) + sha256(heard) + sha256(links)


def motes(message: Any) -> bytes:
    bitmaps = (message.alive, message.synced, message.joined)
    columns = (message.rank, message.parent, message.queue_length)
    return sha256(b"".join([*map(counted, bitmaps), *(column(each, "<u4") for each in columns)]))


def _motes_of(message: Any) -> bytes:
    return motes(message.motes) if message.HasField("motes") else ABSENT


def _begun(request: Any) -> bytes:
    """What both starts have of the request."""
    coupling = request.coupling or common_pb2.COUPLING_SEQUENTIAL
    data = struct.pack("<QIQB", request.seed, request.agent_count, request.step_ns, coupling)
    data += counted(request.site_toml) + counted(request.config_toml) + struct.pack("<Q", len(request.files))
    return data + b"".join(counted(file.path) + counted(file.content) for file in request.files)


def robots_start(request: Any, reply: Any) -> bytes:
    """ROBOTS' START, of Configure's request and reply."""
    said = payloads(reply.payloads, request.agent_count) if reply.HasField("payloads") else ABSENT
    data = _begun(request) + counted(reply.effective_config_toml) + states(reply.states) + said
    return sha256(data + column(reply.columns, "<u4") + struct.pack("<?", reply.messages))


def robots_step(start: bytes, request: Any, reply: Any, n: int) -> bytes:
    """ROBOTS' DIGEST of a step of `n` robots that send no messages."""
    flags = struct.pack("<2Q2?", reply.step, reply.time_ns, reply.held, reply.task_complete)
    shared = states(reply.states) + payloads(reply.payloads, n) + moved_obstacles(reply.moved_obstacles)
    orders = agent_commands(reply.commands) + agent_commands(reply.applied_commands)
    replied = sha256(flags + shared + orders + ABSENT + figures(reply.figures))
    given = deliveries(request.deliveries) if request.HasField("deliveries") else ABSENT * 3
    return sha256(start + given + _motes_of(request) + agent_commands(request.commands) + replied)


def network_start(request: Any, reply: Any) -> bytes:
    """NETWORK'S START, of Configure's request and reply: one that has nothing to form and keeps no records."""
    data = _begun(request) + column(request.columns, "<u4") + column(request.records, "<u4")
    data += counted(reply.effective_config_toml) + _motes_of(reply) + struct.pack("<Q", len(reply.warnings))
    data += b"".join(map(counted, reply.warnings)) + ABSENT + column(reply.records, "<u4") + ABSENT
    return sha256(data + counted(reply.capture_header))


def network_step(start: bytes, request: Any, reply: Any, n: int) -> bytes:
    """NETWORK'S DIGEST of a step with `n` motes, of a network that has nothing to form and keeps no records."""
    asked = sha256(struct.pack("<Q?", request.until_ns, request.stop_at_first_delivery) + column(request.records, "<u4"))
    given = states(request.states) + payloads(request.payloads, n) + moved_obstacles(request.moved_obstacles)
    orders = agent_commands(reply.commands) + mote_commands(reply.applied_commands)
    replied = struct.pack("<2Q", reply.step, reply.time_ns) + deliveries(reply.deliveries) + _motes_of(reply) + orders + ABSENT * 5
    return sha256(start + asked + given + mote_commands(request.commands) + sha256(replied) + ABSENT)
