//! Keys of `[netsim]` that are written and have no influence, because of what other keys say: one list.

use super::{Keys, MODE_6TISCH, SPEC, network, swarm};
use crate::catalogue::Catalogue;
use crate::second::Route;
use crate::sf;
use physics::effect::{self, Effect};
use physics::propagation::{self, Family};
use physics::section;
use proto::config::{IdleKey, Node, Reason, Relation, Section as _, check, idle_keys, join};
use proto::effect::Need;
use proto::site::Site;

/// What decides, beside the keys of the section, whether one of them has influence.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// Path of `[netsim]`.
    pub path: &'a str,
    /// The place.
    pub site: &'a Site,
    /// Number of motes.
    pub agent_count: usize,
    /// Where the motes begin (m); `None`: unknown.
    pub positions_m: Option<&'a [[f64; 3]]>,
    /// Whether they certainly keep the heights at which they begin.
    pub keeps_heights: bool,
}

/// Which keys have no influence, and when.
const fn relations<'a>() -> &'a [Relation<Facts<'a>>] {
    &[
        Relation {
            keys: &["phy.*", "hopping_sequence"],
            except: &["phy.propagation", "phy.antenna_height_m"],
            reason: payloads_travel_elsewhere,
        },
        Relation {
            keys: &["second_medium.*"],
            except: &["second_medium.kind", "second_medium.payloads"],
            reason: second_medium_is_idle,
        },
        Relation { keys: &["phy.reception"], except: &[], reason: reception_is_stated },
        Relation {
            keys: &[
                "phy.tx_power_dbm",
                "phy.tx_antenna_gain_dbi",
                "phy.rx_antenna_gain_dbi",
                "phy.carrier_hz",
                "phy.min_distance_m",
                "phy.antenna_height_m",
            ],
            except: &[],
            reason: links_are_replayed,
        },
        Relation {
            keys: &["phy.tx_power_dbm", "phy.tx_antenna_gain_dbi", "phy.rx_antenna_gain_dbi"],
            except: &[],
            reason: rssi_is_constant,
        },
        Relation { keys: &["phy.interference"], except: &[], reason: frames_do_not_interfere },
        Relation { keys: &["phy.antenna_height_m"], except: &[], reason: positions_have_heights },
        Relation { keys: &["phy.effect[*]"], except: &[], reason: effect_meets_nothing },
        Relation {
            keys: &["swarm.slots", "swarm.channel_offset"],
            except: &[],
            reason: no_broadcast_slotframe,
        },
        Relation { keys: &["mobility.handover_s"], except: &[], reason: no_handover },
        Relation {
            keys: &["mobility.keep_admission"],
            except: &[],
            reason: nobody_needs_admission,
        },
    ]
}

/// The keys of a valid section that are written and have no influence.
#[must_use]
pub fn idle(written: &Node, around: Surroundings<'_>, catalogue: &Catalogue) -> Vec<IdleKey> {
    let effective = |node: &Node| {
        let mut problems = Vec::new();
        let mut table = check(node, "", &SPEC, &catalogue.lists(), &mut problems).table;
        if let Some(phy) = table.get_mut("phy").and_then(toml::Value::as_table_mut) {
            section::apply(phy, node.get("phy"), "phy", &catalogue.physics, &mut problems);
        }
        (table, problems.into_iter().map(|problem| problem.path).collect())
    };
    let facts = Facts::new(&effective(written).0, around, catalogue);
    idle_keys(relations(), &facts, (written, around.path), effective)
}

/// The channels that frames are sent on, by a valid section with its defaults; none: frames have no channel.
#[must_use]
pub fn channels(table: &toml::Table, catalogue: &Catalogue) -> Vec<u8> {
    let keys = Keys::read(table);
    let model = catalogue.physics.propagation.selected(&keys.phy, &propagation::TAG);
    let is_recording = model.is_some_and(|model| model.family == Family::Recording);
    let standard = section::physical_layer(&keys.phy).standard;
    let hops = is_recording || keys.protocols().is_some();
    let default = || if hops { standard.hopping_sequence.to_vec() } else { Vec::new() };
    keys.hopping_sequence.unwrap_or_else(default)
}

/// What the relations ask.
struct Facts<'a> {
    around: Surroundings<'a>,
    catalogue: &'a Catalogue,
    keys: Keys,
    phy: section::Keys,
    model: Option<&'static propagation::Entry>,
    effects: Vec<Box<dyn Effect>>,
    /// Channels that frames are sent on; none: frames have no channel.
    channels: Vec<u8>,
    route: Option<Route>,
}

impl<'a> Facts<'a> {
    fn new(table: &toml::Table, around: Surroundings<'a>, catalogue: &'a Catalogue) -> Self {
        let keys = Keys::read(table);
        let phy = section::Keys::read(&keys.phy);
        Self {
            around,
            catalogue,
            model: catalogue.physics.propagation.selected(&keys.phy, &propagation::TAG),
            effects: effect::build(&phy.effect, &catalogue.physics.effects),
            channels: channels(table, catalogue),
            route: keys.second_medium.as_ref().map(Route::of_table),
            phy,
            keys,
        }
    }

    fn path(&self, key: &str) -> String {
        join(self.around.path, key)
    }

    /// The propagation model, if it is of this family, as it is written.
    fn model_of(&self, is_such: impl Fn(Family) -> bool) -> Option<String> {
        let model = self.model.filter(|model| is_such(model.family))?;
        Some(format!("propagation = {:?}", model.variant.name))
    }

    fn network(&self) -> Option<&network::Keys> {
        self.keys.protocols()
    }

    /// Whether antennas are certainly on the ground.
    fn is_on_ground(&self) -> bool {
        let is_planar = |positions: &[[f64; 3]]| positions.iter().all(|[_, _, z_m]| *z_m == 0.0);
        self.phy.antenna_height_m.unwrap_or(0.0) <= 0.0
            && self.around.keeps_heights
            && self.around.positions_m.is_some_and(is_planar)
    }
}

fn payloads_travel_elsewhere(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    if facts.route != Some(Route::Second) || facts.network().is_some() {
        return None;
    }
    let payloads = facts.path("second_medium.payloads");
    Some(Reason::new(
        format!("with {payloads} = \"second\" the second medium carries all payloads"),
        format!("set {payloads} = \"both\" or \"main\", or leave the key out"),
    ))
}

fn second_medium_is_idle(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let payloads = facts.path("second_medium.payloads");
    (facts.route == Some(Route::Main)).then(|| {
        Reason::new(
            format!("with {payloads} = \"main\" the second medium is idle"),
            format!("set {payloads} = \"both\" or \"second\", or leave the key out"),
        )
    })
}

fn reception_is_stated(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let model = facts.model_of(|family| family != Family::Signal)?;
    Some(Reason::new(
        format!("{model} states itself what is received"),
        "choose a model of signal strength such as \"log-distance\", or leave the key out",
    ))
}

fn links_are_replayed(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let model = facts.model_of(|family| family == Family::Recording)?;
    Some(Reason::new(
        format!("{model} replays what was measured"),
        "choose another model, or leave the key out",
    ))
}

fn rssi_is_constant(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let model = facts.model_of(|family| family == Family::Connectivity)?;
    facts.keys.phy.get("rssi_dbm").map(|rssi_dbm| {
        let key = facts.path("phy.rssi_dbm");
        Reason::new(
            format!("with {model} and {key} = {rssi_dbm} every frame has this strength"),
            format!("leave out this key, or {key}"),
        )
    })
}

fn frames_do_not_interfere(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let mode = facts.path("mode");
    facts.network().is_none().then(|| {
        Reason::new(
            format!("with {mode} = \"propagation-only\" frames do not interfere"),
            format!("set {mode} = {:?}, or leave the key out", MODE_6TISCH),
        )
    })
}

fn positions_have_heights(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let positions_m = facts.around.positions_m?;
    let (robot, [_, _, z_m]) =
        positions_m.iter().enumerate().find(|(_, [_, _, z_m])| *z_m != 0.0)?;
    Some(Reason::new(
        format!("it applies if all robots are at z = 0, and robot {robot} starts at z = {z_m} m"),
        "add the height to the positions, or leave the key out",
    ))
}

/// Effects for which the experiment lacks what they act on.
fn effect_meets_nothing(facts: &Facts<'_>, key: &str) -> Option<Reason> {
    let index: usize = key.strip_suffix(']')?.rsplit_once('[')?.1.parse().ok()?;
    let effect = facts.effects.get(index)?;
    if effect.needs_heights() && facts.is_on_ground() {
        let height = facts.path("phy.antenna_height_m");
        return Some(Reason::new(
            "all antennas are at z = 0",
            format!("set {height} to their height above the ground"),
        ));
    }
    if let Some(band_hz) = effect.band_hz() {
        return outside_band(facts, &band_hz);
    }
    let entry = facts.catalogue.physics.effects.find(effect.name())?;
    entry.about.needs.iter().find_map(|need| lacks(facts, *need))
}

/// Why an effect that acts on some frequencies (Hz) meets no frame.
fn outside_band(facts: &Facts<'_>, band_hz: &std::ops::RangeInclusive<f64>) -> Option<Reason> {
    let standard = section::physical_layer(&facts.keys.phy).standard;
    let key = facts.path("hopping_sequence");
    if facts.channels.is_empty() {
        return Some(Reason::new("frames have no channel", format!("set {key}")));
    }
    let is_hit = |channel: u8| band_hz.contains(&standard.channels.centre_hz(channel));
    if facts.channels.iter().any(|&channel| is_hit(channel)) {
        return None;
    }
    let [first, last] = [band_hz.start(), band_hz.end()].map(|hz| hz / 1e6);
    let plan = standard.channels;
    let hit: Vec<String> =
        (plan.first..=plan.last).filter(|&it| is_hit(it)).map(|it| it.to_string()).collect();
    let instead = if hit.is_empty() {
        "phy.standard has no channel there either, so move the band".to_owned()
    } else {
        format!("move the band, or add one of the channels {} to {key}", hit.join(", "))
    };
    let why = format!("no channel of the hopping sequence lies between {first} and {last} MHz");
    Some(Reason::new(why, instead))
}

/// Why an effect with this need meets nothing.
fn lacks(facts: &Facts<'_>, need: Need) -> Option<Reason> {
    let Surroundings { site, agent_count, .. } = facts.around;
    let (is_lacking, why, instead) = match need {
        Need::Walls => (site.wall.is_empty(), "[site] has no walls", "add [[site.wall]]"),
        Need::Foliage => (site.foliage.is_empty(), "[site] has no foliage", "add [[site.foliage]]"),
        Need::Edges => {
            let has_edges = site.wall.iter().any(|wall| wall.height_m.is_some())
                || site.obstacle.iter().any(|obstacle| obstacle.height_m.is_some());
            (!has_edges, "no wall or obstacle of [site] has a height", "set a height_m in [site]")
        }
        Need::OtherAgents => (
            agent_count <= 2,
            "no robot can be between two others",
            "set experiment.agents to at least 3",
        ),
        _ => return None,
    };
    is_lacking.then(|| Reason::new(why, instead))
}

fn no_broadcast_slotframe(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let keys = facts.network()?;
    let function = facts.catalogue.scheduling_functions.selected(&keys.sf, &sf::TAG);
    swarm::without_slotframe(&keys.swarm, function, &facts.path("swarm"))
}

fn no_handover(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let key = facts.path("mobility.handover_dbm");
    (!facts.network()?.mobility.contains_key("handover_dbm"))
        .then(|| Reason::new(format!("{key} is not set"), "set it, or leave this key out"))
}

fn nobody_needs_admission(facts: &Facts<'_>, _: &str) -> Option<Reason> {
    let keys = facts.network()?;
    let keeps = keys.mobility.get("keep_admission").and_then(toml::Value::as_bool);
    let is_secure = keys.join.get("secure").and_then(toml::Value::as_bool);
    let key = facts.path("join.secure");
    (keeps == Some(true) && is_secure == Some(false)).then(|| {
        Reason::new(
            format!("with {key} = false nobody needs admission"),
            format!("set {key} = true, or leave the key out"),
        )
    })
}
