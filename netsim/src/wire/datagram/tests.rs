use super::*;
use crate::wire::arbitrary;
use crate::wire::rpl::DisRepr;
use crate::wire::{Eui64, address};
use proptest::prelude::*;
use proto::ids::MoteId;

proptest! {
    #[test]
    fn what_was_written_is_read((datagram, source, destination) in arbitrary::datagram(100)) {
        let root = datagram.route.as_ref().map(|route| route.root);
        let bytes = datagram.to_vec(source, destination);
        prop_assert_eq!(bytes.len(), datagram.compressed_len(source, destination));
        prop_assert_eq!(Datagram::parse(&bytes, source, destination, root), Ok(datagram));
    }

    #[test]
    fn no_hop_takes_more_than_the_worst((datagram, source, destination) in arbitrary::datagram(10)) {
        let worst = datagram.headers_len(Hop::Worst) + datagram.upper.tail_len();
        prop_assert!(datagram.compressed_len(source, destination) <= worst);
    }

    #[test]
    fn a_route_never_grows_by_a_hop_taken_off((datagram, ..) in arbitrary::datagram(10)) {
        let mut datagram = datagram;
        let mut before = datagram.headers_len(Hop::Worst);
        while datagram.route.as_ref().is_some_and(|route| route.hops.len() > 1) {
            datagram.route.as_mut().unwrap().hops.remove(0);
            let after = datagram.headers_len(Hop::Worst);
            prop_assert!(after <= before);
            before = after;
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..80), page in any::<bool>()) {
        let mut bytes = bytes;
        if let [first, second, ..] = bytes.as_mut_slice() {
            let iphc = if page { second } else { first };
            *iphc = *iphc & 0x07 | 0x78;
            if page {
                bytes[0] = 0xf1;
            }
        }
        let hop = Eui64::of_mote(MoteId(1));
        let _ = Datagram::parse(&bytes, hop, None, None);
    }
}

fn mote(n: u32) -> Ipv6Addr {
    Eui64::of_mote(MoteId(n)).global()
}

fn udp(source: u32, destination: u32) -> Datagram {
    Datagram {
        packet: 0,
        source: mote(source),
        destination: mote(destination),
        dscp: 0,
        hop_limit: 64,
        rpi: None,
        route: None,
        upper: Upper::Udp(UdpRepr {
            source_port: 61_617,
            destination_port: 61_618,
            payload: Bytes::from_static(&[1, 2, 3]),
        }),
    }
}

const UP: RpiRepr = RpiRepr {
    down: false,
    rank_error: false,
    forwarding_error: false,
    instance: 0,
    sender_rank: 768,
};

fn bytes(datagram: &Datagram, from: u32, to: u32) -> Vec<u8> {
    datagram.to_vec(Eui64::of_mote(MoteId(from)), Some(Eui64::of_mote(MoteId(to))))
}

#[test]
fn rfc6282_3_1_between_neighbours_nothing_but_udp_is_left() {
    // TF and HLIM in two bits each, both addresses by context 0 and from the frame; ports in a byte.
    let bytes = bytes(&udp(5, 0), 5, 0);
    assert_eq!(bytes[..4], [0x7e, 0x77, 0xf3, 0x12]);
    assert_eq!(bytes[6..], [1, 2, 3]);
}

#[test]
fn rfc6282_3_1_what_the_frame_does_not_say_is_in_line() {
    let datagram = Datagram { hop_limit: 63, ..udp(5, 0) };
    let bytes = bytes(&datagram, 4, 3);
    assert_eq!(bytes[..3], [0x7c, 0x55, 63]);
    assert_eq!(bytes[3..11], [0, 0, 0, 0, 0, 0, 0, 5]);
    assert_eq!(bytes[11..19], [0, 0, 0, 0, 0, 1, 0, 0]);
    assert_eq!(bytes[19], 0xf3);
}

#[test]
fn rfc6282_3_1_1_a_code_point_takes_a_byte_and_best_effort_none() {
    let plain = bytes(&udp(5, 0), 5, 0);
    let marked = bytes(&Datagram { dscp: 38, ..udp(5, 0) }, 5, 0);
    assert_eq!(marked[..3], [0x76, 0x77, 0b10_0110]);
    assert_eq!(marked[3..], plain[2..]);
}

#[test]
fn rfc6282_4_3_3_ports_take_a_byte_to_four() {
    let length = |source_port, destination_port| {
        let payload = Bytes::new();
        let upper = Upper::Udp(UdpRepr { source_port, destination_port, payload });
        bytes(&Datagram { upper, ..udp(5, 0) }, 5, 0).len() - 2 - 2
    };
    assert_eq!(length(0xf0b0, 0xf0bf), 2);
    assert_eq!(length(5683, 0xf0bf), 4);
    assert_eq!(length(0xf0c0, 5683), 4);
    assert_eq!(length(5683, 5683), 5);
}

#[test]
fn rfc6282_3_1_1_multicast_to_the_link_takes_a_byte() {
    let datagram = Datagram {
        source: Eui64::of_mote(MoteId(5)).link_local(),
        destination: address::ALL_RPL_NODES,
        hop_limit: 255,
        upper: Upper::Rpl(RplMessage::Dis(DisRepr {})),
        ..udp(5, 0)
    };
    let bytes = datagram.to_vec(Eui64::of_mote(MoteId(5)), None);
    assert_eq!(bytes[..4], [0x7b, 0x3b, 58, 0x1a]);
    assert_eq!(bytes[4..6], [155, 0]);
    assert_eq!(bytes.len(), 4 + 4 + 2);
}

#[test]
fn rfc8138_6_rpi_without_instance_and_with_a_short_rank_takes_three_bytes() {
    let datagram = Datagram { rpi: Some(UP), ..udp(5, 0) };
    assert_eq!(bytes(&datagram, 5, 0)[..5], [0xf1, 0x83, 5, 3, 0x7e]);
    let rpi = RpiRepr { down: true, instance: 7, sender_rank: 769, ..UP };
    let datagram = Datagram { rpi: Some(rpi), ..datagram };
    assert_eq!(bytes(&datagram, 5, 0)[..7], [0xf1, 0x90, 5, 7, 3, 1, 0x7e]);
}

#[test]
fn rfc8138_5_4_each_hop_is_relative_to_the_one_before_it() {
    let hops = vec![mote(1), mote(2), mote(3)];
    let route = Some(SourceRoute { root: mote(0), hops, tunnel_hop_limit: None });
    let datagram = Datagram { rpi: Some(UP), route, ..udp(0, 3) };
    let bytes = bytes(&datagram, 0, 1);
    // The root is fd00::1:0: the first hop differs in three bytes, for which there is room in four; the others in one.
    assert_eq!(bytes[..12], [0xf1, 0x80, 2, 0, 0, 0, 1, 0x81, 0, 2, 3, 0x83]);
    assert!(!datagram.is_encapsulated());
}

#[test]
fn rfc8138_5_1_a_header_holds_at_most_32_addresses() {
    let hops: Vec<_> = (1..=40).map(mote).collect();
    let route = Some(SourceRoute { root: mote(100), hops, tunnel_hop_limit: None });
    let datagram = Datagram { route, ..udp(100, 40) };
    let bytes = bytes(&datagram, 100, 1);
    assert_eq!(bytes[..3], [0xf1, 0x80 | 31, 0]);
    assert_eq!(bytes[35..37], [0x80 | 7, 0]);
    assert_eq!(bytes[45], 0x7e);
}

#[test]
fn rfc9008_8_3_1_the_root_encapsulates_what_is_not_its_own() {
    let (root, hops) = (mote(0), vec![mote(2)]);
    let route = Some(SourceRoute { root, hops, tunnel_hop_limit: Some(60) });
    let datagram = Datagram { hop_limit: 62, rpi: Some(UP), route, ..udp(1, 2) };
    assert!(datagram.is_encapsulated());
    let bytes = bytes(&datagram, 0, 2);
    // Source route, packet information, IP in IP without the root's address, then the datagram as the root got it.
    assert_eq!(bytes[7..13], [0x83, 5, 3, 0xa1, 6, 60]);
    assert_eq!(bytes[13..16], [0x7c, 0x55, 62]);
    assert_eq!(datagram.uncompressed_len(), 40 + 8 + 40 + 8 + 3);
    let (hop, next) = (Eui64::of_mote(MoteId(0)), Some(Eui64::of_mote(MoteId(2))));
    Datagram::parse(&bytes, hop, next, None).unwrap_err();
    assert_eq!(Datagram::parse(&bytes, hop, next, Some(mote(0))), Ok(datagram));
}

#[test]
fn rfc6554_3_the_routing_header_lacks_the_next_hop_and_the_common_prefix() {
    let route =
        |hops: Vec<Ipv6Addr>| Some(SourceRoute { root: mote(0), hops, tunnel_hop_limit: None });
    let length = |route| Datagram { route, ..udp(0, 3) }.uncompressed_len() - (40 + 8 + 3);
    assert_eq!(length(route(vec![mote(3)])), 0);
    assert_eq!(length(route(vec![mote(2), mote(3)])), 8 + 8);
    assert_eq!(length(route((1..=9).map(mote).collect())), 8 + 8);
    assert_eq!(length(route((1..=10).map(mote).collect())), 8 + 16);
}

#[test]
fn a_wrong_checksum_is_noticed() {
    let mut bytes = bytes(&udp(5, 0), 5, 0);
    *bytes.last_mut().unwrap() ^= 1;
    let result =
        Datagram::parse(&bytes, Eui64::of_mote(MoteId(5)), Some(Eui64::of_mote(MoteId(0))), None);
    assert_eq!(result.unwrap_err().what, "wrong checksum");
}

/// What the standing networks of `murmuration bench` send.
#[test]
fn a_payload_of_72_bytes_makes_a_datagram_of_90_to_a_root_some_hops_away() {
    let [source, relay, root] = [5, 3, 0].map(MoteId).map(Eui64::of_mote);
    let payload = Bytes::from(vec![0; 72]);
    let upper = Upper::Udp(UdpRepr { source_port: 61_616, destination_port: 61_616, payload });
    let datagram = Datagram { rpi: Some(UP), upper, ..udp(5, 0) };
    let hops = [(source, relay), (relay, root), (source, root)];
    let lengths = hops.map(|(from, to)| datagram.compressed_len(from, Some(to)));
    assert_eq!(lengths, [90, 90, 82]);
}
