//! Random effects per node, link, channel and time: intercepts with shrinkage, estimated together with all other parameters.
//!
//! Nested cells (a link and place, and in it a channel and finer place) are eliminated one by one; offsets of nodes and times, which
//! cross all links, stand in the dense system with the parameters. So one step of Newton's method costs one pass over the
//! rows, however many cells there are. This is a Schur complement, in the Gaussian case as in lme4 (Bates et al., Fitting linear
//! mixed-effects models using lme4, Journal of Statistical Software 67 (2015), § 3); here the weights come from the likelihood.

mod agreement;
pub(super) mod cells;
pub mod covariance;
pub(super) mod scales;
mod step;

use crate::links::rows::ModelledLinks;
use physics::scatter::{Law, Renewal};

pub use step::{NewtonStep, Solver};

/// Standard deviations (dB) of the random effects of a model; 0: the model has none of that kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RandomEffectSds {
    /// Of a link, at a place.
    pub link_db: f64,
    /// Of a link and channel, at a finer place.
    pub channel_db: f64,
    /// Of what a node sends.
    pub tx_db: f64,
    /// Of what a node receives.
    pub rx_db: f64,
    /// Of all links, at a time.
    pub time_db: f64,
}

/// Over what random levels change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// The way over which levels of links change (m).
    pub decorrelation_m: f64,
    /// The time over which the level of all links changes (s); none where it does not.
    pub drift_s: Option<f64>,
    /// The time over which those of a link and channel change (s); none where they do not.
    pub link_drift_s: Option<f64>,
}

impl Scales {
    /// The same with the times of the drifts that a configuration has.
    pub(in crate::links) fn configured(mut self, rows: &ModelledLinks) -> Self {
        for scatter in rows.model.scatters() {
            if let Renewal::Time { length_s, is_common } = scatter.renewal {
                let scale = if is_common { &mut self.drift_s } else { &mut self.link_drift_s };
                scale.get_or_insert(length_s);
            }
        }
        self
    }
}

impl RandomEffectSds {
    /// Random levels that the configuration itself has.
    pub(in crate::links) fn configured(rows: &ModelledLinks) -> Self {
        let mut known = Self::default();
        for scatter in
            rows.model.scatters().iter().filter(|scatter| scatter.renewal != Renewal::Frame)
        {
            match (scatter.law, scatter.renewal) {
                (Law::Nodes { tx_sd_db, rx_sd_db }, _) => {
                    known.tx_db = libm::hypot(known.tx_db, tx_sd_db);
                    known.rx_db = libm::hypot(known.rx_db, rx_sd_db);
                }
                (Law::Normal { sd_db }, Renewal::Time { is_common: true, .. }) => {
                    known.time_db = libm::hypot(known.time_db, sd_db);
                }
                (Law::Normal { sd_db }, Renewal::Place { .. } | Renewal::Time { .. }) => {
                    known.channel_db = libm::hypot(known.channel_db, sd_db);
                }
                (Law::Normal { sd_db }, _) => known.link_db = libm::hypot(known.link_db, sd_db),
                _ => {}
            }
        }
        known
    }
}

/// The groups of every row for random effects: link, nodes and channel, by number.
#[derive(Clone, Debug)]
pub struct RowCells {
    /// By row: the number of its cell of link and place, below `n_links`.
    pub link: Vec<u32>,
    /// By row: the number of its cell of link, place, channel and finer place, and time where links drift. Each lies in one cell of
    /// `link`.
    pub channel: Vec<u32>,
    /// The link cell of each channel cell.
    pub link_of_channel: Vec<u32>,
    /// Number of cells of links and places.
    pub n_links: usize,
    /// By row: sender and receiver, as indices below `n_nodes`.
    pub nodes: Vec<(u32, u32)>,
    /// Number of nodes.
    pub n_nodes: usize,
    /// By row: the time at which all links share a level, as an index below `n_times`.
    pub times: Vec<u32>,
    /// By time: how its level is correlated with that of the time before; 0 for the first of a campaign. Empty where levels of times are
    /// none.
    pub correlations: Vec<f64>,
}

impl RowCells {
    /// The places of a row's levels among those that cross links: of its sender, its receiver, and its time if it has one.
    fn crossing(&self, row: usize) -> impl Iterator<Item = usize> {
        let (tx, rx) = self.nodes[row];
        let time = self.times.get(row).map(|&time| 2 * self.n_nodes + time as usize);
        [tx as usize, self.n_nodes + rx as usize].into_iter().chain(time)
    }

    /// How many levels cross links.
    fn n_crossing(&self) -> usize {
        2 * self.n_nodes + self.correlations.len()
    }

    /// Adds up over the inverse of the correlations of times (tridiagonal, of a Gauss-Markov sequence), whose entries `add` gets by row
    /// and column.
    fn over_inverse_correlations(&self, mut add: impl FnMut(usize, usize, f64)) {
        for (time, &correlation) in self.correlations.iter().enumerate() {
            let fresh = 1.0 - correlation * correlation;
            add(time, time, 1.0 / fresh);
            if 0.0 < correlation {
                add(time - 1, time - 1, correlation * correlation / fresh);
                add(time, time - 1, -correlation / fresh);
            }
        }
    }

    /// The square of levels of times in the measure of their correlations.
    fn square_of_times(&self, levels: &[f64]) -> f64 {
        let mut square = 0.0;
        self.over_inverse_correlations(|row, column, entry| {
            let times = if row == column { 1.0 } else { 2.0 };
            square += times * entry * levels[row] * levels[column];
        });
        square
    }

    /// The standard deviation of a level that crosses links.
    fn sd_of_crossing(&self, place: usize, sd: RandomEffectSds) -> f64 {
        if place < self.n_nodes {
            sd.tx_db
        } else if place < 2 * self.n_nodes {
            sd.rx_db
        } else {
            sd.time_db
        }
    }
}

/// The random levels of a fit: their modes, and how much is known of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Random {
    /// Standard deviations of the levels, by kind (dB).
    pub sd: RandomEffectSds,
    link_db: Vec<f64>,
    link_weight: Vec<f64>,
    channel_db: Vec<f64>,
    channel_weight: Vec<f64>,
    /// Of senders, of receivers, of times: what crosses links.
    crossing_db: Vec<f64>,
    crossing_variance: Vec<f64>,
    /// Covariance of the level of each sender with that of each receiver: row by row of senders.
    end_covariance: Vec<f64>,
    /// How many levels of times are well determined.
    times_determined: f64,
}

impl Random {
    /// Levels of 0 dB about which nothing is known yet.
    #[must_use]
    pub fn new(sd: RandomEffectSds, cells: &RowCells) -> Self {
        Self {
            sd,
            link_db: vec![0.0; cells.n_links],
            link_weight: vec![0.0; cells.n_links],
            channel_db: vec![0.0; cells.link_of_channel.len()],
            channel_weight: vec![0.0; cells.link_of_channel.len()],
            crossing_db: vec![0.0; cells.n_crossing()],
            crossing_variance: vec![0.0; cells.n_crossing()],
            end_covariance: vec![0.0; cells.n_nodes * cells.n_nodes],
            times_determined: 0.0,
        }
    }

    /// The same random effects with other standard deviations; 0 where the standard deviation is 0.
    #[must_use]
    pub fn with_sds(&self, sd: RandomEffectSds, cells: &RowCells) -> Self {
        let mut other = Self { sd, ..self.clone() };
        if sd.link_db == 0.0 {
            other.link_db.fill(0.0);
        }
        if sd.channel_db == 0.0 {
            other.channel_db.fill(0.0);
        }
        for place in 0..other.crossing_db.len() {
            if cells.sd_of_crossing(place, sd) == 0.0 {
                (other.crossing_db[place], other.crossing_variance[place]) = (0.0, 0.0);
            }
        }
        if sd.tx_db == 0.0 || sd.rx_db == 0.0 {
            other.end_covariance.fill(0.0);
        }
        other
    }

    /// Whether these are levels of such cells.
    #[must_use]
    pub fn fits(&self, cells: &RowCells) -> bool {
        self.link_db.len() == cells.n_links
            && self.channel_db.len() == cells.link_of_channel.len()
            && self.crossing_db.len() == cells.n_crossing()
    }

    /// The random level of a row: its mode (dB).
    #[must_use]
    pub fn level_db(&self, cells: &RowCells, row: usize) -> f64 {
        let crossing: f64 = cells.crossing(row).map(|place| self.crossing_db[place]).sum();
        self.link_db[cells.link[row] as usize]
            + self.channel_db[cells.channel[row] as usize]
            + crossing
    }

    /// The levels of nodes and times alone: nothing is known of those of links and channels but their spreads.
    #[must_use]
    pub fn without_links(&self) -> Self {
        let mut alone = self.clone();
        alone.link_db.fill(0.0);
        alone.link_weight.fill(0.0);
        alone.without_channels()
    }

    /// The same random effects, those of links and channels at their prior: mean 0 and their standard deviations.
    #[must_use]
    pub fn without_channels(mut self) -> Self {
        self.channel_db.fill(0.0);
        self.channel_weight.fill(0.0);
        self
    }

    /// The same random effects, those of times at their prior: mean 0 and their standard deviation.
    #[must_use]
    pub fn without_times(mut self, cells: &RowCells) -> Self {
        self.crossing_db[2 * cells.n_nodes..].fill(0.0);
        self.crossing_variance[2 * cells.n_nodes..].fill(self.sd.time_db * self.sd.time_db);
        self
    }

    /// Variance of the random level of a row about its mode (dB²).
    #[must_use]
    pub fn variance(&self, cells: &RowCells, row: usize) -> f64 {
        let alone: f64 = cells.crossing(row).map(|place| self.crossing_variance[place]).sum();
        // Of few nodes, the sum of both levels is known far better than either.
        let (tx, rx) = cells.nodes[row];
        let crossing = alone + 2.0 * self.end_covariance[tx as usize * cells.n_nodes + rx as usize];
        let posterior = |sd: f64, weight: f64| {
            let variance = sd * sd / (1.0 + weight * sd * sd);
            (variance, 1.0 - weight * variance)
        };
        let (link, link_rest) =
            posterior(self.sd.link_db, self.link_weight[cells.link[row] as usize]);
        let (channel, channel_rest) =
            posterior(self.sd.channel_db, self.channel_weight[cells.channel[row] as usize]);
        let under = link + link_rest * link_rest * crossing;
        channel + channel_rest * channel_rest * under
    }

    /// Minus half the squared levels over their variances: what they cost.
    #[must_use]
    pub fn penalty(&self, cells: &RowCells) -> f64 {
        let cost = |levels: &[f64], sd: f64| {
            if sd == 0.0 {
                return 0.0;
            }
            levels.iter().map(|level| level * level).sum::<f64>() / (sd * sd)
        };
        let (tx, rest) = self.crossing_db.split_at(cells.n_nodes);
        let (rx, times) = rest.split_at(cells.n_nodes);
        let of_times = match self.sd.time_db {
            0.0 => 0.0,
            sd_db => cells.square_of_times(times) / (sd_db * sd_db),
        };
        -0.5 * (cost(&self.link_db, self.sd.link_db)
            + cost(&self.channel_db, self.sd.channel_db)
            + cost(tx, self.sd.tx_db)
            + cost(rx, self.sd.rx_db)
            + of_times)
    }

    /// With a step taken.
    #[must_use]
    pub fn moved(&self, step: &Self) -> Self {
        let along = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect();
        Self {
            sd: self.sd,
            link_db: along(&self.link_db, &step.link_db),
            channel_db: along(&self.channel_db, &step.channel_db),
            crossing_db: along(&self.crossing_db, &step.crossing_db),
            ..step.clone()
        }
    }

    /// Standard deviations that the levels suggest (MacKay's fixed point of the marginal likelihood), and how many cells
    /// are well determined.
    #[must_use]
    pub fn suggested(&self, cells: &RowCells) -> (RandomEffectSds, [f64; 5]) {
        let suggest = |levels: &[f64],
                       variances: &dyn Fn(usize) -> f64,
                       seen: &dyn Fn(usize) -> bool,
                       sd: f64| {
            if sd == 0.0 {
                return (0.0, 0.0);
            }
            let (mut squares, mut determined) = (0.0, 0.0);
            for (index, level) in levels.iter().enumerate().filter(|(index, _)| seen(*index)) {
                squares += level * level;
                determined += (1.0 - variances(index) / (sd * sd)).clamp(1e-9, 1.0);
            }
            // No row lies in a cell of this kind: nothing suggests another spread.
            if determined == 0.0 {
                return (sd, 0.0);
            }
            ((squares / determined).sqrt().clamp(1e-3, 30.0), determined)
        };
        let link_variance = |index: usize| {
            let s2 = self.sd.link_db * self.sd.link_db;
            s2 / (1.0 + self.link_weight[index] * s2)
        };
        let channel_variance = |index: usize| {
            let s2 = self.sd.channel_db * self.sd.channel_db;
            let weight = self.channel_weight[index];
            let own = s2 / (1.0 + weight * s2);
            let link = cells.link_of_channel[index] as usize;
            own + (weight * own) * (weight * own) * link_variance(link)
        };
        let n = cells.n_nodes;
        let (tx, rest) = self.crossing_db.split_at(n);
        let (rx, times) = rest.split_at(n);
        let (link_db, links) = suggest(
            &self.link_db,
            &link_variance,
            &|index| 0.0 < self.link_weight[index],
            self.sd.link_db,
        );
        let (channel_db, channels) = suggest(
            &self.channel_db,
            &channel_variance,
            &|index| 0.0 < self.channel_weight[index],
            self.sd.channel_db,
        );
        let variance = |place: usize| self.crossing_variance[place];
        let (tx_db, txs) = suggest(tx, &variance, &|_| true, self.sd.tx_db);
        let (rx_db, rxs) = suggest(rx, &|index| variance(n + index), &|_| true, self.sd.rx_db);
        let worth = self.times_determined;
        let time_db = if self.sd.time_db == 0.0 || worth == 0.0 {
            self.sd.time_db
        } else {
            (cells.square_of_times(times) / worth).sqrt().clamp(1e-3, 30.0)
        };
        (
            RandomEffectSds { link_db, channel_db, tx_db, rx_db, time_db },
            [links, channels, txs, rxs, worth],
        )
    }

    /// How many numbers the random levels are worth in all: each well-determined cell one.
    #[must_use]
    pub fn n_determined(&self, cells: &RowCells) -> f64 {
        self.suggested(cells).1.iter().sum()
    }
}
