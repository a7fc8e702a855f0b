"""What the motes of a network that forms put on the air, by Wireshark's dissectors, against what the tables say of them."""

import json
import struct
from collections import Counter, defaultdict

import pyarrow.parquet as pq
import pytest
from conftest import only_directory, program, succeed
from dissection import ACK, BEACON, DATA, GOOD, READ, RPL, SLOT_NS, TX_OFFSET_NS, dissect, troubles

# A chain over links that lose frames; packets of 150 bytes up, which take two frames, and of 30 bytes down.
EXPERIMENT = """
[experiment]
name = "chain"
seed = 1
duration_s = 300.0
agents = 8
control_period = { slots = 101 }
[robotsim.scenario]
kind = "line"
spacing_m = 3.0
[robotsim.controller]
kind = "hold"
[netsim]
mode = "6tisch"
[netsim.phy]
propagation = "probabilistic-disk"
[netsim.sf]
kind = "msf"
[netsim.swarm]
transport = "none"
[[netsim.app]]
kind = "periodic"
period_s = 20.0
payload_bytes = 150
[[netsim.app]]
kind = "periodic"
senders = [0]
destination = "all"
period_s = 15.0
payload_bytes = 30
[output]
pcap = true
"""

ROOT = "02:00:00:00:00:01:00:00"


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """The directory that the run left."""
    folder = tmp_path_factory.mktemp("chain")
    (folder / "chain.toml").write_text(EXPERIMENT)
    succeed([program("murmuration"), "run", folder / "chain.toml", "--out", folder / "runs"])
    return only_directory(folder / "runs")


@pytest.fixture(scope="module")
def capture(chain):
    return chain / "radio.pcap"


@pytest.fixture(scope="module")
def last(chain):
    """By column, the sum over all motes at the end."""
    table = pq.read_table(chain / "motes.parquet").to_pylist()
    end = max(row["step"] for row in table)
    rows = [row for row in table if row["step"] == end]
    return {name: sum(row[name] for row in rows) for name in ("tx_frames", "tx_unicast", "tx_acked", "retransmissions")}


def of_type(frames, kind):
    return [frame for frame in frames if frame["wpan.frame_type"] == [kind]]


def test_nothing_is_malformed_and_every_checksum_is_right(capture):
    # The dissector of CoAP notes what it sees again: the same message on its next hop, or sent once more by the MAC.
    for trouble in troubles(capture):
        assert trouble["_ws.malformed"] == [] and trouble["_ws.expert.message"] == ["Retransmitted"], trouble
    frames = dissect(capture, "wpan.fcs_ok", "wpan.version", "icmpv6.checksum.status", "udp.checksum.status")
    assert all(frame["wpan.fcs_ok"] == [GOOD] and frame["wpan.version"] == ["2"] for frame in frames)
    for checksum in ("icmpv6.checksum.status", "udp.checksum.status"):
        found = [frame[checksum] for frame in frames if frame[checksum]]
        assert len(found) > 50 and all(status == [GOOD] for status in found), checksum


def test_as_many_frames_were_captured_as_motes_say_they_sent(chain, capture, last):
    frames = dissect(capture, "wpan.frame_type", "wpan.ack_request", "wpan-tap.asn")
    acknowledgments = of_type(frames, ACK)
    asked = [frame for frame in frames if frame["wpan.ack_request"] == ["1"]]
    assert len(frames) - len(acknowledgments) == last["tx_frames"]
    assert len(asked) == last["tx_unicast"]
    # Some acknowledgments are lost, and their frames sent again.
    assert 0 < last["tx_acked"] < len(acknowledgments) < len(asked)
    assert 0 < last["retransmissions"] < len(asked) - last["tx_acked"] + 1
    summary = json.loads((chain / "summary.json").read_text())
    assert summary["files"]["radio.pcap"] == {"frames": len(frames)}
    assert summary["kpis"]["formation"]["formed"]


def test_every_acknowledgment_answers_a_frame_of_its_slot(capture):
    frames = dissect(capture, "wpan.frame_type", "wpan.ack_request", "wpan-tap.asn", "wpan.seq_no", "wpan.src64",
                     "wpan.dst64", "wpan-tap.ch_num", "wpan.header_ie.time_correction.value")  # fmt: skip
    asked = {
        (*frame["wpan-tap.asn"], *frame["wpan.seq_no"], *frame["wpan.src64"], *frame["wpan-tap.ch_num"])
        for frame in frames
        if frame["wpan.ack_request"] == ["1"]
    }
    for frame in of_type(frames, ACK):
        answered = (*frame["wpan-tap.asn"], *frame["wpan.seq_no"], *frame["wpan.dst64"], *frame["wpan-tap.ch_num"])
        assert answered in asked, frame
        asked.remove(answered)
        # Clocks that are off by more than the guard time, 1.1 ms each way, would not have heard each other.
        assert abs(int(frame["wpan.header_ie.time_correction.value"][0])) <= 1100


def test_frames_lie_in_their_slots_in_the_order_of_time(capture):
    frames = dissect(capture, "wpan.frame_type", "wpan-tap.asn", "wpan.src64", "frame.time_epoch")
    times_ns = [int(frame["frame.time_epoch"][0].replace(".", "")) for frame in frames]
    assert times_ns == sorted(times_ns)
    for frame, time_ns in zip(frames, times_ns, strict=True):
        into_slot_ns = time_ns - int(frame["wpan-tap.asn"][0]) * SLOT_NS
        if frame["wpan.frame_type"] == [ACK]:
            assert TX_OFFSET_NS < into_slot_ns < SLOT_NS
        elif frame["wpan.src64"] == [ROOT]:
            assert into_slot_ns == TX_OFFSET_NS
        else:
            # By the sender's clock, which is off.
            assert abs(into_slot_ns - TX_OFFSET_NS) < TX_OFFSET_NS


def test_every_beacon_tells_the_schedule(capture):
    beacons = of_type(
        dissect(capture, "wpan.frame_type", "wpan-tap.asn", "wpan.tsch.asn", "wpan.tsch.slotframe_size",
                "wpan.tsch.link_options", "wpan.tsch.join_metric", "wpan.payload_ie.id"),
        BEACON,
    )  # fmt: skip
    assert len(beacons) > 100
    for beacon in beacons:
        assert beacon["wpan.tsch.asn"] == beacon["wpan-tap.asn"]
        assert beacon["wpan.tsch.slotframe_size"] == ["101"] and beacon["wpan.tsch.link_options"] == ["0x0f"]
        assert beacon["wpan.payload_ie.id"] == ["0x0001"]
    # The root's, and those of motes behind it.
    metrics = {int(beacon["wpan.tsch.join_metric"][0]) for beacon in beacons}
    assert 0 in metrics and len(metrics) > 2


def test_cells_are_added_by_6p(chain, capture):
    frames = dissect(capture, "wpan.6top_type", "wpan.6top_code", "wpan.6top_num_cells", "wpan.6top_sfid")
    messages = [frame for frame in frames if frame["wpan.6top_type"]]
    assert all(message["wpan.6top_sfid"] == ["0x00"] for message in messages)
    kinds = Counter((message["wpan.6top_type"][0], message["wpan.6top_code"][0]) for message in messages)
    add, success = ("0x00", "0x01"), ("0x01", "0x00")
    # Every mote but the root asked its parent for a cell at least once, and got one.
    assert kinds[add] >= 7 and kinds[success] >= 7
    schedule = pq.read_table(chain / "schedule.parquet").to_pylist()
    end = max(cell["step"] for cell in schedule)
    negotiated = [cell for cell in schedule if cell["step"] == end and cell["slotframe"] == 2]
    assert {cell["mote"] for cell in negotiated if cell["transmits"]} == set(range(1, 8))


def test_routes_are_asked_for_announced_and_acknowledged(capture):
    frames = dissect(capture, "icmpv6.type", "icmpv6.code", "icmpv6.rpl.opt.type", "ipv6.dst")
    messages = [frame for frame in frames if frame["icmpv6.type"]]
    assert all(message["icmpv6.type"] == [RPL] for message in messages)
    kinds = Counter(message["icmpv6.code"][0] for message in messages)
    solicitation, object_, advertisement, acknowledgment = "0", "1", "2", "3"
    assert set(kinds) == {solicitation, object_, advertisement, acknowledgment}
    assert all(kinds[kind] >= 7 for kind in (object_, advertisement, acknowledgment))
    for message in messages:
        if message["icmpv6.code"] == [advertisement]:
            # Non-storing: to the root, with target and transit information.
            assert message["ipv6.dst"] == ["fd00::1:0"] and message["icmpv6.rpl.opt.type"] == ["5", "6"]


def test_motes_are_admitted_through_others(capture):
    frames = dissect(capture, "coap.code", "coap.opt.uri_path", "coap.opt.uri_host", "ipv6.src", "ipv6.dst")
    messages = [frame for frame in frames if frame["coap.code"]]
    post, changed = ["2"], ["68"]
    requests = [message for message in messages if message["coap.code"] == post]
    answers = [message for message in messages if message["coap.code"] == changed]
    assert len(requests) >= 7 and len(answers) >= 7 and len(requests) + len(answers) == len(messages)
    assert all(request["coap.opt.uri_path"] == ["j"] for request in requests)
    assert all(request["coap.opt.uri_host"] == ["6tisch.arpa"] for request in requests)
    # Pledges speak to their proxies with link-local addresses, proxies to the registrar with global ones.
    ends = {request["ipv6.dst"][0].split(":")[0] for request in requests}
    assert ends == {"fe80", "fd00"}


def test_small_packets_go_down_in_one_frame(capture):
    frames = dissect(capture, "udp.length", "ipv6.src", "ipv6.dst", "coap.code", "wpan.src64")
    down = [frame for frame in frames if frame["udp.length"] and not frame["coap.code"]]
    assert len(down) > 20
    assert all(frame["udp.length"] == ["38"] and frame["ipv6.src"] == ["fd00::1:0"] for frame in down)
    # Over more than one hop.
    assert len({frame["wpan.src64"][0] for frame in down}) > 1


# Frame control, sequence number, PAN, two long addresses.
MAC_HEADER_BYTES = 2 + 1 + 2 + 8 + 8


def payloads(capture):
    """Of each frame with a fragment: link-layer source and destination, octets of its MAC header, octets after it."""
    words = ["tshark", "-r", capture, *READ, "-Y", "6lowpan.frag.size", "-T", "json", "-x", "-J", "frame wpan"]
    for packet in json.loads(succeed(words)):
        layers = packet["_source"]["layers"]
        octets = bytes.fromhex(layers["frame_raw"][0])
        # Behind the TAP header, whose length stands in its bytes 2 and 3.
        mac = int.from_bytes(octets[2:4], "little")
        lowpan = mac + MAC_HEADER_BYTES
        yield layers["wpan"]["wpan.src64"], layers["wpan"]["wpan.dst64"], octets[mac:lowpan], octets[lowpan:-2]


def test_fragments_put_together_are_the_datagrams_that_were_sent(capture, tmp_path):
    # Wireshark gives up on first fragments that begin with a page switch (RFC 8025): it is given the parts put together.
    begun, whole, sizes = {}, [], defaultdict(int)
    for source, destination, header, octets in payloads(capture):
        size, tag = int.from_bytes(octets[:2]) & 0x7FF, octets[2:4]
        way = (source, destination, tag)
        if octets[0] >> 3 == 0b11000:
            begun[way] = {0: octets[4:]}, header
            continue
        assert octets[0] >> 3 == 0b11100
        if way not in begun:
            continue
        parts, header = begun[way]
        parts[8 * octets[4]] = octets[5:]
        places = sorted(parts)
        # All but the first are as long as they were before compression.
        follow = all(here + len(parts[here]) == after for here, after in zip(places[1:], places[2:]))
        if len(parts) > 1 and follow and places[-1] + len(parts[places[-1]]) == size:
            whole.append(header + b"".join(parts[place] for place in places))
            sizes[size] += 1
            del begun[way]
    assert len(whole) > 100 and len(begun) < len(whole) / 10
    # 150 bytes, UDP, IPv6, and the RPL option, which is what is left out on the air.
    assert set(sizes) == {150 + 8 + 40 + 8}

    glued = tmp_path / "glued.pcap"
    link_type_without_fcs = 230
    with glued.open("wb") as file:
        file.write(struct.pack("<IHHIIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, link_type_without_fcs))
        for number, octets in enumerate(whole):
            file.write(struct.pack("<IIII", number, 0, len(octets), len(octets)) + octets)
    assert troubles(glued) == []
    datagrams = dissect(glued, "udp.length", "udp.checksum.status", "ipv6.dst", "ipv6.src")
    assert all(datagram["udp.length"] == ["158"] for datagram in datagrams)
    assert all(datagram["udp.checksum.status"] == [GOOD] for datagram in datagrams)
    assert all(datagram["ipv6.dst"] == ["fd00::1:0"] for datagram in datagrams)
    assert {datagram["ipv6.src"][0] for datagram in datagrams} == {f"fd00::{mote}" for mote in range(1, 8)}


def test_every_data_frame_is_something_known(capture):
    frames = dissect(capture, "wpan.frame_type", "frame.protocols", "6lowpan.frag.size", "wpan.6top_type", "data.len",
                     "wpan.dst64", "frame.number")  # fmt: skip
    for frame in of_type(frames, DATA):
        layers = frame["frame.protocols"][0]
        is_ip = layers.startswith("wpan-tap:6lowpan:ipv6:")
        # A frame without content keeps the time of the neighbour it goes to (a keep-alive).
        keeps_time = layers == "wpan-tap" and frame["wpan.dst64"] and not frame["data.len"]
        assert is_ip or frame["6lowpan.frag.size"] or frame["wpan.6top_type"] or keeps_time, frame
