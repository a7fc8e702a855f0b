//! `Predict`: checked, asked of the simulator, and answered.

use super::lifecycle::{malformed, refusal};
use proto::exchange;
use proto::prediction::{MAX_STEPS, MAX_TOTAL_NS, PredictionRequest};
use proto::side::RobotSimulator;
use proto_messages::convert;
use proto_messages::robot_sim;
use tonic::Status;

/// A request whose every field is valid.
pub(super) fn checked(request: robot_sim::PredictRequest) -> Result<PredictionRequest, Status> {
    let n_steps: usize = request.windows.iter().map(|window| window.duration_ns.len()).sum();
    if MAX_STEPS < n_steps {
        return Err(Status::resource_exhausted(format!(
            "windows: must have at most {MAX_STEPS} commands in all, got {n_steps}"
        )));
    }
    let durations = request.windows.iter().flat_map(|window| &window.duration_ns);
    let total_ns = durations.fold(0u64, |sum, &ns| sum.saturating_add(ns));
    if MAX_TOTAL_NS < total_ns {
        return Err(Status::resource_exhausted(format!(
            "windows: must last at most {MAX_TOTAL_NS} ns in all, got {total_ns} ns"
        )));
    }
    let command_kind = convert::motion_command_kind(request.command_kind).map_err(malformed)?;
    let windows = convert::prediction_windows(request.windows).map_err(malformed)?;
    let (site, config) =
        exchange::sections(&request.site_toml, &request.config_toml).map_err(refusal)?;
    Ok(PredictionRequest { site, config, command_kind, windows })
}

/// What the simulator predicts.
pub(super) fn reply<S: RobotSimulator>(
    simulator: &S,
    request: &PredictionRequest,
) -> Result<robot_sim::PredictResponse, Status> {
    let predicted = simulator.predict(request).map_err(refusal)?;
    Ok(convert::predicted_response(&predicted, &request.windows, request.command_kind))
}
