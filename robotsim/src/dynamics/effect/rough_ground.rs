//! A part of the plane that slows robots down.

use super::{Effect, Entry, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter, Search};
use serde::Deserialize;

/// `kind = "rough-ground"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "rough-ground",
        doc: "Speed is scaled inside a disc on the ground.",
        fields: &[
            Field {
                key: "centre_m",
                doc: "Centre of the disc (x, y in m).",
                kind: Kind::List { of: &Kind::Number(Range::PLACE), min: 2, max: 2 },
                default: Default::Required,
            },
            Field {
                key: "radius_m",
                doc: "Radius of the disc (m).",
                kind: Kind::Number(Range::LENGTH),
                default: Default::Required,
            },
            Field {
                key: "scale",
                doc: "Ratio of the speed inside the disc to that outside.",
                kind: Kind::Number(Range::closed(0.0, 10.0)),
                default: Default::Required,
            },
        ],
    },
    about: About {
        mechanism: "On grass, sand or carpet, wheels slip more than elsewhere.",
        equation: "v = scale * u within radius_m of centre_m",
        source: "Definition.",
        validity: "One disc with a sharp border; use several effects for several discs.",
        trace: "An error along the motion, inside one place only.",
        needs: &[Need::VelocityCommands],
        example: "centre_m = [10.0, 5.0]\nradius_m = 4.0\nscale = 0.6\n",
    },
    fit: Fit {
        parameters: &[
            Parameter {
                key: "centre_m[0]",
                unit: "m",
                min: -1e6,
                max: 1e6,
                starts: &[0.0],
                step: 0.1,
            },
            Parameter {
                key: "centre_m[1]",
                unit: "m",
                min: -1e6,
                max: 1e6,
                starts: &[0.0],
                step: 0.1,
            },
            Parameter { key: "radius_m", unit: "m", min: 0.1, max: 1e4, starts: &[5.0], step: 0.1 },
            Parameter { key: "scale", unit: "1", min: 0.0, max: 5.0, starts: &[0.7], step: 0.01 },
        ],
        variants: &[],
        level: Level::Place,
        generalises: &["slip"],
        search: Search::Discs,
        needs_one_frame: true,
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<RoughGround>(table))),
};

/// Speed scaled within a disc.
///
/// # Model
///
/// ```text
/// v = k u  where |x − c| ≤ r,        else v = u
/// ```
///
/// By definition. Over a way that lies partly inside, the mean of both, weighted by length.
///
/// # Arguments
///
/// * `centre_m` c: centre of the disc (x, y in m).
/// * `radius_m` r: its radius (m), greater than 0.
/// * `scale` k: speed over ground per speed asked for (1), not negative.
///
/// # Validity
///
/// One disc with a sharp border, at all heights; several effects for several discs, whose scales are multiplied where they overlap. Turning
/// rates are as they were. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct RoughGround {
    centre_m: [f64; 2],
    radius_m: f64,
    scale: f64,
}

impl Effect for RoughGround {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    /// Over a chord that lies partly inside, the mean of both, by length.
    fn ground_scale(&self, from_m: [f64; 3], to_m: [f64; 3]) -> f64 {
        let from = [from_m[0] - self.centre_m[0], from_m[1] - self.centre_m[1]];
        let step = [to_m[0] - from_m[0], to_m[1] - from_m[1]];
        let (a, b, c) = (
            step[0] * step[0] + step[1] * step[1],
            from[0] * step[0] + from[1] * step[1],
            from[0] * from[0] + from[1] * from[1] - self.radius_m * self.radius_m,
        );
        let discriminant = b * b - a * c;
        let inside = if a == 0.0 {
            if c <= 0.0 { 1.0 } else { 0.0 }
        } else if discriminant <= 0.0 {
            0.0
        } else {
            let root = libm::sqrt(discriminant);
            let enters = ((-b - root) / a).clamp(0.0, 1.0);
            let leaves = ((-b + root) / a).clamp(0.0, 1.0);
            leaves - enters
        };
        1.0 + (self.scale - 1.0) * inside
    }

    fn varies_on_the_way(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn a_robot_is_slow_inside_and_as_ever_outside() {
        // 4 m at 2 m/s to the disc, 2 m at 1 m/s through it, 0.5 s on: 4.5 s, 7 m.
        let text =
            "[[effect]]\nkind = 'rough-ground'\ncentre_m = [5.0, 0.0]\nradius_m = 1.0\nscale = 0.5";
        let end = drive(text, [2.0, 0.0, 0.0], 4.5).position_m;
        // At each border one step of 10 ms is half inside: 10 ms × 2 m/s × 0.5 at most.
        assert!((end[0] - 7.0).abs() < 0.01, "{end:?}");
        assert_near(drive(text, [0.0, 2.0, 0.0], 4.0).position_m, [0.0, 8.0, 0.0]);
    }
}
