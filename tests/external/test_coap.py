"""CoAP exchanges and downloads of whole runs, by Wireshark's dissectors, against what the tables say of them."""

import json
from collections import defaultdict

import pyarrow.parquet as pq
from conftest import ROOT, only_directory, program, succeed
from dissection import SLOT_NS, dissect

CONFIRMABLE, ACKNOWLEDGMENT = "0", "2"
CONTENT = "69"


def recorded(config, folder, seed):
    """The directory that a run of a configuration left, with a capture."""
    path = folder / "traffic.toml"
    path.write_text(config)
    succeed([program("murmuration"), "run", path, "--seed", str(seed), "--out", folder, "--set", "output.pcap=true"], cwd=folder)
    return only_directory(folder)


def test_wireshark_puts_the_blocks_of_downloads_together(tmp_path):
    config = (ROOT / "configs" / "traffic-download.toml").read_text()
    # Without the reports of other motes, and under a seed with which both stay in the network: between two blocks that are minutes
    # apart, Wireshark begins anew.
    reports = '[[netsim.app]]\nkind = "periodic"\nperiod_s = 60.0\npayload_bytes = 40\n'
    assert reports in config
    run = recorded(config.replace(reports, ""), tmp_path, seed=4)
    frames = dissect(run / "radio.pcap", "_ws.malformed", "coap.code", "ipv6.dst", "coap.block.reassembled.length",
                     "coap.block.error", "data.data")  # fmt: skip
    assert [frame for frame in frames if frame["_ws.malformed"] or frame["coap.block.error"]] == []
    whole = {
        frame["ipv6.dst"][0]: frame for frame in frames if frame["coap.code"] == [CONTENT] and frame["coap.block.reassembled.length"]
    }
    assert sorted(whole) == ["fd00::3", "fd00::7"]
    expected = bytes((place ^ place >> 8) & 0xFF for place in range(100_000))
    for frame in whole.values():
        assert frame["coap.block.reassembled.length"] == ["100000"]
        assert bytes.fromhex(frame["data.data"][0]) == expected
    downloads = json.loads((run / "summary.json").read_text())["kpis"]["downloads"]
    assert (downloads["succeeded"], downloads["failed"]) == (2, 0)


def test_round_trips_are_those_of_the_frames_on_the_air(tmp_path):
    # Under this seed some exchanges fail.
    run = recorded((ROOT / "configs" / "traffic-coap.toml").read_text(), tmp_path, seed=2)
    frames = dissect(run / "radio.pcap", "_ws.malformed", "frame.time_epoch", "coap.type", "coap.mid", "coap.token", "coap.opt.uri_path",
                     "coap.payload_length", "ipv6.src", "ipv6.dst")  # fmt: skip
    assert [frame for frame in frames if frame["_ws.malformed"]] == []
    first_ns, answers = {}, defaultdict(list)
    for frame in frames:
        seconds, fraction = (frame["frame.time_epoch"] or ["0.0"])[0].split(".")
        at_ns = int(seconds) * 10**9 + int(fraction.ljust(9, "0")[:9])
        ids = (*frame["coap.mid"], *frame["coap.token"])
        if frame["coap.type"] == [CONFIRMABLE]:
            assert frame["coap.opt.uri_path"] == ["s0"]
            first_ns.setdefault((frame["ipv6.dst"][0], ids), at_ns)
        elif frame["coap.type"] == [ACKNOWLEDGMENT]:
            assert frame["coap.payload_length"] == ["20"]
            answers[frame["ipv6.src"][0]].append((at_ns, ids))
    rows = pq.read_table(run / "packets.parquet").to_pylist()
    exchanges = [row for row in rows if row["kind"] == "exchange"]
    succeeded = [row for row in exchanges if row["delivered"]]
    seen = set()
    for row in succeeded:
        mote = f"fd00::{row['destination']:x}"
        # The last frame of the response ends within the slot in which it began.
        (ids,) = {ids for at_ns, ids in answers[mote] if 0 <= row["ended_ns"] - at_ns < SLOT_NS}
        assert row["created_ns"] <= first_ns[mote, ids] < row["ended_ns"]
        seen.add((mote, ids))
    # Each exchange has a message ID and a token of its own.
    assert len(seen) == len(succeeded) > 500
    kpis = json.loads((run / "summary.json").read_text())["kpis"]["exchanges"]
    assert (kpis["succeeded"], kpis["started"]) == (len(succeeded), len(exchanges))
    mean_s = sum(row["ended_ns"] - row["created_ns"] for row in succeeded) / len(succeeded) / 1e9
    assert abs(kpis["round_trip_s"]["mean"] - mean_s) < 1e-9
    assert 0 < kpis["failed"] < 0.1 * kpis["started"]
