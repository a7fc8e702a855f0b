//! The command that splits the error of a swarm's task.

use super::Failure;
use super::inputs::Watching;
use super::packets::print_answer;
use network::task::comparison::TaskComparison;
use network::{ComparisonOptions, TaskError, TaskFiles, TaskRequest};

/// Prints whether the robots or the network cause the error of the task.
pub(super) fn split(
    files: &TaskFiles<'_>,
    asked: ComparisonOptions,
) -> Result<TaskComparison, Failure> {
    let request = TaskRequest::open(files, asked).map_err(|error| match error {
        TaskError::TooFewSeeds { .. } => Failure::request(format!("--seeds {error}")),
        TaskError::From { .. } => Failure::request(format!("--from {error}")),
        TaskError::Data(error) => Failure::of_data(&error),
        TaskError::File(_) => Failure::request(error),
    })?;
    network::task(&request, &Watching::new(None)).map_err(Failure::request).map(print_answer)
}
