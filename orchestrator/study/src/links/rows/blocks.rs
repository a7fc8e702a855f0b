//! Which rows are left out together, and which are enough for a search.

use super::ModelledLinks;
use crate::choices::{ChoiceError, Choices, SplitBy};
use crate::folds::{Blocks, Few, scramble};
use crate::thresholds::{FEWEST_BLOCKS, FEWEST_PLACE_BLOCKS, THINNED_RUN_ROWS, TIME_BLOCKS};
use measure::links::LinkRow;
use std::collections::{BTreeMap, BTreeSet};

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
    Blocks::of_keys("blocks of time", &keys).in_turn().showing(Few::Possible)
}

/// Whether the rows were measured at so many times that blocks of time can be left out.
fn has_times(rows: &ModelledLinks) -> bool {
    let mut times: Vec<(u32, u64)> =
        rows.links.rows.iter().map(|row| (row.run, row.time_s.to_bits())).collect();
    times.sort_unstable();
    times.dedup();
    FEWEST_BLOCKS <= times.len() && rows.links.rows.iter().all(|row| row.time_s.is_finite())
}

/// How many rows there are for each that differs from all others, where no time tells whether equal rows are of one frame; 1 otherwise.
pub(in crate::links) fn repeats(rows: &ModelledLinks) -> f64 {
    let measured = &rows.links.rows;
    let is_known = |row: &&LinkRow| row.time_s.is_finite();
    let mut times_s = measured.iter().filter(is_known).map(|row| row.time_s);
    if times_s.next().is_some_and(|first_s| times_s.any(|time_s| time_s != first_s)) {
        return 1.0;
    }
    let key = |row: &LinkRow| {
        let places = [row.tx_m, row.rx_m].concat().into_iter().map(f64::to_bits);
        let outcome = [row.rssi_dbm, row.frames, row.received].map(f64::to_bits);
        let ends = [row.run, row.tx, row.rx, u32::from(row.channel.unwrap_or(0))].map(u64::from);
        ends.into_iter().chain(outcome).chain(places).collect::<Vec<u64>>()
    };
    let distinct: BTreeSet<Vec<u64>> = measured.iter().map(key).collect();
    measured.len() as f64 / distinct.len().max(1) as f64
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

pub(in crate::links) fn pair(a: u32, b: u32) -> u64 {
    (u64::from(a.min(b)) << 32) | u64::from(a.max(b))
}

/// The unordered pair of nodes of each row, as a key.
fn pairs(rows: &ModelledLinks) -> Vec<u64> {
    rows.links.rows.iter().map(|row| pair(row.tx, row.rx)).collect()
}

/// How many unordered pairs of nodes there are.
pub(in crate::links) fn n_pairs(rows: &ModelledLinks) -> usize {
    pairs(rows).into_iter().collect::<BTreeSet<_>>().len()
}

/// How many nodes send, and how many receive.
pub(in crate::links) fn n_ends(rows: &ModelledLinks) -> [usize; 2] {
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
                        key = scramble(key ^ square(rows, end.position_m, side_m));
                    }
                }
                key
            })
            .collect();
        let blocks = Blocks::of_keys("places", &keys).showing(Few::Certain);
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
pub(in crate::links) struct Grouped {
    pub(in crate::links) time: Blocks,
    pub(in crate::links) place: Blocks,
    pub(in crate::links) once: Option<Blocks>,
    /// Why blocks of places stand for blocks of time, if they do by default.
    pub(in crate::links) fallback: Option<String>,
}

/// Rows in blocks, as chosen or as suits them.
pub(in crate::links) fn grouped(
    rows: &ModelledLinks,
    choices: &Choices,
) -> Result<Grouped, ChoiceError> {
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
        Blocks { scored, ..blocks.clone() }.are_many()
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
            Blocks::of_keys("campaigns", &runs.collect::<Vec<_>>()).showing(Few::Certain)
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
pub(in crate::links) fn square(rows: &ModelledLinks, place_m: [f64; 3], side_m: f64) -> u64 {
    let numbers = rows.square_numbers(place_m, side_m);
    numbers.iter().fold(17, |key, &number| scramble(key ^ (number as u64)))
}

/// Marks about `most` of the rows: short runs of each pair's, spread evenly over everything.
pub(in crate::links) fn spread_evenly(rows: &ModelledLinks, most: usize) -> Vec<bool> {
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
