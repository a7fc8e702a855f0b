//! The network under test beside the plain one: after every control period both are the same.

use super::plain::Plain;
use super::scenario::{FUNCTIONS, RADIOS, Scenario, Spice};
use crate::harness::STEP_NS;
use netsim::energy::Usage;
use netsim::mesh::network::Mesh;
use netsim::mote::Mote;
use physics::asn::Asn;
use proptest::prelude::*;
use proto::side::NetOutput;

/// Thousands of slots of one network.
const SECONDS: u64 = 30;

/// What the network under test has counted of a mote's radio.
fn usage(mote: &Mote, asn: Asn) -> Usage {
    mote.tally.usage_until(asn, mote.schedule.n_listening(asn))
}

/// A mote without what the network around it counts.
fn without_counts(mote: &Mote) -> Mote {
    let mut mote = mote.clone();
    mote.tally.usage = Usage::default();
    mote.tally.n_listening_used = 0;
    (mote.tally.sent, mote.tally.n_rx) = (Default::default(), 0);
    // Each looks at a mote's changes in slots of its own.
    mote.schedule.set_effective(Asn(0));
    mote
}

/// The lines in which two differ.
fn differences(ours: &impl std::fmt::Debug, theirs: &impl std::fmt::Debug) -> String {
    let texts = [format!("{ours:#?}"), format!("{theirs:#?}")];
    let [ours, theirs] = texts.each_ref().map(|text| text.lines());
    let differing = ours.zip(theirs).filter(|(ours, theirs)| ours != theirs);
    differing.map(|(ours, theirs)| format!("{} and not {}\n", ours.trim(), theirs.trim())).collect()
}

fn heard_in(output: &NetOutput, n: usize) -> Vec<(u32, u32, u64)> {
    let sent = &output.deliveries.transmissions;
    let mut heard = Vec::new();
    for receiver in 0..n {
        for place in output.deliveries.heard_by(receiver) {
            let end_ns = sent.end_ns[place];
            heard.push((receiver as u32, sent.sender[place], end_ns / 10_000_000 - 1));
        }
    }
    heard.sort_unstable();
    heard
}

fn compare(mesh: &Mesh, plain: &mut Plain, output: &NetOutput) -> Result<(), TestCaseError> {
    let state = mesh.state();
    for (place, (ours, theirs)) in state.motes.iter().zip(&plain.motes).enumerate() {
        let tally = &ours.tally;
        let sent = tally.sent_in_all();
        let counts = [sent.n, sent.n_unicast, sent.n_acked, tally.n_rx];
        prop_assert_eq!(counts, plain.counts[place], "mote {}: frames", place);
        prop_assert_eq!(usage(ours, state.asn), plain.usages[place], "mote {}: radio", place);
        let [ours, theirs] = [ours, theirs].map(without_counts);
        prop_assert!(ours == theirs, "mote {}: {}", place, differences(&ours, &theirs));
    }
    prop_assert_eq!(state.packets.counts(), plain.packets.counts());
    plain.heard.sort_unstable();
    prop_assert_eq!(heard_in(output, state.motes.len()), std::mem::take(&mut plain.heard));
    Ok(())
}

proptest! {
    #![proptest_config(super::config(48))]
    #[test]
    fn every_slot_is_as_if_everybody_was_looked_at_in_it(
        function in prop::sample::select(FUNCTIONS.to_vec()),
        radio in prop::sample::select(RADIOS.to_vec()),
        seed in 0u64..1_000_000,
    ) {
        let scenario = Scenario::draw(function, radio, Spice::ALL, seed, SECONDS);
        let mut mesh = scenario.mesh();
        let mut plain = Plain::new(&scenario);
        for period in 0..scenario.end_ns / STEP_NS {
            let (from_ns, until_ns) = (period * STEP_NS, (period + 1) * STEP_NS);
            let output = scenario.step(from_ns, until_ns, |input| mesh.step(input));
            plain.period(&scenario, period);
            if let Err(error) = compare(&mesh, &mut plain, &output) {
                return Err(TestCaseError::fail(format!("period {period}: {error}\n{}", scenario.config)));
            }
        }
    }
}
