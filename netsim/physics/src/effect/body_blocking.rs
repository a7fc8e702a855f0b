//! Others in the way.

use super::{Effect, Entry};
use crate::link::{Link, Scene};
use crate::sight::{bodies_in_first_zone, prepare_bodies};
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "body-blocking"`.
pub const ENTRY: Entry = Entry::of::<BodyBlocking>();

/// The body of every other robot in the direct path attenuates.
///
/// # Mechanism
///
/// A robot or a person between two others obstructs part of the wave, within about the first Fresnel zone.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI - loss_db * (other agents between the ends, nearer to the straight path than blocker_radius_m + sqrt(lambda
/// d1 d2/(d1 + d2)), seen from above)
/// ```
///
/// # Source
///
/// ITU-R P.526 (obstruction of the first Fresnel zone, radius sqrt(lambda d1 d2/(d1 + d2))); a fixed loss to a body as measured for
/// people, e.g. ITU-R P.1238.
///
/// # Validity
///
/// A body blocks fully or not at all, independently of its height. Only agents whose radio is on are known.
///
/// # Trace
///
/// Links are weak only while a third robot is between their ends.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "body-blocking",
    needs = &[Need::Positions, Need::Readings, Need::OtherAgents, Need::Movement],
    example = "loss_db = 6.0\nblocker_radius_m = 0.5\n",
)]
pub struct BodyBlocking {
    /// Loss per body (dB).
    #[key(range = 0.0..=60.0)]
    #[fit(
        unit = "dB",
        range = 0.0..=40.0,
        starts = [3.0],
        step = 0.05,
        null = 0.0,
        plausible = 0.0..=30.0,
        source = "Abbas and Tufvesson, Int. J. Antennas and Propagation 2013: 10 to 20 dB behind vehicles",
    )]
    pub loss_db: f64,
    /// Radius of a body around its antenna (m). 0.5: the radius of the first Fresnel zone in the middle of a link of 8 m.
    #[key(above = 0.0, most = 100.0, default = 0.5)]
    #[fit(unit = "m", range = 0.05..=5.0, starts = [0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.7, 0.8, 1.0, 1.5], step = 0.02)]
    pub blocker_radius_m: f64,
}

impl Effect for BodyBlocking {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        -self.loss_db * bodies_in_first_zone(link, self.blocker_radius_m).count() as f64
    }

    fn prepare(&self, scene: &mut Scene<'_>) {
        prepare_bodies(scene);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::along_x;
    use crate::link::End;
    use proto::ids::MoteId;

    #[test]
    fn bodies_in_the_path_add_up_and_the_ends_are_none() {
        let effect = BodyBlocking { loss_db: 4.0, blocker_radius_m: 0.5 };
        let contribution_among = |places: &[[f64; 2]]| {
            let ends = [[0.0, 0.0], [10.0, 0.0]];
            let agents: Vec<End> = (0..)
                .zip(ends.iter().chain(places))
                .map(|(id, &[x, y])| End::new(MoteId(id), [x, y, 1.0]))
                .collect();
            let mut scene = Scene { agents: &agents, ..Scene::default() };
            effect.prepare(&mut scene);
            effect.contribution_db(&along_x(10.0, 1.0, None, &scene))
        };
        assert_eq!(contribution_among(&[]), 0.0);
        assert_eq!(contribution_among(&[[5.0, 0.5]]), -4.0);
        // The zone is 0.55 m wide in the middle of 10 m, and nothing at the ends.
        assert_eq!(contribution_among(&[[5.0, 1.03]]), -4.0);
        assert_eq!(contribution_among(&[[5.0, 1.08], [0.5, 0.9], [10.2, 0.0]]), 0.0);
        assert_eq!(contribution_among(&[[2.0, 0.1], [7.0, -0.3], [7.0, 3.0]]), -8.0);
        // Enough of them for the grid.
        let many: Vec<[f64; 2]> =
            (0..40).map(|i| [f64::from(i) / 4.0 + 0.1, f64::from(i % 4)]).collect();
        // All ten on the path, and those 1 m off it where the zone is wider than half a metre: at 3.35 to 6.35 m.
        assert_eq!(contribution_among(&many), -56.0);
    }
}
