//! What holds in every network, whatever happens to it: drawn at random, many times.
//!
//! `NETSIM_SEEDS` says how many networks are drawn for each scheduling function and radio; few in an ordinary run.

use crate::harness::STEP_NS;
use crate::model::scenario::{FUNCTIONS, RADIOS, Scenario, Spice};
use netsim::lowpan::DropReason;
use netsim::mesh::network::Mesh;
use netsim::mote::Mote;
use physics::asn::Asn;
use proto::side::NetOutput;
use proto::time::{SimDuration, SimTime};
use proto::types::{Deliveries, FrameOutcome};
use std::collections::BTreeSet;

/// Networks per scheduling function and radio.
pub(crate) fn n_seeds(ordinary: u64) -> u64 {
    let asked = std::env::var("NETSIM_SEEDS").ok();
    asked.map_or(ordinary, |text| text.parse().expect("NETSIM_SEEDS is a number"))
}

/// What is remembered from step to step.
#[derive(Default)]
struct Watch {
    /// Packets that have ended.
    ended: BTreeSet<u64>,
    /// Payloads that have been heard: receiver, sender, when they were sent, what.
    heard: BTreeSet<(u32, u32, u64, Vec<u8>)>,
    /// Frames sent and received by all motes.
    n_frames: [u64; 2],
    /// Of the frames that were recorded: sent, received, acknowledged.
    n_recorded: [u64; 3],
    /// By mote: since when its clock has been further off its time source's than the guard time (ns).
    astray_since_ns: Vec<Option<u64>>,
    /// Packets that arrived after they had ended.
    n_late: u64,
}

/// Half of macTsRxWait (IEEE Std 802.15.4-2015, 8.4.3.3.3).
const GUARD_NS: u64 = 1_100_000;

impl Watch {
    fn check(&mut self, mesh: &Mesh, output: &NetOutput, what: &dyn Fn() -> String) {
        self.packets(mesh, output, what);
        self.receptions(mesh, output, what);
        self.frames(mesh, output, what);
        self.deliveries(mesh, &output.deliveries, what);
        for (place, mote) in mesh.state().motes.iter().enumerate() {
            slots_are_accounted_for(mote, mesh.state().asn, what);
            frames_are_accounted_for(mote, what);
            who_is_off_holds_nothing(mote, mesh.state().place.is_alive(place), what);
        }
        self.clocks(mesh, output.time_ns, what);
    }

    /// Sent = delivered + lost + on their way; each ends once; each on its way is somewhere.
    fn packets(&mut self, mesh: &Mesh, output: &NetOutput, what: &dyn Fn() -> String) {
        let packets = output.packets.as_ref().expect("recorded");
        let created: u64 = packets.kinds.iter().map(|kind| kind.created).sum();
        for place in 0..packets.len() {
            assert!(self.ended.insert(packets.id[place]), "packet ended twice: {}", what());
            assert!(packets.created_ns[place] <= packets.ended_ns[place], "{}", what());
            assert!(packets.ended_ns[place] < output.time_ns, "{}", what());
            assert_eq!(packets.outcome[place] == 0, packets.hops[place] != 0, "{}", what());
        }
        let all = &mesh.state().packets;
        let [sent, delivered, lost, waiting] = all.counts();
        assert_eq!(sent, created, "{}", what());
        assert_eq!(delivered + lost, self.ended.len() as u64, "{}", what());
        assert_eq!(sent, delivered + lost + waiting, "{}", what());
        let mut held = BTreeSet::new();
        for mote in &mesh.state().motes {
            held.extend(mote.mac.queue().iter().map(|queued| queued.packet));
            held.extend(mote.lowpan.under_way());
        }
        for packet in all.on_their_way() {
            assert!(held.contains(&packet.id), "nobody holds {packet:?}: {}", what());
        }
        self.n_late = all.late();
    }

    /// The record of frames holds every frame, reception and acknowledgment that motes count.
    fn frames(&mut self, mesh: &Mesh, output: &NetOutput, what: &dyn Fn() -> String) {
        let frames = output.frames.as_ref().expect("recorded");
        let order: Vec<_> = frames.sent_ns.iter().zip(&frames.sender).collect();
        assert!(order.is_sorted(), "{}", what());
        assert!(frames.sent_ns.iter().all(|sent_ns| *sent_ns < output.time_ns), "{}", what());
        let is_acked = |outcome: &&FrameOutcome| **outcome == FrameOutcome::Acknowledged;
        self.n_recorded[0] += frames.len() as u64;
        self.n_recorded[1] += frames.n_received.iter().copied().map(u64::from).sum::<u64>();
        self.n_recorded[2] += frames.outcome.iter().filter(is_acked).count() as u64;
        let motes = &mesh.state().motes;
        let counted: [u64; 3] = [
            motes.iter().map(|mote| mote.tally.sent_in_all().n).sum(),
            motes.iter().map(|mote| mote.tally.n_rx).sum(),
            motes.iter().map(|mote| mote.tally.sent_in_all().n_acked).sum(),
        ];
        assert_eq!(self.n_recorded, counted, "{}", what());
    }

    /// Nothing is received that was not sent.
    fn receptions(&mut self, mesh: &Mesh, output: &NetOutput, what: &dyn Fn() -> String) {
        let motes = &mesh.state().motes;
        let n_tx: u64 = motes.iter().map(|mote| mote.tally.sent_in_all().n).sum();
        let n_rx: u64 = motes.iter().map(|mote| mote.tally.n_rx).sum();
        let [tx_before, rx_before] = self.n_frames;
        let most = (n_tx - tx_before) * (motes.len() as u64 - 1);
        assert!(n_rx - rx_before <= most, "{n_rx} received, {n_tx} sent: {}", what());
        self.n_frames = [n_tx, n_rx];
        assert_eq!(output.capture.is_empty(), n_tx == tx_before, "{}", what());

        let acked: u64 = motes.iter().map(|mote| mote.tally.sent_in_all().n_acked).sum();
        let unicast: u64 = motes.iter().map(|mote| mote.tally.sent_in_all().n_unicast).sum();
        let received: u64 = motes.iter().map(|mote| mote.tally.usage.rx_unicast.n).sum();
        assert!(
            acked <= received && received <= unicast,
            "{acked} {received} {unicast}: {}",
            what()
        );

        let links = output.heard_links.as_ref().expect("wanted");
        let mut heard_by = vec![0; motes.len()];
        for place in 0..links.receiver.len() {
            let (receiver, sender) = (links.receiver[place], links.sender[place]);
            let sent = motes[sender as usize].tally.sent_in_all().n;
            assert_ne!(receiver, sender, "{}", what());
            assert!(links.frames[place] <= sent, "{receiver} heard {sender}: {}", what());
            heard_by[receiver as usize] += links.frames[place];
        }
        for (mote, heard) in motes.iter().zip(heard_by) {
            assert_eq!(mote.tally.n_rx, heard, "{}", what());
        }
    }

    /// No payload is heard twice, none by its sender, none by who is off.
    fn deliveries(&mut self, mesh: &Mesh, deliveries: &Deliveries, what: &dyn Fn() -> String) {
        let sent = &deliveries.transmissions;
        for (receiver, mote) in mesh.state().motes.iter().enumerate() {
            for place in deliveries.heard_by(receiver) {
                let (sender, sent_ns) = (sent.sender[place], sent.sent_ns[place]);
                assert_ne!(receiver as u32, sender, "{}", what());
                assert!(sent_ns < sent.end_ns[place], "{}", what());
                assert!(mote.tally.on_since_asn.is_some(), "{}", what());
                let payload = sent.payloads.iter().nth(place).expect("one each").to_vec();
                let is_new = self.heard.insert((receiver as u32, sender, sent_ns, payload));
                assert!(is_new, "{receiver} heard {sender} of {sent_ns} twice: {}", what());
            }
        }
    }

    /// A clock that is off its time source's by more than the guard time comes back, or synchronisation is lost.
    fn clocks(&mut self, mesh: &Mesh, now_ns: u64, what: &dyn Fn() -> String) {
        let motes = &mesh.state().motes;
        let mac = &mesh.settings().mac;
        self.astray_since_ns.resize(motes.len(), None);
        for (mote, since) in motes.iter().zip(&mut self.astray_since_ns) {
            let source = mote.mac.time_source().and_then(|source| mesh.addresses().mote(source));
            let off_ns = source.map(|source| {
                let theirs = motes[source.index()].mac.deviation_ns(SimTime::from_ns(now_ns));
                mote.mac.deviation_ns(SimTime::from_ns(now_ns)).abs_diff(theirs)
            });
            if off_ns.is_some_and(|off_ns| GUARD_NS < off_ns) && !mac.keep_alive.is_zero() {
                let since_ns = *since.get_or_insert(now_ns);
                let astray_ns = now_ns - since_ns;
                // A mote that knows its clock may run free meanwhile.
                let free_run = mac.max_keep_alive.map_or(SimDuration::ZERO, |_| mac.max_free_run);
                let most_ns = mac.desynchronise.max(free_run).ns();
                assert!(astray_ns <= most_ns, "astray for {astray_ns}: {}", what());
            } else {
                *since = None;
            }
        }
    }
}

fn slots_are_accounted_for(mote: &Mote, asn: Asn, what: &dyn Fn() -> String) {
    let n_listening = mote.schedule.n_listening(asn);
    let used = mote.tally.n_listening_used;
    assert!(used <= n_listening, "mote {} used {used} of {n_listening}: {}", mote.id, what());
    let usage = mote.tally.usage_until(asn, n_listening);
    let on = mote.tally.slots_on(asn);
    assert_eq!(usage.slots(), on, "mote {}: {usage:?}: {}", mote.id, what());
}

/// At the link: given to the MAC = sent + dropped, by reason + waiting; whatever frames carry.
fn frames_are_accounted_for(mote: &Mote, what: &dyn Fn() -> String) {
    let frames = &mote.tally.frames;
    let waiting = mote.mac.queue().iter().count() as u64;
    let ended = frames.n_sent + frames.n_dropped();
    assert_eq!(frames.n_given, ended + waiting, "{frames:?}, mote {}: {}", mote.id, what());
    assert!(frames.n_arrived <= frames.n_dropped(), "{}", what());
}

fn who_is_off_holds_nothing(mote: &Mote, is_alive: bool, what: &dyn Fn() -> String) {
    let is_on = mote.tally.on_since_asn.is_some();
    assert!(is_alive || !is_on, "{}", what());
    if !is_on {
        assert!(!mote.mac.is_synced() && !mote.mac.is_scanning(), "{}", what());
        assert!(mote.mac.queue_len() == 0 && !mote.joined && !mote.ready, "{}", what());
        assert_eq!(mote.schedule.cells().count(), 0, "{}", what());
        assert_eq!(mote.rpl.parent(), None, "{}", what());
    }
    if !mote.mac.is_synced() {
        assert_eq!(mote.mac.queue_len(), 0, "{}", what());
    }
}

/// Runs a scenario; steps of one to ten slots.
fn run(scenario: &Scenario, mut check: impl FnMut(&Mesh, &NetOutput)) -> Mesh {
    let mut mesh = scenario.mesh();
    for period in 0..scenario.end_ns / STEP_NS {
        let (from_ns, until_ns) = (period * STEP_NS, (period + 1) * STEP_NS);
        let middle_ns = from_ns + STEP_NS / 10 * (period % 10);
        for (from_ns, until_ns) in [(from_ns, middle_ns), (middle_ns, until_ns)] {
            if from_ns < until_ns {
                let output = scenario.step(from_ns, until_ns, |input| mesh.step(input));
                check(&mesh, &output);
            }
        }
    }
    mesh
}

fn what_always_holds(function: &str, first_seed: u64) {
    let mut totals = [0; 5];
    for (k, radio) in (0..).zip(RADIOS) {
        for seed in 0..n_seeds(5) {
            let seed = first_seed + 100_000 * k + seed;
            let scenario = Scenario::draw(function, radio, Spice::ALL, seed, 45);
            let mut watch = Watch::default();
            let mesh = run(&scenario, |mesh, output| {
                let what = || format!("seed {seed}, {} ns\n{}", output.time_ns, scenario.config);
                watch.check(mesh, output, &what);
            });
            let [sent, delivered, lost, _] = mesh.state().packets.counts();
            let motes = &mesh.state().motes;
            let ready = motes.iter().filter(|mote| mote.tally.first_ready.is_some()).count();
            let desynchronised: u64 = motes.iter().map(|mote| mote.tally.n_desynchronised).sum();
            // No packet reaches its application twice, or after it was taken for lost.
            assert_eq!(watch.n_late, 0, "seed {seed}\n{}", scenario.config);
            let counts = [sent, delivered, lost, ready as u64, desynchronised];
            for (total, count) in totals.iter_mut().zip(counts) {
                *total += count;
            }
        }
    }
    let [sent, delivered, lost, ready, desynchronised] = totals;
    // None of it is about networks in which nothing happens.
    let much = [100 < delivered, delivered < sent, 10 < lost, 50 < ready, 0 < desynchronised];
    assert_eq!(much, [true; 5], "{totals:?}");
}

#[test]
fn what_always_holds_under_minimal() {
    what_always_holds(FUNCTIONS[0], 1_000_000);
}

#[test]
fn what_always_holds_under_msf() {
    what_always_holds(FUNCTIONS[1], 2_000_000);
}

#[test]
fn what_always_holds_under_rrsf() {
    what_always_holds(FUNCTIONS[2], 3_000_000);
}

#[test]
fn what_always_holds_under_orchestra() {
    what_always_holds(FUNCTIONS[3], 4_000_000);
}

#[test]
fn what_always_holds_under_a_static_schedule() {
    what_always_holds(FUNCTIONS[4], 5_000_000);
}

#[test]
fn what_always_holds_under_sotdma() {
    what_always_holds(FUNCTIONS[6], 7_000_000);
}

#[test]
fn what_always_holds_of_motes_that_move_with_slots_of_their_own() {
    what_always_holds(FUNCTIONS[7], 8_000_000);
}

#[test]
fn what_always_holds_of_motes_that_move_under_orchestra() {
    what_always_holds(FUNCTIONS[8], 9_000_000);
}

#[test]
fn what_always_holds_under_alice() {
    what_always_holds(FUNCTIONS[9], 10_000_000);
}

#[test]
fn alice_drops_frames_for_motes_that_are_no_relatives_any_more_unless_told_otherwise() {
    let dropped = |function: &str| -> u64 {
        let counts = (0..40).map(|seed| {
            let scenario = Scenario::draw(function, RADIOS[2], Spice::ALL, 13_000_000 + seed, 45);
            let mesh = run(&scenario, |_, _| {});
            let motes = mesh.state().motes.iter();
            motes.map(|mote| mote.tally.dropped(DropReason::NoTxCells)).sum::<u64>()
        });
        counts.sum()
    };
    assert!(0 < dropped(FUNCTIONS[9]));
    assert_eq!(dropped(&format!("{}\nearly_packet_drop = false", FUNCTIONS[9])), 0);
}

#[test]
fn what_always_holds_under_llsf() {
    what_always_holds(FUNCTIONS[10], 11_000_000);
}

#[test]
fn what_always_holds_under_emsf() {
    what_always_holds(FUNCTIONS[11], 12_000_000);
}

#[test]
fn what_always_holds_under_rrsf_as_botnet_has_it() {
    what_always_holds(FUNCTIONS[5], 6_000_000);
}
