//! Rigid bodies against closed forms.

use super::*;
use crate::catalogue::Catalogue;
use crate::dynamics::Dynamics;
use crate::dynamics::inertial::GRAVITY_MPS2;
use proptest::prelude::*;
use proto::site::{Obstacle, Wall};
use proto::time::SimTime;

const STEP_NS: u64 = 100_000_000;
const GROUND_MPS2: f64 = 0.2 * GRAVITY_MPS2;

/// A body's state: where it is (m), its velocity (m/s) and its spin (rad/s).
type State = ([f64; 3], [f64; 3], f64);

/// Bodies with these keys, each with a start, under one command for some steps.
fn run(bodies: &[(&str, State)], command: Command, site: &Site, n_steps: u64) -> Vec<State> {
    run_each(bodies, &vec![command; bodies.len()], site, n_steps)
}

/// The same, each under a command of its own.
fn run_each(
    bodies: &[(&str, State)],
    commands: &[Command],
    site: &Site,
    n_steps: u64,
) -> Vec<State> {
    let kinds = bodies.iter().map(|(keys, _)| {
        let defaults = "kind = 'rigid-body'\nspeed_cap_mps = 30.0\ncap = 'norm'\nmass_kg = 1.0\nbody_diameter_m = 0.3\n\
                        force_cap_n = 10.0\nfriction = 0.0\nrestitution = 0.0\nground_friction = 0.0";
        let mut table: toml::Table = defaults.parse().unwrap();
        table.extend(keys.parse::<toml::Table>().unwrap());
        (1, Dynamics::build(&table, "", &Catalogue::built_in().effects, &mut Vec::new()).unwrap())
    });
    let fleet = Fleet::new(kinds, None, 0.4);
    let mut states = AgentStates::at_origin(bodies.len());
    fleet.complete(&mut states);
    let mut memory = fleet.memory(bodies.len());
    for (agent, &(_, (at_m, velocity_mps, spin_radps))) in bodies.iter().enumerate() {
        [states.x_m[agent], states.y_m[agent], states.z_m[agent]] = at_m;
        (memory[agent].drive, memory[agent].spin_radps) = (velocity_mps, spin_radps);
    }
    for step in 0..n_steps {
        let [from, until] = [step, step + 1].map(|n| SimTime::from_ns(n * STEP_NS));
        let step = Step { from, until, site, courses: &[], seed: 1 };
        fleet.advance(&step, commands, &mut states, &mut memory);
    }
    let end =
        |agent: usize| (states.position_m(agent), memory[agent].drive, memory[agent].spin_radps);
    (0..bodies.len()).map(end).collect()
}

/// Left to themselves.
fn drift(bodies: &[(&str, State)], site: &Site, n_steps: u64) -> Vec<State> {
    run(bodies, Command::Acceleration([0.0; 3]), site, n_steps)
}

fn wall_at(x_m: f64) -> Site {
    let (from_m, to_m) = ([x_m, -50.0], [x_m, 50.0]);
    Site { wall: vec![Wall { from_m, to_m, height_m: None, material: None }], ..Site::default() }
}

#[test]
fn what_slides_stops_after_the_way_that_friction_allows() {
    let keys = "ground_friction = 0.2";
    let at_rest = |n| drift(&[(keys, ([0.0; 3], [3.0, -4.0, 0.0], 0.0))], &Site::default(), n)[0];
    // v² / (2 μ g), along its way; after v / (μ g) = 2.55 s.
    let way_m = 25.0 / (2.0 * GROUND_MPS2);
    let (place_m, velocity_mps, _) = at_rest(26);
    assert!((place_m[0] - 0.6 * way_m).abs() < 1e-9, "{place_m:?}");
    assert!((place_m[1] + 0.8 * way_m).abs() < 1e-9, "{place_m:?}");
    assert_eq!(velocity_mps, [0.0; 3]);
    // Before that it is uniformly braked.
    let (place_m, velocity_mps, _) = at_rest(10);
    assert!((velocity_mps[0] - 0.6 * (5.0 - GROUND_MPS2)).abs() < 1e-9, "{velocity_mps:?}");
    assert!((place_m[0] - 0.6 * (5.0 - 0.5 * GROUND_MPS2)).abs() < 1e-9, "{place_m:?}");
}

#[test]
fn a_drive_moves_what_stands_only_if_it_is_stronger_than_the_ground() {
    let keys = "ground_friction = 0.2\nmass_kg = 2.0\nforce_cap_n = 10.0";
    let still = ([0.0; 3], [0.0; 3], 0.0);
    let pushed = |mps2| {
        run(&[(keys, still)], Command::Acceleration([mps2, 0.0, 0.0]), &Site::default(), 10)[0]
    };
    assert_eq!(pushed(0.99 * GROUND_MPS2), still);
    // F = m a at most 10 N: 5 m/s², of which the ground takes μ g; v² = 2 a x.
    let (place_m, velocity_mps, _) = pushed(100.0);
    let left_mps2 = 5.0 - GROUND_MPS2;
    assert!((velocity_mps[0] - left_mps2).abs() < 1e-9, "{velocity_mps:?}");
    assert!((place_m[0] - 0.5 * left_mps2).abs() < 1e-9, "{place_m:?}");
}

#[test]
fn a_spin_on_the_ground_ends_as_that_of_an_even_disc() {
    let keys = "ground_friction = 0.2\nbody_diameter_m = 0.5";
    let spin = |n| drift(&[(keys, ([0.0; 3], [0.0; 3], -9.0))], &Site::default(), n)[0].2;
    // (2/3) μ m g r against m r²/2, r = 0.25 m.
    let slower = 4.0 * GROUND_MPS2 / (3.0 * 0.25);
    assert!((spin(5) + 9.0 - 0.5 * slower).abs() < 1e-9, "{}", spin(5));
    assert_eq!((9.0 / slower * 10.0).ceil() as u64, 9);
    assert!(spin(8) < 0.0 && spin(9).abs() < 1e-300, "{}", spin(9));
}

#[test]
fn unequal_masses_that_meet_head_on_part_as_newton_says() {
    for restitution in [0.0, 0.5, 1.0] {
        let keys = |mass_kg: f64| format!("mass_kg = {mass_kg:?}\nrestitution = {restitution:?}");
        let (light, heavy) = (keys(1.0), keys(3.0));
        let bodies = [
            (light.as_str(), ([0.0; 3], [2.0, 0.0, 0.0], 0.0)),
            (heavy.as_str(), ([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.0)),
        ];
        let end = drift(&bodies, &Site::default(), 10);
        // Of the centre (−1/4 m/s), and e times the velocities about it.
        let expected = [-0.25 - restitution * 2.25, -0.25 + restitution * 0.75];
        for ((_, velocity_mps, spin_radps), expected_mps) in end.into_iter().zip(expected) {
            assert!(
                (velocity_mps[0] - expected_mps).abs() < 1e-9,
                "e = {restitution}: {velocity_mps:?} {expected_mps}"
            );
            assert!(velocity_mps[1].abs() < 1e-12 && spin_radps.abs() < 1e-12);
        }
    }
}

#[test]
fn a_disc_that_meets_a_wall_slides_along_it_or_rolls() {
    let after = |friction: f64| {
        let keys = format!("friction = {friction:?}");
        let start = ([0.0; 3], [2.0, 3.0, 0.0], 0.0);
        drift(&[(&keys, start)], &wall_at(1.0), 10)[0]
    };
    // Little friction: the wall takes μ (v · n) along it, and gives the disc the spin of that impulse at its rim.
    let (place_m, velocity_mps, spin_radps) = after(0.1);
    assert!(velocity_mps[0].abs() < 1e-6, "{velocity_mps:?}");
    assert!((velocity_mps[1] - 2.8).abs() < 1e-6, "{velocity_mps:?}");
    // The wall gets hold of it up to one part's way early, on that much longer a lever.
    let spin = 2.0 * 0.2 / 0.15;
    let early = 1.0 + 2.0 * PART_S / 0.15;
    assert!((spin - 1e-6..=spin * early).contains(&spin_radps.abs()), "{spin_radps}");
    assert!((place_m[0] - 0.85).abs() < 1e-3, "{place_m:?}");
    // Much: its rim does not slide, v' = ω r, and it rolls with two thirds of the speed.
    let (_, velocity_mps, spin_radps) = after(5.0);
    assert!((velocity_mps[1] / 2.0 - 1.0).abs() < early - 1.0, "{velocity_mps:?}");
    assert!((spin_radps.abs() * 0.15 / velocity_mps[1] - 1.0).abs() < early - 1.0, "{spin_radps}");
}

#[test]
fn discs_that_pass_close_by_do_not_touch() {
    // 1 mm beside each other, and beside the end of a wall, at 15 cm in a part.
    let begin = |x_m, y_m, speed_mps| ([x_m, y_m, 0.0], [speed_mps, 0.0, 0.0], 0.0);
    let bodies = [("", begin(-1.01, 0.301, 15.0)), ("", begin(1.0, 0.0, -15.0))];
    let (from_m, to_m) = ([0.013, 0.452], [0.013, 2.0]);
    let wall = Wall { from_m, to_m, height_m: None, material: None };
    let site = Site { wall: vec![wall], ..Site::default() };
    for ((place_m, velocity_mps, spin_radps), (_, (at_m, before_mps, _))) in
        drift(&bodies, &site, 2).into_iter().zip(bodies)
    {
        assert_eq!((velocity_mps, spin_radps), (before_mps, 0.0));
        assert!((place_m[0] - at_m[0] - 0.2 * before_mps[0]).abs() < 1e-9, "{place_m:?}");
        assert_eq!(place_m[1], at_m[1]);
    }
}

#[test]
fn discs_that_begin_in_each_other_part_without_a_push() {
    let rest = |x_m| ([x_m, 0.0, 0.0], [0.0; 3], 0.0);
    let end = drift(&[("", rest(0.0)), ("mass_kg = 3.0", rest(0.1))], &Site::default(), 3);
    let [(one_m, one_mps, _), (other_m, other_mps, _)] = [end[0], end[1]];
    assert_eq!([one_mps, other_mps], [[0.0; 3]; 2]);
    assert!((other_m[0] - one_m[0] - 0.3).abs() < 1e-6, "{one_m:?} {other_m:?}");
    // The lighter goes three times as far.
    assert!((one_m[0] + 0.15).abs() < 1e-6 && (other_m[0] - 0.15).abs() < 1e-6, "{one_m:?}");
}

/// Total momentum, angular momentum about the origin, and energy of discs of these masses (kg) and 0.3 m.
fn totals(masses: &[f64], states: &[State]) -> [f64; 4] {
    let mut all = [0.0; 4];
    for (mass_kg, (at, v, spin)) in masses.iter().zip(states) {
        let inertia = 0.5 * mass_kg * 0.15 * 0.15;
        all[0] += mass_kg * v[0];
        all[1] += mass_kg * v[1];
        all[2] += mass_kg * (at[0] * v[1] - at[1] * v[0]) + inertia * spin;
        all[3] += 0.5 * mass_kg * (v[0] * v[0] + v[1] * v[1]) + 0.5 * inertia * spin * spin;
    }
    all
}

#[test]
fn three_that_meet_at_once_in_a_room_get_no_energy() {
    // Found by the property below.
    no_energy_from_nowhere(&[4.205383018234056, 0.31139315132097944]).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_pair_that_meets_keeps_what_it_must(
        offset_m in -0.25f64..0.25,
        mass_kg in 0.2f64..5.0,
        speed_mps in 0.5f64..3.0,
        spin_radps in -20.0f64..20.0,
        friction in 0.0f64..1.0,
        restitution in 0.0f64..=1.0,
    ) {
        let keys = |mass_kg: f64| {
            format!("mass_kg = {mass_kg:?}\nfriction = {friction:?}\nrestitution = {restitution:?}")
        };
        let (one, other) = (keys(1.0), keys(mass_kg));
        let begin = [
            ([-0.4, offset_m, 0.0], [speed_mps, 0.0, 0.0], spin_radps),
            ([0.4, 0.0, 0.0], [-speed_mps, 0.0, 0.0], 0.0),
        ];
        let end = drift(&[(&one, begin[0]), (&other, begin[1])], &Site::default(), 10);
        prop_assert!(end[0].1 != begin[0].1, "they met");
        let masses = [1.0, mass_kg];
        let (before, after) = (totals(&masses, &begin), totals(&masses, &end));
        for i in 0..2 {
            prop_assert!((before[i] - after[i]).abs() < 1e-9, "{before:?} {after:?}");
        }
        // What they give each other acts where they are at the beginning of a part: at most their way in it aside.
        let given = libm::hypot(end[0].1[0] - begin[0].1[0], end[0].1[1] - begin[0].1[1]);
        let aside_m = 2.0 * speed_mps * PART_S;
        prop_assert!((before[2] - after[2]).abs() <= given * aside_m, "{before:?} {after:?}");
        prop_assert!(after[3] <= before[3] * (1.0 + 1e-9), "{before:?} {after:?}");
        if friction == 0.0 && restitution == 1.0 {
            prop_assert!((after[3] - before[3]).abs() < 1e-9);
        }
    }

    #[test]
    fn nobody_leaves_a_room_and_no_energy_comes_from_nowhere(
        directions in prop::collection::vec(0.0f64..6.0, 1..5),
    ) {
        no_energy_from_nowhere(&directions)?;
    }
}

/// Elastic discs that set out in these directions (rad) in a room with a pillar.
fn no_energy_from_nowhere(directions: &[f64]) -> Result<(), TestCaseError> {
    let corners = [[2.0, -2.0], [2.0, 2.0], [-2.0, 2.0], [-2.0, -2.0], [2.0, -2.0]];
    let wall =
        |ends: &[[f64; 2]]| Wall { from_m: ends[0], to_m: ends[1], height_m: None, material: None };
    let pillar = Obstacle {
        name: None,
        centre_m: [0.0, 0.0],
        radius_m: 0.5,
        height_m: None,
        material: None,
    };
    let site = Site {
        wall: corners.windows(2).map(wall).collect(),
        obstacle: vec![pillar],
        ..Site::default()
    };
    let bodies: Vec<(&str, State)> = directions
        .iter()
        .zip(0..)
        .map(|(angle, k)| {
            let at_m = [[1.2, 1.2, 0.0], [-1.2, 1.2, 0.0], [-1.2, -1.2, 0.0], [1.2, -1.2, 0.0]][k];
            (
                "restitution = 1.0",
                (at_m, [2.0 * libm::cos(*angle), 2.0 * libm::sin(*angle), 0.0], 0.0),
            )
        })
        .collect();
    let begin: Vec<State> = bodies.iter().map(|(_, state)| *state).collect();
    let end = drift(&bodies, &site, 50);
    let masses = vec![1.0; bodies.len()];
    let (before, after) = (totals(&masses, &begin)[3], totals(&masses, &end)[3]);
    prop_assert!(after <= before * (1.0 + 1e-9), "{before} {after}");
    for (at_m, _, _) in end {
        prop_assert!(at_m[0].abs() < 1.9 && at_m[1].abs() < 1.9, "{at_m:?}");
        prop_assert!(0.6 < libm::hypot(at_m[0], at_m[1]), "{at_m:?}");
    }
    Ok(())
}

/// A robot of another kind, of 0.4 m, that goes east with this speed (m/s), and a disc with these keys and this start.
fn beside(speed_mps: f64, height_m: f64, disc: (&str, State), n_steps: u64) -> [State; 2] {
    let pusher = ("kind = 'point-mass'\ncap = 'norm'", ([0.0, 0.0, height_m], [0.0; 3], 0.0));
    let commands = [Command::Velocity([speed_mps, 0.0, 0.0]), Command::Acceleration([0.0; 3])];
    let end = run_each(&[pusher, disc], &commands, &Site::default(), n_steps);
    [end[0], end[1]]
}

#[test]
fn a_robot_of_another_kind_pushes_a_disc_along_at_its_own_speed() {
    for keys in ["", "mass_kg = 1000.0", "ground_friction = 0.3\nmass_kg = 50.0"] {
        let disc = (keys, ([1.0, 0.0, 0.0], [0.0; 3], 0.0));
        let [pusher, (place_m, _, spin_radps)] = beside(2.0, 0.0, disc, 20);
        // It is not pushed back, whatever it pushes.
        assert!((pusher.0[0] - 4.0).abs() < 1e-12 && pusher.0[1].abs() < 1e-300, "{pusher:?}");
        let [_, (before_m, ..)] = beside(2.0, 0.0, disc, 19);
        assert!((place_m[0] - before_m[0] - 0.2).abs() < 1e-6, "{keys}: {before_m:?} {place_m:?}");
        assert!(place_m[1].abs() < 1e-9 && spin_radps.abs() < 1e-9, "{keys}");
        // They touch where radii of 0.2 m and 0.15 m say, up to an overlap and one part's way early.
        let gap_m = place_m[0] - pusher.0[0] - 0.35;
        assert!((-0.002..2.0 * PART_S).contains(&gap_m), "{keys}: {gap_m}");
    }
}

#[test]
fn a_disc_comes_back_from_a_robot_of_another_kind_as_off_a_moving_wall() {
    for restitution in [0.0, 0.5, 1.0] {
        for own_mps in [-1.0, 0.5] {
            let keys = format!("restitution = {restitution:?}");
            let disc = (keys.as_str(), ([1.0, 0.0, 0.0], [own_mps, 0.0, 0.0], 0.0));
            let [_, (_, velocity_mps, _)] = beside(2.0, 0.0, disc, 10);
            // v' = u + e (u − v); for e = 1 it is 2 u − v.
            let expected_mps = 2.0 + restitution * (2.0 - own_mps);
            assert!((velocity_mps[0] - expected_mps).abs() < 1e-6, "{keys}: {velocity_mps:?}");
            assert!(velocity_mps[1].abs() < 1e-9, "{keys}: {velocity_mps:?}");
        }
    }
}

#[test]
fn a_robot_of_another_kind_that_flies_higher_than_its_radius_passes_over_discs() {
    let still = ([1.0, 0.0, 0.0], [0.0; 3], 0.0);
    assert_eq!(beside(2.0, 0.2, ("", still), 10)[1], still);
    assert!(1.0 < beside(2.0, 0.19, ("", still), 10)[1].0[0]);
}
