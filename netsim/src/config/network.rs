//! The keys of `mode = "6tisch"`.

use super::profile::Profile;
use super::{admission, applications, energy, lowpan, mac, mobility, rpl, security, swarm};
use crate::app;
use crate::catalogue::Catalogue;
use crate::energy::Model;
use crate::mac::{blacklist, effect};
use crate::mote::addresses::Addresses;
use crate::mote::compat::Compat;
use crate::mote::settings::Settings;
use crate::sf;
use crate::sf::oracle::OracleConfig;
use crate::sixtop;
use crate::wire::Eui64;
use physics::timing::Airtime;
use proto::config::{Kind, Problem, Section, join};
use proto::ids::MoteId;
use proto::time::SimDuration;

/// What the checked table is read with.
pub(super) struct Given<'a> {
    /// The keys of the full network.
    pub(super) keys: &'a Keys,
    /// Its path, for problems.
    pub(super) path: &'a str,
    /// Capacity of the experiment.
    pub(super) agent_count: usize,
    /// Length of a slot.
    pub(super) slot: SimDuration,
    /// Channels by absolute slot number.
    pub(super) hopping_sequence: &'a [u8],
    /// How long frames are on the air.
    pub(super) airtime: Airtime,
    /// What there is to choose from.
    pub(super) catalogue: &'a Catalogue,
}

/// Keys of the full network.
#[derive(Section)]
pub(super) struct Keys {
    /// Settings that go together. Keys that are written have priority over them.
    #[key(default = Profile::Auto)]
    pub(super) profile: Profile,
    /// Motes that are roots, each of its own DODAG. Absent: mote 0.
    #[key(length = 1..=10_000)]
    pub(super) roots: Option<Vec<MoteId>>,
    /// Link-layer addresses of the first motes, as 02-00-00-00-00-00-00-05. Absent: 02-00-00-00-00-00-00-00 plus the mote's number,
    /// for mote 0 02-00-00-00-00-01-00-00.
    #[key(kind = Kind::List { of: &Kind::Text, min: 0, max: 100_000 })]
    eui64: Vec<String>,
    /// The MAC.
    #[key(table = mac::SPEC, default)]
    mac: toml::Table,
    /// The scheduling function.
    #[key(table = sf::SPEC, default)]
    pub(super) sf: toml::Table,
    /// Routing.
    #[key(table = rpl::SPEC, default)]
    rpl: toml::Table,
    /// Extensions of the standards for mobile motes.
    #[key(table = mobility::SPEC, default)]
    pub(super) mobility: toml::Table,
    /// Fragments.
    #[key(table = lowpan::SPEC, default)]
    lowpan: toml::Table,
    /// Admission.
    #[key(table = admission::SPEC, default)]
    pub(super) join: toml::Table,
    /// Security of frames and of admission. Absent: nothing is secured.
    #[key(table = security::SPEC)]
    security: Option<toml::Table>,
    /// Applications: packets that motes send in addition to the robots' payloads.
    #[key(tables = app::config::SPEC)]
    pub(super) app: Vec<toml::Table>,
    /// Transport of the robots' payloads.
    #[key(table = swarm::SPEC, default)]
    pub(super) swarm: toml::Table,
    /// Charge.
    #[key(table = energy::SPEC, default)]
    energy: toml::Table,
    /// Behaviour of other simulators, for comparisons.
    #[key(default)]
    compat: Compat,
}

/// Probability of a beacon in an idle cell under `compat.eb_rule`: that of the 6TiSCH simulator.
const BEACON_PROBABILITY: f64 = 0.33;

/// Makes the settings of the protocols, and the addresses. `None`: something is wrong, which `problems` says.
pub(super) fn build(
    given: &Given<'_>,
    problems: &mut Vec<Problem>,
    warnings: &mut Vec<String>,
) -> Option<(Settings, Addresses)> {
    let n_before = problems.len();
    let keys = given.keys;
    let key_path = |key: &str| join(given.path, key);
    let compat = keys.compat;
    let roots = roots(keys.roots.as_deref(), given, problems);
    let addresses = addresses(&keys.eui64, given, problems);

    let mac_path = key_path("mac");
    let sf_path = key_path("sf");
    let surroundings = mac::Surroundings {
        path: &mac_path,
        slot: given.slot,
        hopping_sequence: given.hopping_sequence,
        airtime: given.airtime,
        beacon_probability: compat.eb_rule.then_some(BEACON_PROBABILITY),
        contends_as_peer: compat.shared_slot_0,
        agent_count: given.agent_count,
        sf: (&keys.sf, &sf_path),
        catalogue: given.catalogue,
    };
    let (mut mac, effects) = mac::build(&keys.mac, &surroundings, problems);
    let burdens = effect::burdens(&effects, given.agent_count, &roots);
    let mut context = sf::BuildContext {
        path: &sf_path,
        agent_count: given.agent_count,
        n_channels: given.hopping_sequence.len() as u16,
        roots: &roots,
        shared_slot_0: compat.shared_slot_0,
        stores_routes: rpl::stores_routes(&keys.rpl),
        address: Eui64::of_mote,
        problems: Vec::new(),
        warnings: Vec::new(),
    };
    let function = given.catalogue.scheduling_functions.selected(&keys.sf, &sf::TAG);
    let scheduling = function.and_then(|function| (function.build)(&keys.sf, &mut context));
    problems.append(&mut context.problems);
    warnings.append(&mut context.warnings);
    if mac.blacklist.is_some() && scheduling.as_ref().is_some_and(|sf| !sf.has_dedicated_cells()) {
        let path = join(&mac_path, "blacklist");
        problems.push(blacklist::undedicated((&keys.sf, &sf_path), &path));
    }

    let swarm_path = key_path("swarm");
    let mut swarm = swarm::Given {
        path: &swarm_path,
        function,
        agent_count: given.agent_count,
        n_channels: given.hopping_sequence.len(),
        problems,
        warnings,
    };
    let transport = swarm::build(&keys.swarm, &mut swarm);
    let (energy, battery_mah, battery_deaths) =
        energy::build(&keys.energy, &key_path("energy"), given.airtime, problems);
    if given.airtime != Airtime::O_QPSK_2450 && !matches!(energy, Model::ByTime { .. }) {
        warnings.push(format!(
            "{}: the charges of this model are those of 2.4 GHz radios: set it to \"by-time\" with another phy.standard",
            key_path("energy.model")
        ));
    }
    let mut rpl = rpl::build(&keys.rpl, compat);
    let has_oracle = scheduling.as_ref().is_some_and(|sf| sf.as_kind::<OracleConfig>().is_some());
    let surroundings = applications::Surroundings {
        path: given.path,
        agent_count: given.agent_count,
        roots: &roots,
        has_routes_down: rpl.advertises,
        has_oracle,
    };
    let apps = applications::build(&keys.app, &surroundings, problems);
    let (mobility, handover) = mobility::build(&keys.mobility, given, &roots, problems);
    rpl.handover = handover;
    mac.pending_bit |= mobility.bursts;
    mac.bursts_beside_everyone = mobility.bursts;
    mac.scans_hopping = mobility.scan_hopping;
    let mut join = admission::build(&keys.join);
    join.security =
        security::build(keys.security.as_ref(), &key_path("security"), compat, problems);
    if join.secure && !rpl.advertises && roots.len() + 1 < given.agent_count {
        warnings.push(format!(
            "{}: without routes down the registrar's answers reach only motes that hear a root and join through it; \
             others, who ask through a join proxy, are never admitted: set {} = \
             false or {} = true",
            key_path("rpl.routes_down"),
            key_path("join.secure"),
            key_path("rpl.routes_down"),
        ));
    }
    if 1 < given.agent_count && mobility.leaves.len() + roots.len() == given.agent_count {
        let key = key_path("mobility.leaves");
        warnings.push(format!(
            "{key}: all motes but roots are leaves: only those that hear a root take part"
        ));
    }
    let (Some(sf), Some(addresses), true) = (scheduling, addresses, problems.len() == n_before)
    else {
        return None;
    };
    warnings.extend(sf.advice(&sf::Formation {
        path: &sf_path,
        n_motes: given.agent_count,
        n_roots: roots.len(),
        frames_per_mote: u32::from(join.secure) + u32::from(rpl.dao_ack),
        slot: given.slot,
    }));
    let sixtop = sixtop::Config {
        slotframe: given.slot * u64::from(sf.slotframe_slots()),
        max_retries: mac.max_retries.unwrap_or(u16::MAX),
        max_be: mac.max_exponent,
        ..sixtop::Config::default()
    };
    let queue_frames = mac.queue_capacity.unwrap_or(QUEUE_FRAMES);
    rpl.wait_for_dao_acks(u64::from(queue_frames) * sixtop.slotframe);
    let settings = Settings {
        roots,
        mac,
        burdens,
        sf,
        sixtop,
        rpl,
        lowpan: lowpan::build(&keys.lowpan),
        join,
        apps,
        transport,
        mobility,
        energy,
        battery_mah,
        battery_deaths,
        compat,
    };
    if !has_oracle {
        applications::warn_of_queues(&settings, given.path, warnings);
    }
    Some((settings, addresses))
}

/// Frames that wait before an acknowledgment where queues have no limit.
const QUEUE_FRAMES: u16 = 10;

fn roots(listed: Option<&[MoteId]>, given: &Given<'_>, problems: &mut Vec<Problem>) -> Vec<MoteId> {
    let Some(listed) = listed else { return vec![MoteId(0)] };
    let mut roots = Vec::new();
    for (index, &mote) in listed.iter().enumerate() {
        let path = join(given.path, &format!("roots[{index}]"));
        if given.agent_count <= mote.index() {
            let last = given.agent_count - 1;
            let message = format!("must be the number of a mote, 0 to {last}");
            problems.push(Problem::new(path, message).value(mote).nearest(last));
        } else if roots.contains(&mote) {
            problems.push(Problem::new(path, "must not be listed twice").value(mote));
        } else {
            roots.push(mote);
        }
    }
    roots.sort_unstable();
    roots
}

fn addresses(
    listed: &[String],
    given: &Given<'_>,
    problems: &mut Vec<Problem>,
) -> Option<Addresses> {
    let mut addresses = Vec::new();
    for (index, text) in listed.iter().enumerate() {
        let octets: Vec<&str> = text.split('-').collect();
        let is_well_formed = octets.len() == 8 && octets.iter().all(|octet| octet.len() == 2);
        match u64::from_str_radix(&octets.concat(), 16) {
            Ok(number) if is_well_formed => addresses.push(Eui64(number)),
            _ => problems.push(
                Problem::new(
                    join(given.path, &format!("eui64[{index}]")),
                    "must be eight octets of two hexadecimal digits each, as in 02-00-00-00-00-00-00-05",
                )
                .value(format!("{text:?}")),
            ),
        }
    }
    match Addresses::new(given.agent_count, &addresses) {
        Ok(addresses) => Some(addresses),
        Err(twice) => {
            let [first, second] = twice.motes;
            let message = format!("motes {first} and {second} must not have the same address");
            problems.push(
                Problem::new(join(given.path, "eui64"), message).value(twice.address.to_string()),
            );
            None
        }
    }
}
