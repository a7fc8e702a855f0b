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
#[derive(Clone, Copy)]
struct Hidden {
    /// Thrust by commanded thrust.
    scale: f64,
    /// Mass that the controller knows nothing of (kg).
    payload_kg: f64,
    /// Radius of a rotor in ground effect (m); 0: none.
    rotor_radius_m: f64,
}

const NOTHING: Hidden = Hidden { scale: 1.0, payload_kg: 0.0, rotor_radius_m: 0.0 };

/// How the table says what was commanded.
#[derive(Clone, Copy, PartialEq)]
enum Commands {
    Acceleration,
    Thrust,
}

/// Two quadrotors that fly to places drawn anew every two seconds, at heights (m) from the first to the second number.
fn flown(hidden: Hidden, commands: Commands, heights_m: [f64; 2]) -> String {
    let columns = match commands {
        Commands::Acceleration => "cmd_ax_mps2,cmd_ay_mps2,cmd_az_mps2",
        Commands::Thrust => "cmd_thrust_n,cmd_roll_rad,cmd_pitch_rad,cmd_yaw_rad",
    };
    let mut csv = format!("time_s,agent,x_m,y_m,z_m,{columns}\n");
    let draws = Draws::new(3, Purpose::Resample);
    for agent in 0..2_u64 {
        let mut at_m = [50.0 * agent as f64, 0.0, heights_m[0]];
        let mut velocity_mps = [0.0; 3];
        // Thrust by mass (m/s²): hover.
        let mut thrust_mps2 = [0.0, 0.0, GRAVITY_MPS2];
        for sample in 0..2400_u64 {
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
            write!(csv, "{time_s:.2},{agent},{:.5},{:.5},{:.5},", noisy(0), noisy(1), noisy(2))
                .unwrap();
            let [ax, ay, az] = asked_mps2;
            let f = [ax, ay, az + GRAVITY_MPS2];
            match commands {
                Commands::Acceleration => writeln!(csv, "{ax:.6},{ay:.6},{az:.6}").unwrap(),
                Commands::Thrust => {
                    // The attitude whose vertical axis is along f, its nose at 0.4 rad from east: f turned back by the yaw is
                    // (sin p cos r, -sin r, cos p cos r).
                    let yaw = 0.4_f64;
                    let size = f.iter().map(|part| part * part).sum::<f64>().sqrt();
                    let ahead = (f[0] * yaw.cos() + f[1] * yaw.sin()) / size;
                    let left = (f[1] * yaw.cos() - f[0] * yaw.sin()) / size;
                    let (roll, pitch) = ((-left).asin(), ahead.atan2(f[2] / size));
                    writeln!(csv, "{:.6},{roll:.7},{pitch:.7},{yaw}", MASS_KG * size).unwrap();
                }
            }
            let share = MASS_KG / (MASS_KG + hidden.payload_kg) * hidden.scale;
            let h_s = SAMPLE_S / f64::from(STEPS);
            for _ in 0..STEPS {
                let ratio = hidden.rotor_radius_m / (4.0 * at_m[2]);
                let gain = share / (1.0 - ratio * ratio);
                for i in 0..3 {
                    thrust_mps2[i] += h_s * (f[i] - thrust_mps2[i]) / LAG_S;
                    let weight_mps2 = if i == 2 { GRAVITY_MPS2 } else { 0.0 };
                    let middle_mps =
                        velocity_mps[i] + 0.5 * h_s * (gain * thrust_mps2[i] - weight_mps2);
                    at_m[i] += h_s * middle_mps;
                    velocity_mps[i] += h_s * (gain * thrust_mps2[i] - weight_mps2);
                }
            }
        }
    }
    csv
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
    let hidden = Hidden { scale: 0.93, ..NOTHING };
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
    assert_eq!(because("wind"), "needs commands of velocity or speed");
}

#[test]
fn a_load_is_found_from_commands_of_thrust_and_attitude_and_is_said_to_look_like_weak_thrust() {
    let hidden = Hidden { payload_kg: 0.1, ..NOTHING };
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
    let hidden = Hidden { rotor_radius_m: 0.3, ..NOTHING };
    let found = diagnosed(&flown(hidden, Commands::Acceleration, [0.3, 1.2]), "");
    assert_eq!(missing(&found), ["ground-effect"], "{found:#}");
    let [value, ..] = number(&found, "ground-effect", "rotor_radius_m");
    assert!((value - 0.3).abs() < 0.01, "{found:#}");
}

#[test]
fn of_quadrotors_that_fly_as_modelled_nothing_is_missing() {
    let found = diagnosed(&flown(NOTHING, Commands::Thrust, [2.0, 5.0]), "mass_kg = 1.2\n");
    assert_eq!(missing(&found), [""; 0], "{found:#}");
    assert_eq!(found["verdict"], "nothing-missing", "{found:#}");
    // Noise of the end, and of what is known of place and velocity when a window begins.
    let rmse_m = found["ladder"][0]["rmse"].as_f64().unwrap();
    assert!((NOISE_M * 3_f64.sqrt()..4.0 * NOISE_M).contains(&rmse_m), "{rmse_m}");
}
