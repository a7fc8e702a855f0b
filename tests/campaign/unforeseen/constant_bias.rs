//! A constant bias: `compare` reports the plain error, and blames no covariate.

use super::air::{Air, layout, n_rows};
use super::answer::{Judged, Judgement};
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use serde_json::Value;

/// Tolerance of the plain error, as a share of it.
const NEAR: f64 = 0.02;
/// A covariate is blamed if its p-value is below the first, and its explained share above the second.
const BLAMED: (f64, f64) = (0.005, 0.05);

/// Covariates that a constant bias does not depend on.
const INNOCENT: [&str; 6] =
    ["distance_m", "log10_distance", "tx_height_m", "rx_height_m", "transmitter", "receiver"];

/// The bias (dB).
fn bias_db(seed: u64) -> f64 {
    let mut draws = Draws::new(seed, "constant");
    let size_db = draws.between(5.0, 35.0);
    if draws.chance(0.5) { size_db } else { -size_db }
}

fn air(seed: u64) -> Air {
    let mut air = Air::new(seed, &layout(seed, 15.0), n_rows(seed, 1000, 5000));
    air.add(|_, _| bias_db(seed));
    air
}

/// Honest: the plain error on received rows, and no blame.
pub(super) fn case(seed: u64) -> Case {
    let air = air(seed);
    let sent = air.send();
    let expected = Expected::PlainError(air.plain_rmse_db(&sent));
    Case { csv: air.csv(&sent), config_toml: air.config(&sent), expected }
}

/// Judges the JSON of `compare`, given the plain error (dB).
pub(super) fn judged(rmse_db: f64, comparison: &Value) -> Judged {
    let places = comparison["where"].as_array().into_iter().flatten();
    let mut wrong: Vec<String> = places
        .filter(|place| {
            let is_innocent = place["covariate"].as_str().is_some_and(|it| INNOCENT.contains(&it));
            let is_significant = place["p_value"].as_f64().is_some_and(|p| p < BLAMED.0);
            let is_large = place["explained"].as_f64().is_some_and(|share| BLAMED.1 < share);
            is_innocent && is_significant && is_large
        })
        .filter_map(|place| place["covariate"].as_str().map(str::to_owned))
        .collect();
    let said_db = comparison["scores"]["rmse_received_db"].as_f64();
    if said_db.is_some_and(|said_db| NEAR < (said_db / rmse_db - 1.0).abs()) {
        wrong.push("rmse_received_db".to_owned());
    }
    let judgement = match (wrong.is_empty(), said_db) {
        (false, _) => Judgement::FalseCertain,
        (true, None) => Judgement::Uncertain,
        (true, Some(_)) => Judgement::Honest,
    };
    Judged { judgement, wrong }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_plain_error_is_that_of_bias_and_noise() {
        for seed in 0..5 {
            let case = case(seed);
            let Expected::PlainError(rmse_db) = case.expected else { panic!("a plain error") };
            let noise_db = air(seed).noise_sd_db;
            // Frames are received rather where noise helped: the mean is off by less than the noise.
            let expected_db = bias_db(seed).hypot(noise_db);
            assert!((rmse_db - expected_db).abs() < 0.7 * noise_db, "{rmse_db} {expected_db}");
            assert!(!case.config_toml.contains("noise"));
        }
    }

    #[test]
    fn a_comparison_is_judged_by_the_plain_error_and_by_whom_it_blames() {
        let said = |scores: Value, places: Value| {
            judged(13.2, &json!({"scores": scores, "where": places})).judgement
        };
        let right = json!({"rmse_received_db": 13.4});
        let place = |covariate: &str, p: f64, share: f64| json!([{"covariate": covariate, "p_value": p, "explained": share}]);
        assert_eq!(said(right.clone(), json!([])), Judgement::Honest);
        let wrong = json!({"rmse_received_db": 33.4});
        assert_eq!(said(wrong, json!([])), Judgement::FalseCertain);
        assert_eq!(said(json!({"rmse_db": 13.2}), json!([])), Judgement::Uncertain);
        let blamed = place("rx_height_m", 0.001, 0.2);
        assert_eq!(said(right.clone(), blamed), Judgement::FalseCertain);
        for innocent in [
            place("rx_height_m", 0.01, 0.2),
            place("rx_height_m", 0.001, 0.04),
            place("time_s", 0.001, 0.2),
        ] {
            assert_eq!(said(right.clone(), innocent), Judgement::Honest);
        }
    }
}
