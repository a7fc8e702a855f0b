//! The command line.

mod answer_file;
mod answers;
mod arguments;
mod bench;
mod between;
mod check;
mod choice;
mod conformance;
mod convert;
mod demo;
mod docs;
mod effects;
mod export;
mod figure;
mod foreign;
mod formula;
mod given_files;
mod help;
mod import;
mod inputs;
mod measured;
mod measured_args;
mod metrics;
mod new;
mod open;
mod packets;
mod power;
mod recover;
mod render;
mod replay;
mod residuals;
mod run;
mod schema;
mod search_log;
mod shell;
mod simulate;
mod stop;
mod sweeps;
mod task;
mod verify;

use ::run::{RunError, StartOptions};
use answers::{check_json, check_place, is_stdout, on_stdout, place_for, write_json, write_whole};
use arguments::{MOST_SEED, whole_number};
use clap::{Args, FromArgMatches as _, Parser, Subcommand};
use diagnose::DiagnoseError;
use diagnose::extend::ExtendError;
use drive::peer::become_command;
use experiment::{Consent, Overrides, Tls, set_program_name};
pub use help::command;
use input::Reading;
use measure::DataError;
use measure::memory::MemoryBudget;
use proto_host::{ServeArgs, ServeOptions, init_logging_to, use_threads};
use record::read::ReadError;
use record::result::{ResultFolder, Trust};
use record::run_summary::RunSummary;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Once;
use terminal::{LoggedStderr, complain, leave_stdout_to_answers, run_log, stdout_error, warn};

/// Simulate robot swarms that communicate over a radio mesh, and find missing physics from measurements
///
/// The program runs a robot simulator and a network simulator as separate processes and keeps them in step. Exit
/// status: 0 success; 1 the command failed while it worked; 2 the request or its input is invalid.
#[derive(Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Set the log level on standard error: error, warn, info, debug, trace, or a filter such as netsim=debug
    #[arg(long, global = true, value_name = "FILTER", default_value = "warn")]
    log: String,
    /// Log as JSON, one object per line
    #[arg(long, global = true)]
    log_json: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Write a starter experiment with comments
    ///
    /// Makes a folder with an experiment file that runs as it is. Its comments explain the keys, and end with what to
    /// try next. Kinds about measurements come with a table of measurements and a model that lacks an effect.
    New(new::NewArgs),
    /// Find a hidden effect in simulated measurements, from start to end
    ///
    /// Simulates measurements in which an effect is hidden, compares a model with them, diagnoses which effect the model
    /// lacks, extends the model, and runs a swarm under both. A page tells it with pictures. The diagnosis is a process
    /// of its own, which reads the model and the measurements only.
    Demo(demo::DemoArgs),
    /// Open the documentation in a browser
    ///
    /// The site is found beside the installed program, in the folder that the environment variable MURMURATION_DOCS
    /// names, or in target/book of a checkout of the source.
    Docs(docs::DocsArgs),
    /// Run an experiment and record it
    Run(run::RunArgs),
    /// Make results from the recording of a run that was killed
    Recover(recover::RecoverArgs),
    /// Run a recorded experiment again and compare all files
    Reproduce(recover::ReproduceArgs),
    /// Show the results of a folder in a browser: runs, sweeps and answers in one table
    ///
    /// The table has the figures of each result and the keys of the configuration that differ. Sort and filter it, lay series
    /// of several runs over each other, and go on to reports and to the page that plays a run. Runs that are being
    /// recorded appear with their progress.
    Open(open::OpenArgs),
    /// Show a recorded run in a browser, or write it as one HTML page
    Replay(replay::ReplayArgs),
    /// Draw a recorded run from above: a picture or a video
    ///
    /// Give --at and --output for a picture of one moment (SVG or PNG), or --video for a video (MP4, WebM or GIF).
    Render(render::RenderArgs),
    /// Draw a figure for a paper from a run, a sweep or an answer
    ///
    /// Writes PDF, SVG or PNG at the width of a journal's column or page, or the numbers as CSV. The figure of a sweep has the
    /// median of each setting with its interval, as its report has; the text below it is printed.
    Figure(figure::FigureArgs),
    /// Write a recorded run as CSV tables or as a ROS 2 bag
    Export(export::ExportArgs),
    /// Run one experiment under many settings and seeds
    ///
    /// The section [sweep] of the experiment file lists the settings and the number of seeds.
    Sweep(sweeps::SweepArgs),
    /// Compare the results of two runs or of two sweeps
    CompareRuns(sweeps::CompareRunsArgs),
    /// Check an experiment file, or measurements, before you use it
    Check(check::CheckArgs),
    /// Print the JSON Schema of experiment files, mapping files or answers
    Schema(schema::SchemaArgs),
    /// List the physical effects, or explain one
    Effects(effects::EffectsArgs),
    /// List the names of a run's figures, or explain one
    ///
    /// sweep.metrics, the Python package and reports accept a short name, such as pdr, or a path of summary.json.
    Metrics(metrics::MetricsArgs),
    /// Check that a recorded run is complete and consistent
    Verify(verify::VerifyArgs),
    /// Test whether a running simulator conforms to the contract
    Conformance(conformance::ConformanceArgs),
    /// Find out what logs are, and make a table of measurements and a first model of them
    ///
    /// Looks at names, values and units of the columns, shows what it takes them for and the first rows, asks what the
    /// logs leave open, and writes three files: the mapping, the table, and a model for compare and diagnose.
    Import(import::ImportArgs),
    /// Convert logs to a table of measurements, exactly as a mapping file says
    ///
    /// A mapping file names the logs, and which of their columns fill the columns of the table.
    Convert(convert::ConvertArgs),
    /// Measure how large a model's error is, and under which conditions
    Compare(measured::CompareArgs),
    /// Fit a missing effect to measurements and add it to a configuration
    Extend(measured::ExtendArgs),
    /// Find the physical effects that a model lacks, from measurements
    Diagnose(measured::DiagnoseArgs),
    /// Simulate a measurement campaign from a model
    Simulate(simulate::SimulateArgs),
    /// Estimate how large an effect must be for a campaign to detect it
    Power(power::PowerArgs),
    /// Measure the speed of the simulators
    Bench(bench::BenchArgs),
    /// Print the completions of a shell
    ///
    /// For bash: save the output as ~/.local/share/bash-completion/completions/NAME, with NAME the name of this program.
    Completions(shell::CompletionsArgs),
    /// Write manual pages to a folder
    Man(shell::ManArgs),
    /// Become a command that ends with its parent process
    #[command(hide = true)]
    Become(BecomeArgs),
    /// Serve the network simulator, for runs that have its URL
    Netsim(ServeOptions),
    /// Serve the robot simulator, for runs that have its URL
    Robotsim(ServeOptions),
}

#[derive(Args)]
struct FileArgs {
    /// The experiment file (TOML)
    config: PathBuf,
    #[command(flatten)]
    change: OverrideArgs,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Options that override keys of an experiment file.
#[derive(Args)]
struct OverrideArgs {
    /// Override a key of the file, as in netsim.phy.propagation=friis. Repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Override the seed of all random draws
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_number::<MOST_SEED>)]
    seed: Option<u64>,
    /// Use the network simulator at this URL instead of starting one
    #[arg(long, value_name = "URL")]
    netsim: Option<String>,
    /// Use the robot simulator at this URL instead of starting one
    #[arg(long, value_name = "URL")]
    robotsim: Option<String>,
    #[command(flatten)]
    tls: TlsArgs,
    #[command(flatten)]
    allow: AllowArgs,
}

/// Certificates for https URLs.
#[derive(Args)]
struct TlsArgs {
    /// Certificate authority that signed the simulators' certificates (PEM); required for https URLs
    #[arg(long, value_name = "FILE")]
    tls_ca: Option<PathBuf>,
    /// Client certificate (PEM), for simulators that require one
    #[arg(long, value_name = "FILE", requires_all = ["tls_key", "tls_ca"])]
    tls_cert: Option<PathBuf>,
    /// Private key of the client certificate (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
}

impl TlsArgs {
    fn tls(&self) -> Option<Tls> {
        let ca = self.tls_ca.clone()?;
        Some(Tls { ca, identity: self.tls_cert.clone().zip(self.tls_key.clone()) })
    }
}

impl OverrideArgs {
    fn overrides(&self) -> Overrides {
        Overrides {
            set: self.set.clone(),
            seed: self.seed,
            netsim_url: self.netsim.clone(),
            robotsim_url: self.robotsim.clone(),
            tls: self.tls.tls(),
            consent: self.allow.consent(),
            ..Overrides::default()
        }
    }
}

/// How files of others are read.
#[derive(Args, Clone, Copy)]
struct ReadArgs {
    /// Refuse a file of measurements or of a result that needs more memory than this to be read, as in 2GiB or 500MB
    #[arg(long, value_name = "SIZE", default_value = "1GiB")]
    memory_budget: MemoryBudget,
    /// Read files of a result that were changed after they were written, or that cannot be checked
    #[arg(long)]
    unverified: bool,
}

impl ReadArgs {
    /// What was said, with a warning, once, if nothing is checked.
    fn reading(self) -> Reading {
        static WARNED: Once = Once::new();
        if !self.unverified {
            return self.memory_budget.into();
        }
        WARNED.call_once(|| {
            warn(
                "--unverified: files are read as they are, changed or not; `murmuration verify` tells",
            );
        });
        Reading { budget: self.memory_budget, trust: Trust::Unchecked }
    }

    /// The folder of a run.
    fn open(self, run: &Path) -> Result<ResultFolder, Failure> {
        ResultFolder::open(run, self.reading()).map_err(|error| {
            if run.join(RunSummary::FILE).is_file() {
                Failure::work(error)
            } else {
                let what = "is not the folder of a recorded run: it has no summary.json";
                Failure::request(format!("{}: {what}", run.display()))
            }
        })
    }
}

/// What the experiment file may do outside of its own folder.
#[derive(Args, Clone, Default)]
struct AllowArgs {
    /// Run the programs that the experiment file names in [robotsim] command and [netsim] command, and obey its lines for a
    /// batch system. Give it only for files that you trust
    #[arg(long)]
    allow_command: bool,
    #[command(flatten)]
    files: AllowFileArgs,
    /// Send the experiment, with the contents of its files, to this URL if the experiment file names it. Repeatable
    #[arg(long, value_name = "URL")]
    allow_url: Vec<String>,
}

impl AllowArgs {
    fn consent(&self) -> Consent {
        Consent {
            commands: self.allow_command,
            urls: self.allow_url.clone(),
            ..self.files.consent()
        }
    }
}

/// Which files a configuration or a mapping may read.
#[derive(Args, Clone, Default)]
struct AllowFileArgs {
    /// Read this file, or any file in this folder, if the configuration or mapping file names it. Files in the folder of that
    /// file need no permission. Repeatable
    #[arg(long, value_name = "PATH")]
    allow_file: Vec<PathBuf>,
}

impl AllowFileArgs {
    fn consent(&self) -> Consent {
        Consent { files: self.allow_file.clone(), ..Consent::default() }
    }
}

#[derive(Args)]
struct BecomeArgs {
    /// Number of the parent process
    parent: u32,
    /// The command
    #[arg(last = true, required = true)]
    words: Vec<OsString>,
}

/// Something went wrong: what to say and how to exit.
#[derive(Debug, thiserror::Error)]
#[error("{text}")]
struct Failure {
    status: u8,
    text: String,
}

impl Failure {
    fn work(error: impl ToString) -> Self {
        Self { status: 1, text: error.to_string() }
    }

    /// A recording cannot be read: it is not there, or not what was written.
    fn of_reading(error: &ReadError) -> Self {
        if matches!(error, ReadError::Open { .. }) {
            return Self::request(format!(
                "{error}; give the folder of a complete run that was recorded with output.mcap = true"
            ));
        }
        Self::work(error)
    }

    /// A file of measurements cannot be used: only if it is of a result, and was changed, is that not the request's fault.
    fn of_data(error: &DataError) -> Self {
        match error {
            DataError::Unbelieved(_) => Self::work(error),
            DataError::Read { .. } | DataError::Format { .. } => Self::request(error),
        }
    }

    fn request(error: impl ToString) -> Self {
        Self { status: 2, text: error.to_string() }
    }

    /// A run did not leave complete results.
    fn of_run(error: RunError) -> Self {
        Self { status: error.exit_status(), text: error.to_string() }
    }

    /// A question about links or robots has no answer: files, choices and names are the user's.
    fn of_diagnosis(error: DiagnoseError) -> Self {
        match error {
            DiagnoseError::Simulator(error) => match error.downcast::<Self>() {
                Ok(failure) => *failure,
                Err(error) => Self::work(error),
            },
            DiagnoseError::Effect(ExtendError::Nothing)
            | DiagnoseError::NotExecuted(_)
            | DiagnoseError::Stopped(_) => Self::work(error),
            DiagnoseError::Open(_)
            | DiagnoseError::Choice(_)
            | DiagnoseError::Formula(_)
            | DiagnoseError::Effect(_)
            | DiagnoseError::NotCorrectable(_)
            | DiagnoseError::CorrectedRobots
            | DiagnoseError::SimulatorOfLinks => Self::request(error),
        }
    }
}

/// Runs the program.
#[must_use]
pub fn main() -> ExitCode {
    let mut arguments = std::env::args_os();
    set_program_name(arguments.next().as_deref());
    leave_stdout_to_answers(arguments);
    let matches = command().try_get_matches();
    let checked = match &matches {
        Ok(matches) => given_files::check(matches),
        Err(error) => given_files::check_words(error, std::env::args_os().skip(1)),
    };
    if let Err(failure) = checked {
        complain(failure.text);
        return ExitCode::from(failure.status);
    }
    let matches = matches.unwrap_or_else(|error| arguments::with_tips(error).exit());
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let result = match cli.command {
        Command::Netsim(options) => {
            let args = ServeArgs { options, log: cli.log, log_json: cli.log_json };
            return served(::run::serve_network(&args));
        }
        Command::Robotsim(options) => {
            let args = ServeArgs { options, log: cli.log, log_json: cli.log_json };
            return served(::run::serve_robots(&args));
        }
        Command::Become(args) => {
            let error = become_command(args.parent, &args.words);
            let program = args.words.first().cloned().unwrap_or_default();
            complain(format!("{}: {error}", program.display()));
            return ExitCode::from(127);
        }
        command => init_logging_to(&cli.log, cli.log_json, || LoggedStderr)
            .map_err(Failure::request)
            .and_then(|()| dispatch(command, &cli.log, cli.log_json)),
    };
    match result.and_then(|()| stdout_written()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            complain(failure.text);
            ExitCode::from(failure.status)
        }
    }
}

/// Whether all lines that the command printed were written.
fn stdout_written() -> Result<(), Failure> {
    let failed = |error| Failure::work(format!("cannot write to standard output: {error}"));
    stdout_error().map_or(Ok(()), |error| Err(failed(error)))
}

fn served(result: Result<(), proto_host::ServeError>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain(error);
            ExitCode::from(2)
        }
    }
}

fn dispatch(command: Command, log: &str, log_json: bool) -> Result<(), Failure> {
    let of_search = match &command {
        Command::Compare(args) => args.threads().threads,
        Command::Diagnose(args) => args.threads().threads,
        Command::Extend(args) => args.threads().threads,
        Command::Power(args) => args.threads.threads,
        _ => None,
    };
    use_threads(of_search);
    let start = |threads| -> Result<StartOptions, Failure> {
        let executable = std::env::current_exe().map_err(Failure::work)?;
        Ok(StartOptions {
            executable,
            threads,
            log: log.to_owned(),
            log_json,
            is_busy: false,
            run_log: run_log().clone(),
        })
    };
    match command {
        Command::New(args) => new::new(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Docs(args) => docs::docs(&args),
        Command::Completions(args) => shell::completions(&args),
        Command::Man(args) => shell::man(&args),
        Command::Run(args) => run::run(&args, start(args.threads)?),
        Command::Recover(args) => recover::recover(&args),
        Command::Reproduce(args) => recover::reproduce(&args, start(args.threads)?),
        Command::Open(args) => open::open(&args),
        Command::Replay(args) => replay::replay(&args),
        Command::Render(args) => render::render(&args),
        Command::Figure(args) => figure::figure(&args),
        Command::Export(args) => export::export(&args),
        Command::Sweep(args) => sweeps::sweep(&args, start(Some(args.threads))?),
        Command::CompareRuns(args) => sweeps::compare_runs(&args),
        Command::Check(args) => check::check(&args),
        Command::Schema(args) => schema::schema(&args),
        Command::Effects(args) => effects::effects(&args),
        Command::Metrics(args) => metrics::metrics(&args),
        Command::Verify(args) => verify::verify(&args),
        Command::Import(args) => import::import(&args),
        Command::Convert(args) => convert::convert(&args),
        Command::Compare(args) => measured::compare(&args),
        Command::Extend(args) => measured::extend(&args),
        Command::Diagnose(args) => measured::diagnose(&args),
        Command::Power(args) => power::power(&args),
        Command::Simulate(args) => simulate::simulate(&args),
        Command::Conformance(args) => conformance::conformance(&args),
        Command::Bench(args) => bench::bench(&args, start(args.threads)?),
        Command::Become(_) | Command::Netsim(_) | Command::Robotsim(_) => {
            unreachable!("served in main")
        }
    }
}

/// One thread suffices: the work is in the simulators, and handing over between threads would cost more than it gains.
fn on_runtime<T>(work: impl Future<Output = T>) -> Result<T, Failure> {
    ::run::on_runtime(work).map_err(Failure::work)
}
