//! Effects that may be missing from a network, and the values at which they are tried.

use netsim::catalogue::Catalogue;
use numbers::format::number;
use proto::config::Kind;
use proto::effect::{About, Parameter};

/// An effect that is tried by simulation: one number of it is fitted.
#[derive(Clone, Debug)]
pub struct CandidateEffect {
    /// Name of the effect in the catalogue.
    pub name: &'static str,
    /// The layer of the network that has it: `mac` or `phy`.
    pub layer: &'static str,
    /// What people should know of it.
    pub about: &'static About,
    /// The number that is fitted.
    pub parameter: &'static Parameter,
    /// Whether that is a whole number.
    pub is_whole: bool,
    /// Its further keys.
    fixed: Vec<(&'static str, toml::Value)>,
}

/// Places that are looked at from a tried value up to the next one.
const BETWEEN: usize = 12;
/// Values at which an effect with one start only is tried, as steps from there on its scale.
const STEPS: [f64; 5] = [-1.0, 0.0, 1.0, 2.0, 3.0];

/// All effects that are tried, in a fixed order.
#[must_use]
pub fn all(catalogue: &Catalogue) -> Vec<CandidateEffect> {
    let mut list: Vec<CandidateEffect> = Vec::new();
    for entry in catalogue.mac_effects.iter() {
        let Some(parameter) = entry.fit.parameters.first() else { continue };
        let fixed = entry.fit.variants.first().copied().unwrap_or_default();
        let field = entry.variant.fields.iter().find(|field| field.key == parameter.key);
        list.push(CandidateEffect {
            name: entry.variant.name,
            layer: "mac",
            about: &entry.about,
            parameter,
            is_whole: field.is_some_and(|field| matches!(field.kind, Kind::Integer { .. })),
            fixed: fixed.iter().map(|(key, value)| (*key, value.value())).collect(),
        });
    }
    for entry in catalogue.physics.effects.iter() {
        let (Some(parameter), Some(fixed)) = (entry.fit.parameters.first(), entry.fit.in_runs)
        else {
            continue;
        };
        list.push(CandidateEffect {
            name: entry.variant.name,
            layer: "phy",
            about: &entry.about,
            parameter,
            is_whole: false,
            fixed: fixed.iter().map(|(key, value)| (*key, value.value())).collect(),
        });
    }
    list
}

impl CandidateEffect {
    /// A share: its scale is that of log odds. Everything else is a ratio: logarithm.
    fn is_share(&self) -> bool {
        self.parameter.max == 1.0
    }

    /// A value on the scale on which it is searched.
    #[must_use]
    pub fn scaled(&self, value: f64) -> f64 {
        if self.is_share() { libm::log(value / (1.0 - value)) } else { libm::log(value) }
    }

    /// The value at a place of the scale, within its range; the nearest whole one where it must be whole.
    #[must_use]
    pub fn value(&self, at: f64) -> f64 {
        let Parameter { min, max, step, .. } = *self.parameter;
        let value = if self.is_share() { 1.0 / (1.0 + libm::exp(-at)) } else { libm::exp(at) };
        // None of it at all, and all of a share, are nowhere on the scale.
        let most = if self.is_share() { max - 1e-3 } else { max };
        let value = value.clamp(min.max(1e-2 * step), most);
        if self.is_whole { value.round().max(min) } else { value }
    }

    /// A value as it is written: four digits are more than simulations tell.
    #[must_use]
    pub fn rounded(&self, value: f64) -> f64 {
        numbers::format::rounded(value, 4)
    }

    /// Where it is tried first, on its scale, ascending: its starts and one beyond them on either side.
    #[must_use]
    pub fn first_tries(&self) -> Vec<f64> {
        let starts: Vec<f64> =
            self.parameter.starts.iter().map(|&start| self.scaled(start)).collect();
        let mut tries = match starts[..] {
            [] => Vec::new(),
            [only] => STEPS.map(|step| only + step).to_vec(),
            [first, second, ..] => {
                let [.., before, last] = starts[..] else { return starts };
                let mut tries = vec![2.0 * first - second];
                tries.extend(&starts);
                tries.push(2.0 * last - before);
                tries
            }
        };
        for at in &mut tries {
            *at = self.scaled(self.value(*at));
        }
        tries.dedup();
        tries
    }

    /// Where it is looked at between two places of its scale that were tried, the first of them included: at whole numbers
    /// only, where it must be whole.
    #[must_use]
    pub fn values_between(&self, from: f64, to: f64) -> Vec<f64> {
        let place = |k: usize| from + k as f64 / BETWEEN as f64 * (to - from);
        let mut places: Vec<f64> = (0..BETWEEN).map(place).collect();
        if self.is_whole {
            for at in &mut places {
                *at = self.scaled(self.value(*at));
            }
            places.dedup();
            // What is the next tried value, but for rounding, is looked at there.
            places.retain(|at| *at < to - 1e-6);
        }
        places
    }

    /// The keys of its section.
    #[must_use]
    pub fn settings(&self, value: f64) -> toml::Table {
        let mut keys = toml::Table::new();
        keys.insert("kind".to_owned(), self.name.into());
        let number = if self.is_whole {
            toml::Value::Integer(value as i64)
        } else {
            toml::Value::Float(value)
        };
        keys.insert(self.parameter.key.to_owned(), number);
        keys.extend(self.fixed.iter().map(|(key, value)| ((*key).to_owned(), value.clone())));
        keys
    }

    /// A network's section with this effect added.
    #[must_use]
    pub fn added(&self, network: &toml::Table, value: f64) -> toml::Table {
        let mut network = network.clone();
        let layer =
            network.entry(self.layer).or_insert_with(|| toml::Value::Table(toml::Table::new()));
        if let Some(layer) = layer.as_table_mut() {
            let list = layer.entry("effect").or_insert_with(|| toml::Value::Array(Vec::new()));
            if let Some(list) = list.as_array_mut() {
                list.push(toml::Value::Table(self.settings(value)));
            }
        }
        network
    }

    /// Its number, in words: `delay_s = 0.6 s`.
    #[must_use]
    pub fn setting_text(&self, value: f64) -> String {
        let Parameter { key, unit, .. } = *self.parameter;
        let space = if unit.is_empty() { "" } else { " " };
        format!("{key} = {}{space}{unit}", number(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_of_the_network_is_tried_within_its_range() {
        let all = all(Catalogue::built_in());
        let names: Vec<&str> = all.iter().map(|candidate| candidate.name).collect();
        for entry in Catalogue::built_in().mac_effects.iter() {
            assert!(names.contains(&entry.variant.name), "{names:?}");
        }
        assert!(names.contains(&"interference"));
        for candidate in &all {
            let tries = candidate.first_tries();
            assert!(4 <= tries.len(), "{}: {tries:?}", candidate.name);
            assert!(tries.is_sorted(), "{}: {tries:?}", candidate.name);
            for at in tries {
                let value = candidate.value(at);
                let Parameter { min, max, .. } = *candidate.parameter;
                assert!((min..=max).contains(&value), "{}: {value}", candidate.name);
                assert!((candidate.scaled(value) - at).abs() < 1e-9, "{}: {value}", candidate.name);
            }
        }
    }

    #[test]
    fn whole_numbers_between_those_that_were_tried_are_looked_at() {
        let all = all(Catalogue::built_in());
        let queue = all.iter().find(|candidate| candidate.is_whole).unwrap();
        let between = |from: f64, to: f64| -> Vec<f64> {
            let places = queue.values_between(queue.scaled(from), queue.scaled(to));
            places.into_iter().map(|at| queue.value(at)).collect()
        };
        assert_eq!(between(1.0, 2.0), [1.0]);
        assert_eq!(between(2.0, 4.0), [2.0, 3.0]);
        assert_eq!(between(4.0, 8.0), [4.0, 5.0, 6.0, 7.0]);
    }

    #[test]
    fn an_effect_is_added_to_those_that_are_there() {
        let all = all(Catalogue::built_in());
        let network: toml::Table =
            "[mac]\neffect = [{ kind = \"queue-limit\", frames = 3 }]".parse().unwrap();
        let added = all[0].added(&network, 0.25);
        let list = added["mac"]["effect"].as_array().unwrap();
        assert_eq!(list.len(), 2);
        assert_eq!(list[1]["kind"].as_str(), Some("ack-loss"));
        assert_eq!(list[1]["probability"].as_float(), Some(0.25));
        let interference = all.last().unwrap().added(&network, 0.5);
        assert_eq!(interference["phy"]["effect"][0]["width_mhz"].as_float(), Some(80.0));
    }
}
