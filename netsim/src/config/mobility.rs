//! `[netsim.mobility]`.

use super::network::Given;
use crate::mote::settings::Mobility;
use crate::rpl::Handover;
use proto::config::{Problem, Section, TableSpec, join};
use proto::ids::MoteId;
use proto::time::SimDuration;

/// Description of `[netsim.mobility]`.
pub(super) const SPEC: TableSpec = Keys::SPEC;

/// Extensions of the standards for mobile motes. All are off by default.
#[derive(Section)]
struct Keys {
    /// Motes that take part in routing as leaves (RFC 6550, § 8.5): other motes neither route nor join through them. For mobile
    /// motes among stationary routers.
    #[key(length = 0..=100_000)]
    leaves: Vec<MoteId>,
    /// Whether a mote synchronises to the beacons of every neighbour that is nearer to the root than itself, not of its time source
    /// alone: it then loses synchronisation only if it hears no such neighbour.
    #[key(default = false)]
    time_from_beacons: bool,
    /// Whether the join metric of a beacon, the rank of its sender in whole hops (RFC 8180, § 6.1), counts as a DIO: a mote then
    /// chooses its parent by the latest beacons, and changes to any neighbour that is a hop better.
    #[key(default = false)]
    rank_from_beacons: bool,
    /// A neighbour whose RSSI will be below this (dBm) within handover_s, according to the trend of its beacons, counts as a hop
    /// farther from the root, so a mote leaves a parent before the link breaks (as in mRPL and MobiRPL). Requires
    /// rank_from_beacons. Absent: signal strength decides between equal ranks only.
    #[key(range = -200.0..=100.0)]
    handover_dbm: Option<f64>,
    /// How far ahead that trend is followed (s); without handover_dbm it has no influence.
    #[key(range = 0.0..=60.0, default = 2.0)]
    handover_s: f64,
    /// Whether datagrams that wait for a former parent go to the new one, and one that a neighbour does not acknowledge is sent on
    /// another way: up through the present parent, or back to the root if its source route has failed (packet salvaging, as in DSR:
    /// RFC 4728, § 3.4.1).
    #[key(default = false)]
    reroute: bool,
    /// Whether a mote sends further frames to the same neighbour in the following slots (as mac.pending_bit), including shared
    /// slots and slots in which motes of rrsf or sotdma only listen. It uses the channel of the first frame.
    #[key(default = false)]
    bursts: bool,
    /// Whether a mote that has lost synchronisation scans the channel of channel offset 0 in each slot, not one channel for
    /// mac.scan_dwell_s: its clock still gives the slot number for 62 s (at 40 ppm and 10 ms). It then hears the next beacon in
    /// range, not one in sixteen. Beacons of orchestra with another sf.eb_channel are heard only after that time.
    #[key(default = false)]
    scan_hopping: bool,
    /// Whether a mote that has lost synchronisation keeps what the registrar gave it, and takes part again as soon as it hears a
    /// beacon. RFC 9031 leaves that open.
    #[key(default = false)]
    keep_admission: bool,
}

/// Makes the settings of the checked table: of motes, and of routing.
pub(super) fn build(
    table: &toml::Table,
    given: &Given<'_>,
    roots: &[MoteId],
    problems: &mut Vec<Problem>,
) -> (Mobility, Option<Handover>) {
    let keys = Keys::read(table);
    let path = join(given.path, "mobility");
    for (index, &mote) in keys.leaves.iter().enumerate() {
        let path = join(&path, &format!("leaves[{index}]"));
        if given.agent_count <= mote.index() {
            let last = given.agent_count - 1;
            let message = format!("must be the number of a mote, 0 to {last}");
            problems.push(Problem::new(path, message).value(mote).nearest(last));
        } else if roots.contains(&mote) {
            problems.push(Problem::new(path, "must not be a root").value(mote));
        }
    }
    if keys.handover_dbm.is_some() && !keys.rank_from_beacons {
        let path = join(&path, "handover_dbm");
        problems.push(Problem::new(path, "requires rank_from_beacons = true"));
    }
    let mut leaves = keys.leaves;
    leaves.sort_unstable();
    leaves.dedup();
    let mobility = Mobility {
        leaves,
        time_from_beacons: keys.time_from_beacons,
        reroute: keys.reroute,
        bursts: keys.bursts,
        scan_hopping: keys.scan_hopping,
        keep_admission: keys.keep_admission,
    };
    let handover = keys.rank_from_beacons.then(|| Handover {
        // Thousandths, so that settings can be compared.
        least_mdbm: keys.handover_dbm.map(|dbm| (dbm * 1e3).round() as i32),
        ahead: SimDuration::from_seconds(keys.handover_s),
    });
    (mobility, handover)
}
