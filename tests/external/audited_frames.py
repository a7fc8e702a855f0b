"""Frames of a capture for wire_audit.py: Wireshark's dissection of each, and of the datagrams that fragments make."""

import ipaddress
import json
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from audited_networks import MOTES, Network
from dissection import ACK, BEACON, DATA, PAYLOADS, SLOT_NS, TX_OFFSET_NS, dissect
from unsecured import Secured, oscore_contexts

# macTsTxAckDelay (IEEE Std 802.15.4-2015, 8.4.3.3.1), and O-QPSK at 2.4 GHz: a byte, bytes before the PSDU.
TX_ACK_DELAY_NS = 1_000_000
BYTE_NS = 32_000
PHY_HEADER_BYTES = 6

FIELDS = """
frame.time_epoch wpan-tap.asn wpan-tap.ch_num wpan-tap.data_length wpan.frame_type wpan.version wpan.fcs_ok wpan.seq_no
wpan.seqno_suppression wpan.security wpan.aux_sec.sec_level wpan.aux_sec.key_id_mode wpan.aux_sec.key_index
wpan.aux_sec.frame_counter_suppression wpan.aux_sec.asn_in_nonce wpan.mic wpan.ack_request wpan.pan_id_compression wpan.dst_addr_mode wpan.src_addr_mode
wpan.dst_pan wpan.src_pan wpan.dst16 wpan.dst64 wpan.src64 wpan.header_ie.id wpan.header_ie.time_correction.value
wpan.header_ie.vendor_specific.vendor_oui wpan.header_ie.vendor_specific.content
wpan.payload_ie.id wpan.mlme.ie.id wpan.tsch.asn wpan.tsch.join_metric wpan.tsch.slotframe_num wpan.tsch.timeslot.id
wpan.tsch.link_options wpan.tsch.hopping_sequence_id wpan.6top_version wpan.6top_type wpan.6top_code wpan.6top_sfid
wpan.6top_seqnum wpan.6top_metadata wpan.6top_cell_options wpan.6top_num_cells wpan.6top_cell_slot_offset
wpan.6top_channel_offset 6lowpan.frag.size 6lowpan.6loRH.bitO 6lowpan.6loRH.bitR 6lowpan.6loRH.bitF 6lowpan.6loRH.bitK
6lowpan.sender.rank 6lowpan.rpl.instance 6lowpan.rhhop.limit 6lowpan.rhtype ipv6.tclass.dscp ipv6.src ipv6.dst ipv6.hlim ipv6.nxt udp.srcport
udp.dstport udp.length udp.checksum udp.checksum.status coap.code coap.mid coap.token coap.type oscore.code
oscore.opt.uri_path oscore.tag icmpv6.type icmpv6.code
icmpv6.checksum icmpv6.checksum.status icmpv6.rpl.dio.rank icmpv6.rpl.dio.version icmpv6.rpl.dio.instance
icmpv6.rpl.dio.flag.g icmpv6.rpl.dio.flag.mop icmpv6.rpl.dio.dtsn icmpv6.rpl.dio.dagid icmpv6.rpl.opt.type
icmpv6.rpl.opt.config.flag icmpv6.rpl.opt.config.ocp icmpv6.rpl.opt.config.min_hop_rank_inc
icmpv6.rpl.opt.config.def_lifetime icmpv6.rpl.opt.config.lifetime_unit icmpv6.rpl.opt.config.interval_min
icmpv6.rpl.opt.prefix.flag icmpv6.rpl.opt.prefix icmpv6.rpl.opt.prefix.length icmpv6.rpl.dao.instance
icmpv6.rpl.dao.flag.k icmpv6.rpl.dao.flag.d icmpv6.rpl.dao.sequence icmpv6.rpl.opt.target.prefix
icmpv6.rpl.opt.target.prefix_length icmpv6.rpl.opt.transit.parent icmpv6.rpl.opt.transit.pathctl
icmpv6.rpl.opt.transit.pathseq icmpv6.rpl.opt.transit.pathlifetime icmpv6.rpl.opt.transit.flag.e
icmpv6.rpl.daoack.sequence icmpv6.rpl.daoack.status _ws.malformed _ws.expert.severity _ws.expert.message data.len
frame.protocols
""".split()


def mote_of_eui64(text):
    """02:00:00:00:00:00:00:05 is mote 5, and mote 0 has 02:00:00:00:00:01:00:00."""
    return int(text.replace(":", ""), 16) % 0x10000


def mote_of_ip(text):
    """fd00::5 and fe80::5 are mote 5's; None: a group or the unspecified address."""
    address = ipaddress.IPv6Address(text)
    return None if address.is_multicast or address.is_unspecified else int(address) % 0x10000


class Frame:
    """A frame as dissected. `frame[field]`: the list of values of a field; empty if the frame does not have it."""

    def __init__(self, number, fields, record, secured=None):
        self.number = number
        self.fields = fields
        # Without its security, if it has any.
        self.record = record
        self.mic_is_right = secured is None or secured.is_right
        self.time_ns = int(fields["frame.time_epoch"][0].replace(".", ""))
        self.asn = int(fields["wpan-tap.asn"][0])
        self.channel = int(fields["wpan-tap.ch_num"][0])
        self.psdu_bytes = int(fields["wpan-tap.data_length"][0])
        self.kind = fields["wpan.frame_type"][0]
        self.sequence = self.number_in("wpan.seq_no")
        self.source = mote_of_eui64(fields["wpan.src64"][0]) if fields["wpan.src64"] else None
        self.destination = mote_of_eui64(fields["wpan.dst64"][0]) if fields["wpan.dst64"] else None
        self.ack_request = fields["wpan.ack_request"] == ["1"]

    def __getitem__(self, field):
        return self.fields[field]

    def number_in(self, field, at=0):
        """One value of a field as a number; None: the frame does not have it."""
        values = self.fields[field]
        return int(values[at], 0) if values else None

    @property
    def is_beacon(self):
        return self.kind == BEACON

    @property
    def is_data(self):
        return self.kind == DATA

    @property
    def is_ack(self):
        return self.kind == ACK

    @property
    def is_secured(self):
        return self["wpan.security"] == ["1"]

    @property
    def deviation_ns(self):
        """How long after its slot's nominal time a beacon or data frame began."""
        return self.time_ns - self.asn * SLOT_NS - TX_OFFSET_NS

    @property
    def air_ns(self):
        return (PHY_HEADER_BYTES + self.psdu_bytes) * BYTE_NS

    # Of the datagram, which is the inner one if there are two:

    @property
    def has_datagram(self):
        return bool(self["ipv6.dst"])

    @property
    def ip_source(self):
        return mote_of_ip(self["ipv6.src"][-1])

    @property
    def ip_destination(self):
        return mote_of_ip(self["ipv6.dst"][-1])

    @property
    def is_routed(self):
        """Whether routing brings the datagram from one mote to another: neither a group's nor the link's."""
        return self.has_datagram and self["ipv6.dst"][-1].startswith("fd00:")

    @property
    def hop_limit(self):
        return int(self["ipv6.hlim"][-1])

    @property
    def tunnel_hop_limit(self):
        """That of the encapsulating header (RFC 8138, section 7); None: there is none."""
        return self.number_in("6lowpan.rhhop.limit")

    @property
    def goes_down(self):
        """The O bit; None: no RPL packet information."""
        bits = self["6lowpan.6loRH.bitO"]
        return bits[0] in ("1", "True") if bits else None

    @property
    def rank_error(self):
        return self["6lowpan.6loRH.bitR"][:1] in (["1"], ["True"])

    @property
    def forwarding_error(self):
        return self["6lowpan.6loRH.bitF"][:1] in (["1"], ["True"])

    @property
    def sender_rank(self):
        """That of packet information. With the K bit its least significant octet is zero and left out (RFC 8138, section 6)."""
        rank = self.number_in("6lowpan.sender.rank")
        return rank * 256 if self["6lowpan.6loRH.bitK"][:1] in (["1"], ["True"]) else rank

    @cached_property
    def source_route(self):
        """The motes of its source route header, next one first (RFC 8138, section 5): each address relative to the one before
        it, the first to the root's, which is fd00::1:0."""
        octets = self.record[16 + int.from_bytes(self.record[18:20], "little") :]
        header_bytes = MAC_HEADER_BYTES
        # A link's blacklist (9 octets, with the end of the header elements), if information elements are present.
        if octets[1] & 0x02:
            header_bytes += BLACKLIST_BYTES
        octets = octets[header_bytes:]
        hops, at, address = [], 1, bytes.fromhex("fd000000000000000000000000010000")
        # Page 1, then critical routing headers of types 0 to 4.
        while octets[0] == 0xF1 and octets[at] >> 5 == 0b100 and octets[at + 1] <= 4:
            size = 1 << octets[at + 1]
            for here in range(at + 2, at + 2 + size * (1 + octets[at] % 32), size):
                address = address[:-size] + octets[here : here + size]
                hops.append(int.from_bytes(address[-2:], "big"))
            at += 2 + size * (1 + octets[at] % 32)
        return hops

    def is_rpl(self, code):
        return self["icmpv6.type"] == ["155"] and self["icmpv6.code"] == [str(code)]

    @property
    def identity(self):
        """What stays the same of a datagram on its way."""
        same = ("ipv6.src", "ipv6.dst", "udp.srcport", "udp.dstport", "udp.checksum", "udp.length", "icmpv6.checksum")
        return tuple(self[field][-1] if self[field] else None for field in same)


DIS, DIO, DAO, DAO_ACK = range(4)


@dataclass
class Capture:
    """All frames of a capture."""

    network: Network
    path: Path
    # When the network had formed; None: it had not.
    formed_ns: int | None
    # As captured.
    frames: list
    # Instead of fragments the datagrams that they make, each with the number of the first fragment, in the order in which
    # they were complete.
    datagrams: list

    def says(self, frame, what):
        return f"{self.path}, frame {frame.number}: {what}"

    @cached_property
    def beacons(self):
        return [frame for frame in self.frames if frame.is_beacon]

    @cached_property
    def acks(self):
        return [frame for frame in self.frames if frame.is_ack]

    @cached_property
    def answered(self):
        """Pairs: an acknowledgment and the frame of its slot that it answers."""
        asked = {
            (frame.asn, frame.channel, frame.source, frame.sequence): frame for frame in self.frames if frame.ack_request
        }
        return [(ack, asked.get((ack.asn, ack.channel, ack.destination, ack.sequence))) for ack in self.acks]


def read_capture(network, path):
    """Dissects a capture."""
    records = split(path.read_bytes())
    sent = {}
    secured = [Secured(record, sent) for record in records]
    whole = list(reassembled([of.legible for of in secured], network.payload_bytes))
    glued = path.with_name("glued.pcap")
    glued.write_bytes(path.read_bytes()[:24] + b"".join(records) + b"".join(record for _, record in whole))
    contexts = oscore_contexts(range(1, MOTES)) if network.secured else []
    rows = dissect(glued, *FIELDS, more=[*PAYLOADS, *contexts])
    assert len(rows) == len(records) + len(whole), path
    frames = [Frame(at + 1, rows[at], of.legible, of) for at, of in enumerate(secured)]
    put_together = [Frame(number, row, record) for (number, record), row in zip(whole, rows[len(records) :], strict=True)]
    unbroken = [frame for frame in frames if frame.has_datagram and not frame["6lowpan.frag.size"]]
    datagrams = sorted([*unbroken, *put_together], key=lambda frame: (frame.time_ns, frame.number))
    formed_s = json.loads(path.with_name("summary.json").read_text())["kpis"]["formation"]["formed_s"]
    return Capture(network, path, None if formed_s is None else round(formed_s * 1e9), frames, datagrams)


def split(octets):
    """The records of a pcap file, each with its header of 16 bytes."""
    records, at = [], 24
    while at < len(octets):
        length = struct.unpack_from("<I", octets, at + 8)[0]
        records.append(octets[at : at + 16 + length])
        at += 16 + length
    return records


# Frame control, sequence number, PAN, two long addresses.
MAC_HEADER_BYTES = 2 + 1 + 2 + 8 + 8
# Vendor-specific header element with the channels that a link skips, and header termination 2.
BLACKLIST_BYTES = 2 + 3 + 2 + 2
# Where the type of the frame check sequence stands in a record.
FCS_TYPE_AT = 16 + 8


def reassembled(records, payload_bytes):
    """Of each datagram of which every fragment went over a hop: the number of the first fragment and a record with all.

    Wireshark gives up on first fragments that begin with a page switch (RFC 8025): it is given the parts put together.
    Every datagram in fragments has a UDP payload of `payload_bytes`.
    """
    begun = {}
    for number, record in enumerate(records, start=1):
        mac = 16 + int.from_bytes(record[18:20], "little")
        octets = record[mac + MAC_HEADER_BYTES : -2]
        # A data frame without information elements, from one mote to another.
        if record[mac : mac + 2] not in (b"\x21\xec", b"\x31\xec") or not octets or octets[0] >> 3 not in (0b11000, 0b11100):
            continue
        size = int.from_bytes(octets[:2], "big") & 0x7FF
        way = record[mac + 5 : mac + MAC_HEADER_BYTES] + octets[2:4]
        if octets[0] >> 3 == 0b11000:
            header = bytearray(record[: mac + MAC_HEADER_BYTES])
            header[FCS_TYPE_AT] = 0
            begun[way] = number, header, {0: octets[4:]}
            continue
        if way not in begun:
            continue
        first, header, parts = begun[way]
        parts[8 * octets[4]] = octets[5:]
        places = sorted(parts)
        # All but the first are as long as they were before compression.
        follow = all(here + len(parts[here]) == after for here, after in zip(places[1:], places[2:]))
        # The first one's compressed headers are shorter than a part.
        has_all = payload_bytes < sum(len(part) for part in parts.values())
        if follow and has_all and places[-1] + len(parts[places[-1]]) == size:
            # Complete when the last one came.
            header[:8] = record[:8]
            whole = bytes(header) + b"".join(parts[place] for place in places)
            length = struct.pack("<I", len(whole) - 16)
            yield first, whole[:8] + length + length + whole[16:]
            del begun[way]


def expect_none(faults, checked, at_least=1):
    """No faults, out of so many frames that were checked, of which there must be enough."""
    faults = list(faults)
    assert checked >= at_least, f"only {checked} frames were checked"
    listed = "\n".join(faults[:10])
    assert not faults, f"{len(faults)} of {checked}:\n{listed}"


def faults_of(capture, frames, is_right, what, at_least=1):
    """Checks frames one by one. `what` says of a wrong one what is wrong with it."""
    frames = list(frames)
    expect_none((capture.says(frame, what(frame)) for frame in frames if not is_right(frame)), len(frames), at_least)
