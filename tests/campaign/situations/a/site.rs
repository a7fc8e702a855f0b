//! The radio world: nodes in a rectangle, some of them on closed curves; frames at random times between random pairs.

use crate::campaign::draws::Draws;
use crate::campaign::radio::{friis_db, table};
use crate::campaign::situations::Case;
use crate::campaign::situations::files::{LinkRow, Log, links};
use crate::campaign::situations::reference::{Rival, truth};
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::TAU;

/// The design of a campaign.
pub(super) struct Design {
    pub(super) n_fixed: usize,
    pub(super) n_moving: usize,
    pub(super) n_rows: usize,
    pub(super) side_m: f64,
    pub(super) duration_s: f64,
    /// Share of the frames that are received.
    pub(super) share: f64,
}

impl Design {
    /// A design as of a careful user.
    pub(super) fn drawn(draws: &mut Draws) -> Self {
        Self {
            n_fixed: 7 + draws.below(6),
            n_moving: 2 + draws.below(4),
            n_rows: 1800 + draws.below(1800),
            side_m: draws.between(30.0, 90.0),
            duration_s: draws.between(2400.0, 7200.0),
            share: draws.between(0.75, 0.97),
        }
    }

    pub(super) fn still(self) -> Self {
        Self { n_fixed: self.n_fixed + self.n_moving, n_moving: 0, ..self }
    }
}

/// A campaign in the making.
pub(super) struct Site {
    pub(super) draws: Draws,
    pub(super) design: Design,
    pub(super) rows: Vec<LinkRow>,
    /// Gain in free space, and true gain (dB).
    base_db: Vec<f64>,
    level_db: Vec<f64>,
    pub(super) noise_db: Vec<f64>,
    pub(super) sd_db: f64,
    hidden: Vec<(Cause, Vec<f64>)>,
    permitted: Vec<&'static str>,
    columns: Vec<&'static str>,
    tx_power_dbm: f64,
    config: String,
    /// Whether a free level is what the cause may be confused with, and not what every model has.
    pub(super) is_level_rival: bool,
}

/// A node: still, or on a closed curve with two frequencies.
struct Node {
    centre_m: [f64; 2],
    reach_m: f64,
    rates_per_s: [f64; 2],
    phases: [f64; 2],
    z_m: f64,
}

impl Node {
    fn at(&self, time_s: f64) -> [f64; 3] {
        let place = |axis: usize| {
            let phase = TAU * self.rates_per_s[axis] * time_s + self.phases[axis];
            rounded(self.centre_m[axis] + self.reach_m * phase.sin(), 3)
        };
        [place(0), place(1), self.z_m]
    }
}

impl Site {
    pub(super) fn new(seed: u64) -> Self {
        let mut draws = Draws::new(seed, "site of set A");
        let design = Design::drawn(&mut draws);
        Self::of(draws, design)
    }

    pub(super) fn of(mut draws: Draws, design: Design) -> Self {
        let n_nodes = design.n_fixed + design.n_moving;
        let nodes: Vec<Node> = (0..n_nodes)
            .map(|node| {
                let is_moving = design.n_fixed <= node;
                let margin = if is_moving { 0.35 } else { 0.0 };
                Node {
                    centre_m: [0, 1].map(|_| draws.between(margin, 1.0 - margin) * design.side_m),
                    reach_m: if is_moving { 0.3 * design.side_m } else { 0.0 },
                    rates_per_s: [0, 1].map(|_| 1.0 / draws.between(90.0, 400.0)),
                    phases: [0, 1].map(|_| draws.between(0.0, TAU)),
                    z_m: if is_moving { 0.6 } else { rounded(draws.between(1.0, 2.5), 2) },
                }
            })
            .collect();
        let mut times: Vec<f64> =
            (0..design.n_rows).map(|_| rounded(draws.uniform() * design.duration_s, 3)).collect();
        times.sort_by(f64::total_cmp);
        let rows: Vec<LinkRow> = times
            .into_iter()
            .map(|time_s| {
                let tx = draws.below(n_nodes);
                let rx = (tx + 1 + draws.below(n_nodes - 1)) % n_nodes;
                LinkRow {
                    time_s,
                    tx,
                    rx,
                    channel: Some(11 + draws.below(16) as u8),
                    places_m: [nodes[tx].at(time_s), nodes[rx].at(time_s)],
                    ..LinkRow::default()
                }
            })
            .collect();
        let base_db: Vec<f64> = rows.iter().map(free_space_db).collect();
        let sd_db = draws.between(1.0, 2.5);
        Self {
            noise_db: rows.iter().map(|_| sd_db * draws.normal()).collect(),
            level_db: base_db.clone(),
            base_db,
            rows,
            sd_db,
            hidden: Vec::new(),
            permitted: Vec::new(),
            columns: Vec::new(),
            tx_power_dbm: 0.0,
            config: String::new(),
            is_level_rival: false,
            draws,
            design,
        }
    }

    pub(super) fn n_nodes(&self) -> usize {
        self.design.n_fixed + self.design.n_moving
    }

    pub(super) fn per_row(&self, value: impl Fn(&LinkRow) -> f64) -> Vec<f64> {
        self.rows.iter().map(value).collect()
    }

    /// Adds a cause with its signal (dB).
    pub(super) fn hide(&mut self, cause: Cause, signal: Vec<f64>) {
        self.shift(&signal);
        self.hidden.push((cause, signal));
    }

    /// Adds to the true gain what no diagnosis need name (dB).
    pub(super) fn shift(&mut self, added_db: &[f64]) {
        self.level_db.iter_mut().zip(added_db).for_each(|(level, added)| *level += added);
    }

    /// Takes the signal of a cause that is in the readings only out of the power (dB).
    pub(super) fn take_from_power(&mut self, signal: &[f64]) {
        self.level_db.iter_mut().zip(signal).for_each(|(level, added)| *level -= added);
    }

    /// The gain of free space (dB).
    pub(super) fn base_db(&self) -> &[f64] {
        &self.base_db
    }

    /// Adds a column that the user logged.
    pub(super) fn log(&mut self, name: &'static str, values: &[f64]) {
        self.columns.push(name);
        self.rows.iter_mut().zip(values).for_each(|(row, value)| row.more.push(*value));
    }

    pub(super) fn permit(&mut self, patterns: &[&'static str]) {
        self.permitted.extend(patterns);
    }

    pub(super) fn configure(&mut self, toml: &str) {
        self.config.push_str(toml);
    }

    /// Columns by which every node has its own level, as sender and as receiver.
    pub(super) fn node_levels(&self) -> Vec<Vec<f64>> {
        (0..self.n_nodes())
            .flat_map(|node| {
                let of = |is: fn(&LinkRow) -> usize| {
                    self.per_row(|row| f64::from(u8::from(is(row) == node)))
                };
                [of(|row| row.tx), of(|row| row.rx)]
            })
            .collect()
    }

    /// Sets the transmit power so that the share of the design is received.
    pub(super) fn power_dbm(&mut self) -> f64 {
        let [mut low, mut high] = [-90.0, 55.0];
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            let received: f64 =
                self.level_db.iter().zip(&self.noise_db).map(|(l, n)| table(middle + l + n)).sum();
            if received < self.design.share * self.rows.len() as f64 {
                low = middle;
            } else {
                high = middle;
            }
        }
        self.tx_power_dbm = rounded(0.5 * (low + high), 1);
        self.tx_power_dbm
    }

    /// Sends all frames. `register`: what is read of a received power (dBm). `rivals`: explanations, with columns for all rows.
    pub(super) fn finish(
        mut self,
        log: Log,
        rivals: Vec<Rival>,
        register: impl Fn(f64) -> f64,
    ) -> Case {
        let tx_power_dbm = self.power_dbm();
        for (index, row) in self.rows.iter_mut().enumerate() {
            let power_dbm = tx_power_dbm + self.level_db[index] + self.noise_db[index];
            row.rssi_dbm = self.draws.chance(table(power_dbm)).then(|| register(power_dbm).round());
        }
        let is_received: Vec<bool> = self.rows.iter().map(|row| row.rssi_dbm.is_some()).collect();
        let kept = |values: &[f64]| -> Vec<f64> {
            values.iter().zip(&is_received).filter(|(_, kept)| **kept).map(|(v, _)| *v).collect()
        };
        let hidden: Vec<_> = self.hidden.iter().map(|(c, s)| (c.clone(), kept(s))).collect();
        let rivals: Vec<Rival> = rivals
            .iter()
            .map(|rival| Rival::new(rival.name, rival.columns.iter().map(|c| kept(c)).collect()))
            .collect();
        // Every model has a free level, unless the level is what it lacks.
        let is_level = hidden.iter().any(|(cause, _)| cause.names.contains(&"system-gain"));
        let ones = vec![1.0; is_received.iter().filter(|kept| **kept).count()];
        let nuisance = if is_level || self.is_level_rival { Vec::new() } else { vec![ones] };
        let sd_db = (self.sd_db.powi(2) + 1.0 / 12.0).sqrt();
        Case {
            csv: links(&self.rows, &self.columns, log),
            config_toml: format!(
                "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = {tx_power_dbm:?}\n{}",
                self.config
            ),
            truth: truth(hidden, &nuisance, &rivals, sd_db).permitting(&self.permitted),
        }
    }
}

/// Distance between both antennas (m).
pub(super) fn distance_m(row: &LinkRow) -> f64 {
    let [a, b] = row.places_m;
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

/// Gain in free space (dB).
pub(super) fn free_space_db(row: &LinkRow) -> f64 {
    friis_db(distance_m(row), row.channel.unwrap_or(18))
}

/// Whether the straight path cuts a segment, seen from above.
pub(super) fn crosses(row: &LinkRow, [from, to]: [[f64; 2]; 2]) -> bool {
    let side = |a: [f64; 2], b: [f64; 2], p: [f64; 2]| {
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    };
    let [tx, rx] = row.places_m.map(|[x, y, _]| [x, y]);
    side(tx, rx, from) * side(tx, rx, to) < 0.0 && side(from, to, tx) * side(from, to, rx) < 0.0
}

/// Least distance of the straight path from a point, seen from above (m).
pub(super) fn clearance_m(row: &LinkRow, point: [f64; 2]) -> f64 {
    let [[ax, ay, _], [bx, by, _]] = row.places_m;
    let [dx, dy] = [bx - ax, by - ay];
    let along = ((point[0] - ax) * dx + (point[1] - ay) * dy) / (dx * dx + dy * dy).max(1e-9);
    let along = along.clamp(0.0, 1.0);
    (ax + along * dx - point[0]).hypot(ay + along * dy - point[1])
}

/// A Gauss–Markov process at the rows' times: stationary deviation 1.
pub(super) fn slow(draws: &mut Draws, rows: &[LinkRow], tau_s: f64) -> Vec<f64> {
    let [mut value, mut last_s] = [draws.normal(), 0.0];
    rows.iter()
        .map(|row| {
            let kept = (-(row.time_s - last_s) / tau_s).exp();
            value = kept * value + (1.0 - kept * kept).sqrt() * draws.normal();
            last_s = row.time_s;
            value
        })
        .collect()
}
