//! Faults from a seed: an operation on a file fails or the program is killed there, or a simulator lies or is disturbed.
//!
//! A seed determines one fault of one command. An undisturbed command lists its operations (`system::fault`), and the seed draws one
//! of them and what happens there. A process is killed by the system, so that nothing of it runs on; simulators that lie are
//! served by this process. Afterwards a user's next commands must lead to the files of an undisturbed run.

mod peers;
mod scenarios;
mod tree;

use crate::executable;
use crate::fault_campaign::ended;
use anyhow::{Context as _, bail};
use peers::PeerFault;
use proto::rng::philox4x64;
use scenarios::{Command, Repair, SCENARIOS, Scenario, arguments};
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::sync::OnceLock;
use std::time::Duration;
use tempfile::TempDir;
use tree::{copy_tree, names, read_tree, unfinished};

/// Longest time that a command may take.
const LIMIT: Duration = Duration::from_secs(60);

/// One fault of one command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trial {
    /// The scenario, an index.
    scenario: usize,
    /// What happens.
    fault: TrialFault,
    /// Decides between things that a user may do next.
    choice: u64,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum TrialFault {
    /// To a command, by its index: a schedule of `system::fault`.
    System { command: usize, schedule: String },
    /// To a simulator of the only command.
    Peer(PeerFault),
}

impl Trial {
    /// What kind of fault it is, in one or two words.
    #[must_use]
    pub fn kind(&self) -> String {
        match &self.fault {
            TrialFault::Peer(_) => "a simulator".to_owned(),
            TrialFault::System { schedule, .. } => {
                let mut words = schedule.split(' ');
                let (fault, operation) = (words.next(), words.next());
                let fault =
                    fault.unwrap_or_default().trim_end_matches(|c: char| !c.is_alphabetic());
                let is_kill = ["kill", "torn"].contains(&fault);
                let at = if is_kill && operation == Some("point") { " at a point" } else { "" };
                format!("{fault}{at}")
            }
        }
    }
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scenario, fault, choice } = self;
        write!(f, "{} | ", SCENARIOS[*scenario].name)?;
        match fault {
            TrialFault::System { command, schedule } => write!(f, "{command} | {schedule}")?,
            TrialFault::Peer(fault) => write!(f, "peer | {fault}")?,
        }
        write!(f, " | {choice}")
    }
}

/// What became of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The command succeeded, with the files of an undisturbed one.
    SameBytes,
    /// It failed with an error that names the file or the simulator, and led to the same files when it was continued or repeated.
    NamedAndRecovered,
    /// It was killed, and led to the same files when it was continued or repeated.
    KilledAndRecovered,
    /// It panicked. A defect.
    Panicked,
    /// It did not end in time. A defect.
    Hangs,
    /// It failed without naming the file or simulator. A defect.
    Unclear,
    /// It cannot be continued or repeated. A defect.
    NotRecoverable,
    /// An earlier result is lost. A defect.
    Lost,
    /// Files differ. A defect.
    Wrong,
    /// Temporary files stay behind. A defect.
    LeftBehind,
}

impl Verdict {
    /// Whether it may not be.
    #[must_use]
    pub fn is_defect(self) -> bool {
        !matches!(self, Self::SameBytes | Self::NamedAndRecovered | Self::KilledAndRecovered)
    }
}

/// What an undisturbed scenario does and leaves.
struct Reference {
    /// The folder before each command.
    before: Vec<PathBuf>,
    /// Operations of each command that may meet a fault: kind, file, and how many there are.
    operations: Vec<BTreeMap<(String, String), u64>>,
    /// Files at the end; none: its content differs from run to run.
    files: BTreeMap<String, Option<Vec<u8>>>,
    /// Names of everything at the end.
    names: Vec<String>,
}

/// Scenarios, each prepared when it is needed first.
pub struct Simulation {
    folder: TempDir,
    references: [OnceLock<Reference>; SCENARIOS.len()],
}

impl Simulation {
    /// Nothing is prepared yet.
    ///
    /// # Errors
    ///
    /// There is no room for it.
    pub fn new() -> anyhow::Result<Self> {
        Ok(Self { folder: tempfile::tempdir()?, references: Default::default() })
    }

    fn reference(&self, scenario: usize) -> &Reference {
        self.references[scenario].get_or_init(|| {
            let folder = self.folder.path().join(SCENARIOS[scenario].name);
            Reference::of(&SCENARIOS[scenario], &folder)
                .unwrap_or_else(|error| panic!("{}: {error:#}", SCENARIOS[scenario].name))
        })
    }

    /// The trial of a seed.
    #[must_use]
    pub fn draw(&self, seed: u64) -> Trial {
        let [a, b, c, d] = philox4x64([seed, 0, 0, 0], [0, 0]);
        let [e, f, choice, g] = philox4x64([seed, 1, 0, 0], [0, 0]);
        if a % 8 == 0 {
            let scenario = (b % peers::N_SCENARIOS) as usize;
            return Trial { scenario, fault: TrialFault::Peer(PeerFault::draw(c, d)), choice };
        }
        let scenario = (b % SCENARIOS.len() as u64) as usize;
        let reference = self.reference(scenario);
        let pick = |n: usize, draw: u64| (draw % n as u64) as usize;
        let meets: Vec<usize> = (0..reference.operations.len())
            .filter(|&i| !reference.operations[i].is_empty())
            .collect();
        let command = meets[pick(meets.len(), c)];
        // One in six is killed at a point with a name.
        let all = &reference.operations[command];
        let points = all.iter().filter(|((kind, _), _)| kind == "point");
        let entries: Vec<_> = if d % 6 == 0 && 0 < points.clone().count() {
            points.collect()
        } else {
            all.iter().collect()
        };
        let ((kind, file), count) = entries[pick(entries.len(), e)];
        let number = 1 + f % count;
        let faults = faults_of(kind);
        let fault = if g % 16 == 0 && kind != "point" {
            ["clock+86400", "clock-86400"][pick(2, g / 16)]
        } else {
            faults[pick(faults.len(), g / 16)]
        };
        let schedule = format!("{fault} {kind} {number} {file}");
        Trial { scenario, fault: TrialFault::System { command, schedule }, choice }
    }

    /// A trial as its text says, which a report prints.
    ///
    /// # Errors
    ///
    /// The text is none.
    pub fn parse(&self, text: &str) -> anyhow::Result<Trial> {
        let parts: Vec<&str> = text.split(" | ").collect();
        let [name, command, fault, choice] = parts[..] else { bail!("{text}: has not four parts") };
        let scenario = SCENARIOS.iter().position(|scenario| scenario.name == name);
        let fault = match command {
            "peer" => TrialFault::Peer(fault.parse()?),
            number => TrialFault::System { command: number.parse()?, schedule: fault.to_owned() },
        };
        let scenario = scenario.with_context(|| format!("{name} is no scenario"))?;
        Ok(Trial { scenario, fault, choice: choice.parse()? })
    }

    /// Carries out a trial in a folder of its own. Returns what became of it, and what the commands said.
    ///
    /// # Errors
    ///
    /// A command cannot be started.
    pub fn carry_out(&self, trial: &Trial) -> anyhow::Result<(Verdict, String)> {
        let reference = self.reference(trial.scenario);
        let (command, schedule) = match &trial.fault {
            TrialFault::System { command, schedule } => (*command, schedule.as_str()),
            TrialFault::Peer(_) => (0, ""),
        };
        let temporary = tempfile::tempdir()?;
        let folder = temporary.path().join("w");
        copy_tree(&reference.before[command], &folder)?;
        let scenario = &SCENARIOS[trial.scenario];
        let mut case =
            Case { scenario, reference, folder, said: String::new(), choice: trial.choice };
        let verdict = match &trial.fault {
            TrialFault::System { .. } => case.system(command, schedule)?,
            TrialFault::Peer(fault) => case.peer(fault)?,
        };
        Ok((verdict, case.said))
    }
}

/// What may happen to an operation.
fn faults_of(kind: &str) -> &'static [&'static str] {
    match kind {
        "create" => &["ENOSPC", "EIO", "EMFILE", "EACCES", "kill"],
        "write" => &["ENOSPC", "short", "EIO", "kill", "torn"],
        "sync" => &["ENOSPC", "EIO", "kill"],
        "rename" => &["EIO", "EACCES", "EXDEV", "kill"],
        "link" | "remove" => &["EIO", "EACCES", "kill"],
        "make-folder" => &["ENOSPC", "EIO", "EACCES", "kill"],
        "set-length" => &["EIO", "kill"],
        _ => &["kill"],
    }
}

impl Reference {
    fn of(scenario: &Scenario, folder: &Path) -> anyhow::Result<Self> {
        let mut before = Vec::new();
        let mut operations = Vec::new();
        let mut ends = Vec::new();
        for name in ["a", "b"] {
            let place = folder.join(name);
            fs::create_dir_all(&place)?;
            (scenario.prepare)(&place)?;
            for (number, command) in scenario.commands.iter().enumerate() {
                let list = folder.join(format!("operations-{number}"));
                let (schedule, text) = match command {
                    Command::Meets(text) => (format!("list {}", list.display()), *text),
                    Command::Prepares(schedule, text) => ((*schedule).to_owned(), *text),
                };
                if name == "a" {
                    let state = folder.join(format!("before-{number}"));
                    copy_tree(&place, &state)?;
                    before.push(state);
                }
                let output = execute(&place, text, &schedule, &[])?.context("it hangs")?;
                let is_killed = schedule.starts_with("kill");
                if output.status.success() == is_killed {
                    bail!("{text}: {}", crate::said(&output));
                }
                if name == "a" {
                    operations.push(listed(&list));
                }
            }
            ends.push((read_tree(&place)?, names(&place)?));
        }
        let (second, _) = ends.pop().context("two runs")?;
        let (first, names) = ends.pop().context("two runs")?;
        let stable = |(name, content): (String, Vec<u8>)| {
            let is_stable = second.get(&name) == Some(&content);
            (name, is_stable.then_some(content))
        };
        Ok(Self { before, operations, files: first.into_iter().map(stable).collect(), names })
    }
}

/// Operations that a process listed; none of a process that was not asked.
fn listed(list: &Path) -> BTreeMap<(String, String), u64> {
    let mut operations = BTreeMap::new();
    for line in fs::read_to_string(list).unwrap_or_default().lines() {
        let mut words = line.splitn(3, ' ');
        if let (Some(kind), Some(_), Some(file)) = (words.next(), words.next(), words.next()) {
            *operations.entry((kind.to_owned(), file.to_owned())).or_default() += 1;
        }
    }
    operations
}

/// Carries out a command; none: it did not end in time.
fn execute(
    folder: &Path,
    command: &str,
    schedule: &str,
    more: &[String],
) -> anyhow::Result<Option<Output>> {
    let left = unfinished(folder);
    let mut process = std::process::Command::new(executable("murmuration"));
    process.args(arguments(command, left.last().map(PathBuf::as_path))).args(more);
    if !schedule.is_empty() {
        process.env(system::fault::VARIABLE, schedule);
    }
    // Temporary files of the command are looked for, too.
    process.env("TMPDIR", folder).current_dir(folder);
    process.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    ended(process.spawn().context("starting the program")?, LIMIT)
}

/// A trial under way.
struct Case<'a> {
    scenario: &'a Scenario,
    reference: &'a Reference,
    folder: PathBuf,
    said: String,
    choice: u64,
}

impl Case<'_> {
    /// Carries out a command and keeps what it says; none: it did not end in time.
    fn execute(
        &mut self,
        command: &str,
        schedule: &str,
        more: &[String],
    ) -> anyhow::Result<Option<Output>> {
        let output = execute(&self.folder, command, schedule, more)?;
        let said = output.as_ref().map_or_else(|| "it hangs".to_owned(), crate::said);
        self.said.push_str(&format!("$ {command} {schedule}\n{said}\n"));
        Ok(output)
    }

    fn system(&mut self, number: usize, schedule: &str) -> anyhow::Result<Verdict> {
        let command = self.scenario.commands[number].text();
        let Some(output) = self.execute(command, schedule, &[])? else { return Ok(Verdict::Hangs) };
        let said = crate::said(&output);
        let is_killed = output.status.signal() == Some(9);
        if said.contains("panicked") {
            return Ok(Verdict::Panicked);
        }
        if !output.status.success() && !is_killed && !names_the_file(&said, schedule) {
            return Ok(Verdict::Unclear);
        }
        if self.scenario.name == "replace" && !self.has_earlier_result() {
            return Ok(Verdict::Lost);
        }
        if !output.status.success()
            && let Some(defect) = self.repair(command)?
        {
            return Ok(defect);
        }
        for later in &self.scenario.commands[number + 1..] {
            let Some(output) = self.execute(later.text(), "", &[])? else {
                return Ok(Verdict::Hangs);
            };
            if !output.status.success() {
                return Ok(Verdict::NotRecoverable);
            }
        }
        if let Some(defect) = self.compare(command)? {
            return Ok(defect);
        }
        Ok(match (output.status.success(), is_killed) {
            (true, _) => Verdict::SameBytes,
            (false, false) => Verdict::NamedAndRecovered,
            (false, true) => Verdict::KilledAndRecovered,
        })
    }

    /// Does what a user may do after a command that failed; returns the defect that this shows.
    fn repair(&mut self, command: &str) -> anyhow::Result<Option<Verdict>> {
        if self.scenario.repair == Repair::Again {
            let Some(output) = self.execute(command, "", &[])? else {
                return Ok(Some(Verdict::Hangs));
            };
            // The result of a command that was killed once it had its name.
            let is_there = crate::said(&output).contains(" exists: ");
            return Ok((!output.status.success() && !is_there).then_some(Verdict::NotRecoverable));
        }
        let left = unfinished(&self.folder);
        if self.choice.is_multiple_of(3)
            && left.last().is_some_and(|left| left.join("checkpoint").exists())
        {
            let defect = self.must("run --resume LEFT", &[])?;
            // A resumed run writes its own results only; the file of --save-formed takes a run from the start.
            if defect.is_some() || self.scenario.name != "save-formed" {
                return Ok(defect);
            }
            return self.must(self.scenario.again, &[]);
        }
        if self.choice % 3 == 1 && !left.is_empty() {
            let Some(output) = self.execute("recover LEFT", "", &[])? else {
                return Ok(Some(Verdict::Hangs));
            };
            // A folder in which nothing was recorded yet is refused, and removed by the next run.
            if !output.status.success() && output.status.code() != Some(2) {
                return Ok(Some(Verdict::NotRecoverable));
            }
            if output.status.success() && self.compare_files(|_| true)?.is_none() {
                return Ok(None);
            }
        }
        self.must(self.scenario.again, &[])
    }

    /// Carries out a command that must succeed.
    fn must(&mut self, command: &str, more: &[String]) -> anyhow::Result<Option<Verdict>> {
        let Some(output) = self.execute(command, "", more)? else {
            return Ok(Some(Verdict::Hangs));
        };
        Ok((!output.status.success()).then_some(Verdict::NotRecoverable))
    }

    /// Whether a complete earlier result, and what a user has put into its folder, is still there, under whatever name.
    fn has_earlier_result(&self) -> bool {
        let runs = fs::read_dir(self.folder.join("runs")).into_iter().flatten().flatten();
        let results: Vec<PathBuf> = runs
            .map(|entry| entry.path())
            .filter(|path| !path.display().to_string().contains(".partial-"))
            .collect();
        let is_complete = |path: &PathBuf| {
            let text = fs::read_to_string(path.join("summary.json")).unwrap_or_default();
            text.contains("\"status\": \"complete\"")
        };
        results.iter().any(is_complete)
            && results.iter().any(|path| path.join("notes.json").exists())
    }

    /// The same command removes later what could not be removed; a folder of an unfinished run is the user's to keep.
    fn clean_up(&mut self, command: &str) -> anyhow::Result<Option<Verdict>> {
        let left = unfinished(&self.folder);
        for left in left {
            let output = self.execute("recover LEFT", "", &[])?;
            let code = output.and_then(|output| output.status.code());
            if !matches!(code, Some(0 | 2)) {
                return Ok(Some(Verdict::NotRecoverable));
            }
            if left.exists() {
                fs::remove_dir_all(left)?;
            }
        }
        // What was recovered beside the result, since that is complete.
        for name in names(&self.folder)? {
            let path = self.folder.join(&name);
            if name.starts_with("runs/") && name.ends_with("-2") && path.is_dir() {
                fs::remove_dir_all(path)?;
            }
        }
        let exported = self.folder.join("exported");
        if exported.exists() {
            fs::remove_dir_all(exported)?;
        }
        // The user comes back later.
        for name in names(&self.folder)?.iter().filter(|name| name.contains(".lock-")) {
            let file = fs::File::options().write(true).open(self.folder.join(name))?;
            file.set_modified(file.metadata()?.modified()? - Duration::from_secs(3600))?;
        }
        if self.scenario.repair == Repair::Again
            && command != self.scenario.again
            && let Some(defect) = self.must(command, &[])?
        {
            return Ok(Some(defect));
        }
        self.must(self.scenario.again, &[])
    }

    /// What is wrong with files and names at the end.
    fn compare(&mut self, command: &str) -> anyhow::Result<Option<Verdict>> {
        // What is missing may still stand aside, for the next command to put it back.
        let folder = self.folder.clone();
        if let Some(defect) = self.compare_files(|name| folder.join(name).exists())? {
            return Ok(Some(defect));
        }
        if names(&self.folder)? != self.reference.names
            && let Some(defect) = self.clean_up(command)?
        {
            return Ok(Some(defect));
        }
        let now = names(&self.folder)?;
        let before = &self.reference.names;
        let more: Vec<&String> = now.iter().filter(|name| !before.contains(name)).collect();
        let less: Vec<&String> = before.iter().filter(|name| !now.contains(name)).collect();
        if more.is_empty() && less.is_empty() {
            return self.compare_files(|_| true);
        }
        self.said.push_str(&format!("left behind: {more:?}; missing: {less:?}\n"));
        Ok(Some(if less.is_empty() { Verdict::LeftBehind } else { Verdict::Wrong }))
    }

    /// Whether the files that `counts` accepts are those of an undisturbed run.
    fn compare_files(&mut self, counts: impl Fn(&str) -> bool) -> anyhow::Result<Option<Verdict>> {
        let now = read_tree(&self.folder)?;
        let expected = self.reference.files.iter().filter(|(name, _)| counts(name));
        let differs =
            |(name, content): &(&String, &Option<Vec<u8>>)| match (now.get(*name), content) {
                (None, _) => true,
                (Some(now), Some(content)) => now != content,
                (Some(_), None) => false,
            };
        let different: Vec<&String> = expected.filter(differs).map(|(name, _)| name).collect();
        if different.is_empty() {
            return Ok(None);
        }
        self.said.push_str(&format!("other content: {different:?}\n"));
        Ok(Some(Verdict::Wrong))
    }

    /// The only command meets simulators that lie or are disturbed.
    fn peer(&mut self, fault: &PeerFault) -> anyhow::Result<Verdict> {
        let command = self.scenario.again;
        let peer = fault.start()?;
        let Some(output) = self.execute(command, "", &peer.arguments)? else {
            return Ok(Verdict::Hangs);
        };
        let said = crate::said(&output);
        if said.contains("panicked") {
            return Ok(Verdict::Panicked);
        }
        let is_recorded = |name: &str| name.starts_with("runs/") && !name.ends_with("config.toml");
        if output.status.success() {
            return Ok(self.compare_files(is_recorded)?.unwrap_or(Verdict::SameBytes));
        }
        let names_it = ["robotsim: ", "netsim: "].iter().any(|name| said.contains(name));
        if !names_it || !matches!(output.status.code(), Some(1 | 2)) {
            return Ok(Verdict::Unclear);
        }
        drop(peer);
        // What is recorded of the run that failed is no complete result: it does not keep its place.
        let replace = ["--replace".to_owned()];
        if let Some(defect) = self.must(command, &replace)? {
            return Ok(defect);
        }
        Ok(self.compare_files(is_recorded)?.unwrap_or(Verdict::NamedAndRecovered))
    }
}

/// Whether an error names the file that the failed operation was to make, or the folder that it is in.
fn names_the_file(said: &str, schedule: &str) -> bool {
    let file = schedule.splitn(4, ' ').nth(3).unwrap_or_default();
    // The name under which a file is drafted is no name that a user knows.
    let names = |part: &str| {
        let known = part.split(".draft-").next().unwrap_or_default().trim_start_matches('.');
        !known.is_empty() && known.split('#').all(|text| said.contains(text))
    };
    said.contains("error: ") && file.split('/').any(names)
}
