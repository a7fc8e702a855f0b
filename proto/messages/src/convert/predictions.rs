//! Windows of motion to predict and what was predicted, from messages to values and back.

use super::{InvalidField, NUMBER, Result, is_number};
use crate::v1;
use proto::prediction::{
    MotionCommandKind, PredictedState, PredictedWindow, PredictionStep, PredictionWindow,
};

/// The latest that a window may start (ns): after about 31 years.
const LATEST_NS: u64 = 1_000_000_000_000_000_000;

/// Windows to predict.
///
/// # Errors
///
/// There is none, or one has no command, columns of unequal length, a duration of 0, a time out of range, or a number that is
/// not finite.
pub fn prediction_windows(messages: Vec<v1::PredictionWindow>) -> Result<Vec<PredictionWindow>> {
    if messages.is_empty() {
        return Err(InvalidField::new("windows", "must have at least 1 entry, got 0"));
    }
    let window = |(index, message)| {
        window_of(message).map_err(|invalid| invalid.within(&format!("windows[{index}]")))
    };
    messages.into_iter().enumerate().map(window).collect()
}

fn window_of(message: v1::PredictionWindow) -> Result<PredictionWindow> {
    let n = message.duration_ns.len();
    if n == 0 {
        return Err(InvalidField::new("duration_ns", "must have at least 1 entry, got 0"));
    }
    let columns = [
        ("command_first", &message.command_first),
        ("command_second", &message.command_second),
        ("command_third", &message.command_third),
    ];
    for (field, column) in columns {
        column_of(field, column, n)?;
    }
    let velocity = message.velocity.map(|it| [it.vx_mps, it.vy_mps, it.vz_mps]);
    let [vx_mps, vy_mps, vz_mps] = velocity.unwrap_or_default();
    for (field, number) in [
        ("x_m", message.x_m),
        ("y_m", message.y_m),
        ("z_m", message.z_m),
        ("heading_rad", message.heading_rad),
        ("velocity.vx_mps", vx_mps),
        ("velocity.vy_mps", vy_mps),
        ("velocity.vz_mps", vz_mps),
    ] {
        if !is_number(number) {
            return Err(InvalidField::new(field, format!("{NUMBER}, got {number}")));
        }
    }
    if LATEST_NS < message.start_ns {
        let reason = format!("must be at most {LATEST_NS}, got {}", message.start_ns);
        return Err(InvalidField::new("start_ns", reason));
    }
    if let Some(step) = message.duration_ns.iter().position(|&duration_ns| duration_ns == 0) {
        let reason = format!("must be at least 1 each, entry {step} is 0");
        return Err(InvalidField::new("duration_ns", reason));
    }
    let [first, second, third] = columns.map(|(_, column)| column);
    let steps = (0..n).map(|step| PredictionStep {
        duration_ns: message.duration_ns[step],
        command: [first[step], second[step], third[step]],
    });
    Ok(PredictionWindow {
        agent: message.agent,
        start_ns: message.start_ns,
        position_m: [message.x_m, message.y_m, message.z_m],
        heading_rad: message.heading_rad,
        velocity_mps: velocity,
        steps: steps.collect(),
    })
}

impl From<&PredictionWindow> for v1::PredictionWindow {
    fn from(window: &PredictionWindow) -> Self {
        let [x_m, y_m, z_m] = window.position_m;
        let component = |k: usize| window.steps.iter().map(|step| step.command[k]).collect();
        Self {
            agent: window.agent,
            start_ns: window.start_ns,
            x_m,
            y_m,
            z_m,
            heading_rad: window.heading_rad,
            velocity: window.velocity_mps.map(|[vx_mps, vy_mps, vz_mps]| v1::PredictionVelocity {
                vx_mps,
                vy_mps,
                vz_mps,
            }),
            duration_ns: window.steps.iter().map(|step| step.duration_ns).collect(),
            command_first: component(0),
            command_second: component(1),
            command_third: component(2),
        }
    }
}

/// What was predicted for `asked`, whose commands are of a kind.
///
/// # Errors
///
/// Another number of windows, another robot, columns of another length than the window has commands, a number that is not
/// finite, or no headings where robots have some.
pub fn predicted_windows(
    reply: v1::RobotSimServicePredictResponse,
    asked: &[PredictionWindow],
    kind: MotionCommandKind,
) -> Result<Vec<PredictedWindow>> {
    if reply.windows.len() != asked.len() {
        let reason = format!(
            "must have {} entries, one per window of the request, got {}",
            asked.len(),
            reply.windows.len()
        );
        return Err(InvalidField::new("windows", reason));
    }
    let both = reply.windows.into_iter().zip(asked).enumerate();
    both.map(|(index, (message, asked))| {
        predicted_of(message, asked, kind)
            .map_err(|invalid| invalid.within(&format!("windows[{index}]")))
    })
    .collect()
}

fn predicted_of(
    message: v1::PredictedWindow,
    asked: &PredictionWindow,
    kind: MotionCommandKind,
) -> Result<PredictedWindow> {
    if message.agent != asked.agent {
        let reason = format!("must be {}, as in the request, got {}", asked.agent, message.agent);
        return Err(InvalidField::new("agent", reason));
    }
    let n = asked.steps.len();
    for (field, column) in [("x_m", &message.x_m), ("y_m", &message.y_m), ("z_m", &message.z_m)] {
        column_of(field, column, n)?;
    }
    let has_heading = kind.is_turning() || !message.heading_rad.is_empty();
    if has_heading {
        column_of("heading_rad", &message.heading_rad, n)?;
    }
    let state = |step: usize| PredictedState {
        position_m: [message.x_m[step], message.y_m[step], message.z_m[step]],
        heading_rad: if has_heading { message.heading_rad[step] } else { 0.0 },
    };
    Ok((0..n).map(state).collect())
}

/// What was predicted for windows, as a message.
#[must_use]
pub fn predicted_response(
    predicted: &[PredictedWindow],
    asked: &[PredictionWindow],
    kind: MotionCommandKind,
) -> v1::RobotSimServicePredictResponse {
    let message = |(window, asked): (&PredictedWindow, &PredictionWindow)| {
        let axis = |k: usize| window.iter().map(|state| state.position_m[k]).collect();
        let headings = window.iter().map(|state| state.heading_rad);
        v1::PredictedWindow {
            agent: asked.agent,
            x_m: axis(0),
            y_m: axis(1),
            z_m: axis(2),
            heading_rad: if kind.is_turning() { headings.collect() } else { Vec::new() },
        }
    };
    let windows = predicted.iter().zip(asked).map(message).collect();
    v1::RobotSimServicePredictResponse { windows }
}

/// Checks a column with one number per command.
fn column_of(field: &str, column: &[f64], n: usize) -> Result<()> {
    if column.len() != n {
        let reason = format!("must have {n} entries, one per command, got {}", column.len());
        return Err(InvalidField::new(field, reason));
    }
    match column.iter().position(|number| !is_number(*number)) {
        Some(step) => Err(InvalidField::new(
            format!("{field}[{step}]"),
            format!("{NUMBER}, got {}", column[step]),
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::motion_command_kind;

    fn window() -> PredictionWindow {
        let step = |speed_mps| PredictionStep { duration_ns: 100, command: [speed_mps, 0.5, 0.0] };
        PredictionWindow {
            agent: 7,
            start_ns: 3,
            position_m: [1.0, 2.0, 3.0],
            heading_rad: 0.5,
            velocity_mps: Some([4.0, 5.0, 6.0]),
            steps: vec![step(1.0), step(2.0)],
        }
    }

    #[test]
    fn windows_survive_the_way_there_and_predictions_the_way_back() {
        let kind = MotionCommandKind::SpeedAndYawRate;
        let messages = vec![v1::PredictionWindow::from(&window())];
        assert_eq!(prediction_windows(messages).unwrap(), [window()]);
        let state = |x_m| PredictedState { position_m: [x_m, 0.0, 0.0], heading_rad: x_m };
        let predicted = vec![vec![state(1.0), state(2.0)]];
        let reply = predicted_response(&predicted, &[window()], kind);
        assert_eq!(predicted_windows(reply, &[window()], kind).unwrap(), predicted);
    }

    #[test]
    fn a_malformed_window_is_refused_with_its_field() {
        let spoilt = |spoil: fn(&mut v1::PredictionWindow)| {
            let mut message = v1::PredictionWindow::from(&window());
            spoil(&mut message);
            prediction_windows(vec![message]).unwrap_err().to_string()
        };
        assert!(spoilt(|w| w.x_m = f64::NAN).starts_with("windows[0].x_m: must be finite"));
        assert!(spoilt(|w| w.duration_ns[1] = 0).contains("duration_ns: must be at least 1 each"));
        assert!(spoilt(|w| w.start_ns = u64::MAX).contains("start_ns: must be at most"));
        assert!(spoilt(|w| w.duration_ns.clear()).contains("duration_ns: must have at least 1"));
        assert!(
            spoilt(|w| w.command_second.clear()).contains("command_second: must have 2 entries")
        );
        let text = prediction_windows(Vec::new()).unwrap_err().to_string();
        assert_eq!(text, "windows: must have at least 1 entry, got 0");
        assert!(motion_command_kind(0).is_err() && motion_command_kind(9).is_err());
    }

    #[test]
    fn a_malformed_prediction_is_refused_with_its_field() {
        let kind = MotionCommandKind::SpeedAndYawRate;
        let spoilt = |spoil: fn(&mut v1::RobotSimServicePredictResponse)| {
            let predicted = vec![vec![PredictedState::default(); 2]];
            let mut reply = predicted_response(&predicted, &[window()], kind);
            spoil(&mut reply);
            predicted_windows(reply, &[window()], kind).unwrap_err().to_string()
        };
        assert_eq!(
            spoilt(|r| r.windows[0].agent = 1),
            "windows[0].agent: must be 7, as in the request, got 1"
        );
        assert!(spoilt(|r| r.windows.clear()).contains("windows: must have 1 entries"));
        assert!(spoilt(|r| r.windows[0].heading_rad.clear()).contains("heading_rad: must have 2"));
        assert!(
            spoilt(|r| r.windows[0].y_m[1] = f64::NAN)
                .contains("windows[0].y_m[1]: must be finite")
        );
    }
}
