//! What is around a robot, as far as its motion depends on it.

use proto::rng::Draws;
use proto::site::Hill;

/// What is around robots during a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surroundings<'a> {
    /// The ground: its hills.
    pub terrain: &'a [Hill],
    /// The others, as they were at `others_at_s`.
    pub others: &'a [Other],
    /// When (s) the others were there.
    pub others_at_s: f64,
    /// Draws for gusts. `None`: there are no gusts.
    pub draws: Option<Draws>,
}

/// Another robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Other {
    /// Where it was (m).
    pub position_m: [f64; 3],
    /// With which velocity (m/s) it goes on from there.
    pub velocity_mps: [f64; 3],
}
