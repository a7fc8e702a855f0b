//! `netsim.profile`: settings that go together, chosen by what is known of an experiment before it starts.
//!
//! [`resolve`] writes keys into a section that does not have them, so that the effective configuration says what holds. A key that is
//! written stays.

mod systems;

use super::network;
use super::{Keys, effective};
use crate::catalogue::Catalogue;
use crate::wire::slots::MAX_SLOTS;
use physics::end::{End, distance_squared_m2};
use physics::link::Scene;
use physics::model::Model;
use physics::nearest::Grid;
use physics::section;
use proto::config::{Choice, Node, Section as _, Value, parse};
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Which settings go together.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Profile {
    /// The orchestrator chooses before the start: `rfc` where no robot moves or sf.kind is written, otherwise settings for motes that move.
    /// A network simulator by itself takes it as `rfc`.
    Auto,
    /// The standards' defaults.
    Rfc,
    /// The defaults of Contiki-NG 5.0 with Orchestra, December 2024, as far as they are keys here.
    ContikiNg,
    /// The defaults of OpenWSN's firmware (branch develop, commit 7ee5f203, November 2021), as far as they are keys here.
    Openwsn,
    /// BotNet's network, for Table I of its paper (arXiv 2108.13606): its scheduling function, radio and behaviour.
    Botnet,
}

impl Profile {
    /// Settings that do not depend on the experiment.
    fn settings(self) -> Option<&'static str> {
        match self {
            Self::Auto | Self::Rfc => None,
            Self::ContikiNg => Some(systems::CONTIKI_NG),
            Self::Openwsn => Some(systems::OPENWSN),
            Self::Botnet => Some(systems::BOTNET),
        }
    }
}

/// A section as a network by itself takes it: with the settings of its profile, and `auto` as `rfc`, because it does not know whether motes
/// will move.
pub(super) fn by_itself(config: &Node, catalogue: &Catalogue) -> Node {
    let mut config = config.clone();
    let table = effective(&config, catalogue);
    let Some(profile) = Keys::read(&table).protocols().map(|keys| keys.profile) else {
        return config;
    };
    if profile == Profile::Auto {
        tracing::info!("netsim.profile = \"auto\" is taken as \"rfc\": who moves is unknown here");
        // A section that has protocols is a table.
        _ = config.set("profile", Value::Text("rfc".to_owned()));
    }
    fill_with(&mut config, profile);
    config
}

/// Writes the settings of a profile that does not depend on the experiment.
fn fill_with(config: &mut Node, profile: Profile) {
    if let Some(settings) = profile.settings().and_then(|text| parse(text).ok()) {
        fill(config, settings);
    }
}

/// What is known of the motes before the start.
#[derive(Clone, Debug, PartialEq)]
pub struct Motes {
    /// Where they begin (m).
    pub positions_m: Vec<[f64; 3]>,
    /// Which of them move.
    pub moves: Vec<bool>,
    /// How fast they may move apart from each other (m/s), if that is known.
    pub scatter_mps: Option<f64>,
}

impl Motes {
    /// The most motes within a distance of any of them, itself included; `enough` stands for more than that.
    fn most_within(&self, distance_m: f64, enough: usize) -> usize {
        let sorted = Sorted::new(&self.positions_m, distance_m);
        let mut most = 0;
        for mote in 0..self.positions_m.len() {
            most = most.max(sorted.within(mote, distance_m).take(enough).count());
            if most == enough {
                break;
            }
        }
        most
    }

    /// Motes within a distance of a root, roots apart.
    fn n_beside(&self, roots: &[MoteId], distance_m: f64) -> usize {
        let sorted = Sorted::new(&self.positions_m, distance_m);
        let is_root = |mote: usize| roots.iter().any(|root| root.index() == mote);
        let in_range =
            roots.iter().map(|root| root.index()).filter(|&root| root < self.moves.len());
        let beside: BTreeSet<usize> = in_range
            .flat_map(|root| sorted.within(root, distance_m).collect::<Vec<usize>>())
            .filter(|&mote| !is_root(mote))
            .collect();
        beside.len()
    }

    /// The motes that move, if all others reach a root over each other and every mote is in range of one of these: then nobody needs a
    /// mote that moves as a parent.
    fn among_routers(&self, roots: &[MoteId], range_m: f64) -> Option<Vec<usize>> {
        let (moving, standing): (Vec<usize>, Vec<usize>) =
            (0..self.moves.len()).partition(|&mote| self.moves[mote]);
        if standing.len() <= 2 * roots.len() {
            return None;
        }
        let sorted = Sorted::new(&self.positions_m, range_m);
        let is_root = |mote: &usize| roots.iter().any(|root| root.index() == *mote);
        let mut reached: Vec<usize> = standing.iter().copied().filter(is_root).collect();
        let mut is_open = self.moves.iter().map(|moves| !moves).collect::<Vec<bool>>();
        reached.iter().for_each(|&mote| is_open[mote] = false);
        let mut next = 0;
        while let Some(&from) = reached.get(next) {
            let new =
                sorted.within(from, range_m).filter(|&mote| std::mem::take(&mut is_open[mote]));
            reached.extend(new);
            next += 1;
        }
        // All that stand are routers then.
        let is_covered =
            |mote: &usize| sorted.within(*mote, range_m).any(|router| !self.moves[router]);
        (reached.len() == standing.len() && moving.iter().all(is_covered)).then_some(moving)
    }

    /// A length (m) that no two motes are apart.
    fn extent_m(&self) -> f64 {
        let span = |axis: usize| {
            let places = self.positions_m.iter().map(|position_m| position_m[axis]);
            let [low, high] = places
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
                    [f64::min(low, place), f64::max(high, place)]
                });
            high - low
        };
        distance_squared_m2([span(0), span(1), span(2)]).sqrt() + 1.0
    }
}

/// Motes sorted by where they are.
struct Sorted<'a> {
    positions_m: &'a [[f64; 3]],
    grid: Grid,
}

impl<'a> Sorted<'a> {
    /// For searches within about a distance (m), which is finite.
    fn new(positions_m: &'a [[f64; 3]], distance_m: f64) -> Self {
        let mut grid = Grid::default();
        grid.build(distance_m, positions_m.iter().map(|&[x_m, y_m, _]| [x_m, y_m]));
        Self { positions_m, grid }
    }

    /// The motes within a distance (m) of one, itself included.
    fn within(&self, mote: usize, distance_m: f64) -> impl Iterator<Item = usize> {
        let [x_m, y_m, z_m] = self.positions_m[mote];
        let near = move |other: &usize| {
            let [other_x_m, other_y_m, other_z_m] = self.positions_m[*other];
            let apart_m = [other_x_m - x_m, other_y_m - y_m, other_z_m - z_m];
            distance_squared_m2(apart_m) <= distance_m * distance_m
        };
        self.grid.around([x_m, y_m], distance_m).map(|other| other as usize).filter(near)
    }
}

/// Resolves `profile = "auto"` of a section: writes what it chooses where nothing is written, and returns a sentence about the choice.
/// `None`: the standards' defaults hold, or another profile is written.
#[must_use]
pub fn resolve(config: &mut Node, motes: &Motes, catalogue: &Catalogue) -> Option<String> {
    let table = effective(config, catalogue);
    let keys = Keys::read(&table);
    let protocols = keys.protocols()?;
    if protocols.profile != Profile::Auto {
        fill_with(config, protocols.profile);
        return None;
    }
    let said = chosen(config, &keys, protocols, motes, catalogue).map(|(settings, said)| {
        fill(config, settings);
        said
    });
    config.set("profile", Value::Text("rfc".to_owned())).ok()?;
    said
}

/// The scheduling function for motes that move.
const SOTDMA: &str = "sotdma";
/// Shared slots: for joining and routing.
const SHARED: usize = 16;
/// Slots of single motes, as a share of the most motes within two hops before the start: where slots are fewer than motes, those that are
/// farthest apart share one, and a slotframe is shorter.
const OWN_SHARE: f64 = 0.65;
/// A beacon is sent in a slot of the mote's own. Of these slots it may take all but this times those that data need at the busiest motes,
/// the neighbours of roots: what else they pass on goes in bursts and in shared slots.
const DATA_SHARE: f64 = 0.7;
/// But at least this share, so that moving motes find the way.
const LEAST_BEACONS: f64 = 0.4;
/// And so many that a mote sends this number of beacons while another one moves as far as a link reaches.
const BEACONS_IN_RANGE: f64 = 7.0;
/// Bounds of the number of these slots.
const OWN_SLOTS: [usize; 2] = [16, MAX_SLOTS as usize - SHARED];
/// Least probability of reception over a link on which a mote may rely.
const RELIABLE: f64 = 0.9;
/// A neighbour counts as a hop farther once its frames are weaker than this above the level at which links break (dB).
const HANDOVER_MARGIN_DB: f64 = 1.7;
/// For so long after a request to join (s) do those on its way advertise how they are reached, where nothing else travels down.
const DAO_FOR_JOINS_S: f64 = 120.0;
/// Kinds of applications that send upwards alone, unless they have a destination.
const UPWARD: [&str; 3] = ["periodic", "poisson", "event"];
/// Channels on which motes that look for the network find it sooner than on sixteen, those of TSCH-Sim and Contiki-NG.
const FEW_CHANNELS: &str = "hopping_sequence = [15, 25, 26, 20]";

/// The settings for motes that move, and what to say of them. `None`: none moves, or a scheduling function is written.
fn chosen(
    config: &Node,
    keys: &Keys,
    protocols: &network::Keys,
    motes: &Motes,
    catalogue: &Catalogue,
) -> Option<(Node, String)> {
    let n_motes = motes.moves.len();
    let n_moving = motes.moves.iter().filter(|moves| **moves).count();
    let is_written = config.get("sf").is_some_and(|sf| sf.get("kind").is_some());
    if n_moving == 0 || is_written {
        return None;
    }
    let text = |table: &toml::Table, key: &str| Some(table.get(key)?.as_str()?.to_owned());
    let radio = Radio::of(config, motes.positions_m.len(), catalogue);
    let extent_m = motes.extent_m();
    let range_m = radio.map_or(extent_m, |radio| radio.range_m.min(extent_m));
    let [least, most] = OWN_SLOTS;
    // More of them do not have more slots.
    let enough = libm::ceil(most as f64 / OWN_SHARE) as usize;
    let n_around = motes.most_within(2.0 * range_m, enough);
    let n_own = (libm::ceil(OWN_SHARE * n_around as f64) as usize).clamp(least, most);
    let n_slots = n_own + SHARED;
    let slotframe_s = n_slots as f64 * keys.slot_duration_s;
    let roots = protocols.roots.clone().unwrap_or_else(|| vec![MoteId(0)]);
    let n_senders = n_motes.saturating_sub(roots.len()) as f64;
    let packets_per_s: f64 = protocols.app.iter().map(|app| packets_per_s(app, n_senders)).sum();
    let n_beside_roots = motes.n_beside(&roots, range_m).max(1) as f64;
    let load = slotframe_s * packets_per_s / n_beside_roots;
    let of_motion = motes.scatter_mps.zip(radio).map_or(0.0, |(scatter_mps, radio)| {
        BEACONS_IN_RANGE * slotframe_s * scatter_mps / radio.range_m
    });
    let of_beacons = (1.0 - DATA_SHARE * load).clamp(of_motion.clamp(LEAST_BEACONS, 1.0), 1.0);
    let beacon_period_s = slotframe_s / of_beacons;
    let leaves = motes.among_routers(&roots, range_m).unwrap_or_default();
    let is_upward = |app: &toml::Table| {
        let destination = app.get("destination");
        destination.is_none_or(|destination| destination.as_str() == Some("root"))
            && text(app, "kind").is_some_and(|kind| UPWARD.contains(&kind.as_str()))
    };
    let carries_payloads = text(&protocols.swarm, "transport").as_deref() != Some("none");
    let is_upward = !protocols.app.is_empty() && protocols.app.iter().all(is_upward);
    let dao_for_joins_s = if is_upward { DAO_FOR_JOINS_S } else { 0.0 };
    let unicast = if carries_payloads && protocols.app.is_empty() { "shared" } else { "own" };
    let handover = radio.map_or_else(String::new, |Radio { edge_dbm, .. }| {
        format!("handover_dbm = {:.1}\nhandover_s = 1.0", edge_dbm + HANDOVER_MARGIN_DB)
    });
    let has_band = config.get("phy").is_some_and(|phy| phy.get("standard").is_some());
    let channels = if has_band || radio.is_none() { "" } else { FEW_CHANNELS };
    let is_secure = protocols.join.get("secure").and_then(toml::Value::as_bool) != Some(false);
    let settings = format!(
        r#"
{channels}
[mac]
beacon_period_s = {beacon_period_s:?}
beacon_spacing_s = 0.0
beacon_wait_s = 10.0
rejoin_wait_s = 4.0
neighbours_to_wait = 1
queue_frames = 100
min_backoff_exponent = 4
[sf]
kind = "{SOTDMA}"
slotframe_slots = {n_slots}
shared_slots = {SHARED}
unicast = "{unicast}"
forget_slotframes = 3
[rpl]
dao_delay_s = 0.5
dao_interval_s = 3.0
dao_for_joins_s = {dao_for_joins_s:?}
dao_ack = false
initial_etx = 1.0
max_failures = 3
unusable_hold_s = 3.0
repair_hold_s = 2.0
neighbour_lifetime_s = 6.0
solicitation = "multicast"
dis_period_s = 5.0
[join]
rate_bytes_s = 200
[mobility]
leaves = {leaves:?}
time_from_beacons = true
rank_from_beacons = true
{handover}
reroute = true
bursts = true
keep_admission = {is_secure}
"#
    );
    let settings = parse(&settings).ok()?;
    let among = if leaves.is_empty() { "" } else { " as leaves among routers that stand" };
    let fast = motes.scatter_mps.map_or_else(String::new, |mps| format!(" at up to {mps} m/s"));
    let said = format!(
        "netsim.profile = \"auto\": {n_moving} of {n_motes} robots move{fast}{among}, so sf.kind = {SOTDMA:?} with {n_slots} slots, a beacon every \
         {beacon_period_s:.2} s, hand-over and rerouting; \"rfc\" has the standards' defaults"
    );
    Some((settings, said))
}

/// Packets per second of an application whose rate is configured: of its senders, or of all motes but roots.
fn packets_per_s(app: &toml::Table, n_others: f64) -> f64 {
    let interval_s = ["period_s", "mean_interval_s"].map(|key| app.get(key)?.as_float());
    let n_senders = app.get("senders").and_then(toml::Value::as_array).map(|all| all.len() as f64);
    interval_s
        .into_iter()
        .flatten()
        .next()
        .map_or(0.0, |interval_s| n_senders.unwrap_or(n_others) / interval_s)
}

/// A radio whose links depend on distance alone, scatter apart.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Radio {
    /// How far a mote may rely on a link (m).
    range_m: f64,
    /// The power of frames there (dBm).
    edge_dbm: f64,
}

impl Radio {
    /// The radio of a section. `None`: its links depend on more than distance, or it is not valid, which is said elsewhere.
    fn of(config: &Node, n_motes: usize, catalogue: &Catalogue) -> Option<Self> {
        let empty = Node::empty_table();
        let phy = config.get("phy").unwrap_or(&empty);
        let (model, _) =
            section::read(phy, "", n_motes, &BTreeMap::new(), &catalogue.physics).ok()?;
        // Steps of 1 %, from a decimetre to a hundred kilometres.
        let steps = (0..1389).map(|step| 0.1 * libm::pow(1.01, f64::from(step)));
        let reliable = steps.map_while(|distance_m| Self::at(&model, distance_m));
        if model.is_isotropic() { reliable.last() } else { None }
    }

    /// The radio at a distance, if a mote may rely on a link so long.
    fn at(model: &Model, distance_m: f64) -> Option<Self> {
        let scene = Scene::default();
        let [one, other] =
            [(0, 0.0), (1, distance_m)].map(|(mote, x_m)| End::new(MoteId(mote), [x_m, 0.0, 0.0]));
        let budget = model.evaluate(&model.link(&scene, one, other, None, 0));
        (RELIABLE <= budget.reception_probability)
            .then_some(Self { range_m: distance_m, edge_dbm: budget.rssi_dbm })
    }
}

/// Writes the entries of a table into another, where nothing is written. A table of another kind has other keys, and stays.
fn fill(config: &mut Node, settings: Node) {
    let is_other = |tag| {
        let [written, ours] = [&*config, &settings].map(|table| table.get(tag).map(Node::show));
        written.is_some() && ours.is_some() && written != ours
    };
    if is_other("kind") || is_other("propagation") {
        return;
    }
    let Value::Table(settings) = settings.value else { return };
    for (key, span, setting) in settings {
        let Value::Table(entries) = &mut config.value else { return };
        match entries.iter_mut().find(|(written, ..)| *written == key) {
            Some((.., written)) => fill(written, setting),
            None => entries.push((key, span, setting)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    /// A grid of motes 10 m apart, of which the last ones move.
    fn motes(n_standing: usize, n_moving: usize) -> Motes {
        let place = |mote: usize| [10.0 * (mote % 6) as f64, 10.0 * (mote / 6) as f64, 0.0];
        let n_motes = n_standing + n_moving;
        Motes {
            positions_m: (0..n_motes).map(place).collect(),
            moves: (0..n_motes).map(|mote| n_standing <= mote).collect(),
            scatter_mps: None,
        }
    }

    const DISK: &str =
        "mode = \"6tisch\"\nphy = { propagation = \"unit-disk\", radius_m = 15.0 }\n";

    /// What is written after the profile was resolved, and what is said.
    fn resolved(more: &str, motes: &Motes) -> (toml::Value, Option<String>) {
        let mut config = parse(&format!("{DISK}{more}")).unwrap();
        let said = resolve(&mut config, motes, Catalogue::built_in());
        (config.to_toml(), said)
    }

    #[test]
    fn motes_that_stand_have_the_defaults_of_the_standards() {
        let (config, said) = resolved("", &motes(36, 0));
        assert_eq!(said, None);
        assert!(config.get("sf").is_none() && config.get("mac").is_none());
        assert_eq!(config["profile"].as_str(), Some("rfc"));
    }

    #[test]
    fn a_crowd_has_slots_of_its_own_and_among_routers_it_has_leaves() {
        let (crowd, said) = resolved("", &motes(1, 35));
        assert!(said.is_some_and(|said| said.contains("35 of 36 robots move, so")));
        assert_eq!(crowd["sf"]["kind"].as_str(), Some("sotdma"));
        assert_eq!(crowd["mobility"]["leaves"].as_array().map(Vec::len), Some(0));
        // Free space at 15 m on 2.44 GHz: 40.2 + 23.5 dB, and 1.7 dB more.
        assert_eq!(crowd["mobility"]["handover_dbm"].as_float(), Some(-62.0));
        let (among, said) = resolved("", &motes(36, 6));
        assert!(said.is_some_and(|said| said.contains("as leaves among routers")));
        let leaves: Vec<i64> = among["mobility"]["leaves"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(toml::Value::as_integer)
            .collect();
        assert_eq!(leaves, [36, 37, 38, 39, 40, 41]);
        // The slotframe follows the density: at most so many of the motes are within 30 m of one.
        let slots = |config: &toml::Value| config["sf"]["slotframe_slots"].as_integer().unwrap();
        let n_around = motes(36, 6).most_within(29.9, 100) as f64;
        assert_eq!(slots(&among), (OWN_SHARE * n_around).ceil().max(16.0) as i64 + 16);
    }

    #[test]
    fn motes_around_one_are_those_that_a_look_at_all_pairs_counts() {
        let draws = Draws::new(1, Purpose::Resample);
        let place = |mote: u64| [0, 1, 2].map(|axis| 60.0 * draws.uniform(mote, axis, 0));
        let positions_m: Vec<[f64; 3]> = (0..200).map(place).collect();
        let around = |one: &[f64; 3], distance_m: f64| {
            let apart_m = |other: &[f64; 3]| {
                distance_squared_m2([0, 1, 2].map(|axis| one[axis] - other[axis])).sqrt()
            };
            positions_m.iter().filter(|other| apart_m(other) <= distance_m).count()
        };
        let motes =
            Motes { positions_m: positions_m.clone(), moves: vec![true; 200], scatter_mps: None };
        for distance_m in [5.0, 20.0, 40.0, motes.extent_m()] {
            let most = positions_m.iter().map(|one| around(one, distance_m)).max().unwrap();
            assert_eq!(motes.most_within(distance_m, 1000), most, "{distance_m}");
            assert_eq!(motes.most_within(distance_m, 7), most.min(7), "{distance_m}");
        }
    }

    #[test]
    fn what_is_written_stays_and_another_function_is_a_choice() {
        let more = "[mac]\nqueue_frames = 7\n[mobility]\nreroute = false\n";
        let (config, _) = resolved(more, &motes(1, 35));
        assert_eq!(config["mac"]["queue_frames"].as_integer(), Some(7));
        assert_eq!(config["mobility"]["reroute"].as_bool(), Some(false));
        assert_eq!(config["mobility"]["bursts"].as_bool(), Some(true));
        for more in ["[sf]\nkind = \"msf\"\n", "profile = \"rfc\"\n"] {
            let (config, said) = resolved(more, &motes(1, 35));
            assert!(said.is_none() && config.get("mobility").is_none(), "{more}");
        }
    }

    #[test]
    fn a_section_is_resolved_once() {
        let mut config = parse(DISK).unwrap();
        assert!(resolve(&mut config, &motes(1, 35), Catalogue::built_in()).is_some());
        let before = config.clone();
        assert!(resolve(&mut config, &motes(1, 35), Catalogue::built_in()).is_none());
        assert_eq!(config, before);
    }

    #[test]
    fn beacons_leave_slots_for_data_where_motes_beside_the_root_pass_on_much() {
        // The period of beacons in slotframes, and the length of these (s).
        let beacons = |app: &str| {
            let (config, _) = resolved(app, &motes(1, 35));
            let slotframe_s = 0.01 * config["sf"]["slotframe_slots"].as_integer().unwrap() as f64;
            (config["mac"]["beacon_period_s"].as_float().unwrap() / slotframe_s, slotframe_s)
        };
        let app =
            |period_s: f64| format!("[[app]]\nkind = \"periodic\"\nperiod_s = {period_s:?}\n");
        assert!((beacons("").0 - 1.0).abs() < 1e-9);
        // Three motes are within 15 m of the corner where the root is.
        let (rarely, slotframe_s) = beacons(&app(20.0));
        let load = slotframe_s * 35.0 / 20.0 / 3.0;
        assert!((rarely * (1.0 - DATA_SHARE * load) - 1.0).abs() < 1e-9, "{rarely}");
        assert!((beacons(&app(0.01)).0 * LEAST_BEACONS - 1.0).abs() < 1e-9);
    }

    #[test]
    fn motes_that_move_fast_send_beacons_before_they_are_out_of_reach() {
        let period_s = |scatter_mps| {
            let motes = Motes { scatter_mps, ..motes(1, 35) };
            let busy = "[[app]]\nkind = \"periodic\"\nperiod_s = 0.01\n";
            resolved(busy, &motes).0["mac"]["beacon_period_s"].as_float().unwrap()
        };
        assert_eq!(period_s(Some(0.1)), period_s(None));
        // Links reach 15 m, in steps of 1 %.
        assert!((15.0 / 4.0 / BEACONS_IN_RANGE / period_s(Some(4.0)) - 1.0).abs() < 0.01);
        // No more than one in each slotframe.
        assert!((period_s(Some(100.0)) / period_s(None) - LEAST_BEACONS).abs() < 1e-9);
    }

    #[test]
    fn profiles_of_other_systems_are_valid_and_leave_what_is_written() {
        for name in ["contiki-ng", "openwsn", "botnet"] {
            let text = format!("mode = \"6tisch\"\nprofile = \"{name}\"\n");
            let config = parse(&text).unwrap();
            let whole = by_itself(&config, Catalogue::built_in());
            let mut problems = Vec::new();
            let lists = Catalogue::built_in().lists();
            proto::config::check(&whole, "netsim", &super::super::SPEC, &lists, &mut problems);
            assert!(problems.is_empty(), "{name}: {problems:?}");
            // An orchestrator writes the same.
            let mut resolved = config.clone();
            assert_eq!(resolve(&mut resolved, &motes(1, 35), Catalogue::built_in()), None);
            assert_eq!(resolved.to_toml(), whole.to_toml());
            assert_eq!(by_itself(&whole, Catalogue::built_in()).to_toml(), whole.to_toml());
            let other = format!("{text}[sf]\nkind = \"minimal\"\n[mac]\nqueue_frames = 7\n");
            let other = by_itself(&parse(&other).unwrap(), Catalogue::built_in()).to_toml();
            assert_eq!(other["sf"].as_table().map(toml::Table::len), Some(1), "{name}");
            assert_eq!(other["mac"]["queue_frames"].as_integer(), Some(7));
        }
    }

    #[test]
    fn routes_down_are_kept_fresh_where_something_travels_down() {
        let for_joins_s = |app: &str| {
            let (config, _) = resolved(app, &motes(1, 35));
            config["rpl"]["dao_for_joins_s"].as_float().unwrap()
        };
        let app = |more: &str| format!("[[app]]\nkind = \"periodic\"\nperiod_s = 10.0\n{more}");
        assert_eq!(for_joins_s(&app("senders = [1, 2]")), 120.0);
        assert_eq!(for_joins_s(&app("senders = [0]\ndestination = 3")), 0.0);
        assert_eq!(for_joins_s(""), 0.0);
    }
}
