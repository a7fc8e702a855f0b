use super::*;
use crate::wire::Eui64;
use crate::wire::arbitrary;
use crate::wire::datagram::{SourceRoute, UdpRepr, Upper};
use proptest::prelude::*;
use proto::ids::MoteId;

/// Fragments as their frames carry them.
fn parts(fragments: &[Fragment]) -> Vec<LowpanRepr> {
    let first = fragments.iter().take(1).cloned().map(LowpanRepr::First);
    first.chain(fragments.iter().skip(1).cloned().map(LowpanRepr::Next)).collect()
}

proptest! {
    #[test]
    fn rfc4944_5_3_fragments_cover_the_datagram_fit_their_frames_and_make_it_again(
        (datagram, source, destination) in arbitrary::datagram(700),
        tag in any::<u16>(),
        room in 60_usize..110,
    ) {
        let datagram = Arc::new(datagram);
        let Some(fragments) = datagram.fragment(tag, room) else {
            return Ok(());
        };
        let mut end = 0;
        for fragment in &fragments {
            prop_assert_eq!(usize::from(fragment.offset), end);
            prop_assert_eq!(fragment.offset % 8, 0);
            prop_assert_eq!(usize::from(fragment.size), datagram.uncompressed_len());
            end += usize::from(fragment.covers);
        }
        prop_assert_eq!(end, datagram.uncompressed_len());
        let parts = parts(&fragments);
        let bytes: Vec<_> = parts.iter().map(|part| part.to_vec(source, destination)).collect();
        for (part, bytes) in parts.iter().zip(&bytes) {
            prop_assert!(bytes.len() <= room);
            prop_assert_eq!(part.buffer_len(source, destination), bytes.len());
            let (header, _) = FragmentHeader::parse(bytes).unwrap().unwrap();
            prop_assert_eq!(header.tag, tag);
        }
        let root = datagram.route.as_ref().map(|route| route.root);
        let reversed: Vec<_> = bytes.iter().rev().map(Vec::as_slice).collect();
        let again = reassemble(&reversed, source, destination, root);
        prop_assert_eq!(again, Ok(Datagram::clone(&datagram)));
        if bytes.len() > 1 {
            let missing: Vec<_> = bytes[..bytes.len() - 1].iter().map(Vec::as_slice).collect();
            prop_assert!(reassemble(&missing, source, destination, root).is_err());
        }
    }
}

fn udp(payload: usize) -> Datagram {
    Datagram {
        packet: 0,
        source: Eui64::of_mote(MoteId(0)).global(),
        destination: Eui64::of_mote(MoteId(3)).global(),
        dscp: 0,
        hop_limit: 64,
        rpi: None,
        route: None,
        upper: Upper::Udp(UdpRepr {
            source_port: 61_617,
            destination_port: 61_617,
            payload: vec![7; payload].into(),
        }),
    }
}

#[test]
fn rfc4944_5_3_the_headers_of_fragments() {
    let fragments = Arc::new(udp(200)).fragment(0x0102, 104).unwrap();
    let bytes: Vec<_> = parts(&fragments)
        .iter()
        .map(|part| part.to_vec(Eui64::of_mote(MoteId(0)), Some(Eui64::of_mote(MoteId(3)))))
        .collect();
    // 248 bytes in all. In the first there may be 4 bytes of fragment header and 23 of compressed headers, which stand
    // for 48: 121 covered, 120 of them a multiple of 8.
    assert_eq!(bytes[0][..5], [0xc0, 248, 1, 2, 0x7e]);
    assert_eq!((fragments[0].covers, fragments[1].covers, fragments[2].covers), (120, 96, 32));
    assert_eq!(bytes[1][..5], [0xe0, 248, 1, 2, 120 / 8]);
    assert_eq!(bytes[2][..5], [0xe0, 248, 1, 2, 216 / 8]);
    assert_eq!(bytes[2].len(), 5 + 32);
}

#[test]
fn rfc8930_6_a_first_fragment_still_fits_where_less_can_be_left_out() {
    let room = 104;
    let hops: Vec<_> = (1..=3).map(|n| Eui64::of_mote(MoteId(n)).global()).collect();
    let root = Eui64::of_mote(MoteId(0)).global();
    let route = Some(SourceRoute { root, hops, tunnel_hop_limit: None });
    let datagram = Arc::new(Datagram { route, ..udp(300) });
    let mut fragments = datagram.fragment(1, room).unwrap();
    let whole: Vec<u8> = vec![7; 300];
    for hop in 0..3 {
        let (from, to) = (Eui64::of_mote(MoteId(hop)), Some(Eui64::of_mote(MoteId(hop + 1))));
        let parts = parts(&fragments);
        let bytes: Vec<_> = parts.iter().map(|part| part.to_vec(from, to)).collect();
        assert!(bytes.iter().all(|bytes| bytes.len() <= room), "hop {hop}");
        let slices: Vec<_> = bytes.iter().map(Vec::as_slice).collect();
        let again = reassemble(&slices, from, to, Some(root)).unwrap();
        assert!(matches!(again.upper, Upper::Udp(udp) if udp.payload == whole));
        // The next mote takes itself off the route, in the first fragment only.
        let mut forwarded = Datagram::clone(&datagram);
        forwarded.hop_limit = 63 - hop as u8;
        forwarded.route.as_mut().unwrap().hops.drain(..=hop as usize);
        fragments[0].datagram = Arc::new(forwarded);
    }
}

#[test]
fn datagrams_beyond_11_bits_and_headers_beyond_a_frame_are_not_cut() {
    assert!(Arc::new(udp(1999)).fragment(1, 104).is_some());
    assert!(Arc::new(udp(2000)).fragment(1, 104).is_none());
    let root = Eui64::of_mote(MoteId(0)).global();
    let hops = (1..100).map(|n| Eui64(n * 0x1234_5678_9abc).global()).collect();
    let route = Some(SourceRoute { root, hops, tunnel_hop_limit: None });
    assert!(Arc::new(Datagram { route, ..udp(10) }).fragment(1, 104).is_none());
}

#[test]
fn a_whole_datagram_is_not_a_fragment() {
    let whole = LowpanRepr::Whole(Arc::new(udp(3)));
    let bytes = whole.to_vec(Eui64::of_mote(MoteId(0)), Some(Eui64::of_mote(MoteId(3))));
    assert_eq!(FragmentHeader::parse(&bytes), Ok(None));
}
