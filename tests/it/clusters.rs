//! `murmuration sweep --engine`: shards that a batch system runs. Stand-ins for its commands show what is issued and how their answers
//! are taken; tests/external/test_slurm.py runs a real Slurm.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

const SWEEP: &str = "[experiment]\nname = \"s\"\nseed = 3\nduration_s = 1.0\nagents = 4\n\
    [robotsim.scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.1\n\
    [robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n\
    [netsim.phy]\npropagation = \"full\"\n[sweep]\nseeds = 6\n";

/// What a sweep leaves, whoever ran which trial when.
const RESULTS: [&str; 4] = ["sweep.toml", "trials.parquet", "summary.json", "report.html"];

/// A folder with a sweep, whose name a shell would take apart, and a folder of commands for PATH.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new(sections: &str) -> Self {
        let place = Self { folder: tests::folder() };
        fs::create_dir_all(place.path()).unwrap();
        fs::create_dir(place.folder.path().join("bin")).unwrap();
        fs::write(place.path().join("s.toml"), format!("{SWEEP}{sections}")).unwrap();
        place
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("it's $HOME")
    }

    /// A command that does what `script` says, in the folder of the sweep.
    fn command(&self, name: &str, script: &str) {
        let path = self.folder.path().join("bin").join(name);
        fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn sweep(&self, args: &str, variables: &[(&str, &str)]) -> Output {
        let bin = self.folder.path().join("bin");
        let path = format!("{}:/usr/bin:/bin", bin.display());
        let mut command = Command::new(tests::executable("murmuration"));
        command.args(["sweep", "s.toml"]).args(args.split_whitespace()).current_dir(self.path());
        command.env("PATH", path).envs(variables.iter().copied()).output().unwrap()
    }

    fn succeeds(&self, args: &str) -> Output {
        let output = self.sweep(args, &[]);
        assert!(output.status.success(), "{args}: {}", tests::said(&output));
        output
    }

    fn fails(&self, args: &str, status: i32) -> String {
        let output = self.sweep(args, &[]);
        assert_eq!(output.status.code(), Some(status), "{args}: {}", tests::said(&output));
        tests::said(&output)
    }

    fn results(&self, out: &str) -> Vec<Vec<u8>> {
        let dir = self.path().join(out).join("s");
        RESULTS.iter().map(|name| fs::read(dir.join(name)).unwrap()).collect()
    }
}

/// Runs the tasks of a script as a batch system would, elsewhere and with these variables.
fn run_tasks(script: &Path, job: (&str, &str), task: &str, shards: &[&str]) {
    for shard in shards {
        let mut command = Command::new("bash");
        command.arg(script).current_dir("/").env(job.0, job.1).env(task, shard);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", tests::said(&output));
    }
}

#[test]
fn shards_are_submitted_to_hyperqueue_and_its_script_runs_them() {
    let place = Place::new("[sweep.hyperqueue]\ncpus_per_task = 2\ntime_limit_min = 30\n");
    place.command("hq", "printf '%s\\n' \"$@\" > hq-arguments; echo 7");
    let said = tests::said(&place.succeeds("--engine hyperqueue --shards 2"));
    assert!(said.contains("HyperQueue job 7: 2 of 2 shards submitted"), "{said}");
    assert!(said.contains("run hq job wait 7") && said.contains("run hq job cancel 7"), "{said}");
    assert!(said.contains("run murmuration sweep s.toml --merge"), "{said}");
    let arguments = fs::read_to_string(place.path().join("hq-arguments")).unwrap();
    let script = place.path().join("runs/s/cluster/hyperqueue.sh");
    assert_eq!(arguments, format!("--output-mode=quiet\nsubmit\n{}\n", script.display()));
    let text = fs::read_to_string(&script).unwrap();
    let directives = "#!/bin/bash\n#HQ --name=murmuration-s\n#HQ --array=1-2\n#HQ --cpus=2\n#HQ --time-limit=30m\n\
                      #HQ --stdout=none\n#HQ --stderr=none\n";
    assert!(text.starts_with(directives) && text.contains(" --jobs 2 "), "{text}");
    run_tasks(&script, ("HQ_JOB_ID", "7"), "HQ_TASK_ID", &["1", "2"]);
    let log = fs::read_to_string(place.path().join("runs/s/cluster/hyperqueue-7-2.log")).unwrap();
    assert!(log.contains("shard 2/2 has 3 of 6 trials"), "{log}");
    let said = tests::said(&place.succeeds("--engine hyperqueue"));
    assert!(
        said.contains("all shards are finished; run murmuration sweep s.toml --merge"),
        "{said}"
    );
    place.succeeds("--merge");
    place.succeeds("--out whole");
    assert_eq!(place.results("runs"), place.results("whole"));
}

#[test]
fn an_emitted_script_has_what_the_file_asks_for_and_leaves_nothing() {
    let place = Place::new(
        "[sweep.slurm]\npartition = \"a,b\"\naccount = \"x \\\"y\\\"\"\nqos = \"q\"\ntime_limit_min = 90\nmemory_mib = 2000\n\
         cpus_per_task = 4\nmax_running = 20\noptions = [\"--exclusive\", \"--constraint=a&b\"]\n\
         modules = [\"gcc/12\", \"it's\"]\ncommands = [\"export A=$B\"]\n",
    );
    let output = place.succeeds("--engine slurm --shards 3 --emit script --jobs 2 --seed 5");
    let script = String::from_utf8(output.stdout).unwrap();
    assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1, "something was left");
    let (directives, body) = script.split_once("\n\n").unwrap();
    assert_eq!(
        directives,
        "#!/bin/bash\n#SBATCH --job-name=murmuration-s\n#SBATCH --array=1-3%20\n#SBATCH --nodes=1\n#SBATCH --ntasks=1\n\
         #SBATCH --no-requeue\n#SBATCH --output=/dev/null\n#SBATCH --cpus-per-task=4\n#SBATCH --partition=\"a,b\"\n\
         #SBATCH --account=\"x \\\"y\\\"\"\n#SBATCH --qos=\"q\"\n#SBATCH --time=90\n#SBATCH --mem=2000M\n\
         #SBATCH --exclusive\n#SBATCH --constraint=\"a&b\""
    );
    assert!(
        body.contains("module load gcc/12 || exit\nmodule load 'it'\\''s' || exit\nexport A=$B\n"),
        "{body}"
    );
    let command = " sweep s.toml --seed 5 --threads 1 --jobs 2 --wait-for-lock 300 --shard \"$SLURM_ARRAY_TASK_ID/3\"\n";
    assert!(body.ends_with(command), "{body}");
    place.succeeds("--engine slurm --shards 3 --emit script --jobs 2 --seed 5 --emit-to job.sh");
    // A file is no part of the command that tasks run.
    assert_eq!(fs::read_to_string(place.path().join("job.sh")).unwrap(), script);
}

#[test]
fn a_shard_that_is_lost_too_often_is_named_with_the_reason() {
    let place = Place::new("[sweep.slurm]\nmax_resubmissions = 2\n");
    place.command("sbatch", "echo x >> n; wc -l < n");
    // Shard 1 runs; shard 2 exceeds its time in every job.
    place.command(
        "squeue",
        "echo '1|1|RUNNING|None|n1'; for job in 1 2 3; do echo \"$job|2|TIMEOUT|TimeLimit|n2\"; done",
    );
    let said = place.fails("--engine slurm --shards 2", 1);
    assert!(said.contains("Slurm job 1: 2 of 2 shards submitted"), "{said}");
    for (job, n) in [(2, 1), (3, 2)] {
        let again = format!(
            "shard 2/2 was lost: TIMEOUT (TimeLimit) on n2; submitted again as Slurm job {job}, {n} of at most 2 times"
        );
        assert!(said.contains(&again), "{said}");
    }
    let lost = "Slurm: shard 2/2 was lost 3 times after 0 of 6 trials, the last time because: TIMEOUT (TimeLimit) on n2.";
    assert!(said.contains(lost), "{said}");
    let script = fs::read_to_string(place.path().join("runs/s/cluster/slurm.sh")).unwrap();
    assert!(script.contains("#SBATCH --array=2\n"), "{script}");
    // The same command follows the jobs that are there; another number of shards is refused.
    let said = place.fails("--engine slurm --shards 3", 2);
    assert!(said.contains("holds this sweep in 2 shards; use --shards 2"), "{said}");
}

#[test]
fn tasks_that_slurm_no_longer_knows_are_looked_up_in_its_accounting() {
    let place = Place::new("[sweep.slurm]\nmax_resubmissions = 0\n");
    place.command("sbatch", "echo '5;cluster'");
    place.command("squeue", "echo 'slurm_load_jobs error: Invalid job id specified' >&2; exit 1");
    place.command("sacct", "echo '5_1|OUT_OF_MEMORY|0:125|n1'");
    let said = place.fails("--engine slurm --shards 1", 1);
    assert!(
        said.contains("shard 1/1 was lost once") && said.contains("OUT_OF_MEMORY on n1"),
        "{said}"
    );
}

#[test]
fn nothing_is_submitted_where_it_cannot_be() {
    let place = Place::new("");
    // Slurm may be installed on this machine.
    let nowhere = place.path();
    let output = place.sweep("--engine slurm", &[("PATH", nowhere.to_str().unwrap())]);
    assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
    let said = tests::said(&output);
    assert!(said.contains("Slurm: nothing was submitted: sbatch was not found on PATH"), "{said}");
    place.command("sbatch", "echo 'sbatch: error: invalid partition specified: x' >&2; exit 1");
    let said = place.fails("--engine slurm", 1);
    assert!(
        said.contains("nothing was submitted: sbatch: sbatch: error: invalid partition"),
        "{said}"
    );
    place.command("sbatch", "echo submitted");
    let said = place.fails("--engine slurm", 1);
    assert!(said.contains("sbatch printed something unexpected: \"submitted\\n\""), "{said}");
    for (args, problem) in [
        (
            "--engine slurm --shards 7",
            "--shards 7: the sweep has only 6 trials; use at most 6 shards",
        ),
        ("--engine slurm --shard 1/2", "cannot be used with"),
        ("--engine slurm --netsim http://127.0.0.1:1", "runs one trial at a time; use --shards 1"),
        ("--engine slrum", "a similar value exists: 'slurm'"),
        ("--shards 2", "--engine <NAME>"),
    ] {
        let said = place.fails(args, 2);
        assert!(said.contains(problem), "{args}: {said}");
    }
}

#[test]
fn a_file_puts_nothing_into_a_script_that_is_submitted_unless_it_is_allowed_to() {
    let sections = "[sweep.slurm]\ncommands = [\"touch executed\"]\noptions = [\"--prolog=/tmp/x\"]\nmodules = [\"m\"]\n\
        [sweep.hyperqueue]\ncommands = [\"touch executed\"]\n";
    let place = Place::new(sections);
    place.command("sbatch", "touch executed; echo 7");
    place.command("hq", "touch executed; echo 7");
    for engine in ["slurm", "hyperqueue"] {
        let said = place.fails(&format!("--engine {engine}"), 2);
        for problem in [
            "sweep.slurm.commands[0]: would put this into the script of a batch system: 'touch executed'",
            "sweep.slurm.options[0]",
            "sweep.slurm.modules[0]",
            "sweep.hyperqueue.commands[0]",
            "--allow-command",
        ] {
            assert!(said.contains(problem), "{problem}: {said}");
        }
    }
    let entries = fs::read_dir(place.path()).unwrap().count();
    assert_eq!(entries, 1, "something was written, or executed");
    // On this machine the lines mean nothing, and a script that is printed does nothing.
    place.succeeds("--engine slurm --shards 3 --emit script");
    place.succeeds("--dry-run");
    let checked = tests::orchestrator(&["check", "s.toml"], &place.path());
    assert!(checked.status.success(), "{}", tests::said(&checked));
    assert!(
        tests::said(&checked).contains("sweep.slurm.options[0] would put this"),
        "{}",
        tests::said(&checked)
    );
    place.succeeds("--engine hyperqueue --allow-command");
    assert!(place.path().join("executed").exists(), "it was not submitted");
    // What tasks run is allowed, too: their sweep is the same.
    let script = fs::read_to_string(place.path().join("runs/s/cluster/hyperqueue.sh")).unwrap();
    assert!(script.contains(" sweep s.toml --allow-command "), "{script}");
}

#[test]
fn a_file_whose_name_looks_like_an_option_is_one_in_the_script_too() {
    let place = Place::new("");
    fs::rename(place.path().join("s.toml"), place.path().join("-x y.toml")).unwrap();
    let args = ["sweep", "--engine", "slurm", "--emit", "script", "--", "-x y.toml"];
    let output = tests::orchestrator(&args, &place.path());
    assert!(output.status.success(), "{}", tests::said(&output));
    let script = tests::said(&output);
    assert!(script.contains(" sweep './-x y.toml' --threads 1 "), "{script}");
}

#[test]
fn what_a_cluster_cannot_be_asked_for_is_refused_with_its_place() {
    let place = Place::new(
        "[sweep.slurm]\npartitoin = \"a\"\ncpus_per_task = 0\naccount = \"a\\nb\"\noptions = [\"-p x\", \"--array=1-3\"]\n\
         commands = [\"a\\nb\"]\n[sweep.hyperqueue]\npartition = \"a\"\n",
    );
    let said = place.fails("--engine slurm --emit script", 2);
    for problem in [
        "sweep.slurm.partitoin",
        "sweep.slurm.cpus_per_task: must be a whole number from 1 to 65536",
        "sweep.slurm.account: must be one line without control characters",
        "sweep.slurm.options[0]: must be an option of sbatch",
        "sweep.slurm.options[1]: is set by murmuration sweep; use the option --shards",
        "sweep.slurm.commands[0]: must be one line without control characters",
        "sweep.hyperqueue.partition",
    ] {
        assert!(said.contains(problem), "{problem}: {said}");
    }
    assert!(said.contains("partition)"), "the nearest key is named: {said}");
}

#[test]
fn a_task_of_slurm_runs_as_many_trials_at_the_same_time_as_it_has_cores() {
    let place = Place::new("");
    let variables = [("SLURM_JOB_ID", "1"), ("SLURM_CPUS_PER_TASK", "1")];
    let output = place.sweep("--shard 1/2", &variables);
    assert!(output.status.success(), "{}", tests::said(&output));
    let log = fs::read_to_string(place.path().join("runs/s/run.log")).unwrap();
    assert!(log.contains("shard 1/2 of a sweep of 6 trials, 1 at a time"), "{log}");
}
