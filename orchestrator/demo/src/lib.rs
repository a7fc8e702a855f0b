//! Starter experiments, which `new` writes, and the loop from measurements to a better model, on an effect that a seed hides: what
//! `demo` does.
//!
//! Every step is a command of this program in a process of its own, so the diagnosis reads the model and the measurements, and
//! nothing else. The file that states the truth is written after it.
//!
//! | module | content |
//! |---|---|
//! | here | the steps of the loop |
//! | `hidden` | which effects can be hidden, and the one that a seed hides |
//! | `answers` | what the steps answer |
//! | `demo_answer`, `page` | what was hidden and what was found, as JSON and as a page |
//! | [`starters`] | starter experiments, some with measurements |
//! | `campaign` | templates of the measurement campaigns of both |

mod answers;
mod campaign;
mod demo_answer;
mod hidden;
mod page;
pub mod starters;

use crate::campaign::{LinkCampaign, TrackCampaign};
use answers::{ComparisonAnswer, DiagnosisAnswer, RunSummaryAnswer};
pub use demo_answer::DemoAnswer;
use demo_answer::{Estimate, Outcome, SCHEMA, SwarmResult};
use experiment::program_name;
use hidden::{HiddenEffect, Measured};
use numbers::format::{count, number};
use proto::bounds::{COMMAND_BYTES, DESCRIPTION_BYTES};
use run::interrupt::Interrupt;
use serde::de::DeserializeOwned;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use system::DraftFolder;
use thiserror::Error;

/// The model, as a template.
const MODEL: &str = include_str!("model.toml");

/// The campaign that measures links, in and around the building of the model, for two hours.
const LINKS: LinkCampaign = LinkCampaign {
    motes_m: &[
        [-9.0, -4.0],
        [-4.0, 0.5],
        [1.0, -3.0],
        [6.0, 0.0],
        [12.0, -2.0],
        [10.0, 6.0],
        [15.0, 2.0],
        [10.0, 13.0],
        [16.0, 12.0],
        [11.0, 20.0],
        [18.0, 19.0],
        [-8.0, 7.0],
        [-3.0, 11.0],
        [2.0, 6.0],
        [5.0, 13.0],
        [4.0, 19.0],
        [-5.0, 18.0],
    ],
    rows: 3000,
    period_s: 2.4,
    temperature_c: Some([22.0, 8.0]),
};

/// The campaign that measures robots, for 50 s.
const TRACKS: TrackCampaign = TrackCampaign {
    sides_mps: [[1.5, 0.0], [0.4, 0.8], [-0.6, 1.1], [-1.3, 0.0], [-0.5, -0.8], [0.3, -1.1]],
    start_m: [0.0, -6.0],
    robots: 4,
    samples: 250,
};

/// Names of files of a demo.
const MODEL_FILE: &str = "model.toml";
const TRUTH_FILE: &str = "truth.toml";
const BETTER_FILE: &str = "better.toml";
const PAGE_FILE: &str = "story.html";
/// Folder of the runs of the swarm.
const RUNS: &str = "runs";
/// Simulated time at which the swarm is drawn: the end of the run (s).
const DRAWN_S: &str = "25";
/// Width and height of the pictures of the swarm (px).
const PICTURE_SIZE: &str = "480x440";

/// What a demo is asked for.
#[derive(Clone, Debug)]
pub struct DemoOptions {
    /// This program.
    pub program: PathBuf,
    /// The seed of all draws.
    pub seed: u64,
    /// Name of the effect to hide, `none` for none, or absent to let the seed choose.
    pub effect: Option<String>,
    /// Number of robots of the swarm.
    pub robots: u32,
    /// The folder to make.
    pub folder: PathBuf,
}

/// Why a demo failed.
#[derive(Debug, Error)]
pub enum DemoError {
    /// The request is invalid.
    #[error("{0}")]
    Request(String),
    /// A file cannot be written or read.
    #[error("{path}: {source}")]
    File {
        /// Where.
        path: String,
        /// Why.
        source: std::io::Error,
    },
    /// The measurements cannot be simulated.
    #[error("cannot simulate the measurements: {0}")]
    Simulation(String),
    /// A command failed.
    #[error("{command}: {message}")]
    Command {
        /// The command.
        command: String,
        /// What it printed on standard error.
        message: String,
    },
    /// An answer of a command cannot be read.
    #[error("{file}: {problem}")]
    Answer {
        /// The file.
        file: String,
        /// What is wrong.
        problem: String,
    },
    /// A signal ended it.
    #[error("{0}: the demo did not finish, and nothing was kept")]
    Interrupted(&'static str),
}

/// The model with values in place of `@…@`.
fn filled(template: &str, seed: u64, robots: u32, data: &str) -> String {
    template
        .replace("@PROGRAM@", program_name())
        .replace("@DATA@", data)
        .replace("@SEED@", &seed.to_string())
        .replace("@ROBOTS@", &robots.to_string())
}

/// The model with the hidden effect.
fn truth_text(model: &str, hidden: Option<&HiddenEffect>) -> String {
    let (_, sections) = model.split_once("\n\n").unwrap_or_default();
    let sections = sections.replace("name = \"model\"", "name = \"truth\"");
    let (made, effect) = match hidden {
        Some(hidden) => (
            format!("{MODEL_FILE} with the hidden effect"),
            format!("\n# The effect that {MODEL_FILE} lacks.\n{}", hidden.section()),
        ),
        None => (format!("{MODEL_FILE} as it is; nothing was hidden"), String::new()),
    };
    format!("# What made the measurements: {made}.\n\n{sections}{effect}")
}

/// A demo under way.
struct Demo<'a> {
    options: &'a DemoOptions,
    /// Where the files are made.
    folder: &'a Path,
    interrupt: Interrupt,
    /// The commands that ran, as a person types them.
    commands: Vec<String>,
}

/// Who watches a demo.
pub trait DemoObserver {
    /// Work on a step begins, from 1 to [`STEPS`]. `what`: the work, as in `searching for …`.
    fn begin(&mut self, step: u64, what: &str);

    /// What a step found, as a line.
    fn report(&mut self, line: String);
}

/// Number of steps of a demo.
pub const STEPS: u64 = 5;

/// Runs the demo.
///
/// # Errors
///
/// The request is invalid, a file cannot be written, a command fails, or a signal ends it. Then no folder is left.
pub async fn demo(
    options: &DemoOptions,
    observer: &mut dyn DemoObserver,
) -> Result<DemoAnswer, DemoError> {
    let hidden = hidden::draw(options.seed, options.effect.as_deref())
        .map_err(|problem| DemoError::Request(format!("--effect {problem}")))?;
    let folder = &options.folder;
    if folder.symlink_metadata().is_ok() {
        return Err(DemoError::Request(format!(
            "{}: exists already; give another folder with --out",
            folder.display()
        )));
    }
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty());
    let parent = parent.unwrap_or(Path::new("."));
    if !parent.is_dir() {
        return Err(DemoError::Request(format!(
            "{}: the folder {} does not exist; make it first",
            folder.display(),
            parent.display()
        )));
    }
    // Beside its place, so that a failure leaves no half of it.
    let made = DraftFolder::beside(folder).map_err(|source| file_error(parent, source))?;
    let interrupt = Interrupt::listen();
    let mut demo = Demo { options, folder: made.path(), interrupt, commands: Vec::new() };
    let answer = demo.run(hidden.as_ref(), observer).await?;
    made.place(folder).map_err(|source| file_error(folder, source))?;
    Ok(answer)
}

fn file_error(path: &Path, source: std::io::Error) -> DemoError {
    DemoError::File { path: path.display().to_string(), source }
}

impl Demo<'_> {
    async fn run(
        &mut self,
        hidden: Option<&HiddenEffect>,
        observer: &mut dyn DemoObserver,
    ) -> Result<DemoAnswer, DemoError> {
        let DemoOptions { seed, robots, .. } = *self.options;
        let measured = hidden.map_or(Measured::Links, |hidden| hidden.measured);
        let (data, template, unit, what) = match measured {
            Measured::Links => ("links.csv", LINKS.template(), "dB", "received signal strength"),
            Measured::Robots => ("tracks.csv", TRACKS.template(), "m", "commands and motion"),
        };
        let model = filled(MODEL, seed, robots, data);
        let truth = truth_text(&model, hidden);
        observer.begin(1, &format!("simulating the measurements {data}"));
        let (n_rows, n_received) = self.measure(&truth, data, &template)?;
        self.write(MODEL_FILE, &model)?;
        let rows = match measured {
            Measured::Links => {
                let frames = count(n_rows as u64);
                let received = count(n_received as u64);
                format!(
                    "{frames} frames between {} motes, {received} received",
                    LINKS.motes_m.len()
                )
            }
            Measured::Robots => {
                format!("{} positions of {} robots", count(n_rows as u64), TRACKS.robots)
            }
        };
        observer.report(format!(
            "1. {data}: {rows} ({what}). Seed {seed} chose what is hidden in them"
        ));

        observer.begin(2, &format!("comparing {MODEL_FILE} with {data}"));
        self.command(
            &["compare", MODEL_FILE, "--data", data],
            &[("--report", "comparison.html"), ("--json", "comparison.json")],
        )
        .await?;
        let comparison: ComparisonAnswer = self.answer("comparison.json")?;
        let before = comparison.error();
        observer.report(format!("2. the error of {MODEL_FILE} is {}", with_unit(before, unit)));

        observer.begin(3, &format!("searching for the effect that {MODEL_FILE} lacks"));
        self.command(
            &["diagnose", MODEL_FILE, "--data", data],
            &[
                ("--report", "diagnosis.html"),
                ("--json", "diagnosis.json"),
                ("--residuals", "residuals.csv"),
            ],
        )
        .await?;
        let diagnosis: DiagnosisAnswer = self.answer("diagnosis.json")?;
        observer.report(format!(
            "3. the diagnosis, from {MODEL_FILE} and {data} alone: {}",
            diagnosis.sentence
        ));

        observer.begin(4, "adding what was found to the model");
        let after = self.extend(&diagnosis, data).await?;
        if let Some(after) = after {
            observer.report(format!(
                "4. the error of {BETTER_FILE} is {} in place of {}",
                with_unit(after, unit),
                with_unit(before, unit)
            ));
        } else {
            observer.report("4. no effect was named, so the model stays as it is".to_owned());
        }

        self.write(TRUTH_FILE, &truth)?;
        observer.begin(5, &format!("comparing {TRUTH_FILE} with {data}"));
        self.command(&["compare", TRUTH_FILE, "--data", data], &[("--json", "truth.json")]).await?;
        let noise = self.answer::<ComparisonAnswer>("truth.json")?.error();
        let swarms = self.swarms(hidden.is_some(), after.is_some(), observer).await?;
        let floor_mps = swarms.first().map_or(0.0, |(swarm, _)| swarm.flock_speed_floor_mps);
        let leader_mps = swarms.first().map_or(0.0, |(swarm, _)| swarm.leader_speed_mps);
        let speeds: Vec<String> = swarms
            .iter()
            .map(|(swarm, _)| {
                format!("{} m/s with {}.toml", number(swarm.speed_along_leader_mps), swarm.model)
            })
            .collect();
        observer.report(format!(
            "5. speed along the leader's direction (leader {} m/s; {} m/s if no robot follows): {}",
            number(leader_mps),
            number(floor_mps),
            speeds.join(", ")
        ));

        let outcome = Outcome::of(&diagnosis, hidden);
        let kind = hidden.map(|hidden| hidden.kind.clone());
        let estimates = estimates(&diagnosis, hidden);
        let accepted = diagnosis.accepted().map(|candidate| candidate.effect.clone()).collect();
        let mut indistinguishable: Vec<String> = diagnosis
            .accepted()
            .flat_map(|candidate| candidate.indistinguishable_from.clone())
            .collect();
        indistinguishable.sort();
        indistinguishable.dedup();
        let answer = DemoAnswer {
            schema: SCHEMA,
            seed,
            settings: hidden.map(|hidden| hidden.settings.clone()),
            outcome,
            sentence: diagnosis.sentence.clone(),
            accepted,
            indistinguishable,
            error: before,
            error_extended: after.flatten(),
            estimates,
            swarms: swarms.iter().map(|(swarm, _)| swarm.clone()).collect(),
            folder: self.options.folder.display().to_string(),
            page: self.options.folder.join(PAGE_FILE).display().to_string(),
            hidden: kind,
        };
        let told = page::Told {
            answer: &answer,
            comparison: &comparison,
            diagnosis: &diagnosis,
            hidden,
            data,
            measured: rows,
            unit,
            noise,
            commands: &self.commands,
            pictures: swarms.into_iter().map(|(_, pictures)| pictures).collect(),
        };
        let page = told.page(self.folder, &model)?;
        self.write(PAGE_FILE, &page)?;
        Ok(answer)
    }

    /// Writes the measurements. Returns the number of rows, and of those with a reading.
    fn measure(
        &self,
        truth: &str,
        data: &str,
        template: &str,
    ) -> Result<(usize, usize), DemoError> {
        let simulated =
            campaign::simulated((TRUTH_FILE, truth), (data, template), self.options.seed)
                .map_err(DemoError::Simulation)?;
        self.write(data, &simulated.to_csv())?;
        let received = simulated.names.iter().position(|name| name == "received");
        let n_received = received.map_or(simulated.n_rows(), |column| {
            simulated.columns[column].iter().filter(|&&received| 0.0 < received).count()
        });
        Ok((simulated.n_rows(), n_received))
    }

    /// Adds the effects that were accepted, and returns the error of the extended model. None if no effect was accepted.
    async fn extend(
        &mut self,
        diagnosis: &DiagnosisAnswer,
        data: &str,
    ) -> Result<Option<Option<f64>>, DemoError> {
        // Curves have no section in a configuration.
        let effects = diagnosis.accepted().filter(|candidate| candidate.settings.is_some());
        let options: Vec<(&str, &str)> =
            effects.map(|candidate| ("--effect", candidate.effect.as_str())).collect();
        if options.is_empty() {
            return Ok(None);
        }
        let options = [options, vec![("--output", BETTER_FILE)]].concat();
        self.command(&["extend", MODEL_FILE, "--data", data], &options).await?;
        self.command(&["compare", BETTER_FILE, "--data", data], &[("--json", "better.json")])
            .await?;
        let better: ComparisonAnswer = self.answer("better.json")?;
        Ok(Some(better.error()))
    }

    /// Runs the swarm under each model. Returns each with its pictures on light and on dark ground (SVG).
    async fn swarms(
        &mut self,
        is_hidden: bool,
        is_extended: bool,
        observer: &mut dyn DemoObserver,
    ) -> Result<Vec<(SwarmResult, [String; 2])>, DemoError> {
        let models = [("model", true), ("better", is_extended), ("truth", is_hidden)];
        let mut swarms = Vec::new();
        for (model, _) in models.into_iter().filter(|(_, is_there)| *is_there) {
            let config = format!("{model}.toml");
            observer.begin(5, &format!("running the swarm with {config}"));
            let name = format!("experiment.name={model}");
            self.command(&["run", &config], &[("--set", &name), ("--out", RUNS)]).await?;
            let run = format!("{RUNS}/{model}");
            let summary: RunSummaryAnswer = self.answer(&format!("{run}/summary.json"))?;
            let mut pictures = [String::new(), String::new()];
            for (picture, ground) in pictures.iter_mut().zip(["light", "dark"]) {
                let file = format!("{model}-{ground}.svg");
                let drawn =
                    ["render", &run, "--at", DRAWN_S, "--size", PICTURE_SIZE, "--output", &file];
                let dark: &[&str] = if ground == "dark" { &["--dark"] } else { &[] };
                self.child(&[&drawn[..], dark].concat()).await?;
                *picture = self.read(&file)?;
            }
            swarms.push((
                SwarmResult {
                    model,
                    speed_along_leader_mps: summary.task.speed_along_leader_mps,
                    flock_speed_mps: summary.task.flock_speed_mps,
                    leader_speed_mps: summary.task.leader_speed_mps,
                    flock_speed_floor_mps: summary.task.flock_speed_floor_mps,
                    delivery_ratio: summary.network.delivery_ratio,
                },
                pictures,
            ));
        }
        Ok(swarms)
    }

    /// Runs a command, and lists it among those that the page shows.
    async fn command(&mut self, words: &[&str], options: &[(&str, &str)]) -> Result<(), DemoError> {
        let options = options.iter().flat_map(|&(option, value)| [option, value]);
        let words: Vec<&str> = words.iter().copied().chain(options).collect();
        self.commands.push(format!("{} {}", program_name(), words.join(" ")));
        self.child(&words).await
    }

    /// Runs this program in the folder of the demo, as a process of its own.
    async fn child(&mut self, words: &[&str]) -> Result<(), DemoError> {
        let failed = |source| file_error(&self.options.program, source);
        let errors = system::unnamed_file().map_err(failed)?;
        let mut child = tokio::process::Command::new(&self.options.program)
            .arg0(program_name())
            .args(words)
            .current_dir(self.folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(errors.try_clone().map_err(failed)?)
            .kill_on_drop(true)
            .spawn()
            .map_err(failed)?;
        let status = tokio::select! {
            status = child.wait() => status.map_err(failed)?,
            signal = self.interrupt.first() => {
                // The child has the signal too, if it came from a terminal; it may be about to print what it has.
                let _ = child.kill().await;
                return Err(DemoError::Interrupted(signal));
            }
        };
        if status.success() {
            return Ok(());
        }
        Err(DemoError::Command {
            command: format!("{} {}", program_name(), words.join(" ")),
            message: printed(errors).unwrap_or_else(|error| error.to_string()),
        })
    }

    fn write(&self, name: &str, text: &str) -> Result<(), DemoError> {
        let path = self.folder.join(name);
        system::write(&path, text).map_err(|source| file_error(&path, source))
    }

    fn read(&self, name: &str) -> Result<String, DemoError> {
        let path = self.folder.join(name);
        File::open(&path)
            .and_then(|file| DESCRIPTION_BYTES.read_text(file))
            .map_err(|source| file_error(&path, source))
    }

    fn answer<T: DeserializeOwned>(&self, name: &str) -> Result<T, DemoError> {
        serde_json::from_str(&self.read(name)?).map_err(|error| DemoError::Answer {
            file: name.to_owned(),
            problem: error.to_string(),
        })
    }
}

/// What a command printed on standard error.
fn printed(mut errors: File) -> std::io::Result<String> {
    use std::io::Seek as _;
    errors.rewind()?;
    Ok(String::from_utf8_lossy(&COMMAND_BYTES.read(errors)?).trim().to_owned())
}

fn with_unit(value: Option<f64>, unit: &str) -> String {
    value.map_or_else(|| "unknown".to_owned(), |value| format!("{} {unit}", number(value)))
}

/// Numbers of the hidden effect that the diagnosis estimated.
fn estimates(diagnosis: &DiagnosisAnswer, hidden: Option<&HiddenEffect>) -> Vec<Estimate> {
    let Some(hidden) = hidden else { return Vec::new() };
    let Some(found) = diagnosis.accepted().find(|candidate| candidate.effect == hidden.kind) else {
        return Vec::new();
    };
    let estimate = |(name, hidden): (String, f64)| {
        let parameter = found.parameters.get(&name)?;
        Some(Estimate {
            unit: parameter.unit.clone(),
            hidden,
            value: parameter.value?,
            low: parameter.low?,
            high: parameter.high?,
            name,
        })
    };
    hidden.numbers().into_iter().filter_map(estimate).collect()
}
