//! The commands that hold a network against measured packets.

use super::answers::write_new;
use super::inputs::Watching;
use super::stop::Stopper;
use super::{Failure, write_json};
use clap::Args;
use diagnose::{Effects, Stopped};
use experiment::Consent;
use input::Reading;
use measure::config::Compared;
use measure::table::DataTable;
use network::comparison::NetworkComparison;
use network::diagnosis::NetworkDiagnosis;
use network::error_split::NetworkErrorSplit;
use network::{
    ComparisonOptions, ExtendedExperiment, PacketError, PacketFiles, PacketRequest, Worded,
};
use std::path::{Path, PathBuf};
use terminal::say;

/// How the experiment is simulated again, to be compared with measured packets.
#[derive(Args, Clone)]
pub(super) struct ResimulationArgs {
    /// Packets only: measured robot positions, as a table with time_s, agent, x_m, y_m, or the folder of a run [default:

    /// robots move as the experiment simulates them]

    #[arg(long, value_name = "FILE")]
    positions: Option<PathBuf>,
    /// Packets and --heard only: number of seeds under which the network is simulated
    #[arg(long, value_name = "N", default_value_t = ComparisonOptions::default().seeds)]
    seeds: u64,
    /// Packets only: ignore packets created before this time (s). With --heard: time at which the task began (s)
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    from: f64,
    /// Packets only: end of the campaign (s), if it is later than the last packet
    #[arg(long, value_name = "S")]
    until: Option<f64>,
}

impl ResimulationArgs {
    /// What is asked.
    pub(super) fn asked(&self) -> ComparisonOptions {
        ComparisonOptions { seeds: self.seeds, from_s: self.from }
    }

    /// Where robots were must have been measured.
    pub(super) fn needs_positions(&self) -> Result<(), Failure> {
        if self.positions.is_some() {
            return Ok(());
        }
        Err(Failure::request(
            "--links: requires --positions, because measured links are replayed between robots at their measured \
             positions; give --positions FILE",
        ))
    }

    /// As they would be typed.
    pub(super) fn words(&self) -> String {
        let positions = self.positions.as_ref();
        format!(
            "{} --seeds {} --from {}{}",
            positions.map_or_else(String::new, |path| format!(" --positions {}", path.display())),
            self.seeds,
            self.from,
            self.until.map_or_else(String::new, |until_s| format!(" --until {until_s}"))
        )
    }

    /// Reads everything.
    pub(super) fn open(
        &self,
        config: &Path,
        (set, consent): (&[String], &Consent),
        table: &DataTable,
        reading: Reading,
    ) -> Result<PacketRequest, Failure> {
        let positions = self.positions.as_deref();
        let until_s = self.until;
        let files = PacketFiles { config, set, consent, table, positions, until_s, reading };
        PacketRequest::open(&files, self.asked()).map_err(failure)
    }
}

/// Why packets have no answer, with the option that it concerns.
fn failure(error: PacketError) -> Failure {
    match error {
        PacketError::Until { .. } => Failure::request(format!("--until {error}")),
        PacketError::TooFewSeeds { .. } => Failure::request(format!("--seeds {error}")),
        PacketError::Extend(_) | PacketError::Stopped(_) => Failure::work(error),
        PacketError::Data(error) => Failure::of_data(&error),
        PacketError::File(_) | PacketError::Effect(_) | PacketError::Resimulation(_) => {
            Failure::request(error)
        }
    }
}

/// Prints an answer, and returns it.
pub(super) fn print_answer<A>(Worded { answer, text }: Worded<A>) -> A {
    say(text);
    answer
}

/// `murmuration compare` of packets.
pub(super) fn compare(request: &PacketRequest) -> Result<NetworkComparison, Failure> {
    network::compare(request, &Watching::new(None)).map_err(Failure::request).map(print_answer)
}

/// Where the error comes from.
pub(super) fn split(
    request: &PacketRequest,
    config: &Compared,
    links: &DataTable,
) -> Result<NetworkErrorSplit, Failure> {
    let Worded { answer, text } =
        network::split(request, config, links, &Watching::new(None)).map_err(Failure::request)?;
    say(format!("\n{text}"));
    Ok(answer)
}

/// `murmuration diagnose` of packets.
pub(super) fn diagnose(
    request: &PacketRequest,
    stopper: &Stopper,
) -> Result<NetworkDiagnosis, Failure> {
    let watching = Watching::new(Some(stopper));
    network::diagnose(request, &watching).map_err(failure).map(print_answer)
}

/// Which effects are added to an experiment, and where it is written: the file, and whether an existing one is replaced.
pub(super) struct Adding<'a> {
    pub(super) config: &'a Path,
    pub(super) text: &'a str,
    pub(super) effects: Effects,
    pub(super) output: (&'a Path, bool),
    pub(super) json: Option<&'a Path>,
    pub(super) is_partial_wanted: bool,
}

/// `murmuration extend` of packets.
pub(super) fn extend(
    request: &PacketRequest,
    adding: &Adding<'_>,
    stopper: &Stopper,
) -> Result<(), Failure> {
    let effects = (&adding.effects, adding.is_partial_wanted);
    let watching = Watching::new(Some(stopper));
    let extended = network::extend(request, (adding.config, adding.text), effects, &watching);
    let ExtendedExperiment { text, added, answer } = extended.map_err(|error| match error {
        PacketError::Stopped(Stopped::Search) => stopper.refuse_partial(
            "Give it more time, or add the effects that were accepted until then with --partial",
        ),
        error => failure(error),
    })?;
    let (output, replace) = adding.output;
    write_new("--output", output, replace, &text)?;
    let parts: Vec<String> = added
        .iter()
        .map(|(candidate, fitted)| {
            format!("{}, {}", candidate.name, network::parameter_text(candidate, fitted))
        })
        .collect();
    say(format!(
        "{}: added {}. Consistency of the packets with the model: p = {:.3} before, {:.3} after",
        output.display(),
        parts.join("; "),
        answer.p_value[0],
        answer.p_value[1]
    ));
    write_json(adding.json, &answer)
}
