//! A receiver that reports one reading, whoever sends and wherever the ends are.
//!
//! Its readings vary far less than the model predicts. Their sum of squares about their mean, over the variance of the noise, is
//! noncentral χ² where the receiver works: the predictions of its rows differ. The central law is below that, so that its lower tail
//! bounds the p-value. Because a receiver with little noise also varies less, its readings must moreover not follow the
//! predictions.

use super::evidence::Evidence;
use super::{Correction, Defect};
use crate::Estimate;
use crate::thresholds::{
    FEWEST_STUCK_READINGS, FEWEST_STUCK_SENDERS, LEAST_PREDICTED_SD_DB, MOST_STUCK_VARIANCE,
};
use statrs::distribution::{ChiSquared, ContinuousCDF as _};
use std::collections::{BTreeMap, BTreeSet};

/// The name of this kind.
pub const NAME: &str = "stuck-node";

/// Sums over the readings of one receiver.
#[derive(Clone, Debug, Default)]
struct Receiver {
    rows: Vec<u32>,
    senders: BTreeSet<u32>,
    read_dbm: Vec<f64>,
    predicted_dbm: Vec<f64>,
    variances: f64,
}

/// Sum of squares about the mean, and the mean.
fn squares(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|value| (value - mean) * (value - mean)).sum(), mean)
}

impl Receiver {
    /// The p-value, where the readings do not follow the predictions.
    fn p_value(&self) -> Option<f64> {
        let n = self.rows.len();
        if n < FEWEST_STUCK_READINGS || self.senders.len() < FEWEST_STUCK_SENDERS {
            return None;
        }
        let ((read, _), (predicted, _)) = (squares(&self.read_dbm), squares(&self.predicted_dbm));
        if predicted < n as f64 * LEAST_PREDICTED_SD_DB * LEAST_PREDICTED_SD_DB
            || MOST_STUCK_VARIANCE * predicted < read
        {
            return None;
        }
        let law = ChiSquared::new((n - 1) as f64).ok()?;
        Some(law.cdf(read / (self.variances / n as f64)))
    }
}

/// Looks for receivers that are stuck.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    if !evidence.has_single_frames() {
        return None;
    }
    let rows = evidence.rows();
    let mut receivers: BTreeMap<u32, Receiver> = BTreeMap::new();
    for row in evidence.received() {
        let receiver = receivers.entry(rows[row].rx).or_default();
        receiver.rows.push(row as u32);
        receiver.senders.insert(rows[row].tx);
        receiver.read_dbm.push(rows[row].rssi_dbm);
        receiver.predicted_dbm.push(evidence.mean_dbm[row]);
        receiver.variances += evidence.sd_db[row] * evidence.sd_db[row];
    }
    let n = receivers.len() as f64;
    let mut stuck: Vec<(u32, f64, &Receiver)> = receivers
        .iter()
        // Bonferroni over receivers.
        .filter_map(|(&node, receiver)| Some((node, (n * receiver.p_value()?).min(1.0), receiver)))
        .collect();
    stuck.sort_by(|a, b| a.1.total_cmp(&b.1));
    let &(_, p_value, first) = stuck.first()?;
    let alike: Vec<&(u32, f64, &Receiver)> =
        stuck.iter().filter(|(_, p, _)| *p <= (2.0 * p_value).max(1e-6)).collect();
    let mut nodes: Vec<u32> = alike.iter().map(|(node, ..)| *node).collect();
    nodes.sort_unstable();
    let left_out: Vec<u32> = alike.iter().flat_map(|(.., one)| one.rows.iter().copied()).collect();
    let (_, mean_dbm) = squares(&first.read_dbm);
    let list: Vec<String> = nodes.iter().map(u32::to_string).collect();
    let noun = if nodes.len() == 1 { "node" } else { "nodes" };
    let estimates = vec![Estimate::new("reading_dbm", "dBm", mean_dbm, (mean_dbm, mean_dbm))];
    Some(Defect {
        name: NAME,
        p_value,
        share: left_out.len() as f64 / rows.len() as f64,
        estimates: if nodes.len() == 1 { estimates } else { Vec::new() },
        n_rows: left_out.len(),
        first_line: left_out.iter().map(|&row| rows[row as usize].line).min()?,
        runs: Vec::new(),
        clause: format!(
            "the readings of {noun} {} do not vary with the sender, as if the register were stuck",
            list.join(", ")
        ),
        nodes,
        correction: Correction::leaving_out(left_out),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn receiver(read_dbm: impl Fn(usize) -> f64, spread_db: f64) -> Receiver {
        let n = 40;
        Receiver {
            rows: (0..n as u32).collect(),
            senders: [1, 2].into(),
            read_dbm: (0..n).map(read_dbm).collect(),
            predicted_dbm: (0..n).map(|k| -70.0 + spread_db * (k % 5) as f64).collect(),
            variances: 4.0 * n as f64,
        }
    }

    #[test]
    fn a_constant_reading_is_stuck_where_predictions_differ() {
        assert!(receiver(|_| -70.0, 3.0).p_value().unwrap() < 1e-9);
        // The predictions hardly differ: a constant reading may be right.
        assert_eq!(receiver(|_| -70.0, 1.0).p_value(), None);
    }

    #[test]
    fn a_receiver_without_noise_that_follows_the_predictions_is_not_stuck() {
        assert_eq!(receiver(|k| -75.0 + 3.0 * (k % 5) as f64, 3.0).p_value(), None);
        // A fifth of the slope has 4 % of the variance.
        assert!(receiver(|k| -75.0 + 0.6 * (k % 5) as f64, 3.0).p_value().is_some());
    }

    #[test]
    fn few_readings_or_one_sender_show_nothing() {
        let mut few = receiver(|_| -70.0, 3.0);
        few.senders = [1].into();
        assert_eq!(few.p_value(), None);
    }
}
