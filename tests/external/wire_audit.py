"""An audit on the wire: frames of every scheduling function and mode, one by one, against IEEE Std 802.15.4-2015 and 6P."""

from bisect import bisect_right
from collections import Counter, defaultdict

from audited_frames import TX_ACK_DELAY_NS, expect_none, faults_of
from audited_networks import HOPPING_SEQUENCE, MOTES
from dissection import ACK, BEACON, DATA, GOOD, SLOT_NS

ROOT = 0
# Severities of Wireshark's expert information: chats and notes are less (retransmitted CoAP is a note).
WARNING = 0x600000


def test_every_network_formed(audited):
    assert audited.formed_ns is not None, f"{audited.path}: see run.log and summary.json there"


# What every frame has.


# Acknowledgments do not name their sender, from whose address the nonce is made: Wireshark verifies none that is secured.
NAMELESS = "No extended source address - can't decrypt"
# To a pledge, whose token is empty: Wireshark finds no request for the response.
WITHOUT_TOKEN = "Partial IV not found - can't decrypt"
POST, CHANGED = ["2"], ["68"]


def test_every_frame_dissects_without_malformation_or_warning(audited):
    def is_right(frame):
        if frame.is_ack and frame.is_secured and frame["_ws.expert.message"] == [NAMELESS]:
            return not frame["_ws.malformed"]
        if audited.network.secured and frame["coap.code"] == CHANGED and not frame["coap.token"]:
            return not frame["_ws.malformed"] and WITHOUT_TOKEN in frame["_ws.expert.message"]
        return not frame["_ws.malformed"] and all(int(level) < WARNING for level in frame["_ws.expert.severity"])

    captured = {id(frame) for frame in audited.frames}
    frames = [*audited.frames, *(frame for frame in audited.datagrams if id(frame) not in captured)]
    faults_of(audited, frames, is_right, lambda frame: f"{frame['_ws.malformed']}, {frame['_ws.expert.message']}", 1000)


def test_every_checksum_is_right(audited):
    faults_of(audited, audited.frames, lambda frame: frame["wpan.fcs_ok"] == [GOOD], lambda frame: "FCS", 1000)
    for status in ("udp.checksum.status", "icmpv6.checksum.status"):
        summed = [frame for frame in audited.datagrams if frame[status]]
        faults_of(audited, summed, lambda frame, status=status: frame[status] == [GOOD], lambda frame, status=status: status, 50)


def test_frames_have_no_more_than_127_bytes(audited):
    # IEEE Std 802.15.4-2015, 11.3: aMaxPhyPacketSize.
    faults_of(audited, audited.frames, lambda frame: frame.psdu_bytes <= 127, lambda frame: f"{frame.psdu_bytes} bytes")


def test_frames_are_of_version_2_and_numbered(audited):
    # IEEE Std 802.15.4-2015, 7.2.1.
    def is_right(frame):
        return (frame["wpan.version"], frame["wpan.seqno_suppression"]) == (["2"], ["0"])

    faults_of(audited, audited.frames, is_right, lambda frame: f"{frame['wpan.version']} {frame['wpan.seqno_suppression']}")


# Security.


def test_only_frames_of_secured_networks_are_secured(audited):
    # docs/network.md: link-layer security is off by default.
    if not audited.network.secured:
        faults_of(audited, audited.frames, lambda frame: not frame.is_secured, lambda frame: "secured")
        return
    n = Counter((frame.kind, frame.is_secured) for frame in audited.frames)
    assert n[BEACON, True] >= 200 and n[BEACON, False] == 0, n
    # Join messages on the link, and their acknowledgments: a request and a response for each mote but the root.
    assert n[DATA, True] >= 200 and n[DATA, False] >= 2 * (MOTES - 1), n
    assert n[ACK, True] >= 200 and n[ACK, False] >= 2 * (MOTES - 1), n


def test_security_headers_are_those_of_rfc_8180(audited):
    # RFC 8180, section 4.6: K1 authenticates beacons (level 1), K2 encrypts and authenticates all else (level 5). IEEE Std
    # 802.15.4-2015, 9.4: key identifier mode 1, the frame counter suppressed, the ASN in the nonce.
    def is_right(frame):
        level, index = ("0x01", "0x01") if frame.is_beacon else ("0x05", "0x02")
        return (
            frame["wpan.aux_sec.sec_level"] == [level]
            and frame["wpan.aux_sec.key_index"] == [index]
            and frame["wpan.aux_sec.key_id_mode"] == ["0x01"]
            and frame["wpan.aux_sec.frame_counter_suppression"] == ["1"]
            and frame["wpan.aux_sec.asn_in_nonce"] == ["1"]
            and len(frame["wpan.mic"]) == 1
        )

    faults_of(audited, secured(audited), is_right, lambda frame: f"level {frame['wpan.aux_sec.sec_level']}", least(audited))


def test_message_integrity_codes_are_right(audited):
    # OpenSSL's AES, keys, sender and slot: all secured frames, acknowledgments among them.
    faults_of(audited, secured(audited), lambda frame: frame.mic_is_right, lambda frame: "MIC", least(audited))


def test_unsecured_frames_of_secured_networks_are_those_of_pledges_and_their_proxies(audited):
    # RFC 9031, section 5. A pledge becomes a mote with keys once: what it sends is not secured before, and secured after.
    if not audited.network.secured:
        return
    first_secured = {}
    for frame in audited.frames:
        if frame.is_data and frame.is_secured:
            first_secured.setdefault(frame.source, frame.time_ns)
    unsecured = [frame for frame in audited.frames if frame.is_data and not frame.is_secured]

    def is_right(frame):
        return frame["udp.dstport"] == ["5683"] or frame.time_ns < first_secured[frame.source]

    faults_of(audited, unsecured, is_right, lambda frame: f"{frame['udp.dstport']}", 2 * (MOTES - 1))
    answered = [(ack, frame) for ack, frame in audited.answered if frame]
    unlike = (audited.says(ack, "not secured as its frame") for ack, frame in answered if ack.is_secured != frame.is_secured)
    expect_none(unlike, len(answered), 200)


def test_join_messages_of_secured_networks_are_protected_by_oscore(audited):
    # RFC 9031, section 8.1; RFC 8613: Wireshark decrypts what it finds the context and the request of.
    messages = [frame for frame in audited.datagrams if frame["coap.code"] and (frame["coap.code"] == POST or frame["coap.token"])]

    def is_right(frame):
        path = ["j"] if frame["coap.code"] == POST else []
        protected = (frame["coap.code"], path, 1)
        expected = protected if audited.network.secured else ([], [], 0)
        return (frame["oscore.code"], frame["oscore.opt.uri_path"], len(frame["oscore.tag"])) == expected

    faults_of(audited, messages, is_right, lambda frame: f"{frame['coap.code']}: {frame['oscore.code']}", 2 * (MOTES - 1))


def secured(audited):
    return [frame for frame in audited.frames if frame.is_secured]


def least(audited):
    """How many frames an audit of secured frames must find."""
    return 1000 if audited.network.secured else 0


def test_addresses_and_pan_identifiers_are_compressed_as_table_7_2_says(audited):
    # Destination mode, source mode, PAN ID compression: the destination's PAN identifier is there, the source's is not.
    short_to_long, long_to_long, long_alone = ("0x0002", "0x0003", "1"), ("0x0003", "0x0003", "0"), ("0x0003", "0x0000", "0")

    def is_right(frame):
        modes = tuple(frame[f][0] for f in ("wpan.dst_addr_mode", "wpan.src_addr_mode", "wpan.pan_id_compression"))
        expected = long_alone if frame.is_ack else short_to_long if frame.destination is None else long_to_long
        return modes == expected and frame["wpan.dst_pan"] == ["0xabcd"] and not frame["wpan.src_pan"]

    def what(frame):
        return f"{frame['wpan.dst_addr_mode']} {frame['wpan.src_addr_mode']} {frame['wpan.pan_id_compression']}"

    faults_of(audited, audited.frames, is_right, what)


def test_a_frame_to_everyone_asks_for_no_acknowledgment_and_one_to_a_mote_does(audited):
    sent = [frame for frame in audited.frames if not frame.is_ack]
    faults_of(
        audited, sent, lambda frame: frame.ack_request == (frame.destination is not None), lambda frame: "acknowledgment request"
    )


def test_sequence_numbers_of_data_frames_advance_by_one(audited):
    # IEEE Std 802.15.4-2015, 7.2.2: macDsn goes into a new frame, then is incremented; a repetition keeps its number.
    faults, checked, sent = [], 0, {}
    for frame in audited.frames:
        if not frame.is_data:
            continue
        before = sent.setdefault(frame.source, [frame.sequence])
        # Frames that wait for another neighbour's cell are repeated among newer ones.
        if frame.sequence not in before[-64:]:
            checked += 1
            if frame.sequence != (before[-1] + 1) % 256 and audited.network.stands:
                faults.append(audited.says(frame, f"{frame.sequence} after {before[-1]}"))
            before.append(frame.sequence)
    expect_none(faults, checked, 300)


def test_a_mote_sends_one_frame_or_one_acknowledgment_in_a_slot(audited):
    senders = [(frame, frame.source) for frame in sent_on_time(audited)]
    senders += [(ack, frame.destination) for ack, frame in audited.answered if frame]
    n_sent = Counter((frame.asn, sender) for frame, sender in senders)
    several = [(frame, sender) for frame, sender in senders if n_sent[frame.asn, sender] > 1]
    expect_none((audited.says(frame, f"not the only one of mote {sender}") for frame, sender in several), len(senders), 500)


def test_frames_are_sent_six_times_at_most(audited):
    # IEEE Std 802.15.4-2015, 8.4.2: macMaxFrameRetries, here 5.
    attempts, faults = {}, []
    for frame in audited.frames:
        if not frame.ack_request:
            continue
        # Numbers come again after 256 frames, and then with other octets.
        octets = frame.record[16 + int.from_bytes(frame.record[18:20], "little") :]
        n, last_ns = attempts.get(octets, (0, frame.time_ns))
        n = n + 1 if frame.time_ns < last_ns + 20_000_000_000 else 1
        attempts[octets] = n, frame.time_ns
        if n > 6:
            faults.append(audited.says(frame, f"sent for the {n}th time"))
    expect_none(faults, len(attempts), 200)


# Enhanced beacons.


def test_beacons_are_numbered_by_one_from_beacon_to_beacon(audited):
    # IEEE Std 802.15.4-2015, 6.3.1: macEbsn goes into an enhanced beacon, then is incremented.
    faults, checked, last = [], 0, {}
    for frame in audited.beacons:
        before = last.get(frame.source)
        if before is not None:
            checked += 1
            # A mote that was switched off begins anew.
            follows = frame.sequence == (before + 1) % 256 if audited.network.stands else frame.sequence != before
            if not follows:
                faults.append(audited.says(frame, f"mote {frame.source}'s beacon {frame.sequence} follows {before}"))
        last[frame.source] = frame.sequence
    expect_none(faults, checked, 200)


def test_beacons_tell_time_metric_timeslot_and_hopping_sequence(audited):
    # RFC 8180, section 4.5 and appendix A.1: the TSCH Synchronization, Slotframe and Link, Timeslot and Channel Hopping IEs.
    # The template of timeslots is the standard's (0), the sequence of channels another one (1).
    def is_right(frame):
        nested = ["0x001a", "0x001c", "0x001b", "0x0009"]
        return (
            frame.number_in("wpan.tsch.asn") == frame.asn
            and frame["wpan.header_ie.id"] == ["0x007e"]
            and frame["wpan.payload_ie.id"][0] == "0x0001"
            and frame["wpan.mlme.ie.id"] == nested
            and frame["wpan.tsch.timeslot.id"] == ["0x00"]
            and frame["wpan.tsch.hopping_sequence_id"] == ["0x01"]
            and all(options == "0x0f" for options in frame["wpan.tsch.link_options"])
            and (frame["wpan.tsch.join_metric"] == ["0"]) == (frame.source == ROOT)
        )

    def what(frame):
        return f"ASN {frame['wpan.tsch.asn']} for {frame.asn}, elements {frame['wpan.mlme.ie.id']}, metric {frame['wpan.tsch.join_metric']}"

    faults_of(audited, audited.beacons, is_right, what, 200)


def test_beacons_follow_the_hopping_sequence(audited):
    # IEEE Std 802.15.4-2015, 6.2.6.3. All beacons have channel offset 0, but for those in Orchestra's common cell.
    offset = 1 if "link-based" in audited.network.sf else 0

    def is_right(frame):
        return frame.channel == HOPPING_SEQUENCE[(frame.asn + offset) % len(HOPPING_SEQUENCE)]

    faults_of(audited, audited.beacons, is_right, lambda frame: f"channel {frame.channel}", 200)



def test_blacklists_are_vendor_specific_header_elements_of_unicast_frames(audited):
    # IEEE Std 802.15.4-2015, 7.4.2.2. docs/network.md: three octets for the vendor, then a bit for each channel that the link skips.
    skips = "blacklist" in audited.network.mac
    frames = [frame for frame in audited.frames if frame["wpan.header_ie.vendor_specific.content"]]
    assert skips or not frames, f"{len(frames)} frames"
    if not skips:
        return
    channels = sum(1 << channel - 11 for channel in HOPPING_SEQUENCE)

    def blacklist(frame):
        return int.from_bytes(bytes.fromhex(frame["wpan.header_ie.vendor_specific.content"][0].replace(":", "")), "little")

    def is_right(frame):
        n = blacklist(frame).bit_count()
        is_for_one = frame.is_data and frame.destination is not None
        return is_for_one and frame["wpan.header_ie.id"][0] == "0x0000" and n in (0, 2) and blacklist(frame) & ~channels == 0

    faults_of(audited, frames, is_right, lambda frame: f"{frame['wpan.header_ie.id']}, {blacklist(frame):#06x}", 50)
    # Lists are offered until one is acknowledged, and are not in every frame.
    assert len(frames) < len(audited.acks), f"{len(frames)} of {len(audited.acks)}"


# Time.


def sent_on_time(audited):
    """Beacons and data frames: those that begin macTsTxOffset after their sender's slot does."""
    return [frame for frame in audited.frames if not frame.is_ack]


def test_frames_are_in_the_order_of_time(audited):
    pairs = zip(audited.frames, audited.frames[1:])
    faults = (
        audited.says(after, f"{after.time_ns} ns after {before.time_ns} ns") for before, after in pairs if after.time_ns < before.time_ns
    )
    expect_none(faults, len(audited.frames))


def test_frames_begin_when_their_senders_clocks_say(audited):
    # IEEE Std 802.15.4-2015, 8.4.3.3.1: macTsTxOffset after the slot begins by the sender's clock. The root's clock is right.
    frames = sent_on_time(audited)
    if "max_drift_ppm = 0.0" in audited.network.mac:
        on_grid = frames
    else:
        on_grid = [frame for frame in frames if frame.source == ROOT]
        off = Counter(frame.source for frame in frames if frame.source != ROOT and frame.deviation_ns != 0)
        assert set(off) == set(range(1, MOTES)), f"{audited.path}: only the clocks of {sorted(off)} are ever off"
    faults_of(audited, on_grid, lambda frame: frame.deviation_ns == 0, lambda frame: f"{frame.deviation_ns} ns late", 100)
    faults_of(audited, frames, lambda frame: abs(frame.deviation_ns) < SLOT_NS // 4, lambda frame: f"{frame.deviation_ns} ns late")


class Clocks:
    """How far each mote's clock was off, by what it sent."""

    # Rates differ from true time by so much at most; a correction is right to within a tick of 32,768 Hz.
    DRIFT_PPM = 30
    TICK_NS = 30_518

    def __init__(self, audited):
        self.seen = defaultdict(list)
        for frame in sent_on_time(audited):
            self.seen[frame.source].append((frame.time_ns, frame.deviation_ns))

    def bounds(self, mote, time_ns, within_ns=2_000_000_000):
        """Between what (ns) a mote's deviation was at a time; None: it sent nothing shortly before or shortly after."""
        if mote == ROOT:
            return 0, 0
        seen = self.seen[mote]
        place = bisect_right(seen, time_ns, key=lambda one: one[0])
        if place in (0, len(seen)):
            return None
        before, after = seen[place - 1], seen[place]
        if before[0] < time_ns - within_ns or time_ns + within_ns < after[0]:
            return None
        margin_ns = (after[0] - before[0]) * self.DRIFT_PPM // 1_000_000 + self.TICK_NS
        deviations = before[1], after[1]
        return min(deviations) - margin_ns, max(deviations) + margin_ns


def test_time_corrections_say_by_how_much_the_frame_was_off(audited):
    # IEEE Std 802.15.4-2015, 6.5.4.2: the receiver's expectation less when the frame came, in microseconds.
    clocks = Clocks(audited)
    faults, checked = defaultdict(list), Counter()
    for ack, frame in audited.answered:
        bounds = clocks.bounds(frame.destination, frame.time_ns) if frame else None
        if bounds is None:
            continue
        receiver = "root" if frame.destination == ROOT else "mote"
        checked[receiver] += 1
        correction_us = ack.number_in("wpan.header_ie.time_correction.value")
        least, most = ((bound - frame.deviation_ns) / 1000 for bound in bounds)
        if not least - 1 <= correction_us <= most + 1:
            what = f"mote {frame.destination} corrects {frame.source} by {correction_us} us, {least:.0f} to {most:.0f} were right"
            faults[receiver].append(audited.says(ack, what))
    expect_none(faults["root"], checked["root"], 50)
    # A mote between two of its frames may have kept the time of a neighbour that was off by more than either shows.
    if len(faults["mote"]) > checked["mote"] // 50:
        expect_none(faults["mote"], checked["mote"])


# Acknowledgments.


def test_every_acknowledgment_answers_one_frame_of_its_slot_and_channel(audited):
    faults = [audited.says(ack, f"answers nothing: {ack.asn}, {ack.sequence}") for ack, frame in audited.answered if frame is None]
    expect_none(faults, len(audited.acks), 200)
    answered = Counter(frame.number for _, frame in audited.answered)
    assert max(answered.values()) == 1, answered.most_common(1)


def test_acknowledgments_begin_one_millisecond_after_their_frames_end(audited):
    # IEEE Std 802.15.4-2015, 8.4.3.3.1: macTsTxAckDelay.
    faults, checked = [], 0
    for ack, frame in audited.answered:
        if frame is None:
            continue
        checked += 1
        late_ns = ack.time_ns - (frame.time_ns + frame.air_ns + TX_ACK_DELAY_NS)
        if late_ns != 0:
            faults.append(audited.says(ack, f"{late_ns} ns late after frame {frame.number}"))
    expect_none(faults, checked, 200)


def test_acknowledgments_end_within_their_slots(audited):
    # A slot of 10 ms holds 2.12 ms, the longest frame, 1 ms and the longest acknowledgment, at any clock within the guard time.
    def is_right(ack):
        return ack.time_ns + ack.air_ns < (ack.asn + 1) * SLOT_NS

    faults_of(audited, audited.acks, is_right, lambda ack: "beyond its slot", 200)


# 6P.


def sixp(audited):
    return [frame for frame in audited.frames if frame["wpan.6top_type"]]


def test_6p_messages_are_msf_s_of_version_0_and_their_cells_lie_in_the_slotframe(audited):
    # RFC 8480, section 3.2.2; RFC 9033, sections 2 and 8: slot 0 is the minimal cell's.
    def is_right(frame):
        slots = [int(slot, 0) for slot in frame["wpan.6top_cell_slot_offset"]]
        channels = [int(channel, 0) for channel in frame["wpan.6top_channel_offset"]]
        return (
            frame.number_in("wpan.6top_version") == 0
            and frame.number_in("wpan.6top_sfid") == 0
            and frame.destination is not None
            and all(0 < slot < 101 for slot in slots)
            and all(channel < 16 for channel in channels)
            and len(set(slots)) == len(slots)
        )

    # LLSF and EMSF negotiate with MSF's messages.
    negotiates = any(f'kind = "{kind}"' in audited.network.sf for kind in ("msf", "llsf", "emsf"))
    least = 20 if negotiates else 0
    faults_of(audited, sixp(audited), is_right, lambda frame: f"{frame['wpan.6top_cell_slot_offset']}", least)
    assert negotiates or not sixp(audited)


def test_6p_responses_have_the_number_of_their_requests(audited):
    # RFC 8480, section 3.4.3.
    faults, checked, asked = [], 0, {}
    for frame in sixp(audited):
        kind = frame.number_in("wpan.6top_type")
        if kind == 0:
            numbers = asked.setdefault((frame.source, frame.destination), [])
            numbers += {frame.number_in("wpan.6top_seqnum")}.difference(numbers[-1:])
        elif kind == 1:
            checked += 1
            numbers = asked.get((frame.destination, frame.source), [])
            if frame.number_in("wpan.6top_seqnum") not in numbers[-3:]:
                faults.append(audited.says(frame, f"number {frame['wpan.6top_seqnum']}, asked {numbers[-3:]}"))
    expect_none(faults, checked, 10 if sixp(audited) else 0)


def test_relocate_and_clear_are_among_what_was_captured(captures):
    asked = Counter(
        frame.number_in("wpan.6top_code")
        for name in ("msf-relocating", "msf-restless")
        for frame in sixp(captures[name])
        if frame.number_in("wpan.6top_type") == 0
    )
    add, relocate, clear = 1, 3, 7
    assert all(asked[command] >= 2 for command in (add, relocate, clear)), asked
