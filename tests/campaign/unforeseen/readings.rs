//! Defects of readings: a register with a floor, a receiver stuck at one reading, outliers, duplicated lines.

use super::air::{Air, Sent, layout, n_rows};
use super::answer::{Answer, Claim, Scope};
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use crate::campaign::world::Layout;

/// Honest: `measurement:register-floor`. The register of every receiver stops at a floor, and weaker frames read as the floor.
pub(super) fn register_floor(seed: u64) -> Case {
    let (air, mut sent) = sent(seed);
    let floor_dbm = floor_dbm(seed);
    for reading in sent.readings.iter_mut().flatten() {
        *reading = reading.max(floor_dbm);
    }
    let answer = defect("measurement:register-floor", Scope::default());
    case(
        &air,
        &sent,
        answer.with_structure(&["distance_m", "log10_distance", "predicted_rssi_dbm"]),
    )
}

fn floor_dbm(seed: u64) -> f64 {
    -92.0 + Draws::new(seed, "floor").below(5) as f64
}

/// Honest: `measurement:stuck-node`. One receiver reports the same reading for every frame.
pub(super) fn stuck_node(seed: u64) -> Case {
    let (air, mut sent) = sent(seed);
    let (node, stuck_dbm) = stuck_receiver(seed, &air);
    for (row, reading) in air.world.rows.iter().zip(&mut sent.readings) {
        if row.rx == node {
            *reading = reading.map(|_| stuck_dbm);
        }
    }
    let answer = defect("measurement:stuck-node", of_node(node));
    case(&air, &sent, answer.with_structure(&["receiver"]))
}

/// The receiver and its reading (dBm).
fn stuck_receiver(seed: u64, air: &Air) -> (usize, f64) {
    let mut draws = Draws::new(seed, "stuck");
    (draws.below(air.world.n_nodes), draws.between(-85.0, -55.0).round())
}

/// Honest: `measurement:outliers`. About 1 % of the readings are off by 15 to 40 dB.
pub(super) fn outliers(seed: u64) -> Case {
    let (air, mut sent) = sent(seed);
    add_outliers(&mut sent, seed);
    case(&air, &sent, defect("measurement:outliers", Scope::default()))
}

/// Adds gross errors to 0.7 to 1.5 % of the readings.
pub(super) fn add_outliers(sent: &mut Sent, seed: u64) {
    let mut draws = Draws::new(seed, "outliers");
    let share = draws.between(0.007, 0.015);
    for reading in sent.readings.iter_mut().flatten() {
        if draws.chance(share) {
            let off_db = draws.between(15.0, 40.0).round();
            let is_above = draws.chance(0.5);
            *reading += if is_above { off_db } else { -off_db };
        }
    }
}

/// Honest: `measurement:duplicates`. Random lines of the log are doubled, or all lines of an interval.
pub(super) fn duplicates(seed: u64) -> Case {
    let (air, sent) = sent(seed);
    let csv = air.csv(&sent);
    let lines: Vec<&str> = csv.lines().collect();
    let is_duplicate = duplicate_lines(seed, lines.len() - 1);
    let mut text = format!("{}\n", lines[0]);
    for (line, is_doubled) in lines[1..].iter().zip(is_duplicate) {
        for _ in 0..1 + usize::from(is_doubled) {
            text.push_str(line);
            text.push('\n');
        }
    }
    let answer = defect("measurement:duplicates", Scope::default());
    Case { csv: text, ..case(&air, &sent, answer) }
}

/// Whether each line is doubled.
fn duplicate_lines(seed: u64, n_lines: usize) -> Vec<bool> {
    let mut draws = Draws::new(seed, "duplicates");
    let share = draws.between(0.05, 0.2);
    if draws.chance(0.5) {
        return (0..n_lines).map(|_| draws.chance(share)).collect();
    }
    let n_doubled = (share * n_lines as f64) as usize;
    let first = draws.below(n_lines - n_doubled);
    (0..n_lines).map(|line| (first..first + n_doubled).contains(&line)).collect()
}

fn sent(seed: u64) -> (Air, Sent) {
    let air = Air::new(seed, &Layout { ..layout(seed, 10.0) }, n_rows(seed, 3000, 4800));
    let sent = air.send();
    (air, sent)
}

/// The answer that names a defect of the measurement.
pub(super) fn defect(name: &'static str, scope: Scope) -> Answer {
    let claim = Claim { scope: Scope { is_optional: true, ..scope }, ..Claim::of(name) };
    // The physics of the model is right, so either verdict is honest if the defect is named.
    Answer { verdicts: vec!["missing-effects", "nothing-missing"], ..Answer::of(vec![claim]) }
}

/// The scope of one node.
pub(super) fn of_node(node: usize) -> Scope {
    Scope { nodes: Some(vec![node as u64]), ..Scope::default() }
}

fn case(air: &Air, sent: &Sent, answer: Answer) -> Case {
    let answer = answer.with_error(air.error_over_noise(sent));
    Case { csv: air.csv(sent), config_toml: air.config(sent), expected: Expected::Answer(answer) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Receiver and reading of the rows that were received.
    fn readings(csv: &str) -> Vec<(usize, f64)> {
        csv.lines()
            .skip(1)
            .filter_map(|line| {
                let fields: Vec<&str> = line.split(',').collect();
                Some((fields[2].parse().unwrap(), fields[10].parse().ok()?))
            })
            .collect()
    }

    #[test]
    fn no_reading_is_below_the_floor_and_many_are_at_it() {
        for seed in 0..5 {
            let floor_dbm = floor_dbm(seed);
            let readings = readings(&register_floor(seed).csv);
            let n_on = readings.iter().filter(|(_, reading)| (reading - floor_dbm).abs() < 0.5);
            let share = n_on.count() as f64 / readings.len() as f64;
            assert!(readings.iter().all(|(_, reading)| floor_dbm <= *reading));
            assert!((0.02..0.6).contains(&share), "{share}");
        }
    }

    #[test]
    fn one_receiver_is_stuck() {
        let (air, _) = sent(4);
        let (node, stuck_dbm) = stuck_receiver(4, &air);
        let readings = readings(&stuck_node(4).csv);
        let values_of = |node: usize| {
            readings.iter().filter(move |(rx, _)| *rx == node).map(|(_, value)| *value as i64)
        };
        assert_eq!(values_of(node).collect::<BTreeSet<_>>(), BTreeSet::from([stuck_dbm as i64]));
        let other = usize::from(node == 0);
        assert!(8 < values_of(other).collect::<BTreeSet<_>>().len());
    }

    #[test]
    fn about_one_reading_in_a_hundred_is_an_outlier() {
        let (_, clean) = sent(5);
        let (_, mut spoiled) = sent(5);
        add_outliers(&mut spoiled, 5);
        let off: Vec<f64> = (clean.readings.iter().zip(&spoiled.readings))
            .filter_map(|(clean, spoiled)| Some((spoiled.as_ref()? - clean.as_ref()?).abs()))
            .collect();
        let n_off = off.iter().filter(|off| 0.0 < **off).count() as f64;
        let n = off.len() as f64;
        assert!(off.iter().all(|off| *off == 0.0 || (15.0..=40.0).contains(off)));
        // 0.7 to 1.5 %, within four standard errors.
        let se = (0.015 / n).sqrt();
        assert!((0.007 - 4.0 * se..0.015 + 4.0 * se).contains(&(n_off / n)), "{n_off} of {n}");
    }

    #[test]
    fn duplicates_follow_their_originals() {
        for seed in 0..4 {
            let case = duplicates(seed);
            let lines: Vec<&str> = case.csv.lines().skip(1).collect();
            let n_twice = lines.windows(2).filter(|pair| pair[0] == pair[1]).count();
            let distinct: BTreeSet<&str> = lines.iter().copied().collect();
            assert_eq!(distinct.len() + n_twice, lines.len());
            let share = n_twice as f64 / distinct.len() as f64;
            assert!((0.035..0.22).contains(&share), "{share}");
        }
    }
}
