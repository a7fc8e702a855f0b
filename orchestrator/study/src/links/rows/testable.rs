//! What measurements have, and so which effects can be tested on them.

use super::ModelledLinks;
use crate::thresholds::FEWEST_VIEWS;
use proto::effect::{Level, Need};
use std::collections::{BTreeMap, BTreeSet};

/// Whether the data have what an effect needs.
#[must_use]
pub fn has(rows: &ModelledLinks, need: Need) -> bool {
    let still = rows.still();
    let measured = &rows.links.rows;
    let differs = |values: &mut dyn Iterator<Item = f64>| {
        let mut known = values.filter(|value| value.is_finite());
        known.next().is_some_and(|first| known.any(|value| value != first))
    };
    match need {
        Need::Positions => {
            measured.iter().all(|row| row.tx_m[0].is_finite() && row.rx_m[0].is_finite())
        }
        Need::Heights => measured.iter().all(|row| 0.0 < row.tx_m[2] && 0.0 < row.rx_m[2]),
        Need::Channels => {
            differs(&mut measured.iter().map(|row| row.channel.map_or(f64::NAN, f64::from)))
        }
        Need::Headings => {
            differs(&mut measured.iter().flat_map(|row| [row.tx_heading_rad, row.rx_heading_rad]))
                || has_still_views(rows)
        }
        Need::Movement => still.values().any(|still| !still),
        Need::Still => still.values().all(|still| *still),
        Need::Time => differs(&mut measured.iter().map(|row| row.time_s)),
        Need::Walls => !rows.site.wall.is_empty(),
        Need::Edges => {
            rows.site.wall.iter().any(|wall| wall.height_m.is_some())
                || rows.site.obstacle.iter().any(|obstacle| obstacle.height_m.is_some())
        }
        Need::OtherAgents => rows.knows_others(),
        Need::Losses => rows.links.readings.has_losses(),
        Need::Readings => measured.iter().any(|row| row.rssi_dbm.is_finite()),
        Need::Column(name) => rows.links.covariates.iter().any(|(column, _)| {
            column == name
                || column.strip_prefix("tx_") == Some(name)
                || column.strip_prefix("rx_") == Some(name)
        }),
        Need::Foliage => !rows.site.foliage.is_empty(),
        Need::Terrain
        | Need::TurningCommands
        | Need::Steering
        | Need::VelocityCommands
        | Need::ThrustCommands
        | Need::Mass
        | Need::Packets
        | Need::Latencies => false,
    }
}

/// Whether a node that stands still, whose heading can be sought, is seen from so many places that a pattern would show.
fn has_still_views(rows: &ModelledLinks) -> bool {
    let still = rows.still();
    let mut views: BTreeMap<u32, BTreeSet<[u64; 2]>> = BTreeMap::new();
    for row in 0..rows.len() {
        let (tx, rx) = rows.ends(row);
        for (own, other) in [(tx, rx), (rx, tx)] {
            if own.heading_rad.is_none() && still.get(&own.id.0).copied().unwrap_or(false) {
                let place = [0, 1].map(|k| other.position_m[k].to_bits());
                views.entry(own.id.0).or_default().insert(place);
            }
        }
    }
    views.values().any(|places| FEWEST_VIEWS <= places.len())
}

/// At which level a covariate varies: from place to place where it is constant for every pair of nodes, else in time.
#[must_use]
pub fn level_of(rows: &ModelledLinks, values: &[f64]) -> Level {
    let mut first: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    let mut distinct: BTreeSet<u64> = BTreeSet::new();
    for (row, &value) in rows.links.rows.iter().zip(values) {
        let key = (row.tx.min(row.rx), row.tx.max(row.rx));
        let known = *first.entry(key).or_insert(value);
        distinct.insert(value.to_bits());
        if known.total_cmp(&value).is_ne() {
            return Level::Time;
        }
    }
    if 1 < distinct.len() { Level::Place } else { Level::Time }
}
