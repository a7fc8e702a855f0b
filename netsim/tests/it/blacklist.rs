//! Channel blacklisting in a whole network: what it gains where it can be computed, and that it is saved and restored.

use crate::harness::{setup, standing_at, step_with};
use netsim::sim::Network;
use proto::side::NetSimulator as _;
use proto::types::{EVERYONE, FrameOutcome, Frames, NetRecord};

/// Sensors around a root, each with a dedicated cell; the WiFi networks 1, 6 and 11, and noise on the whole band.
fn star(n: usize, blacklist: &str, noise: f64, wifi: f64) -> String {
    let mut text = format!(
        "mode = \"6tisch\"\n[mac]\nkeep_alive_s = 0\nmax_drift_ppm = 0\n{blacklist}\n[phy]\npropagation = \"unit-disk\"\nradius_m = 20\n\
         [rpl]\nroutes_down = false\nobjective = \"mrhof\"\nmax_failures = 1000\n[compat]\nperfect_acks = true\n[join]\nsecure = false\n[swarm]\ntransport = \"none\"\n\
         [[app]]\nkind = \"periodic\"\nperiod_s = 3\npayload_bytes = 40\n"
    );
    for (centre, width, duty) in
        [(2440, 80, noise), (2412, 22, wifi), (2437, 22, wifi), (2462, 22, wifi)]
    {
        text += &format!(
            "[[phy.effect]]\nkind = \"interference\"\ncentre_mhz = {centre}\nwidth_mhz = {width}\nduty = {duty}\n"
        );
    }
    text.push_str("[sf]\nkind = \"static\"\nslotframe_slots = 101\n");
    text.push_str("[[sf.cell]]\nslot = 0\nfrom = \"any\"\nto = \"all\"\nadvertising = true\n");
    for mote in 1..n {
        let slot = 7 * mote;
        text += &format!(
            "[[sf.cell]]\nslot = {slot}\nchannel = {}\nfrom = {mote}\nto = 0\n",
            mote % 16
        );
    }
    text
}

const OFF: &str = "";
const ALL_OFFSETS: &str = "blacklist = { kind = \"mabo-first-best-arm\", arms = 4, offsets = 16 }";

/// Transmissions in dedicated cells, how many of them arrived, and how many were lost where nothing is.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    n_sent: u64,
    n_arrived: u64,
    n_lost_clean: u64,
}

impl Count {
    fn add(&mut self, frames: &Frames, from_ns: u64) {
        for frame in (0..frames.len()).filter(|&frame| from_ns <= frames.sent_ns[frame]) {
            // Slot 0 is everybody's.
            let slot = frames.sent_ns[frame] / 10_000_000 % 101;
            let is_dedicated = slot != 0
                && frames.destination[frame] != EVERYONE
                && frames.channel_offset[frame] != u32::MAX;
            if is_dedicated {
                self.n_sent += 1;
                self.n_arrived += u64::from(frames.outcome[frame] != FrameOutcome::Lost);
                let is_clean = [15, 20, 25, 26].contains(&frames.channel[frame]);
                self.n_lost_clean +=
                    u64::from(is_clean && frames.outcome[frame] == FrameOutcome::Lost);
            }
        }
    }

    fn delivery(&self) -> f64 {
        self.n_arrived as f64 / self.n_sent as f64
    }
}

fn run(n: usize, config: &str, seed: u64, seconds: u64, from_s: u64) -> Count {
    let mut setup = setup(n, config);
    setup.experiment.seed = seed;
    setup.experiment.step_ns = 1_000_000_000;
    setup.records = vec![NetRecord::Frames];
    let mut network = Network::default();
    network.configure(&setup).expect("a valid configuration");
    let states = standing_at(&vec![(0.0, 0.0); n]);
    let mut count = Count::default();
    for second in 0..seconds {
        let [from_ns, until_ns] = [second, second + 1].map(|s| s * 1_000_000_000);
        let output = step_with(&mut network, &states, from_ns, until_ns, &[], false);
        if let Some(frames) = &output.frames {
            count.add(frames, from_s * 1_000_000_000);
        }
    }
    count
}

/// Channels 15, 20, 25 and 26 are clean, and 12 others lose four frames of five: all of 4 arms are clean.
#[test]
fn with_twelve_channels_noisy_delivery_rises_to_that_of_the_others_but_for_exploration() {
    let n = 5;
    let off = run(n, &star(n, OFF, 0.0, 0.8), 1, 2000, 400);
    let on = run(n, &star(n, ALL_OFFSETS, 0.0, 0.8), 1, 2000, 400);
    // Four standard errors.
    let near = |count: &Count, expected: f64| {
        let tolerance = 4.0 * (expected * (1.0 - expected) / count.n_sent as f64).sqrt();
        assert!((count.delivery() - expected).abs() < tolerance, "{count:?}, not {expected}");
    };
    assert!(3000 < off.n_sent && 1000 < on.n_sent, "{off:?} {on:?}");
    near(&off, 1.0 - 0.75 * 0.8);
    near(&on, 1.0 - 0.05 * 0.75 * 0.8);
    // The receiver always listens where the sender sends.
    assert_eq!((off.n_lost_clean, on.n_lost_clean), (0, 0));
}

#[test]
fn restored_with_blacklists_and_continued_equals_never_having_stopped() {
    let n = 5;
    let mut setup = setup(n, &star(n, ALL_OFFSETS, 0.2, 0.7));
    setup.records = vec![NetRecord::Frames];
    let mut network = Network::default();
    network.configure(&setup).unwrap();
    let states = standing_at(&vec![(0.0, 0.0); n]);
    let step = |network: &mut Network, k: u64| {
        step_with(network, &states, k * 1_000_000_000, (k + 1) * 1_000_000_000, &[], false)
    };
    for k in 0..300 {
        step(&mut network, k);
    }
    let saved = network.snapshot();
    let mut twin = Network::default();
    twin.restore(&saved).unwrap();
    // Of frames in dedicated cells, how many are on clean channels, and all.
    let mut n_sent = [0; 2];
    for k in 300..600 {
        let (a, b) = (step(&mut network, k), step(&mut twin, k));
        assert_eq!((a.motes, &a.frames), (b.motes, &b.frames));
        let frames = a.frames.unwrap();
        for frame in (0..frames.len()).filter(|&frame| frames.destination[frame] == 0) {
            n_sent[0] += u32::from([15, 20, 25, 26].contains(&frames.channel[frame]));
            n_sent[1] += 1;
        }
    }
    assert!(network.snapshot() == twin.snapshot());
    // Lists were in force when it was saved: by the plain sequence it would be a quarter.
    assert!(200 < n_sent[1] && n_sent[1] < 2 * n_sent[0], "{n_sent:?}");
}

#[test]
fn only_schedules_with_dedicated_cells_at_both_ends_and_fewer_arms_than_channels_are_accepted() {
    let refused = |config: &str| {
        let problems = Network::default().configure(&setup(3, config)).unwrap_err();
        crate::harness::text(&problems)
    };
    let blacklist = "blacklist = { kind = \"mabo-first-best-arm\", arms = 4 }";
    let config =
        format!("mode = \"6tisch\"\nhopping_sequence = [11, 12, 13, 14]\n[mac]\n{blacklist}\n");
    let text = refused(&format!("{config}[sf]\nkind = \"msf\"\n"));
    assert_eq!(
        text,
        "netsim.mac.blacklist.arms: must be less than the number of channels of netsim.hopping_sequence, 4, got 4 \
         (nearest valid: 3)"
    );
    let sub_ghz = config.replace("[11, 12, 13, 14]", "[0, 1, 2, 3, 4]");
    let text = refused(&format!(
        "slot_duration_s = 0.05\n{sub_ghz}[sf]\nkind = \"msf\"\n[phy]\nstandard = \"sun-fsk-863\"\n"
    ));
    assert_eq!(
        text,
        "netsim.mac.blacklist.kind: requires phy.standard = \"o-qpsk-2450\", whose channels are 11 to 26, and \
         netsim.hopping_sequence has channel 0, got \"mabo-first-best-arm\" (nearest valid: \"none\")"
    );
    let spaced = config.replace("arms = 4", "arms = 2, spacing = 8");
    let text = refused(&format!("{spaced}[sf]\nkind = \"msf\"\n"));
    assert_eq!(
        text,
        "netsim.mac.blacklist.spacing: must not be a multiple of the length of netsim.hopping_sequence, 4, because all \
         channel offsets then have the same channel, got 8 (nearest valid: 7)"
    );
    let config = config.replace("arms = 4", "arms = 2");
    let text = refused(&format!("{config}[sf]\nkind = \"minimal\"\n"));
    assert!(text.starts_with("netsim.sf.kind: has no dedicated cells"), "{text}");
    assert!(text.ends_with("got \"minimal\" (nearest valid: \"msf\")"), "{text}");
    for (cell, key) in [
        ("from = 1, to = 0, shared = true", "shared"),
        ("from = \"any\", to = 0, shared = false", "shared"),
        ("from = 1, to = \"all\"", "from"),
    ] {
        let sf = format!(
            "[sf]\nkind = \"static\"\nslotframe_slots = 9\ncell = [{{ slot = 1, {cell} }}]\n"
        );
        let text = refused(&format!("{config}{sf}"));
        assert!(text.contains(&format!("netsim.sf.cell[0].{key}: must be")), "{text}");
    }
}
