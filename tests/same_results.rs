//! Whether two executables of the orchestrator do the same: experiments and answers run by both, and what they leave compared.

mod campaigns;
mod cases;
mod differences;
mod packets;
mod recorded;
mod text;

use anyhow::{Context as _, bail};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

pub use cases::cases;
pub use differences::{Difference, Kind, folders};

/// Inputs, and the commands that are run on them one after the other in a folder of their own.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name, as `--only` searches it.
    pub name: String,
    /// What the commands read.
    pub input: Input,
    /// Command lines without the program's name; quotes as in a shell, single ones only.
    pub commands: Vec<String>,
}

/// Files: name and content of each.
pub type Files = Vec<(&'static str, String)>;

/// Makes the inputs of a case, the same ones each time.
pub type Maker = fn() -> Files;

/// What the commands of a case read.
#[derive(Clone, Copy, Debug)]
pub enum Input {
    /// `configs/` of the repository.
    Configs,
    /// Files, made when they are needed.
    Files(Maker),
    /// A campaign with something hidden: `config.toml` and `data.csv`.
    Campaign(campaigns::Campaign),
}

impl Input {
    /// Writes the files into a folder.
    fn write(&self, folder: &Path) -> anyhow::Result<()> {
        match self {
            Self::Configs => {
                copy_tree(&crate::repository().join("configs"), &folder.join("configs"))
            }
            Self::Files(files) => {
                for (name, content) in files() {
                    std::fs::write(folder.join(name), content)?;
                }
                Ok(())
            }
            Self::Campaign(campaign) => {
                let campaign = campaign.draw();
                std::fs::write(folder.join("config.toml"), &campaign.config_toml)?;
                Ok(std::fs::write(folder.join("data.csv"), &campaign.csv)?)
            }
        }
    }
}

/// Where results of a case come from.
#[derive(Clone, Debug)]
pub enum Side {
    /// A program is run.
    Program {
        /// The executable.
        path: PathBuf,
        /// Where: it gets a folder for each case.
        results: PathBuf,
        /// Cases that are there already are not run again.
        keeps: bool,
    },
    /// An earlier call kept them in this folder.
    Kept(PathBuf),
}

impl Side {
    /// The folder with the results of a case, which is run if they are not there.
    ///
    /// * `inputs`: the case's folder of the other side, whose inputs are taken rather than made once more.
    /// * `limit`: for each command.
    ///
    /// # Errors
    ///
    /// A command failed or took too long, or the folder was kept by another list of cases.
    pub fn results(
        &self,
        case: &Case,
        inputs: Option<&Path>,
        limit: Duration,
    ) -> anyhow::Result<PathBuf> {
        let (program, root, keeps) = match self {
            Self::Program { path, results, keeps } => (Some(path), results, *keeps),
            Self::Kept(results) => (None, results, true),
        };
        let folder = root.join(case.name.replace([' ', ':', '/'], "-"));
        if keeps && folder.join(MANIFEST).exists() {
            if manifest(&folder)?["commands"] != json!(case.commands) {
                bail!("{} was left by other commands: remove it", folder.display());
            }
            return Ok(folder);
        }
        let Some(program) = program else {
            bail!("{} does not hold it: run the old executable with --keep", root.display());
        };
        if folder.exists() {
            // Left by another call, or by one that was interrupted.
            std::fs::remove_dir_all(&folder)?;
        }
        std::fs::create_dir_all(&folder)?;
        match inputs {
            Some(other) => {
                for name in inputs_of(other)? {
                    let to = folder.join(&name);
                    std::fs::create_dir_all(to.parent().unwrap_or(&folder))?;
                    std::fs::copy(other.join(&name), to).with_context(|| name.clone())?;
                }
            }
            None => case.input.write(&folder)?,
        }
        let inputs: Vec<String> = differences::files(&folder)?.into_iter().collect();
        for (number, command) in (1..).zip(&case.commands) {
            run(program, &folder, number, command, limit)?;
        }
        let home = folder.canonicalize()?;
        let manifest = json!({ "commands": case.commands, "inputs": inputs, "home": home });
        std::fs::write(folder.join(MANIFEST), format!("{manifest:#}\n"))?;
        Ok(folder)
    }
}

/// Names of the inputs in a case's folder.
///
/// # Errors
///
/// It is not one.
pub fn inputs_of(folder: &Path) -> anyhow::Result<BTreeSet<String>> {
    let manifest = manifest(folder)?;
    let names = manifest["inputs"].as_array().into_iter().flatten().filter_map(Value::as_str);
    Ok(names.map(str::to_owned).collect())
}

/// Where a case's folder was when its commands ran: what they leave may name it.
fn home_of(folder: &Path) -> anyhow::Result<String> {
    let home = manifest(folder).ok().and_then(|it| it["home"].as_str().map(str::to_owned));
    Ok(home.map_or_else(|| folder.canonicalize().map(|it| it.display().to_string()), Ok)?)
}

/// What a folder was left by: written last, so that an interrupted case has none.
const MANIFEST: &str = "case.json";

fn manifest(folder: &Path) -> anyhow::Result<Value> {
    let path = folder.join(MANIFEST);
    let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    serde_json::from_str(&text).with_context(|| path.display().to_string())
}

fn copy_tree(from: &Path, to: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let entry = entry?;
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_tree(&entry.path(), &to)?;
        } else {
            std::fs::copy(entry.path(), to)?;
        }
    }
    Ok(())
}

/// Runs a command in a folder, which gets what it prints as well.
fn run(
    program: &Path,
    folder: &Path,
    number: usize,
    command: &str,
    limit: Duration,
) -> anyhow::Result<()> {
    let words = words(command);
    let verb = words.first().map_or("", String::as_str);
    let errors = folder.join(format!("{number}-{verb}.stderr.txt"));
    let mut child = Command::new(program)
        .args(&words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(File::create(folder.join(format!("{number}-{verb}.stdout.txt")))?)
        .stderr(File::create(&errors)?)
        .spawn()
        .with_context(|| format!("starting {}", program.display()))?;
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if limit < begin.elapsed() {
            child.kill()?;
            child.wait()?;
            bail!("took longer than {} s: {command}", limit.as_secs_f64());
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    if !status.success() {
        let said = std::fs::read_to_string(&errors).unwrap_or_default();
        let first = said.lines().next().unwrap_or("nothing on standard error");
        bail!("{status} of {command}: {first}");
    }
    Ok(())
}

/// The words of a command line.
fn words(command: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word: Option<String> = None;
    let mut is_quoted = false;
    for c in command.chars() {
        match c {
            '\'' => {
                is_quoted = !is_quoted;
                word.get_or_insert_default();
            }
            ' ' if !is_quoted => words.extend(word.take()),
            c => word.get_or_insert_default().push(c),
        }
    }
    words.extend(word);
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_split_as_a_shell_does() {
        assert_eq!(words("extend  m.toml --formula '-a * (x - 1)'").len(), 4);
        assert_eq!(words("a 'b c' d"), ["a", "b c", "d"]);
        assert_eq!(words("--set 'a=\"b c\"'"), ["--set", "a=\"b c\""]);
    }

    #[test]
    fn every_case_has_a_name_and_a_folder_of_its_own() {
        let folders: Vec<String> =
            cases().iter().map(|case| case.name.replace([' ', ':', '/'], "-")).collect();
        let distinct: BTreeSet<&String> = folders.iter().collect();
        assert_eq!(distinct.len(), folders.len(), "{folders:?}");
    }

    /// A program that writes what its first argument says, in place of the orchestrator.
    fn program(folder: &Path, script: &str) -> PathBuf {
        use std::os::unix::fs::PermissionsExt as _;
        let path = folder.join("program");
        std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        path
    }

    fn case(commands: &[&str]) -> Case {
        Case {
            name: "links: nothing".to_owned(),
            input: Input::Files(|| vec![("config.toml", "a = 1\n".to_owned())]),
            commands: commands.iter().map(|&command| command.to_owned()).collect(),
        }
    }

    #[test]
    fn a_case_is_run_once_and_its_results_are_kept_with_its_inputs() {
        let home = tempfile::tempdir().unwrap();
        let path = program(home.path(), "echo run >> times.txt; cat config.toml");
        let side = Side::Program { path, results: home.path().join("kept"), keeps: true };
        let limit = Duration::from_secs(60);
        let first = side.results(&case(&["compare"]), None, limit).unwrap();
        let again = side.results(&case(&["compare"]), None, limit).unwrap();
        assert_eq!(first, again);
        assert_eq!(std::fs::read_to_string(first.join("times.txt")).unwrap(), "run\n");
        let printed = std::fs::read_to_string(first.join("1-compare.stdout.txt")).unwrap();
        assert_eq!(printed, "a = 1\n");
        assert_eq!(inputs_of(&first).unwrap(), ["config.toml".to_owned()].into());
        let kept = Side::Kept(home.path().join("kept"));
        assert_eq!(kept.results(&case(&["compare"]), None, limit).unwrap(), first);
        let other = kept.results(&case(&["diagnose"]), None, limit).unwrap_err().to_string();
        assert!(other.contains("other commands"), "{other}");
        // The other side reads the inputs that were kept, whatever they would be now.
        std::fs::write(first.join("config.toml"), "a = 2\n").unwrap();
        let path = home.path().join("program");
        let after = Side::Program { path, results: home.path().join("after"), keeps: false };
        let after = after.results(&case(&["compare"]), Some(&first), limit).unwrap();
        let printed = std::fs::read_to_string(after.join("1-compare.stdout.txt")).unwrap();
        assert_eq!(printed, "a = 2\n");
    }

    #[test]
    fn a_command_that_fails_or_takes_too_long_is_told() {
        let home = tempfile::tempdir().unwrap();
        let error = |script: &str, limit_s: f64| {
            let results = home.path().join("results");
            let side = Side::Program { path: program(home.path(), script), results, keeps: false };
            let limit = Duration::from_secs_f64(limit_s);
            side.results(&case(&["compare x"]), None, limit).unwrap_err().to_string()
        };
        let failed = error("echo no such key >&2; exit 2", 60.0);
        assert!(failed.contains("2 of compare x: no such key"), "{failed}");
        let late = error("exec sleep 60", 0.05);
        assert!(late.contains("took longer than 0.05 s: compare x"), "{late}");
    }
}
