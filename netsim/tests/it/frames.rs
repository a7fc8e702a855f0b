//! One frame of every kind, as octets and back. What Wireshark says to the same frames is in tests/external.

#[path = "../../examples/frames/kinds.rs"]
mod kinds;

use netsim::wire::Eui64;
use netsim::wire::datagram::Datagram;
use netsim::wire::fragment::{LowpanRepr, reassemble};
use netsim::wire::frame::{Content, Envelope, FrameRepr, MAX_PSDU};
use proto::ids::MoteId;

#[test]
fn every_kind_is_as_long_as_it_says_and_fits_a_frame() {
    let frames = kinds::frames();
    assert!(frames.len() > 30);
    for frame in frames {
        let mut octets = [0xee; MAX_PSDU + 1];
        frame.emit(&mut octets);
        let length = frame.buffer_len();
        assert!(length <= MAX_PSDU, "{length}: {frame:?}");
        assert!(octets[length..].iter().all(|&octet| octet == 0xee), "{frame:?}");
        assert_eq!(octets[..length], frame.to_vec());
    }
}

#[test]
fn every_kind_that_is_whole_is_read_again() {
    let root = Eui64::of_mote(MoteId(0)).global();
    for frame in kinds::frames() {
        match &frame.content {
            Content::Lowpan(LowpanRepr::First(_) | LowpanRepr::Next(_)) => {
                FrameRepr::parse(&frame.to_vec(), Some(root)).unwrap_err();
            }
            _ => assert_eq!(FrameRepr::parse(&frame.to_vec(), Some(root)), Ok(frame)),
        }
    }
}

#[test]
fn the_fragments_make_their_datagrams_again() {
    let frames = kinds::frames();
    for tag in [1, 2] {
        let mut expected = None;
        let mut psdus = Vec::new();
        for frame in &frames {
            if let Content::Lowpan(LowpanRepr::First(part) | LowpanRepr::Next(part)) =
                &frame.content
                && part.tag == tag
            {
                expected = Some(Datagram::clone(&part.datagram));
                psdus.push(frame.to_vec());
            }
        }
        assert_eq!(psdus.len(), 3);
        let envelopes: Vec<_> = psdus.iter().map(|psdu| Envelope::parse(psdu).unwrap()).collect();
        let payloads: Vec<_> = envelopes.iter().map(|envelope| envelope.payload).collect();
        let source = envelopes[0].source.unwrap();
        let datagram = reassemble(&payloads, source, envelopes[0].destination, None).unwrap();
        assert_eq!(Some(datagram), expected);
    }
}
