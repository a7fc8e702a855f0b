//! One step of Newton's method over parameters and random levels.

use super::Random;
use super::RowCells;
use crate::links::likelihood::RowLikelihood;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

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
        // Levels that cross links follow the parameters.
        let first = if 0.0 < sd.tx_db || 0.0 < sd.rx_db { 0 } else { 2 * self.cells.n_nodes };
        let end = if 0.0 < sd.time_db { self.cells.n_crossing() } else { 2 * self.cells.n_nodes };
        let crossing = first..end;
        let size = p + crossing.len();
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
            self.entries(index, row as usize, &crossing, &mut entries);
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
                // No row of this fit lies in the cell, so its random effect stays at the prior mean.
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
                // As for cells of channels.
                if weight == 0.0 && link.dense[cell].is_empty() {
                    continue;
                }
                let total = weight + cost;
                half_log_determinant += 0.5 * libm::log(total / cost);
                let pull = link.gradient[cell] - cost * random.link_db[cell];
                link.eliminate(cell, total, pull, &mut matrix, &mut vector);
            }
        }
        let nodes = first..crossing.end.min(2 * self.cells.n_nodes);
        for place in nodes {
            let deviation = self.cells.sd_of_crossing(place, sd);
            let cost = 1.0 / (deviation * deviation).max(1e-12);
            let at = p + place - first;
            matrix[(at, at)] += cost;
            vector[at] -= cost * random.crossing_db[place];
            half_log_determinant -= 0.5 * libm::log(cost);
        }
        let times = p + 2 * self.cells.n_nodes - first;
        let cost = 1.0 / (sd.time_db * sd.time_db);
        if 0.0 < sd.time_db {
            let levels = &random.crossing_db[2 * self.cells.n_nodes..];
            self.cells.over_inverse_correlations(|row, column, entry| {
                matrix[(times + row, times + column)] += cost * entry;
                vector[times + row] -= cost * entry * levels[column];
                if row != column {
                    vector[times + column] -= cost * entry * levels[row];
                }
            });
            for correlation in &self.cells.correlations {
                let fresh = 1.0 - correlation * correlation;
                half_log_determinant += 0.5 * libm::log(fresh / cost);
            }
        }
        for i in 0..size {
            for j in 0..i {
                matrix[(j, i)] = matrix[(i, j)];
            }
        }
        let mut information = matrix.view((0, 0), (p, p)).into_owned();
        let n = crossing.len();
        if 0 < n {
            let factor = matrix.view((p, p), (n, n)).into_owned().cholesky()?;
            half_log_determinant +=
                factor.l_dirty().diagonal().iter().map(|d| libm::log(*d)).sum::<f64>();
            let inverse = factor.inverse();
            for place in crossing.clone() {
                out.crossing_variance[place] = inverse[(place - first, place - first)];
            }
            if 0.0 < sd.time_db {
                // The trace of their prior precision times their posterior covariance.
                let mut trace = 0.0;
                self.cells.over_inverse_correlations(|row, column, entry| {
                    let count = if row == column { 1.0 } else { 2.0 };
                    trace += count * entry * inverse[(times - p + row, times - p + column)];
                });
                let n_times = self.cells.correlations.len() as f64;
                out.times_determined = (n_times - cost * trace).clamp(1e-9, n_times);
            }
            let cross = matrix.view((p, 0), (n, p)).into_owned();
            information -= cross.transpose() * factor.solve(&cross);
        }
        // Only parameters are damped: random effects have a prior, which keeps their part positive definite.
        for i in 0..p {
            matrix[(i, i)] = matrix[(i, i)] * (1.0 + damping) + 1e-12;
        }
        let solution = matrix.cholesky()?.solve(&vector);
        out.crossing_db.fill(0.0);
        for place in crossing {
            out.crossing_db[place] = solution[p + place - first];
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
    fn entries(
        &self,
        index: usize,
        row: usize,
        crossing: &Range<usize>,
        entries: &mut Vec<(usize, f64)>,
    ) {
        let p = self.n_parameters;
        entries.clear();
        for (i, &a) in self.jacobian[index * p..(index + 1) * p].iter().enumerate() {
            if a != 0.0 {
                entries.push((i, a));
            }
        }
        let places = self.cells.crossing(row).filter(|place| crossing.contains(place));
        entries.extend(places.map(|place| (p + place - crossing.start, 1.0)));
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
