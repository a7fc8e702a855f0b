//! What tests of effects share: a link, an effect of its keys, a radio.

use super::Effect;
use crate::catalogue::Catalogue;
use crate::link::{End, Link, Scene, channel_hz};
use crate::model::Model;
use crate::propagation::Radio;
use crate::propagation::friis::Friis;
use crate::reception::table::Table;
use proto::effect::Fixed;
use proto::ids::MoteId;

/// A link from node 0 at x = 0 to node 1 at x = `distance_m`, both antennas so high.
pub(crate) fn along_x<'a>(
    distance_m: f64,
    height_m: f64,
    channel: Option<u8>,
    scene: &'a Scene<'a>,
) -> Link<'a> {
    Link {
        sender: End::new(MoteId(0), [0.0, 0.0, height_m]),
        receiver: End::new(MoteId(1), [distance_m, 0.0, height_m]),
        distance_m,
        channel,
        frequency_hz: channel.map_or(2.44e9, channel_hz),
        time_ns: 0,
        scene,
    }
}

/// A radio of free space, the table, and at most one effect.
pub(crate) fn over_friis(effect: Option<Box<dyn Effect>>) -> Model {
    let radio = Radio {
        tx_power_dbm: 0.0,
        tx_antenna_gain_dbi: 0.0,
        rx_antenna_gain_dbi: 0.0,
        carrier_hz: 2.44e9,
    };
    let effects = effect.into_iter().collect();
    Model::new(Box::new(Friis { radio }), effects, Box::new(Table::dust()), radio, 0.1, None)
}

fn checked(name: &str, keys: &str) -> (toml::Table, Vec<proto::config::Problem>) {
    let text = format!("kind = {name:?}\n{keys}");
    let mut problems = Vec::new();
    let node = proto::config::parse(&text).unwrap();
    let catalogue = Catalogue::built_in();
    let (spec, lists) = (&super::SPEC, catalogue.lists());
    let table = proto::config::check(&node, "effect[0]", spec, &lists, &mut problems).table;
    let tables = std::slice::from_ref(&table);
    super::check(tables, "effect", &catalogue.effects, &mut problems);
    (table, problems)
}

/// The effect of this name with these keys.
pub(crate) fn made(name: &str, keys: &str) -> Box<dyn Effect> {
    let (table, problems) = checked(name, keys);
    assert!(problems.is_empty(), "{name}: {problems:?}");
    super::build(&[table], &Catalogue::built_in().effects).pop().unwrap()
}

/// What is wrong with these keys of an effect.
pub(crate) fn problems(name: &str, keys: &str) -> String {
    let (_, problems) = checked(name, keys);
    problems.iter().map(|problem| format!("{problem}\n")).collect()
}

/// Further keys without which an effect of this name cannot be made, though no fit tries them.
fn needed(name: &str) -> &'static str {
    match name {
        "hidden-obstacle" => "centre_m = [1.0, 2.0]\nradius_m = 1.0\n",
        "formula" => "expression = \"0.5 * distance_m\"\n",
        _ => "",
    }
}

#[test]
fn every_effect_can_be_made_from_its_starts_and_bounds_in_every_variant() {
    for entry in Catalogue::built_in().effects.iter() {
        let name = entry.variant.name;
        let variants =
            if entry.fit.variants.is_empty() { &[&[][..]][..] } else { entry.fit.variants };
        for variant in variants {
            for pick in [
                |p: &proto::effect::Parameter| p.starts[0],
                |p: &proto::effect::Parameter| p.starts[p.starts.len() - 1],
                |p: &proto::effect::Parameter| p.min,
                |p: &proto::effect::Parameter| p.max,
            ] {
                let mut keys = needed(name).to_owned();
                for (key, value) in *variant {
                    let value = match value {
                        Fixed::Text(text) => format!("{text:?}"),
                        Fixed::Number(number) => format!("{number:?}"),
                        Fixed::Bool(truth) => truth.to_string(),
                    };
                    keys.push_str(&format!("{key} = {value}\n"));
                }
                for parameter in entry.fit.parameters {
                    let value = pick(parameter);
                    keys.push_str(&format!("{} = {value:?}\n", parameter.key));
                }
                assert_eq!(made(name, &keys).name(), name);
            }
        }
    }
}

#[test]
fn the_list_is_in_order_and_says_everything() {
    let effects = &Catalogue::built_in().effects;
    assert!(effects.iter().is_sorted_by_key(|entry| entry.variant.name));
    for entry in effects.iter() {
        let (name, about, fit) = (entry.variant.name, &entry.about, &entry.fit);
        for text in [about.mechanism, about.equation, about.source, about.validity, about.trace] {
            assert!(20 <= text.len(), "{name}: {text}");
        }
        assert!(!about.needs.is_empty(), "{name}");
        for general in fit.generalises {
            assert!(effects.find(general).is_some() && *general != name, "{name}: {general}");
        }
        for parameter in fit.parameters {
            let key = parameter.key;
            assert!(entry.variant.fields.iter().any(|field| field.key == key), "{name}: {key}");
            assert!(!parameter.starts.is_empty() && 0.0 < parameter.step, "{name}: {key}");
            for &start in parameter.starts {
                assert!(parameter.min <= start && start <= parameter.max, "{name}: {key}");
            }
        }
    }
}
