//! A part of the plane that slows robots down.

use super::{Effect, Entry};
use proto::config::{Range, Section};
use proto::effect::{Catalogued, Level, Need, Search};

/// `kind = "rough-ground"`.
pub(super) const ENTRY: Entry = Entry::of::<RoughGround>();

/// Speed is scaled inside a disc on the ground.
///
/// # Mechanism
///
/// On grass, sand or carpet, wheels slip more than elsewhere.
///
/// # Equation
///
/// ```text
/// v = scale * u within radius_m of centre_m
/// ```
///
/// # Source
///
/// Definition.
///
/// # Validity
///
/// One disc with a sharp border; use several effects for several discs.
///
/// # Trace
///
/// An error along the motion, inside one place only.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "rough-ground",
    needs = &[Need::VelocityCommands],
    example = "centre_m = [10.0, 5.0]\nradius_m = 4.0\nscale = 0.6\n",
    level = Level::Place,
    generalises = &["slip"],
    search = Search::Discs,
    needs_one_frame = true,
)]
struct RoughGround {
    /// Centre of the disc (x, y in m).
    #[key(range = Range::PLACE)]
    #[fit(key = "centre_m[0]", unit = "m", range = -1e6..=1e6, starts = [0.0], step = 0.1)]
    #[fit(key = "centre_m[1]", unit = "m", range = -1e6..=1e6, starts = [0.0], step = 0.1)]
    centre_m: [f64; 2],
    /// Radius of the disc (m).
    #[key(range = Range::LENGTH)]
    #[fit(unit = "m", range = 0.1..=1e4, starts = [5.0], step = 0.1)]
    radius_m: f64,
    /// Ratio of the speed inside the disc to that outside.
    #[key(range = 0.0..=10.0)]
    #[fit(
        unit = "1",
        range = 0.0..=5.0,
        starts = [0.7],
        step = 0.01,
        null = 1.0,
        plausible = 0.0..=2.0,
        source = "Wong, Theory of Ground Vehicles: a slip of 0 to 1 of the commanded speed",
    )]
    scale: f64,
}

impl Effect for RoughGround {
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

    fn is_uniform(&self, position_m: [f64; 3], reach_m: f64) -> bool {
        let [x_m, y_m] = [0, 1].map(|axis| position_m[axis] - self.centre_m[axis]);
        let reach_m = reach_m * self.scale.max(1.0);
        reach_m < (libm::hypot(x_m, y_m) - self.radius_m).abs()
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
