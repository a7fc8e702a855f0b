//! Random effects per node, link and channel: intercepts with shrinkage, estimated together with all other parameters.
//!
//! Nested cells (a link and place, and in it a channel and finer place) are eliminated one by one; offsets of nodes, which
//! cross all links, stand in the dense system with the parameters. So one step of Newton's method costs one pass over the
//! rows, however many cells there are. This is a Schur complement, in the Gaussian case as in lme4 (Bates et al., Fitting linear
//! mixed-effects models using lme4, Journal of Statistical Software 67 (2015), § 3); here the weights come from the likelihood.

use super::likelihood::RowLikelihood;
use super::rows::ModelledLinks;
use nalgebra::{DMatrix, DVector};
use netsim::phy::scatter::{Law, Renewal};

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
}

impl RandomEffectSds {
    /// Random levels that the configuration itself has.
    pub(super) fn configured(rows: &ModelledLinks) -> Self {
        let mut known = Self::default();
        for scatter in
            rows.model.scatters().iter().filter(|scatter| scatter.renewal != Renewal::Frame)
        {
            match (scatter.law, scatter.renewal) {
                (Law::Nodes { tx_sd_db, rx_sd_db }, _) => {
                    known.tx_db = libm::hypot(known.tx_db, tx_sd_db);
                    known.rx_db = libm::hypot(known.rx_db, rx_sd_db);
                }
                (Law::Normal { sd_db }, Renewal::Place { .. }) => {
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
    /// By row: the number of its cell of link, place, channel and finer place. Each lies in one cell of `link`.
    pub channel: Vec<u32>,
    /// The link cell of each channel cell.
    pub link_of_channel: Vec<u32>,
    /// Number of cells of links and places.
    pub n_links: usize,
    /// By row: sender and receiver, as indices below `n_nodes`.
    pub nodes: Vec<(u32, u32)>,
    /// Number of nodes.
    pub n_nodes: usize,
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
    node_db: Vec<f64>,
    node_variance: Vec<f64>,
}

/// A step of Newton's method.
#[derive(Clone, Debug)]
pub struct NewtonStep {
    /// Change of the parameters, in the order of the fit; each in its own unit.
    pub parameters: DVector<f64>,
    /// The random levels after the step.
    pub random: Random,
    /// Information about the parameters, random levels eliminated.
    pub information: DMatrix<f64>,
    /// Half the logarithm of the determinant that the integral over all random levels brings (Laplace).
    pub half_log_determinant: f64,
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
            node_db: vec![0.0; 2 * cells.n_nodes],
            node_variance: vec![0.0; 2 * cells.n_nodes],
        }
    }

    /// The same random effects with other standard deviations; 0 where the standard deviation is 0.
    #[must_use]
    pub fn with_sds(&self, sd: RandomEffectSds) -> Self {
        let mut other = Self { sd, ..self.clone() };
        let (tx, rx) = other.node_db.split_at_mut(self.node_db.len() / 2);
        let levels = [
            (sd.link_db, &mut other.link_db[..]),
            (sd.channel_db, &mut other.channel_db[..]),
            (sd.tx_db, tx),
            (sd.rx_db, rx),
        ];
        for (_, levels) in levels.into_iter().filter(|(sd, _)| *sd == 0.0) {
            levels.fill(0.0);
        }
        other
    }

    /// Whether these are levels of such cells.
    #[must_use]
    pub fn fits(&self, cells: &RowCells) -> bool {
        self.link_db.len() == cells.n_links
            && self.channel_db.len() == cells.link_of_channel.len()
            && self.node_db.len() == 2 * cells.n_nodes
    }

    /// The random level of a row: its mode (dB).
    #[must_use]
    pub fn level_db(&self, cells: &RowCells, row: usize) -> f64 {
        let (tx, rx) = cells.nodes[row];
        self.link_db[cells.link[row] as usize]
            + self.channel_db[cells.channel[row] as usize]
            + self.node_db[tx as usize]
            + self.node_db[cells.n_nodes + rx as usize]
    }

    /// The levels of nodes alone: nothing is known of those of links and channels but their spreads.
    #[must_use]
    pub fn of_nodes(&self) -> Self {
        let mut alone = self.clone();
        for levels in [
            &mut alone.link_db,
            &mut alone.channel_db,
            &mut alone.link_weight,
            &mut alone.channel_weight,
        ] {
            levels.fill(0.0);
        }
        alone
    }

    /// Variance of the random level of a row about its mode (dB²).
    #[must_use]
    pub fn variance(&self, cells: &RowCells, row: usize) -> f64 {
        let (tx, rx) = cells.nodes[row];
        let nodes =
            self.node_variance[tx as usize] + self.node_variance[cells.n_nodes + rx as usize];
        let posterior = |sd: f64, weight: f64| {
            let variance = sd * sd / (1.0 + weight * sd * sd);
            (variance, 1.0 - weight * variance)
        };
        let (link, link_rest) =
            posterior(self.sd.link_db, self.link_weight[cells.link[row] as usize]);
        let (channel, channel_rest) =
            posterior(self.sd.channel_db, self.channel_weight[cells.channel[row] as usize]);
        let under = link + link_rest * link_rest * nodes;
        channel + channel_rest * channel_rest * under
    }

    /// Minus half the squared levels over their variances: what they cost.
    #[must_use]
    pub fn penalty(&self, n_nodes: usize) -> f64 {
        let cost = |levels: &[f64], sd: f64| {
            if sd == 0.0 {
                return 0.0;
            }
            levels.iter().map(|level| level * level).sum::<f64>() / (sd * sd)
        };
        let (tx, rx) = self.node_db.split_at(n_nodes);
        -0.5 * (cost(&self.link_db, self.sd.link_db)
            + cost(&self.channel_db, self.sd.channel_db)
            + cost(tx, self.sd.tx_db)
            + cost(rx, self.sd.rx_db))
    }

    /// With a step taken.
    #[must_use]
    pub fn moved(&self, step: &Self) -> Self {
        let along = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect();
        Self {
            sd: self.sd,
            link_db: along(&self.link_db, &step.link_db),
            channel_db: along(&self.channel_db, &step.channel_db),
            node_db: along(&self.node_db, &step.node_db),
            ..step.clone()
        }
    }

    /// Standard deviations that the levels suggest (MacKay's fixed point of the marginal likelihood), and how many cells
    /// are well determined.
    #[must_use]
    pub fn suggested(&self, cells: &RowCells) -> (RandomEffectSds, [f64; 4]) {
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
        let (tx, rx) = self.node_db.split_at(n);
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
        let (tx_db, txs) =
            suggest(tx, &|index| self.node_variance[index], &|_| true, self.sd.tx_db);
        let (rx_db, rxs) =
            suggest(rx, &|index| self.node_variance[n + index], &|_| true, self.sd.rx_db);
        (RandomEffectSds { link_db, channel_db, tx_db, rx_db }, [links, channels, txs, rxs])
    }

    /// How many numbers the random levels are worth in all: each well-determined cell one.
    #[must_use]
    pub fn n_determined(&self, cells: &RowCells) -> f64 {
        self.suggested(cells).1.iter().sum()
    }
}

/// Solves one step: parameters with rows of derivatives `jacobian` (row-major, `n_parameters` each), random levels with
/// their costs. `extra` is added to the information of the parameters, `gradient` to their gradient (what is not a mean).
pub struct Solver<'a> {
    /// Cells of all rows of the study.
    pub cells: &'a RowCells,
    /// The rows that are fitted.
    pub train: &'a [u32],
    /// Their slopes, in the same order.
    pub slopes: &'a [RowLikelihood],
    /// Derivatives of their levels (dB) by the parameters: a row of `n_parameters` values for each of `train`.
    pub jacobian: &'a [f64],
    /// Number of parameters: columns of `jacobian`.
    pub n_parameters: usize,
}

impl Solver<'_> {
    /// The step. `damping` multiplies the diagonal of the information. `None` where the system is singular.
    #[must_use]
    pub fn step(
        &self,
        random: &Random,
        extra: &DMatrix<f64>,
        gradient: &DVector<f64>,
        damping: f64,
    ) -> Option<NewtonStep> {
        let p = self.n_parameters;
        let sd = random.sd;
        let has_nodes = 0.0 < sd.tx_db || 0.0 < sd.rx_db;
        let n_nodes = if has_nodes { self.cells.n_nodes } else { 0 };
        let size = p + 2 * n_nodes;
        let mut matrix = DMatrix::zeros(size, size);
        let mut vector = DVector::zeros(size);
        matrix.view_mut((0, 0), (p, p)).copy_from(extra);
        vector.rows_mut(0, p).copy_from(gradient);
        let n_links = self.cells.n_links;
        let n_channels = self.cells.link_of_channel.len();
        // Sums over cells: weight, gradient, and the weighted dense entries.
        let has_cells = 0.0 < sd.link_db || 0.0 < sd.channel_db;
        let mut channel = Sums::new(if 0.0 < sd.channel_db { n_channels } else { 0 });
        let mut link = Sums::new(if has_cells { n_links } else { 0 });
        let mut entries: Vec<(usize, f64)> = Vec::with_capacity(p + 2);
        let (mut lower, mut pulls) = (vec![0.0; size * size], vec![0.0; size]);
        for (index, &row) in self.train.iter().enumerate() {
            let slope = &self.slopes[index];
            self.entries(index, row as usize, n_nodes, &mut entries);
            // Entries ascend: those up to the k-th are of the lower triangle.
            for (k, &(i, a)) in entries.iter().enumerate() {
                pulls[i] += a * slope.over_level;
                let scaled = slope.weight * a;
                let line = &mut lower[i * size..][..size];
                for &(j, b) in &entries[..=k] {
                    line[j] += scaled * b;
                }
            }
            if 0.0 < sd.channel_db {
                let cell = self.cells.channel[row as usize] as usize;
                channel.add(cell, slope, &entries);
            } else if 0.0 < sd.link_db {
                link.add(self.cells.link[row as usize] as usize, slope, &entries);
            }
        }
        matrix += DMatrix::from_row_slice(size, size, &lower);
        vector += DVector::from_vec(pulls);
        let mut half_log_determinant = 0.0;
        let mut out = random.clone();
        if 0.0 < sd.channel_db {
            let cost = 1.0 / (sd.channel_db * sd.channel_db);
            for cell in 0..n_channels {
                let weight = channel.weight[cell];
                out.channel_weight[cell] = weight;
                if weight == 0.0 && channel.dense[cell].is_empty() {
                    continue;
                }
                let total = weight + cost;
                half_log_determinant += 0.5 * libm::log(total / cost);
                let pull = channel.gradient[cell] - cost * random.channel_db[cell];
                channel.eliminate(cell, total, pull, &mut matrix, &mut vector);
                if 0.0 < sd.link_db {
                    let into = self.cells.link_of_channel[cell] as usize;
                    let rest = 1.0 - weight / total;
                    link.weight[into] += weight * rest;
                    link.gradient[into] += channel.gradient[cell] - weight * pull / total;
                    let dense = std::mem::take(&mut channel.dense[cell]);
                    for &(i, a) in &dense {
                        link.put(into, i, a * rest);
                    }
                    channel.dense[cell] = dense;
                }
            }
        }
        if 0.0 < sd.link_db {
            let cost = 1.0 / (sd.link_db * sd.link_db);
            for cell in 0..n_links {
                let weight = link.weight[cell];
                out.link_weight[cell] = weight;
                if weight == 0.0 && link.dense[cell].is_empty() {
                    continue;
                }
                let total = weight + cost;
                half_log_determinant += 0.5 * libm::log(total / cost);
                let pull = link.gradient[cell] - cost * random.link_db[cell];
                link.eliminate(cell, total, pull, &mut matrix, &mut vector);
            }
        }
        for node in 0..2 * n_nodes {
            let deviation = if node < n_nodes { sd.tx_db } else { sd.rx_db };
            let cost = 1.0 / (deviation * deviation).max(1e-12);
            matrix[(p + node, p + node)] += cost;
            vector[p + node] -= cost * random.node_db[node];
            half_log_determinant -= 0.5 * libm::log(cost);
        }
        for i in 0..size {
            for j in 0..i {
                matrix[(j, i)] = matrix[(i, j)];
            }
        }
        let mut information = matrix.view((0, 0), (p, p)).into_owned();
        if 0 < n_nodes {
            let factor = matrix.view((p, p), (2 * n_nodes, 2 * n_nodes)).into_owned().cholesky()?;
            half_log_determinant +=
                factor.l_dirty().diagonal().iter().map(|d| libm::log(*d)).sum::<f64>();
            let inverse = factor.inverse();
            for node in 0..2 * n_nodes {
                out.node_variance[node] = inverse[(node, node)];
            }
            let cross = matrix.view((p, 0), (2 * n_nodes, p)).into_owned();
            information -= cross.transpose() * factor.solve(&cross);
        }
        for i in 0..p {
            matrix[(i, i)] = matrix[(i, i)] * (1.0 + damping) + 1e-12;
        }
        let solution = matrix.cholesky()?.solve(&vector);
        for node in 0..2 * n_nodes {
            out.node_db[node] = solution[p + node];
        }
        if !has_nodes {
            out.node_db.fill(0.0);
        }
        let along =
            |dense: &[(usize, f64)]| -> f64 { dense.iter().map(|&(i, a)| a * solution[i]).sum() };
        out.link_db.fill(0.0);
        out.channel_db.fill(0.0);
        if 0.0 < sd.link_db {
            let cost = 1.0 / (sd.link_db * sd.link_db);
            for cell in 0..n_links {
                let pull = link.gradient[cell] - cost * random.link_db[cell];
                out.link_db[cell] = (pull - along(&link.dense[cell])) / (link.weight[cell] + cost);
            }
        }
        if 0.0 < sd.channel_db {
            let cost = 1.0 / (sd.channel_db * sd.channel_db);
            for cell in 0..n_channels {
                let weight = channel.weight[cell];
                let pull = channel.gradient[cell] - cost * random.channel_db[cell];
                let link_step = out.link_db[self.cells.link_of_channel[cell] as usize];
                out.channel_db[cell] =
                    (pull - along(&channel.dense[cell]) - weight * link_step) / (weight + cost);
            }
        }
        Some(NewtonStep {
            parameters: solution.rows(0, p).into_owned(),
            random: out,
            information,
            half_log_determinant,
        })
    }

    /// The entries of a row in the dense system.
    fn entries(&self, index: usize, row: usize, n_nodes: usize, entries: &mut Vec<(usize, f64)>) {
        let p = self.n_parameters;
        entries.clear();
        for (i, &a) in self.jacobian[index * p..(index + 1) * p].iter().enumerate() {
            if a != 0.0 {
                entries.push((i, a));
            }
        }
        if 0 < n_nodes {
            let (tx, rx) = self.cells.nodes[row];
            entries.push((p + tx as usize, 1.0));
            entries.push((p + n_nodes + rx as usize, 1.0));
        }
    }
}

/// Sums over the rows of cells.
struct Sums {
    weight: Vec<f64>,
    gradient: Vec<f64>,
    dense: Vec<Vec<(usize, f64)>>,
}

impl Sums {
    fn new(n: usize) -> Self {
        Self { weight: vec![0.0; n], gradient: vec![0.0; n], dense: vec![Vec::new(); n] }
    }

    fn add(&mut self, cell: usize, slope: &RowLikelihood, entries: &[(usize, f64)]) {
        self.weight[cell] += slope.weight;
        self.gradient[cell] += slope.over_level;
        for &(i, a) in entries {
            self.put(cell, i, slope.weight * a);
        }
    }

    fn put(&mut self, cell: usize, i: usize, a: f64) {
        let dense = &mut self.dense[cell];
        match dense.iter_mut().find(|(j, _)| *j == i) {
            Some((_, sum)) => *sum += a,
            None => dense.push((i, a)),
        }
    }

    fn eliminate(
        &self,
        cell: usize,
        total: f64,
        pull: f64,
        matrix: &mut DMatrix<f64>,
        vector: &mut DVector<f64>,
    ) {
        for &(i, a) in &self.dense[cell] {
            vector[i] -= a * pull / total;
            for &(j, b) in &self.dense[cell] {
                if j <= i {
                    matrix[(i, j)] -= a * b / total;
                }
            }
        }
    }
}
