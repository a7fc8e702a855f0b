//! What commands about measurements are given, and where their answers go.

use super::arguments::{MOST_SEED, ThreadsArgs, whole_number};
use super::choice::ChoiceArgs;
use super::foreign::{Foreign, ForeignArgs};
use super::inputs;
use super::packets::ResimulationArgs;
use super::stop::Stopper;
use super::{
    AllowArgs, Failure, ReadArgs, check_place, is_stdout, residuals, write_json, write_whole,
};
use clap::Args;
use diagnose::Request;
use diagnose::between::Between;
use diagnose::rows::PredictedRows;
use measure::config::Compared;
use measure::table::DataTable;
use network::PacketRequest;
use report::measured::{MeasuredAnswer, MeasuredPage, page};
use report::packets::NetworkAnswer;
use std::path::{Path, PathBuf};
use study::choices::Choices;
use study::open::{self, Subject};
use terminal::say;

/// A configuration and measurements.
#[derive(Args)]
pub(super) struct DataArgs {
    /// The configuration (TOML): a complete experiment for packets; for links and robots, the sections that describe them
    /// suffice
    pub(super) config: PathBuf,
    /// The measurements: link samples, robot samples or packets (CSV, Parquet, K7 or the folder of a run; CSV and K7 may be
    /// gzipped)
    #[arg(long, value_name = "FILE", required = true)]
    pub(super) data: Option<PathBuf>,
    /// Override a key of the configuration, as in netsim.phy.propagation=friis. Repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    pub(super) set: Vec<String>,
    /// Packets and --heard only: override the seed of all random draws, to check how sensitive the answer is to it. Link
    /// and robot results do not depend on the seed
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_number::<MOST_SEED>)]
    pub(super) seed: Option<u64>,
    #[command(flatten)]
    pub(super) read: ReadArgs,
    #[command(flatten)]
    pub(super) allow: AllowArgs,
    #[command(flatten)]
    pub(super) foreign: ForeignArgs,
    #[command(flatten)]
    pub(super) choices: ChoiceArgs,
    #[command(flatten)]
    pub(super) threads: ThreadsArgs,
    /// Rows that aggregate several frames: predict the reception rate of each row from its mean RSSI reading. Only effects
    /// on reception are then tried and scored
    #[arg(long)]
    pub(super) given_rssi: bool,
    /// Write the results as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

impl DataArgs {
    /// The file of measurements. Only `diagnose --between` does without.
    pub(super) fn data(&self) -> &Path {
        self.data.as_deref().unwrap_or(Path::new(""))
    }

    /// Keys that are set, the seed among them.
    pub(super) fn set(&self) -> Vec<String> {
        let seed = self.seed.map(|seed| format!("experiment.seed={seed}"));
        self.set.iter().cloned().chain(seed).collect()
    }

    /// The configuration.
    pub(super) fn compared(&self) -> Result<Compared, Failure> {
        inputs::compared(&self.config, &self.set(), self.allow.consent())
    }

    /// The configuration and the measurements.
    pub(super) fn files(&self) -> Result<(Compared, DataTable), Failure> {
        Ok((self.compared()?, inputs::table(self.data(), self.read)?))
    }

    pub(super) fn choices(&self) -> Choices {
        Choices { given_rssi: self.given_rssi, ..self.choices.choices() }
    }

    /// What is chosen, as it would be typed.
    pub(super) fn words(&self) -> String {
        let given = if self.given_rssi { " --given-rssi" } else { "" };
        format!("{}{given}{}", self.choices.words(), self.foreign.words())
    }

    /// What is asked of links or robots.
    pub(super) fn request<'a>(
        &self,
        (config, table): (&'a Compared, &'a DataTable),
        simulator: Option<&'a Foreign<'a>>,
    ) -> Request<'a> {
        let request = Request::new(config, table).with_choices(self.choices());
        Request { simulator: simulator.map(|simulator| simulator as _), ..request }
    }

    /// The robot simulator of `--robotsim`, if it is given. It applies to robots only.
    pub(super) fn simulator<'a>(
        &'a self,
        table: &'a DataTable,
        stopper: Option<&'a Stopper>,
    ) -> Result<Option<Foreign<'a>>, Failure> {
        if open::subject(table).map_err(Failure::request)? == Subject::Links {
            self.foreign.refuse("link samples")?;
        }
        Ok(self.foreign.simulator(table, stopper))
    }

    /// Refuses choices of rows for what is compared as one run.
    pub(super) fn refuse_choices(&self, what: &str) -> Result<(), Failure> {
        let words = self.words();
        if words.is_empty() {
            return Ok(());
        }
        Err(Failure::request(format!(
            "{}: does not apply to {what}, which are compared as one run. Leave it out; --seeds and --from apply, and \
             --positions for packets",
            words.trim()
        )))
    }

    /// Packets and their experiment. What is chosen by rows is not for them.
    pub(super) fn packet_request(
        &self,
        resimulation: &ResimulationArgs,
        table: &DataTable,
    ) -> Result<PacketRequest, Failure> {
        self.foreign.refuse("packets")?;
        self.refuse_choices("packets")?;
        resimulation.open(
            &self.config,
            (&self.set(), &self.allow.consent()),
            table,
            self.read.reading(),
        )
    }
}

/// A configuration, measurements, and where the answer goes.
#[derive(Args)]
pub(super) struct AnswerArgs {
    #[command(flatten)]
    pub(super) data: DataArgs,
    /// Write the results as a page with plots (one HTML file, which needs no internet connection); - for standard output. Not
    /// with --given-rssi
    #[arg(long, value_name = "FILE")]
    pub(super) report: Option<PathBuf>,
    /// Links and robots only: write each row's residual, with and without the effects found, as CSV to this file; `replay
    /// --residuals` shows it on the map of a run; - for standard output. Not with --given-rssi
    #[arg(long, value_name = "FILE")]
    pub(super) residuals: Option<PathBuf>,
    #[command(flatten)]
    pub(super) resimulation: ResimulationArgs,
}

impl AnswerArgs {
    /// A place that cannot be written is found before the work, not after it.
    pub(super) fn check_places(&self) -> Result<(), Failure> {
        let outputs = [
            ("--json", &self.data.json),
            ("--report", &self.report),
            ("--residuals", &self.residuals),
        ];
        let named: Vec<(&str, &PathBuf)> = outputs
            .into_iter()
            .filter_map(|(option, path)| Some((option, path.as_ref()?)))
            .collect();
        for (place, (option, path)) in named.iter().enumerate() {
            check_place(option, path)?;
            if let Some((other, _)) = named[..place].iter().find(|(_, other)| other == path) {
                return Err(Failure::request(format!(
                    "{option} {}: is the file of {other}, too; give each a file of its own",
                    path.display()
                )));
            }
            if self.data.given_rssi && *option != "--json" {
                return Err(Failure::request(format!(
                    "{option} {}: does not apply with --given-rssi, which predicts no RSSI readings; use --json FILE",
                    path.display()
                )));
            }
        }
        Ok(())
    }

    /// Refuses `--residuals` for what is compared as one run.
    pub(super) fn refuse_residuals(&self, what: &str) -> Result<(), Failure> {
        let Some(path) = &self.residuals else { return Ok(()) };
        Err(Failure::request(format!(
            "--residuals {}: applies to measured links and robots only, not to {what}; leave it out",
            path.display()
        )))
    }

    /// What was asked, as it would be typed.
    pub(super) fn command(&self, verb: &str, choices: &str) -> String {
        self.command_on(verb, &format!("--data {}", self.data.data().display()), choices)
    }

    /// The same of any files. `files`: the option that names them, as it would be typed.
    pub(super) fn command_on(&self, verb: &str, files: &str, choices: &str) -> String {
        let data = &self.data;
        let set: String = data.set().iter().map(|key| format!(" --set '{key}'")).collect();
        let report = self.report.as_deref().map(Path::display);
        format!(
            "{} {verb} {} {files}{set}{choices} --report {}",
            experiment::program_name(),
            data.config.display(),
            report.map_or_else(String::new, |report| report.to_string())
        )
    }

    /// Writes what changed between two campaigns. `files`: the option that names them, as it would be typed.
    pub(super) fn write_between(&self, found: &Between, files: &str) -> Result<(), Failure> {
        write_json(self.data.json.as_deref(), found)?;
        let name = self.data.config.file_name().unwrap_or_default().to_string_lossy();
        let command = || self.command_on("diagnose", files, &self.data.words());
        self.write_page(|| report::between::page(&name, &command(), found))
    }

    /// Writes the page of `--report`, if it is asked for.
    pub(super) fn write_page(&self, page: impl FnOnce() -> String) -> Result<(), Failure> {
        let Some(path) = &self.report else { return Ok(()) };
        write_whole("--report", path, page())?;
        if !is_stdout(path) {
            say(format!("open {}", path.display()));
        }
        Ok(())
    }

    /// Writes what was found of a network. `further`: what else was asked, as it would be typed.
    pub(super) fn write_network(
        &self,
        found: NetworkAnswer<'_>,
        further: &str,
    ) -> Result<(), Failure> {
        write_json(self.data.json.as_deref(), &found)?;
        let name = self.data.config.file_name().unwrap_or_default().to_string_lossy();
        let words = format!("{further}{}", self.resimulation.words());
        let verb =
            if matches!(found, NetworkAnswer::Diagnosis(_)) { "diagnose" } else { "compare" };
        self.write_page(|| report::packets::page(&name, &self.command(verb, &words), found))
    }

    /// What is asked of links or robots, with the rows where a page or a table of residuals is wanted.
    pub(super) fn request<'a>(
        &self,
        files: (&'a Compared, &'a DataTable),
        simulator: Option<&'a Foreign<'a>>,
    ) -> Request<'a> {
        let wants_rows = self.report.is_some() || self.residuals.is_some();
        Request { wants_rows, ..self.data.request(files, simulator) }
    }

    /// Writes an answer about links or robots, and its rows. `further`: what else was asked, as it would be typed.
    pub(super) fn write(
        &self,
        config: &Compared,
        (answer, further): (MeasuredAnswer<'_>, &str),
        rows: Option<PredictedRows>,
    ) -> Result<(), Failure> {
        write_json(self.data.json.as_deref(), &answer)?;
        let Some(rows) = rows else { return Ok(()) };
        if let Some(path) = &self.residuals {
            let table = residuals::csv(&rows).map_err(Failure::work)?;
            write_whole("--residuals", path, table)?;
        }
        let name = config.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let verb =
            if matches!(answer, MeasuredAnswer::Diagnosis(_)) { "diagnose" } else { "compare" };
        self.write_page(|| {
            page(&MeasuredPage {
                config: name,
                command: self.command(verb, &format!("{further}{}", self.data.words())),
                answer,
                site: &config.site,
                rows,
            })
        })
    }
}
