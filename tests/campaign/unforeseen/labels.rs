//! Defects of the other columns: headings, times, channels, positions, sender and receiver.

use super::air::{Air, Sent, layout, n_rows, with_column};
use super::answer::Scope;
use super::readings::{defect, of_node};
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use crate::campaign::effect::cardioids;
use crate::campaign::radio;
use crate::campaign::world::{At, Layout, Path, Row, World, rounded};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt::Write as _;

/// The rows as logged, and their readings.
struct Log {
    rows: Vec<Row>,
    readings: Vec<Option<f64>>,
}

impl Log {
    /// The true rows with an error in each.
    fn new(air: &Air, sent: &Sent, mut change: impl FnMut(&mut Row)) -> Self {
        let mut rows = air.world.rows.clone();
        rows.iter_mut().for_each(&mut change);
        Self { rows, readings: sent.readings.clone() }
    }

    /// Root mean square error over received rows of a model given the rows as logged, divided by the noise.
    fn error_over_noise(&self, air: &Air, sent: &Sent, model_db: impl Fn(&Row) -> f64) -> f64 {
        let squares: Vec<f64> = (self.rows.iter().zip(&self.readings))
            .filter_map(|(row, reading)| {
                Some((reading.as_ref()? - sent.tx_power_dbm - model_db(row)).powi(2))
            })
            .collect();
        let noise_square = air.noise_sd_db.powi(2) + 1.0 / 12.0;
        (squares.iter().sum::<f64>() / squares.len() as f64 / noise_square).sqrt()
    }

    fn csv(&self, air: &Air) -> String {
        World { rows: self.rows.clone(), ..air.world.clone() }.csv(&self.readings)
    }
}

fn base_db(air: &Air, row: &Row) -> f64 {
    air.world.base.gain_db(row.distance_m(), row.channel)
}

fn case(csv: String, config_toml: String, answer: super::answer::Answer) -> Case {
    Case { csv, config_toml, expected: Expected::Answer(answer) }
}

/// A place of some fixed and some moving nodes.
fn place(seed: u64, n_fixed: [usize; 2], n_moving: [usize; 2]) -> Layout {
    let mut draws = Draws::new(seed, "nodes");
    let mut among = |[low, high]: [usize; 2]| low + draws.below(high - low + 1);
    let (n_fixed, n_moving) = (among(n_fixed), among(n_moving));
    Layout { n_fixed, n_moving, ..layout(seed, draws.between(2.0, 6.0)) }
}

/// Front-to-back ratio (dB) and boresight (rad) of the configured antenna pattern.
fn pattern(seed: u64) -> (f64, f64) {
    let mut draws = Draws::new(seed, "pattern");
    (rounded(draws.between(8.0, 20.0), 1), rounded(draws.between(-PI, PI), 2))
}

/// Honest: `measurement:heading-convention`. Headings are logged clockwise from north; the antenna pattern is configured.
pub(super) fn heading_convention(seed: u64) -> Case {
    let mut air = Air::new(seed, &place(seed, [0, 0], [6, 9]), n_rows(seed, 3000, 4800));
    let (front_to_back_db, boresight_rad) = pattern(seed);
    let pattern_db = |row: &Row| front_to_back_db * cardioids(row, boresight_rad, &[]);
    air.add_known(|_, row| pattern_db(row));
    let sent = air.send();
    let log = Log::new(&air, &sent, |row| {
        for at in [&mut row.tx_at, &mut row.rx_at] {
            at.heading_rad = at.heading_rad.map(compass_rad);
        }
    });
    let answer = defect("measurement:heading-convention", Scope::default())
        .with_structure(&["tx_bearing_rad", "rx_bearing_rad", "tx_heading_rad", "rx_heading_rad"])
        .with_error(log.error_over_noise(&air, &sent, |row| base_db(&air, row) + pattern_db(row)));
    let config_toml = format!(
        "{}\n[[netsim.phy.effect]]\nkind = \"antenna-pattern\"\nfront_to_back_db = {front_to_back_db:?}\n\
         boresight_rad = {boresight_rad:?}\n",
        air.config(&sent)
    );
    case(log.csv(&air), config_toml, answer)
}

/// Converts an angle counter-clockwise from east into one clockwise from north.
fn compass_rad(heading_rad: f64) -> f64 {
    rounded((FRAC_PI_2 - heading_rad + PI).rem_euclid(TAU) - PI, 4)
}

/// The receiver whose clock is wrong, and its error (s).
fn skew(seed: u64, n_nodes: usize) -> (usize, f64) {
    let mut draws = Draws::new(seed, "clock");
    let late_s = draws.between(4.0, 8.0);
    (draws.below(n_nodes), rounded(if draws.chance(0.5) { late_s } else { -late_s }, 2))
}

/// Honest: `measurement:clock-skew`. One receiver's clock is wrong, so its readings are joined with the positions of another time.
pub(super) fn clock_skew(seed: u64) -> Case {
    let place = place(seed, [2, 6], [5, 8]);
    let air = Air::new(seed, &place, n_rows(seed, 3000, 4800));
    let sent = air.send();
    let (node, late_s) = skew(seed, air.world.n_nodes);
    let paths: Vec<Path> = (0..place.n_moving)
        .map(|k| Path::new(&mut Draws::new(seed, &format!("path {k}")), &place))
        .collect();
    let at = |of: usize, before: At, time_s: f64| match of.checked_sub(place.n_fixed) {
        Some(k) => At { z_m: before.z_m, ..paths[k].place_at(time_s) },
        None => before,
    };
    let mut log = Log::new(&air, &sent, |row| {
        let stamp_s = rounded(row.time_s + late_s, 2);
        if row.rx == node && (0.0..=place.duration_s).contains(&stamp_s) {
            row.tx_at = at(row.tx, row.tx_at, stamp_s);
            row.rx_at = at(row.rx, row.rx_at, stamp_s);
            row.time_s = stamp_s;
        }
    });
    // Rows with times before the start or after the end are dropped.
    let is_kept =
        |row: &Row| row.rx != node || (0.0..=place.duration_s).contains(&(row.time_s + late_s));
    let kept: Vec<bool> = air.world.rows.iter().map(is_kept).collect();
    let mut is_kept = kept.iter();
    log.rows.retain(|_| is_kept.next() == Some(&true));
    let mut is_kept = kept.iter();
    log.readings.retain(|_| is_kept.next() == Some(&true));
    let answer = defect("measurement:clock-skew", of_node(node))
        .with_structure(&["receiver"])
        .with_error(log.error_over_noise(&air, &sent, |row| base_db(&air, row)));
    case(log.csv(&air), air.config(&sent), answer)
}

/// The error of channel labels: 1 or -1.
fn shift(seed: u64) -> i16 {
    if Draws::new(seed, "labels").chance(0.5) { 1 } else { -1 }
}

/// Centre (MHz) and duty cycle of the configured interference.
fn bands(seed: u64) -> [(f64, f64); 2] {
    let mut draws = Draws::new(seed, "bands");
    let order = draws.order(3);
    [0, 1].map(|k| ([2412.0, 2437.0, 2462.0][order[k]], rounded(draws.between(0.4, 0.7), 2)))
}

fn channel_air(seed: u64) -> Air {
    let place = place(seed, [6, 12], [0, 5]);
    let mut world = World::new(seed, &place, &[], n_rows(seed, 3500, 5000));
    // All labels stay in 11 to 26.
    let (lowest, beyond) = if shift(seed) == 1 { (11, 26) } else { (12, 11) };
    for row in world.rows.iter_mut().filter(|row| row.channel == beyond) {
        row.channel = lowest + (row.frame % 15) as u8;
    }
    let mut air = Air::of(seed, &place, world);
    for (index, row) in air.world.rows.iter().enumerate() {
        let passes = bands(seed).map(|(centre_mhz, duty)| {
            let off_mhz = (radio::centre_mhz(row.channel) - centre_mhz).abs();
            if off_mhz <= 11.0 { 1.0 - duty } else { 1.0 }
        });
        air.loss[index] = 1.0 - passes.iter().product::<f64>();
    }
    air
}

/// Honest: `measurement:channel-shift`. Channel labels are shifted by one; interference on two bands is configured.
pub(super) fn channel_shift(seed: u64) -> Case {
    let air = channel_air(seed);
    let sent = air.send();
    let shift = shift(seed);
    let log = Log::new(&air, &sent, |row| {
        row.channel = u8::try_from(i16::from(row.channel) + shift).expect("between 11 and 26");
    });
    let answer = defect("measurement:channel-shift", Scope::default())
        .with_structure(&["frequency_mhz", "channel"])
        .with_error(log.error_over_noise(&air, &sent, |row| base_db(&air, row)));
    let mut config_toml = air.config(&sent);
    for (centre_mhz, duty) in bands(seed) {
        let _ = write!(
            config_toml,
            "\n[[netsim.phy.effect]]\nkind = \"interference\"\ncentre_mhz = {centre_mhz:?}\nduty = {duty:?}\n"
        );
    }
    case(log.csv(&air), config_toml, answer)
}

/// Adds noise of 1 to 2 m to the positions of moving nodes, independently in every frame.
fn with_position_noise(seed: u64, air: &Air, sent: &Sent) -> Log {
    let mut draws = Draws::new(seed, "places off");
    let sd_m = draws.between(1.0, 2.0);
    let off_m: Vec<Vec<[f64; 2]>> = air
        .world
        .frames
        .iter()
        .map(|all| all.iter().map(|_| [sd_m * draws.normal(), sd_m * draws.normal()]).collect())
        .collect();
    let n_fixed = air.world.n_fixed;
    Log::new(air, sent, |row| {
        for (node, at) in [(row.tx, &mut row.tx_at), (row.rx, &mut row.rx_at)] {
            if n_fixed <= node {
                for (place_m, off_m) in at.plane_m.iter_mut().zip(off_m[row.frame][node]) {
                    *place_m = rounded(*place_m + off_m, 3);
                }
            }
        }
    })
}

/// Honest: `measurement:position-noise`.
pub(super) fn position_noise(seed: u64) -> Case {
    let (csv, config_toml, error) = with_noisy_places(seed);
    let answer = defect("measurement:position-noise", Scope::default()).with_error(error);
    case(csv, config_toml, answer)
}

/// File, configuration and error over noise of a campaign with noisy positions of moving nodes.
pub(super) fn with_noisy_places(seed: u64) -> (String, String, f64) {
    let place = place(seed, [4, 8], [5, 8]);
    let place = Layout { noise_db: place.noise_db.min(1.2), ..place };
    let air = Air::new(seed, &place, n_rows(seed, 3500, 5000));
    let sent = air.send();
    let log = with_position_noise(seed, &air, &sent);
    let error = log.error_over_noise(&air, &sent, |row| base_db(&air, row));
    (log.csv(&air), air.config(&sent), error)
}

/// The configured offsets of each node as transmitter and as receiver (dB).
fn known_offsets(seed: u64, n_nodes: usize) -> [Vec<f64>; 2] {
    let mut draws = Draws::new(seed, "known offsets");
    [(); 2].map(|()| (0..n_nodes).map(|_| rounded(4.0 * draws.normal(), 1)).collect())
}

/// Honest: `measurement:swapped-ends`. Sender and receiver are swapped in one run, or in the log of one receiver. Node offsets are
/// configured.
pub(super) fn swapped_ends(seed: u64) -> Case {
    let mut air = Air::new(seed, &place(seed, [7, 12], [0, 4]), n_rows(seed, 3000, 4800));
    let n_nodes = air.world.n_nodes;
    let [tx_db, rx_db] = known_offsets(seed, n_nodes);
    let offsets_db = |row: &Row| tx_db[row.tx] + rx_db[row.rx];
    air.add_known(|_, row| offsets_db(row));
    let sent = air.send();
    let mut draws = Draws::new(seed, "exchanged");
    let n_runs = 3 + draws.below(3);
    let duration_s = air.world.duration_s;
    let run = |row: &Row| 1 + (row.time_s / duration_s * n_runs as f64) as usize;
    let in_one_run = draws.chance(0.5);
    let [wrong_run, node] = [1 + draws.below(n_runs), draws.below(n_nodes)];
    let log = Log::new(&air, &sent, |row| {
        if if in_one_run { run(row) == wrong_run } else { row.rx == node } {
            std::mem::swap(&mut row.tx, &mut row.rx);
            std::mem::swap(&mut row.tx_at, &mut row.rx_at);
        }
    });
    let scope = if in_one_run {
        Scope { runs: Some(vec![wrong_run as u64]), ..Scope::default() }
    } else {
        of_node(node)
    };
    let answer = defect("measurement:swapped-ends", scope)
        .with_structure(&["run", "transmitter", "receiver"])
        .with_error(log.error_over_noise(&air, &sent, |row| base_db(&air, row) + offsets_db(row)));
    let config_toml = format!(
        "{}\n[[netsim.phy.effect]]\nkind = \"node-offset\"\ntx_db = {tx_db:?}\nrx_db = {rx_db:?}\n",
        air.config(&sent)
    );
    let csv = with_column(&log.csv(&air), "run", |line| run(&log.rows[line]).to_string());
    case(csv, config_toml, answer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{deviation, mean};

    fn error(case: &Case) -> f64 {
        let Expected::Answer(answer) = &case.expected else { panic!("an answer is expected") };
        answer.error_over_noise
    }

    #[test]
    fn compass_headings_count_clockwise_from_north() {
        // East, north, west, south.
        let compass = [0.0, FRAC_PI_2, PI, -FRAC_PI_2].map(compass_rad);
        for (said, expected) in compass.into_iter().zip([FRAC_PI_2, 0.0, -FRAC_PI_2, -PI]) {
            assert!((said - expected).abs() < 1e-3, "{compass:?}");
        }
        for seed in 0..3 {
            let case = heading_convention(seed);
            assert!(1.3 < error(&case), "{}", error(&case));
            assert!(case.config_toml.contains("antenna-pattern"));
        }
    }

    #[test]
    fn only_the_receiver_with_the_wrong_clock_has_other_times() {
        for seed in 0..4 {
            let case = clock_skew(seed);
            assert!(case.csv.lines().count() <= 4801);
            let fields =
                |line: &str, k: usize| -> f64 { line.split(',').nth(k).unwrap().parse().unwrap() };
            let place = place(seed, [2, 6], [5, 8]);
            let air = Air::new(seed, &place, n_rows(seed, 3000, 4800));
            let (node, late_s) = skew(seed, air.world.n_nodes);
            let lines: Vec<&str> = case.csv.lines().skip(1).collect();
            let mut n_late = 0;
            let mut lines = lines.iter();
            let mut line = lines.next();
            for row in &air.world.rows {
                let Some(here) = line else { break };
                let stamp_s = fields(here, 0);
                let is_row =
                    fields(here, 1) as usize == row.tx && fields(here, 2) as usize == row.rx;
                let expected_s = if row.rx == node { row.time_s + late_s } else { row.time_s };
                if is_row && (stamp_s - expected_s).abs() < 0.006 {
                    n_late += usize::from(row.rx == node);
                    line = lines.next();
                } else {
                    assert_eq!(row.rx, node, "only its rows may be missing");
                }
            }
            assert!(line.is_none() && 100 < n_late, "{n_late}");
        }
    }

    #[test]
    fn interference_acts_on_the_true_channel() {
        let seed = 3;
        let air = channel_air(seed);
        let sent = air.send();
        let [(centre_mhz, duty), _] = bands(seed);
        // Strong rows pass but for the traffic.
        let strong: Vec<f64> = (0..air.world.rows.len())
            .filter(|&row| -75.0 < sent.tx_power_dbm + air.level_db[row])
            .filter(|&row| {
                (radio::centre_mhz(air.world.rows[row].channel) - centre_mhz).abs() <= 11.0
            })
            .map(|row| f64::from(u8::from(sent.readings[row].is_some())))
            .collect();
        let tolerance = 4.0 * 0.5 / (strong.len() as f64).sqrt();
        assert!((mean(&strong) - (1.0 - duty)).abs() < tolerance, "{} {duty}", mean(&strong));
        let case = channel_shift(seed);
        let labels: Vec<u8> = case
            .csv
            .lines()
            .skip(1)
            .map(|line| line.split(',').nth(3).unwrap().parse().unwrap())
            .collect();
        for (label, row) in labels.iter().zip(&air.world.rows) {
            assert!((11..=26).contains(label));
            assert_eq!(i16::from(*label) - i16::from(row.channel), shift(seed));
        }
    }

    #[test]
    fn only_positions_of_moving_nodes_are_noisy() {
        let seed = 5;
        let air = Air::new(seed, &place(seed, [4, 8], [5, 8]), 4000);
        let sent = air.send();
        let log = with_position_noise(seed, &air, &sent);
        let off: Vec<f64> = (air.world.rows.iter().zip(&log.rows))
            .map(|(truth, said)| {
                let off_m = said.tx_at.plane_m[0] - truth.tx_at.plane_m[0];
                assert!(air.world.n_fixed <= truth.tx || off_m == 0.0);
                off_m
            })
            .filter(|off_m| *off_m != 0.0)
            .collect();
        assert!((0.85..2.3).contains(&deviation(&off)), "{}", deviation(&off));
        assert!(mean(&off).abs() < 0.6);
        assert!(1.02 < error(&position_noise(seed)));
    }

    #[test]
    fn swapped_ends_contradict_the_configured_offsets() {
        for seed in 0..4 {
            let case = swapped_ends(seed);
            assert!(1.2 < error(&case), "{}", error(&case));
            assert!(case.csv.lines().next().unwrap().ends_with(",run"));
        }
    }
}
