//! `[[netsim.app]]` beside the rest of the network: what applications need of it.

use crate::app::{Spec, config::Largest};
use crate::lowpan::parts_of;
use crate::mote::down::HOP_LIMIT;
use crate::mote::settings::Settings;
use crate::wire::Eui64;
use crate::wire::datagram::{Datagram, Upper};
use crate::wire::security::FrameSecurity;
use proto::config::{Problem, join};
use proto::ids::MoteId;
use std::sync::Arc;

/// What exchanges between the first root and motes need.
pub(super) struct Surroundings<'a> {
    /// Path of `[netsim]`.
    pub(super) path: &'a str,
    /// Motes in the network.
    pub(super) agent_count: usize,
    /// Motes that are roots, ascending.
    pub(super) roots: &'a [MoteId],
    /// Whether routes down exist.
    pub(super) has_routes_down: bool,
    /// Whether packets are carried by the oracle.
    pub(super) has_oracle: bool,
}

/// Reads the applications. Those that something is wrong with are left out.
pub(super) fn build(
    tables: &[toml::Table],
    given: &Surroundings<'_>,
    problems: &mut Vec<Problem>,
) -> Vec<Spec> {
    let mut apps = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let path = join(given.path, &format!("app[{index}]"));
        if let Some(spec) = Spec::read(table, &path, given.agent_count as u32, problems) {
            check_exchanges(&spec, &path, given, problems);
            apps.push(spec);
        }
    }
    apps
}

/// Exchanges between the first root and motes need ways in both directions, and two ends.
fn check_exchanges(spec: &Spec, path: &str, given: &Surroundings<'_>, problems: &mut Vec<Problem>) {
    let kind = join(path, "kind");
    if spec.is_coap() && !given.has_routes_down {
        let key = join(given.path, "rpl.routes_down");
        let message = format!("needs routes from the root to motes: set {key} = true");
        problems.push(Problem::new(kind, message));
    } else if spec.is_coap() && given.has_oracle {
        let key = join(given.path, "sf.kind");
        let message =
            format!("needs another {key} than \"oracle\", which carries one-way packets only");
        problems.push(Problem::new(kind, message));
    }
    let ends = spec.other_ends();
    let mut listed: Vec<MoteId> = ends.iter().map(|(_, mote)| *mote).collect();
    listed.extend(given.roots.first());
    listed.sort_unstable();
    let mut before = Vec::new();
    for (key, mote) in ends {
        let message = if given.roots.first() == Some(&mote) {
            "must not be the first root, which is the other end of the exchange"
        } else if before.contains(&mote) {
            "must not be listed twice"
        } else {
            before.push(mote);
            continue;
        };
        let problem = Problem::new(join(path, &key), message).value(mote);
        let free =
            MoteId::first(given.agent_count).filter(|mote| listed.binary_search(mote).is_err());
        problems.push(match free.min_by_key(|free| free.0.abs_diff(mote.0)) {
            Some(nearest) => problem.nearest(nearest),
            None => problem,
        });
    }
}

/// Warns of applications whose datagrams never fit into a queue: their frames enter it together.
pub(super) fn warn_of_queues(settings: &Settings, path: &str, warnings: &mut Vec<String>) {
    let Some(capacity) = settings.mac.queue_capacity else { return };
    for (index, spec) in settings.apps.iter().enumerate() {
        let largest = spec.largest();
        let n_frames = least_frames(settings, &largest);
        if n_frames <= usize::from(capacity) {
            continue;
        }
        let key = join(path, &format!("app[{index}].{}", largest.key));
        let queue = join(path, "mac.queue_frames");
        warnings.push(format!(
            "{key} = {}: a datagram takes at least {n_frames} frames, more than a queue of {queue} = {capacity} holds, so \
             that none arrives: set a smaller {}, or {queue} to 0 or at least {n_frames}",
            largest.value, largest.key,
        ));
    }
}

/// Frames of the largest datagram of an application to a neighbour, without headers of routing: no way takes fewer.
fn least_frames(settings: &Settings, largest: &Largest) -> usize {
    let [own, to] = [1, 2].map(MoteId).map(Eui64::of_mote);
    let datagram = Datagram {
        packet: 0,
        source: own.global(),
        destination: to.global(),
        dscp: 0,
        hop_limit: HOP_LIMIT,
        rpi: None,
        route: None,
        upper: Upper::Udp(largest.packet.udp()),
    };
    let security = if settings.is_secured() { FrameSecurity::K2 } else { FrameSecurity::Unsecured };
    let room = settings.room(&datagram, Some(to), security);
    parts_of(Arc::new(datagram), 0, own, Some(to), room).map_or(0, |parts| parts.len())
}
