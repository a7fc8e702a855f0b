//! The radio world of set C: one channel, readings in tenths of a decibel, logistic noise, a radio whose reception has a sharp edge;
//! sensors in a field and a drone above them, or sensors alone.

use crate::campaign::draws::Draws;
use crate::campaign::situations::Case;
use crate::campaign::situations::files::{LinkRow, Log, links};
use crate::campaign::situations::reference::{Rival, truth};
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::{PI, TAU};

/// The number of the drone.
pub(super) const DRONE: usize = 0;

/// A campaign in the making.
pub(super) struct Field {
    pub(super) draws: Draws,
    pub(super) rows: Vec<LinkRow>,
    pub(super) n_sensors: usize,
    pub(super) radius_m: f64,
    pub(super) duration_s: f64,
    pub(super) carrier_hz: f64,
    pub(super) noise_db: f64,
    flight: Flight,
    errors_db: Vec<f64>,
    added_db: Vec<f64>,
    pub(super) loss: Vec<f64>,
    causes: Vec<(Cause, Vec<f64>)>,
    pub(super) consequences: Vec<&'static str>,
    columns: Vec<&'static str>,
    pub(super) sections: String,
    /// Mean margin above the edge of reception (dB).
    pub(super) margin_db: f64,
}

/// A drone on a spiral out and in, up and down.
#[derive(Clone, Debug)]
struct Flight {
    reach_m: f64,
    lap_s: f64,
    out_s: f64,
    height_m: [f64; 2],
}

impl Flight {
    fn at(&self, time_s: f64) -> [f64; 3] {
        let reach = self.reach_m * (0.15 + 0.85 * (PI * time_s / self.out_s).sin().abs());
        let (sin, cos) = (TAU * time_s / self.lap_s).sin_cos();
        let height =
            self.height_m[0] + self.height_m[1] * (TAU * time_s / (1.7 * self.out_s)).cos();
        [reach * cos, reach * sin, height]
    }
}

impl Field {
    /// A drone that polls sensors, each in turn answering.
    pub(super) fn drone(seed: u64) -> Self {
        Self::of(seed, true, 0)
    }

    /// Sensors alone, by random pairs.
    pub(super) fn mesh(seed: u64) -> Self {
        Self::of(seed, false, 0)
    }

    /// `n_rows`: 0 for a number that is drawn.
    pub(super) fn of(seed: u64, has_drone: bool, n_rows: usize) -> Self {
        let mut draws = Draws::new(seed, "field of set C");
        let n_sensors = 8 + draws.below(7);
        let radius_m = draws.between(40.0, 200.0);
        let sensors: Vec<[f64; 3]> = (0..=n_sensors)
            .map(|_| {
                let [away, angle] = [draws.uniform().sqrt() * radius_m, draws.between(0.0, TAU)];
                [away * angle.cos(), away * angle.sin(), draws.between(0.3, 1.8)]
                    .map(|place| rounded(place, 2))
            })
            .collect();
        let n_rows = if n_rows == 0 { 2200 + draws.below(1500) } else { n_rows };
        let duration_s = draws.between(900.0, 3600.0);
        let flight = Flight {
            reach_m: radius_m,
            lap_s: draws.between(0.5, 1.0) * radius_m,
            out_s: draws.between(0.11, 0.23) * duration_s,
            height_m: [draws.between(12.0, 30.0), draws.between(3.0, 9.0)],
        };
        let rows: Vec<LinkRow> = (0..n_rows)
            .map(|index| {
                let jitter = 0.4 * draws.uniform();
                let time_s = rounded(duration_s * (index as f64 + jitter) / n_rows as f64, 3);
                let sensor = 1 + draws.below(n_sensors);
                let other = 1 + (sensor + draws.below(n_sensors - 1)) % n_sensors;
                let [tx, rx] = match (has_drone, index % 2) {
                    (true, 0) => [DRONE, sensor],
                    (true, _) => [sensor, DRONE],
                    (false, _) => [sensor, other],
                };
                let place = |node: usize| {
                    if node == DRONE {
                        flight.at(time_s).map(|place| rounded(place, 3))
                    } else {
                        sensors[node]
                    }
                };
                let places_m = [place(tx), place(rx)];
                LinkRow { time_s, tx, rx, channel: None, places_m, ..LinkRow::default() }
            })
            .collect();
        let noise_db = draws.between(0.8, 2.4);
        // Logistic, of this standard deviation.
        let errors_db = rows
            .iter()
            .map(|_| {
                let share = draws.between(1e-4, 1.0 - 1e-4);
                noise_db * 3.0_f64.sqrt() / PI * (share / (1.0 - share)).ln()
            })
            .collect();
        let carrier_hz = if draws.chance(0.5) { 868.3e6 } else { 2.44e9 };
        Self {
            n_sensors,
            radius_m,
            duration_s,
            carrier_hz,
            noise_db,
            flight,
            errors_db,
            added_db: vec![0.0; rows.len()],
            loss: vec![0.0; rows.len()],
            causes: Vec::new(),
            consequences: Vec::new(),
            columns: Vec::new(),
            sections: String::new(),
            margin_db: draws.between(6.0, 14.0),
            rows,
            draws,
        }
    }

    pub(super) fn each(&self, value: impl Fn(&LinkRow) -> f64) -> Vec<f64> {
        self.rows.iter().map(value).collect()
    }

    pub(super) fn free_space_db(&self, row: &LinkRow) -> f64 {
        20.0 * (299_792_458.0 / (self.carrier_hz * 4.0 * PI * span_m(row).max(0.1))).log10()
    }

    /// The same row with the drone elsewhere: where it was some seconds later, and higher.
    pub(super) fn with_drone(&self, row: &LinkRow, later_s: f64, higher_m: f64) -> LinkRow {
        let mut moved = row.clone();
        for (node, place) in [row.tx, row.rx].into_iter().zip(&mut moved.places_m) {
            if node == DRONE {
                *place = self.flight.at(row.time_s + later_s);
                place[2] += higher_m;
            }
        }
        moved
    }

    pub(super) fn drone_mps(&self, time_s: f64) -> f64 {
        let [a, b] = [-0.05, 0.05].map(|by| self.flight.at(time_s + by));
        10.0 * (a[0] - b[0]).hypot(a[1] - b[1]).hypot(a[2] - b[2])
    }

    pub(super) fn hide(&mut self, cause: Cause, signal: Vec<f64>) {
        self.added_db.iter_mut().zip(&signal).for_each(|(sum, db)| *sum += db);
        self.causes.push((cause, signal));
    }

    pub(super) fn log(&mut self, name: &'static str, values: &[f64]) {
        self.columns.push(name);
        self.rows.iter_mut().zip(values).for_each(|(row, value)| row.more.push(*value));
    }

    /// Probability that all bits of a frame of 60 bytes are right: O-QPSK over the noise of a floor.
    fn received(power_dbm: f64, floor_dbm: f64) -> f64 {
        let ratio = 10.0_f64.powf((power_dbm - floor_dbm) / 10.0);
        let mut sum = 0.0;
        let mut choose = 16.0;
        for k in 2..=16 {
            choose *= (17.0 - f64::from(k)) / f64::from(k);
            let term = choose * (20.0 * ratio * (1.0 / f64::from(k) - 1.0)).exp();
            sum += if k % 2 == 0 { term } else { -term };
        }
        (1.0 - 8.0 / 15.0 / 16.0 * sum).clamp(0.0, 1.0).powi(480)
    }

    /// Sends all frames, and makes the campaign. `rivals`: name and changes of all rows.
    pub(super) fn campaign(self, log: Log, rivals: &[(&'static str, Vec<f64>)]) -> Case {
        self.campaign_as(rivals, |rows, columns| links(rows, columns, log))
    }

    /// The same, in a file of another form.
    pub(super) fn campaign_as(
        mut self,
        rivals: &[(&'static str, Vec<f64>)],
        write: impl Fn(&[LinkRow], &[&str]) -> String,
    ) -> Case {
        let power_dbm = rounded(self.draws.between(-10.0, 14.0), 1);
        let gains_db: Vec<f64> = self
            .rows
            .iter()
            .zip(&self.added_db)
            .map(|(row, added_db)| self.free_space_db(row) + added_db)
            .collect();
        let mean_dbm = power_dbm + crate::statistics::mean(&gains_db);
        // The edge is where the signal is a little above the floor.
        let floor_dbm = rounded((mean_dbm - self.margin_db).clamp(-190.0, -5.0), 1);
        let mut kept = Vec::new();
        let mut of_losses = 0.0;
        for (index, gain_db) in gains_db.iter().enumerate() {
            let dbm = power_dbm + gain_db + self.errors_db[index];
            let without = Self::received(dbm, floor_dbm).clamp(1e-3, 1.0 - 1e-3);
            let with = Self::received(dbm, floor_dbm) * (1.0 - self.loss[index]);
            if self.draws.chance(with) {
                self.rows[index].rssi_dbm = Some(rounded(dbm, 1));
                kept.push(index);
            }
            let with = with.clamp(1e-3, 1.0 - 1e-3);
            of_losses += with * (with / without).ln();
            of_losses += (1.0 - with) * ((1.0 - with) / (1.0 - without)).ln();
        }
        let of = |all: &[f64]| kept.iter().map(|index| all[*index]).collect::<Vec<f64>>();
        let is_level = self.causes.iter().any(|(cause, _)| cause.names.contains(&"system-gain"));
        let hidden = self.causes.iter().map(|(cause, signal)| (cause.clone(), of(signal)));
        let nuisance = if is_level { Vec::new() } else { vec![vec![1.0; kept.len()]] };
        let rivals: Vec<Rival> =
            rivals.iter().map(|(name, change)| Rival::new(name, vec![of(change)])).collect();
        let mut truth = truth(hidden.collect(), &nuisance, &rivals, self.noise_db)
            .permitting(&self.consequences);
        // A cause of losses alone has no signal in the readings.
        if let Some(cause) = truth.causes.iter_mut().find(|cause| cause.is_of_losses) {
            cause.nats = of_losses;
            truth.nats += of_losses;
        }
        let config_toml = format!(
            "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = {power_dbm:?}\ncarrier_hz = {:?}\n\
             \n[netsim.phy.reception]\nkind = \"o-qpsk\"\nnoise_floor_dbm = {floor_dbm:?}\nframe_bytes = 60\n{}",
            self.carrier_hz, self.sections
        );
        Case { csv: write(&self.rows, &self.columns), config_toml, truth }
    }
}

/// Distance between both ends (m).
pub(super) fn span_m(row: &LinkRow) -> f64 {
    let [a, b] = row.places_m;
    (a[0] - b[0]).hypot(a[1] - b[1]).hypot(a[2] - b[2])
}
