//! Recorded motion, predicted by a robot simulator.

use super::{Peer as _, Remote, RobotSide, Side as _, SideError, garbage, unacceptable};
use proto::prediction::{MotionCommandKind, PredictedWindow, PredictionWindow, groups};
use proto_messages::{convert, v1};
use tonic::Code;
use tonic_types::StatusExt as _;

/// Most motion (ns) that is asked for in one call: 200 s, so that a simulator that is four times as fast as its robots replies
/// within the default deadline of a call.
const ASKED_NS: u64 = 200_000_000_000;

/// Windows that are asked for together: within the contract's limits, and at most [`ASKED_NS`] unless one window is longer.
fn requests(windows: &[PredictionWindow]) -> Vec<&[PredictionWindow]> {
    let mut requests = Vec::new();
    for group in groups(windows) {
        let (mut first, mut total_ns) = (0, 0);
        for (index, window) in group.iter().enumerate() {
            total_ns += window.duration_ns();
            if first < index && ASKED_NS < total_ns {
                requests.push(&group[first..index]);
                (first, total_ns) = (index, window.duration_ns());
            }
        }
        requests.push(&group[first..]);
    }
    requests
}

/// Under which configuration motion is predicted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PredictionConfig {
    /// The section `[site]` as TOML text, its keys at top level.
    pub site_toml: String,
    /// The section `[robotsim]` as TOML text, its keys at top level.
    pub config_toml: String,
}

impl Remote<RobotSide> {
    /// Asks where robots get to, in as many calls as the contract's limits and the deadline of a call require.
    ///
    /// * `report`: receives how many windows are predicted, of how many, after each call.
    ///
    /// # Errors
    ///
    /// [`SideError::Cannot`] if it does not announce predictions, [`SideError::Unacceptable`] if it refuses the configuration;
    /// others if it fails, hangs, refuses, or replies for other windows or with what is no number.
    pub async fn predict(
        &mut self,
        config: &PredictionConfig,
        command_kind: MotionCommandKind,
        windows: &[PredictionWindow],
        mut report: impl FnMut(usize, usize),
    ) -> Result<Vec<PredictedWindow>, SideError> {
        if !self.described().predictions {
            return Err(SideError::Cannot {
                side: RobotSide::SIDE,
                what: format!(
                    "{} at {} does not announce predictions, so it cannot be compared with measurements; serve Predict of \
                     robotsim.proto and set predictions = true in the reply to Describe",
                    self.described().name,
                    self.url()
                ),
            });
        }
        let mut predicted = Vec::with_capacity(windows.len());
        for group in requests(windows) {
            let first = predicted.len();
            let doing = format!("Predict of windows {first} to {}", first + group.len() - 1);
            let request = v1::RobotSimServicePredictRequest {
                site_toml: config.site_toml.clone(),
                config_toml: config.config_toml.clone(),
                command_kind: v1::MotionCommandKind::from(command_kind).into(),
                windows: group.iter().map(Into::into).collect(),
            };
            let mut client = self.client.clone();
            let call = async move { Ok(client.predict(request).await?.into_inner()) };
            let reply = self.wait(doing.clone(), call).await.map_err(refused)?;
            let states = convert::predicted_windows(reply, group, command_kind)
                .map_err(|invalid| garbage::<RobotSide>(doing, &invalid))?;
            predicted.extend(states);
            report(predicted.len(), windows.len());
        }
        Ok(predicted)
    }
}

/// A refusal that names keys is one of the configuration; any other is one of the request.
fn refused(error: SideError) -> SideError {
    let names_keys = |status: &tonic::Status| {
        let bad = status.get_details_bad_request();
        status.code() == Code::InvalidArgument
            && bad.is_some_and(|it| !it.field_violations.is_empty())
    };
    match &error {
        SideError::Refused { status, .. } if names_keys(status) => unacceptable::<RobotSide>(error),
        _ => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::prediction::PredictionStep;

    #[test]
    fn calls_ask_for_all_windows_in_order_and_for_not_too_much_motion() {
        let window = |agent: u32, duration_ns| PredictionWindow {
            agent,
            start_ns: 0,
            position_m: [0.0; 3],
            heading_rad: 0.0,
            velocity_mps: None,
            steps: vec![PredictionStep { duration_ns, command: [0.0; 3] }],
        };
        let half = ASKED_NS / 2;
        let windows =
            [window(0, half), window(1, half), window(2, 1), window(3, 2 * ASKED_NS), window(4, 1)];
        let sizes: Vec<usize> = requests(&windows).iter().map(|request| request.len()).collect();
        assert_eq!(sizes, [2, 1, 1, 1]);
        let asked: Vec<PredictionWindow> = requests(&windows).concat();
        assert_eq!(asked, windows);
        assert!(requests(&[]).is_empty());
    }
}
