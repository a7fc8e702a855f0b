//! What each delivery reads.

use super::air::Air;
use super::judge::MOST;
use super::resolve::{CHUNK, chunked, places};
use crate::link::Link;
use crate::scatter::draw_blocks;
use proto::rng::unordered_link;
use proto::types::{Deliveries, Heard};

/// What each delivery reads (dBm), in the order receiver, frame.
#[must_use]
pub fn register_rssi_dbm(air: &Air<'_>, agent_count: usize, heard: &Heard) -> Vec<f32> {
    let place_of = places(air, agent_count);
    let deliveries = Deliveries { heard: heard.clone(), ..Deliveries::default() };
    let mutual = Mutual::compute(air, deliveries.n_deliveries());
    let chunks: Vec<Vec<f32>> = chunked(agent_count, |agents| {
        let mut read = Vec::new();
        let mut frames = Vec::new();
        for agent in agents {
            let Some(receiver) = place_of[agent] else { continue };
            let receiver = receiver as usize;
            if let Some(mutual) = &mutual {
                read.extend(deliveries.heard_by(agent).map(|frame| mutual.dbm(receiver, frame)));
                continue;
            }
            frames.clear();
            frames.extend(deliveries.heard_by(agent));
            for frames in frames.chunks(MOST) {
                let (senders, n) = padded(frames.iter().copied());
                of_receiver(air, receiver, &senders[..n], &mut read);
            }
        }
        read
    });
    chunks.concat()
}

/// Readings that both ends of a link share, computed once.
struct Mutual {
    /// By chunk of 64 radios, the readings between each and those before it.
    chunks: Vec<Vec<f32>>,
}

/// More radios than this are not worth the memory: 33 MB.
const MOST_MUTUAL: usize = 4096;

impl Mutual {
    /// Readings between all radios, if they are mutual and if most are wanted.
    fn compute(air: &Air<'_>, n_deliveries: usize) -> Option<Self> {
        let n = air.radios.ends.len();
        let frames = &air.radios.frames;
        let first = frames.first()?;
        let is_mutual = air.model.is_isotropic()
            && air.model.directed_scatters().is_empty()
            && frames.iter().all(|frame| frame.channel == first.channel);
        if !is_mutual || frames.len() < n || MOST_MUTUAL < n || n_deliveries < n * n * 5 / 8 {
            return None;
        }
        let chunks = chunked(n, |places| {
            let mut read = Vec::with_capacity(places.len() * places.end);
            for p in places {
                for from in (0..p).step_by(MOST) {
                    let (others, n) = padded(from..p.min(from + MOST));
                    of_receiver(air, p, &others[..n], &mut read);
                }
            }
            read
        });
        Some(Self { chunks })
    }

    /// What `a` reads of `b`, and `b` of `a` (dBm).
    #[inline]
    fn dbm(&self, a: usize, b: usize) -> f32 {
        let (low, high) = (a.min(b), a.max(b));
        let start = high / CHUNK * CHUNK;
        // Rows of this chunk before that of `high` have start, start + 1, ... readings.
        let i = high - start;
        self.chunks[high / CHUNK][i * start + i * i.saturating_sub(1) / 2 + low]
    }
}

/// At most [`MOST`] places, and how many.
fn padded(places: impl Iterator<Item = usize>) -> ([usize; MOST], usize) {
    let mut padded = [0; MOST];
    let mut n = 0;
    for (slot, place) in padded.iter_mut().zip(places) {
        *slot = place;
        n += 1;
    }
    (padded, n)
}

/// What one radio reads of at most [`MOST`] frames.
fn of_receiver(air: &Air<'_>, receiver: usize, frames: &[usize], read: &mut Vec<f32>) {
    let Some(&first) = frames.first() else { return };
    let radios = air.radios;
    let has_scatter = !air.model.scatters().is_empty();
    let mut pairs = [0; MOST];
    let mut words = [[0; 4]; MOST];
    if has_scatter {
        for (pair, &frame) in pairs.iter_mut().zip(frames) {
            *pair = unordered_link(radios.id[receiver], radios.id[frame]);
        }
        draw_blocks(air.seeds, &pairs[..frames.len()], air.period_ns, &mut words);
    }
    // Where nothing but distance and frequency counts, one description serves all links.
    let is_isotropic = air.model.is_isotropic();
    let mut link = link_of(air, receiver, first);
    for (&frame, &words) in frames.iter().zip(&words) {
        if !is_isotropic || radios.frames[frame].channel != link.channel {
            link = link_of(air, receiver, frame);
        } else {
            let d2_m2 = radios.distance_squared_m2(frame, receiver);
            link.distance_m = d2_m2.sqrt().max(air.model.min_distance_m);
        }
        let scatter_db = if has_scatter {
            air.scatter_db(receiver, frame, &mut air.drawn_pair(receiver, frame, words))
        } else {
            0.0
        };
        read.push(air.model.register_dbm(&link, scatter_db) as f32);
    }
}

fn link_of<'a>(air: &Air<'a>, receiver: usize, frame: usize) -> Link<'a> {
    let at = air.radios.frames[frame];
    let ends = &air.radios.ends;
    air.model.link(air.scene, ends[frame], ends[receiver], at.channel, at.sent_ns)
}
