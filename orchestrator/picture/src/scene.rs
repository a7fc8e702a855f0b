//! What a picture shows, as numbers.

use ::view::view;
use schemars::JsonSchema;
use serde::Serialize;

/// The swarm at the end of a step. Positions are in metres, x to the east and y to the north, to 2 mm: they are for drawing, and
/// `steps.parquet` has the exact ones.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Scene {
    /// Name of the run.
    pub run: String,
    /// Seed of its random draws.
    pub seed: u64,
    /// The step; 0 is the beginning.
    pub step: u64,
    /// Its end (s).
    pub time_s: f64,
    /// Robots that exist or have existed.
    pub robots: Vec<Robot>,
    /// Pairs with at least one delivery in the step, or since the frame before in a video that leaves out steps.
    pub links: Vec<Link>,
    /// Where robots were in the 5 s before.
    pub trails: Vec<Trail>,
    /// Round obstacles where they are now.
    pub obstacles: Vec<Obstacle>,
    /// The part of the plane that the picture must show: least x and y, greatest x and y (m).
    pub extent_m: [[f64; 2]; 2],
}

/// A robot.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Robot {
    /// Its number.
    pub robot: u32,
    /// Position, east (m); of a robot that is lost its last.
    pub x_m: f32,
    /// Position, north (m).
    pub y_m: f32,
    /// Heading from +x towards +y (rad).
    pub heading_rad: f32,
    /// It exists.
    pub alive: bool,
    /// Its radio works.
    pub radio: bool,
    /// Its group, from 0.
    pub group: usize,
}

/// Deliveries from one robot to another.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Link {
    /// The sender.
    pub sender: u32,
    /// The receiver.
    pub receiver: u32,
    /// How many frames were delivered.
    pub received: u32,
    /// How many frames the sender broadcast; 0: not known.
    pub sent: u32,
    /// Received signal strength of the last of them (dBm); absent where the network does not report it.
    pub rssi_dbm: Option<f32>,
}

impl Link {
    /// Share of the broadcast frames that were delivered, at most 1. Of unicast frames only deliveries are known: 1.
    #[must_use]
    pub fn delivery(&self) -> f64 {
        if self.sent == 0 {
            1.0
        } else {
            (f64::from(self.received) / f64::from(self.sent)).min(1.0)
        }
    }
}

/// Where a robot was.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Trail {
    /// The robot.
    pub robot: u32,
    /// Its group, from 0.
    pub group: usize,
    /// How long ago it was at each of `points_m` (s), ascending.
    pub ago_s: Vec<f64>,
    /// From its position now back in time (m).
    pub points_m: Vec<[f32; 2]>,
}

/// A round obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Obstacle {
    /// Its name; may be empty.
    pub name: String,
    /// Its centre (m).
    pub centre_m: [f32; 2],
    /// Its radius (m).
    pub radius_m: f32,
    /// Who knows of it.
    pub kind: Knowledge,
}

/// Who knows of an obstacle or a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Knowledge {
    /// Robots and radio.
    Site,
    /// Only the radio.
    Hidden,
    /// A diagnosis estimated it.
    Estimated,
}

impl From<view::ObstacleKind> for Knowledge {
    fn from(kind: view::ObstacleKind) -> Self {
        match kind {
            view::ObstacleKind::Unspecified => Self::Site,
            view::ObstacleKind::Hidden => Self::Hidden,
            view::ObstacleKind::Estimated => Self::Estimated,
        }
    }
}

impl From<&view::Obstacle> for Obstacle {
    fn from(obstacle: &view::Obstacle) -> Self {
        Self {
            name: obstacle.name.clone(),
            centre_m: [obstacle.x_m, obstacle.y_m],
            radius_m: obstacle.radius_m,
            kind: obstacle.kind().into(),
        }
    }
}
