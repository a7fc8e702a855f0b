//! Which rows belong together: blocks that are left out together, and cells that share a random level.

use super::SIDE;
use super::cells::{RowCells, Scales};
use super::rows::ModelledLinks;
use crate::choices::{ChoiceError, Choices, SplitBy};
use crate::folds::{Blocks, scramble};
use crate::thresholds::{
    COMMON_SPAN, DRIFT_TIMES_S, FEWEST_BLOCKS, FEWEST_DRIFT_LEVELS, FEWEST_PLACE_BLOCKS,
    LEAST_COMMON_SPAN, MOST_DRIFT_LEVELS, THINNED_RUN_ROWS, TIME_BLOCKS,
};
use std::collections::{BTreeMap, BTreeSet};

/// Half a wavelength at 2.44 GHz (m).
pub(super) const HALF_WAVE_M: f64 = 0.0614;

/// Rows by time in blocks of equal numbers; by pair where time is unknown or constant. Rows that are `scored` by a fit to the
/// others are in blocks of their own, as many as else of all.
fn time_blocks(rows: &ModelledLinks, scored: Option<&[bool]>) -> Blocks {
    if !has_times(rows) {
        return Blocks::of_keys("pairs of nodes", &pairs(rows));
    }
    let measured = &rows.links.rows;
    let mut order: Vec<usize> = (0..rows.len()).collect();
    let time = |row: usize| (measured[row].run, measured[row].time_s);
    order.sort_by(|&a, &b| {
        time(a).0.cmp(&time(b).0).then(time(a).1.total_cmp(&time(b).1)).then(a.cmp(&b))
    });
    let is_scored = |row: &usize| scored.is_some_and(|scored| scored[*row]);
    let parts: (Vec<usize>, Vec<usize>) = order.into_iter().partition(is_scored);
    let mut keys = vec![0u64; rows.len()];
    for (first, part) in [(0, parts.0), (TIME_BLOCKS as u64, parts.1)] {
        let n_blocks = TIME_BLOCKS.min(part.len() / 8).max(1);
        let mut block = 0;
        for (rank, &row) in part.iter().enumerate() {
            // Rows of one moment stay together.
            if rank * n_blocks / part.len() != block && time(row) != time(part[rank - 1]) {
                block = rank * n_blocks / part.len();
            }
            keys[row] = first + block as u64;
        }
    }
    Blocks::of_keys("blocks of time", &keys).in_turn()
}

/// Whether the rows were measured at so many times that blocks of time can be left out.
fn has_times(rows: &ModelledLinks) -> bool {
    let mut times: Vec<(u32, u64)> =
        rows.links.rows.iter().map(|row| (row.run, row.time_s.to_bits())).collect();
    times.sort_unstable();
    times.dedup();
    FEWEST_BLOCKS <= times.len() && rows.links.rows.iter().all(|row| row.time_s.is_finite())
}

/// Rows of links that were measured once: a link and channel is predicted from other channels and from the other direction.
/// Those of one pair of nodes depend on each other.
fn link_channel_blocks(rows: &ModelledLinks) -> Blocks {
    let measured = &rows.links.rows;
    let keys: Vec<u64> = measured
        .iter()
        .map(|row| {
            let link = (u64::from(row.tx) << 32) | u64::from(row.rx);
            scramble(link ^ scramble(u64::from(row.channel.unwrap_or(0))))
        })
        .collect();
    let clusters = Some(Blocks::of_keys("pairs of nodes", &pairs(rows)).of_row);
    Blocks { clusters, ..Blocks::of_keys("links and channels", &keys) }
}

fn pair(a: u32, b: u32) -> u64 {
    (u64::from(a.min(b)) << 32) | u64::from(a.max(b))
}

/// The unordered pair of nodes of each row, as a key.
fn pairs(rows: &ModelledLinks) -> Vec<u64> {
    rows.links.rows.iter().map(|row| pair(row.tx, row.rx)).collect()
}

/// How many unordered pairs of nodes there are.
pub(super) fn n_pairs(rows: &ModelledLinks) -> usize {
    pairs(rows).into_iter().collect::<BTreeSet<_>>().len()
}

/// How many nodes send, and how many receive.
pub(super) fn n_ends(rows: &ModelledLinks) -> [usize; 2] {
    let senders: BTreeSet<u32> = rows.links.rows.iter().map(|row| row.tx).collect();
    let receivers: BTreeSet<u32> = rows.links.rows.iter().map(|row| row.rx).collect();
    [senders.len(), receivers.len()]
}

/// Rows by unordered pair of nodes; by place where there are too few pairs.
fn place_blocks(rows: &ModelledLinks) -> Blocks {
    let by_pair = Blocks::of_keys("pairs of nodes", &pairs(rows));
    if by_pair.suffices() || rows.still().values().all(|&still| still) {
        return by_pair;
    }
    let places = blocks_of_squares(rows);
    if by_pair.n_blocks() < places.n_blocks() { places } else { by_pair }
}

/// Rows by the places of the nodes that move: the largest squares of which there are at least [`FEWEST_PLACE_BLOCKS`].
fn blocks_of_squares(rows: &ModelledLinks) -> Blocks {
    let mut best: Option<Blocks> = None;
    for side_m in [8.0, 4.0, 2.0, 1.0] {
        let keys: Vec<u64> = (0..rows.len())
            .map(|row| {
                let (tx, rx) = rows.ends(row);
                let mut key = 0u64;
                for end in [tx, rx] {
                    if !rows.still().get(&end.id.0).copied().unwrap_or(true) {
                        key = scramble(key ^ square(end.position_m, side_m));
                    }
                }
                key
            })
            .collect();
        let blocks = Blocks::of_keys("places", &keys);
        let enough = FEWEST_PLACE_BLOCKS <= blocks.n_blocks();
        if best.as_ref().is_none_or(|best| best.n_blocks() < blocks.n_blocks()) {
            best = Some(blocks);
        }
        if enough {
            break;
        }
    }
    best.unwrap_or_else(|| Blocks::of_keys("places", &vec![0; rows.len()]))
}

/// Rows by one of their ends: with a fold, every row that one of its nodes takes part in is kept from training.
fn node_blocks(rows: &ModelledLinks) -> Blocks {
    let measured = &rows.links.rows;
    // One end of each pair, each as often as the other.
    let keys: Vec<u64> = measured
        .iter()
        .map(|row| {
            let (low, high) = (row.tx.min(row.rx), row.tx.max(row.rx));
            let is_low = scramble(pair(low, high)) & 1 == 0;
            u64::from(if is_low { low } else { high })
        })
        .collect();
    let mut blocks = Blocks::of_keys("nodes", &keys);
    let mut fold_of_node: BTreeMap<u32, usize> = BTreeMap::new();
    for (row, &key) in keys.iter().enumerate() {
        fold_of_node.insert(key as u32, blocks.fold(row as u32));
    }
    let gaps = measured.iter().enumerate().flat_map(|(row, ends)| {
        let own = blocks.fold(row as u32);
        let folds = [ends.tx, ends.rx].map(|node| fold_of_node.get(&node).copied());
        let others: BTreeSet<usize> =
            folds.into_iter().flatten().filter(|&fold| fold != own).collect();
        others.into_iter().map(move |fold| (row as u32, fold as u8))
    });
    blocks.gaps = gaps.collect();
    blocks
}

/// Blocks by what varies: in time, with places, and, where nothing was measured twice, links and channels.
pub(super) struct Grouped {
    pub(super) time: Blocks,
    pub(super) place: Blocks,
    pub(super) once: Option<Blocks>,
    /// Why blocks of places stand for blocks of time, if they do by default.
    pub(super) fallback: Option<String>,
}

/// Rows in blocks, as chosen or as suits them.
pub(super) fn grouped(rows: &ModelledLinks, choices: &Choices) -> Result<Grouped, ChoiceError> {
    let runs: Vec<u32> = rows.links.rows.iter().map(|row| row.run).collect();
    let scored = choices.scored_rows(&runs);
    let grouped = match choices.split {
        Some(split) => {
            let blocks = split_blocks(rows, split, scored.as_deref())?;
            Grouped { time: blocks.clone(), place: blocks, once: None, fallback: None }
        }
        None => default_blocks(rows, scored.as_deref()),
    };
    let folded = |blocks: Blocks| Blocks { scored: scored.clone(), ..blocks };
    Ok(Grouped {
        fallback: grouped.fallback,
        time: folded(grouped.time),
        place: folded(grouped.place),
        once: grouped.once.map(folded),
    })
}

/// Rows in blocks as suits them. Where these are too few, and nodes move, in squares of the plane.
fn default_blocks(rows: &ModelledLinks, scored: Option<&[bool]>) -> Grouped {
    let is_enough = |blocks: &Blocks| {
        let scored = scored.map(<[bool]>::to_vec);
        Blocks { scored, ..blocks.clone() }.suffices()
    };
    let (time, place) = (time_blocks(rows, scored), place_blocks(rows));
    let once = (!has_times(rows)).then(|| link_channel_blocks(rows));
    if is_enough(&time) || rows.still().values().all(|&still| still) {
        return Grouped { time, place, once, fallback: None };
    }
    let places = blocks_of_squares(rows);
    if !is_enough(&places) {
        return Grouped { time, place, once, fallback: None };
    }
    let fallback = format!(
        "the data have only {} {}, and at least {FEWEST_BLOCKS} are required; {} places are held out instead, as with --split place",
        time.n_blocks(),
        time.unit,
        places.n_blocks()
    );
    Grouped { time: places, place, once: None, fallback: Some(fallback) }
}

/// Rows that are left out together by choice.
fn split_blocks(
    rows: &ModelledLinks,
    split: SplitBy,
    scored: Option<&[bool]>,
) -> Result<Blocks, ChoiceError> {
    let refused =
        |reason: &str, nearest| ChoiceError::Split { split, reason: reason.to_owned(), nearest };
    let blocks = match split {
        SplitBy::Time if !has_times(rows) => {
            let reason = "the rows have no times, or fewer than 20 different times";
            return Err(refused(reason, SplitBy::Pair));
        }
        SplitBy::Time => time_blocks(rows, scored),
        SplitBy::Pair => Blocks::of_keys("pairs of nodes", &pairs(rows)),
        SplitBy::Node => node_blocks(rows),
        SplitBy::Place if rows.still().values().all(|&still| still) => {
            return Err(refused("no node moves, or positions are unknown", SplitBy::Pair));
        }
        SplitBy::Place => blocks_of_squares(rows),
        SplitBy::Run => {
            let runs = rows.links.rows.iter().map(|row| u64::from(row.run));
            Blocks::of_keys("campaigns", &runs.collect::<Vec<_>>())
        }
    };
    if blocks.n_blocks() < 2 {
        let nearest = if has_times(rows) { SplitBy::Time } else { SplitBy::Pair };
        let reason = format!("all rows belong to one of the {}", blocks.unit);
        return Err(refused(&reason, nearest));
    }
    Ok(blocks)
}

/// The square (or cube) of a place.
fn square(place_m: [f64; 3], side_m: f64) -> u64 {
    place_m
        .iter()
        .fold(17, |key, coordinate| scramble(key ^ ((coordinate / side_m).floor() as i64 as u64)))
}

/// From the first row to the last (s).
fn length_s(rows: &ModelledLinks) -> f64 {
    let times_s = || rows.links.rows.iter().map(|row| row.time_s);
    times_s().fold(f64::NEG_INFINITY, f64::max) - times_s().fold(f64::INFINITY, f64::min)
}

/// Times over which levels may drift in the course of these rows (s).
pub(super) fn drift_times_s(rows: &ModelledLinks) -> Vec<f64> {
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
type Span = (u32, i64);

/// The span of time, of the campaign of a row, of a length (s); the same for all rows where there is none.
fn span(rows: &ModelledLinks, row: usize, span_s: Option<f64>) -> Span {
    let measured = &rows.links.rows[row];
    span_s.map_or((0, 0), |span_s| (measured.run, (measured.time_s / span_s).floor() as i64))
}

/// Spans of time in which all links share a level that drifts over a time (s): of each row, and how each is correlated with that
/// before.
fn spans_of_drift(rows: &ModelledLinks, correlation_s: f64) -> (Vec<u32>, Vec<f64>) {
    let length_s = length_s(rows);
    let span_s = (COMMON_SPAN * correlation_s).max(LEAST_COMMON_SPAN * length_s);
    let spans: Vec<Span> = (0..rows.len()).map(|row| span(rows, row, Some(span_s))).collect();
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
pub(super) fn cells_of(rows: &ModelledLinks, scales: Scales) -> RowCells {
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
                scramble(key ^ square(end.position_m, side_m))
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
    let channels: Vec<(u32, (u8, u64), Span)> = (0..rows.len())
        .map(|row| {
            let fine = || {
                let channel = rows.links.rows[row].channel.unwrap_or(0);
                (channel, places(row, HALF_WAVE_M))
            };
            let fine = if scales.link_drift_s.is_some() { (0, 0) } else { fine() };
            (link[row], fine, span(rows, row, scales.link_drift_s.map(|time_s| SIDE * time_s)))
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

/// Marks about `most` of the rows: short runs of each pair's, spread evenly over everything.
pub(super) fn spread_evenly(rows: &ModelledLinks, most: usize) -> Vec<bool> {
    let mut seen: BTreeMap<u64, u64> = BTreeMap::new();
    let share = most as f64 / rows.len() as f64;
    let limit = (share * u64::MAX as f64) as u64;
    pairs(rows)
        .into_iter()
        .map(|key| {
            let n = seen.entry(key).or_insert(0);
            let run = *n / THINNED_RUN_ROWS;
            *n += 1;
            scramble(key ^ scramble(run)) <= limit
        })
        .collect()
}
