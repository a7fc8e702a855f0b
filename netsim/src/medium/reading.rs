//! What each delivery reads.

use super::air::Air;
use super::judge::MOST;
use super::resolve::{chunked, places};
use crate::phy::scatter::draw_blocks;
use proto::rng::unordered_link;
use proto::types::{Deliveries, Heard};

/// What each delivery reads (dBm), in the order receiver, frame.
#[must_use]
pub fn register_rssi_dbm(air: &Air<'_>, agent_count: usize, heard: &Heard) -> Vec<f32> {
    let place_of = places(air, agent_count);
    let deliveries = Deliveries { heard: heard.clone(), ..Deliveries::default() };
    let chunks: Vec<Vec<f32>> = chunked(agent_count, |agents| {
        let mut read = Vec::new();
        let mut frames = Vec::new();
        for agent in agents {
            let Some(receiver) = place_of[agent] else { continue };
            frames.clear();
            frames.extend(deliveries.heard_by(agent));
            for frames in frames.chunks(MOST) {
                of_receiver(air, receiver as usize, frames, &mut read);
            }
        }
        read
    });
    chunks.concat()
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
        draw_blocks(air.seed, &pairs[..frames.len()], air.period_ns, &mut words);
    }
    let link_of = |frame: usize| {
        let at = radios.frames[frame];
        let (sender, receiver) = (radios.ends[frame], radios.ends[receiver]);
        air.model.link(air.scene, sender, receiver, at.channel, at.sent_ns)
    };
    // Where nothing but distance and frequency counts, one description serves all links.
    let is_isotropic = air.model.is_isotropic();
    let mut link = link_of(first);
    for (&frame, &words) in frames.iter().zip(&words) {
        if !is_isotropic || radios.frames[frame].channel != link.channel {
            link = link_of(frame);
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
