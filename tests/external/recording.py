"""Reads run.mcap with the `mcap` package and computes the digest of a step by the rule in cosim/v1/common.proto.

Nothing here was derived from the Rust code: the rule's text and the topics in docs/outputs.md are its only sources.
"""

import hashlib
import struct
from collections import defaultdict
from dataclasses import dataclass

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


@dataclass
class Entry:
    """One message: the topic it stands under, its type, its time (ns), its bytes and what they mean."""

    topic: str
    type: str
    log_time: int
    publish_time: int
    data: bytes
    message: object


def entries(path):
    """All messages of a recording, in the order of the file."""
    found = []
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, raw, decoded in reader.iter_decoded_messages(log_time_order=False):
            found.append(
                Entry(channel.topic, schema.name, raw.log_time, raw.publish_time, raw.data, decoded)
            )
    return found


def by_topic(path):
    """All messages of a recording, sorted by topic, each list in the order of the file."""
    topics = defaultdict(list)
    for entry in entries(path):
        topics[entry.topic].append(entry)
    return dict(topics)


def digest(step, time_ns, states, deliveries):
    """SHA-256 of a step: `states` are those the network used, `deliveries` those the robots were given, or None."""
    data = struct.pack("<QQ", step, time_ns) + states.alive
    for column in (states.x_m, states.y_m, states.z_m):
        data += pack("d", column)
    if deliveries is not None:
        sent = deliveries.transmissions
        data += pack("I", sent.sender) + pack("Q", sent.sent_ns) + pack("Q", sent.end_ns)
        data += pack("I", sent.payloads.length_bytes) + sent.payloads.data
        data += pack("I", deliveries.heard_end) + pack("I", deliveries.heard) + deliveries.heard_bitmap
    return hashlib.sha256(data).digest()


def pack(letter, column):
    """A column, little-endian, without padding."""
    return struct.pack(f"<{len(column)}{letter}", *column)


def heard_by(deliveries, receiver, agent_count):
    """The indices of the transmissions that one agent heard, from either form."""
    n = len(deliveries.transmissions.sender)
    if deliveries.heard_bitmap:
        width = (n + 7) // 8
        assert len(deliveries.heard_bitmap) == width * agent_count
        row = deliveries.heard_bitmap[receiver * width : (receiver + 1) * width]
        return [i for i in range(n) if row[i // 8] >> (i % 8) & 1]
    if not deliveries.heard_end:
        return []
    start = deliveries.heard_end[receiver - 1] if receiver else 0
    return list(deliveries.heard[start : deliveries.heard_end[receiver]])


def same_recording(here, there):
    """Compares all that the promise of byte identity covers: messages, tables and the summary."""
    ours, theirs = entries(here / "run.mcap"), entries(there / "run.mcap")
    assert len(ours) == len(theirs) > 0
    for number, (one, other) in enumerate(zip(ours, theirs, strict=True)):
        assert (one.topic, one.type, one.log_time, one.publish_time) == (
            other.topic, other.type, other.log_time, other.publish_time,
        ), f"message {number}"
        assert one.data == other.data, f"message {number} on {one.topic} at {one.log_time} ns"
    files = sorted(path.name for path in [*here.glob("*.parquet"), here / "summary.json"])
    assert files == sorted(path.name for path in [*there.glob("*.parquet"), there / "summary.json"])
    assert "steps.parquet" in files
    for name in files:
        assert (here / name).read_bytes() == (there / name).read_bytes(), f"{name} differs"
