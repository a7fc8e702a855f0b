//! An effect that is not in the catalogue: antennas near the ground lose power.
//!
//! docs/adding-an-effect.md walks through this file. As it stands it runs by itself:
//! `cargo run --release -p physics --example low_antenna`.

use physics::effect::{Effect, Entry};
use physics::link::Link;
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};
use proto::ids::MoteId;

/// `kind = "low-antenna"`.
pub const ENTRY: Entry = Entry::of::<LowAntenna>();

/// Antennas near the ground lose power.
///
/// # Mechanism
///
/// The ground takes power from an antenna that is within about a wavelength of it.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI - loss_db (e^(-h_t/scale_m) + e^(-h_r/scale_m))
/// ```
///
/// # Source
///
/// An example: not taken from the literature.
///
/// # Validity
///
/// Heights are above flat ground at z = 0.
///
/// # Trace
///
/// Links of low antennas are weak at any distance.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "low-antenna",
    needs = &[Need::Heights, Need::Readings],
    level = Level::Place,
)]
pub struct LowAntenna {
    /// What an antenna on the ground loses (dB).
    #[key(range = 0.0..=60.0)]
    #[fit(unit = "dB", range = 0.0..=40.0, starts = [5.0], step = 0.05, null = 0.0)]
    pub loss_db: f64,
    /// Height (m) at which 1/e of that is left.
    #[key(above = 0.0, most = 100.0, default = 0.3)]
    #[fit(unit = "m", range = 0.05..=5.0, starts = [0.3, 1.0], step = 0.01)]
    pub scale_m: f64,
}

impl Effect for LowAntenna {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        let near = |height_m: f64| libm::exp(-height_m.max(0.0) / self.scale_m);
        -self.loss_db * (near(link.sender.position_m[2]) + near(link.receiver.position_m[2]))
    }
}

fn main() {
    use physics::link::{End, Scene};
    use physics::propagation::{Radio, friis::Friis};
    use physics::reception::table::Table;
    use std::io::Write as _;

    let radio = Radio {
        tx_power_dbm: -10.0,
        tx_antenna_gain_dbi: 0.0,
        rx_antenna_gain_dbi: 0.0,
        carrier_hz: 2.44e9,
    };
    let keys = "loss_db = 6.0\nscale_m = 0.5".parse().unwrap_or_default();
    let effects = (ENTRY.build)(&keys, 0).into_iter().collect();
    let model = physics::Model::new(
        Box::new(Friis { radio }),
        effects,
        Box::new(Table::dust()),
        radio,
        0.1,
        None,
    );
    let scene = Scene::default();
    let mut out = std::io::stdout().lock();
    for height_m in [0.1, 0.3, 1.0, 3.0] {
        let ends = [[0.0, 0.0, height_m], [50.0, 0.0, height_m]].map(|at| End::new(MoteId(0), at));
        let budget = model.evaluate(&model.link(&scene, ends[0], ends[1], None, 0));
        let (rssi_dbm, probability) = (budget.rssi_dbm, budget.reception_probability);
        let _ = writeln!(out, "{height_m} m high: {rssi_dbm:.1} dBm, received {probability:.2}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::link::{End, Scene};

    #[test]
    fn an_antenna_on_the_ground_loses_all_and_one_at_the_scale_1_over_e_of_it() {
        let scene = Scene::default();
        let link = Link {
            sender: End::new(MoteId(0), [0.0, 0.0, 0.0]),
            receiver: End::new(MoteId(1), [9.0, 0.0, 0.5]),
            distance_m: 9.0,
            channel: None,
            frequency_hz: 2.44e9,
            time_ns: 0,
            scene: &scene,
        };
        let effect = LowAntenna { loss_db: 10.0, scale_m: 0.5 };
        let expected = -10.0 * (1.0 + 1.0 / std::f64::consts::E);
        assert!((effect.contribution_db(&link) - expected).abs() < 1e-12);
    }
}
