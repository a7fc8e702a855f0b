//! What a file of measurements holds, and which effects it can show. With a configuration, level and noise are fitted to find defects.
//!
//! | module | content |
//! |---|---|
//! | here | links and robots; `data_check` is the answer, `words` its text |
//! | `packet_check` | packets, with its answer and text |
//! | `file_check` | the answers about an experiment file and a sweep |

mod data_check;
mod file_check;
mod packet_check;
mod words;

pub use data_check::DataCheck;
use data_check::{
    CovariateFacts, Facts, LinkCounts, LinkFacts, Motes, NotTestable, RobotFacts, RowKind, SCHEMA,
};
use diagnose::{defects, identifiability};
pub use file_check::{AskedPermission, CHECK_SCHEMA, ExperimentCheck, SweepCheck};
use indexmap::IndexMap;
use measure::config::Compared;
use measure::links::LinkRow;
use measure::robots::CommandKind;
use measure::table::DataTable;
use numbers::statistics::{self, quantile_lower};
pub use packet_check::{PacketCheck, packets};
use proto::effect::Level;
use std::collections::BTreeSet;
use std::path::Path;
use study::choices::Choices;
use study::links::LinkStudy;
use study::open::{self, DataAccount, OpenError, Subject};
use study::robots::RobotStudy;
use study::thresholds::WINDOW_S;
use study::{Candidate, Study};
pub use words::text;

/// Looks at a file of measurements. Without a configuration, free space and bodies that obey at once are taken.
///
/// # Errors
///
/// What is wrong with either file, in words for its author.
pub fn data(
    config: Option<Compared>,
    table: &DataTable,
    choices: &Choices,
) -> Result<DataCheck, OpenError> {
    let is_without_configuration = config.is_none();
    let subject = open::subject(table)?;
    let config = match config {
        Some(config) => config,
        None => bare(subject, table)?,
    };
    let check = match subject {
        Subject::Links => {
            let (study, account) = open::links(&config, table, choices)?;
            // Without a configuration nothing predicts the readings.
            let defects = (!is_without_configuration).then(|| defects::listed(&study));
            let table = (!is_without_configuration).then(|| identifiability::of_links(&study));
            DataCheck {
                measurement_defects: defects,
                identifiability: table.flatten(),
                ..links(&study, account)
            }
        }
        Subject::Robots => {
            let (study, account) = open::robots(&config, table, choices)?;
            let table = (!is_without_configuration).then(|| identifiability::of_robots(&study));
            let window_s = choices.window_s.unwrap_or(WINDOW_S);
            DataCheck { identifiability: table.flatten(), ..robots(&study, account, window_s) }
        }
    };
    Ok(DataCheck { is_without_configuration, ..check })
}

/// The least configuration that suits a file.
fn bare(subject: Subject, table: &DataTable) -> Result<Compared, OpenError> {
    let text = match subject {
        Subject::Links => "[netsim.phy]\npropagation = \"friis\"\n".to_owned(),
        Subject::Robots => {
            let commands = CommandKind::of_table(table).unwrap_or(CommandKind::Velocity);
            // What is tested without a configuration does not depend on the mass.
            let mass = if commands == CommandKind::Thrust { "mass_kg = 1.0\n" } else { "" };
            format!("[robotsim.dynamics]\nkind = \"{}\"\n{mass}", commands.bodies()[0])
        }
    };
    Ok(Compared::of_text(Path::new("no configuration"), text, &[])?)
}

fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let [low, high] = statistics::range(values.filter(|value| value.is_finite()));
    (low <= high).then_some([low, high])
}

fn links(study: &LinkStudy, account: DataAccount) -> DataCheck {
    let rows = &study.rows.links.rows;
    let all: BTreeSet<u32> = rows.iter().flat_map(|row| [row.tx, row.rx]).collect();
    let still = study.still_motes();
    let links: BTreeSet<(u32, u32)> = rows.iter().map(|row| (row.tx, row.rx)).collect();
    let pairs: BTreeSet<(u32, u32)> =
        rows.iter().map(|row| (row.tx.min(row.rx), row.tx.max(row.rx))).collect();
    let channels: BTreeSet<u8> = rows.iter().filter_map(|row| row.channel).collect();
    let runs: BTreeSet<u32> = rows.iter().map(|row| row.run).collect();
    let known = || rows.iter().filter(|row| row.received.is_finite());
    let sum = |value: fn(&LinkRow) -> f64| known().map(value).sum::<f64>();
    let (frames, received) = (sum(|row| row.frames), sum(|row| row.received));
    let is_placed =
        |row: &LinkRow| [row.tx_m, row.rx_m].iter().all(|m| m[..2].iter().all(|c| c.is_finite()));
    let distances = (0..rows.len())
        .filter(|&row| is_placed(&rows[row]))
        .map(|row| study.rows.link(row, |link| link.distance_m));
    let facts = LinkFacts {
        time_s: range(rows.iter().map(|row| row.time_s)),
        runs: runs.len(),
        motes: Motes { all, still },
        links: LinkCounts { directed: links.len(), pairs: pairs.len() },
        channels,
        distance_m: range(distances),
        rssi_dbm: range(rows.iter().map(|row| row.rssi_dbm)),
        delivery: (0.0 < frames).then(|| received / frames),
        covariates: covariates(&study.rows.links.covariates),
        is_placed: rows.iter().all(is_placed),
        n_readings: rows.iter().filter(|row| row.rssi_dbm.is_finite()).count(),
        is_rounded: study.rows.links.readings.quantum_db == 1.0,
        n_frames: frames,
    };
    let is_aggregated = study.rows.links.readings.is_aggregated;
    let kind = if is_aggregated { RowKind::AggregatedLink } else { RowKind::Link };
    finished(kind, Facts::Links(facts), study, account)
}

fn robots(study: &RobotStudy, account: DataAccount, window_s: f64) -> DataCheck {
    let robots = study.robots();
    let samples = &robots.samples;
    let agents: BTreeSet<u32> = samples.iter().map(|sample| sample.agent).collect();
    let runs: BTreeSet<u32> = samples.iter().map(|sample| sample.run).collect();
    let place = |axis: usize| range(samples.iter().map(|sample| sample.position_m[axis]));
    let speeds = robots.tracks.iter().flat_map(|track| {
        samples[track.clone()].windows(2).map(|pair| {
            let [a, b] = [pair[0].position_m, pair[1].position_m];
            (b[0] - a[0]).hypot(b[1] - a[1]).hypot(b[2] - a[2]) / (pair[1].time_s - pair[0].time_s)
        })
    });
    let mut speeds: Vec<f64> = speeds.filter(|speed| speed.is_finite()).collect();
    speeds.sort_by(f64::total_cmp);
    let most_speeds = [0.01, 0.99].map(|share| quantile_lower(&speeds, share));
    let facts = RobotFacts {
        time_s: range(samples.iter().map(|sample| sample.time_s)),
        runs: runs.len(),
        agents,
        spacing_s: robots.spacing_s(),
        commands: robots.commands.describe(),
        x_m: place(0),
        y_m: place(1),
        z_m: robots.is_spatial.then(|| place(2)),
        speed_mps: (!speeds.is_empty()).then_some(most_speeds),
        windows: study.n_rows(),
        covariates: covariates(&robots.covariates),
        window_s,
    };
    finished(RowKind::Robot, Facts::Robots(facts), study, account)
}

/// Covariates with their ranges; none where there are none, or one has no value.
fn covariates(columns: &[(String, Vec<f64>)]) -> Option<IndexMap<String, CovariateFacts>> {
    let facts = columns.iter().map(|(name, values)| {
        let range = range(values.iter().copied())?;
        let missing = values.iter().filter(|value| !value.is_finite()).count();
        Some((name.clone(), CovariateFacts { range, missing }))
    });
    let facts: Option<IndexMap<String, CovariateFacts>> = facts.collect();
    facts.filter(|facts| !facts.is_empty())
}

fn finished<S: Study>(kind: RowKind, facts: Facts, study: &S, account: DataAccount) -> DataCheck {
    let blocks = [Level::Time, Level::Place]
        .map(|level| study.blocks(level))
        .map(|blocks| format!("{} {}", blocks.n_scored(), blocks.unit));
    let why = |candidate: &Candidate| match &candidate.untestable {
        Some(why) => Some(why.clone()),
        None => {
            let blocks = study.blocks(candidate.level);
            (!blocks.suffices()).then(|| {
                format!(
                    "requires at least {} {}; the data have {}",
                    blocks.fewest(),
                    blocks.unit,
                    blocks.n_scored()
                )
            })
        }
    };
    let (mut testable, mut not_testable) = (Vec::new(), Vec::new());
    for candidate in study.candidates().iter().filter(|c| c.curve_over().is_none()) {
        let effect = candidate.name.clone();
        match why(candidate) {
            None => testable.push(effect),
            Some(because) => not_testable.push(NotTestable { effect, because }),
        }
    }
    DataCheck {
        schema: SCHEMA,
        kind,
        facts,
        blocks,
        testable,
        not_testable,
        measurement_defects: None,
        identifiability: None,
        account,
        is_without_configuration: false,
    }
}
