//! The order of the integration: how its error falls with the step, against other methods and closed forms.

use super::*;
use crate::dynamics::effect::testing::physics;
use proto::site::{Hill, Terrain};

/// The product's physics with other steps (s).
fn with_steps(text: &str, turning_s: f64, local_s: f64) -> Physics {
    Physics { steps: Steps { turning_s, local_s, force_s: local_s, ..STEPS }, ..physics(text) }
}

/// Where a robot comes to in `t_s` that begins at `robot` and is asked for `demand`.
fn end(
    physics: &Physics,
    mut robot: Robot,
    demand: Drive,
    t_s: f64,
    surroundings: &Surroundings<'_>,
) -> Robot {
    let orders = [Order { from_s: 0.0, demand }];
    physics.advance(&mut robot, &orders, &mut 0, 0.0, t_s, surroundings);
    robot
}

/// The classical Runge-Kutta method in 20,000 steps: an error far below that of what is measured with it.
fn runge_kutta<const N: usize>(
    begin: [f64; N],
    t_s: f64,
    rate: impl Fn([f64; N]) -> [f64; N],
) -> [f64; N] {
    let n = 20_000;
    let h = t_s / f64::from(n);
    let advanced = |s: [f64; N], k: [f64; N], h: f64| std::array::from_fn(|i| s[i] + h * k[i]);
    (0..n).fold(begin, |s, _| {
        let a = rate(s);
        let b = rate(advanced(s, a, h / 2.0));
        let c = rate(advanced(s, b, h / 2.0));
        let d = rate(advanced(s, c, h));
        std::array::from_fn(|i| s[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
    })
}

/// Orders log2 (error(h) / error(h / 2)) from the product's step on, for two halvings, and the error at the product's step (m).
fn orders(step_s: f64, error_m: impl Fn(f64) -> f64) -> ([f64; 2], f64) {
    let errors = [1.0, 0.5, 0.25].map(|share| error_m(share * step_s));
    ([libm::log2(errors[0] / errors[1]), libm::log2(errors[1] / errors[2])], errors[0])
}

fn apart_m(a: [f64; 3], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

const LAGS: &str = "[[effect]]\nkind = 'actuator-lag'\ntau_s = 0.3\non = 'speed'\n\
                    [[effect]]\nkind = 'actuator-lag'\ntau_s = 0.2\non = 'turn'\n";
const LAGS_S: [f64; 2] = [0.3, 0.2];

/// How a turning body with these lags moves, its yaw rate (rad/s) following from what its actuators do.
fn turning(demand: [f64; 2], t_s: f64, yaw_rate: impl Fn(f64, f64) -> f64) -> [f64; 2] {
    let [x, y, ..] = runge_kutta([0.0; 5], t_s, |[_, _, heading, speed, turn]| {
        [
            speed * libm::cos(heading),
            speed * libm::sin(heading),
            yaw_rate(speed, turn),
            (demand[0] - speed) / LAGS_S[0],
            (demand[1] - turn) / LAGS_S[1],
        ]
    });
    [x, y]
}

/// Asserts that a turning body of the kind of `text`, with these lags, errs a quarter with half the step, and by less than `least_m`
/// at the product's.
fn assert_second_order(
    text: &str,
    demand: [f64; 2],
    least_m: f64,
    yaw_rate: impl Fn(f64, f64) -> f64,
) {
    let text = format!("{text}\n{LAGS}");
    let exact = turning(demand, 0.8, yaw_rate);
    let error_m = |step_s| {
        let physics = with_steps(&text, step_s, STEPS.local_s);
        let nowhere = Surroundings::default();
        let demand = [demand[0], demand[1], 0.0];
        apart_m(end(&physics, Robot::default(), demand, 0.8, &nowhere).position_m, exact)
    };
    let (orders, error_m) = orders(STEPS.turning_s, error_m);
    // Steps of an eighth of the shorter lag: the next order changes the ratio by a few per cent.
    assert!(orders.iter().all(|order| (1.9..2.1).contains(order)), "{orders:?}");
    assert!(error_m < least_m, "{error_m} m after 0.8 s");
}

#[test]
fn a_unicycle_whose_actuators_lag_errs_a_quarter_with_half_the_step() {
    assert_second_order("kind = 'unicycle'", [2.0, 3.0], 1e-3, |_, turn| turn);
}

#[test]
fn a_car_whose_actuators_lag_errs_a_quarter_with_half_the_step() {
    let yaw_rate = |speed, turn| speed * libm::tan(turn) / 0.5;
    assert_second_order("kind = 'car'\nwheelbase_m = 0.5", [2.0, 0.4], 2e-3, yaw_rate);
}

#[test]
fn without_lags_an_arc_is_the_closed_form_in_one_step() {
    // ω = 3 rad/s for the unicycle, 2 tan 0.4 / 0.5 for the car: a circle of radius v / ω.
    for (text, turn, yaw_rate) in [
        ("kind = 'unicycle'", 3.0, 3.0),
        ("kind = 'car'\nwheelbase_m = 0.5", 0.4, 2.0 * libm::tan(0.4) / 0.5),
    ] {
        let physics = with_steps(text, 10.0, 10.0);
        let nowhere = Surroundings::default();
        let end = end(&physics, Robot::default(), [2.0, turn, 0.0], 0.8, &nowhere);
        let (angle, radius) = (0.8 * yaw_rate, 2.0 / yaw_rate);
        let exact = [radius * libm::sin(angle), radius * (1.0 - libm::cos(angle))];
        // Rounding of numbers about 1.
        assert!(apart_m(end.position_m, exact) < 1e-14, "{text}: {end:?} {exact:?}");
    }
}

/// A hollow of 8 m and 20 m radius, and its slope's drift at `gain` 4 m/s, or force at 4 m/s², by hand: h = H e^(−d² / 2 r²).
fn hollow() -> Terrain {
    Terrain::Hills(vec![Hill { centre_m: [0.0; 2], height_m: -8.0, radius_m: 20.0 }])
}

const SLOPE: &str = "[[effect]]\nkind = 'slope'\ngain = 4.0\n";

#[test]
fn a_quadrotor_in_a_field_of_force_errs_a_quarter_with_half_the_step() {
    let text = format!("kind = 'quadrotor'\nattitude_lag_s = 0.15\n{SLOPE}");
    let terrain = hollow();
    let begin = Robot { position_m: [6.0, -3.0, 0.0], ..Robot::default() };
    let asked = [1.5, 1.0];
    let [x, y, ..] = runge_kutta([6.0, -3.0, 0.0, 0.0, 0.0, 0.0], 1.2, |[x, y, vx, vy, ax, ay]| {
        let [east, north] = terrain.gradient([x, y]);
        let lag_s = 0.15;
        let push = [(asked[0] - ax) / lag_s, (asked[1] - ay) / lag_s];
        [vx, vy, ax - 4.0 * east, ay - 4.0 * north, push[0], push[1]]
    });
    let error_m = |step_s| {
        let physics = with_steps(&text, STEPS.turning_s, step_s);
        let surroundings = Surroundings { terrain: Some(&terrain), ..Surroundings::default() };
        let end = end(&physics, begin, [asked[0], asked[1], 0.0], 1.2, &surroundings);
        apart_m(end.position_m, [x, y])
    };
    let (orders, error_m) = orders(STEPS.local_s, error_m);
    // The force is taken half way.
    assert!(orders.iter().all(|order| (1.9..2.1).contains(order)), "{orders:?}");
    assert!(error_m < 1e-3, "{error_m} m after 1.2 s");
}

#[test]
fn a_quadrotor_alone_is_the_closed_form_whatever_the_step() {
    // x = a t² / 2 − a τ (t − τ (1 − e^(−t / τ))), from rest.
    let (t, lag, asked) = (1.2, 0.15, 1.5);
    let exact = 0.5 * asked * t * t - asked * lag * (t - lag * (1.0 - libm::exp(-t / lag)));
    for step_s in [0.01, 0.1, 10.0] {
        let physics = with_steps("kind = 'quadrotor'\nattitude_lag_s = 0.15", step_s, step_s);
        let nowhere = Surroundings::default();
        let end = end(&physics, Robot::default(), [asked, 0.0, 0.0], t, &nowhere);
        // Rounding of numbers about 1.
        assert!(apart_m(end.position_m, [exact, 0.0]) < 1e-14, "{end:?} {exact}");
    }
}

#[test]
fn far_from_the_border_of_a_disc_a_fit_needs_no_short_steps() {
    let disc =
        "[[effect]]\nkind = 'rough-ground'\ncentre_m = [2.0, 0.5]\nradius_m = 1.0\nscale = 0.6";
    for (kind, demand) in [("unicycle", [1.2, 0.2, 0.0]), ("point-mass", [1.0, 0.3, 0.0])] {
        let text = format!("kind = '{kind}'\n{disc}");
        let [short, adaptive] = [physics(&text), physics(&text).in_fits()];
        let nowhere = Surroundings::default();
        let mut robots = [Robot::default(); 2];
        for step in 0..30 {
            // Outside, over both borders and outside again.
            for (physics, robot) in [&short, &adaptive].into_iter().zip(&mut robots) {
                *robot = end(physics, *robot, demand, 0.2, &nowhere);
            }
            let [a, b] = robots.map(|robot| robot.position_m);
            assert!(apart_m(a, [b[0], b[1]]) < 1e-12, "{kind} {step}: {a:?} {b:?}");
        }
        assert!(3.0 < robots[0].position_m[0], "{robots:?}");
    }
}

#[test]
fn forces_in_fits_err_by_far_less_than_noise() {
    let text = "kind = 'double-integrator'\n[[effect]]\nkind = 'linear-drag'\nrate_per_s = 0.8";
    let nowhere = Surroundings::default();
    let fitted = end(&physics(text).in_fits(), Robot::default(), [3.0, 0.0, 0.0], 2.0, &nowhere);
    // v = a / k (1 − e^(−k t)), from rest.
    let exact = 3.0 / 0.8 * (2.0 - (1.0 - libm::exp(-1.6)) / 0.8);
    assert!(apart_m(fitted.position_m, [exact, 0.0]) < 2e-4, "{fitted:?} {exact}");
}
