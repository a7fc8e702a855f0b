//! A robot that is slower than assumed.

use super::{Drive, Effect, Entry, Shape, with_speed};
use proto::config::Section;
use proto::effect::{Bounds, Catalogued, Need, Search};

/// `kind = "speed-limit"`.
pub(super) const ENTRY: Entry = Entry::of::<SpeedLimit>();

/// The speed is limited below the model's speed cap.
///
/// # Mechanism
///
/// A drive saturates, or firmware limits it, below the speed that the model assumes.
///
/// # Equation
///
/// ```text
/// |v| <= limit_mps, direction kept
/// ```
///
/// # Source
///
/// Definition.
///
/// # Validity
///
/// One limit in all directions.
///
/// # Trace
///
/// An error only at commanded speeds above the limit, against the motion, growing with the speed.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "speed-limit",
    needs = &[Need::VelocityCommands],
    example = "limit_mps = 1.2\n",
    search = Search::Thresholds { only_below: false },
    bounds = Some(Bounds::Speed),
)]
struct SpeedLimit {
    /// Maximum speed (m/s).
    #[key(above = 0.0, most = 1e4)]
    #[fit(unit = "m/s", range = 0.01..=1e4, starts = [0.1, 0.2, 0.4, 0.8, 1.5, 3.0, 5.0, 8.0, 12.0, 16.0, 20.0, 24.0, 28.0], step = 0.05)]
    limit_mps: f64,
}

impl Effect for SpeedLimit {
    fn shape(&self, shape: Shape, demand: Drive) -> Drive {
        with_speed(shape, demand, |speed_mps| speed_mps.min(self.limit_mps))
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn no_robot_is_faster_and_directions_are_kept() {
        let text = "[[effect]]\nkind = 'speed-limit'\nlimit_mps = 5.0";
        assert_near(drive(text, [6.0, -8.0, 0.0], 2.0).position_m, [6.0, -8.0, 0.0]);
        assert_near(drive(text, [3.0, 0.0, 0.0], 2.0).position_m, [6.0, 0.0, 0.0]);
        let end = drive(&format!("kind = 'unicycle'\n{text}"), [-7.0, 0.0, 0.0], 2.0);
        assert_near(end.position_m, [-10.0, 0.0, 0.0]);
    }
}
