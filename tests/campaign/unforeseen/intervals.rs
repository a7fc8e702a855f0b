//! Rules that every reported parameter must obey, whatever was hidden.

use super::answer::{Judged, Judgement};
use crate::campaign::blind::texts;
use serde_json::Value;
use std::collections::BTreeSet;

/// Width of the range in which each parameter is fitted (`docs/effects.md`).
const RANGES: [(&str, &str, f64); 36] = [
    ("acceleration-limit", "limit_mps2", 1e6),
    ("actuator-lag", "tau_s", 10.0),
    ("antenna-pattern", "boresight_rad", 6.284),
    ("antenna-pattern", "front_to_back_db", 40.0),
    ("battery-sag", "db_per_hour", 100.0),
    ("body-blocking", "blocker_radius_m", 4.95),
    ("body-blocking", "loss_db", 40.0),
    ("dead-band", "threshold_mps", 100.0),
    ("dead-time", "delay_s", 5.0),
    ("diffraction", "scale", 3.0),
    ("downwash", "gain", 200.0),
    ("downwash", "range_m", 99.95),
    ("fast-fading", "k_factor_db", 50.0),
    ("heading-bias", "angle_rad", 6.4),
    ("hidden-obstacle", "loss_db", 40.0),
    ("interference", "duty", 1.0),
    ("motion-fading", "rician_k_db", 35.0),
    ("multipath", "coherence_mhz", 999.9),
    ("multipath", "sd_db", 20.0),
    ("node-offset", "rx_sd_db", 20.0),
    ("node-offset", "tx_sd_db", 20.0),
    ("noise-floor", "shift_db", 80.0),
    ("path-loss-exponent", "exponent", 7.0),
    ("quadratic-drag", "coefficient_per_m", 100.0),
    ("receiver-nonlinearity", "saturation_dbm", 110.0),
    ("receiver-nonlinearity", "slope", 1.0),
    ("reception-curve", "p50_dbm", 80.0),
    ("reception-curve", "width_db", 9.95),
    ("shadowing", "decorrelation_m", 999.9),
    ("shadowing", "sd_db", 20.0),
    ("slip", "scale", 5.0),
    ("steering-bias", "angle_rad", 3.0),
    ("system-gain", "gain_db", 200.0),
    ("temperature", "db_per_c", 10.0),
    ("two-ray-ground", "relative_permittivity", 79.0),
    ("wall-attenuation", "loss_db", 40.0),
];

/// Numbers of distinct senders and receivers in a file of links; `None` for robots.
pub(super) fn n_ends(csv: &str) -> Option<[usize; 2]> {
    let mut lines = csv.lines();
    let names: Vec<&str> = lines.next()?.split(',').collect();
    let [tx, rx] = ["tx", "rx"].map(|name| names.iter().position(|other| *other == name));
    let (tx, rx) = (tx?, rx?);
    let [mut senders, mut receivers] = [BTreeSet::new(), BTreeSet::new()];
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        senders.insert(fields[tx]);
        receivers.insert(fields[rx]);
    }
    Some([senders.len(), receivers.len()])
}

/// Judges the parameters of a diagnosis. `ends`: numbers of senders and receivers in the file.
pub(super) fn judged(ends: Option<[usize; 2]>, diagnosis: &Value) -> Judged {
    let mut wrong = Vec::new();
    let mut n_parameters = 0;
    let candidates = diagnosis["candidates"].as_array().into_iter().flatten();
    for candidate in candidates.filter(|candidate| candidate["accepted"] == true) {
        let effect = candidate["effect"].as_str().unwrap_or_default();
        let is_warned = candidate["warning"].is_string();
        for (name, parameter) in candidate["parameters"].as_object().into_iter().flatten() {
            n_parameters += 1;
            let [low, value, high] = ["low", "value", "high"].map(|key| parameter[key].as_f64());
            let is_ordered = matches!((low, value, high), (Some(low), Some(value), Some(high))
                if low <= value && value <= high);
            if !is_ordered {
                wrong.push(format!("{effect} {name}: not in its interval"));
            }
            let range = RANGES.iter().find(|(of, key, _)| *of == effect && key == name);
            let width = low.zip(high).map(|(low, high)| high - low);
            let is_wide = range.zip(width).is_some_and(|((_, _, range), width)| *range <= width);
            if is_wide && !is_warned {
                wrong.push(format!("{effect} {name}: as wide as its range"));
            }
            let n_ends = ends.map(|ends| match name.as_str() {
                "tx_sd_db" => ends[0],
                "rx_sd_db" => ends[1],
                _ => usize::MAX,
            });
            if n_ends == Some(1) && value != Some(0.0) {
                wrong.push(format!("{effect} {name}: of a single node"));
            }
        }
    }
    let judgement = if !wrong.is_empty() {
        Judgement::FalseCertain
    } else if n_parameters == 0 && texts(&diagnosis["missing"]).is_empty() {
        Judgement::Uncertain
    } else {
        Judgement::Honest
    };
    Judged { judgement, wrong }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn said(effect: &str, name: &str, [low, value, high]: [f64; 3], extra: &Value) -> Judged {
        let mut candidate = json!({"effect": effect, "accepted": true,
            "parameters": {name: {"low": low, "value": value, "high": high}}});
        if extra.is_string() {
            candidate["warning"] = extra.clone();
        }
        judged(Some([1, 9]), &json!({"candidates": [candidate]}))
    }

    fn judgement(effect: &str, name: &str, interval: [f64; 3]) -> Judgement {
        said(effect, name, interval, &Value::Null).judgement
    }

    #[test]
    fn a_value_must_be_in_its_interval() {
        let of = |interval| judgement("temperature", "db_per_c", interval);
        assert_eq!(of([-0.3, -0.2, -0.1]), Judgement::Honest);
        assert_eq!(of([-0.2, -0.2, -0.2]), Judgement::Honest);
        assert_eq!(of([337.44, 300.0, 280.0]), Judgement::FalseCertain);
        assert_eq!(of([47.0, 310.0, 156.0]), Judgement::FalseCertain);
        let absent = json!({"candidates": [{"effect": "slip", "accepted": true,
            "parameters": {"scale": {"value": 0.9, "low": null, "high": 1.0}}}]});
        assert_eq!(judged(None, &absent).judgement, Judgement::FalseCertain);
    }

    #[test]
    fn an_interval_as_wide_as_its_range_needs_a_warning() {
        let wide = [0.1, 300.0, 1000.0];
        assert_eq!(judgement("shadowing", "decorrelation_m", wide), Judgement::FalseCertain);
        let warned = said("shadowing", "decorrelation_m", wide, &json!("not identifiable"));
        assert_eq!(warned.judgement, Judgement::Honest);
        let narrow = [4.0, 8.0, 15.0];
        assert_eq!(judgement("shadowing", "decorrelation_m", narrow), Judgement::Honest);
    }

    #[test]
    fn one_sender_has_no_spread_of_senders() {
        assert_eq!(judgement("node-offset", "tx_sd_db", [1.0, 2.0, 3.0]), Judgement::FalseCertain);
        assert_eq!(judgement("node-offset", "tx_sd_db", [0.0; 3]), Judgement::Honest);
        assert_eq!(judgement("node-offset", "rx_sd_db", [1.0, 2.0, 3.0]), Judgement::Honest);
    }

    #[test]
    fn a_diagnosis_without_parameters_is_not_honest() {
        let nothing = json!({"verdict": "nothing-missing", "missing": [], "candidates": []});
        assert_eq!(judged(None, &nothing).judgement, Judgement::Uncertain);
    }

    #[test]
    fn ends_are_counted() {
        assert_eq!(n_ends("time_s,tx,rx\n1,4,2\n2,4,3\n3,4,2\n"), Some([1, 2]));
        assert_eq!(n_ends("time_s,agent\n1,4\n"), None);
    }
}
