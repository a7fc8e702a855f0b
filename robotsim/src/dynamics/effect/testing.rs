//! What the tests of effects share.

use crate::catalogue::Catalogue;
use crate::dynamics::Dynamics;
use crate::dynamics::body::Drive;
use crate::dynamics::physics::{Order, Physics, Robot};
use crate::dynamics::surroundings::Surroundings;

/// The physics of a `[robotsim.dynamics]` section.
pub(in crate::dynamics) fn physics(text: &str) -> Physics {
    let node = proto::config::parse(text).expect("the text is TOML");
    let mut problems = Vec::new();
    let spec = &crate::dynamics::SPEC;
    let catalogue = Catalogue::built_in();
    let table = proto::config::check(&node, "", spec, &catalogue.lists(), &mut problems).table;
    let dynamics = Dynamics::build(&table, "", &catalogue.effects, &mut problems);
    assert!(problems.is_empty(), "{problems:?}");
    dynamics.expect("what has no problem can be built").into_physics()
}

/// Where a robot is that begins at the origin, at rest and facing east, and is asked for `demand` for `t_s`.
pub(super) fn drive(text: &str, demand: Drive, t_s: f64) -> Robot {
    drive_in(&physics(text), demand, t_s, &Surroundings::default())
}

/// As [`drive`], in some surroundings.
pub(super) fn drive_in(
    physics: &Physics,
    demand: Drive,
    t_s: f64,
    surroundings: &Surroundings<'_>,
) -> Robot {
    let mut robot = Robot::default();
    let orders = [Order { from_s: 0.0, demand }];
    physics.advance(&mut robot, &orders, &mut 0, 0.0, t_s, surroundings);
    robot
}

/// Numbers that agree but for rounding.
#[track_caller]
pub(super) fn assert_near(measured: [f64; 3], exact: [f64; 3]) {
    let near = measured.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(near, "{measured:?} is not {exact:?}");
}
