//! Whole swarms that come to rest where the law says: potentials with and without alignment, and dispersion.

use crate::air::{Air, setup};
use proto::types::{Bitmap, MoteStates};

type Perfect = fn(u64, usize, usize, f64) -> bool;

const N: usize = 6;

/// Robots that begin at rest within 3 m of each other, and flock behind a leader that goes on with 0.5 m/s as double integrators.
fn flock(law: &str, velocity_term: bool) -> Air<Perfect> {
    let toml = format!(
        "scenario = {{ kind = 'circle', radius_m = 1.5 }}\n\
         controller = {{ kind = 'flocking', law = '{law}', flock_radius_m = 5, input = 'acceleration', \
         velocity_term = {velocity_term}, leader_velocity_mps = [0.5, 0] }}"
    );
    Air::new(&setup(&toml, N, 2), |_, _, _, _| true)
}

fn place_m(air: &Air<Perfect>, agent: usize) -> [f64; 2] {
    [air.states.x_m[agent], air.states.y_m[agent]]
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// How far velocities are from the leader's at most (m/s).
fn straying_mps(air: &Air<Perfect>) -> f64 {
    let off = |agent: usize| (air.states.vx_mps[agent] - 0.5).hypot(air.states.vy_mps[agent]);
    (0..N).map(off).fold(0.0, f64::max)
}

/// The potentials as printed, r_flock = 5 m.
fn potential(law: &str, d: f64) -> f64 {
    match law {
        "zavlanos" => 1.0 / (d * d) + 1.0 / (25.0 - d * d),
        // K_conn = r_flock, K_col = r_collision² + r_flock.
        _ => 5.0 * (d * d / 25.0).exp() + (0.64 + 5.0) * (-d * d / 0.64).exp(),
    }
}

/// The slope of a robot's potential where it stands, by a difference quotient.
fn slope(air: &Air<Perfect>, law: &str, agent: usize) -> f64 {
    let potential_at = |place: [f64; 2]| -> f64 {
        let others = (0..N).filter(|&other| other != agent);
        others.map(|other| potential(law, distance(place, place_m(air, other)))).sum()
    };
    let [x, y] = place_m(air, agent);
    let h = 1e-5;
    let [dx, dy] = [[h, 0.0], [0.0, h]].map(|[dx, dy]| {
        (potential_at([x + dx, y + dy]) - potential_at([x - dx, y - dy])) / (2.0 * h)
    });
    dx.hypot(dy)
}

#[test]
fn a_flock_that_aligns_comes_to_its_leaders_velocity_where_the_printed_potential_has_no_slope() {
    for law in ["zavlanos", "paper"] {
        let mut air = flock(law, true);
        for _ in 0..3000 {
            air.step();
            for agent in 1..N {
                // Connectivity, as the source has it: nobody ever comes as far as r_flock from anybody.
                let others =
                    (0..N).map(|other| distance(place_m(&air, agent), place_m(&air, other)));
                assert!(others.fold(0.0, f64::max) < 5.0, "{law}: the flock breaks");
            }
        }
        // Five minutes: what decays has decayed but for rounding and the flattest of directions.
        assert!(straying_mps(&air) < 1e-3, "{law}: {}", straying_mps(&air));
        for agent in 1..N {
            // The error of the difference quotient, and what is left of the flattest directions.
            assert!(slope(&air, law, agent) < 1e-3, "{law}: {}", slope(&air, law, agent));
            let others = (0..N).filter(|&other| other != agent);
            let near_m = others.map(|other| distance(place_m(&air, agent), place_m(&air, other)));
            assert!(0.5 < near_m.fold(f64::INFINITY, f64::min), "{law}: a collision");
        }
    }
}

#[test]
fn a_flock_that_does_not_align_swings_on() {
    let mut air = flock("zavlanos", false);
    for _ in 0..3000 {
        air.step();
    }
    // Nothing takes the energy with which they began.
    assert!(0.05 < straying_mps(&air), "{}", straying_mps(&air));
}

#[test]
fn a_follower_of_the_original_potential_rests_where_push_and_pull_are_equal() {
    let toml = "scenario = { kind = 'line', spacing_m = 2.0 }\n\
                controller = { kind = 'flocking', law = 'zavlanos', flock_radius_m = 4, leader_velocity_mps = [0, 0] }";
    let mut air: Air<Perfect> = Air::new(&setup(toml, 2, 1), |_, _, _, _| true);
    for _ in 0..5000 {
        air.step();
    }
    // r_flock / √2; steps of 0.1 s leave less than a millionth of what is missing after so many.
    let distance_m = distance(place_m(&air, 0), place_m(&air, 1));
    assert!((distance_m - 4.0 / 2f64.sqrt()).abs() < 1e-6, "{distance_m}");
}

/// Strength at a distance: 25 dB a decade from -40 dBm at 1 m. The floor of -65 dBm is at 10 m.
fn rssi_dbm(distance_m: f64) -> f32 {
    (-40.0 - 25.0 * distance_m.max(1e-3).log10()) as f32
}

const FLOOR_M: f64 = 10.0;
const DISPERSION: &str = "scenario = { kind = 'square', side_m = 4 }\n\
                          controller = { kind = 'dispersion', speed_mps = 1, rssi_floor_dbm = -65, rssi_margin_db = 6 }";

#[test]
fn robots_disperse_until_each_ones_best_link_is_at_the_floor() {
    let mut air: Air<Perfect> = Air::new(&setup(DISPERSION, 8, 1), |_, _, _, _| true);
    air.rssi_dbm = Some(rssi_dbm);
    for _ in 0..6000 {
        air.step();
    }
    for agent in 0..8 {
        let others = (0..8).filter(|&other| other != agent);
        let near_m = others.map(|other| distance(place_m(&air, agent), place_m(&air, other)));
        let near_m = near_m.fold(f64::INFINITY, f64::min);
        // Strengths are reported with 24 bits: a ten-thousandth of a metre; the residual of the slow approach is larger.
        assert!((near_m - FLOOR_M).abs() < 0.05, "robot {agent}: {near_m} m");
    }
}

#[test]
fn robots_disperse_on_a_circle_around_the_root_that_is_everyones_parent() {
    let mut air: Air<Perfect> = Air::new(&setup(DISPERSION, 7, 1), |_, _, _, _| true);
    air.rssi_dbm = Some(rssi_dbm);
    let parent = std::iter::once(u32::MAX).chain([0; 6]).collect();
    air.motes = Some(MoteStates {
        alive: Bitmap::filled(7, true),
        joined: Some(Bitmap::filled(7, true)),
        parent,
        ..MoteStates::default()
    });
    let root_m = place_m(&air, 0);
    for _ in 0..6000 {
        air.step();
    }
    assert_eq!(place_m(&air, 0), root_m, "the root stays");
    for agent in 1..7 {
        let distance_m = distance(place_m(&air, agent), root_m);
        assert!((distance_m - FLOOR_M).abs() < 0.05, "robot {agent}: {distance_m} m");
        // Six around a root: all but evenly, as the others push them along the circle ever more slowly.
        let others = (1..7).filter(|&other| other != agent);
        let near_m = others.map(|other| distance(place_m(&air, agent), place_m(&air, other)));
        assert!(4.0 < near_m.fold(f64::INFINITY, f64::min), "robot {agent}");
    }
}
