//! Whether a robot simulator predicts recorded motion as the contract says.

use super::{ContractVerdict, Finding, N_STEPS, Questions, status_text, within};
use drive::peer::{Described, RobotSide};
use proto::prediction::{MotionCommandKind, PredictedWindow, PredictionStep, PredictionWindow};
use proto_messages::{convert, v1};
use tonic::{Code, Status};

const COMPLETE: &str = "Predict replies for each window and each of its commands, with complete and finite columns, to commands of \
                        at least one kind";
const STATELESS: &str = "Predict gives the same windows again, in another order and each by itself, and changes nothing of an experiment";
const REFUSES: &str = "a window whose start is not a number is INVALID_ARGUMENT";

/// Kinds of command. A simulator executes at least one of them.
const KINDS: [MotionCommandKind; 3] = [
    MotionCommandKind::Velocity,
    MotionCommandKind::SpeedAndYawRate,
    MotionCommandKind::SpeedAndSteering,
];

/// Three robots that start somewhere else each, drive, turn and stop.
fn windows() -> Vec<PredictionWindow> {
    let step = |duration_ns, command| PredictionStep { duration_ns, command };
    let window = |agent: u32, velocity_mps| PredictionWindow {
        agent,
        start_ns: 1_000_000_000 * u64::from(agent),
        position_m: [f64::from(agent), -2.0, 0.0],
        heading_rad: 0.5 * f64::from(agent),
        velocity_mps,
        steps: vec![
            step(100_000_000, [0.5, 0.1, 0.0]),
            step(250_000_000, [0.4, -0.2, 0.0]),
            step(50_000_000, [0.0; 3]),
        ],
    };
    vec![window(0, None), window(1, Some([0.1, 0.0, 0.0])), window(4, None)]
}

/// Promises about predictions, and whether a simulator keeps them.
pub(super) async fn judged(
    questions: &Questions<'_, RobotSide>,
    described: &Described,
) -> Vec<Finding> {
    let promises = [COMPLETE, STATELESS, REFUSES];
    if !described.predictions {
        return promises.map(|promise| (promise, ContractVerdict::NotAnnounced)).into();
    }
    let found = questions.executed().await;
    let (kind, predicted) = match found {
        Ok(found) => found,
        Err(reason) => return vec![(COMPLETE, ContractVerdict::Broken(reason))],
    };
    let refuses = match questions.refuses_no_number(kind).await {
        Ok(()) => ContractVerdict::Kept,
        Err(reason) => ContractVerdict::Lax(reason),
    };
    vec![
        (COMPLETE, ContractVerdict::Kept),
        (STATELESS, questions.stateless(kind, &predicted).await.into()),
        (REFUSES, refuses),
    ]
}

impl Questions<'_, RobotSide> {
    async fn predict(
        &self,
        kind: MotionCommandKind,
        windows: Vec<v1::PredictionWindow>,
    ) -> Result<v1::RobotSimServicePredictResponse, Status> {
        let mut client = self.client.clone();
        let request = v1::RobotSimServicePredictRequest {
            site_toml: String::new(),
            config_toml: self.toml.to_owned(),
            command_kind: v1::MotionCommandKind::from(kind).into(),
            windows,
        };
        within(async move { Ok(client.predict(request).await?.into_inner()) }).await
    }

    async fn predicted(
        &self,
        kind: MotionCommandKind,
        windows: &[PredictionWindow],
    ) -> Result<Vec<PredictedWindow>, String> {
        let messages = windows.iter().map(Into::into).collect();
        let reply = self.predict(kind, messages).await.map_err(status_text)?;
        convert::predicted_windows(reply, windows, kind).map_err(|invalid| invalid.to_string())
    }

    /// The first kind of command that is executed, and what is predicted of it.
    async fn executed(&self) -> Result<(MotionCommandKind, Vec<PredictedWindow>), String> {
        let mut refused = String::new();
        for kind in KINDS {
            let messages = windows().iter().map(Into::into).collect();
            match self.predict(kind, messages).await {
                Ok(reply) => {
                    let predicted = convert::predicted_windows(reply, &windows(), kind);
                    return Ok((kind, predicted.map_err(|invalid| invalid.to_string())?));
                }
                Err(status) if status.code() == Code::InvalidArgument => {
                    refused = status_text(status);
                }
                Err(status) => return Err(status_text(status)),
            }
        }
        Err(format!("every kind of command is refused, the last one with {refused}"))
    }

    async fn stateless(
        &self,
        kind: MotionCommandKind,
        predicted: &[PredictedWindow],
    ) -> Result<(), String> {
        let before = self.barrier(N_STEPS).await?;
        let mut reversed = windows();
        reversed.reverse();
        let mut again = self.predicted(kind, &reversed).await?;
        again.reverse();
        if again != predicted {
            return Err("in the opposite order the windows have other predictions".to_owned());
        }
        for (index, window) in windows().into_iter().enumerate() {
            let alone = self.predicted(kind, &[window]).await?;
            if alone != predicted[index..=index] {
                return Err(format!(
                    "window {index} alone has another prediction than with others"
                ));
            }
        }
        if self.barrier(N_STEPS).await? == before {
            Ok(())
        } else {
            Err("its experiment stands at another step, time or digest than before".to_owned())
        }
    }

    async fn refuses_no_number(&self, kind: MotionCommandKind) -> Result<(), String> {
        let mut messages: Vec<v1::PredictionWindow> = windows().iter().map(Into::into).collect();
        messages[0].x_m = f64::NAN;
        match self.predict(kind, messages).await {
            Err(status) if status.code() == Code::InvalidArgument => Ok(()),
            Err(status) => {
                Err(format!("refused with {:?} instead of InvalidArgument", status.code()))
            }
            Ok(_) => Err("accepted".to_owned()),
        }
    }
}
