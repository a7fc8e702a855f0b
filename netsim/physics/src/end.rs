//! The ends of links: an antenna, and how it moves.

use proto::ids::MoteId;

/// One end of a link: an antenna and the body that carries it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct End {
    /// Number of the mote.
    pub id: MoteId,
    /// Position of the antenna (m).
    pub position_m: [f64; 3],
    /// Direction the body faces (rad, from +x towards +y), if it is known.
    pub heading_rad: Option<f64>,
    /// Velocity (m/s), if it is known.
    pub velocity_mps: Option<[f64; 3]>,
}

impl End {
    /// An end with a known position, and without heading or velocity.
    #[must_use]
    pub fn new(id: MoteId, position_m: [f64; 3]) -> Self {
        Self { id, position_m, heading_rad: None, velocity_mps: None }
    }

    /// Square of the distance to another end (m²), in space.
    #[inline]
    #[must_use]
    pub fn distance_squared_m2(&self, other: &Self) -> f64 {
        let [ax, ay, az] = self.position_m;
        let [bx, by, bz] = other.position_m;
        distance_squared_m2([ax - bx, ay - by, az - bz])
    }
}

/// Square of a length (m²). The one place where it is summed, so that every path rounds alike.
#[inline]
#[must_use]
pub fn distance_squared_m2([dx, dy, dz]: [f64; 3]) -> f64 {
    dx * dx + dy * dy + dz * dz
}
