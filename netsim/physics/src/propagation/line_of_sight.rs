//! Who sees whom.

use super::friis::within;
use super::{
    AssignedRssi, Entry, Family, NOT_REPLAYED, Prediction, Propagation, Reach, Reading, Reception,
};
use crate::link::{Link, Scene};
use crate::sight::{Path, is_blocked_by_body, off_heading_rad, prepare_bodies};
use proto::config::{Range, Section, variant};

/// `propagation = "line-of-sight"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("line-of-sight"),
    family: Family::Connectivity,
    replay: NOT_REPLAYED,
    build: |table, context| {
        let keys = Keys::read(table);
        Some(Box::new(LineOfSight {
            radius_m: keys.radius_m,
            field_of_view_rad: keys.field_of_view_rad,
            body_radius_m: keys.robots_block.then_some(keys.body_radius_m),
            rssi: AssignedRssi::new(context.radio, keys.reading.rssi_dbm),
        }))
    },
};

/// Line of sight: every frame arrives if no wall or obstacle of \[site\] cuts the direct path, and none otherwise.
#[derive(Section)]
struct Keys {
    /// Maximum distance (m), itself included. Absent: unlimited.
    #[key(range = Range::LENGTH)]
    radius_m: Option<f64>,
    /// Full opening angle of the sender in the plane, about its heading, or about its direction of motion if no heading is known. A
    /// sender at rest without a heading is omnidirectional. Absent: omnidirectional.
    #[key(above = 0.0, most = std::f64::consts::TAU)]
    field_of_view_rad: Option<f64>,
    /// Whether the bodies of other robots block the path, too.
    #[key(default = false)]
    robots_block: bool,
    /// Radius of a robot's body, a ball around its antenna (m). Used with robots_block only.
    #[key(range = Range::LENGTH, default = 0.1)]
    body_radius_m: f64,
    #[key(flatten)]
    reading: Reading,
}

/// Line of sight, for light and as an abstraction of radio at high frequencies.
///
/// # Model
///
/// PDR 1 where the straight path between the antennas touches no wall, no obstacle and, if asked for, no third robot's
/// body, the distance is at most the radius, and the receiver lies within the sender's field of view; 0 elsewhere.
///
/// # Validity
///
/// No diffraction, no reflection, nothing passes through a wall: pessimistic for radio at 2.4 GHz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineOfSight {
    /// Greatest distance (m).
    pub radius_m: Option<f64>,
    /// Opening angle of the sender (rad).
    pub field_of_view_rad: Option<f64>,
    /// Radius of the bodies that block (m).
    pub body_radius_m: Option<f64>,
    /// RSSI that is assigned to received frames (dBm).
    pub rssi: AssignedRssi,
}

impl LineOfSight {
    fn sees(&self, link: &Link<'_>) -> bool {
        let path = Path::direct(link);
        self.radius_m.is_none_or(|radius_m| link.distance_m <= radius_m)
            && self.field_of_view_rad.is_none_or(|angle_rad| is_in_view(link, angle_rad))
            && link.scene.site.is_none_or(|site| {
                !site.wall.iter().any(|wall| path.is_cut_by_wall(wall))
                    && !site.obstacle.iter().any(|obstacle| path.is_cut_by_obstacle(obstacle))
            })
            && self.body_radius_m.is_none_or(|radius_m| !is_blocked_by_body(link, radius_m))
    }
}

/// Whether the receiver lies within the sender's field of view. Straight above or below it does.
fn is_in_view(link: &Link<'_>, angle_rad: f64) -> bool {
    off_heading_rad(link).is_none_or(|off_rad| off_rad.abs() <= 0.5 * angle_rad)
}

impl Propagation for LineOfSight {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        Prediction {
            rssi_dbm: self.rssi.dbm(link),
            reception: Reception::Stated(if self.sees(link) { 1.0 } else { 0.0 }),
        }
    }

    fn reach(&self, _: f64, _: f64) -> Reach {
        self.radius_m.map_or(Reach::Unlimited, within)
    }

    fn prepare(&self, scene: &mut Scene<'_>) {
        if self.body_radius_m.is_some() {
            prepare_bodies(scene);
        }
    }
}
