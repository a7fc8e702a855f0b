//! The keys of `mode = "6tisch"`.

use super::{admission, compat, energy, lowpan, mac, rpl, swarm};
use crate::app;
use crate::mac::{effect, tsch};
use crate::medium::slot::timing;
use crate::mesh::addresses::Addresses;
use crate::mesh::settings::Settings;
use crate::sf;
use crate::sixtop;
use crate::wire::Eui64;
use proto::config::{Default, Field, Kind, Problem, join};
use proto::types::seconds;

/// Keys of the full network.
pub(super) const FIELDS: &[Field] = &[
    Field {
        key: "roots",
        doc: "Motes that are roots, each of a DODAG of its own. Absent: mote 0.",
        kind: Kind::List {
            of: &Kind::Integer { min: 0, max: u32::MAX as i64 },
            min: 1,
            max: 10_000,
        },
        default: Default::Absent,
    },
    Field {
        key: "eui64",
        doc: "Link-layer addresses of the first motes, as 02-00-00-00-00-00-00-05. Absent: 02-00-00-00-00-00-00-00 plus the \
              mote's number, for mote 0 02-00-00-00-00-01-00-00.",
        kind: Kind::List { of: &Kind::Text, min: 0, max: 100_000 },
        default: Default::Absent,
    },
    Field { key: "mac", doc: "The MAC.", kind: Kind::Table(&mac::SPEC), default: Default::Table },
    Field {
        key: "sf",
        doc: "The scheduling function.",
        kind: Kind::Table(&sf::SPEC),
        default: Default::Table,
    },
    Field { key: "rpl", doc: "Routing.", kind: Kind::Table(&rpl::SPEC), default: Default::Table },
    Field {
        key: "lowpan",
        doc: "Fragments.",
        kind: Kind::Table(&lowpan::SPEC),
        default: Default::Table,
    },
    Field {
        key: "join",
        doc: "Admission.",
        kind: Kind::Table(&admission::SPEC),
        default: Default::Table,
    },
    Field {
        key: "app",
        doc: "What motes send beside the robots' payloads.",
        kind: Kind::Tables(&app::config::SPEC),
        default: Default::Absent,
    },
    Field {
        key: "swarm",
        doc: "The robots' payloads.",
        kind: Kind::Table(&swarm::SPEC),
        default: Default::Table,
    },
    Field {
        key: "energy",
        doc: "Charge.",
        kind: Kind::Table(&energy::SPEC),
        default: Default::Table,
    },
    Field {
        key: "compat",
        doc: "Behaviour of the peers, for comparisons.",
        kind: Kind::Table(&compat::SPEC),
        default: Default::Table,
    },
];

/// What the checked table is read with.
pub(super) struct Given<'a> {
    /// The table of `[netsim]`.
    pub(super) table: &'a toml::Table,
    /// Its path, for problems.
    pub(super) path: &'a str,
    /// Capacity of the experiment.
    pub(super) agent_count: usize,
    /// Length of a slot (ns).
    pub(super) slot_ns: u64,
    /// Channels by absolute slot number.
    pub(super) hopping_sequence: &'a [u8],
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
    let empty = toml::Table::new();
    let section =
        |key: &str| given.table.get(key).and_then(toml::Value::as_table).unwrap_or(&empty);
    let at = |key: &str| join(given.path, key);
    let compat = compat::build(section("compat"));
    let roots = roots(given, problems);
    let addresses = addresses(given, problems);

    let probability = compat.eb_rule.then_some(BEACON_PROBABILITY);
    let mac_path = at("mac");
    let mac = mac::build(
        section("mac"),
        &mac_path,
        given.slot_ns,
        given.hopping_sequence,
        probability,
        problems,
    );
    let listed = section("mac").get("effect").and_then(toml::Value::as_array);
    let effects = listed.map_or_else(Vec::new, |list| {
        let is_time_kept = mac.keep_alive_ns != 0;
        effect::build(list, &join(&mac_path, "effect"), given.agent_count, is_time_kept, problems)
    });
    let burdens = effect::burdens(&effects, given.agent_count, &roots);
    let mac = tsch::Config { contends_as_peer: compat.shared_slot_0, ..mac };
    let sf_path = at("sf");
    let mut context = sf::BuildContext {
        path: &sf_path,
        agent_count: given.agent_count,
        n_channels: given.hopping_sequence.len() as u16,
        roots: &roots,
        shared_slot_0: compat.shared_slot_0,
        address: Eui64::of_mote,
        problems: Vec::new(),
        warnings: Vec::new(),
    };
    let scheduling = sf::build(section("sf"), &mut context);
    problems.append(&mut context.problems);
    warnings.append(&mut context.warnings);

    let swarm_path = at("swarm");
    let mut swarm = swarm::Given {
        path: &swarm_path,
        sf: section("sf").get("kind").and_then(toml::Value::as_str),
        agent_count: given.agent_count,
        n_channels: given.hopping_sequence.len(),
        problems,
        warnings,
    };
    let transport = swarm::build(section("swarm"), &mut swarm);
    let mut apps = Vec::new();
    let listed = given.table.get("app").and_then(toml::Value::as_array);
    for (index, table) in listed.into_iter().flatten().enumerate() {
        let path = at(&format!("app[{index}]"));
        let Some(table) = table.as_table() else { continue };
        apps.extend(app::Spec::read(table, &path, given.agent_count as u32, problems));
    }
    let (energy, battery_mah) = energy::build(section("energy"));
    let rpl = rpl::build(section("rpl"), compat);
    let join = admission::build(section("join"));
    if join.secure && !rpl.advertises && roots.len() + 1 < given.agent_count {
        warnings.push(format!(
            "{}: without routes down the registrar's answers reach only motes that hear a root and join through it; \
             others, who ask through a join proxy, are never admitted: set {} = \
             false or {} = true",
            at("rpl.routes_down"),
            at("join.secure"),
            at("rpl.routes_down"),
        ));
    }
    let (Some(sf), Some(addresses), true) = (scheduling, addresses, problems.len() == n_before)
    else {
        return None;
    };
    let sixtop = sixtop::Config {
        slotframe_ns: u64::from(sf.slotframe_slots()) * given.slot_ns,
        max_retries: mac.max_retries.unwrap_or(u16::MAX),
        max_be: mac.max_exponent,
        ..sixtop::Config::default()
    };
    let settings = Settings {
        roots,
        mac,
        burdens,
        sf,
        sixtop,
        rpl,
        lowpan: lowpan::build(section("lowpan")),
        join,
        apps,
        transport,
        energy,
        battery_mah,
        compat,
    };
    warnings.extend(slow_round_robin(&settings, given));
    Some((settings, addresses))
}

/// From the begin of a slot to the end of the longest acknowledgment of the longest frame (ns).
pub(super) const LEAST_SLOT_NS: u64 =
    (timing::TX_OFFSET_NS + timing::MAX_TX_NS + timing::TX_ACK_DELAY_NS + timing::MAX_ACK_NS)
        as u64;

/// What a round robin takes at least to form (s), if that is longer than experiments wait by default.
const LONG_FORMATION_S: f64 = 3600.0;

/// Whether the roots' own slots are too few for what they must tell every mote.
fn slow_round_robin(settings: &Settings, given: &Given<'_>) -> Option<String> {
    let sf::Config::Rrsf(sf) = &settings.sf else { return None };
    let of_each = u32::from(settings.join.secure) + u32::from(settings.rpl.dao_ack);
    let n_frames = f64::from(of_each) * given.agent_count as f64 / settings.roots.len() as f64;
    let slotframe_s = seconds(u64::from(settings.sf.slotframe_slots()) * given.slot_ns);
    let takes_s = n_frames * slotframe_s;
    (sf.shared_slots == 0 && LONG_FORMATION_S < takes_s).then(|| {
        format!(
            "{} = \"rrsf\" gives a root one frame in {slotframe_s} s: to admit all motes and to acknowledge their routes takes \
             it {takes_s:.0} s at least, and most requests go unanswered; join.secure = false and rpl.dao_ack = false spare \
             it that",
            join(&join(given.path, "sf"), "kind"),
        )
    })
}

fn roots(given: &Given<'_>, problems: &mut Vec<Problem>) -> Vec<u32> {
    let Some(listed) = given.table.get("roots").and_then(toml::Value::as_array) else {
        return vec![0];
    };
    let mut roots = Vec::new();
    for (index, mote) in listed.iter().filter_map(toml::Value::as_integer).enumerate() {
        let path = join(given.path, &format!("roots[{index}]"));
        if given.agent_count as i64 <= mote {
            let last = given.agent_count - 1;
            let message = format!("must be a mote, 0 to {last}");
            problems.push(Problem::new(path, message).value(mote).nearest(last));
        } else if roots.contains(&(mote as u32)) {
            problems.push(Problem::new(path, "must not be listed twice").value(mote));
        } else {
            roots.push(mote as u32);
        }
    }
    roots.sort_unstable();
    roots
}

fn addresses(given: &Given<'_>, problems: &mut Vec<Problem>) -> Option<Addresses> {
    let listed = given.table.get("eui64").and_then(toml::Value::as_array);
    let mut addresses = Vec::new();
    for (index, text) in listed.into_iter().flatten().filter_map(toml::Value::as_str).enumerate() {
        let octets: Vec<&str> = text.split('-').collect();
        let is_well_formed = octets.len() == 8 && octets.iter().all(|octet| octet.len() == 2);
        match u64::from_str_radix(&octets.concat(), 16) {
            Ok(number) if is_well_formed => addresses.push(Eui64(number)),
            _ => problems.push(
                Problem::new(
                    join(given.path, &format!("eui64[{index}]")),
                    "must be eight octets of two hexadecimal digits, as 02-00-00-00-00-00-00-05",
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
