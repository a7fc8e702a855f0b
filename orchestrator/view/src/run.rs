//! What a run is, as known from its start.

use crate::place::{add_effects, place};
use crate::view;
use proto::config;
use proto::exchange::Configured;
use proto::site::{self, Site};
use proto::types::NS_PER_S;
use proto_messages::v1;

/// Channels of the default hopping sequence at 2.4 GHz (IEEE Std 802.15.4-2015, 6.2.10).
const STANDARD_CHANNELS: u32 = 16;

/// Walls, obstacles and ground. They were checked before anything started: of a site that is no site, nothing is drawn.
pub(crate) fn site_of(configured: &Configured) -> Site {
    config::parse(&configured.network_request.site_toml)
        .map(|node| site::read(&node, "site", &mut Vec::new()).0)
        .unwrap_or_default()
}

/// Describes a run of which no step was taken yet.
#[must_use]
pub(crate) fn run_of(name: &str, configured: &Configured) -> view::Run {
    let experiment = &configured.robots_request.experiment;
    let states = &configured.robots_start.states;
    let site = site_of(configured);
    let or = |effective: &str, asked: &str| -> toml::Table {
        let text = if effective.is_empty() { asked } else { effective };
        text.parse().unwrap_or_default()
    };
    let robots =
        or(&configured.robots_start.effective_toml, &configured.robots_request.config_toml);
    let network =
        or(&configured.network_start.effective_toml, &configured.network_request.config_toml);
    // Networks without a schedule have no slots that mean anything to a viewer.
    let has_slots = configured.network_start.formation.is_some();
    let of_slots = |key: &str| network.get(key).filter(|_| has_slots);
    let slot_s = of_slots("slot_duration_s").and_then(toml::Value::as_float);
    let channels = of_slots("hopping_sequence").and_then(toml::Value::as_array);
    let mut place = place(&site, states);
    let effects =
        [("phy", &network), ("dynamics", &robots)].into_iter().flat_map(|(key, table)| {
            let effects = table.get(key).and_then(|section| section.get("effect")?.as_array());
            effects.into_iter().flatten().filter_map(toml::Value::as_table)
        });
    add_effects(&mut place, effects, view::ObstacleKind::Hidden);
    view::Run {
        name: name.to_owned(),
        seed: experiment.seed,
        agent_count: experiment.agent_count as u32,
        step_ns: experiment.step_ns,
        coupling: v1::Coupling::from(experiment.coupling).into(),
        place: Some(place),
        groups: groups(&robots),
        slot_ns: slot_s.map_or(0, |slot_s| libm::round(slot_s * NS_PER_S as f64) as u64),
        channel_count: match channels {
            Some(channels) => channels.len() as u32,
            None if slot_s.is_some() => STANDARD_CHANNELS,
            None => 0,
        },
        ..view::Run::default()
    }
}

/// Groups of robots, if the robots' configuration has any.
fn groups(robots: &toml::Table) -> Vec<view::Group> {
    let groups = robots.get("group").and_then(toml::Value::as_array);
    let groups = groups.into_iter().flatten().filter_map(|group| {
        let kind = |key: &str| -> Option<&str> {
            group.get(key).or_else(|| robots.get(key))?.get("kind")?.as_str()
        };
        let words: Vec<&str> = ["controller", "dynamics"].into_iter().filter_map(kind).collect();
        let count = u32::try_from(group.get("count")?.as_integer()?).ok()?;
        Some(view::Group { name: words.join(", "), count })
    });
    groups.collect()
}
