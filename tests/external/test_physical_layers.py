"""Frames of physical layers below 1 GHz, by Wireshark's dissectors: channels, pages, and how long frames last."""

import pytest
from conftest import ROOT, only_directory, program, succeed
from dissection import ACK, BEACON, GOOD, TX_OFFSET_NS, dissect

CONFIG = ROOT / "configs" / "sensors-sub-ghz.toml"
TX_ACK_DELAY_NS = 1_000_000
# IEEE Std 802.15.4-2015: channel page, last channel, bytes before a frame, duration of a byte (ns); and a slot that is long enough.
LAYERS = {
    "o-qpsk-868": (2, 0, 6, 80_000, 0.02),
    "o-qpsk-915": (2, 10, 6, 32_000, 0.01),
    "sun-fsk-863": (9, 33, 8, 160_000, 0.05),
    "sun-fsk-902": (9, 128, 8, 160_000, 0.05),
}


@pytest.mark.parametrize("standard", LAYERS)
def test_frames_name_their_channel_and_acknowledgments_follow_their_end(standard, tmp_path):
    page, last, before_bytes, byte_ns, slot_s = LAYERS[standard]
    settings = [
        f'netsim.phy.standard="{standard}"', f"netsim.slot_duration_s={slot_s}", "experiment.duration_s=600.0", "output.pcap=true",
    ]  # fmt: skip
    words = [word for setting in settings for word in ("--set", setting)]
    succeed([program("murmuration"), "run", CONFIG, "--out", tmp_path, *words], cwd=tmp_path)
    capture = only_directory(tmp_path) / "radio.pcap"
    fields = ("frame.time_epoch", "wpan-tap.asn", "wpan-tap.ch_num", "wpan-tap.ch_page", "wpan-tap.data_length",
              "wpan.frame_type", "wpan.ack_request", "wpan.seq_no", "wpan.src64", "wpan.dst64", "wpan.fcs_ok", "_ws.malformed")  # fmt: skip
    frames = dissect(capture, *fields)
    assert len(frames) > 200 and any(frame["wpan.frame_type"] == [BEACON] for frame in frames)
    ends_ns, n_answers = {}, 0
    for frame in frames:
        assert frame["wpan.fcs_ok"] == [GOOD] and not frame["_ws.malformed"]
        assert int(frame["wpan-tap.ch_page"][0]) == page and int(frame["wpan-tap.ch_num"][0]) <= last
        time_ns = int(frame["frame.time_epoch"][0].replace(".", ""))
        asn, channel = int(frame["wpan-tap.asn"][0]), int(frame["wpan-tap.ch_num"][0])
        air_ns = (before_bytes + int(frame["wpan-tap.data_length"][0])) * byte_ns
        begins_ns = time_ns - asn * round(slot_s * 1e9)
        if frame["wpan.frame_type"] != [ACK]:
            assert abs(begins_ns - TX_OFFSET_NS) < 1_100_000, "within the guard time"
            if frame["wpan.ack_request"] == ["1"]:
                ends_ns[asn, channel, *frame["wpan.seq_no"], *frame["wpan.src64"]] = time_ns + air_ns
        else:
            n_answers += 1
            assert time_ns - ends_ns[asn, channel, *frame["wpan.seq_no"], *frame["wpan.dst64"]] == TX_ACK_DELAY_NS
        assert begins_ns + air_ns < round(slot_s * 1e9)
    assert n_answers > 50
