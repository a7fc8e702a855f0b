//! The commands that hold a model against measurements.

use super::answers::{check_new, write_new};
use super::arguments::ThreadsArgs;
use super::between::BetweenArgs;
use super::formula::FormulaArgs;
use super::inputs::Watching;
use super::measured_args::{AnswerArgs, DataArgs};
use super::packets::{Adding, ResimulationArgs};
use super::stop::{BudgetArgs, Stopper};
use super::task;
use super::{Failure, inputs, write_json, write_whole};
use clap::Args;
use diagnose::corrected_data::CorrectedData;
use diagnose::extend::extension;
use diagnose::{DiagnoseError, Effects, Extending, Request, Stopped};
use measure::packets;
use network::{PacketRequest, TaskFiles};
use report::measured::MeasuredAnswer;
use report::packets::NetworkAnswer;
use std::path::{Path, PathBuf};
use study::open::{self, Subject};
use terminal::say;

/// The same, and how long the search may take; or two files in place of one.
#[derive(Args)]
#[command(mut_arg("data", |data| data.required(false).required_unless_present("between")))]
pub(super) struct DiagnoseArgs {
    #[command(flatten)]
    answer: AnswerArgs,
    /// Links and robots only: search all rows, which of large files takes minutes to hours. By default a subset of them
    /// is searched, and the result is fitted to all
    #[arg(long)]
    thorough: bool,
    #[command(flatten)]
    budget: BudgetArgs,
    #[command(flatten)]
    between: BetweenArgs,
}

/// The same, and what tells where an error comes from.
#[derive(Args)]
pub(super) struct CompareArgs {
    #[command(flatten)]
    answer: AnswerArgs,
    /// Packets only: links measured during the same campaign (link samples or an aggregated table). Together with
    /// --positions, attributes the error to robots, radio and protocol
    #[arg(long, value_name = "FILE")]
    links: Option<PathBuf>,
    /// Robots only: receptions during the same campaign (packets, link samples, or the folder of a run). Attributes the
    /// error of the swarm's task to network and robots; the configuration must be a complete experiment
    #[arg(long, value_name = "FILE", conflicts_with_all = ["links", "positions"])]
    heard: Option<PathBuf>,
}

#[derive(Args)]
pub(super) struct ExtendArgs {
    #[command(flatten)]
    data: DataArgs,
    /// Name of the effect to add; the command `effects` lists them. Repeatable
    #[arg(long, value_name = "NAME", required_unless_present_any = ["all", "formula"])]
    effect: Vec<String>,
    /// Run diagnose and add every effect that it accepts
    #[arg(long, conflicts_with = "effect")]
    all: bool,
    #[command(flatten)]
    formula: FormulaArgs,
    /// Write the extended configuration to this file (TOML); - for standard output
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
    /// Replace the file of --output if it exists
    #[arg(long)]
    replace: bool,
    /// If Ctrl-C or --budget stops the search of --all early: add the effects that it has accepted so far
    #[arg(long, requires = "all")]
    partial: bool,
    #[command(flatten)]
    budget: BudgetArgs,
    /// Links only: look for defects of the measurement, fit to the corrected measurements, and write these to this file (CSV);
    /// - for standard output
    #[arg(long, value_name = "FILE")]
    corrected_data: Option<PathBuf>,
    #[command(flatten)]
    resimulation: ResimulationArgs,
}

impl CompareArgs {
    pub(super) fn threads(&self) -> ThreadsArgs {
        self.answer.data.threads
    }
}

impl DiagnoseArgs {
    pub(super) fn threads(&self) -> ThreadsArgs {
        self.answer.data.threads
    }
}

impl ExtendArgs {
    pub(super) fn threads(&self) -> ThreadsArgs {
        self.data.threads
    }
}

/// `murmuration compare`.
pub(super) fn compare(args: &CompareArgs) -> Result<(), Failure> {
    let CompareArgs { answer: args, links, heard } = args;
    args.check_places()?;
    let data = &args.data;
    if let Some(heard) = heard {
        data.foreign.refuse("tracks with --heard")?;
        data.refuse_choices("tracks with --heard")?;
        args.refuse_residuals("tracks with --heard")?;
        let set = data.set();
        let files = TaskFiles {
            config: &data.config,
            set: &set,
            consent: &data.allow.consent(),
            data: data.data(),
            heard,
            reading: data.read.reading(),
        };
        let found = task::split(&files, args.resimulation.asked())?;
        let found = NetworkAnswer::Task(&found);
        return args.write_network(found, &format!(" --heard {}", heard.display()));
    }
    let (config, table) = data.files()?;
    if packets::has_shape(&table).is_ok() {
        args.refuse_residuals("packets")?;
        let request = data.packet_request(&args.resimulation, &table)?;
        let links = match links {
            Some(path) => {
                args.resimulation.needs_positions()?;
                Some((inputs::table(path, data.read)?, path))
            }
            None => None,
        };
        let mut found = super::packets::compare(&request)?;
        let mut further = String::new();
        if let Some((links, path)) = links {
            found.error_split = Some(super::packets::split(&request, &config, &links)?);
            further = format!(" --links {}", path.display());
        }
        return args.write_network(NetworkAnswer::Comparison(&found), &further);
    }
    if let Some(links) = links {
        return Err(Failure::request(format!(
            "--links {}: applies only if --data holds packets; to compare link measurements themselves, give them as --data",
            links.display()
        )));
    }
    let simulator = data.simulator(&table, None)?;
    let request = args.request((&config, &table), simulator.as_ref());
    let watching = Watching::new(None);
    let found = diagnose::compare(&request, &watching).map_err(Failure::of_diagnosis)?;
    watching.clear();
    say(diagnose::compare::words::text(&found.answer));
    args.write(&config, (MeasuredAnswer::Comparison(&found.answer), ""), found.rows)
}

/// Packets have no rows to fit an expression to.
const NO_FORMULA: &str = "--formula applies to measured links and robots only: the network has no effect of kind \
                          \"formula\". Use --effect NAME for packets";

/// Packets are searched by resimulation.
const NOT_THOROUGH: &str =
    "--thorough applies to measured links and robots only; for packets, raise --seeds";

/// `murmuration extend`.
pub(super) fn extend(args: &ExtendArgs) -> Result<(), Failure> {
    let data = &args.data;
    check_new("--output", &args.output, args.replace)?;
    let stopper = Stopper::listen(args.budget)?;
    let (config, table) = data.files()?;
    let subject = open::subject(&table);
    if let (Some(path), Ok(Subject::Robots) | Err(_)) = (&args.corrected_data, &subject) {
        return Err(Failure::request(format!(
            "--corrected-data {}: defects are looked for in link samples only, and {} holds none; leave the option out",
            path.display(),
            data.data().display()
        )));
    }
    if packets::has_shape(&table).is_ok() {
        if args.formula.wanted().is_some() {
            return Err(Failure::request(NO_FORMULA));
        }
        let request = data.packet_request(&args.resimulation, &table)?;
        return args.extend_network(&request, &config.text, &stopper);
    }
    let simulator = data.simulator(&table, Some(&stopper))?;
    let request = data.request((&config, &table), simulator.as_ref());
    let effects = args.effects();
    let extending = Extending {
        effects,
        formula: args.formula.wanted(),
        wants_corrected: args.corrected_data.is_some(),
        accepts_partial: args.partial,
    };
    let watching = Watching::new(Some(&stopper));
    let extended = diagnose::extend(&request, &extending, &watching);
    watching.clear();
    let extended = extended.map_err(|error| args.failure(error, &stopper))?;
    if let (Some(path), Some(corrected)) = (&args.corrected_data, &extended.corrected) {
        write_corrected(path, corrected)?;
    }
    let Some(extended) = extended.config else {
        say("no effect is missing in the corrected measurements: --output is not written");
        return Ok(());
    };
    write_new("--output", &args.output, args.replace, &extended.text)?;
    let answer = &extended.answer;
    say(format!("{}: {}", args.output.display(), extension::text(answer)));
    write_json(data.json.as_deref(), answer)?;
    stopper.require_complete(answer.complete)
}

/// Writes measurements without their defects.
fn write_corrected(path: &Path, corrected: &CorrectedData) -> Result<(), Failure> {
    write_whole("--corrected-data", path, &corrected.csv)?;
    say(format!(
        "{}: {} rows, {} of them corrected; {} rows with defects and {} that cannot be used are left out",
        path.display(),
        corrected.n_rows,
        corrected.n_changed,
        corrected.n_left_out,
        corrected.n_rejected
    ));
    Ok(())
}

impl ExtendArgs {
    fn effects(&self) -> Effects {
        if self.all { Effects::Accepted } else { Effects::Named(self.effect.clone()) }
    }

    /// `murmuration extend` of packets.
    fn extend_network(
        &self,
        request: &PacketRequest,
        text: &str,
        stopper: &Stopper,
    ) -> Result<(), Failure> {
        let adding = Adding {
            config: &self.data.config,
            text,
            effects: self.effects(),
            output: (&self.output, self.replace),
            json: self.data.json.as_deref(),
            is_partial_wanted: self.partial,
        };
        super::packets::extend(request, &adding, stopper)
    }

    /// Why nothing is written, with the option that it concerns.
    fn failure(&self, error: DiagnoseError, stopper: &Stopper) -> Failure {
        let corrected = || {
            let path = self.corrected_data.as_deref().unwrap_or(Path::new(""));
            format!("--corrected-data {}", path.display())
        };
        match error {
            DiagnoseError::NotCorrectable(refused) => {
                Failure::request(format!("{}: {refused}", corrected()))
            }
            DiagnoseError::Stopped(Stopped::Defects) => Failure::request(format!(
                "{}: the search was stopped before it told which defects there are; nothing is written",
                corrected()
            )),
            DiagnoseError::Stopped(stopped) => stopper.refuse_partial(hint(stopped)),
            error => Failure::of_diagnosis(error),
        }
    }
}

/// What to do about an extension that was stopped.
fn hint(stopped: Stopped) -> &'static str {
    match stopped {
        Stopped::Search => {
            "Give it more time, or add the effects that were accepted until then with --partial"
        }
        Stopped::NothingAccepted => "No effect was accepted until then; give it more time",
        Stopped::Defects | Stopped::Fit => "Give it more time",
    }
}

/// `murmuration diagnose`.
pub(super) fn diagnose(args: &DiagnoseArgs) -> Result<(), Failure> {
    let DiagnoseArgs { answer: args, thorough, budget, between } = args;
    let words = if *thorough { " --thorough" } else { "" };
    between.refuse_data(args.data.data.as_deref())?;
    args.check_places()?;
    let stopper = Stopper::listen(*budget)?;
    let data = &args.data;
    if between.is_asked() {
        args.refuse_residuals("what changed between two files")?;
        let found =
            between.diagnose(data.compared()?, (data.choices(), *thorough), data.read, &stopper)?;
        args.write_between(&found, &format!("{}{words}", between.words()))?;
        return stopper.require_complete(found.complete);
    }
    let (config, table) = data.files()?;
    if packets::has_shape(&table).is_ok() {
        args.refuse_residuals("packets")?;
        if *thorough {
            return Err(Failure::request(NOT_THOROUGH));
        }
        let request = data.packet_request(&args.resimulation, &table)?;
        let found = super::packets::diagnose(&request, &stopper)?;
        args.write_network(NetworkAnswer::Diagnosis(&found), "")?;
        return stopper.require_complete(found.complete);
    }
    let simulator = data.simulator(&table, Some(&stopper))?;
    let request = args.request((&config, &table), simulator.as_ref());
    let request = Request { is_thorough: *thorough, ..request };
    let watching = Watching::new(Some(&stopper));
    let found = diagnose::diagnose(&request, &watching).map_err(Failure::of_diagnosis)?;
    watching.clear();
    if let Some(n_rows) = found.subset {
        say(format!(
            "searched in a subset of {n_rows} rows, spread evenly over all rows; parameters fitted to all rows (--thorough searches all)"
        ));
    }
    say(diagnose::words::text(&found.answer));
    args.write(&config, (MeasuredAnswer::Diagnosis(&found.answer), words), found.rows)?;
    stopper.require_complete(found.answer.complete)
}
