//! Every controller converges in its textbook setting, with everyone hearing everyone.

use crate::air::{Air, setup};
use proto::types::AgentStates;

type Perfect = fn(u64, usize, usize, f64) -> bool;

fn perfect(toml: &str, n: usize) -> Air<Perfect> {
    Air::new(&setup(toml, n, 1), |_, _, _, _| true)
}

fn places(states: &AgentStates) -> Vec<[f64; 2]> {
    states.x_m.iter().zip(&states.y_m).map(|(&x, &y)| [x, y]).collect()
}

fn velocities(states: &AgentStates) -> Vec<[f64; 2]> {
    states.vx_mps.iter().zip(&states.vy_mps).map(|(&x, &y)| [x, y]).collect()
}

fn mean(points: &[[f64; 2]]) -> [f64; 2] {
    let n = points.len() as f64;
    [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / n)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Distance of each to the nearest other.
fn nearest(places: &[[f64; 2]]) -> Vec<f64> {
    let nearest_of = |i: usize| {
        let others = (0..places.len()).filter(|&j| j != i);
        others.map(|j| distance(places[i], places[j])).fold(f64::INFINITY, f64::min)
    };
    (0..places.len()).map(nearest_of).collect()
}

#[test]
fn consensus_contracts_as_the_laplacian_says_and_keeps_the_centroid() {
    let toml = "scenario.kind = 'square'\ncontroller = { kind = 'consensus', over = 'sum', gain_per_s = 0.5 }";
    let mut air = perfect(toml, 5);
    let begin = mean(&places(&air.states));
    let spread = |air: &Air<Perfect>| distance(places(&air.states)[0], begin);
    // Nothing is heard before the first step. Of five robots that all hear each other the Laplacian's other eigenvalues
    // are all 5: each step of 0.1 s leaves 1 − 0.5 · 5 · 0.1 of a difference. Rounding accumulates over twenty steps.
    air.step();
    let before = spread(&air);
    for _ in 0..20 {
        air.step();
    }
    assert!((spread(&air) / before / 0.75f64.powi(20) - 1.0).abs() < 1e-9);
    assert!(distance(mean(&places(&air.states)), begin) < 1e-12);
    let done = (0..200).find(|_| air.step().task_complete);
    assert!(done.is_some(), "they never meet");
    assert!(spread(&air) < 0.01);
}

#[test]
fn boids_come_to_head_the_same_way_and_stay_together_without_touching() {
    let mut air = perfect(
        "scenario = { kind = 'square', side_m = 8 }\ncontroller = { kind = 'boids', speed_mps = 2 }",
        30,
    );
    let polarisation = |air: &Air<Perfect>| {
        let [vx, vy] = mean(&velocities(&air.states));
        vx.hypot(vy) / 2.0
    };
    air.step();
    // Thirty headings at random: about 0.16 on average, above 0.45 once in four hundred draws.
    assert!(polarisation(&air) < 0.45, "{}", polarisation(&air));
    for _ in 0..600 {
        air.step();
    }
    assert!(0.98 < polarisation(&air), "{}", polarisation(&air));
    for [vx, vy] in velocities(&air.states) {
        assert!((vx.hypot(vy) - 2.0).abs() < 1e-9);
    }
    let places = places(&air.states);
    let centre = mean(&places);
    assert!(places.iter().all(|&place| distance(place, centre) < 10.0));
    assert!(nearest(&places).iter().all(|&m| 0.3 < m), "{:?}", nearest(&places));
}

#[test]
fn an_alpha_lattice_forms_and_moves_with_its_target() {
    let mut air = perfect(
        "scenario = { kind = 'square', side_m = 25 }\n\
         controller = { kind = 'olfati-saber', target_velocity_mps = [1, 0], target_gain_per_s2 = 0.02 }",
        20,
    );
    for _ in 0..2000 {
        air.step();
    }
    // The pull to the middle makes it somewhat tighter than the 7 m wanted, and neighbours within 8.4 m matter.
    let near = nearest(&places(&air.states));
    assert!(near.iter().all(|m| (5.0..7.7).contains(m)), "{near:?}");
    for velocity in velocities(&air.states) {
        assert!(distance(velocity, [1.0, 0.0]) < 0.05, "{velocity:?}");
    }
    // 200 s at 1 m/s.
    let [x, y] = mean(&places(&air.states));
    assert!((x - 200.0).abs() < 2.0 && y.abs() < 2.0, "{x}, {y}");
}

#[test]
fn lloyds_robots_share_a_corridor_evenly() {
    let mut air = perfect(
        "scenario = { kind = 'square', side_m = 0.4 }\n\
         controller = { kind = 'coverage', from_m = [-6, -0.25], to_m = [6, 0.25], gain_per_s = 10 }",
        6,
    );
    let done = (0..3000).find(|_| air.step().task_complete);
    assert!(done.is_some(), "they never come to rest");
    let mut x: Vec<f64> = air.states.x_m.clone();
    x.sort_by(f64::total_cmp);
    // The optimum of a corridor: the middles of six equal parts. At rest to 1 mm a step, of which the last of a slow
    // approach may hide some thirty.
    for (found, wanted) in x.iter().zip([-5.0, -3.0, -1.0, 1.0, 3.0, 5.0]) {
        assert!((found - wanted).abs() < 0.05, "{x:?}");
    }
    assert!(air.states.y_m.iter().all(|y| y.abs() < 0.02), "{:?}", air.states.y_m);
}

#[test]
fn wanderers_have_the_mean_speed_of_the_model_and_stay_in_their_square() {
    let mut air = perfect(
        "scenario = { kind = 'square', side_m = 100 }\n\
         controller = { kind = 'random-waypoint', side_m = 100, slowest_mps = 0.5, fastest_mps = 2 }",
        20,
    );
    // To the first place, at 30 m/s.
    for _ in 0..100 {
        air.step();
    }
    let n_steps = 20_000;
    let mut sum_mps = 0.0;
    for _ in 0..n_steps {
        air.step();
        for [vx, vy] in velocities(&air.states) {
            // A millionth for rounding of positions of 50 m over a tenth of a second.
            assert!(vx.hypot(vy) < 2.0 * (1.0 + 1e-6));
            sum_mps += vx.hypot(vy);
        }
        assert!(air.states.x_m.iter().chain(&air.states.y_m).all(|x| x.abs() <= 50.0 + 1e-9));
    }
    // (b − a) / ln(b / a) = 1.082 m/s (Yoon, Liu and Noble 2003). About 830 legs, whose mean speed, weighted by how long they
    // last, has a standard error of about 0.015 m/s.
    let mean_mps = sum_mps / f64::from(20 * n_steps);
    assert!((mean_mps - 1.082).abs() < 0.06, "{mean_mps}");
}

#[test]
fn a_circle_is_formed_and_shared_evenly() {
    let free =
        "scenario = { kind = 'disc', density_per_m2 = 0.3 }\ncontroller.kind = 'circle-formation'";
    let mut air = perfect(free, 12);
    let done = (0..2000).find(|_| air.step().task_complete);
    assert!(done.is_some(), "it is never done");
    let centre = |places: &[[f64; 2]]| {
        // Of points that lie on a circle, the centre from three of them.
        let [a, b, c] = [places[0], places[4], places[8]];
        let d = 2.0 * (a[0] * (b[1] - c[1]) + b[0] * (c[1] - a[1]) + c[0] * (a[1] - b[1]));
        let square = |p: [f64; 2]| p[0] * p[0] + p[1] * p[1];
        [
            (square(a) * (b[1] - c[1]) + square(b) * (c[1] - a[1]) + square(c) * (a[1] - b[1])) / d,
            (square(a) * (c[0] - b[0]) + square(b) * (a[0] - c[0]) + square(c) * (b[0] - a[0])) / d,
        ]
    };
    let found = places(&air.states);
    let middle = centre(&found);
    let radius_m = distance(found[0], middle);
    // Within a millimetre of their own fits.
    assert!(found.iter().all(|&place| (distance(place, middle) - radius_m).abs() < 0.02));

    let even = format!("{free}\ncontroller.radius_m = 3.0\ncontroller.even = true");
    let mut air = perfect(&even, 12);
    for _ in 0..3000 {
        air.step();
    }
    let found = places(&air.states);
    let middle = mean(&found);
    assert!(found.iter().all(|&place| (distance(place, middle) - 3.0).abs() < 0.02));
    // Twelve on a circle of 3 m: 1.553 m to either side.
    assert!(nearest(&found).iter().all(|m| (m - 1.553).abs() < 0.08), "{:?}", nearest(&found));
}

#[test]
fn a_leader_follows_its_path_and_the_others_follow_it() {
    let mut air = perfect(
        "scenario.kind = 'line'\n\
         controller = { kind = 'flocking', flock_radius_m = 5, leader_velocity_mps = [2, 0], leader_path_m = [[0, 0], [20, 0], [20, 20], [0, 20]], leader_path_closed = true }",
        4,
    );
    for _ in 0..550 {
        air.step();
    }
    // 110 m along a square of 80 m: ten metres up its second side.
    let found = places(&air.states);
    assert!(distance(found[0], [20.0, 10.0]) < 1e-9, "{found:?}");
    assert!(found[1..].iter().all(|&place| distance(place, found[0]) < 5.0), "{found:?}");
}

#[test]
fn who_remembers_and_reckons_keeps_up_with_whom_it_rarely_hears() {
    // Everyone is heard in every eighth period only.
    let distance_m = |memory: &str| {
        let toml = format!(
            "{memory}\nscenario.kind = 'line'\n\
             controller = {{ kind = 'flocking', flock_radius_m = 5, leader_velocity_mps = [1, 0] }}"
        );
        let mut air = Air::new(&setup(&toml, 2, 1), |step, _, _, _| step % 8 == 0);
        let mut sum_m = 0.0;
        for step in 0..400 {
            air.step();
            let found = places(&air.states);
            if 200 <= step {
                sum_m += distance(found[0], found[1]) / 200.0;
            }
        }
        sum_m
    };
    let [never, frozen, reckoned] =
        ["", "memory = { keep_s = 1.0, extrapolate = false }", "memory = { keep_s = 1.0 }"]
            .map(distance_m);
    let mut always = perfect(
        "scenario.kind = 'line'\n\
         controller = { kind = 'flocking', flock_radius_m = 5, leader_velocity_mps = [1, 0] }",
        2,
    );
    for _ in 0..400 {
        always.step();
    }
    let found = places(&always.states);
    let ideal = distance(found[0], found[1]);
    // A leader that goes straight on is where it is reckoned to be.
    assert!((reckoned - ideal).abs() < 0.01, "{reckoned} against {ideal}");
    assert!(ideal + 0.1 < frozen && frozen + 0.1 < never, "{ideal}, {frozen}, {never}");
}

#[test]
fn two_double_integrators_swing_about_their_rest_at_the_frequency_of_the_potential() {
    // Leaderless, at rest, displaced from where the pull vanishes; r_flock 10 m: 1.80328 m apart. To first order the distance
    // x swings with ω² = 2 · d(pull · d)/dd there: the relative acceleration is twice each one's.
    let begin = |x: f64| {
        format!(
            "scenario = {{ kind = 'line', spacing_m = {x}, jitter_m = 0.0 }}\n\
             controller = {{ kind = 'flocking', flock_radius_m = 10, leaderless = true, input = 'acceleration' }}"
        )
    };
    let pull = |d: f64| {
        2.0 * (10.0 / 100.0 * (d * d / 100.0).exp() - (0.64 + 10.0) / 0.64 * (-d * d / 0.64).exp())
    };
    let rest = 1.80328;
    let slope = (pull(rest + 1e-4) * (rest + 1e-4) - pull(rest - 1e-4) * (rest - 1e-4)) / 2e-4;
    let period_s = std::f64::consts::TAU / (2.0 * slope).sqrt();
    let mut air = perfect(&begin(rest + 0.02), 2);
    let mut crossings = Vec::new();
    let mut before = 0.02;
    for step in 1..=600 {
        air.step();
        let found = places(&air.states);
        let off = distance(found[0], found[1]) - rest;
        if before < 0.0 && 0.0 <= off {
            crossings.push(f64::from(step));
        }
        before = off;
        assert!(off.abs() < 0.05, "{off}: it grows");
    }
    let n = crossings.len();
    assert!(3 <= n, "{crossings:?}");
    let measured_s = 0.1 * (crossings[n - 1] - crossings[0]) / (n - 1) as f64;
    // A step in several periods; the amplitude of a hundredth changes the period by less than that.
    assert!((measured_s / period_s - 1.0).abs() < 0.05, "{measured_s} against {period_s}");
    // At rest where the potential is least, they stay.
    let mut still = perfect(&begin(rest), 2);
    for _ in 0..100 {
        still.step();
    }
    let found = places(&still.states);
    assert!((distance(found[0], found[1]) - rest).abs() < 1e-3);
}

#[test]
fn lines_form_where_the_fit_that_is_asked_for_says() {
    // Three robots of an upright triangle, high and narrow: vertical distances are least about the level line through the
    // mean, distances across the line about the upright one. Everyone goes to the line that all see.
    let begin = "agent,x_m,y_m\n0,-0.3,0\n1,0.3,0\n2,0,3\n3,0.1,1.5\n4,-0.1,1.5\n";
    let formed = |fit: &str| {
        let toml = format!(
            "scenario = {{ kind = 'csv', file = 'p' }}\ncontroller = {{ kind = 'line-formation', fit = '{fit}' }}"
        );
        let mut setup = setup(&toml, 5, 1);
        setup.files.insert("p".to_owned(), begin.into());
        let hears: Perfect = |_, _, _, _| true;
        let mut air = Air::new(&setup, hears);
        let done = (0..500).find(|_| air.step().task_complete);
        assert!(done.is_some(), "{fit}: it is never done");
        let found = places(&air.states);
        [0, 1].map(|axis| {
            let of = found.iter().map(|place| place[axis]);
            of.clone().fold(f64::NEG_INFINITY, f64::max) - of.fold(f64::INFINITY, f64::min)
        })
    };
    let [across_m, along_m] = formed("orthogonal");
    // Robots within a millimetre of their lines stay; along the upright line nobody moves.
    assert!(across_m < 0.01 && (along_m - 3.0).abs() < 0.01, "{across_m} {along_m}");
    let [along_m, across_m] = formed("vertical");
    assert!(across_m < 0.01 && (along_m - 0.6).abs() < 0.01, "{along_m} {across_m}");
}
