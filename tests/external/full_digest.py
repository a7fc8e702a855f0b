"""Computes the digest that a recording holds for each step, by the rule THE FULL DIGEST in cosim/v1/common.proto.

Nothing here was derived from the Rust code: the rule's text is its only source. Networks without protocols alone: a reply with
formation, packets, statistics, schedule or heard links is refused.
"""

import hashlib
import struct

ABSENT = bytes(32)


def sha256(data):
    return hashlib.sha256(data).digest()


def column(letter, values):
    return struct.pack(f"<Q{len(values)}{letter}", len(values), *values)


def counted(data):
    """Bytes, or a text, after their length."""
    data = data.encode() if isinstance(data, str) else bytes(data)
    return struct.pack("<Q", len(data)) + data


def listed(entries):
    """A part that is a list of messages, each as bytes already."""
    return sha256(struct.pack("<Q", len(entries)) + b"".join(entries)) if entries else ABSENT


def states(message):
    columns = ("x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps", "heading_rad")
    data = counted(message.alive) + b"".join(column("d", getattr(message, name)) for name in columns)
    data += struct.pack("<Q", len(message.covariates))
    for covariate in message.covariates:
        data += counted(covariate.name) + column("d", covariate.values)
    return sha256(data)


def payloads(message, n_agents):
    lengths = list(message.length_bytes) or [0] * n_agents
    return sha256(column("I", lengths) + counted(message.data))


def agent_commands(messages):
    def entry(message):
        order = message.WhichOneof("order")
        number = {"velocity": 3, "waypoint": 4, "release": 5}[order]
        data = struct.pack("<I", message.agent) + counted(message.source) + bytes([number])
        if order == "velocity":
            given = message.velocity
            data += struct.pack("<3d", given.vx_mps, given.vy_mps, given.vz_mps)
        if order == "waypoint":
            given = message.waypoint
            data += struct.pack("<3d", given.x_m, given.y_m, given.z_m)
        return data

    return listed([entry(message) for message in messages])


def mote_commands(messages):
    def entry(message):
        order = message.WhichOneof("order")
        number = {"kill": 2, "revive": 3, "add": 4, "jam": 5, "send": 6}[order]
        given = getattr(message, order)
        data = counted(message.source) + bytes([number])
        if order == "jam":
            data += struct.pack("<IQQ", given.channel, given.from_ns, given.until_ns)
            return data + struct.pack("<3d", given.x_m, given.y_m, given.radius_m)
        data += struct.pack("<I", given.mote)
        if order == "send":
            data += struct.pack("<I", given.destination) + counted(given.payload)
        return data

    return listed([entry(message) for message in messages])


def unicasts(messages):
    data, entries, start = messages.payloads.data, [], 0
    rows = zip(messages.sender, messages.destination, messages.payloads.length_bytes, strict=True)
    for sender, destination, length in rows:
        entries.append(struct.pack("<II", sender, destination) + counted(data[start : start + length]))
        start += length
    return listed(entries)


def deliveries(message):
    """The three parts: transmissions, heard, links."""
    sent = message.transmissions
    if not sent.sender:
        return ABSENT * 3
    transmissions = column("I", sent.sender) + column("Q", sent.sent_ns) + column("Q", sent.end_ns)
    transmissions += column("I", sent.payloads.length_bytes) + counted(sent.payloads.data)
    transmissions += column("I", sent.destination)
    heard = column("I", message.heard_end) + column("I", message.heard) + counted(message.heard_bitmap)
    links = column("Q", message.received_ns) + column("f", message.rssi_dbm) + column("I", message.hops)
    links += column("I", [medium or 1 for medium in message.medium])
    return sha256(transmissions) + sha256(heard) + sha256(links)


def motes(reply):
    if not reply.HasField("motes"):
        return ABSENT
    message = reply.motes
    data = counted(message.alive) + counted(message.synced) + counted(message.joined)
    data += column("I", message.rank) + column("I", message.parent) + column("I", message.queue_length)
    return sha256(data)


def robots_reply(reply, n_agents):
    def obstacle(message):
        return counted(message.name) + struct.pack("<2d", message.x_m, message.y_m)

    data = struct.pack("<QQ??", reply.step, reply.time_ns, reply.held, reply.task_complete)
    data += states(reply.states) + payloads(reply.payloads, n_agents)
    data += listed([obstacle(message) for message in reply.moved_obstacles])
    data += agent_commands(reply.commands) + agent_commands(reply.applied_commands)
    data += unicasts(reply.messages)
    data += listed([counted(figure.name) + struct.pack("<d", figure.value) for figure in reply.figures])
    return sha256(data)


def network_reply(reply):
    records = ("formation", "packets", "statistics", "schedule", "heard_links")
    assert not any(reply.HasField(name) for name in (*records, "frames")), "a network with protocols"
    data = struct.pack("<QQ", reply.step, reply.time_ns) + deliveries(reply.deliveries) + motes(reply)
    data += agent_commands(reply.commands) + mote_commands(reply.applied_commands)
    return sha256(data + ABSENT * len(records))


def exchange_digest(robots, network, commands):
    """Of both replies to a step, and the orders of the experiment that took effect in it."""
    n_agents = len(robots.states.x_m)
    return sha256(robots_reply(robots, n_agents) + network_reply(network) + mote_commands(commands))
