//! Received power that drifts: common to all links, or independently on every link.

use super::air::{Air, frame_times, layout, n_rows, ornstein_uhlenbeck, per_frame};
use super::answer::{Answer, Claim};
use super::testbed::link;
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use std::collections::BTreeMap;

/// Correlation time (s) and standard deviation (dB) of the common drift.
fn common(seed: u64) -> (f64, f64) {
    let mut draws = Draws::new(seed, "common drift");
    (draws.between(60.0, 300.0), draws.between(1.0, 2.0))
}

fn common_air(seed: u64) -> Air {
    let mut air = Air::new(seed, &layout(seed, 10.0), n_rows(seed, 3000, 5000));
    let (tau_s, sd_db) = common(seed);
    let times = frame_times(&air.world);
    let mut draws = Draws::new(seed, "course of the drift");
    let drift = ornstein_uhlenbeck(&mut draws, times.into_iter(), tau_s, sd_db);
    let drift_db = per_frame(&air.world, &drift);
    air.add(|index, _| drift_db[index]);
    air
}

/// Honest: drift. Temperature, humidity and dust vary smoothly and have no effect.
pub(super) fn common_case(seed: u64) -> Case {
    case(&common_air(seed), "drift", &["time_s"])
}

/// Correlation time (s) and standard deviation (dB) of the drift of each link.
fn single(seed: u64) -> (f64, f64) {
    let mut draws = Draws::new(seed, "drift of a link");
    (100.0 * 10_f64.powf(draws.uniform()), draws.between(2.0, 4.0))
}

fn link_air(seed: u64) -> Air {
    // With few nodes, every link has several rows within its correlation time.
    let few = 5 + Draws::new(seed, "nodes").below(3);
    let mut layout = layout(seed, 1.0);
    (layout.n_fixed, layout.n_moving) = (few, 0);
    layout.duration_s = layout.duration_s.min(5400.0);
    let mut air = Air::new(seed, &layout, n_rows(seed, 4000, 5000));
    let (tau_s, sd_db) = single(seed);
    let mut rows_of = BTreeMap::new();
    for (index, row) in air.world.rows.iter().enumerate() {
        rows_of.entry(link(row)).or_insert_with(Vec::new).push(index);
    }
    let mut drift_db = vec![0.0; air.world.rows.len()];
    for (of, rows) in rows_of {
        let mut draws = Draws::new(seed, &format!("drift of {of:?}"));
        let times = rows.iter().map(|&row| air.world.rows[row].time_s);
        let drift = ornstein_uhlenbeck(&mut draws, times, tau_s, sd_db);
        for (&row, value) in rows.iter().zip(drift) {
            drift_db[row] = value;
        }
    }
    air.add(|index, _| drift_db[index]);
    air
}

/// Honest: time-correlated fading of each link.
pub(super) fn link_case(seed: u64) -> Case {
    case(&link_air(seed), "link-drift", &[])
}

fn case(air: &Air, effect: &'static str, structure: &[&'static str]) -> Case {
    let sent = air.send();
    let answer = Answer::of(vec![Claim::of(effect)])
        .with_structure(structure)
        .with_error(air.error_over_noise(&sent));
    Case { csv: air.csv(&sent), config_toml: air.config(&sent), expected: Expected::Answer(answer) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{deviation, mean};

    fn added(air: &Air) -> Vec<f64> {
        air.level_db.iter().zip(&air.model_db).map(|(truth, model)| truth - model).collect()
    }

    #[test]
    fn a_common_drift_is_the_same_for_all_receivers_of_a_frame() {
        for seed in 0..4 {
            let air = common_air(seed);
            let added = added(&air);
            for (rows, values) in air.world.rows.windows(2).zip(added.windows(2)) {
                if rows[0].frame == rows[1].frame {
                    assert!((values[0] - values[1]).abs() < 1e-9);
                }
            }
            let (tau_s, sd_db) = common(seed);
            // An hour holds at least six independent values (of 600 s), so that the spread is known to a third.
            let independent = air.world.duration_s / (2.0 * tau_s);
            let tolerance = 4.0 * sd_db / (2.0 * independent).sqrt();
            assert!((deviation(&added) - sd_db).abs() < tolerance, "{}", deviation(&added));
            assert!(common_case(seed).csv.contains("temperature_c,humidity_pct"));
        }
    }

    #[test]
    fn links_drift_by_themselves_with_the_spread_drawn() {
        let ratios: Vec<f64> = (0..6)
            .map(|seed| {
                let air = link_air(seed);
                let added = added(&air);
                let square = mean(&added.iter().map(|value| value * value).collect::<Vec<_>>());
                square / single(seed).1.powi(2)
            })
            .collect();
        // Six campaigns of at least ten links, each of at least two independent values.
        assert!((mean(&ratios) - 1.0).abs() < 4.0 * (2.0 / 120.0_f64).sqrt(), "{ratios:?}");
        let air = link_air(1);
        let added = added(&air);
        let pairs: Vec<f64> = air
            .world
            .rows
            .windows(2)
            .zip(added.windows(2))
            .filter(|(rows, _)| rows[0].frame == rows[1].frame)
            .map(|(_, values)| values[0] * values[1] / single(1).1.powi(2))
            .collect();
        // Two links of a frame have nothing in common.
        assert!(mean(&pairs).abs() < 0.35, "{}", mean(&pairs));
    }
}
