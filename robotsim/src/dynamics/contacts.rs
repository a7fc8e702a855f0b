//! Contacts: robots that cannot be where a wall, an obstacle or another robot is.

use super::norm;
use proto::config::Section;
use proto::site::{Obstacle, Site, Wall};

/// What happens when robots touch each other, walls and obstacles.
#[derive(Section)]
pub(crate) struct Keys {
    /// The response to contacts.
    #[key(tag)]
    kind: Option<Response>,
}

#[derive(Section)]
enum Response {
    /// Robots pass through; collisions are only counted.
    Count,
    /// Contacts are resolved: robots are discs of `diameter_m` that push each other, and walls and obstacles of `\[site\]` are solid.
    Resolve {
        /// Coefficient of restitution of bodies with inertia: ratio of the speed after a contact to that before.
        #[key(range = 0.0..=1.0, default = 0.0)]
        restitution: f64,
    },
}

/// How contacts are resolved.
///
/// # Model
///
/// Robots are balls of equal mass without friction; walls and obstacles are upright and do not give way. A robot goes its
/// way in pieces of at most half its radius. After each it is put back to where it touches whatever it would be in, along
/// the normal, so that it slides along walls; two robots are put apart by half of what is missing each. No piece crosses the
/// middle of a wall: where two walls leave no room, the robot stays where it was.
///
/// Bodies that keep their velocity change it by an impulse along the normal n of the contact, e being the restitution (the
/// collision law of Newton, e.g. Goldsmith, Impact, § 2.2):
///
/// ```text
/// wall:    v' = v − (1 + e) ((v − w) · n) n        w: velocity of a moving obstacle
/// robots:  v_a' = v_a + j n,  v_b' = v_b − j n,    j = (1 + e)/2 ((v_b − v_a) · n),  n from a to b
/// ```
///
/// Momentum of a pair is kept, and of its kinetic energy 1 − e² of what is in the motion towards each other is lost. Other
/// bodies have no velocity to change: they are held up for as long as the contact lasts, and one that meets a body that
/// keeps its velocity is to it what a moving wall is.
///
/// # Validity
///
/// No friction, no spin, one mass. A contact is found up to a quarter of the diameter late. In a crowd some overlap may be
/// left: pairs are put apart in eight rounds. Height counts: robots pass over walls and obstacles that have a top. Not
/// validated against hardware.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contacts {
    pub(super) radius_m: f64,
    pub(super) restitution: f64,
}

/// A robot among others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disc {
    pub(super) position_m: [f64; 3],
    /// Of a body that keeps its velocity (m/s).
    pub(super) velocity_mps: Option<[f64; 3]>,
    /// With which velocity (m/s) its actuators drive it in this part of a step.
    pub(super) driven_mps: [f64; 3],
}

/// What robots cannot enter: everything within `radius_m` of a straight, upright wall, or of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Solid {
    from_m: [f64; 2],
    to_m: [f64; 2],
    radius_m: f64,
    height_m: f64,
    velocity_mps: [f64; 2],
}

/// Longest part (s) of a step after which contacts are looked for.
const PART_S: f64 = 0.01;
/// How often a robot is put out of what is solid, and robots are put apart, one after the other.
const N_ROUNDS: usize = 8;
/// By how much farther than where they touch robots are put, as a share of the radius: contacts end.
const CLEARANCE: f64 = 1e-9;

impl Contacts {
    /// As configured: `None` where they are only counted.
    pub(crate) fn build(keys: &Keys, diameter_m: f64) -> Option<Self> {
        match keys.kind.as_ref()? {
            Response::Count => None,
            &Response::Resolve { restitution } => {
                Some(Self { radius_m: 0.5 * diameter_m, restitution })
            }
        }
    }

    /// Robots of this diameter (m) that part with no speed of their own.
    pub(super) fn inelastic(diameter_m: f64) -> Self {
        Self { radius_m: 0.5 * diameter_m, restitution: 0.0 }
    }

    /// In how many parts robots that are at most this fast go on for `dt_s`.
    pub(super) fn n_parts(&self, dt_s: f64, fastest_mps: f64) -> usize {
        let parts = (dt_s / PART_S).max(dt_s * fastest_mps / (0.5 * self.radius_m));
        libm::ceil(parts).max(1.0) as usize
    }

    /// A robot that goes by `way_m`, as far as it can.
    pub(super) fn walk(&self, solids: &[Solid], disc: Disc, way_m: [f64; 3]) -> Disc {
        let length_m = libm::hypot(way_m[0], way_m[1]);
        let n = libm::ceil(length_m / (0.5 * self.radius_m)).max(1.0);
        let piece_m = way_m.map(|part_m| part_m / n);
        (0..n as usize).fold(disc, |disc, _| self.piece(solids, disc, piece_m))
    }

    /// A robot that goes by less than its radius.
    fn piece(&self, solids: &[Solid], disc: Disc, way_m: [f64; 3]) -> Disc {
        let begin_m = disc.position_m;
        let mut disc = Disc { position_m: std::array::from_fn(|i| begin_m[i] + way_m[i]), ..disc };
        let height_m = disc.position_m[2];
        for _ in 0..N_ROUNDS {
            let mut is_free = true;
            for solid in solids.iter().filter(|solid| height_m < solid.height_m) {
                is_free &= !self.leave(solid, begin_m, &mut disc);
            }
            if is_free {
                break;
            }
        }
        let is_through =
            |solid: &Solid| height_m < solid.height_m && solid.is_crossed(begin_m, disc.position_m);
        if solids.iter().any(is_through) {
            disc.position_m = [begin_m[0], begin_m[1], height_m];
        }
        disc
    }

    /// Puts a robot that came from `begin_m` out of a solid. Whether it was in it.
    fn leave(&self, solid: &Solid, begin_m: [f64; 3], disc: &mut Disc) -> bool {
        let reach_m = self.radius_m + solid.radius_m;
        let away = |from_m: [f64; 3]| {
            let core_m = solid.nearest_m(from_m);
            [from_m[0] - core_m[0], from_m[1] - core_m[1]]
        };
        let [x, y] = away(disc.position_m);
        let distance_m = libm::hypot(x, y);
        if reach_m <= distance_m {
            return false;
        }
        // Where it came from says on which side it is.
        let side = away(begin_m);
        let is_behind = x * side[0] + y * side[1] < 0.0;
        let normal = if is_behind || distance_m == 0.0 {
            unit([side[0], side[1], 0.0]).unwrap_or([1.0, 0.0, 0.0])
        } else {
            [x / distance_m, y / distance_m, 0.0]
        };
        let core_m = [disc.position_m[0] - x, disc.position_m[1] - y];
        for axis in 0..2 {
            disc.position_m[axis] = core_m[axis] + reach_m * (1.0 + CLEARANCE) * normal[axis];
        }
        if let Some(velocity_mps) = &mut disc.velocity_mps {
            let [wx, wy] = solid.velocity_mps;
            let closing_mps =
                (velocity_mps[0] - wx) * normal[0] + (velocity_mps[1] - wy) * normal[1];
            if closing_mps < 0.0 {
                for (component, part) in velocity_mps.iter_mut().zip(normal) {
                    *component -= (1.0 + self.restitution) * closing_mps * part;
                }
            }
        }
        true
    }

    /// Puts robots apart that are in each other.
    pub(super) fn separate(&self, solids: &[Solid], discs: &mut [Disc]) {
        let diameter_m = 2.0 * self.radius_m;
        let mut by_x: Vec<usize> = (0..discs.len()).collect();
        by_x.sort_by(|&a, &b| {
            discs[a].position_m[0].total_cmp(&discs[b].position_m[0]).then(a.cmp(&b))
        });
        // A robot that is put aside may meet one that was a little farther away.
        let range_m = 1.5 * diameter_m;
        let mut pairs = Vec::new();
        for (place, &a) in by_x.iter().enumerate() {
            for &b in &by_x[place + 1..] {
                let [x, y, z]: [f64; 3] =
                    std::array::from_fn(|i| discs[b].position_m[i] - discs[a].position_m[i]);
                if range_m < x {
                    break;
                }
                if x * x + y * y + z * z < range_m * range_m {
                    pairs.push((a.min(b), a.max(b)));
                }
            }
        }
        pairs.sort_unstable();
        for _ in 0..N_ROUNDS {
            let mut is_free = true;
            for &(a, b) in &pairs {
                let between: [f64; 3] =
                    std::array::from_fn(|i| discs[b].position_m[i] - discs[a].position_m[i]);
                let missing_m = diameter_m - norm(between);
                if missing_m <= 0.0 {
                    continue;
                }
                is_free = false;
                let normal = unit(between).unwrap_or([1.0, 0.0, 0.0]);
                self.strike(discs, [a, b], normal);
                let half_m = 0.5 * missing_m + CLEARANCE * self.radius_m;
                discs[a] = self.walk(solids, discs[a], normal.map(|part| -half_m * part));
                discs[b] = self.walk(solids, discs[b], normal.map(|part| half_m * part));
            }
            if is_free {
                return;
            }
        }
    }

    /// What two robots that touch do to each other's velocities; the normal leads from the first to the second.
    fn strike(&self, discs: &mut [Disc], [a, b]: [usize; 2], normal: [f64; 3]) {
        let kept = [a, b].map(|robot| discs[robot].velocity_mps);
        let [va_mps, vb_mps] =
            [a, b].map(|robot| discs[robot].velocity_mps.unwrap_or(discs[robot].driven_mps));
        let closing_mps: f64 = (0..3).map(|i| (vb_mps[i] - va_mps[i]) * normal[i]).sum();
        if 0.0 <= closing_mps {
            return;
        }
        // A body whose actuators give it its velocity does not yield: the other one bears all of the change.
        let share = if kept.iter().all(Option::is_some) { 0.5 } else { 1.0 };
        let change_mps = share * (1.0 + self.restitution) * closing_mps;
        for (robot, sign) in [(a, 1.0), (b, -1.0)] {
            if let Some(velocity_mps) = &mut discs[robot].velocity_mps {
                for (component, part) in velocity_mps.iter_mut().zip(normal) {
                    *component += sign * change_mps * part;
                }
            }
        }
    }
}

impl Solid {
    /// An obstacle at `centre_m` that moves with a velocity (m/s).
    pub(crate) fn obstacle(
        obstacle: &Obstacle,
        centre_m: [f64; 2],
        velocity_mps: [f64; 2],
    ) -> Self {
        Self {
            from_m: centre_m,
            to_m: centre_m,
            radius_m: obstacle.radius_m,
            height_m: obstacle.height_m.unwrap_or(f64::INFINITY),
            velocity_mps,
        }
    }

    fn wall(wall: &Wall) -> Self {
        Self {
            from_m: wall.from_m,
            to_m: wall.to_m,
            radius_m: 0.0,
            height_m: wall.height_m.unwrap_or(f64::INFINITY),
            velocity_mps: [0.0; 2],
        }
    }

    /// The point of its middle line that is nearest.
    fn nearest_m(&self, to_m: [f64; 3]) -> [f64; 2] {
        let along: [f64; 2] = std::array::from_fn(|i| self.to_m[i] - self.from_m[i]);
        let length_2 = along[0] * along[0] + along[1] * along[1];
        if length_2 == 0.0 {
            return self.from_m;
        }
        let way = (to_m[0] - self.from_m[0]) * along[0] + (to_m[1] - self.from_m[1]) * along[1];
        let share = (way / length_2).clamp(0.0, 1.0);
        std::array::from_fn(|i| self.from_m[i] + share * along[i])
    }

    /// Whether the straight way from one place to another crosses its middle line. A point is not crossed.
    fn is_crossed(&self, begin_m: [f64; 3], end_m: [f64; 3]) -> bool {
        let turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let [begin, end] = [begin_m, end_m].map(|[x, y, _]| [x, y]);
        let (from, to) = (self.from_m, self.to_m);
        let side = turn(from, to, begin);
        side != 0.0
            && side * turn(from, to, end) <= 0.0
            && turn(begin, end, from) * turn(begin, end, to) <= 0.0
    }
}

/// Walls, then obstacles, of a place.
pub(super) fn solids(site: &Site) -> Vec<Solid> {
    let still = |obstacle: &Obstacle| Solid::obstacle(obstacle, obstacle.centre_m, [0.0; 2]);
    site.wall.iter().map(Solid::wall).chain(site.obstacle.iter().map(still)).collect()
}

pub(super) fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let length = norm(vector);
    (0.0 < length).then(|| vector.map(|part| part / length))
}
