//! Quadrotors flown here, by equations written out here, and held against the model: what they lack is found.

use diagnose::Request;
use measure::config::Compared;
use proto::rng::{Draws, Purpose};
use serde_json::Value;
use std::fmt::Write as _;
use study::choices::Choices;
use study::open;
use tests::answers::{self, measurements};

const GRAVITY_MPS2: f64 = 9.80665;
const MASS_KG: f64 = 1.2;
/// Time constant of the thrust vector (s).
const LAG_S: f64 = 0.15;
const SAMPLE_S: f64 = 0.05;
/// Steps of the integration in a sample.
const STEPS: u32 = 50;
/// Noise of measured positions, per component (m).
const NOISE_M: f64 = 0.005;

/// What is wrong with a quadrotor.
#[derive(Clone, Copy, Default)]
struct Hidden {
    /// Thrust that is lacking, as a share of the commanded one.
    lacking: f64,
    /// The same from half of the flight on.
    lost: f64,
    /// Mass that the controller knows nothing of (kg) …
    payload_kg: f64,
    /// … and the cable on which it swings (m); 0: it is fixed.
    cable_m: f64,
    /// Radius of a rotor in ground effect (m); 0: none.
    rotor_radius_m: f64,
    /// Force by mass to the east and the north (m/s²).
    push_mps2: [f64; 2],
    /// Drag by speed (1/s) …
    drag_per_s: f64,
    /// … through air that moves east and north so fast (m/s) …
    air_mps: [f64; 2],
    /// … and by its square (1/m).
    drag_per_m: f64,
    /// Roll and pitch beside the commanded ones (rad).
    tilt_rad: [f64; 2],
    /// With which power of the voltage, from 3.9 V, thrust falls.
    voltage_exponent: f64,
}

/// How the table says what was commanded.
#[derive(Clone, Copy, PartialEq)]
enum Commands {
    Acceleration,
    Thrust,
}

/// Samples of a flight.
const N_SAMPLES: u64 = 1200;

/// Two quadrotors that fly to places drawn anew every two seconds, at heights (m) from the first to the second number.
fn flown(hidden: Hidden, commands: Commands, heights_m: [f64; 2]) -> String {
    let columns = match commands {
        Commands::Acceleration => "cmd_ax_mps2,cmd_ay_mps2,cmd_az_mps2",
        Commands::Thrust => "cmd_thrust_n,cmd_roll_rad,cmd_pitch_rad,cmd_yaw_rad",
    };
    let mut csv = format!("time_s,agent,x_m,y_m,z_m,voltage_v,{columns}\n");
    let draws = Draws::new(3, Purpose::Resample);
    for agent in 0..2_u64 {
        let mut at_m = [50.0 * agent as f64, 0.0, heights_m[0]];
        let mut velocity_mps = [0.0; 3];
        // Where the load hangs, seen from the robot, and how that changes.
        let (mut hangs_m, mut swings_mps) = ([0.0; 2], [0.0; 2]);
        // Thrust by mass (m/s²): hover.
        let mut thrust_mps2 = [0.0, 0.0, GRAVITY_MPS2];
        for sample in 0..N_SAMPLES {
            let draw = |k: u64| {
                let [word, ..] = draws.words(agent, sample / 40, k);
                proto::rng::uniform(word)
            };
            let goal_m = [
                50.0 * agent as f64 + 6.0 * draw(0),
                6.0 * draw(1),
                heights_m[0] + (heights_m[1] - heights_m[0]) * draw(2),
            ];
            let asked_mps2: [f64; 3] = std::array::from_fn(|i| {
                (2.0 * (goal_m[i] - at_m[i]) - 2.2 * velocity_mps[i]).clamp(-2.5, 2.5)
            });
            let noisy = |k: usize| at_m[k] + NOISE_M * draws.normal(10 + agent, sample, k as u64);
            let time_s = SAMPLE_S * sample as f64;
            let voltage_v = 4.2 - 0.6 * sample as f64 / N_SAMPLES as f64;
            let [x_m, y_m, z_m] = [0, 1, 2].map(noisy);
            write!(csv, "{time_s:.2},{agent},{x_m:.5},{y_m:.5},{z_m:.5},{voltage_v:.4},").unwrap();
            let [ax, ay, az] = asked_mps2;
            let f = [ax, ay, az + GRAVITY_MPS2];
            // Its nose turns about the vertical axis in 40 s.
            let yaw = 0.4 + std::f64::consts::TAU * time_s / 40.0;
            match commands {
                Commands::Acceleration => writeln!(csv, "{ax:.6},{ay:.6},{az:.6}").unwrap(),
                Commands::Thrust => {
                    // The attitude whose vertical axis is along f: f turned back by the yaw is
                    // (sin p cos r, -sin r, cos p cos r).
                    let size = f.iter().map(|part| part * part).sum::<f64>().sqrt();
                    let ahead = (f[0] * yaw.cos() + f[1] * yaw.sin()) / size;
                    let left = (f[1] * yaw.cos() - f[0] * yaw.sin()) / size;
                    let (roll, pitch) = ((-left).asin(), ahead.atan2(f[2] / size));
                    writeln!(csv, "{:.6},{roll:.7},{pitch:.7},{yaw}", MASS_KG * size).unwrap();
                }
            }
            let is_late = N_SAMPLES / 2 <= sample;
            let lost = if is_late { hidden.lost } else { 0.0 };
            let by_voltage = (voltage_v / 3.9).powf(hidden.voltage_exponent);
            let share = (1.0 - hidden.lacking) * (1.0 - lost) * by_voltage;
            let load = hidden.payload_kg / MASS_KG;
            let h_s = SAMPLE_S / f64::from(STEPS);
            for _ in 0..STEPS {
                let ratio = hidden.rotor_radius_m / (4.0 * at_m[2]);
                for i in 0..3 {
                    thrust_mps2[i] += (f[i] - thrust_mps2[i]) * (1.0 - (-h_s / LAG_S).exp());
                }
                let gain = share / (1.0 - ratio * ratio);
                let mut push_mps2 =
                    tilted(thrust_mps2.map(|part| gain * part), hidden.tilt_rad, yaw);
                let through_mps: [f64; 3] = std::array::from_fn(|i| {
                    velocity_mps[i] - hidden.air_mps.get(i).copied().unwrap_or(0.0)
                });
                let speed_mps = velocity_mps.iter().map(|part| part * part).sum::<f64>().sqrt();
                for i in 0..3 {
                    push_mps2[i] -= hidden.drag_per_s * through_mps[i]
                        + hidden.drag_per_m * speed_mps * velocity_mps[i];
                }
                for (part, push) in push_mps2.iter_mut().zip(hidden.push_mps2) {
                    *part += push;
                }
                if hidden.cable_m == 0.0 {
                    push_mps2 = push_mps2.map(|part| part / (1.0 + load));
                } else {
                    push_mps2[2] /= 1.0 + load;
                    // The cable bears the load, and pulls robot and load together.
                    for i in 0..2 {
                        let pull_mps2 = push_mps2[2] / hidden.cable_m * hangs_m[i];
                        push_mps2[i] += load * pull_mps2;
                        swings_mps[i] -= h_s * (pull_mps2 + push_mps2[i]);
                        hangs_m[i] += h_s * swings_mps[i];
                    }
                }
                push_mps2[2] -= GRAVITY_MPS2;
                for i in 0..3 {
                    at_m[i] += h_s * (velocity_mps[i] + 0.5 * h_s * push_mps2[i]);
                    velocity_mps[i] += h_s * push_mps2[i];
                }
            }
        }
    }
    csv
}

/// A vector turned by small angles about the axes ahead and to the left of a nose at `yaw`.
fn tilted(vector: [f64; 3], [roll, pitch]: [f64; 2], yaw: f64) -> [f64; 3] {
    let (ahead, left) = ([yaw.cos(), yaw.sin(), 0.0], [-yaw.sin(), yaw.cos(), 0.0]);
    [(ahead, roll), (left, pitch)].into_iter().fold(vector, |vector, (axis, angle)| {
        // Rodrigues' formula.
        let along: f64 = (0..3).map(|i| axis[i] * vector[i]).sum();
        let cross: [f64; 3] = std::array::from_fn(|i| {
            let [j, k] = [(i + 1) % 3, (i + 2) % 3];
            axis[j] * vector[k] - axis[k] * vector[j]
        });
        std::array::from_fn(|i| {
            vector[i] * angle.cos() + cross[i] * angle.sin() + axis[i] * along * (1.0 - angle.cos())
        })
    })
}

fn config(dynamics: &str) -> Compared {
    answers::model(&format!("[robotsim.dynamics]\n{dynamics}"))
}

/// What `diagnose` says as JSON, with a model that knows the lag.
fn diagnosed(csv: &str, mass: &str) -> Value {
    let model = config(&format!("kind = \"quadrotor\"\n{mass}"));
    let found = answers::diagnosed(&Request::new(&model, &measurements(csv)));
    serde_json::to_value(&found).unwrap()
}

/// Why measurements are not held against a model.
fn refused(csv: &str, dynamics: &str) -> String {
    open::robots(&config(dynamics), &measurements(csv), &Choices::default())
        .unwrap_err()
        .to_string()
}

fn missing(found: &Value) -> Vec<&str> {
    let names = found["missing"].as_array().unwrap().iter().filter_map(Value::as_str);
    // Of several that look alike the first.
    names.filter_map(|name| name.split(" or ").next()).collect()
}

/// The number of an accepted effect, with its interval.
#[track_caller]
fn number(found: &Value, effect: &str, key: &str) -> [f64; 3] {
    let candidates = found["candidates"].as_array().unwrap();
    let candidate = candidates.iter().find(|candidate| candidate["effect"] == effect).unwrap();
    ["value", "low", "high"].map(|end| candidate["parameters"][key][end].as_f64().unwrap())
}

#[test]
fn thrust_that_is_too_weak_is_found_from_commands_of_acceleration() {
    let hidden = Hidden { lacking: 0.07, ..Hidden::default() };
    let found = diagnosed(&flown(hidden, Commands::Acceleration, [2.0, 5.0]), "");
    assert_eq!(missing(&found), ["thrust-scale"], "{found:#}");
    let [value, ..] = number(&found, "thrust-scale", "scale");
    assert!((value - 0.93).abs() < 0.002, "{found:#}");
    let because = |effect: &str| {
        let candidates = found["candidates"].as_array().unwrap();
        let candidate = candidates.iter().find(|candidate| candidate["effect"] == effect).unwrap();
        candidate["untestable"].as_str().unwrap_or_default().to_owned()
    };
    assert_eq!(because("payload-mass"), "needs mass_kg in [robotsim.dynamics]");
    assert_eq!(because("slope"), "needs terrain in [site]");
}

#[test]
fn a_load_is_found_from_commands_of_thrust_and_attitude_and_is_said_to_look_like_weak_thrust() {
    let hidden = Hidden { payload_kg: 0.1, ..Hidden::default() };
    let csv = flown(hidden, Commands::Thrust, [2.0, 5.0]);
    let found = diagnosed(&csv, "mass_kg = 1.2\n");
    let [name] = missing(&found)[..] else { panic!("{found:#}") };
    assert!(["payload-mass", "thrust-scale"].contains(&name), "{found:#}");
    if name == "payload-mass" {
        let [value, ..] = number(&found, name, "payload_kg");
        assert!((value - 0.1).abs() < 0.003, "{found:#}");
    } else {
        let [value, ..] = number(&found, name, "scale");
        assert!((value - 12.0 / 13.0).abs() < 0.002, "{found:#}");
    }
    let candidates = found["candidates"].as_array().unwrap();
    let accepted = candidates.iter().find(|candidate| candidate["effect"] == name).unwrap();
    let other = if name == "payload-mass" { "thrust-scale" } else { "payload" };
    assert!(accepted.to_string().contains(other), "{accepted:#}");

    // The mass is what makes accelerations of it.
    let without_mass = refused(&csv, "kind = \"quadrotor\"\n");
    assert!(without_mass.contains("robotsim.dynamics.mass_kg is required"), "{without_mass}");
    let other_body = refused(&csv, "kind = \"point-mass\"\n");
    assert!(other_body.contains("set it to \"quadrotor\""), "{other_body}");
}

#[test]
fn the_ground_effect_is_found_with_the_radius_of_the_rotor() {
    let hidden = Hidden { rotor_radius_m: 0.3, ..Hidden::default() };
    let found = diagnosed(&flown(hidden, Commands::Acceleration, [0.3, 1.2]), "");
    assert_eq!(missing(&found), ["ground-effect"], "{found:#}");
    let [value, ..] = number(&found, "ground-effect", "rotor_radius_m");
    assert!((value - 0.3).abs() < 0.01, "{found:#}");
}

#[test]
fn of_quadrotors_that_fly_as_modelled_nothing_is_missing() {
    let found =
        diagnosed(&flown(Hidden::default(), Commands::Thrust, [2.0, 5.0]), "mass_kg = 1.2\n");
    assert_eq!(missing(&found), [""; 0], "{found:#}");
    assert_eq!(found["verdict"], "nothing-missing", "{found:#}");
    // Noise of the end, and of what is known of place and velocity when a window begins.
    let rmse_m = found["ladder"][0]["rmse"].as_f64().unwrap();
    assert!((NOISE_M * 3_f64.sqrt()..4.0 * NOISE_M).contains(&rmse_m), "{rmse_m}");
}

#[test]
fn forces_are_found_with_their_sizes() {
    let default = Hidden::default();
    let cases: [(Hidden, &str, &[Number]); 6] = [
        (
            Hidden { push_mps2: [0.3, -0.2], ..default },
            "push",
            &[("acceleration_mps2[0]", 0.3, 0.01), ("acceleration_mps2[1]", -0.2, 0.01)],
        ),
        (Hidden { drag_per_s: 0.3, ..default }, "linear-drag", &[("rate_per_s", 0.3, 0.01)]),
        (
            Hidden { drag_per_m: 0.15, ..default },
            "quadratic-drag",
            &[("coefficient_per_m", 0.15, 0.01)],
        ),
        (
            Hidden { drag_per_s: 0.3, air_mps: [2.0, 1.0], ..default },
            "wind",
            &[
                ("velocity_mps[0]", 2.0, 0.1),
                ("velocity_mps[1]", 1.0, 0.1),
                ("drag_per_s", 0.3, 0.01),
            ],
        ),
        (
            Hidden { tilt_rad: [0.02, -0.03], ..default },
            "attitude-bias",
            &[("roll_rad", 0.02, 0.001), ("pitch_rad", -0.03, 0.001)],
        ),
        (
            Hidden { payload_kg: 0.15, cable_m: 0.6, ..default },
            "swinging-load",
            &[("payload_kg", 0.15, 0.005), ("cable_m", 0.6, 0.02)],
        ),
    ];
    for (hidden, effect, numbers) in cases {
        let csv = flown(hidden, Commands::Thrust, [2.0, 5.0]);
        expect(&diagnosed(&csv, "mass_kg = 1.2\n"), effect, numbers);
    }
}

#[test]
fn thrust_that_changes_on_the_way_is_found_with_when_or_by_what() {
    let half_s = 0.5 * SAMPLE_S * N_SAMPLES as f64;
    let lost = flown(Hidden { lost: 0.1, ..Hidden::default() }, Commands::Acceleration, [2.0, 5.0]);
    expect(&diagnosed(&lost, ""), "rotor-loss", &[("share", 0.1, 0.005), ("at_s", half_s, 0.3)]);
    let fallen = Hidden { voltage_exponent: 1.5, ..Hidden::default() };
    let fallen = flown(fallen, Commands::Acceleration, [2.0, 5.0]);
    let numbers = [("exponent", 1.5, 0.05), ("reference_v", 3.9, 0.01)];
    expect(&diagnosed(&fallen, ""), "thrust-voltage", &numbers);
}

/// The key of a number, what it is, and how far off its estimate may be.
type Number = (&'static str, f64, f64);

/// That one effect is missing, alone or first of several that look alike, with these numbers.
#[track_caller]
fn expect(found: &Value, effect: &str, numbers: &[Number]) {
    assert_eq!(missing(found), [effect], "{}", found["sentence"]);
    for &(key, truth, within) in numbers {
        let [value, ..] = number(found, effect, key);
        assert!((value - truth).abs() < within, "{effect}: {key} is {value}, not {truth}");
    }
}
