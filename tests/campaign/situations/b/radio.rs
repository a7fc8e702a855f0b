//! The radio world of set B: rounds of broadcasts between nodes along a building, over a known exponent, with heavy tails.

use crate::campaign::draws::Draws;
use crate::campaign::situations::Case;
use crate::campaign::situations::files::{LinkRow, Log, links};
use crate::campaign::situations::reference::{Rival, truth};
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;

/// Who is where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// Nodes in two rows along a corridor.
    Corridor,
    /// Sensors around one gateway, node 0, which alone receives.
    Star,
    /// Some nodes of a corridor, and carts that go to and fro between its ends.
    Carts,
    /// Two nodes that stay.
    Pair,
}

/// Another explanation: its name, and how it changes each row (dB).
pub(super) type Change<'a> = (&'static str, &'a dyn Fn(&LinkRow) -> f64);

/// A campaign in the making.
pub(super) struct Radio {
    pub(super) draws: Draws,
    pub(super) rows: Vec<LinkRow>,
    pub(super) n_nodes: usize,
    pub(super) length_m: f64,
    pub(super) duration_s: f64,
    pub(super) scale_db: f64,
    exponent: f64,
    level_db: Vec<f64>,
    noise_db: Vec<f64>,
    /// Probability of each row to be lost whatever its power.
    loss: Vec<f64>,
    /// Shift of the reception curve of each row (dB).
    deafness_db: Vec<f64>,
    hidden: Vec<(Cause, Vec<f64>)>,
    of_losses: Vec<Cause>,
    permitted: Vec<&'static str>,
    columns: Vec<&'static str>,
    edge_dbm: f64,
    share: f64,
    /// Whether a free level is a rival of the cause, and not what every model has.
    pub(super) is_level_rival: bool,
}

/// Student's t with five degrees of freedom, of unit variance.
fn heavy(draws: &mut Draws) -> f64 {
    let squares: f64 = (0..5).map(|_| draws.normal().powi(2)).sum();
    draws.normal() / (squares / 5.0).sqrt() * (3.0_f64 / 5.0).sqrt()
}

impl Radio {
    pub(super) fn new(seed: u64, shape: Shape) -> Self {
        let mut draws = Draws::new(seed, "radio of set B");
        let n_nodes = match shape {
            Shape::Pair => 2,
            Shape::Star => 12 + draws.below(14),
            Shape::Corridor | Shape::Carts => 6 + draws.below(4),
        };
        let length_m = draws.between(40.0, 160.0);
        let n_rounds = match shape {
            Shape::Pair => 40 + draws.below(20),
            Shape::Star => 2500 / n_nodes,
            Shape::Corridor | Shape::Carts => 3000 / (n_nodes * (n_nodes - 1)),
        };
        let period_s = draws.between(15.0, 60.0);
        let homes: Vec<[f64; 3]> = (0..n_nodes)
            .map(|node| {
                let along = (node as f64 + draws.between(0.1, 0.9)) / n_nodes as f64;
                let x_m = if shape == Shape::Star && node == 0 { 0.5 } else { along } * length_m;
                let y_m = if node % 2 == 0 { 0.3 } else { draws.between(3.0, 9.0) };
                [rounded(x_m, 2), rounded(y_m, 2), rounded(draws.between(0.4, 2.8), 2)]
            })
            .collect();
        let n_carts = if shape == Shape::Carts { 2 + draws.below(2) } else { 0 };
        let paces: Vec<f64> = (0..n_nodes).map(|_| draws.between(0.3, 1.1)).collect();
        let at = |node: usize, time_s: f64| {
            let mut place = homes[node];
            if node < n_carts {
                // To and fro between both ends.
                let way = (paces[node] * time_s + homes[node][0]) / length_m;
                place[0] = rounded(length_m * (1.0 - (way % 2.0 - 1.0).abs()), 3);
                place[1] = 1.5 + 0.5 * node as f64;
            }
            place
        };
        let mut rows = Vec::new();
        for round in 0..n_rounds {
            for tx in 0..n_nodes {
                let time_s = rounded(period_s * (round as f64 + tx as f64 / n_nodes as f64), 3);
                let channel = Some(11 + ((5 * round + 3 * tx) % 16) as u8);
                let receivers = if shape == Shape::Star { 0..1 } else { 0..n_nodes };
                for rx in receivers.filter(|rx| *rx != tx) {
                    let places_m = [at(tx, time_s), at(rx, time_s)];
                    rows.push(LinkRow { time_s, tx, rx, channel, places_m, ..LinkRow::default() });
                }
            }
        }
        let exponent = rounded(draws.between(1.7, 3.2), 1);
        let scale_db = draws.between(0.9, 2.2);
        let n = rows.len();
        let mut radio = Self {
            n_nodes,
            length_m,
            duration_s: period_s * n_rounds as f64,
            scale_db,
            exponent,
            level_db: Vec::new(),
            noise_db: (0..n).map(|_| scale_db * heavy(&mut draws)).collect(),
            loss: vec![0.0; n],
            deafness_db: vec![0.0; n],
            hidden: Vec::new(),
            of_losses: Vec::new(),
            permitted: Vec::new(),
            columns: Vec::new(),
            edge_dbm: rounded(-draws.between(85.0, 95.0), 1),
            share: draws.between(0.72, 0.95),
            is_level_rival: false,
            rows,
            draws,
        };
        radio.level_db = radio.per_row(|row| radio.gain_db(row));
        radio
    }

    /// The gain that the model knows (dB): free space up to a metre, the exponent beyond.
    pub(super) fn gain_db(&self, row: &LinkRow) -> f64 {
        let wave_m = 299.792_458 / (2405.0 + 5.0 * (f64::from(row.channel.unwrap_or(11)) - 11.0));
        let distance_m = distance_m(row).max(0.1);
        let free = |metres: f64| 20.0 * (wave_m / (4.0 * std::f64::consts::PI * metres)).log10();
        free(distance_m.min(1.0)) - 10.0 * self.exponent * distance_m.max(1.0).log10()
    }

    pub(super) fn per_row(&self, value: impl Fn(&LinkRow) -> f64) -> Vec<f64> {
        self.rows.iter().map(value).collect()
    }

    pub(super) fn hide(&mut self, cause: Cause, signal: impl Fn(&LinkRow) -> f64) {
        let signal = self.per_row(signal);
        self.level_db.iter_mut().zip(&signal).for_each(|(level, added)| *level += added);
        self.hidden.push((cause, signal));
    }

    pub(super) fn log(&mut self, name: &'static str, value: impl Fn(&LinkRow) -> f64) {
        let values = self.per_row(value);
        self.columns.push(name);
        self.rows.iter_mut().zip(values).for_each(|(row, value)| row.more.push(value));
    }

    pub(super) fn permit(&mut self, patterns: &[&'static str]) {
        self.permitted.extend(patterns);
    }

    /// A cause of losses: a share of frames, and a shift of the reception curve (dB).
    pub(super) fn hide_losses(&mut self, cause: Cause, loss: impl Fn(&LinkRow) -> [f64; 2]) {
        for (index, row) in self.rows.iter().enumerate() {
            let [share, shift_db] = loss(row);
            self.loss[index] = share;
            self.deafness_db[index] = shift_db;
        }
        self.of_losses.push(cause);
    }

    fn curve(&self) -> [[f64; 2]; 4] {
        [[0.0, 0.0], [2.5, 0.35], [6.0, 0.85], [10.0, 1.0]].map(|[db, p]| [self.edge_dbm + db, p])
    }

    fn received(&self, power_dbm: f64) -> f64 {
        let points = self.curve();
        let above = points.iter().position(|[dbm, _]| power_dbm < *dbm);
        match above {
            Some(0) => 0.0,
            None => 1.0,
            Some(next) => {
                let [[x0, y0], [x1, y1]] = [points[next - 1], points[next]];
                y0 + (y1 - y0) * (power_dbm - x0) / (x1 - x0)
            }
        }
    }

    pub(super) fn power_dbm(&self) -> f64 {
        let mut levels: Vec<f64> =
            self.level_db.iter().zip(&self.noise_db).map(|(level, noise)| level + noise).collect();
        levels.sort_by(f64::total_cmp);
        // So that the share of frames is above the middle of the curve.
        let weakest = levels[((1.0 - self.share) * levels.len() as f64) as usize];
        rounded((self.edge_dbm + 4.0 - weakest).clamp(-99.0, 59.0), 1)
    }

    pub(super) fn finish(self, log: Log) -> Case {
        self.finish_with(log, &[], |_, dbm| dbm)
    }

    /// Sends everything. `rivals`: other explanations, by their changes of each row; `register`: what is read of a power.
    pub(super) fn finish_with(
        mut self,
        log: Log,
        rivals: &[Change<'_>],
        register: impl Fn(&LinkRow, f64) -> f64,
    ) -> Case {
        let tx_power_dbm = self.power_dbm();
        let mut information = 0.0;
        for index in 0..self.rows.len() {
            let power_dbm = tx_power_dbm + self.level_db[index] + self.noise_db[index];
            let without = self.received(power_dbm).clamp(1e-3, 1.0 - 1e-3);
            let with =
                self.received(power_dbm - self.deafness_db[index]) * (1.0 - self.loss[index]);
            let received = self.draws.chance(with);
            let with = with.clamp(1e-3, 1.0 - 1e-3);
            information += with * (with / without).ln();
            information += (1.0 - with) * ((1.0 - with) / (1.0 - without)).ln();
            let reading_dbm = register(&self.rows[index], power_dbm).round();
            self.rows[index].rssi_dbm = received.then_some(reading_dbm);
        }
        let received: Vec<usize> =
            (0..self.rows.len()).filter(|index| self.rows[*index].rssi_dbm.is_some()).collect();
        let of = |values: &[f64]| received.iter().map(|index| values[*index]).collect::<Vec<f64>>();
        let hidden: Vec<_> = self.hidden.iter().map(|(c, s)| (c.clone(), of(s))).collect();
        let rivals: Vec<Rival> = rivals
            .iter()
            .map(|(name, change)| Rival::new(name, vec![of(&self.per_row(change))]))
            .collect();
        let is_level = self.hidden.iter().any(|(cause, _)| cause.names.contains(&"system-gain"));
        let nuisance = if is_level || self.is_level_rival {
            Vec::new()
        } else {
            vec![vec![1.0; received.len()]]
        };
        let noise_db = (self.scale_db.powi(2) + 1.0 / 12.0).sqrt();
        let mut truth = truth(hidden, &nuisance, &rivals, noise_db).permitting(&self.permitted);
        for cause in self.of_losses.drain(..) {
            truth.nats += information;
            truth.causes.push(Cause { nats: information, ..cause });
        }
        let config_toml = format!(
            "[netsim.phy]\npropagation = \"log-distance\"\nexponent = {:?}\ntx_power_dbm = {tx_power_dbm:?}\n\
             \n[netsim.phy.reception]\nkind = \"table\"\npoints = {:?}\n",
            self.exponent,
            self.curve(),
        );
        Case { csv: links(&self.rows, &self.columns, log), config_toml, truth }
    }
}

pub(super) fn distance_m(row: &LinkRow) -> f64 {
    let [[ax, ay, az], [bx, by, bz]] = row.places_m;
    (ax - bx).hypot(ay - by).hypot(az - bz)
}
