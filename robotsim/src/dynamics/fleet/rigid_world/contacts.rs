//! Contacts of discs with each other and with walls: impulses by Newton's law of restitution and Coulomb's law of friction.
//!
//! In each part of a step the contacts are found first, then their impulses are applied in turn until the velocities converge
//! (projected Gauss–Seidel iteration; Catto, Iterative Dynamics with Temporal Coherence, 2005). Bodies then move on straight lines.

use proto::site::Wall;

/// Most iterations over all contacts for their impulses.
const MOST_ITERATIONS: usize = 32;
/// Velocities have converged when an iteration changes them by less than this share of the highest speed.
const PRECISION: f64 = 1e-13;
/// Iterations that push overlapping bodies apart, after they have moved.
const SEPARATIONS: usize = 8;
/// Share of an overlap that one of these iterations removes.
const SEPARATED: f64 = 0.4;
/// Overlaps up to this (m) remain: they are rounding.
const SLOP_M: f64 = 1e-9;

/// A disc in the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    pub(super) position_m: [f64; 2],
    pub(super) velocity_mps: [f64; 2],
    pub(super) spin_radps: f64,
    pub(super) radius_m: f64,
    /// 1 / mass (1/kg); 0: contacts do not move it.
    pub(super) inverse_mass: f64,
    /// 1 / moment of inertia (1/(kg m²)); 0: contacts do not turn it.
    pub(super) inverse_inertia: f64,
    pub(super) friction: f64,
    pub(super) restitution: f64,
}

impl Round {
    /// A disc that contacts do not move; for pairs the friction and restitution of the other disc apply.
    pub(super) fn immovable(position_m: [f64; 2], radius_m: f64) -> Self {
        Self {
            position_m,
            velocity_mps: [0.0; 2],
            spin_radps: 0.0,
            radius_m,
            inverse_mass: 0.0,
            inverse_inertia: 0.0,
            friction: f64::MAX,
            restitution: 1.0,
        }
    }

    /// Applies an impulse (N s) at the point of its rim that lies at `lever_m` along `normal` from its centre, of which `tangential`
    /// acts along the tangent, the normal turned left.
    fn push(&mut self, normal: [f64; 2], [along, tangential]: [f64; 2], lever_m: f64) {
        let impulse = add(scaled(normal, along), scaled(left_of(normal), tangential));
        self.velocity_mps = add(self.velocity_mps, scaled(impulse, self.inverse_mass));
        self.spin_radps += lever_m * tangential * self.inverse_inertia;
    }
}

/// What a body touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Partner {
    /// The disc of this number.
    Round(usize),
    /// The wall of this number.
    Wall(usize),
}

/// A contact in one part of a step, or one that may come about in it.
#[derive(Clone, Copy, Debug)]
struct Contact {
    body: usize,
    partner: Partner,
    /// From the partner to the body, of length 1, when they touch.
    normal: [f64; 2],
    /// Lowest velocity along the normal (m/s) after the contact.
    least_mps: f64,
    friction: f64,
    /// Impulse so far (N s): along the normal, and along the tangent.
    impulse: [f64; 2],
}

/// Discs and walls.
#[derive(Clone, Debug, Default)]
pub(super) struct Contacts {
    pub(super) rounds: Vec<Round>,
    walls: Vec<[[f64; 2]; 2]>,
    contacts: Vec<Contact>,
}

impl Contacts {
    pub(super) fn new(walls: &[Wall]) -> Self {
        let walls = walls.iter().map(|wall| [wall.from_m, wall.to_m]).collect();
        Self { walls, ..Self::default() }
    }

    /// Takes in a disc. Returns its number.
    pub(super) fn add(&mut self, round: Round) -> usize {
        self.rounds.push(round);
        self.rounds.len() - 1
    }

    /// Bodies that touch in this part, each with its partner.
    pub(super) fn touching(&self) -> impl Iterator<Item = (usize, Partner)> {
        let touching = self.contacts.iter().filter(|contact| 0.0 < contact.impulse[0]);
        touching.map(|contact| (contact.body, contact.partner))
    }

    /// Moves everything by one part of a step (s): contacts change velocities first.
    pub(super) fn step(&mut self, h_s: f64) {
        let speeds = self.rounds.iter().map(|round| length(round.velocity_mps));
        let fastest_mps = speeds.fold(0.0, f64::max);
        self.find(fastest_mps, h_s);
        self.solve(PRECISION * fastest_mps);
        for round in &mut self.rounds {
            round.position_m = add(round.position_m, scaled(round.velocity_mps, h_s));
        }
        for _ in 0..SEPARATIONS {
            self.separate();
        }
    }

    /// Finds the contacts of the next part. No disc is faster than `fastest_mps`.
    fn find(&mut self, fastest_mps: f64, h_s: f64) {
        self.contacts.clear();
        let reach_m = 2.0 * fastest_mps * h_s;
        let end_m = |index: usize, side: f64| {
            self.rounds[index].position_m[0] + side * (self.rounds[index].radius_m + 0.5 * reach_m)
        };
        let mut order: Vec<usize> = (0..self.rounds.len()).collect();
        order.sort_by(|&a, &b| end_m(a, -1.0).total_cmp(&end_m(b, -1.0)).then(a.cmp(&b)));
        let mut found = Vec::new();
        for (place, &one) in order.iter().enumerate() {
            let until_m = end_m(one, 1.0);
            let near =
                order[place + 1..].iter().take_while(|&&other| end_m(other, -1.0) <= until_m);
            for &other in near {
                found.extend(self.between(one.min(other), one.max(other), reach_m, h_s));
            }
        }
        for body in (0..self.rounds.len()).filter(|&body| 0.0 < self.rounds[body].inverse_mass) {
            for wall in 0..self.walls.len() {
                self.with_wall(body, wall, reach_m, h_s, &mut found);
            }
        }
        self.contacts = found;
    }

    /// The contact of two discs.
    fn between(&self, one: usize, other: usize, reach_m: f64, h_s: f64) -> Option<Contact> {
        let (body, partner) =
            if 0.0 < self.rounds[one].inverse_mass { (one, other) } else { (other, one) };
        let [a, b] = [body, partner].map(|index| &self.rounds[index]);
        let apart_m = minus(a.position_m, b.position_m);
        let touch_m = a.radius_m + b.radius_m;
        if a.inverse_mass == 0.0 || touch_m + reach_m < length(apart_m) {
            return None;
        }
        let velocity_mps = minus(a.velocity_mps, b.velocity_mps);
        let (normal, gap_m) = meeting(apart_m, velocity_mps, touch_m, h_s);
        Some(Contact {
            body,
            partner: Partner::Round(partner),
            normal,
            least_mps: least_mps(
                dot(velocity_mps, normal),
                gap_m / h_s,
                a.restitution.min(b.restitution),
            ),
            friction: a.friction.min(b.friction),
            impulse: [0.0; 2],
        })
    }

    /// Contacts of a disc with a wall: with its side, or with its ends.
    fn with_wall(
        &self,
        body: usize,
        wall: usize,
        reach_m: f64,
        h_s: f64,
        found: &mut Vec<Contact>,
    ) {
        let round = &self.rounds[body];
        let [from_m, to_m] = self.walls[wall];
        let near_m = round.radius_m + reach_m;
        let is_far = (0..2).any(|i| {
            round.position_m[i] + near_m < from_m[i].min(to_m[i])
                || from_m[i].max(to_m[i]) < round.position_m[i] - near_m
        });
        if is_far {
            return;
        }
        let mut take = |(normal, gap_m): ([f64; 2], f64)| {
            let approach_mps = dot(round.velocity_mps, normal);
            found.push(Contact {
                body,
                partner: Partner::Wall(wall),
                normal,
                least_mps: least_mps(approach_mps, gap_m / h_s, round.restitution),
                friction: round.friction,
                impulse: [0.0; 2],
            });
        };
        if let Some(side) = meeting_with_side(round, [from_m, to_m], h_s) {
            take(side);
        } else {
            for end_m in [from_m, to_m] {
                let apart_m = minus(round.position_m, end_m);
                if length(apart_m) <= near_m {
                    take(meeting(apart_m, round.velocity_mps, round.radius_m, h_s));
                }
            }
        }
    }

    /// Applies impulses until they change velocities by less than this (m/s).
    fn solve(&mut self, precision_mps: f64) {
        for _ in 0..MOST_ITERATIONS {
            let mut largest_mps = 0.0f64;
            for index in 0..self.contacts.len() {
                largest_mps = largest_mps.max(self.apply(index));
            }
            if largest_mps <= precision_mps {
                return;
            }
        }
    }

    /// Brings the impulse of a contact up to date. Returns how much that changes a velocity (m/s).
    fn apply(&mut self, index: usize) -> f64 {
        let Contact { body, partner, normal, least_mps, friction, impulse } = self.contacts[index];
        let mut a = self.rounds[body];
        let mut b = match partner {
            Partner::Round(other) => self.rounds[other],
            Partner::Wall(_) => Round::immovable([0.0; 2], 0.0),
        };
        let velocity_mps = minus(a.velocity_mps, b.velocity_mps);
        let mobility = a.inverse_mass + b.inverse_mass;
        let along = (impulse[0] + (least_mps - dot(velocity_mps, normal)) / mobility).max(0.0);
        // The velocity with which the rims slide past each other, and what an impulse of 1 N s changes of it.
        let sliding_mps = dot(velocity_mps, left_of(normal))
            - a.radius_m * a.spin_radps
            - b.radius_m * b.spin_radps;
        let slip = mobility
            + a.radius_m * a.radius_m * a.inverse_inertia
            + b.radius_m * b.radius_m * b.inverse_inertia;
        let most = friction * along;
        let tangential = (impulse[1] - sliding_mps / slip).clamp(-most, most);
        let change = [along - impulse[0], tangential - impulse[1]];
        a.push(normal, change, -a.radius_m);
        b.push(normal, change.map(|part| -part), b.radius_m);
        self.contacts[index].impulse = [along, tangential];
        self.rounds[body] = a;
        if let Partner::Round(other) = partner {
            self.rounds[other] = b;
        }
        change[0].abs().max(change[1].abs()) * mobility
    }

    /// Moves bodies that overlap a little apart, without a change of velocities.
    fn separate(&mut self) {
        for index in 0..self.contacts.len() {
            let Contact { body, partner, normal, .. } = self.contacts[index];
            let a = self.rounds[body];
            let (nearest_m, radius_m, inverse_mass) = match partner {
                Partner::Round(other) => {
                    let b = &self.rounds[other];
                    (b.position_m, b.radius_m, b.inverse_mass)
                }
                Partner::Wall(wall) => (nearest_on(self.walls[wall], a.position_m), 0.0, 0.0),
            };
            let apart_m = minus(a.position_m, nearest_m);
            let overlap_m = a.radius_m + radius_m - length(apart_m);
            if overlap_m <= SLOP_M {
                continue;
            }
            let way = scaled(direction(apart_m, normal), SEPARATED * overlap_m);
            let share = a.inverse_mass / (a.inverse_mass + inverse_mass);
            self.rounds[body].position_m = add(a.position_m, scaled(way, share));
            if let Partner::Round(other) = partner {
                let at_m = &mut self.rounds[other].position_m;
                *at_m = minus(*at_m, scaled(way, 1.0 - share));
            }
        }
    }
}

/// The lowest velocity along the normal (m/s) that a contact leaves, of bodies that approach with `velocity_mps` < 0 and touch after
/// the part of a step if they keep `touch_mps`, their gap over the part's duration.
fn least_mps(velocity_mps: f64, touch_mps: f64, restitution: f64) -> f64 {
    let stop_mps = -touch_mps.max(0.0);
    let returned_mps = -restitution * velocity_mps;
    // Without restitution they come as near as they can.
    if velocity_mps < stop_mps && 0.0 < returned_mps { returned_mps } else { stop_mps }
}

/// The normal and the gap (m) along it of two discs whose centres are `apart_m`, and that touch at the distance `touch_m`: at the time
/// of their first touch within `h_s`, or else when they are nearest. The gap is not negative, unless they overlap at the beginning.
fn meeting(apart_m: [f64; 2], velocity_mps: [f64; 2], touch_m: f64, h_s: f64) -> ([f64; 2], f64) {
    let begin_m = length(apart_m);
    if begin_m <= touch_m {
        return (direction(apart_m, [1.0, 0.0]), begin_m - touch_m);
    }
    let (square, approach) = (dot(velocity_mps, velocity_mps), dot(apart_m, velocity_mps));
    let apart_at = |time_s: f64| add(apart_m, scaled(velocity_mps, time_s));
    let nearest_s = if approach < 0.0 { (-approach / square).min(h_s) } else { 0.0 };
    // The earlier root of |apart + t velocity| = touch.
    let outside = dot(apart_m, apart_m) - touch_m * touch_m;
    let root = approach * approach - square * outside;
    let time_s = if approach < 0.0 && 0.0 <= root {
        (outside / (root.sqrt() - approach)).min(nearest_s)
    } else {
        nearest_s
    };
    let normal = direction(apart_at(time_s), [1.0, 0.0]);
    (normal, (dot(apart_m, normal) - touch_m).max(0.0))
}

/// The same of a disc and the side of a wall; `None` if it does not meet the wall between its ends.
fn meeting_with_side(
    round: &Round,
    [from_m, to_m]: [[f64; 2]; 2],
    h_s: f64,
) -> Option<([f64; 2], f64)> {
    let along = minus(to_m, from_m);
    let length_m = length(along);
    if length_m == 0.0 {
        return None;
    }
    let along = scaled(along, 1.0 / length_m);
    let begin_m = minus(round.position_m, from_m);
    let across_m = dot(begin_m, left_of(along));
    let normal = if across_m < 0.0 { scaled(left_of(along), -1.0) } else { left_of(along) };
    let gap_m = across_m.abs() - round.radius_m;
    let approach_mps = -dot(round.velocity_mps, normal);
    let time_s =
        if 0.0 < gap_m && 0.0 < approach_mps { (gap_m / approach_mps).min(h_s) } else { 0.0 };
    let foot_m = dot(begin_m, along) + time_s * dot(round.velocity_mps, along);
    (0.0..=length_m).contains(&foot_m).then_some((normal, gap_m))
}

/// The point of a wall that is nearest to a place (m).
fn nearest_on([from_m, to_m]: [[f64; 2]; 2], place_m: [f64; 2]) -> [f64; 2] {
    let along = minus(to_m, from_m);
    let square = dot(along, along);
    let share = if 0.0 < square { dot(minus(place_m, from_m), along) / square } else { 0.0 };
    add(from_m, scaled(along, share.clamp(0.0, 1.0)))
}

fn add(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn scaled(a: [f64; 2], factor: f64) -> [f64; 2] {
    a.map(|part| part * factor)
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn length(a: [f64; 2]) -> f64 {
    libm::hypot(a[0], a[1])
}

/// Turned left by a right angle.
fn left_of(a: [f64; 2]) -> [f64; 2] {
    [-a[1], a[0]]
}

/// Of length 1; the direction of `otherwise` where `a` has none.
fn direction(a: [f64; 2], otherwise: [f64; 2]) -> [f64; 2] {
    let length = length(a);
    if 0.0 < length { scaled(a, 1.0 / length) } else { otherwise }
}
