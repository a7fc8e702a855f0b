//! Link samples, one row per frame sent and possible receiver; and aggregated link tables, one row per link and channel.

mod second_readings;
mod warnings;

pub use second_readings::is_named as is_reading_of_frame;

use super::ranges::RangeCheck;
use super::table::{CELL_BYTES, DataTable, covariates};
use super::time_of_day;
use super::warnings::rejection_warnings;
use super::{Rejected, Rejections, TWICE, first_rejection, to_u32};
use proto::effect::CONSTANT;
use std::collections::BTreeSet;

/// Measurements of links: a row per frame and possible receiver, or per several frames.
#[derive(Clone, Debug)]
pub struct LinkSamples {
    /// What could be used, in the order of the file.
    pub rows: Vec<LinkRow>,
    /// Every other numeric column that says anything: a value per row, NaN where it is missing.
    pub covariates: Vec<(String, Vec<f64>)>,
    /// What could not be used.
    pub rejected: Vec<Rejected>,
    /// What was seen in the file, and what it does to an answer.
    pub warnings: Vec<String>,
    /// Number of rows in the file, used or not.
    pub n_rows: usize,
    /// What a row is: one frame, or several that are summed up.
    pub readings: Readings,
    /// Whether frames that were lost were logged, as the file states it.
    pub losses_logged: Option<bool>,
}

/// What the rows of a file have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    /// Rows sum up several frames.
    pub is_aggregated: bool,
    /// Readings are rounded to whole multiples of this (dB); 0: they are not.
    pub quantum_db: f64,
    /// What is known of frames that were lost.
    pub losses: Losses,
    /// They are taken for the levels at which frames arrived: what is received is predicted from them.
    pub is_given: bool,
}

impl Readings {
    /// It is known which frames were lost.
    #[must_use]
    pub fn has_losses(&self) -> bool {
        self.losses == Losses::Logged
    }

    /// A reading is one of a frame that was received: the stronger ones of a weak link.
    #[must_use]
    pub fn is_of_received(&self) -> bool {
        self.losses != Losses::Ignored
    }
}

/// What rows say of the frames that were lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Losses {
    /// Which were lost. How many were is part of what a model predicts.
    Logged,
    /// Nothing: frames that were received were logged, and no others. A reading tells of its level under the condition that the frame
    /// was received.
    NotLogged,
    /// Nothing, and readings are taken as if the level did not decide over reception.
    Ignored,
}

/// A row: a frame, or several of one link and channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkRow {
    /// Line of the file that the row stands on, for messages.
    pub line: usize,
    /// From the start of the campaign (s); NaN where unknown.
    pub time_s: f64,
    /// Number of the campaign that it belongs to; time starts anew in each.
    pub run: u32,
    /// Number of the node that sends.
    pub tx: u32,
    /// Number of the node that may receive.
    pub rx: u32,
    /// IEEE 802.15.4 channel, if it is known.
    pub channel: Option<u8>,
    /// Place of the sender's antenna (m); NaN where unknown.
    pub tx_m: [f64; 3],
    /// Place of the receiver's antenna (m); NaN where unknown.
    pub rx_m: [f64; 3],
    /// Where the sender faces (rad); NaN where unknown.
    pub tx_heading_rad: f64,
    /// Where the receiver faces (rad); NaN where unknown.
    pub rx_heading_rad: f64,
    /// Reading, or mean of the readings (dBm); NaN where no frame was received.
    pub rssi_dbm: f64,
    /// Number of frames that were sent.
    pub frames: f64,
    /// Frames received; NaN where unknown.
    pub received: f64,
}

/// Columns of both shapes.
const COMMON: [&str; 4] = ["time_s", "tx", "rx", "rssi_dbm"];
/// Columns with a meaning of their own, which are no covariates.
pub const KNOWN: [&str; 24] = [
    "time_s",
    LOSSES_LOGGED,
    time_of_day::START,
    "tx",
    "rx",
    "rssi_dbm",
    "channel",
    "received",
    "frames",
    "pdr",
    "rssi_sd_db",
    "run",
    "tx_x_m",
    "tx_y_m",
    "tx_z_m",
    "rx_x_m",
    "rx_y_m",
    "rx_z_m",
    "tx_heading_rad",
    "rx_heading_rad",
    SEQUENCE[0],
    SEQUENCE[1],
    SEQUENCE[2],
    SEQUENCE[3],
];
/// Whether frames that were lost were logged, 1 or 0 in every row.
pub const LOSSES_LOGGED: &str = "losses_logged";
/// Readings above this (dBm) are no readings of a radio.
const GREATEST_DBM: f64 = 20.0;
/// Headings beyond this (rad) are degrees.
const GREATEST_RAD: f64 = 6.4;

/// Whether a table has the shape of link samples or of an aggregated link table; otherwise the columns it lacks for that.
///
/// # Errors
///
/// The columns it lacks.
pub fn has_shape(table: &DataTable) -> Result<(), Vec<String>> {
    let mut lacking: Vec<String> = COMMON
        .iter()
        .filter(|name| table.column(name).is_none())
        .map(|name| (*name).to_owned())
        .collect();
    let is_there = |name| table.column(name).is_some();
    if !(is_there("received") || is_there("frames") && is_there("pdr")) {
        lacking.push("received (or frames and pdr)".to_owned());
    }
    if lacking.is_empty() { Ok(()) } else { Err(lacking) }
}

/// Reads link samples or an aggregated link table.
///
/// # Errors
///
/// What makes the whole file useless, in words for its author.
pub fn read(table: &DataTable) -> Result<LinkSamples, String> {
    if let Err(lacking) = has_shape(table) {
        return Err(table.lacking("link samples", &lacking));
    }
    // Beside the rows, the covariates, and the 15 numbers by which a row is found again, with what keeps them in order.
    let n_numbers = table.names().len() + 1 + 26;
    table.check_memory(size_of::<LinkRow>() + CELL_BYTES * n_numbers, "links")?;
    let n_rows = table.n_rows();
    let column = |name: &str| table.column(name);
    let cell = |column: Option<&[f64]>, row: usize| column.map_or(f64::NAN, |column| column[row]);
    let is_aggregated = column("received").is_none();
    let mut warnings = Vec::new();
    let readings = column("rssi_dbm").unwrap_or_default();
    let n_readings = readings.iter().filter(|rssi| rssi.is_finite()).count();
    let n_positive = readings.iter().filter(|&&rssi| 0.0 < rssi).count();
    if n_readings < 2 * n_positive {
        return Err(format!(
            "rssi_dbm is positive in {n_positive} of {n_readings} rows; RSSI readings in dBm are negative (about -100 to \
             -20). Check the sign and the unit"
        ));
    }
    let headings = |name: &str, warnings: &mut Vec<String>| {
        let values = column(name)?;
        let greatest = values.iter().filter(|v| v.is_finite()).fold(0.0f64, |m, v| m.max(v.abs()));
        if GREATEST_RAD < greatest {
            warnings.push(format!(
                "{name} reaches {greatest}, beyond the range of headings in rad (-3.15 to 6.29); if it is in degrees, \
                 convert it. The column is ignored, so antenna patterns cannot be tested"
            ));
            return None;
        }
        Some(values)
    };
    let tx_heading = headings("tx_heading_rad", &mut warnings);
    let rx_heading = headings("rx_heading_rad", &mut warnings);

    // Readings have a range of their own; headings are refused as a whole.
    let mut ranges = RangeCheck::new(table, &["rssi_dbm", "tx_heading_rad", "rx_heading_rad"]);
    let mut rejections = Rejections::default();
    let mut rows: Vec<LinkRow> = Vec::with_capacity(n_rows);
    let mut kept: Vec<usize> = Vec::with_capacity(n_rows);
    let mut seen = BTreeSet::new();
    let are_times_known = column("time_s").is_some_and(has_times);
    let sequence = SEQUENCE.iter().find_map(|name| column(name));
    let single_channels = if is_aggregated { single_channels(table) } else { BTreeSet::new() };
    let mut untold = Untold::default();
    for index in 0..n_rows {
        let line = table.line(index);
        if let Some(reason) = ranges.refusal(index, line) {
            rejections.add(&reason, line);
            continue;
        }
        let number = |name: &str| cell(column(name), index);
        let row = LinkRow {
            line,
            time_s: number("time_s"),
            run: to_u32(number("run")).unwrap_or(0),
            tx: 0,
            rx: 0,
            channel: None,
            tx_m: [number("tx_x_m"), number("tx_y_m"), number("tx_z_m")],
            rx_m: [number("rx_x_m"), number("rx_y_m"), number("rx_z_m")],
            tx_heading_rad: cell(tx_heading, index),
            rx_heading_rad: cell(rx_heading, index),
            rssi_dbm: number("rssi_dbm"),
            frames: if is_aggregated { number("frames") } else { 1.0 },
            received: if is_aggregated {
                number("frames") * number("pdr")
            } else {
                number("received")
            },
        };
        match checked(row, number("tx"), number("rx"), number("channel"), is_aggregated) {
            Ok(row)
                if row.channel.is_none() && single_channels.contains(&link_at(table, index)) =>
            {
                rejections.add(SUM_OVER_CHANNELS, line);
            }
            Ok(row) => {
                // The same frame twice says nothing twice.
                let key = [row.time_s, f64::from(row.run), row.rssi_dbm, row.received]
                    .map(f64::to_bits)
                    .to_vec();
                let place = [row.tx_m, row.rx_m].concat().into_iter().map(f64::to_bits);
                let key: Vec<u64> = key
                    .into_iter()
                    .chain(place)
                    .chain([u64::from(row.tx), u64::from(row.rx)])
                    .chain([u64::from(row.channel.unwrap_or(0)), row.frames.to_bits()])
                    .chain([cell(sequence, index).to_bits()])
                    .collect();
                let is_new = seen.insert(key);
                if row.time_s.is_finite() && are_times_known && !is_new {
                    rejections.add(TWICE, line);
                } else {
                    if !is_new && sequence.is_none() {
                        untold.add(line);
                    }
                    rows.push(row);
                    kept.push(index);
                }
            }
            Err(reason) => rejections.add(&reason, line),
        }
    }

    let quantum_db = quantum(&rows, is_aggregated);
    let covariates = covariates(table, &KNOWN, &kept, &mut warnings, |name| {
        if name == CONSTANT {
            return Some(format!(
                "the column {CONSTANT} is ignored, because answers use this name for what is the same in every row; rename \
                 the column"
            ));
        }
        let values = column(name)?;
        let values: Vec<f64> = kept.iter().map(|&row| values[row]).collect();
        second_readings::is_one(name, &values, &rows, quantum_db).then(|| {
            format!(
                "{name} is another reading of the received frame, with the errors of rssi_dbm in it, and no cause of them; the column \
                 is not tested"
            )
        })
    });
    let (frames, received) = counts(&rows);
    if !rows.is_empty() && 0.0 < frames && frames <= received && column(LOSSES_LOGGED).is_none() {
        warnings.push(format!(
            "every frame was received, so effects on reception cannot be tested; frames that were lost may be missing from \
             the file. Say which with --losses, or in a column {LOSSES_LOGGED}"
        ));
    }
    warnings.extend(untold.warning());
    warnings.extend(ranges.warnings());
    warnings.extend(warnings::link_warnings(&rows));
    warnings.extend(rejection_warnings(&rejections.clone().into_list(), n_rows));
    if let Some(reason) = warnings::stuck_register(&rows) {
        return Err(reason);
    }
    let losses = losses(&rows);
    let losses_logged = column(LOSSES_LOGGED).map(stated_losses).transpose()?;
    let readings = Readings { is_aggregated, quantum_db, losses, is_given: false };
    let links = LinkSamples {
        covariates,
        rejected: rejections.into_list(),
        warnings,
        n_rows,
        readings,
        losses_logged,
        rows,
    };
    if links.rows.iter().all(|row| row.rssi_dbm.is_nan()) {
        return Err(format!(
            "no frame was received in {} usable rows, so there is no RSSI reading to compare with{}",
            links.rows.len(),
            first_rejection(&links.rejected)
        ));
    }
    Ok(links)
}

const SUM_OVER_CHANNELS: &str =
    "it is the mean over channels that have rows of their own at the same time";

/// Run, time, sender and receiver of a row.
fn link_at(table: &DataTable, row: usize) -> [u64; 4] {
    ["run", "time_s", "tx", "rx"]
        .map(|name| table.column(name).map_or(f64::NAN, |column| column[row]).to_bits())
}

/// The links and times that have rows of single channels, if the table has rows over all channels as well: these frames would count
/// twice.
fn single_channels(table: &DataTable) -> BTreeSet<[u64; 4]> {
    let Some(channels) = table.column("channel") else { return BTreeSet::new() };
    if !channels.iter().any(|channel| channel.is_nan()) {
        return BTreeSet::new();
    }
    let is_single = |&row: &usize| channels[row].is_finite();
    (0..table.n_rows()).filter(is_single).map(|row| link_at(table, row)).collect()
}

/// Whether times differ, so that equal rows of one time are one frame.
fn has_times(times_s: &[f64]) -> bool {
    let mut known = times_s.iter().copied().filter(|time_s| time_s.is_finite());
    known.next().is_some_and(|first_s| known.any(|time_s| time_s != first_s))
}

/// Columns that number the frames of a sender. They tell frames apart, and are no covariates.
const SEQUENCE: [&str; 4] = ["sequence", "seq", "seqno", "sequence_number"];

/// Rows that equal earlier ones, and of which neither time nor sequence number says whether they are of another frame.
#[derive(Clone, Copy, Debug, Default)]
struct Untold {
    n_rows: usize,
    first_line: usize,
}

impl Untold {
    fn add(&mut self, line: usize) {
        if self.n_rows == 0 {
            self.first_line = line;
        }
        self.n_rows += 1;
    }

    fn warning(self) -> Option<String> {
        (0 < self.n_rows).then(|| {
            format!(
                "{} rows equal earlier rows, the first on line {}, and neither time_s nor a sequence number tells whether they are other \
                 frames. They are used; if they are copies, intervals are too narrow. Rows of unknown time count as so many \
                 as differ",
                self.n_rows, self.first_line
            )
        })
    }
}

/// What the column [`LOSSES_LOGGED`] says.
fn stated_losses(values: &[f64]) -> Result<bool, String> {
    match values.first() {
        Some(&first)
            if [0.0, 1.0].contains(&first) && values.iter().all(|&value| value == first) =>
        {
            Ok(first == 1.0)
        }
        _ => Err(format!(
            "{LOSSES_LOGGED} must be 1 in every row (lost frames were logged) or 0 in every row (they were not)"
        )),
    }
}

/// Frames sent and received, of rows that say both.
fn counts(rows: &[LinkRow]) -> (f64, f64) {
    rows.iter()
        .filter(|row| row.received.is_finite())
        .fold((0.0, 0.0), |(frames, received), row| (frames + row.frames, received + row.received))
}

/// What rows say of frames that were lost: which were, if some were and some were not, or nothing.
#[must_use]
pub fn losses(rows: &[LinkRow]) -> Losses {
    let (frames, received) = counts(rows);
    if 0.0 < received && received < frames { Losses::Logged } else { Losses::Ignored }
}

/// A row with numbers of motes and channel, or why it cannot be used.
fn checked(
    row: LinkRow,
    tx: f64,
    rx: f64,
    channel: f64,
    is_aggregated: bool,
) -> Result<LinkRow, String> {
    let mote = |name: &str, number: f64| {
        to_u32(number).ok_or_else(|| {
            if number.is_nan() {
                format!("{name} is missing")
            } else {
                format!("{name} is not a mote number")
            }
        })
    };
    let (tx, rx) = (mote("tx", tx)?, mote("rx", rx)?);
    if tx == rx {
        return Err("tx and rx are the same mote".to_owned());
    }
    let channel = match to_u32(channel) {
        Some(channel @ 11..=26) => Some(channel as u8),
        None if channel.is_nan() => None,
        _ => return Err("channel is not a whole number from 11 to 26".to_owned()),
    };
    if GREATEST_DBM < row.rssi_dbm || row.rssi_dbm < -200.0 {
        return Err(format!("rssi_dbm is not from -200 to {GREATEST_DBM}"));
    }
    if is_aggregated {
        if !(1.0 <= row.frames && row.frames.fract() == 0.0) {
            return Err("frames is not a whole number of at least 1".to_owned());
        }
        if !row.received.is_nan() && !(0.0..=row.frames).contains(&row.received) {
            return Err("pdr is not from 0 to 1".to_owned());
        }
        if 0.0 < row.received && row.rssi_dbm.is_nan() {
            return Err("frames were received, but rssi_dbm is missing".to_owned());
        }
        if row.received.is_nan() && row.rssi_dbm.is_nan() {
            return Err("pdr and rssi_dbm are both missing".to_owned());
        }
    } else {
        match row.received {
            1.0 if row.rssi_dbm.is_nan() => {
                return Err("received is 1, but rssi_dbm is missing".to_owned());
            }
            0.0 if row.rssi_dbm.is_finite() => {
                return Err("received is 0, but rssi_dbm is present".to_owned());
            }
            0.0 | 1.0 => {}
            received if received.is_nan() => return Err("received is missing".to_owned()),
            _ => return Err("received is not 0 or 1".to_owned()),
        }
    }
    let received = if is_aggregated { row.received.round() } else { row.received };
    Ok(LinkRow { tx, rx, channel, received, ..row })
}

/// The step of the readings: 1 where they are whole dB, 0 where they are not.
fn quantum(rows: &[LinkRow], is_aggregated: bool) -> f64 {
    let mut readings = rows.iter().map(|row| row.rssi_dbm).filter(|rssi| rssi.is_finite());
    if !is_aggregated && readings.all(|rssi| rssi.fract() == 0.0) { 1.0 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_sequence_number_tells_frames_of_one_time_apart_and_is_no_covariate() {
        let rows =
            "0,1,2,-70,1,5\n1,1,2,-71,1,6\n1,1,2,-71,1,7\n1,1,2,-71,1,7\n2,1,2,,0,8\n2,1,2,,0,9\n";
        let text = format!("time_s,tx,rx,rssi_dbm,received,sequence\n{rows}");
        let table = DataTable::of_csv(Path::new("links.csv"), text.as_bytes()).unwrap();
        let links = read(&table).unwrap();
        assert_eq!((links.rows.len(), links.rejected[0].rows), (5, 1));
        assert!(links.covariates.is_empty(), "{:?}", links.covariates);
    }

    /// Warnings of jumps on links of one mote to another, a row every 10 ms; `x_m`: where the sender is, by row.
    fn jumps(x_m: impl Fn(usize) -> f64) -> Vec<String> {
        let rows: String = (0..600)
            .map(|row| {
                let level_dbm = -70 - (row % 3) as i32;
                format!("{},1,2,{},0,50,0,{level_dbm},1\n", 0.01 * row as f64, x_m(row))
            })
            .collect();
        let text = format!("time_s,tx,rx,tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm,received\n{rows}");
        let table = DataTable::of_csv(Path::new("links.csv"), text.as_bytes()).unwrap();
        let warnings = read(&table).unwrap().warnings;
        warnings.into_iter().filter(|warning| warning.contains("position jumps")).collect()
    }

    #[test]
    fn positions_that_hold_for_a_step_are_no_jumps_and_exchanged_ones_are() {
        // 30 m/s, measured ten times a second.
        assert_eq!(jumps(|row| 3.0 * (row / 10) as f64), [""; 0]);
        // The same, with the ends of a row exchanged.
        let exchanged = |row: usize| if row == 300 { 50.0 } else { 3.0 * (row / 10) as f64 };
        assert_eq!(jumps(exchanged).len(), 1);
        // Motes that stand still, with the ends of the later half exchanged.
        assert_eq!(jumps(|row| if row < 300 { 0.0 } else { 50.0 }).len(), 1);
    }
}
