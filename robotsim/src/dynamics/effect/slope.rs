//! Ground that leads downhill.

use super::{Effect, Entry, Situation, keys};
use proto::config::{Default, Field, Kind, Range, Variant};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "slope"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "slope",
        doc: "A drift downhill, in proportion to the slope of [site.terrain].",
        fields: &[Field {
            key: "gain",
            doc: "k: drift (m/s) where the ground falls by 1 m per metre.",
            kind: Kind::Number(Range::closed(-1e3, 1e3)),
            default: Default::Required,
        }],
    },
    about: About {
        mechanism: "On a slope weight pulls robots downhill, and their drives give way.",
        equation: "v = u - gain * grad h",
        source: "A linearised balance of weight and drive; the form of effects that depend on the place.",
        validity: "Small slopes, drives that give way in proportion. Where no terrain is known, the ground is level.",
        trace: "An error that depends on the place alone, downhill.",
        needs: &[Need::Terrain],
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "gain",
            unit: "m/s",
            min: -1e3,
            max: 1e3,
            starts: &[0.0],
            step: 0.02,
        }],
        variants: &[],
        level: Level::Place,
        generalises: &[],
    },
    build: |table| Some(Box::new(keys::<Slope>(table)?)),
};

/// Drift −k ∇h.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Slope {
    gain: f64,
}

impl Effect for Slope {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn drift_mps(&self, at: &Situation<'_>) -> [f64; 3] {
        let [x_m, y_m, _] = at.position_m;
        let [east, north] =
            at.surroundings.terrain.map_or([0.0; 2], |terrain| terrain.gradient([x_m, y_m]));
        [-self.gain * east, -self.gain * north, 0.0]
    }

    fn drifts(&self) -> bool {
        true
    }

    fn varies_on_the_way(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use crate::dynamics::surroundings::Surroundings;

    #[test]
    fn a_robot_in_a_bowl_creeps_to_its_middle() {
        // A plane tilted by 0.1 to the east: −k 0.1 for all time.
        let terrain = proto::site::Terrain {
            origin_m: [-10.0, -10.0],
            spacing_m: 10.0,
            height_m: vec![vec![0.0, 1.0, 2.0]; 3],
        };
        let surroundings = Surroundings { terrain: Some(&terrain), ..Surroundings::default() };
        let text = "[[effect]]\nkind = 'slope'\ngain = 2.0";
        let end = drive_in(&physics(text), [0.0, 1.0, 0.0], 3.0, &surroundings);
        assert_near(end.position_m, [-0.6, 3.0, 0.0]);
    }
}
