//! Received power, reception and files of the link campaigns.

use crate::campaign::draws::Draws;
use crate::campaign::link::bisected;
use crate::campaign::radio;
use crate::campaign::world::{Layout, Row, World, rounded};

/// A link campaign before its frames are sent.
pub(super) struct Air {
    pub(super) world: World,
    /// True mean received power of every row at a transmit power of 0 dBm (dB).
    pub(super) level_db: Vec<f64>,
    /// The same, of the model as configured (dB).
    pub(super) model_db: Vec<f64>,
    /// Noise of every frame and receiver (dB).
    pub(super) noise_db: Vec<f64>,
    /// Its standard deviation (dB).
    pub(super) noise_sd_db: f64,
    /// Probability that a frame is lost for another reason than its strength, per row.
    pub(super) loss: Vec<f64>,
    luck: Vec<f64>,
    share: f64,
}

/// The frames after reception.
pub(super) struct Sent {
    pub(super) tx_power_dbm: f64,
    /// Per row what was read (dBm), if the frame was received.
    pub(super) readings: Vec<Option<f64>>,
}

impl Air {
    /// The air of a layout, in which the model as configured is right, with white noise.
    pub(super) fn new(seed: u64, layout: &Layout, n_rows: usize) -> Self {
        Self::of(seed, layout, World::new(seed, layout, &[], n_rows))
    }

    /// The same, of a world that exists.
    pub(super) fn of(seed: u64, layout: &Layout, world: World) -> Self {
        let (mut noise, mut luck) = (Draws::new(seed, "noise"), Draws::new(seed, "reception"));
        let base = |row: &Row| world.base.gain_db(row.distance_m(), row.channel);
        let model_db: Vec<f64> = world.rows.iter().map(base).collect();
        Self {
            level_db: model_db.clone(),
            model_db,
            noise_db: world.rows.iter().map(|_| layout.noise_db * noise.normal()).collect(),
            noise_sd_db: layout.noise_db,
            loss: vec![0.0; world.rows.len()],
            luck: world.rows.iter().map(|_| luck.uniform()).collect(),
            share: Draws::new(seed, "share").between(0.61, 0.9),
            world,
        }
    }

    /// Adds to the true received power of every row (dB), but not to the model.
    pub(super) fn add(&mut self, added_db: impl Fn(usize, &Row) -> f64) {
        for (index, row) in self.world.rows.iter().enumerate() {
            self.level_db[index] += added_db(index, row);
        }
    }

    /// Adds to the true received power of every row and to the model (dB).
    pub(super) fn add_known(&mut self, added_db: impl Fn(usize, &Row) -> f64) {
        for (index, row) in self.world.rows.iter().enumerate() {
            let added_db = added_db(index, row);
            self.level_db[index] += added_db;
            self.model_db[index] += added_db;
        }
    }

    /// Sends every frame, at the transmit power at which the share drawn for this seed is received, of the frames that
    /// are not lost for another reason.
    pub(super) fn send(&self) -> Sent {
        let n = self.level_db.len();
        let not_lost: f64 = self.loss.iter().map(|loss| 1.0 - loss).sum();
        let tx_power_dbm = bisected(-90.0, 90.0, 24, |power_dbm| {
            let passes =
                |row| radio::table(power_dbm + self.power_db(row)) * (1.0 - self.loss[row]);
            (0..n).map(passes).sum::<f64>() < self.share * not_lost
        });
        let tx_power_dbm = rounded(tx_power_dbm, 1);
        let reading = |row: usize| {
            let power_dbm = tx_power_dbm + self.power_db(row);
            let passes = radio::table(power_dbm) * (1.0 - self.loss[row]);
            (self.luck[row] < passes).then(|| power_dbm.round())
        };
        Sent { tx_power_dbm, readings: (0..n).map(reading).collect() }
    }

    fn power_db(&self, row: usize) -> f64 {
        self.level_db[row] + self.noise_db[row]
    }

    /// Root mean square error of the mean of the model as configured over received rows (dB).
    pub(super) fn plain_rmse_db(&self, sent: &Sent) -> f64 {
        let errors = sent.readings.iter().zip(&self.model_db).filter_map(|(reading, level_db)| {
            reading.map(|reading| reading - sent.tx_power_dbm - level_db)
        });
        let errors: Vec<f64> = errors.collect();
        (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
    }

    /// The same, divided by the standard deviation of noise and rounding.
    pub(super) fn error_over_noise(&self, sent: &Sent) -> f64 {
        self.plain_rmse_db(sent) / (self.noise_sd_db.powi(2) + 1.0 / 12.0).sqrt()
    }

    /// The file.
    pub(super) fn csv(&self, sent: &Sent) -> String {
        self.world.csv(&sent.readings)
    }

    /// The configuration.
    pub(super) fn config(&self, sent: &Sent) -> String {
        self.world.config(sent.tx_power_dbm, None)
    }
}

/// A layout drawn from a seed, with at most 2 dB of noise and nodes that move at up to `speed_mps`.
pub(super) fn layout(seed: u64, speed_mps: f64) -> Layout {
    let drawn = Layout::drawn(seed);
    let noise_db = drawn.noise_db.min(2.0);
    Layout { speed_mps, noise_db, ..drawn }
}

/// The number of rows of a campaign, drawn between two bounds.
pub(super) fn n_rows(seed: u64, low: usize, high: usize) -> usize {
    low + Draws::new(seed, "rows").below(high - low + 1)
}

/// An Ornstein-Uhlenbeck process (Uhlenbeck and Ornstein 1930) at ascending times. `tau_s`: correlation time; `sd`: stationary
/// standard deviation.
pub(super) fn ornstein_uhlenbeck(
    draws: &mut Draws,
    times_s: impl Iterator<Item = f64>,
    tau_s: f64,
    sd: f64,
) -> Vec<f64> {
    let (mut value, mut last_s) = (sd * draws.normal(), None);
    times_s
        .map(|time_s| {
            let kept = last_s.map_or(1.0, |last_s: f64| (-(time_s - last_s) / tau_s).exp());
            value = kept * value + sd * (1.0 - kept * kept).sqrt() * draws.normal();
            last_s = Some(time_s);
            value
        })
        .collect()
}

/// A random walk at ascending times, 0 at the first. `per_root_s`: its standard deviation after a second.
pub(super) fn random_walk(
    draws: &mut Draws,
    times_s: impl Iterator<Item = f64>,
    per_root_s: f64,
) -> Vec<f64> {
    let (mut value, mut last_s) = (0.0, None);
    times_s
        .map(|time_s| {
            let since_s = last_s.map_or(0.0, |last_s: f64| time_s - last_s);
            value += per_root_s * since_s.sqrt() * draws.normal();
            last_s = Some(time_s);
            value
        })
        .collect()
}

/// The value of each row's frame.
pub(super) fn per_frame(world: &World, values: &[f64]) -> Vec<f64> {
    world.rows.iter().map(|row| values[row.frame]).collect()
}

/// Time of every frame (s).
pub(super) fn frame_times(world: &World) -> Vec<f64> {
    let mut times = vec![0.0; world.frames.len()];
    for row in &world.rows {
        times[row.frame] = row.time_s;
    }
    times
}

/// A file with one more column.
pub(super) fn with_column(csv: &str, name: &str, value: impl Fn(usize) -> String) -> String {
    let mut lines = csv.lines();
    let mut text = format!("{},{name}\n", lines.next().unwrap_or_default());
    for (index, line) in lines.enumerate() {
        text.push_str(line);
        text.push(',');
        text.push_str(&value(index));
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{deviation, mean};

    #[test]
    fn a_drift_has_its_spread_and_its_correlation() {
        let mut draws = Draws::new(1, "process");
        let times = || (0..200_000).map(|k| f64::from(k) * 10.0);
        let drift = ornstein_uhlenbeck(&mut draws, times(), 100.0, 2.0);
        // 2,000,000 s of a process with an integral time of 200 s are worth 10,000 values: four standard errors.
        assert!(mean(&drift).abs() < 0.08, "{}", mean(&drift));
        assert!((deviation(&drift) - 2.0).abs() < 0.06, "{}", deviation(&drift));
        let lagged =
            |k: usize| mean(&drift.windows(k + 1).map(|w| w[0] * w[k]).collect::<Vec<_>>()) / 4.0;
        assert!((lagged(10) - (-1.0_f64).exp()).abs() < 0.04, "{}", lagged(10));
    }

    #[test]
    fn a_random_walk_spreads_with_the_root_of_time() {
        let ends: Vec<f64> = (0..2000)
            .map(|seed| {
                let times = (0..50).map(|k| f64::from(k) * 2.0);
                let walk = random_walk(&mut Draws::new(seed, "walk"), times, 0.5);
                assert!(walk[0].abs() < 1e-12);
                walk[49]
            })
            .collect();
        // 0.5 √98; a standard deviation of 2,000 values has a standard error of 1.6 %.
        assert!((deviation(&ends) / (0.5 * 98.0_f64.sqrt()) - 1.0).abs() < 0.064);
    }

    #[test]
    fn the_share_drawn_is_received_and_the_model_errs_by_its_noise() {
        let layout = layout(3, 5.0);
        let air = Air::new(3, &layout, 5000);
        let sent = air.send();
        let share = sent.readings.iter().flatten().count() as f64 / sent.readings.len() as f64;
        assert!((share - air.share).abs() < 0.03, "{share}");
        // Weak frames are received where noise helped them.
        let error = air.error_over_noise(&sent);
        assert!((0.9..1.1).contains(&error), "{error}");
        let mut louder = Air::new(3, &layout, 5000);
        louder.add(|_, _| 40.0);
        let sent = louder.send();
        let error = louder.plain_rmse_db(&sent);
        assert!((error - 40.0).abs() < 1.0, "{error}");
        assert!(louder.csv(&sent).lines().count() == 1 + sent.readings.len());
    }

    #[test]
    fn a_column_is_added_to_every_line() {
        let text = with_column("a,b\n1,2\n3,4\n", "c", |line| line.to_string());
        assert_eq!(text, "a,b,c\n1,2,0\n3,4,1\n");
    }
}
