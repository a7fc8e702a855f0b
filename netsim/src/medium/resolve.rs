//! All links of a moment.

use super::air::Air;
use crate::phy::nearest::Grid;
use crate::phy::propagation::Reach;
use crate::phy::scatter::{LEVEL_WORD, level_db};
use bytes::Bytes;
use proto::rng::uniform;
use proto::types::Heard;
use rayon::prelude::*;

/// Who heard which frame, in agents' order.
///
/// * `agent_count`: how many rows or lists there shall be.
/// * `reach`: how far links may reach; see [`crate::phy::Model::reach`].
/// * `grid`: scratch.
#[must_use]
pub fn resolve(air: &Air<'_>, agent_count: usize, reach: Reach, grid: &mut Grid) -> Heard {
    if air.n_frames() == 0 {
        return Heard::default();
    }
    let place_of = places(air, agent_count);
    if air.model.is_certain() {
        return shorter(all_ones(air, &place_of), agent_count, air.n_frames());
    }
    let neighbourhoods = match reach {
        Reach::Unlimited => Neighbourhoods::All,
        Reach::Listed => Neighbourhoods::Listed,
        Reach::Within(_) if air.radios.ends.len() <= FEW => Neighbourhoods::All,
        Reach::Within(reach_m) => {
            let points = air.radios.ends.iter().map(|end| [end.position_m[0], end.position_m[1]]);
            grid.build(reach_m, points);
            if is_crowded(air, grid, reach_m) {
                Neighbourhoods::All
            } else {
                Neighbourhoods::Within(grid, reach_m)
            }
        }
    };
    let heard = match neighbourhoods {
        Neighbourhoods::All => dense(air, &place_of),
        Neighbourhoods::Listed | Neighbourhoods::Within(..) => {
            sparse(air, &place_of, &neighbourhoods)
        }
    };
    shorter(heard, agent_count, air.n_frames())
}

/// What each delivery reads (dBm), in the order receiver, frame.
#[must_use]
pub fn register_rssi_dbm(air: &Air<'_>, agent_count: usize, heard: &Heard) -> Vec<f32> {
    let place_of = places(air, agent_count);
    let deliveries = proto::types::Deliveries { heard: heard.clone(), ..Default::default() };
    let chunks: Vec<Vec<f32>> = chunked(agent_count, |agents| {
        let mut read = Vec::new();
        for agent in agents {
            let Some(receiver) = place_of[agent] else { continue };
            for frame in deliveries.heard_by(agent) {
                let mut pair = air.pair(receiver as usize, frame);
                let budget = air.budget(receiver as usize, frame, &mut pair);
                read.push(budget.register_rssi_dbm as f32);
            }
        }
        read
    });
    chunks.concat()
}

/// Which frames a radio may hear at all.
enum Neighbourhoods<'a> {
    /// All.
    All,
    /// Those of the radios within a distance.
    Within(&'a Grid, f64),
    /// Those of the radios that the scene lists.
    Listed,
}

/// Radios for which neighbourhoods do not pay.
const FEW: usize = 64;
/// Agents to a unit of parallel work.
const CHUNK: usize = 64;

/// The place of every agent among the radios, if its radio is on.
fn places(air: &Air<'_>, agent_count: usize) -> Vec<Option<u32>> {
    let mut place_of = vec![None; agent_count];
    for (place, end) in (0..).zip(&air.radios.ends) {
        place_of[end.id as usize] = Some(place);
    }
    place_of
}

/// Whether neighbourhoods hold so many that looking at all pairs, two directions at once, is no more work. Judged by a
/// sample of the radios; the result does not depend on it.
fn is_crowded(air: &Air<'_>, grid: &Grid, reach_m: f64) -> bool {
    let ends = &air.radios.ends;
    let stride = ends.len().div_ceil(32);
    let (mut n_sampled, mut n_found) = (0, 0);
    for end in ends.iter().step_by(stride) {
        n_sampled += 1;
        n_found += grid.around([end.position_m[0], end.position_m[1]], reach_m).count();
    }
    n_sampled * ends.len() < 4 * n_found
}

/// Every radio hears every frame but its own.
fn all_ones(air: &Air<'_>, place_of: &[Option<u32>]) -> Heard {
    let n_frames = air.n_frames();
    let row_bytes = n_frames.div_ceil(8);
    let mut full_row = vec![0xff; row_bytes];
    if !n_frames.is_multiple_of(8) {
        full_row[row_bytes - 1] = (1 << (n_frames % 8)) - 1;
    }
    let mut bytes = vec![0; place_of.len() * row_bytes];
    for (row, place) in bytes.chunks_exact_mut(row_bytes).zip(place_of) {
        let Some(place) = *place else { continue };
        row.copy_from_slice(&full_row);
        let place = place as usize;
        if place < n_frames {
            row[place / 8] &= !(1 << (place % 8));
        }
    }
    Heard::Rows { bytes: Bytes::from(bytes), row_bytes }
}

/// Side of a tile.
const TILE: usize = 64;

/// What a tile of 64 by 64 pairs says: frames of the second block heard by the first, and the other way round.
type Tile = ([u64; TILE], [u64; TILE]);

/// All pairs, in tiles; every unordered pair once.
fn dense(air: &Air<'_>, place_of: &[Option<u32>]) -> Heard {
    let n_frames = air.n_frames();
    let n_blocks = air.radios.ends.len().div_ceil(TILE);
    let n_frame_blocks = n_frames.div_ceil(TILE);
    // Tile (row, column), column <= row, stands at first[column] + row.
    let mut corners = Vec::new();
    let mut first = Vec::new();
    for column in 0..n_frame_blocks {
        first.push(corners.len() - column);
        corners.extend((column..n_blocks).map(|row| (row, column)));
    }
    let tiles: Vec<Tile> = if n_frames * air.radios.ends.len() < SERIAL_PAIRS {
        corners.iter().map(|&(row, column)| tile(air, row, column)).collect()
    } else {
        corners.par_iter().map(|&(row, column)| tile(air, row, column)).collect()
    };
    let row_bytes = n_frames.div_ceil(8);
    let mut bytes = vec![0; place_of.len() * row_bytes];
    for (row, place) in bytes.chunks_exact_mut(row_bytes).zip(place_of) {
        let Some(place) = *place else { continue };
        let (block, i) = (place as usize / TILE, place as usize % TILE);
        for (column, part) in row.chunks_mut(8).enumerate() {
            let word = if column <= block {
                tiles[first[column] + block].0[i]
            } else {
                tiles[first[block] + column].1[i]
            };
            part.copy_from_slice(&word.to_le_bytes()[..part.len()]);
        }
    }
    Heard::Rows { bytes: Bytes::from(bytes), row_bytes }
}

/// Fewer ordered pairs than this are not worth waking other threads.
const SERIAL_PAIRS: usize = 16_384;

fn tile(air: &Air<'_>, row: usize, column: usize) -> Tile {
    let n = air.radios.ends.len();
    let columns = column * TILE..((column + 1) * TILE).min(n);
    let mut tile = ([0; TILE], [0; TILE]);
    for (i, p) in (row * TILE..((row + 1) * TILE).min(n)).enumerate() {
        // On the diagonal only pairs p > q: each pair once.
        let before = columns.start..columns.end.min(p);
        let (hears, is_heard) = against(air, p, before);
        tile.0[i] |= hears;
        for j in ones(is_heard) {
            tile.1[j] |= 1 << i;
            if row == column {
                tile.0[j] |= 1 << i;
            }
        }
    }
    tile
}

/// Radio p against at most 64 others before it: bits of those whose frame it hears, and of those that hear its frame.
fn against(air: &Air<'_>, p: usize, others: std::ops::Range<usize>) -> (u64, u64) {
    let n_frames = air.n_frames();
    let first = others.start;
    let up_to = |n: usize| if n < 64 { (1 << n) - 1 } else { u64::MAX };
    // Frames come first: bits of the others that have one, and of all others if p has one.
    let sending = up_to(others.end.min(n_frames).saturating_sub(first));
    let listening = if p < n_frames { up_to(others.len()) } else { 0 };
    let candidates = sending | listening;
    let (mut hears, mut is_heard) = (0, 0);

    // One filter serves both directions where frames have no channel.
    let without_channel = air.radios.frames.first().is_none_or(|frame| frame.channel.is_none());
    let filter = air
        .filters
        .on(None)
        .filter(|_| without_channel && air.model.directed_scatters().is_empty());
    let Some(filter) = filter else {
        for j in ones(candidates) {
            let q = first + j;
            let mut pair = air.pair(p, q);
            if sending >> j & 1 == 1 && air.hears(p, q, &mut pair) {
                hears |= 1 << j;
            }
            if listening >> j & 1 == 1 && air.hears(q, p, &mut pair) {
                is_heard |= 1 << j;
            }
        }
        return (hears, is_heard);
    };

    let mut bounds = [(0.0, 0.0); TILE];
    let (mut certain, mut impossible) = (0, 0);
    for (j, q) in others.enumerate() {
        bounds[j] = filter.bounds(air.radios.distance_squared_m2(p, q));
        certain |= u64::from(filter.is_certain(bounds[j].0)) << j;
        impossible |= u64::from(filter.is_impossible(bounds[j].1)) << j;
    }
    hears |= certain;
    is_heard |= certain;
    // In passes, and without branches that a random outcome would mislead: three times as fast. The rare links that the
    // bounds leave undecided come afterwards.
    let (mut unsure_hears, mut unsure_is_heard) = (0, 0);
    let mut left = [0; TILE];
    let mut n_left = 0;
    for j in ones(candidates & !certain & !impossible) {
        left[n_left] = j;
        n_left += 1;
    }
    let left = &left[..n_left];
    let mut blocks = [[0; 4]; TILE];
    for (words, &j) in blocks.iter_mut().zip(left) {
        *words = air.pair(p, first + j).words();
    }
    // Usually scatter is the level of this period, or there is none.
    let level_span_db = match air.model.symmetric_scatters() {
        [] => Some(0.0),
        [only] => only.period_span_db(),
        _ => None,
    };
    let p_id = air.radios.id[p];
    for (&words, &j) in blocks.iter().zip(left) {
        let q = first + j;
        let shared_db = match level_span_db {
            Some(span_db) => level_db(span_db, uniform(words[LEVEL_WORD])),
            None => air.shared_db(p, q, &mut air.pair(p, q)),
        };
        let (low, high) = filter.probability(bounds[j], shared_db);
        let (low_to_high, high_to_low) = (uniform(words[0]), uniform(words[1]));
        let p_is_higher = air.radios.id[q] < p_id;
        let to_p = if p_is_higher { low_to_high } else { high_to_low };
        let to_q = if p_is_higher { high_to_low } else { low_to_high };
        hears |= u64::from(to_p < low) << j;
        unsure_hears |= u64::from(to_p < high) << j;
        is_heard |= u64::from(to_q < low) << j;
        unsure_is_heard |= u64::from(to_q < high) << j;
    }
    for j in ones(unsure_hears & !hears & sending) {
        let q = first + j;
        hears |= u64::from(air.hears_plainly(p, q, &mut air.pair(p, q))) << j;
    }
    for j in ones(unsure_is_heard & !is_heard & listening) {
        let q = first + j;
        is_heard |= u64::from(air.hears_plainly(q, p, &mut air.pair(p, q))) << j;
    }
    (hears & sending, is_heard & listening)
}

/// Indices of the bits that are set.
fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (bits != 0).then(|| {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            bit
        })
    })
}

/// Neighbours only.
fn sparse(air: &Air<'_>, place_of: &[Option<u32>], near: &Neighbourhoods<'_>) -> Heard {
    let n_frames = air.n_frames();
    let ends = &air.radios.ends;
    let chunks: Vec<(Vec<u32>, Vec<u32>)> = chunked(place_of.len(), |agents| {
        let mut counts = Vec::with_capacity(agents.len());
        let mut indices = Vec::new();
        for agent in agents {
            let begin = indices.len();
            if let Some(place) = place_of[agent] {
                let receiver = place as usize;
                let mut consider = |frame: u32| {
                    let frame = frame as usize;
                    if frame < n_frames && frame != receiver {
                        let mut pair = air.pair(receiver, frame);
                        if air.hears(receiver, frame, &mut pair) {
                            indices.push(frame as u32);
                        }
                    }
                };
                match near {
                    Neighbourhoods::All => (0..n_frames as u32).for_each(&mut consider),
                    Neighbourhoods::Within(grid, reach_m) => {
                        let [x, y, _] = ends[receiver].position_m;
                        grid.around([x, y], *reach_m).for_each(&mut consider);
                    }
                    Neighbourhoods::Listed => {
                        let nearest = air.scene.nearest.as_ref();
                        nearest
                            .map_or(&[][..], |nearest| nearest.neighbours_of(receiver))
                            .iter()
                            .for_each(|&place| consider(place));
                    }
                }
                indices[begin..].sort_unstable();
            }
            counts.push((indices.len() - begin) as u32);
        }
        (counts, indices)
    });
    let mut ends_of = Vec::with_capacity(place_of.len());
    let mut indices = Vec::with_capacity(chunks.iter().map(|chunk| chunk.1.len()).sum());
    let mut end = 0;
    for (counts, part) in chunks {
        ends_of.extend(counts.into_iter().map(|count| {
            end += count;
            end
        }));
        indices.extend(part);
    }
    Heard::Lists { ends: ends_of, indices }
}

/// Applies `work` to consecutive ranges of agents, in parallel where that pays; results in the agents' order.
fn chunked<T: Send>(
    agent_count: usize,
    work: impl Fn(std::ops::Range<usize>) -> T + Send + Sync,
) -> Vec<T> {
    let range = |chunk: usize| chunk * CHUNK..((chunk + 1) * CHUNK).min(agent_count);
    let n_chunks = agent_count.div_ceil(CHUNK);
    if n_chunks <= 2 {
        (0..n_chunks).map(|chunk| work(range(chunk))).collect()
    } else {
        (0..n_chunks).into_par_iter().map(|chunk| work(range(chunk))).collect()
    }
}

/// The shorter of both forms.
#[must_use]
pub fn shorter(heard: Heard, agent_count: usize, n_frames: usize) -> Heard {
    let row_bytes = n_frames.div_ceil(8);
    let deliveries = proto::types::Deliveries { heard, ..Default::default() };
    let rows_are_shorter = agent_count * row_bytes < 4 * (agent_count + deliveries.n_deliveries());
    match (&deliveries.heard, rows_are_shorter) {
        (Heard::Lists { .. }, false) | (Heard::Rows { .. }, true) => deliveries.heard,
        (Heard::Lists { .. }, true) => {
            let mut bytes = vec![0; agent_count * row_bytes];
            for (agent, row) in bytes.chunks_exact_mut(row_bytes).enumerate() {
                for frame in deliveries.heard_by(agent) {
                    row[frame / 8] |= 1 << (frame % 8);
                }
            }
            Heard::Rows { bytes: Bytes::from(bytes), row_bytes }
        }
        (Heard::Rows { .. }, false) => {
            let mut ends = Vec::with_capacity(agent_count);
            let mut indices = Vec::new();
            for agent in 0..agent_count {
                indices.extend(deliveries.heard_by(agent).map(|frame| frame as u32));
                ends.push(indices.len() as u32);
            }
            Heard::Lists { ends, indices }
        }
    }
}
