//! The `[netsim]` section.

mod admission;
mod applications;
mod energy;
pub mod idle;
mod lowpan;
mod mac;
pub mod mobility;
mod network;
pub mod profile;
mod rpl;
mod security;
mod standard;
mod swarm;

use crate::catalogue::Catalogue;
use crate::mesh::config::Config;
use crate::second;
use bytes::Bytes;
use idle::Surroundings;
use physics::propagation::{self, BuildContext, Family};
use physics::{interference, section};
use proto::config::{FileReference, Node, Problem, Section, TableSpec, check, join};
use proto::effect::only::refuse_runs;
use proto::ids::MoteId;
use proto::side::Setup;
use proto::time::SimDuration;
use proto::types::{MoteCommandKind, seconds};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Description of `[netsim]`.
pub const SPEC: TableSpec = Keys::SPEC;

/// The network and its radio.
#[derive(Section)]
struct Keys {
    /// The level of detail of the simulation.
    #[key(tag, default = "propagation-only")]
    mode: Option<Mode>,
    /// Length of a slot (s); the control period must be a multiple of it. 0.01: IEEE Std 802.15.4-2015's default timeslot.
    #[key(range = 1e-6..=1e3, default = 0.01)]
    slot_duration_s: f64,
    /// Hopping sequence: channels of phy.standard by absolute slot number, 11 to 26 at 2.4 GHz. Absent: 16, 17, 23, 18, 26, 15, 25,
    /// 22, 19, 11, 12, 13, 24, 14, 20, 21, or as many channels of another band, with mode = "6tisch" or a trace; otherwise frames
    /// have no channel and are sent on carrier_hz.
    #[key(range = 0..=128, length = 1..=512)]
    hopping_sequence: Option<Vec<u8>>,
    /// Motes that are absent until an event of the timeline adds them.
    #[key(length = 0..)]
    absent: Vec<MoteId>,
    /// The radio.
    #[key(table = section::SPEC, default)]
    phy: toml::Table,
    /// A broadcast medium beside the main network, which can carry the robots' payloads. Absent: there is none.
    #[key(table = second::SPEC)]
    second_medium: Option<toml::Table>,
}

/// What `mode` may be.
#[derive(Section)]
#[expect(clippy::large_enum_variant, reason = "a configuration has one")]
enum Mode {
    /// No protocols: each payload is broadcast once per control period, and every other radio receives it with the probability that
    /// the physics gives. Frames do not interfere.
    PropagationOnly,
    /// The full network: TSCH, a scheduling function, 6P, 6LoWPAN, RPL and admission, on a medium with interference.
    #[section(name = "6tisch")]
    Protocols(network::Keys),
}

impl Keys {
    /// Those of the full network.
    fn protocols(&self) -> Option<&network::Keys> {
        match &self.mode {
            Some(Mode::Protocols(keys)) => Some(keys),
            _ => None,
        }
    }
}

/// The files that a configuration names.
#[must_use]
pub fn files(config: &Node, path: &str, catalogue: &Catalogue) -> Vec<FileReference> {
    check(config, path, &SPEC, &catalogue.lists(), &mut Vec::new()).files()
}

/// The section's table with defaults, whatever is wrong with it.
fn effective(config: &Node, catalogue: &Catalogue) -> toml::Table {
    check(config, "", &SPEC, &catalogue.lists(), &mut Vec::new()).table
}

/// Slots of one slotframe of the network that `config` describes: a control period of `"slotframe"`. With protocols it is
/// the scheduling function's, or that of the payloads' broadcast slotframe; without, a slot for every agent. So is it
/// where the configuration is not valid, which [`read`] will say.
#[must_use]
pub fn slotframe_slots(config: &Node, agent_count: usize, catalogue: &Catalogue) -> u64 {
    let table = effective(config, catalogue);
    let keys = Keys::read(&table);
    let Some(protocols) = keys.protocols() else { return agent_count as u64 };
    let physical = section::physical_layer(&keys.phy);
    let given = network::Given {
        keys: protocols,
        path: "",
        agent_count,
        slot: SimDuration::from_ns(1),
        hopping_sequence: keys
            .hopping_sequence
            .as_deref()
            .unwrap_or(physical.standard.hopping_sequence),
        airtime: physical.standard.airtime,
        catalogue,
    };
    network::build(&given, &mut Vec::new(), &mut Vec::new())
        .map_or(agent_count as u64, |(settings, _)| u64::from(settings.slotframe_slots()))
}

/// Orders that mean anything to the network that `config` describes. Without protocols nothing can be jammed, and no
/// packet sent beside the robots' payloads.
#[must_use]
pub fn commands(config: &Node, catalogue: &Catalogue) -> &'static [MoteCommandKind] {
    let keys = Keys::read(&effective(config, catalogue));
    if keys.protocols().is_some() { &COMMANDS } else { &WITHOUT_PROTOCOLS }
}

/// The motes that `config` leaves out until an order adds them.
#[must_use]
pub fn absent(config: &Node, catalogue: &Catalogue) -> Vec<MoteId> {
    let keys = Keys::read(&effective(config, catalogue));
    keys.absent
}

/// How long the trace lasts that a network replays (ns), its checked section and files given; `None`: it replays none, or one
/// beyond whose end links are held.
#[must_use]
pub fn replay_ns(
    table: &toml::Table,
    files: &BTreeMap<String, Bytes>,
    catalogue: &Catalogue,
) -> Option<u64> {
    section::replay_ns(table.get("phy")?.as_table()?, files, &catalogue.physics)
}

/// Orders that some network obeys.
pub const COMMANDS: [MoteCommandKind; 5] = [
    MoteCommandKind::Kill,
    MoteCommandKind::Revive,
    MoteCommandKind::Add,
    MoteCommandKind::Jam,
    MoteCommandKind::Send,
];

/// Orders that a network without protocols obeys.
pub(crate) const WITHOUT_PROTOCOLS: [MoteCommandKind; 3] =
    [MoteCommandKind::Kill, MoteCommandKind::Revive, MoteCommandKind::Add];

/// The `mode` of the full network.
const MODE_6TISCH: &str = "6tisch";

/// Reads `[netsim]`: the configuration, its effective text, and what should be checked before results are trusted.
///
/// # Errors
///
/// Everything that is wrong with it.
pub fn read(
    setup: &Setup,
    catalogue: &Catalogue,
) -> Result<(Config, toml::Table, Vec<String>), Vec<Problem>> {
    let mut problems = Vec::new();
    let lists = catalogue.lists();
    let config = profile::by_itself(&setup.config, catalogue);
    let mut table = check(&config, &setup.path, &SPEC, &lists, &mut problems).table;
    if let Some(phy) = table.get_mut("phy").and_then(toml::Value::as_table_mut) {
        let path = join(&setup.path, "phy");
        section::apply(phy, config.get("phy"), &path, &catalogue.physics, &mut problems);
    }
    let keys = Keys::read(&table);
    let key_path = |key: &str| join(&setup.path, key);

    let slot_s = keys.slot_duration_s;
    let slot = SimDuration::from_seconds(slot_s);
    let step = SimDuration::from_ns(setup.experiment.step_ns);
    let is_refused = problems.iter().any(|problem| problem.path == key_path("slot_duration_s"));
    if !is_refused && !step.ns().is_multiple_of(slot.ns()) {
        let message = format!(
            "must divide the control period, {} s, into a whole number of slots",
            step.seconds()
        );
        let nearest = seconds(nearest_divisor(step.ns(), slot.ns()));
        problems.push(
            Problem::new(key_path("slot_duration_s"), message).value(slot_s).nearest(nearest),
        );
    }

    let agent_count = setup.experiment.agent_count;
    let mut absent: Vec<MoteId> = Vec::new();
    for (index, &mote) in keys.absent.iter().enumerate() {
        let key = key_path(&format!("absent[{index}]"));
        if agent_count <= mote.index() {
            let message = format!("must be the number of a mote, 0 to {}", agent_count - 1);
            problems.push(Problem::new(key, message).value(mote).nearest(agent_count - 1));
        } else if absent.contains(&mote) {
            problems.push(Problem::new(key, "must not be listed twice").value(mote));
        } else {
            absent.push(mote);
        }
    }

    let protocols = keys.protocols();
    let is_network = protocols.is_some();
    let phy = section::Keys::read(&keys.phy);
    let base = catalogue.physics.propagation.selected(&keys.phy, &propagation::TAG);
    let is_recording = base.is_some_and(|base| base.family == Family::Recording);
    let physical = physics::standard::find(phy.standard.as_deref());
    if is_network && !is_refused {
        let path = key_path("slot_duration_s");
        problems.extend(standard::check_slot(physical, slot, step, &path));
    }
    let hopping_sequence: Vec<u8> = match &keys.hopping_sequence {
        Some(channels) => channels.clone(),
        None if is_recording || is_network => physical.standard.hopping_sequence.to_vec(),
        None => Vec::new(),
    };
    let written = config.get("hopping_sequence");
    standard::check_channels(written, physical, &setup.path, &mut problems);
    let phy_path = key_path("phy");
    let mut context = BuildContext {
        path: &phy_path,
        radio: phy.radio,
        agent_count,
        slot_ns: slot.max(SimDuration::from_ns(1)).ns(),
        channels: &hopping_sequence,
        files: &setup.files,
        problems: Vec::new(),
        warnings: Vec::new(),
    };
    let model = section::model_of(&keys.phy, &phy, &catalogue.physics, &mut context, &mut problems);
    refuse_runs(&phy.effect, &join(&phy_path, "effect"), &mut problems);
    let mut warnings = context.warnings;
    problems.extend(context.problems);

    let interference = interference::build(&phy.interference, &catalogue.physics.interference);
    let network = protocols.map(|protocols| {
        let given = network::Given {
            keys: protocols,
            path: &setup.path,
            agent_count,
            slot: slot.max(SimDuration::from_ns(1)),
            hopping_sequence: &hopping_sequence,
            airtime: physical.standard.airtime,
            catalogue,
        };
        network::build(&given, &mut problems, &mut warnings)
    });
    if let Some(Some((settings, _))) = &network
        && settings.roots.iter().all(|root| absent.contains(root))
    {
        let message = "must not list every root, because motes need a root to join a network";
        problems.push(Problem::new(key_path("absent"), message).value(format!("{absent:?}")));
    }
    let second = keys.second_medium.as_ref().and_then(|table| {
        let mut context = second::BuildContext {
            path: &key_path("second_medium"),
            agent_count,
            step,
            problems: &mut problems,
        };
        second::build(table, &catalogue.second_media, &mut context)
    });
    let is_silent = network.iter().flatten().any(|(settings, _)| settings.is_silent());
    warnings.extend(second.iter().filter_map(|second| second.warning(&setup.path, is_silent)));
    let (Some(model), Some(interference), true) = (model, interference, problems.is_empty()) else {
        assert!(!problems.is_empty(), "what cannot be built has a problem");
        return Err(problems);
    };
    let around = Surroundings {
        path: &setup.path,
        site: &setup.site,
        agent_count,
        positions_m: None,
        keeps_heights: false,
    };
    let idle = idle::idle(&setup.config, around, catalogue);
    warnings.extend(idle.into_iter().map(|idle| idle.warning));
    let config = Config {
        slot,
        n_slots: step / slot,
        hopping_sequence,
        absent,
        antenna_height_m: phy.antenna_height_m.unwrap_or(0.0),
        model: Arc::new(model),
        interference: Some(interference),
        network: network.flatten().map(Box::new),
        second,
    };
    Ok((config, table, warnings))
}

/// The divisor of `whole` that is nearest to `part`.
fn nearest_divisor(whole: u64, part: u64) -> u64 {
    // A search that takes no time; a period of so many parts finds a near enough one.
    const MOST: u64 = 1 << 20;
    let mut best = whole;
    let mut low = 1u64;
    while low <= MOST && low * low <= whole {
        if whole.is_multiple_of(low) {
            for divisor in [low, whole / low] {
                if divisor.abs_diff(part) < best.abs_diff(part) {
                    best = divisor;
                }
            }
        }
        low += 1;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slots(text: &str) -> u64 {
        slotframe_slots(&proto::config::parse(text).unwrap(), 12, Catalogue::built_in())
    }

    #[test]
    fn a_control_period_of_one_slotframe_is_that_in_which_payloads_travel() {
        assert_eq!(slots(""), 12);
        assert_eq!(slots("mode = \"propagation-only\""), 12);
        let network = |more: &str| slots(&format!("mode = \"6tisch\"\n{more}"));
        assert_eq!(network("[sf]\nkind = \"rrsf\"\nshared_slots = 3"), 15);
        // Where the scheduling function has no room for payloads they have a slotframe of their own.
        assert_eq!(network("[sf]\nkind = \"msf\""), 12);
        assert_eq!(network("[sf]\nkind = \"msf\"\n[swarm]\nslots = 20"), 20);
        assert_eq!(network("[sf]\nkind = \"msf\"\n[swarm]\ntransport = \"none\""), 101);
        let shorter =
            "[sf]\nkind = \"minimal\"\nslotframe_slots = 50\n[swarm]\ntransport = \"shared-cell\"";
        assert_eq!(network(shorter), 50);
        // Not valid: said elsewhere.
        assert_eq!(network("[swarm]\ntransport = \"own-cell\"\n[sf]\nkind = \"msf\""), 12);
    }
}
