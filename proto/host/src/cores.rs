//! How many cores this process may use.
//!
//! A batch system gives a task some cores of a machine, and may not keep its processes to them. The system then reports all cores
//! of the machine, and a program that starts as many threads takes those of other tasks.

use std::num::NonZeroUsize;

/// Variables by which Slurm tells a task how many cores it has, the most specific first: cores of each task, which is absent unless
/// the job asked for a number, and cores of the job on this machine. <https://slurm.schedmd.com/sbatch.html>, "Output environment
/// variables".
const OF_SLURM: [&str; 2] = ["SLURM_CPUS_PER_TASK", "SLURM_CPUS_ON_NODE"];

/// Number of cores that this process may use, at least 1: those that the system reports, but no more than Slurm gave to the task
/// that it runs in. The default of every option that is a number of threads, or of trials at the same time.
#[must_use]
pub fn cores() -> usize {
    let variable = |name: &str| std::env::var(name).ok();
    limited(reported(), variable)
}

/// Sets the number of worker threads of this process: `threads`, or else [`cores`]. Has no effect once threads have started.
pub fn use_threads(threads: Option<u16>) {
    let builder = rayon::ThreadPoolBuilder::new();
    let builder = match threads {
        Some(threads) => builder.num_threads(threads.into()),
        // Without a limit, the library's own default holds, which the user may have set.
        None if cores() == reported() => return,
        None => builder.num_threads(cores()),
    };
    // Fails only if a pool exists already, which then serves.
    let _ = builder.build_global();
}

/// Number of cores that the system reports.
fn reported() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// `reported` cores, or fewer where a task of Slurm has fewer. A value that is no positive number is ignored.
fn limited(reported: usize, variable: impl Fn(&str) -> Option<String>) -> usize {
    if variable("SLURM_JOB_ID").is_none() {
        return reported;
    }
    let of_task =
        OF_SLURM.iter().find_map(|name| variable(name)?.trim().parse::<NonZeroUsize>().ok());
    of_task.map_or(reported, |cores| reported.min(cores.get()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_task_of_slurm_has_the_cores_that_it_was_given() {
        for (variables, cores) in [
            (&[][..], 8),
            (
                &[("SLURM_JOB_ID", "7"), ("SLURM_CPUS_PER_TASK", "3"), ("SLURM_CPUS_ON_NODE", "6")],
                3,
            ),
            (&[("SLURM_JOB_ID", "7"), ("SLURM_CPUS_ON_NODE", "1")], 1),
            // More than there are.
            (&[("SLURM_JOB_ID", "7"), ("SLURM_CPUS_PER_TASK", "64")], 8),
            (
                &[
                    ("SLURM_JOB_ID", "7"),
                    ("SLURM_CPUS_PER_TASK", "0"),
                    ("SLURM_CPUS_ON_NODE", "many"),
                ],
                8,
            ),
            // Defaults that a user exports for later jobs are no limit outside of a job.
            (&[("SLURM_CPUS_PER_TASK", "1")], 8),
        ] {
            let variable = |name: &str| {
                let found = variables.iter().find(|(known, _)| *known == name);
                found.map(|(_, value)| (*value).to_owned())
            };
            assert_eq!(limited(8, variable), cores, "{variables:?}");
        }
    }
}
