//! `[netsim.mac]`.

use crate::catalogue::Catalogue;
use crate::mac::tsch::Config;
use crate::mac::{blacklist, effect};
use physics::timing::Airtime;
use proto::config::{Problem, Section, TableSpec, join};
use proto::time::SimDuration;

/// Description of `[netsim.mac]`.
pub(super) const SPEC: TableSpec = Keys::SPEC;

/// Time-slotted channel hopping (IEEE Std 802.15.4-2015, RFC 8180).
#[derive(Section)]
struct Keys {
    /// Capacity of a mote's transmit queue (frames); 0: unlimited. 10: the 6TiSCH simulator's.
    #[key(range = 0..=10_000, default = 10)]
    queue_frames: u16,
    /// Maximum number of retransmissions of an unacknowledged frame (macMaxFrameRetries). 5: the 6TiSCH simulator's; IEEE Std
    /// 802.15.4-2015 allows 0 to 7 and has 3.
    #[key(range = 0..=1000, default = 5)]
    max_retries: u16,
    /// Minimum back-off exponent: after the first failure a mote waits 0 to 2^this - 1 shared cells (macMinBe).
    #[key(range = 0..=8, default = 1)]
    min_backoff_exponent: u8,
    /// Maximum back-off exponent: after many failures a mote waits 0 to 2^this - 1 shared cells (macMaxBe).
    #[key(range = 3..=8, default = 7)]
    max_backoff_exponent: u8,
    /// Mean time between a mote's beacons (s), jittered by a quarter. 16: as in Contiki-NG.
    #[key(range = 0.01..=1e5, default = 16.0)]
    beacon_period_s: f64,
    /// Minimum mean interval (s) between the beacons of all motes in range of each other; in dense networks each mote sends fewer.
    /// 3: a third of the cells of a slotframe of 101 slots of 10 ms.
    #[key(range = 0.0..=1e5, default = 3.0)]
    beacon_spacing_s: f64,
    /// Time that a joining mote waits for further beacons after the first (s): MAX_EB_DELAY of RFC 8180, § 6.2.
    #[key(range = 0.0..=1e5, default = 180.0)]
    beacon_wait_s: f64,
    /// The same wait (s) for a mote that rejoins after a loss of synchronisation, at most beacon_wait_s. RFC 8180, § 6.2, has an
    /// upper limit only; Contiki-NG and OpenWSN follow the first beacon. 16: one beacon period.
    #[key(range = 0.0..=1e5, default = 16.0)]
    rejoin_wait_s: f64,
    /// Number of neighbours whose beacons end this wait: NUM_NEIGHBOURS_TO_WAIT of RFC 8180, § 6.2.
    #[key(range = 1..=1000, default = 2)]
    neighbours_to_wait: u16,
    /// Time that a joining mote listens on a channel before it switches to another (s). 1: as in TSCH-Sim.
    #[key(range = 1e-6..=1e5, default = 1.0)]
    scan_dwell_s: f64,
    /// Keep-alive interval (s): a mote that has not heard its time source for this long sends it a frame. 0: no keep-alives, and no
    /// mote loses synchronisation; requires max_drift_ppm = 0. 10: the 6TiSCH simulator's.
    #[key(range = 0.0..=1e5, default = 10.0)]
    keep_alive_s: f64,
    /// Synchronisation timeout (s): a mote that has not heard its time source for this long scans for beacons; one that has
    /// estimated its clock's drift waits longer (max_keep_alive_s, max_free_run_s). 17.5: clocks of 30 ppm in opposite directions
    /// are then off by the guard time, 1.1 ms.
    #[key(above = 0.0, most = 1e6, default = 17.5)]
    desynchronise_s: f64,
    /// Whether a mote estimates its clock's drift relative to its time source, compensates for it, and sends keep-alives less often
    /// if the corrected clock stays accurate for longer (Chang et al., Computer Networks 76, 2015, as in Contiki-NG and OpenWSN).
    /// Off with compat.shared_slot_0.
    #[key(default = true)]
    adaptive_synchronization: bool,
    /// Maximum keep-alive interval (s) with adaptive_synchronization; the synchronisation timeout grows in proportion. Less than
    /// keep_alive_s: keep_alive_s. 30: half of Contiki-NG's, so that a mote notices within a minute that its time source is gone.
    #[key(range = 0.0..=1e5, default = 30.0)]
    max_keep_alive_s: f64,
    /// Maximum time (s) that a mote without a parent keeps time by its own clock, with adaptive_synchronization: it scans once its
    /// clock's estimated error is too large, at the earliest after desynchronise_s. 300: after a shorter outage of the root, its
    /// motes are still synchronised.
    #[key(range = 0.0..=1e5, default = 300.0)]
    max_free_run_s: f64,
    /// Maximum clock drift (ppm); each mote's drift is uniform up to it. 0: exact clocks; corrections are still rounded to a tick
    /// of mac.crystal_hz.
    #[key(range = 0.0..=1e4, default = 30.0)]
    max_drift_ppm: f64,
    /// Clock resolution at resynchronisation (Hz).
    #[key(range = 1000..=1_000_000_000, default = 32_768)]
    crystal_hz: u32,
    /// Whether a frame announces that another one to the same neighbour follows in the next slot, if it is free (burst
    /// transmission).
    #[key(default = false)]
    pending_bit: bool,
    /// Channel blacklisting: per link, channels on which frames are lost are skipped in dedicated cells.
    #[key(table = blacklist::SPEC, default)]
    blacklist: toml::Table,
    /// Effects on the behaviour of motes; `murmuration effects` lists them.
    #[key(tables = effect::SPEC)]
    effect: Vec<toml::Table>,
}

/// What the table is read with.
pub(super) struct Surroundings<'a> {
    /// Its path, for problems.
    pub(super) path: &'a str,
    /// Length of a slot.
    pub(super) slot: SimDuration,
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
    let keys = Keys::read(table);
    let path = given.path;
    let duration = SimDuration::from_seconds;
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
    let keep_alive = duration(keys.keep_alive_s);
    let desynchronise = duration(keys.desynchronise_s);
    let is_time_kept = !keep_alive.is_zero();
    if is_time_kept && desynchronise <= keep_alive {
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
        slot: given.slot,
        hopping_sequence: given.hopping_sequence.to_vec(),
        airtime: given.airtime,
        blacklist,
        queue_capacity: Some(keys.queue_frames).filter(|&frames| frames != 0),
        max_retries: Some(keys.max_retries),
        min_exponent: min,
        max_exponent: max,
        beacon_period: duration(keys.beacon_period_s),
        beacon_spacing: duration(keys.beacon_spacing_s),
        beacon_probability: given.beacon_probability,
        contends_as_peer: given.contends_as_peer,
        beacon_wait: duration(keys.beacon_wait_s),
        rejoin_wait: duration(keys.rejoin_wait_s.min(keys.beacon_wait_s)),
        neighbours_to_wait: keys.neighbours_to_wait,
        scan_dwell_slots: (duration(keys.scan_dwell_s) / given.slot.max(SimDuration::from_ns(1)))
            .clamp(1, u64::from(u32::MAX)) as u32,
        keep_alive,
        desynchronise,
        max_keep_alive: (keys.adaptive_synchronization && !given.contends_as_peer)
            .then(|| duration(keys.max_keep_alive_s).max(keep_alive)),
        max_free_run: duration(keys.max_free_run_s),
        max_drift_ppm: keys.max_drift_ppm,
        crystal_hz: keys.crystal_hz,
        pending_bit: keys.pending_bit,
        bursts_beside_everyone: false,
        scans_hopping: false,
    };
    (config, effects)
}
