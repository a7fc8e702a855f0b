//! `[netsim.mac]`.

use crate::catalogue::Catalogue;
use crate::mac::tsch::Config;
use crate::mac::{blacklist, effect};
use crate::medium::slot::timing::Airtime;
use proto::config::{Default, Field, Kind, Problem, Range, TableSpec, join, typed};
use proto::types::NS_PER_S;
use serde::Deserialize;

/// Description of `[netsim.mac]`.
pub(super) const SPEC: TableSpec = TableSpec {
    doc: "Time-slotted channel hopping (IEEE Std 802.15.4-2015, RFC 8180).",
    fields: &[
        Field {
            key: "queue_frames",
            doc: "Capacity of a mote's transmit queue (frames); 0: unlimited. 10: the 6TiSCH simulator's.",
            kind: Kind::Integer { min: 0, max: 10_000 },
            default: Default::Integer(10),
        },
        Field {
            key: "max_retries",
            doc: "Maximum number of retransmissions of an unacknowledged frame (macMaxFrameRetries). 5: the 6TiSCH \
                  simulator's; IEEE Std 802.15.4-2015 allows 0 to 7 and has 3.",
            kind: Kind::Integer { min: 0, max: 1000 },
            default: Default::Integer(5),
        },
        Field {
            key: "min_backoff_exponent",
            doc: "Minimum back-off exponent: after the first failure a mote waits 0 to 2^this - 1 shared cells (macMinBe).",
            kind: Kind::Integer { min: 0, max: 8 },
            default: Default::Integer(1),
        },
        Field {
            key: "max_backoff_exponent",
            doc: "Maximum back-off exponent: after many failures a mote waits 0 to 2^this - 1 shared cells (macMaxBe).",
            kind: Kind::Integer { min: 3, max: 8 },
            default: Default::Integer(7),
        },
        Field {
            key: "beacon_period_s",
            doc: "Mean time between a mote's beacons (s), jittered by a quarter. 16: as in Contiki-NG.",
            kind: Kind::Number(Range::closed(0.01, 1e5)),
            default: Default::Number(16.0),
        },
        Field {
            key: "beacon_spacing_s",
            doc: "Minimum mean interval (s) between the beacons of all motes in range of each other; in dense networks \
                  each mote sends fewer. 3: a third of the cells of a slotframe of 101 slots of 10 ms.",
            kind: Kind::Number(Range::closed(0.0, 1e5)),
            default: Default::Number(3.0),
        },
        Field {
            key: "beacon_wait_s",
            doc: "Time that a joining mote waits for further beacons after the first (s): MAX_EB_DELAY of RFC 8180, § 6.2.",
            kind: Kind::Number(Range::closed(0.0, 1e5)),
            default: Default::Number(180.0),
        },
        Field {
            key: "rejoin_wait_s",
            doc: "The same wait (s) for a mote that rejoins after a loss of synchronisation, at most beacon_wait_s. RFC \
                  8180, § 6.2, has an upper limit only; Contiki-NG and OpenWSN follow the first beacon. 16: one beacon \
                  period.",
            kind: Kind::Number(Range::closed(0.0, 1e5)),
            default: Default::Number(16.0),
        },
        Field {
            key: "neighbours_to_wait",
            doc: "Number of neighbours whose beacons end this wait: NUM_NEIGHBOURS_TO_WAIT of RFC 8180, § 6.2.",
            kind: Kind::Integer { min: 1, max: 1000 },
            default: Default::Integer(2),
        },
        Field {
            key: "scan_dwell_s",
            doc: "Time that a joining mote listens on a channel before it switches to another (s). 1: as in TSCH-Sim.",
            kind: Kind::Number(Range::closed(1e-6, 1e5)),
            default: Default::Number(1.0),
        },
        Field {
            key: "keep_alive_s",
            doc: "Keep-alive interval (s): a mote that has not heard its time source for this long sends it a frame. 0: no \
                  keep-alives, and no mote loses synchronisation; requires max_drift_ppm = 0. 10: the 6TiSCH simulator's.",
            kind: Kind::Number(Range::closed(0.0, 1e5)),
            default: Default::Number(10.0),
        },
        Field {
            key: "desynchronise_s",
            doc: "Synchronisation timeout (s): a mote that has not heard its time source for this long scans for beacons; \
                  one that has estimated its clock's drift waits longer (max_keep_alive_s, max_free_run_s). 17.5: clocks of \
                  30 ppm in opposite directions are then off by the guard time, 1.1 ms.",
            kind: Kind::Number(Range::above(0.0, 1e6)),
            default: Default::Number(17.5),
        },
        Field {
            key: "adaptive_synchronization",
            doc: "Whether a mote estimates its clock's drift relative to its time source, compensates for it, and sends \
                  keep-alives less often if the corrected clock stays accurate for longer (Chang et al., Computer Networks \
                  76, 2015, as in Contiki-NG and OpenWSN). Off with compat.shared_slot_0.",
            kind: Kind::Bool,
            default: Default::Bool(true),
        },
        Field {
            key: "max_keep_alive_s",
            doc: "Maximum keep-alive interval (s) with adaptive_synchronization; the synchronisation timeout grows in \
                  proportion. Less than keep_alive_s: keep_alive_s. 30: half of Contiki-NG's, so that a mote notices within a \
                  minute that its time source is gone.",
            kind: Kind::Number(Range::closed(0.0, 1e5)),
            default: Default::Number(30.0),
        },
        Field {
            key: "max_free_run_s",
            doc: "Maximum time (s) that a mote without a parent keeps time by its own clock, with adaptive_synchronization: \
                  it scans once its clock's estimated error is too large, at the earliest after desynchronise_s. 300: after \
                  a shorter outage of the root, its motes are still synchronised.",
            kind: Kind::Number(Range::closed(0.0, 1e5)),
            default: Default::Number(300.0),
        },
        Field {
            key: "max_drift_ppm",
            doc: "Maximum clock drift (ppm); each mote's drift is uniform up to it. 0: exact clocks; corrections are still \
                  rounded to a tick of mac.crystal_hz.",
            kind: Kind::Number(Range::closed(0.0, 1e4)),
            default: Default::Number(30.0),
        },
        Field {
            key: "crystal_hz",
            doc: "Clock resolution at resynchronisation (Hz).",
            kind: Kind::Integer { min: 1000, max: 1_000_000_000 },
            default: Default::Integer(32_768),
        },
        Field {
            key: "pending_bit",
            doc: "Whether a frame announces that another one to the same neighbour follows in the next slot, if it is free \
                  (burst transmission).",
            kind: Kind::Bool,
            default: Default::Bool(false),
        },
        Field {
            key: "blacklist",
            doc: "Channel blacklisting: per link, channels on which frames are lost are skipped in dedicated cells.",
            kind: Kind::Table(&blacklist::SPEC),
            default: Default::Table,
        },
        Field {
            key: "effect",
            doc: "Effects on the behaviour of motes; `murmuration effects` lists them.",
            kind: Kind::Tables(&effect::SPEC),
            default: Default::Absent,
        },
    ],
    tag: None,
};

/// Keys of `[netsim.mac]`.
#[derive(Deserialize)]
struct Keys {
    queue_frames: u16,
    max_retries: u16,
    min_backoff_exponent: u8,
    max_backoff_exponent: u8,
    beacon_period_s: f64,
    beacon_spacing_s: f64,
    beacon_wait_s: f64,
    rejoin_wait_s: f64,
    neighbours_to_wait: u16,
    scan_dwell_s: f64,
    keep_alive_s: f64,
    desynchronise_s: f64,
    adaptive_synchronization: bool,
    max_keep_alive_s: f64,
    max_free_run_s: f64,
    max_drift_ppm: f64,
    crystal_hz: u32,
    pending_bit: bool,
    blacklist: toml::Table,
    #[serde(default)]
    effect: Vec<toml::Table>,
}

/// What the table is read with.
pub(super) struct Surroundings<'a> {
    /// Its path, for problems.
    pub(super) path: &'a str,
    /// Length of a slot (ns).
    pub(super) slot_ns: u64,
    /// Channels by absolute slot number.
    pub(super) hopping_sequence: &'a [u8],
    /// How long frames are on the air.
    pub(super) airtime: Airtime,
    /// Probability of a beacon in an idle cell, where that decides.
    pub(super) beacon_probability: Option<f64>,
    /// Whether motes contend as in the 6TiSCH simulator.
    pub(super) contends_as_peer: bool,
    /// Capacity of the experiment.
    pub(super) agent_count: usize,
    /// The checked table of the scheduling function, and its path.
    pub(super) sf: (&'a toml::Table, &'a str),
    /// What there is to choose from.
    pub(super) catalogue: &'a Catalogue,
}

/// Makes the MAC's settings of the checked table, and the effects on what motes do.
pub(super) fn build(
    table: &toml::Table,
    given: &Surroundings<'_>,
    problems: &mut Vec<Problem>,
) -> (Config, Vec<Box<dyn effect::Effect>>) {
    let keys: Keys = typed(table);
    let path = given.path;
    let ns = |duration_s: f64| (duration_s * NS_PER_S as f64).round() as u64;
    let (min, max) = (keys.min_backoff_exponent, keys.max_backoff_exponent);
    if max < min {
        problems.push(
            Problem::new(
                join(path, "min_backoff_exponent"),
                format!("must not exceed max_backoff_exponent, {max}"),
            )
            .value(min)
            .nearest(max),
        );
    }
    let keep_alive_ns = ns(keys.keep_alive_s);
    let desynchronise_ns = ns(keys.desynchronise_s);
    let is_time_kept = keep_alive_ns != 0;
    if is_time_kept && desynchronise_ns <= keep_alive_ns {
        problems.push(
            Problem::new(
                join(path, "desynchronise_s"),
                format!("must exceed keep_alive_s, {} s", keys.keep_alive_s),
            )
            .value(keys.desynchronise_s)
            .nearest(keys.keep_alive_s * 1.75),
        );
    }
    // Nobody would put those clocks right, or notice how far off they are: motes would fall deaf for good.
    if !is_time_kept && keys.max_drift_ppm != 0.0 {
        problems.push(
            Problem::new(
                join(path, "max_drift_ppm"),
                "must be 0 with keep_alive_s = 0, because drifting clocks must be resynchronised",
            )
            .value(keys.max_drift_ppm)
            .nearest(0.0),
        );
    }
    let effects = effect::build(
        &keys.effect,
        &join(path, "effect"),
        given.agent_count,
        is_time_kept,
        &given.catalogue.mac_effects,
        problems,
    );
    let blacklist = blacklist::build(
        &keys.blacklist,
        &join(path, "blacklist"),
        given.hopping_sequence,
        given.sf,
        &given.catalogue.blacklists,
        problems,
    );
    let config = Config {
        slot_ns: given.slot_ns,
        hopping_sequence: given.hopping_sequence.to_vec(),
        airtime: given.airtime,
        blacklist,
        queue_capacity: Some(keys.queue_frames).filter(|&frames| frames != 0),
        max_retries: Some(keys.max_retries),
        min_exponent: min,
        max_exponent: max,
        beacon_period_ns: ns(keys.beacon_period_s),
        beacon_spacing_ns: ns(keys.beacon_spacing_s),
        beacon_probability: given.beacon_probability,
        contends_as_peer: given.contends_as_peer,
        beacon_wait_ns: ns(keys.beacon_wait_s),
        rejoin_wait_ns: ns(keys.rejoin_wait_s.min(keys.beacon_wait_s)),
        neighbours_to_wait: keys.neighbours_to_wait,
        scan_dwell_slots: (ns(keys.scan_dwell_s) / given.slot_ns.max(1))
            .clamp(1, u64::from(u32::MAX)) as u32,
        keep_alive_ns,
        desynchronise_ns,
        max_keep_alive_ns: (keys.adaptive_synchronization && !given.contends_as_peer)
            .then(|| ns(keys.max_keep_alive_s).max(keep_alive_ns)),
        max_free_run_ns: ns(keys.max_free_run_s),
        max_drift_ppm: keys.max_drift_ppm,
        crystal_hz: keys.crystal_hz,
        pending_bit: keys.pending_bit,
        bursts_beside_everyone: false,
        scans_hopping: false,
    };
    (config, effects)
}
