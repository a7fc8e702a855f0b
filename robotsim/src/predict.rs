//! Where robots get to that start in a recorded state and execute recorded commands.

use crate::catalogue::Catalogue;
use crate::dynamics::physics::{Order, Physics, Robot};
use crate::dynamics::surroundings::Surroundings;
use crate::dynamics::{self, Dynamics, Shape};
use proto::config::{Node, Problem, Value, check};
use proto::ids::AgentId;
use proto::prediction::{
    MotionCommandKind, PredictedState, PredictedWindow, PredictionRequest, PredictionWindow,
};
use proto::time::{SimDuration, SimTime};

/// Predicts windows by `[robotsim.dynamics]`, the section and its checks being those of runs; nothing else of the configuration
/// matters.
///
/// # Model
///
/// The robot of each window is advanced by [`Physics`], as in runs and fits. Its first command has been in force before the
/// window; where its velocity was measured, its speed (or velocity) is that instead.
///
/// # Validity
///
/// Each robot is alone: others, walls, contacts and obstacles have no effect. Gusts are at their mean. Noise of localization is
/// left out: what is predicted is where the robot is, not where it would be measured.
///
/// # Errors
///
/// Problems of the dynamics; a body that executes other commands than those of the request; groups, since which robot is of
/// which group depends on how many there are.
pub(crate) fn predict(
    request: &PredictionRequest,
    catalogue: &Catalogue,
) -> Result<Vec<PredictedWindow>, Vec<Problem>> {
    let physics = physics(request, catalogue)?;
    let window = |window: &PredictionWindow| predicted(window, &physics, request);
    Ok(request.windows.iter().map(window).collect())
}

/// The dynamics of the request, if they execute its commands.
fn physics(request: &PredictionRequest, catalogue: &Catalogue) -> Result<Physics, Vec<Problem>> {
    let mut problems = Vec::new();
    if matches!(request.config.get("group").map(|node| &node.value), Some(Value::List(groups)) if !groups.is_empty())
    {
        let message =
            "must be absent when motion is predicted, which takes all robots for alike; remove it";
        problems.push(Problem::new("group", message));
    }
    let empty = Node::empty_table();
    let written = request.config.get("dynamics").unwrap_or(&empty);
    let table =
        check(written, "dynamics", &dynamics::SPEC, &catalogue.lists(), &mut problems).table;
    let (shape, needed) = match request.command_kind {
        MotionCommandKind::Velocity => (Shape::Velocity, "point-mass"),
        MotionCommandKind::SpeedAndYawRate => (Shape::Unicycle, "unicycle"),
        MotionCommandKind::SpeedAndSteering => (Shape::Car, "car"),
    };
    let mut built = None;
    if problems.is_empty() {
        built = Dynamics::build(&table, "dynamics", &catalogue.effects, &mut problems);
    }
    let physics = built.map(Dynamics::into_physics);
    if let Some(physics) = &physics
        && (physics.shape() != shape || physics.is_inertial())
    {
        let message = format!("must be {needed:?} to execute the recorded commands");
        let kind = table.get("kind").and_then(toml::Value::as_str).unwrap_or_default();
        problems.push(Problem::new("dynamics.kind", message).value(format!("{kind:?}")));
    }
    physics.filter(|_| problems.is_empty()).ok_or(problems)
}

fn predicted(
    window: &PredictionWindow,
    physics: &Physics,
    request: &PredictionRequest,
) -> PredictedWindow {
    let around = Surroundings {
        agent: AgentId(window.agent),
        terrain: Some(&request.site.terrain),
        ..Surroundings::default()
    };
    let first = window.steps.first().map_or([0.0; 3], |step| step.command);
    let start = SimTime::from_ns(window.start_ns);
    let start_s = start.seconds();
    let mut robot = Robot {
        position_m: window.position_m,
        heading_rad: window.heading_rad,
        ..Robot::default()
    };
    robot.drive = physics.target_at(first, &robot, start_s, &around);
    if let Some([vx_mps, vy_mps, vz_mps]) = window.velocity_mps {
        if request.command_kind.is_turning() {
            let (sin, cos) = libm::sincos(window.heading_rad);
            robot.drive[0] = vx_mps * cos + vy_mps * sin;
        } else {
            robot.drive = [vx_mps, vy_mps, vz_mps];
        }
    }
    let mut orders = vec![Order { from_s: f64::NEG_INFINITY, demand: first }];
    let mut at = start;
    for step in &window.steps {
        if orders.last().is_some_and(|last| last.demand != step.command) {
            orders.push(Order { from_s: at.seconds(), demand: step.command });
        }
        at += SimDuration::from_ns(step.duration_ns);
    }
    let mut next = 0;
    let mut at = start;
    let mut states = Vec::with_capacity(window.steps.len());
    for step in &window.steps {
        let until = at + SimDuration::from_ns(step.duration_ns);
        let [at_s, until_s] = [at, until].map(SimTime::seconds);
        physics.advance(&mut robot, &orders, &mut next, at_s, until_s, &around);
        states
            .push(PredictedState { position_m: robot.position_m, heading_rad: robot.heading_rad });
        at = until;
    }
    states
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::prediction::PredictionStep;
    use proto::site::Site;
    use std::f64::consts::PI;

    fn request(config: &str, command_kind: MotionCommandKind) -> PredictionRequest {
        let step = PredictionStep { duration_ns: 500_000_000, command: [1.0, 0.5, 0.0] };
        PredictionRequest {
            site: Site::default(),
            config: proto::config::parse(config).unwrap(),
            command_kind,
            windows: vec![PredictionWindow {
                agent: 3,
                start_ns: 0,
                position_m: [1.0, 2.0, 0.0],
                heading_rad: 0.5 * PI,
                velocity_mps: None,
                steps: vec![step; 4],
            }],
        }
    }

    fn end(request: &PredictionRequest) -> PredictedState {
        let predicted = predict(request, &Catalogue::default()).unwrap();
        assert_eq!((predicted.len(), predicted[0].len()), (1, 4));
        predicted[0][3]
    }

    /// ẋ = v cos θ, ẏ = v sin θ, θ̇ = ω has the circle of radius v / ω as its solution.
    #[test]
    fn a_unicycle_that_turns_goes_along_its_circle() {
        let request = request("dynamics.kind = 'unicycle'", MotionCommandKind::SpeedAndYawRate);
        let PredictedState { position_m, heading_rad } = end(&request);
        // After 2 s at 0.5 rad/s: 1 rad along a circle of radius 2 m around (−1, 2), begun northwards.
        let expected_m = [-1.0 + 2.0 * f64::cos(1.0), 2.0 + 2.0 * f64::sin(1.0)];
        // Rounding in f64 at metres.
        assert!((heading_rad - (0.5 * PI + 1.0)).abs() < 1e-12, "{heading_rad}");
        assert!((position_m[0] - expected_m[0]).abs() < 1e-12, "{position_m:?}");
        assert!((position_m[1] - expected_m[1]).abs() < 1e-12, "{position_m:?}");
    }

    /// ẍ = (u − ẋ) / τ, begun with velocity v: x(t) = u t + (v − u) τ (1 − exp(−t/τ)).
    #[test]
    fn a_measured_velocity_counts_where_actuators_follow() {
        let lag =
            "dynamics = { kind = 'point-mass', effect = [{ kind = 'actuator-lag', tau_s = 0.5 }] }";
        let mut request = request(lag, MotionCommandKind::Velocity);
        let steady_m = end(&request).position_m;
        assert!(
            (steady_m[0] - 3.0).abs() < 1e-9 && (steady_m[1] - 3.0).abs() < 1e-9,
            "{steady_m:?}"
        );
        request.windows[0].velocity_mps = Some([0.0; 3]);
        let begun_m = end(&request).position_m;
        let expected_m = 1.0 + 2.0 - 0.5 * (1.0 - f64::exp(-4.0));
        assert!((begun_m[0] - expected_m).abs() < 1e-9, "{begun_m:?}");
    }

    #[test]
    fn what_cannot_execute_the_commands_is_refused_by_its_key() {
        let refused = |config: &str| {
            let request = request(config, MotionCommandKind::Velocity);
            let problems = predict(&request, &Catalogue::default()).unwrap_err();
            problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
        };
        assert!(refused("dynamics.kind = 'car'").contains("dynamics.kind"));
        assert!(refused("dynamics.kind = 'quadrotor'").contains("\"point-mass\""));
        assert!(refused("dynamics.speed_cap_mps = -1.0").contains("dynamics.speed_cap_mps"));
        assert!(refused("group = [{ name = 'a' }]").contains("group"));
    }
}
