//! Whether results fit on the disk: before the work, and while it lasts.

use experiment::Plan;
use nix::sys::statvfs::statvfs;
use std::fs;
use std::path::Path;

/// The least that a step takes of `run.mcap` and of `steps.parquet` for each agent (bytes): columns of numbers
/// that hardly change, compressed. Robots that move and hear others take ten to a hundred times as much.
const LEAST_PER_AGENT: u64 = 2;

/// Refuses work whose results do not fit by far, before it starts.
///
/// # Errors
///
/// Where the least that the results take exceeds the free space: both, in words.
pub fn fits(least_bytes: u64, out: &Path) -> Result<(), String> {
    match free_bytes(out) {
        Some(free) if free < least_bytes => Err(format!(
            "--out {}: results take at least {}, but {} are free; choose another folder, or leave out files in [output]",
            out.display(),
            bytes(least_bytes),
            bytes(free)
        )),
        _ => Ok(()),
    }
}

/// What to say if a recording that has taken so many bytes for `step` of `n_steps` steps will not fit.
pub(crate) fn outgrows(dir: &Path, step: u64, n_steps: u64) -> Option<String> {
    let so_far = size_of(dir) as f64;
    let to_come = so_far / step.max(1) as f64 * n_steps.saturating_sub(step) as f64;
    let free = free_bytes(dir)?;
    ((free as f64) < to_come).then(|| {
        format!(
            "the recording has taken {} in {step} of {n_steps} steps: at this rate the {} that are free do not suffice; stop \
             it with Ctrl-C to keep what there is, or make room",
            bytes(so_far as u64),
            bytes(free)
        )
    })
}

/// Steps of an experiment after its network has formed.
pub(crate) fn n_steps(plan: &Plan) -> u64 {
    plan.duration_ns.div_ceil(plan.experiment.step_ns)
}

/// The least that a recording takes, whatever happens in it: nothing may be heard, and robots may be done at once.
pub fn least_bytes(plan: &Plan) -> u64 {
    if plan.stop_when_complete { 0 } else { least_bytes_to_the_end(plan) }
}

/// What to say before a run that fits only if the robots are done early.
pub(crate) fn fits_if_ended_early(plan: &Plan, out: &Path) -> Option<String> {
    let least = least_bytes_to_the_end(plan);
    let free = free_bytes(out).filter(|&free| free < least)?;
    Some(format!(
        "--out {}: results take at least {} if the robots are not done before {} s, but {} are free; --dry-run estimates how \
         much they take",
        out.display(),
        bytes(least),
        proto::types::seconds(plan.duration_ns),
        bytes(free)
    ))
}

fn least_bytes_to_the_end(plan: &Plan) -> u64 {
    let rows = n_steps(plan).saturating_mul(plan.experiment.agent_count as u64);
    let output = &plan.output;
    let in_log = if output.mcap { rows } else { 0 };
    let in_table = if output.steps { rows / output.every_steps } else { 0 };
    LEAST_PER_AGENT.saturating_mul(in_log.saturating_add(in_table))
}

/// Bytes of all files below a folder.
pub(crate) fn size_of(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| match entry.metadata() {
            Ok(metadata) if metadata.is_dir() => size_of(&entry.path()),
            Ok(metadata) => metadata.len(),
            Err(_) => 0,
        })
        .sum()
}

/// Free space for this user where `path` is or will be.
pub(crate) fn free_bytes(path: &Path) -> Option<u64> {
    let path = std::path::absolute(path).ok()?;
    let existing = path.ancestors().find(|path| path.exists())?;
    let stat = statvfs(existing).ok()?;
    stat.blocks_available().checked_mul(stat.fragment_size())
}

/// Bytes for people, with three digits.
pub(crate) fn bytes(n: u64) -> String {
    const UNITS: [&str; 4] = ["kB", "MB", "GB", "TB"];
    if n < 1000 {
        return format!("{n} bytes");
    }
    let mut size = n as f64 / 1e3;
    let mut unit = 0;
    while 999.5 <= size && unit + 1 < UNITS.len() {
        size /= 1e3;
        unit += 1;
    }
    let digits = if size < 10.0 { 2 } else { usize::from(size < 100.0) };
    format!("{size:.digits$} {}", UNITS[unit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_space_of_a_folder_that_is_yet_to_come_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let free = free_bytes(&folder.path().join("a/b")).unwrap();
        assert!(0 < free);
        assert!(fits(1, folder.path()).is_ok());
        let error = fits(u64::MAX, folder.path()).unwrap_err();
        assert!(error.contains("results take at least") && error.contains("are free"), "{error}");
        fs::write(folder.path().join("run.mcap"), [0; 5000]).unwrap();
        assert_eq!(outgrows(folder.path(), 10, 20), None);
        let warning = outgrows(folder.path(), 10, 1 << 60).unwrap();
        assert!(warning.starts_with("the recording has taken 5.00 kB in 10 of "), "{warning}");
    }
}
