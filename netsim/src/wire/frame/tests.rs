use super::*;
use crate::wire::arbitrary;
use crate::wire::datagram::{Datagram, Upper};
use crate::wire::rpl::{DisRepr, RplMessage};
use crate::wire::security::{FrameSecurity, Keys};
use crate::wire::sixp::{AnswerContent, ReturnCode, SixpAnswer, SixpBody, SixpRepr};
use crate::wire::slots::SlotSet;
use physics::asn::Asn;
use proptest::prelude::*;
use proto::ids::MoteId;
use std::sync::Arc;

proptest! {
    #[test]
    fn what_was_secured_is_read_by_whoever_has_the_key_and_the_time(
        (plain, root) in arbitrary::frame(),
        k1 in any::<bool>(),
        asn in 0_u64..1 << 40,
        flip in any::<prop::sample::Index>(),
    ) {
        let security = if k1 { FrameSecurity::K1 } else { FrameSecurity::K2 };
        let frame = FrameRepr { security, ..plain.clone() };
        let bytes = frame.to_secured_vec(&KEYS, Asn(asn));
        prop_assert_eq!(bytes.len(), plain.buffer_len() + security.overhead());
        let (read, found) = unsecure(&bytes, &KEYS, Asn(asn), None).unwrap();
        prop_assert_eq!(found, security);
        prop_assert_eq!(FrameRepr::parse(&read, root), Ok(plain));
        let others = Keys { k1: KEYS.k2, k2: KEYS.k1 };
        prop_assert!(unsecure(&bytes, &others, Asn(asn), None).is_err());
        prop_assert!(unsecure(&bytes, &KEYS, Asn(asn ^ 1), None).is_err());
        let mut changed = bytes.clone();
        let end = changed.len() - 2;
        changed[flip.index(end)] ^= 1;
        let fcs = fcs(&changed[..end]).to_le_bytes();
        changed[end..].copy_from_slice(&fcs);
        // A frame whose security bit was flipped is one that is not secured.
        let unsecured = unsecure(&changed, &KEYS, Asn(asn), None);
        let found = unsecured.map(|(_, security)| security);
        prop_assert!(!matches!(found, Ok(FrameSecurity::K1 | FrameSecurity::K2)), "{:?}", found);
    }

    #[test]
    fn an_acknowledgment_is_read_with_the_address_of_its_sender(ack in arbitrary::ack(), asn in 0_u64..1 << 40) {
        let (own, security) = (Eui64::of_mote(MoteId(3)), FrameSecurity::K2);
        let bytes = AckRepr { security, ..ack }.to_secured_vec(&KEYS, own, Asn(asn));
        let (read, found) = unsecure(&bytes, &KEYS, Asn(asn), Some(own)).unwrap();
        prop_assert_eq!((AckRepr::parse(&read), found), (Ok(ack), security));
        prop_assert!(unsecure(&bytes, &KEYS, Asn(asn), Some(Eui64::of_mote(MoteId(4)))).is_err());
        prop_assert!(unsecure(&bytes, &KEYS, Asn(asn), None).is_err());
    }

    #[test]
    fn what_was_written_is_read((frame, root) in arbitrary::frame()) {
        let bytes = frame.to_vec();
        prop_assert_eq!(bytes.len(), frame.buffer_len());
        prop_assert_eq!(FrameRepr::parse(&bytes, root), Ok(frame));
    }

    #[test]
    fn acknowledgments_that_were_written_are_read(ack in arbitrary::ack()) {
        let bytes = ack.to_vec();
        prop_assert_eq!(bytes.len(), ack.buffer_len());
        prop_assert_eq!(AckRepr::parse(&bytes), Ok(ack));
    }

    #[test]
    fn a_bit_that_flipped_is_noticed((frame, root) in arbitrary::frame(), at in 0.0..1.0, bit in 0..8) {
        let mut bytes = frame.to_vec();
        let at = (bytes.len() as f64 * at) as usize;
        bytes[at] ^= 1_u8 << bit;
        prop_assert_eq!(FrameRepr::parse(&bytes, root).unwrap_err().what, "wrong frame check sequence");
    }

    #[test]
    fn any_bytes_with_a_right_fcs_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..125)) {
        let mut bytes = bytes;
        if let [_, high, _, low_pan, high_pan, ..] = bytes.as_mut_slice() {
            // Often enough of the right version and network.
            *high = *high & !0x31 | 0x20;
            (*low_pan, *high_pan) = (0xcd, 0xab);
        }
        bytes.extend_from_slice(&fcs(&bytes).to_le_bytes());
        let _ = FrameRepr::parse(&bytes, None);
        let _ = AckRepr::parse(&bytes);
    }
}

fn frame(destination: Option<Eui64>, content: Content) -> FrameRepr {
    let source = Eui64::of_mote(MoteId(1));
    FrameRepr {
        source,
        destination,
        sequence: 9,
        ack_request: false,
        pending: false,
        security: FrameSecurity::Unsecured,
        slots: None,
        blacklist: None,
        content,
    }
}

#[test]
fn ieee802154_7_2_10_the_example_of_a_frame_check_sequence() {
    assert_eq!(fcs(&[0x02, 0x00, 0x6a]).to_le_bytes(), [0xe4, 0x79]);
}

#[test]
fn rfc8180_a_1_the_information_elements_of_a_beacon() {
    let slotframe = BeaconSlotframe { handle: 0, slots: 101, links: vec![(0, 0, 0x0f)] };
    let beacon = BeaconRepr {
        asn: Asn(0x05_0403_0201),
        join_metric: 2,
        timeslot_id: 0,
        hopping_sequence_id: 0,
        slotframes: vec![slotframe],
    };
    let bytes = frame(None, Content::Beacon(beacon)).to_vec();
    let elements = [
        0x00, 0x3f, 0x1a, 0x88, 0x06, 0x1a, 1, 2, 3, 4, 5, 2, 0x01, 0x1c, 0x00, 0x0a, 0x1b, 0x01,
        0x00, 101, 0, 0x01, 0, 0, 0, 0, 0x0f, 0x01, 0xc8, 0x00,
    ];
    let header = 2 + 1 + 2 + 2 + 8;
    assert_eq!(bytes[header..bytes.len() - 2], elements);
}

#[test]
fn ieee802154_7_2_frame_control_and_addresses() {
    let unicast = FrameRepr {
        ack_request: true,
        ..frame(Some(Eui64::of_mote(MoteId(2))), Content::KeepAlive)
    };
    let expected = [0x21, 0xec, 9, 0xcd, 0xab, 2, 0, 0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 2];
    assert_eq!(unicast.to_vec()[..21], expected);
    assert_eq!(unicast.buffer_len(), 23);
    let broadcast = frame(None, Content::KeepAlive);
    let expected = [0x41, 0xe8, 9, 0xcd, 0xab, 0xff, 0xff, 1, 0, 0, 0, 0, 0, 0, 2];
    assert_eq!(broadcast.to_vec()[..15], expected);
    assert_eq!(broadcast.buffer_len(), 17);
}

#[test]
fn rfc8480_6_1_6p_goes_in_an_ietf_information_element() {
    let answer = SixpAnswer { code: ReturnCode::Success, content: AnswerContent::Nothing };
    let message = SixpRepr { version: 0, sfid: 0, seqnum: 1, body: SixpBody::Response(answer) };
    let bytes = frame(Some(Eui64::of_mote(MoteId(2))), Content::Sixp(message)).to_vec();
    // Group 5, five bytes: the subtype and an empty response.
    assert_eq!(bytes[1], 0xee);
    assert_eq!(bytes[21..30], [0x00, 0x3f, 0x05, 0xa8, 0xc9, 0x10, 0, 0, 1]);
}

#[test]
fn ieee802154_7_4_1_what_is_announced_of_slots_ends_before_the_payload() {
    let slots = SlotsRepr { n_slots: 8, taken: SlotSet::default(), first: 0, tags: vec![] };
    let slots = Some(Box::new(slots));
    // Header termination 1; group 2, six bytes.
    let announced = [0x00, 0x3f, 0x06, 0x90, 0x00, 0x00, 0x02, 7, 0, 0];
    let alone = FrameRepr { slots: slots.clone(), ..frame(None, Content::KeepAlive) }.to_vec();
    assert_eq!(alone[1], 0xea);
    assert_eq!(alone[15..alone.len() - 2], announced);
    let datagram = Datagram {
        packet: 0,
        source: Eui64::of_mote(MoteId(1)).link_local(),
        destination: Eui64::of_mote(MoteId(2)).link_local(),
        dscp: 0,
        hop_limit: 255,
        rpi: None,
        route: None,
        upper: Upper::Rpl(RplMessage::Dis(DisRepr {})),
    };
    let content = Content::Lowpan(LowpanRepr::Whole(Arc::new(datagram)));
    let without = frame(Some(Eui64::of_mote(MoteId(2))), content);
    let with = FrameRepr { slots, ..without.clone() }.to_vec();
    let without = without.to_vec();
    assert_eq!(with[21..31], announced);
    // Payload termination.
    assert_eq!(with[31..33], [0x00, 0xf8]);
    assert_eq!(with[33..with.len() - 2], without[21..without.len() - 2]);
}

#[test]
fn ieee802154_7_4_2_7_a_time_correction_has_twelve_bits() {
    let destination = Eui64::of_mote(MoteId(1));
    let security = FrameSecurity::Unsecured;
    let ack = AckRepr { destination, sequence: 9, time_correction_us: -2, security };
    let expected = [0x02, 0x2e, 9, 0xcd, 0xab, 1, 0, 0, 0, 0, 0, 0, 2, 0x02, 0x0f, 0xfe, 0x0f];
    assert_eq!(ack.to_vec()[..17], expected);
    assert_eq!(ack.buffer_len(), 19);
}

#[test]
fn a_frame_full_to_its_room_has_127_bytes() {
    for destination in [None, Some(Eui64::of_mote(MoteId(2)))] {
        for security in [FrameSecurity::Unsecured, FrameSecurity::K2] {
            let empty = FrameRepr { security, ..frame(destination, Content::KeepAlive) };
            let room = payload_room(destination, security);
            assert_eq!(empty.buffer_len() + room, MAX_PSDU);
        }
    }
}

#[test]
fn a_secured_frame_is_refused() {
    let security = FrameSecurity::K2;
    let bytes = FrameRepr { security, ..frame(None, Content::KeepAlive) }.to_vec();
    assert_eq!(FrameRepr::parse(&bytes, None).unwrap_err().what, "secured");
}

const KEYS: Keys = Keys { k1: *b"6TiSCH minimal15", k2: [7; 16] };

#[test]
fn ieee802154_9_4_the_security_header_follows_the_addresses() {
    let plain = frame(Some(Eui64::of_mote(MoteId(2))), Content::KeepAlive);
    let bytes =
        FrameRepr { security: FrameSecurity::K2, ..plain.clone() }.to_secured_vec(&KEYS, Asn(5));
    assert_eq!(bytes.len(), plain.buffer_len() + 6);
    assert_eq!(bytes[..2], [0x09, 0xec]);
    assert_eq!(bytes[2..21], plain.to_vec()[2..21]);
    assert_eq!(bytes[21..23], [0x6d, 2]);
    let destination = Eui64::of_mote(MoteId(1));
    let security = FrameSecurity::K2;
    let ack = AckRepr { destination, sequence: 9, time_correction_us: -2, security };
    let bytes = ack.to_secured_vec(&KEYS, Eui64::of_mote(MoteId(2)), Asn(5));
    assert_eq!(bytes.len(), 25);
    assert_eq!(bytes[13..19], [0x6d, 2, 0x02, 0x0f, 0xfe, 0x0f]);
}

#[test]
fn a_beacon_stays_legible_and_another_frame_does_not() {
    let slots = SlotsRepr { n_slots: 8, taken: SlotSet::default(), first: 0, tags: vec![1] };
    for (security, is_legible) in [(FrameSecurity::K1, true), (FrameSecurity::K2, false)] {
        let slots = Some(Box::new(slots.clone()));
        let frame = FrameRepr { security, slots, ..frame(None, Content::KeepAlive) };
        let (plain, secured) = (frame.to_vec(), frame.to_secured_vec(&KEYS, Asn(5)));
        // To the termination of the header elements.
        assert_eq!(plain[..19], secured[..19]);
        let end = plain.len() - 6;
        assert_eq!(plain[19..end] == secured[19..end], is_legible, "{security:?}");
    }
}

#[test]
fn ieee802154_7_4_2_a_blacklist_is_a_vendor_specific_header_element() {
    let destination = Some(Eui64::of_mote(MoteId(2)));
    let of = |content| FrameRepr { blacklist: Some(0x8001), ..frame(destination, content) };
    // Element 0 of five octets: the vendor, then channels 11 and 26.
    let element = [0x05, 0x00, 0x00, 0x00, 0x02, 0x01, 0x80];
    let alone = of(Content::KeepAlive);
    assert_eq!(alone.to_vec()[21..28], element);
    assert_eq!(alone.buffer_len(), frame(destination, Content::KeepAlive).buffer_len() + 7);
    // A payload without payload elements follows header termination 2.
    let dis = Upper::Rpl(RplMessage::Dis(DisRepr {}));
    let datagram = Datagram {
        packet: 0,
        source: Eui64::of_mote(MoteId(1)).link_local(),
        destination: Eui64::of_mote(MoteId(2)).link_local(),
        dscp: 0,
        hop_limit: 64,
        rpi: None,
        route: None,
        upper: dis,
    };
    let content = Content::Lowpan(LowpanRepr::Whole(Arc::new(datagram)));
    let without = frame(destination, content.clone());
    let with = of(content);
    assert_eq!(with.to_vec()[21..28], element);
    assert_eq!(with.to_vec()[28..30], [0x80, 0x3f]);
    assert_eq!(with.buffer_len(), without.buffer_len() + 9);
    assert_eq!(FrameRepr::parse(&with.to_vec(), None), Ok(with));
    // Another vendor's element is passed over.
    let mut bytes = alone.to_vec();
    bytes[23] = 1;
    let end = bytes.len() - 2;
    let fcs = fcs(&bytes[..end]).to_le_bytes();
    bytes[end..].copy_from_slice(&fcs);
    assert_eq!(FrameRepr::parse(&bytes, None).unwrap().blacklist, None);
}
