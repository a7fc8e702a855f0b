//! Prints a capture of one frame of every kind: `cargo run --release -p netsim --example frames | wireshark -k -i -`.
//!
//! Wireshark is to know context 0 (preference 6lowpan.context0: fd00::/64) and what the network carries
//! (decode as: wpan.panid 0xabcd is 6LoWPAN).

mod kinds;

use netsim::wire::Eui64;
use netsim::wire::frame::AckRepr;
use netsim::wire::security::FrameSecurity;
use netsim::wire::tap;
use physics::asn::Asn;
use proto::time::SimTime;
use std::io::{self, Write};

fn main() -> io::Result<()> {
    let mut capture = tap::file_header().to_vec();
    for (asn, frame) in (0..).zip(kinds::frames()) {
        capture.extend(tap::record(
            SimTime::from_ns(asn * 10_000_000),
            (26, 0),
            Some(-70.0),
            Asn(asn),
            &frame.to_vec(),
        ));
        if frame.ack_request {
            let psdu = ack(frame.source, frame.sequence).to_vec();
            capture.extend(tap::record(
                SimTime::from_ns(asn * 10_000_000 + 5_000_000),
                (26, 0),
                None,
                Asn(asn),
                &psdu,
            ));
        }
    }
    io::stdout().write_all(&capture)
}

fn ack(destination: Eui64, sequence: u8) -> AckRepr {
    AckRepr { destination, sequence, time_correction_us: -31, security: FrameSecurity::Unsecured }
}
