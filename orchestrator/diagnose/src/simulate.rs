//! The campaign that a model would have measured: at the rows of a file, by the radio or the dynamics of a configuration.
//!
//! Links go through the same [`Model::evaluate_at`](physics::Model::evaluate_at) as those of a running simulation, with
//! levels drawn by the same keys; robots through the same
//! [`Physics::advance`](robotsim::dynamics::physics::Physics::advance).

pub mod simulation;

use crate::ladder::Search;
use measure::config::Compared;
use measure::links::LinkRow;
use measure::table::DataTable;
use numbers::format::trimmed;
use numbers::power::square;
use physics::scatter::{Moment, PairBlock};
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose};
use std::collections::BTreeMap;
use study::COMMON;
use study::choices::Choices;
use study::links::LinkStudy;
use study::links::rows::ModelledLinks;
use study::open::{self, OpenError, Subject};

/// A campaign that was never measured.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// The file's columns, in its order, with what would have been measured in place of what was.
    pub names: Vec<String>,
    /// A value per row; NaN where there is none.
    pub columns: Vec<Vec<f64>>,
    /// What was taken for the noise: of readings (dB) or of positions (m).
    pub noise: f64,
    /// Whether that was estimated from the file, because the configuration does not say it.
    pub is_noise_estimated: bool,
    /// Rows of the file that could not be used, and are not written.
    pub n_left_out: usize,
    /// Unit of the noise.
    pub unit: &'static str,
}

/// Simulates a campaign at the rows of `table`.
///
/// * `noise`: standard deviation of the noise, where the configuration does not say it; else it is estimated from the file,
///   which takes what the model lacks for noise.
///
/// # Errors
///
/// What is wrong with either file, in words for its author.
pub fn simulate(
    config: &Compared,
    table: &DataTable,
    seed: u64,
    noise: Option<f64>,
) -> Result<Simulated, OpenError> {
    match open::subject(table)? {
        Subject::Links => links(config, table, seed, noise),
        Subject::Robots => robots(config, table, seed, noise),
    }
}

/// What is taken for the noise of a file, of readings (dB) or of positions (m): what the configuration says, else what the
/// model leaves of the rows that are chosen.
///
/// # Errors
///
/// What is wrong with either file or the choices, in words for their author.
pub fn noise(config: &Compared, table: &DataTable, choices: &Choices) -> Result<f64, OpenError> {
    match open::subject(table)? {
        Subject::Links => {
            let (study, _) = open::links(config, table, choices)?;
            Ok(configured_noise(config, &study)?.unwrap_or_else(|| estimated_db(&study)))
        }
        Subject::Robots => {
            let (study, _) = open::robots(config, table, choices)?;
            Ok(open::localization_sd_m(config).unwrap_or_else(|| study.configured().sd_m()))
        }
    }
}

/// The noise of readings that a model leaves (dB).
fn estimated_db(study: &LinkStudy) -> f64 {
    Search::new(study, &|_| {}).full_fit(&[], COMMON, None).instrument.sd_db
}

fn links(
    config: &Compared,
    table: &DataTable,
    seed: u64,
    noise: Option<f64>,
) -> Result<Simulated, OpenError> {
    let (study, _) = open::links(config, table, &Choices::NONE)?;
    let given = configured_noise(config, &study)?;
    let sd_db = given.or(noise).unwrap_or_else(|| estimated_db(&study));
    // The model with that noise in it.
    let with_noise;
    let rows = if given.is_some() {
        &study.rows
    } else {
        let set = format!("netsim.phy.noise_sd_db={sd_db:?}");
        let config = config.with_key(&set)?;
        with_noise = open::links(&config, table, &Choices::NONE)?.0;
        &with_noise.rows
    };
    let drawn = FrameDraws::new(rows, seed).draw_all();
    let (mut names, mut columns) = copied(table, rows.links.rows.iter().map(|row| row.line));
    let mut put = |name: &str, values: Vec<f64>| {
        if let Some(place) = names.iter().position(|other| other == name) {
            columns[place] = values;
        } else if name == "rssi_dbm" {
            names.push(name.to_owned());
            columns.push(values);
        }
    };
    put("rssi_dbm", drawn.iter().map(|frames| frames.mean_dbm).collect());
    put("received", drawn.iter().map(|frames| frames.n_received).collect());
    put("rssi_sd_db", drawn.iter().map(|frames| frames.sd_db).collect());
    let sent = rows.links.rows.iter().map(|row| row.frames);
    put("pdr", drawn.iter().zip(sent).map(|(frames, sent)| frames.n_received / sent).collect());
    let n_left_out = rows.links.n_rows - rows.len();
    let is_noise_estimated = given.is_none() && noise.is_none();
    Ok(Simulated { names, columns, noise: sd_db, is_noise_estimated, n_left_out, unit: "dB" })
}

/// The noise that the configuration gives (dB).
fn configured_noise(config: &Compared, study: &LinkStudy) -> Result<Option<f64>, OpenError> {
    let n_motes = study.rows.links.rows.iter().map(|row| row.tx.max(row.rx) as usize + 1).max();
    let (_, effective) = config.radio(n_motes.unwrap_or(1))?;
    let sd_db = effective.get("noise_sd_db").and_then(toml::Value::as_float);
    Ok(sd_db.filter(|sd_db| 0.0 < *sd_db))
}

/// The columns of a file at the rows on these lines.
fn copied(table: &DataTable, lines: impl Iterator<Item = usize>) -> (Vec<String>, Vec<Vec<f64>>) {
    let first = table.line(0);
    let rows: Vec<usize> = lines.map(|line| line - first).collect();
    let names = table.names().to_vec();
    let columns = names
        .iter()
        .map(|name| {
            let column = table.column(name).unwrap_or_default();
            rows.iter().map(|&row| column[row]).collect()
        })
        .collect();
    (names, columns)
}

/// The simulated frames of a row, summed up.
#[derive(Clone, Copy, Debug)]
struct ReceivedFrames {
    n_received: f64,
    /// Mean reading; NaN where no frame was received.
    mean_dbm: f64,
    /// Standard deviation of the readings; NaN of fewer than two.
    sd_db: f64,
}

/// Draws the frames of all rows.
struct FrameDraws<'a> {
    rows: &'a ModelledLinks,
    seed: u64,
    /// The way that each mote has travelled until each row of it, by row: of the sender and of the receiver (m).
    ways_m: Vec<[f64; 2]>,
}

impl<'a> FrameDraws<'a> {
    fn new(rows: &'a ModelledLinks, seed: u64) -> Self {
        Self { rows, seed, ways_m: ways(&rows.links.rows) }
    }

    fn draw_all(&self) -> Vec<ReceivedFrames> {
        // Of frames of one link at one moment each has draws of its own.
        let mut sent: BTreeMap<(u32, u32, u64), u64> = BTreeMap::new();
        (0..self.rows.len())
            .map(|row| {
                let measured = &self.rows.links.rows[row];
                let time_ns = (measured.time_s.max(0.0) * 1e9) as u64;
                let before = sent.entry((measured.tx, measured.rx, time_ns)).or_default();
                let first_ns = time_ns + *before;
                let n_frames = measured.frames as u64;
                *before += n_frames;
                self.draw_row(row, first_ns, n_frames)
            })
            .collect()
    }

    /// Frames of a row: the first at this time, the others each a nanosecond later.
    fn draw_row(&self, row: usize, first_ns: u64, n_frames: u64) -> ReceivedFrames {
        let measured = &self.rows.links.rows[row];
        let (tx, rx) = (measured.tx, measured.rx);
        let quantum_db = self.rows.links.readings.quantum_db;
        let [tx_m, rx_m] = self.ways_m[row];
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        self.rows.link(row, |link| {
            let model = &self.rows.model;
            for frame in 0..n_frames {
                let sent_ns = first_ns + frame;
                let mut block = PairBlock::new(self.seed, MoteId(tx), MoteId(rx), sent_ns);
                let at = Moment {
                    period_ns: sent_ns,
                    sent_ns,
                    way_m: tx_m + rx_m,
                    channel: measured.channel,
                };
                let scatter_db: f64 = model
                    .scatters()
                    .iter()
                    .map(|scatter| scatter.value_db(&mut block, MoteId(tx), MoteId(rx), at))
                    .sum();
                let budget = model.evaluate_at(link, scatter_db);
                if block.reception(MoteId(tx), MoteId(rx)) < budget.reception_probability {
                    let mut reading = budget.register_rssi_dbm;
                    if 0.0 < quantum_db {
                        reading = (reading / quantum_db).round() * quantum_db;
                    }
                    n += 1.0;
                    sum += reading;
                    squares += reading * reading;
                }
            }
        });
        let mean_dbm = if 0.0 < n { sum / n } else { f64::NAN };
        let variance = (squares - n * mean_dbm * mean_dbm).max(0.0) / (n - 1.0);
        ReceivedFrames {
            n_received: n,
            mean_dbm,
            sd_db: if 1.0 < n { variance.sqrt() } else { f64::NAN },
        }
    }
}

/// The way that sender and receiver of each row have travelled since they were first seen in its campaign (m).
fn ways(rows: &[LinkRow]) -> Vec<[f64; 2]> {
    type Place = (f64, [f64; 3]);
    let mut tracks: BTreeMap<(u32, u32), Vec<Place>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.time_s.is_finite()) {
        for (mote, place) in [(row.tx, row.tx_m), (row.rx, row.rx_m)] {
            tracks.entry((row.run, mote)).or_default().push((row.time_s, place));
        }
    }
    let mut travelled: BTreeMap<(u32, u32), Vec<(f64, f64)>> = BTreeMap::new();
    for (key, mut track) in tracks {
        track.sort_by(|a, b| a.0.total_cmp(&b.0));
        track.dedup_by(|a, b| a.0.total_cmp(&b.0).is_eq());
        let mut way_m = 0.0;
        let mut last = track[0].1;
        let list = track.into_iter().map(|(time_s, place)| {
            let step: f64 = (0..3).map(|k| square(place[k] - last[k])).sum::<f64>().sqrt();
            way_m += if step.is_finite() { step } else { 0.0 };
            last = place;
            (time_s, way_m)
        });
        travelled.insert(key, list.collect());
    }
    let way = |row: &LinkRow, mote: u32| {
        let list = travelled.get(&(row.run, mote))?;
        let after = list.partition_point(|(time_s, _)| *time_s < row.time_s);
        list.get(after).map(|(_, way_m)| *way_m)
    };
    rows.iter().map(|row| [row.tx, row.rx].map(|mote| way(row, mote).unwrap_or_default())).collect()
}

fn robots(
    config: &Compared,
    table: &DataTable,
    seed: u64,
    noise: Option<f64>,
) -> Result<Simulated, OpenError> {
    let (study, account) = open::robots(config, table, &Choices::NONE)?;
    let given = open::localization_sd_m(config);
    let sd_m = given.or(noise).unwrap_or_else(|| study.configured().sd_m());
    let samples = &study.robots().samples;
    // In the order of the file.
    let mut order: Vec<usize> = (0..samples.len()).collect();
    order.sort_by_key(|&sample| samples[sample].line);
    let driven = study.driven(Draws::new(seed, Purpose::Gust));
    let noise = Draws::new(seed, Purpose::Localization);
    let (names, mut columns) = copied(table, order.iter().map(|&sample| samples[sample].line));
    for (axis, name) in ["x_m", "y_m", "z_m"].into_iter().enumerate() {
        let Some(place) = names.iter().position(|other| other == name) else { continue };
        columns[place] = order
            .iter()
            .map(|&sample| {
                let at = &samples[sample];
                // As the running simulation has it: heights are measured as they are.
                let axis_sd_m = if axis < 2 { libm::hypot(sd_m, driven.more_sd_m) } else { 0.0 };
                let time_ns = (at.time_s.max(0.0) * 1e9) as u64;
                let entity = u64::from(at.run) << 32 | u64::from(at.agent);
                driven.places_m[sample][axis]
                    + axis_sd_m * noise.normal(entity, time_ns, axis as u64)
            })
            .collect();
    }
    if study.robots().shape.is_turning()
        && let Some(place) = names.iter().position(|name| name == "heading_rad")
    {
        columns[place] = order.iter().map(|&sample| driven.headings_rad[sample]).collect();
    }
    let n_left_out = account.rows - samples.len();
    let is_noise_estimated = given.is_none() && sd_m == study.configured().sd_m();
    Ok(Simulated { names, columns, noise: sd_m, is_noise_estimated, n_left_out, unit: "m" })
}

impl Simulated {
    /// As CSV.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut csv = self.names.join(",");
        csv.push('\n');
        for row in 0..self.n_rows() {
            for (k, column) in self.columns.iter().enumerate() {
                if k != 0 {
                    csv.push(',');
                }
                if column[row].is_finite() {
                    csv.push_str(&trimmed(column[row], 9));
                }
            }
            csv.push('\n');
        }
        csv
    }

    /// Number of rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// As a table, as if it had been read from a file.
    #[must_use]
    pub fn to_table(&self) -> DataTable {
        DataTable::of_columns(self.names.clone(), self.columns.clone())
    }
}
