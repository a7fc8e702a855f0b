"""Frames as the simulator writes them, by Wireshark's dissectors."""

import subprocess
from collections import Counter

import pytest

from conftest import BUILT, ROOT, RUN_DEADLINE_S, only_directory, program, succeed
from dissection import ACK, BEACON, DATA, GOOD, PAYLOADS, RPL, dissect, troubles

BUILD_DEADLINE_S = 1200

@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """One frame of every kind."""
    build = ["cargo", "build", "--locked", "--release", "--workspace", "--example", "frames"]
    succeed(build, deadline_s=BUILD_DEADLINE_S, cwd=ROOT)
    path = tmp_path_factory.mktemp("capture") / "frames.pcap"
    with path.open("wb") as out:
        subprocess.run([BUILT / "examples" / "frames"], stdout=out, check=True, timeout=RUN_DEADLINE_S)
    return path


def test_nothing_is_malformed_and_every_frame_check_sequence_is_right(capture):
    assert troubles(capture) == []
    frames = dissect(capture, "wpan.fcs_ok", "wpan.frame_type", "wpan.version")
    kinds = Counter(frame["wpan.frame_type"][0] for frame in frames)
    assert kinds[BEACON] == 2 and kinds[DATA] > 30 and kinds[ACK] > 25
    assert all(frame["wpan.fcs_ok"] == [GOOD] for frame in frames)
    assert all(frame["wpan.version"] == ["2"] for frame in frames)


def test_a_swarm_that_flies_is_dissected_too(tmp_path):
    config = ROOT / "configs" / "flocking-rrsf.toml"
    shorter = ["netsim.mac.beacon_wait_s=5.0", "experiment.duration_s=10.0", "output.pcap=true"]
    words = [word for setting in shorter for word in ("--set", setting)]
    succeed([program("murmuration"), "run", config, "--out", tmp_path, *words], cwd=tmp_path)
    capture = only_directory(tmp_path) / "radio.pcap"
    frames = dissect(capture, "_ws.malformed", "udp.dstport", more=PAYLOADS)
    assert [frame for frame in frames if frame["_ws.malformed"]] == []
    assert sum(frame["udp.dstport"] == ["61617"] for frame in frames) > 900


def test_a_flipped_bit_would_have_been_noticed(capture, tmp_path):
    # Guards the test above: dissectors that verify nothing are content with everything.
    octets = bytearray(capture.read_bytes())
    octets[-1] ^= 1
    flipped = tmp_path / "flipped.pcap"
    flipped.write_bytes(octets)
    assert dissect(flipped, "wpan.fcs_ok")[-1]["wpan.fcs_ok"] != [GOOD]
    assert len(troubles(flipped)) == 1


def test_the_beacon_tells_a_joining_mote_the_schedule(capture):
    frames = dissect(
        capture, "wpan.header_ie.id", "wpan.payload_ie.id", "wpan.mlme.ie.id", "wpan.tsch.slotframe_size",
        "wpan.tsch.link_options", "wpan.tsch.join_metric", "wpan.tsch.timeslot.id", "wpan.tsch.hopping_sequence_id",
    )  # fmt: skip
    assert list(frames[0].values()) == [
        ["0x007e"], ["0x0001"], ["0x001a", "0x001c", "0x001b", "0x0009"], ["101"], ["0x0f"], ["0"], ["0x00"], ["0x00"],
    ]  # fmt: skip


def test_what_is_announced_of_slots_is_a_vendor_s_and_ends_before_the_payload(capture):
    frames = dissect(capture, "wpan.payload_ie.id", "wpan.payload_ie.vendor.oui", "udp.dstport")
    announcing = [frame for frame in frames if "0x0002" in frame["wpan.payload_ie.id"]]
    assert [frame["wpan.payload_ie.id"] for frame in announcing] == [["0x0001", "0x0002"], ["0x0002"], ["0x0002", "0x000f"]]
    assert all(len(frame["wpan.payload_ie.vendor.oui"]) == 1 for frame in announcing)
    assert announcing[2]["udp.dstport"] == ["61617"]


def test_what_a_link_skips_is_a_vendor_s_and_ends_before_the_payload(capture):
    fields = "wpan.header_ie.id", "wpan.header_ie.vendor_specific.content", "wpan.payload_ie.id", "udp.dstport"
    skipping = [frame for frame in dissect(capture, *fields) if frame["wpan.header_ie.vendor_specific.content"]]
    assert [frame["wpan.header_ie.id"] for frame in skipping] == [["0x0000"], ["0x0000", "0x007e"], ["0x0000", "0x007f"]]
    contents = [frame["wpan.header_ie.vendor_specific.content"][0].replace(":", "") for frame in skipping]
    assert [bytes.fromhex(content) for content in contents] == 3 * [b"\xf3\x0f"]
    assert skipping[1]["wpan.payload_ie.id"] == ["0x0005"]
    assert skipping[2]["udp.dstport"] == ["61617"]


def test_acknowledgments_correct_the_time(capture):
    frames = dissect(capture, "wpan.frame_type", "wpan.header_ie.time_correction.value", "wpan.dst64", "wpan-tap.asn")
    acknowledgments = [frame for frame in frames if frame["wpan.frame_type"] == [ACK]]
    assert all(frame["wpan.header_ie.time_correction.value"] == ["-31"] for frame in acknowledgments)
    assert all(frame["wpan.dst64"] for frame in acknowledgments)
    slots = [int(frame["wpan-tap.asn"][0]) for frame in frames]
    assert slots == sorted(slots) and len(set(slots)) == len(frames) - len(acknowledgments)


def test_6p_messages_of_every_kind(capture):
    fields = ("wpan.6top_type", "wpan.6top_code", "wpan.6top_num_cells", "wpan.6top_cell_slot_offset",
              "wpan.6top_total_num_cells", "wpan.6top_max_num_cells", "wpan.6top_payload")  # fmt: skip
    messages = [frame for frame in dissect(capture, *fields) if frame["wpan.6top_type"]]
    kinds = Counter((frame["wpan.6top_type"][0], frame["wpan.6top_code"][0]) for frame in messages)
    requests = {("0x00", f"0x{command:02x}"): 1 for command in range(1, 8)}
    # One ADD more has the blacklist of its link.
    assert kinds == {**requests, ("0x00", "0x01"): 2, ("0x01", "0x00"): 7, ("0x02", "0x00"): 1}
    add, relocate = messages[0], messages[4]
    assert add["wpan.6top_num_cells"] == ["2"]
    assert [int(slot, 16) for slot in add["wpan.6top_cell_slot_offset"]] == [10, 11, 12, 13, 14]
    assert [int(slot, 16) for slot in relocate["wpan.6top_cell_slot_offset"]] == [10, 11, 20, 21, 22, 23, 24]


def test_rpl_messages_of_every_kind_with_right_checksums(capture):
    frames = dissect(capture, "icmpv6.type", "icmpv6.code", "icmpv6.checksum.status", "icmpv6.rpl.opt.type", "ipv6.dst")
    messages = [frame for frame in frames if frame["icmpv6.type"]]
    assert all(frame["icmpv6.type"] == [RPL] for frame in messages)
    assert all(frame["icmpv6.checksum.status"] == [GOOD] for frame in messages)
    kinds = [(frame["icmpv6.code"][0], frame["icmpv6.rpl.opt.type"], frame["ipv6.dst"]) for frame in messages]
    assert kinds == [
        ("0", [], ["ff02::1a"]),
        ("1", ["4", "8"], ["ff02::1a"]),
        ("1", ["4", "8"], ["fe80::1"]),
        ("2", ["5", "6"], ["fd00::1:0"]),
        ("3", [], ["fd00::2"]),
    ]


def test_join_messages_go_to_j_at_6tisch_arpa(capture):
    frames = dissect(capture, "coap.code", "coap.opt.uri_path", "coap.opt.uri_host", "coap.opt.proxy_scheme",
                     "coap.token", "coap.type", "udp.checksum.status")  # fmt: skip
    non_confirmable = ["1"]
    messages = [frame for frame in frames if frame["coap.type"] == non_confirmable]
    assert all(frame["udp.checksum.status"] == [GOOD] for frame in messages)
    post, changed = ["2"], ["68"]
    assert [frame["coap.code"] for frame in messages] == [post, post, changed, changed]
    assert [frame["coap.opt.uri_path"] for frame in messages[:2]] == [["j"], ["j"]]
    assert [frame["coap.opt.uri_host"] for frame in messages[:2]] == [["6tisch.arpa"], ["6tisch.arpa"]]
    assert [frame["coap.opt.proxy_scheme"] for frame in messages[:2]] == [["coap"], []]
    assert messages[0]["coap.token"] == messages[3]["coap.token"] != messages[1]["coap.token"]
    assert messages[1]["coap.token"] == messages[2]["coap.token"]


def test_coap_exchanges_and_blocks_are_what_rfc_7252_and_7959_say(capture):
    frames = dissect(capture, "coap.type", "coap.code", "coap.mid", "coap.token", "coap.opt.uri_path", "coap.opt.block_number",
                     "coap.opt.block_mflag", "coap.opt.block_size", "coap.payload_length", "udp.srcport", "udp.dstport",
                     "udp.checksum.status", "ipv6.src", "ipv6.dst")  # fmt: skip
    confirmable, acknowledgment = ["0"], ["2"]
    messages = [frame for frame in frames if frame["coap.type"] in (confirmable, acknowledgment)]
    assert all(frame["udp.checksum.status"] == [GOOD] for frame in messages)
    assert all(frame["udp.srcport"] == frame["udp.dstport"] == ["5683"] for frame in messages)
    get, content = ["1"], ["69"]
    assert [frame["coap.code"] for frame in messages] == [get, content] * 3
    assert [frame["coap.type"] for frame in messages] == [confirmable, acknowledgment] * 3
    assert [frame["coap.opt.uri_path"] for frame in messages[::2]] == [["s0"], ["f1"], ["f1"]]
    for request, response in zip(messages[::2], messages[1::2]):
        assert request["coap.mid"] == response["coap.mid"]
        assert request["coap.token"] == response["coap.token"]
        assert (request["ipv6.src"], request["ipv6.dst"]) == (response["ipv6.dst"], response["ipv6.src"])
    assert messages[0]["coap.mid"] == ["32052"]
    assert messages[1]["coap.payload_length"] == ["16"]
    assert [frame["coap.opt.block_number"] for frame in messages[2:]] == [["0"], ["0"], ["1"], ["1"]]
    assert [frame["coap.opt.block_mflag"] for frame in messages[3::2]] in ([["1"], ["0"]], [["True"], ["False"]])
    assert all(frame["coap.opt.block_size"][0] == "1" for frame in messages[2:])
    # Wireshark puts the blocks of 32 and 16 bytes together.
    assert messages[5]["coap.payload_length"] == ["48"]


def test_addresses_that_were_left_out_are_found_again(capture):
    frames = dissect(capture, "udp.srcport", "udp.checksum.status", "ipv6.src", "ipv6.dst", "udp.length")
    datagrams = [frame for frame in frames if frame["udp.srcport"] == ["61617"]]
    assert all(frame["udp.checksum.status"] == [GOOD] for frame in datagrams)
    ends = [(frame["ipv6.src"][0], frame["ipv6.dst"][0]) for frame in datagrams]
    assert ends == [
        ("fd00::1", "fd00::1:0"),
        ("fd00::2", "fd00::1:0"),
        ("fd00::1:0", "fd00::3"),
        ("fd00::1", "fd00::3"),
        ("fe80::1", "ff02::1"),
        ("fd00::1", "fd00::1:0"),
        # The one with an announcement of slots, and the one with the blacklist of its link.
        ("fe80::1", "ff02::1"),
        ("fd00::1", "fd00::1:0"),
    ]


def test_fragments_make_their_datagram_again(capture):
    # Of the first datagram: Wireshark does not count the RPL option that the second one's size includes (RFC 4944,
    # § 5.3: the size before compression), and so never finds that one complete.
    frames = dissect(capture, "6lowpan.frag.size", "6lowpan.frag.tag", "6lowpan.reassembled.length", "udp.length")
    fragments = [frame for frame in frames if frame["6lowpan.frag.size"]]
    sizes = [(int(frame["6lowpan.frag.tag"][0], 16), int(frame["6lowpan.frag.size"][0])) for frame in fragments]
    assert sizes == [(1, 248)] * 3 + [(2, 256)] * 3
    assert fragments[2]["6lowpan.reassembled.length"] == ["248"]
    assert fragments[2]["udp.length"] == ["208"]
