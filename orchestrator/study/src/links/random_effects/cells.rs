//! Which rows share a random level.

use super::{RowCells, Scales};
use crate::folds::scramble;
use crate::links::rows::ModelledLinks;
use crate::links::rows::blocks::{pair, square};
use crate::thresholds::{
    COMMON_SPAN, DRIFT_TIMES_S, FEWEST_DRIFT_LEVELS, LEAST_COMMON_SPAN, MOST_DRIFT_LEVELS,
};
use measure::links::LinkRow;
use std::collections::BTreeMap;

/// Half a wavelength at 2.44 GHz (m).
pub(in crate::links) const HALF_WAVE_M: f64 = 0.0614;
/// The side of the squares whose rows share a level, in such lengths. Two places share a square of side s with a chance that falls
/// as 1 - way / s, whose integral is s / 2; that of e^(-way / length) is the length.
const SIDE: f64 = 2.0;
/// That of levels which fading leaves to links (m): squares of half a wave.
pub(in crate::links) const FINEST_M: f64 = HALF_WAVE_M / SIDE;

/// From the first row to the last (s).
fn length_s(rows: &ModelledLinks) -> f64 {
    let times_s = || rows.links.rows.iter().map(|row| row.time_s);
    times_s().fold(f64::NEG_INFINITY, f64::max) - times_s().fold(f64::INFINITY, f64::min)
}

/// Times over which levels may drift in the course of these rows (s).
pub(in crate::links) fn drift_times_s(rows: &ModelledLinks) -> Vec<f64> {
    let length_s = length_s(rows);
    let suits = |time_s: &f64| {
        let n_levels = length_s / (SIDE * time_s);
        (FEWEST_DRIFT_LEVELS..=MOST_DRIFT_LEVELS).contains(&n_levels)
    };
    let suiting: Vec<f64> = DRIFT_TIMES_S.into_iter().filter(suits).collect();
    // Where none suits, one that is a twentieth of the whole.
    if suiting.is_empty() && 0.0 < length_s { vec![0.05 * length_s] } else { suiting }
}

/// A span of time: its campaign, and its number.
pub(in crate::links) type Span = (u32, i64);

/// The span of time, of the campaign of each row, of a length (s), from the first row of the campaign; the same for all rows where there
/// is none.
pub(in crate::links) fn spans(rows: &ModelledLinks, span_s: Option<f64>) -> Vec<Span> {
    let measured = &rows.links.rows;
    let Some(span_s) = span_s else { return vec![(0, 0); measured.len()] };
    let mut first_s: BTreeMap<u32, f64> = BTreeMap::new();
    for row in measured {
        let first_s = first_s.entry(row.run).or_insert(f64::INFINITY);
        *first_s = first_s.min(row.time_s);
    }
    let number = |row: &LinkRow| ((row.time_s - first_s[&row.run]) / span_s).floor() as i64;
    measured.iter().map(|row| (row.run, number(row))).collect()
}

/// Spans of time in which all links share a level that drifts over a time (s): of each row, and how each is correlated with that
/// before.
fn spans_of_drift(rows: &ModelledLinks, correlation_s: f64) -> (Vec<u32>, Vec<f64>) {
    let length_s = length_s(rows);
    let span_s = (COMMON_SPAN * correlation_s).max(LEAST_COMMON_SPAN * length_s);
    let spans = spans(rows, Some(span_s));
    let mut sorted = spans.clone();
    sorted.sort_unstable();
    sorted.dedup();
    let apart = |before: &Span, after: &Span| {
        let apart_s = (after.1 - before.1) as f64 * span_s;
        if before.0 == after.0 { libm::exp(-apart_s / correlation_s) } else { 0.0 }
    };
    let later = sorted.windows(2).map(|pair| apart(&pair[0], &pair[1]));
    let correlations = sorted.first().map(|_| 0.0).into_iter().chain(later).collect();
    (numbered(&spans).0, correlations)
}

/// Cells of random levels.
pub(in crate::links) fn cells_of(rows: &ModelledLinks, scales: Scales) -> RowCells {
    let side_m = SIDE * scales.decorrelation_m;
    let ids: Vec<u32> = rows.still().keys().copied().collect();
    let node = |id: u32| ids.binary_search(&id).unwrap_or_default() as u32;
    let places = |row: usize, side_m: f64| {
        let (tx, rx) = rows.ends(row);
        let (low, high) = if tx.id < rx.id { (tx, rx) } else { (rx, tx) };
        [low, high].iter().fold(0u64, |key, end| {
            if rows.still().get(&end.id.0).copied().unwrap_or(true) {
                key
            } else {
                scramble(key ^ square(rows, end.position_m, side_m))
            }
        })
    };
    let links: Vec<(u64, u64)> = (0..rows.len())
        .map(|row| {
            let measured = &rows.links.rows[row];
            (pair(measured.tx, measured.rx), places(row, side_m))
        })
        .collect();
    let (link, n_links) = numbered(&links);
    // Links drift on all channels alike.
    let spans = spans(rows, scales.link_drift_s.map(|time_s| SIDE * time_s));
    let channels: Vec<(u32, (u8, u64), Span)> = (0..rows.len())
        .map(|row| {
            let fine = || {
                let channel = rows.links.rows[row].channel.unwrap_or(0);
                (channel, places(row, HALF_WAVE_M))
            };
            let fine = if scales.link_drift_s.is_some() { (0, 0) } else { fine() };
            (link[row], fine, spans[row])
        })
        .collect();
    let (channel, n_channels) = numbered(&channels);
    let mut link_of_channel = vec![0; n_channels];
    for (row, &cell) in channel.iter().enumerate() {
        link_of_channel[cell as usize] = link[row];
    }
    let nodes = rows.links.rows.iter().map(|row| (node(row.tx), node(row.rx))).collect();
    let (times, correlations) = match scales.drift_s {
        Some(correlation_s) => spans_of_drift(rows, correlation_s),
        None => (Vec::new(), Vec::new()),
    };
    let n_nodes = ids.len();
    RowCells { link, channel, link_of_channel, n_links, nodes, n_nodes, times, correlations }
}

/// Numbers keys in the order in which they sort.
fn numbered<T: Ord + Clone>(keys: &[T]) -> (Vec<u32>, usize) {
    let mut sorted = keys.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    let number = |key: &T| sorted.binary_search(key).unwrap_or_default() as u32;
    (keys.iter().map(number).collect(), sorted.len())
}
