//! F3, F8: datagrams in parts over several hops of a network.

use super::bench::{Bench, EAGER, LINE, NO_KEEP_ALIVES, OnAir, What, line, own_cells};

/// A line of four. The nearer a hop is to the root, the earlier in the slotframe its cell lies.
fn cells() -> String {
    let mut text =
        "[sf]\nkind = \"static\"\nslotframe_slots = 20\nminimal_cell_slots = 20\n".to_owned();
    for (slot, from, to) in [(5, 1, 0), (6, 2, 1), (7, 3, 2), (10, 0, 1), (11, 1, 2), (12, 2, 3)] {
        text += &format!("[[sf.cell]]\nslot = {slot}\nfrom = {from}\nto = {to}\n");
    }
    text
}

/// In how many slotframes the fragments of one datagram of two went from mote 3 to the root.
fn slotframes_taken(fragmentation: &str) -> u64 {
    let lowpan = format!("[lowpan]\nfragmentation = \"{fragmentation}\"\n");
    let mac = format!("{EAGER}{NO_KEEP_ALIVES}");
    let mut bench = Bench::new(&line(4), &format!("{LINE}{mac}{lowpan}{}", cells()));
    bench.form();
    bench.run(2000);
    bench.send(3, 0, 120);
    bench.run(500);
    let fragments: Vec<_> = bench
        .frames
        .iter()
        .filter(|frame| matches!(frame.what, What::Fragment(_)))
        .map(|frame| (frame.source, frame.asn / 20))
        .collect();
    assert_eq!(fragments.len(), 6, "{fragments:?}");
    let [ended] = &bench.ended[..] else { panic!("{:?}", bench.ended) };
    assert_eq!((ended.lost.as_deref(), ended.hops), (None, 3));
    fragments[5].1 - fragments[0].1 + 1
}

#[test]
fn f3_over_three_hops_two_fragments_take_six_slotframes_per_hop_and_four_forwarded() {
    // What arrives over a hop finds the cell of the next one past: it goes on in the next slotframe.
    assert_eq!(slotframes_taken("per-hop"), 6);
    assert_eq!(slotframes_taken("forwarding"), 4);
}

#[test]
fn f8_a_datagram_in_parts_goes_down_two_hops_to_its_end() {
    for fragmentation in ["per-hop", "forwarding"] {
        let lowpan = format!("[lowpan]\nfragmentation = \"{fragmentation}\"\n");
        let cells = own_cells(3, &[(0, 1), (1, 2)]);
        let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}{lowpan}{cells}"));
        bench.form();
        let root_knows = |bench: &Bench| bench.mote(0).rpl.routes().len() == 2;
        bench.run_until(101, 20_000, root_knows);
        bench.frames.clear();
        bench.send(0, 2, 180);
        bench.run(5_000);
        let [ended] = &bench.ended[..] else { panic!("{:?}", bench.ended) };
        assert_eq!((ended.source, ended.destination, ended.hops), (0, 2, 2));
        assert_eq!(ended.lost, None);
        for (source, destination) in [(0, 1), (1, 2)] {
            let parts = bench.sent(source, |what| matches!(what, What::Fragment(_)));
            assert!(2 <= parts.len(), "{fragmentation}: {parts:?}");
            assert!(parts.iter().all(|part| part.destination == Some(destination)));
        }
    }
}

#[test]
fn rfc4944_5_3_parts_that_turn_round_at_the_root_are_put_together_before_they_enter_its_tunnel() {
    for fragmentation in ["per-hop", "forwarding"] {
        let lowpan = format!("[lowpan]\nfragmentation = \"{fragmentation}\"\n");
        let cells = own_cells(4, &[(0, 1), (0, 2), (2, 3)]);
        // 1 - 0 - 2 - 3
        let places = [(10.0, 0.0), (0.0, 0.0), (20.0, 0.0), (30.0, 0.0)];
        let mut bench = Bench::new(&places, &format!("{LINE}{EAGER}{lowpan}{cells}"));
        bench.form();
        bench.run_until(101, 20_000, |bench| bench.mote(0).rpl.routes().len() == 3);
        bench.frames.clear();
        bench.send(1, 3, 180);
        bench.run(5_000);
        let [ended] = &bench.ended[..] else { panic!("{:?}", bench.ended) };
        assert_eq!((ended.lost.as_deref(), ended.hops), (None, 3), "{fragmentation}");
        let sizes = |source| {
            let parts = bench.sent(source, |what| matches!(what, What::Fragment(_)));
            let size_of = |part: &OnAir| match &part.what {
                What::Fragment(header) => header.size,
                _ => unreachable!("only fragments were kept"),
            };
            let mut sizes: Vec<u16> = parts.iter().map(size_of).collect();
            sizes.dedup();
            sizes
        };
        // IPv6, the RPL option and UDP: 56 bytes. In the tunnel another IPv6 header, and a routing header of 16 bytes.
        assert_eq!(sizes(1), [180 + 56], "{fragmentation}");
        assert_eq!(sizes(0), [180 + 56 + 40 + 16], "{fragmentation}");
    }
}
