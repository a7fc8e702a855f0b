//! All links of a moment.

use super::air::{Air, Radios};
use super::judge::{Judge, MOST, Scratch, ones, up_to};
use crate::link::distance_squared_m2;
use crate::nearest::Grid;
use crate::propagation::Reach;
use bytes::Bytes;
use proto::types::Heard;
use rayon::prelude::*;
use std::ops::Range;

/// Who heard which frame, in agents' order.
///
/// * `agent_count`: how many rows or lists there shall be.
/// * `reach`: how far links may reach; see [`crate::Model::reach`].
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
    let heard = match reach {
        Reach::Unlimited => dense(air, &place_of),
        Reach::Listed => listed(air, &place_of),
        Reach::Within(_) if air.radios.ends.len() <= FEW => dense(air, &place_of),
        Reach::Within(reach_m) => {
            let points = air.radios.ends.iter().map(|end| [end.position_m[0], end.position_m[1]]);
            grid.build(reach_m, points);
            if is_crowded(air, grid, reach_m) {
                dense(air, &place_of)
            } else {
                within(air, &place_of, grid, reach_m)
            }
        }
    };
    shorter(heard, agent_count, air.n_frames())
}

/// Radios for which neighbourhoods do not pay.
const FEW: usize = 64;
/// Agents to a unit of parallel work.
pub(super) const CHUNK: usize = 64;

/// The place of every agent among the radios, if its radio is on.
pub(super) fn places(air: &Air<'_>, agent_count: usize) -> Vec<Option<u32>> {
    let mut place_of = vec![None; agent_count];
    for (place, end) in (0..).zip(&air.radios.ends) {
        place_of[end.id.index()] = Some(place);
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
const TILE: usize = MOST;

/// Of so many in a row that distance leaves open it does not pay to leave out the others.
const MOSTLY: u32 = 48;

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
    let judge = Judge::new(air);
    let tile = |&(row, column): &(usize, usize)| tile(&judge, air.radios, row, column);
    let tiles: Vec<Tile> = if n_frames * air.radios.ends.len() < SERIAL_PAIRS {
        corners.iter().map(tile).collect()
    } else {
        corners.par_iter().map(tile).collect()
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

fn tile(judge: &Judge<'_>, radios: &Radios, row: usize, column: usize) -> Tile {
    let n = radios.ends.len();
    let columns = column * TILE..((column + 1) * TILE).min(n);
    let mut tile = ([0; TILE], [0; TILE]);
    let mut scratch = Scratch::default();
    for (i, p) in (row * TILE..((row + 1) * TILE).min(n)).enumerate() {
        // On the diagonal only pairs p > q: each pair once.
        let before = columns.start..columns.end.min(p);
        (tile.0[i], tile.1[i]) = against(judge, radios, p, before, &mut scratch);
    }
    transpose(&mut tile.1);
    if row == column {
        for (hears, also_hears) in tile.0.iter_mut().zip(&tile.1) {
            *hears |= also_hears;
        }
    }
    tile
}

/// Radio p against at most 64 others before it: bits of those whose frame it hears, and of those that hear its frame.
fn against(
    judge: &Judge<'_>,
    radios: &Radios,
    p: usize,
    others: Range<usize>,
    scratch: &mut Scratch,
) -> (u64, u64) {
    let n_frames = radios.frames.len();
    let (first, n) = (others.start, others.len());
    // Frames come first: bits of the others that have one, and of all others if p has one.
    let sending = up_to(others.end.min(n_frames).saturating_sub(first));
    let listening = if p < n_frames { up_to(n) } else { 0 };

    let [x_m, y_m, z_m] = &radios.position_m;
    let at_p = [x_m[p], y_m[p], z_m[p]];
    let (x_m, y_m, z_m) = (&x_m[others.clone()], &y_m[others.clone()], &z_m[others.clone()]);
    let mut d2_m2 = [0.0; TILE];
    for (((d2_m2, &x_m), &y_m), &z_m) in d2_m2.iter_mut().zip(x_m).zip(y_m).zip(z_m) {
        *d2_m2 = distance_squared_m2([at_p[0] - x_m, at_p[1] - y_m, at_p[2] - z_m]);
    }
    let mut certain = 0;
    if judge.certain_below_m2 != 0.0 {
        certain = bits(&d2_m2, |d2_m2| d2_m2 < judge.certain_below_m2) & up_to(n);
    }
    let possible = bits(&d2_m2, |d2_m2| d2_m2 < judge.impossible_from_m2) & up_to(n);
    let open = possible & !certain & (sending | listening);
    let (mut hears, mut is_heard) = (certain, certain);
    if MOSTLY <= open.count_ones() {
        // Judges those too whose distance would settle them: cheaper than to pick the others.
        let others: [u32; TILE] = std::array::from_fn(|j| (first + j) as u32);
        (hears, is_heard) = judge.both(p, &others[..n], &d2_m2[..n], scratch);
    } else if open != 0 {
        let mut left = [0; TILE];
        let mut left_d2_m2 = [0.0; TILE];
        let mut n_left = 0;
        for j in ones(open) {
            left[n_left] = (first + j) as u32;
            left_d2_m2[n_left] = d2_m2[j];
            n_left += 1;
        }
        let (to_p, to_others) = judge.both(p, &left[..n_left], &left_d2_m2[..n_left], scratch);
        let place = |k: usize| left[k] as usize - first;
        ones(to_p).for_each(|k| hears |= 1 << place(k));
        ones(to_others).for_each(|k| is_heard |= 1 << place(k));
    }
    (hears & sending, is_heard & listening)
}

/// Bits of the distances for which something holds.
#[inline(always)]
fn bits(d2_m2: &[f64; TILE], holds: impl Fn(f64) -> bool) -> u64 {
    let mut flags = [0; TILE];
    for (flag, &d2_m2) in flags.iter_mut().zip(d2_m2) {
        *flag = u8::from(holds(d2_m2));
    }
    let mut bits = 0;
    for (i, eight) in flags.as_chunks::<8>().0.iter().enumerate() {
        // Brings the lowest bit of byte j to bit 56 + j.
        let byte = u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        bits |= byte << (8 * i);
    }
    bits
}

/// Exchanges bit i of word j with bit j of word i: swaps the quarters off the diagonal, then within each quarter.
fn transpose(words: &mut [u64; TILE]) {
    let mut width = TILE / 2;
    let mut mask = u64::from(u32::MAX);
    while width != 0 {
        for block in (0..TILE).step_by(2 * width) {
            for i in block..block + width {
                let swapped = (words[i] >> width ^ words[i + width]) & mask;
                words[i] ^= swapped << width;
                words[i + width] ^= swapped;
            }
        }
        width /= 2;
        mask ^= mask << width;
    }
}

/// What the radios of a chunk hear from those before them, one after the other, and where each one's part ends; and
/// (receiver, frame) of those that hear them.
#[derive(Default)]
struct Near {
    frames: Vec<u32>,
    ends: Vec<usize>,
    back: Vec<(u32, u32)>,
}

/// Those within reach only; every unordered pair once.
fn within(air: &Air<'_>, place_of: &[Option<u32>], grid: &Grid, reach_m: f64) -> Heard {
    let judge = Judge::new(air);
    let radios = air.radios;
    let n_frames = air.n_frames();
    let chunks: Vec<Near> = chunked(radios.ends.len(), |places| {
        let mut near = Near::default();
        let (mut others, mut d2_m2) = (Vec::new(), Vec::new());
        let mut scratch = Scratch::default();
        for p in places {
            let [x, y, _] = radios.ends[p].position_m;
            others.clear();
            d2_m2.clear();
            let begin = near.frames.len();
            for q in grid.around([x, y], reach_m).filter(|&q| (q as usize) < p) {
                let d2 = radios.distance_squared_m2(p, q as usize);
                if d2 < judge.certain_below_m2 {
                    if (q as usize) < n_frames {
                        near.frames.push(q);
                    }
                    if p < n_frames {
                        near.back.push((q, p as u32));
                    }
                } else if d2 < judge.impossible_from_m2 {
                    others.push(q);
                    d2_m2.push(d2);
                }
            }
            for (others, d2_m2) in others.chunks(MOST).zip(d2_m2.chunks(MOST)) {
                let (to_p, to_others) = judge.both(p, others, d2_m2, &mut scratch);
                near.frames.extend(ones(to_p).map(|k| others[k]));
                near.back.extend(ones(to_others).map(|k| (others[k], p as u32)));
            }
            near.frames[begin..].sort_unstable();
            near.ends.push(near.frames.len());
        }
        near
    });
    // Ascending: first the frames of those before a radio, then those of the ones after it, which come in their order.
    let mut counts = vec![0; radios.ends.len()];
    for &(receiver, _) in chunks.iter().flat_map(|near| &near.back) {
        counts[receiver as usize] += 1;
    }
    let mut starts = vec![0; radios.ends.len()];
    let mut end = 0;
    let mut place = 0;
    for near in &chunks {
        let mut begin = 0;
        for &own in &near.ends {
            starts[place] = end;
            end += own - begin + counts[place];
            begin = own;
            place += 1;
        }
    }
    let mut next = starts.clone();
    let mut frames = vec![0; end];
    let mut place = 0;
    for near in &chunks {
        let mut begin = 0;
        for &own in &near.ends {
            let n_own = own - begin;
            frames[next[place]..next[place] + n_own].copy_from_slice(&near.frames[begin..own]);
            next[place] += n_own;
            begin = own;
            place += 1;
        }
    }
    for &(receiver, frame) in chunks.iter().flat_map(|near| &near.back) {
        let slot = &mut next[receiver as usize];
        frames[*slot] = frame;
        *slot += 1;
    }
    lists(place_of, |place| &frames[starts[place]..next[place]])
}

/// The neighbours only that the scene lists for each receiver.
fn listed(air: &Air<'_>, place_of: &[Option<u32>]) -> Heard {
    let n_frames = air.n_frames();
    let chunks: Vec<Vec<Vec<u32>>> = chunked(air.radios.ends.len(), |places| {
        places
            .map(|receiver| {
                let neighbours = match &air.scene.nearest {
                    Some(nearest) => nearest.neighbours_of(receiver),
                    None => &[],
                };
                let mut heard: Vec<u32> = neighbours
                    .iter()
                    .copied()
                    .filter(|&frame| {
                        let frame = frame as usize;
                        let mut pair = air.pair(receiver, frame);
                        frame < n_frames
                            && frame != receiver
                            && air.hears(receiver, frame, &mut pair)
                    })
                    .collect();
                heard.sort_unstable();
                heard
            })
            .collect()
    });
    let heard: Vec<Vec<u32>> = chunks.into_iter().flatten().collect();
    lists(place_of, |place| &heard[place])
}

/// Lists by agent of lists by place.
fn lists<'a>(place_of: &[Option<u32>], heard: impl Fn(usize) -> &'a [u32]) -> Heard {
    let mut ends = Vec::with_capacity(place_of.len());
    let mut indices = Vec::new();
    for place in place_of {
        if let Some(place) = *place {
            indices.extend_from_slice(heard(place as usize));
        }
        ends.push(indices.len() as u32);
    }
    Heard::Lists { ends, indices }
}

/// Applies `work` to consecutive ranges of agents, in parallel where that pays; results in the agents' order.
pub(super) fn chunked<T: Send>(
    agent_count: usize,
    work: impl Fn(Range<usize>) -> T + Send + Sync,
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
