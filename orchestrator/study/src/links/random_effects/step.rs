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
/// their costs.
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
    /// The step. `extra` is added to the information of the parameters, `gradient` to their gradient (what is not a mean); `damping`
    /// multiplies the diagonal of the information. `None` where the system is singular.
    #[must_use]
    pub fn step(
        &self,
        random: &Random,
        extra: &DMatrix<f64>,
        gradient: &DVector<f64>,
        damping: f64,
    ) -> Option<NewtonStep> {
        let mut system = System::new(self, random, extra, gradient);
        system.add_rows();
        system.eliminate_channels();
        system.eliminate_links();
        system.add_priors_of_nodes();
        system.add_priors_of_times();
        system.matrix.fill_upper_triangle_with_lower_triangle();
        let information = system.eliminate_crossing()?;
        let solution = system.solved(damping)?;
        system.set_crossing(&solution);
        system.set_links(&solution);
        system.set_channels(&solution);
        Some(NewtonStep {
            parameters: solution.rows(0, self.n_parameters).into_owned(),
            random: system.after,
            information,
            half_log_determinant: system.half_log_determinant,
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

/// The system of linear equations of one step. Its dense part has the parameters, then the levels that cross links; cells of links and
/// channels are eliminated.
struct System<'a> {
    solver: &'a Solver<'a>,
    /// Random levels before the step.
    before: &'a Random,
    /// Random levels after the step.
    after: Random,
    /// Which of the levels that cross links are in the dense part.
    crossing: Range<usize>,
    /// Information of the dense part.
    matrix: DMatrix<f64>,
    /// Its gradient.
    vector: DVector<f64>,
    /// Sums over cells of links and channels; none where the model has no such level.
    channel: Sums,
    /// Sums over cells of links; none where the model has no such level.
    link: Sums,
    half_log_determinant: f64,
}

/// The precision of a level with this standard deviation.
fn precision(sd_db: f64) -> f64 {
    1.0 / (sd_db * sd_db)
}

impl<'a> System<'a> {
    fn new(
        solver: &'a Solver<'a>,
        before: &'a Random,
        extra: &DMatrix<f64>,
        gradient: &DVector<f64>,
    ) -> Self {
        let (p, cells, sd) = (solver.n_parameters, solver.cells, before.sd);
        let first = if 0.0 < sd.tx_db || 0.0 < sd.rx_db { 0 } else { 2 * cells.n_nodes };
        let end = if 0.0 < sd.time_db { cells.n_crossing() } else { 2 * cells.n_nodes };
        let size = p + (first..end).len();
        let mut matrix = DMatrix::zeros(size, size);
        let mut vector = DVector::zeros(size);
        matrix.view_mut((0, 0), (p, p)).copy_from(extra);
        vector.rows_mut(0, p).copy_from(gradient);
        let sums = |sd_db: f64, n: usize| Sums::new(if 0.0 < sd_db { n } else { 0 });
        Self {
            solver,
            before,
            after: before.clone(),
            crossing: first..end,
            matrix,
            vector,
            channel: sums(sd.channel_db, cells.link_of_channel.len()),
            link: sums(sd.link_db, cells.n_links),
            half_log_determinant: 0.0,
        }
    }

    /// Where a level that crosses links stands in the dense part.
    fn place_of(&self, crossing: usize) -> usize {
        self.solver.n_parameters + crossing - self.crossing.start
    }

    /// Adds what the rows say: to the lower triangle of the dense part, and to the finest cells.
    fn add_rows(&mut self) {
        let Solver { cells, train, slopes, .. } = *self.solver;
        let size = self.vector.len();
        let sd = self.before.sd;
        let mut entries: Vec<(usize, f64)> = Vec::with_capacity(self.solver.n_parameters + 2);
        let (mut lower, mut pulls) = (vec![0.0; size * size], vec![0.0; size]);
        for (index, &row) in train.iter().enumerate() {
            let slope = &slopes[index];
            self.solver.entries(index, row as usize, &self.crossing, &mut entries);
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
                self.channel.add(cells.channel[row as usize] as usize, slope, &entries);
            } else if 0.0 < sd.link_db {
                self.link.add(cells.link[row as usize] as usize, slope, &entries);
            }
        }
        self.matrix += DMatrix::from_row_slice(size, size, &lower);
        self.vector += DVector::from_vec(pulls);
    }

    /// Eliminates the levels of links and channels; what is left of their cells is added to those of links.
    fn eliminate_channels(&mut self) {
        let cost = precision(self.before.sd.channel_db);
        for cell in 0..self.channel.n_cells() {
            let weight = self.channel.weight[cell];
            self.after.channel_weight[cell] = weight;
            // No row of this fit lies in the cell, so its random effect stays at the prior mean.
            if self.channel.has_no_row(cell) {
                continue;
            }
            let total = weight + cost;
            self.half_log_determinant += 0.5 * libm::log(total / cost);
            let pull = self.channel.gradient[cell] - cost * self.before.channel_db[cell];
            self.channel.eliminate(cell, total, pull, &mut self.matrix, &mut self.vector);
            if 0.0 < self.before.sd.link_db {
                let into = self.solver.cells.link_of_channel[cell] as usize;
                let rest = 1.0 - weight / total;
                self.link.weight[into] += weight * rest;
                self.link.gradient[into] += self.channel.gradient[cell] - weight * pull / total;
                for &(i, a) in &self.channel.dense[cell] {
                    self.link.put(into, i, a * rest);
                }
            }
        }
    }

    /// Eliminates the levels of links.
    fn eliminate_links(&mut self) {
        let cost = precision(self.before.sd.link_db);
        for cell in 0..self.link.n_cells() {
            let weight = self.link.weight[cell];
            self.after.link_weight[cell] = weight;
            // As for cells of channels.
            if self.link.has_no_row(cell) {
                continue;
            }
            let total = weight + cost;
            self.half_log_determinant += 0.5 * libm::log(total / cost);
            let pull = self.link.gradient[cell] - cost * self.before.link_db[cell];
            self.link.eliminate(cell, total, pull, &mut self.matrix, &mut self.vector);
        }
    }

    /// Adds that levels of nodes are independent of each other.
    fn add_priors_of_nodes(&mut self) {
        let cells = self.solver.cells;
        for place in self.crossing.start..self.crossing.end.min(2 * cells.n_nodes) {
            let deviation = cells.sd_of_crossing(place, self.before.sd);
            let cost = 1.0 / (deviation * deviation).max(1e-12);
            let at = self.place_of(place);
            self.matrix[(at, at)] += cost;
            self.vector[at] -= cost * self.before.crossing_db[place];
            self.half_log_determinant -= 0.5 * libm::log(cost);
        }
    }

    /// Adds how levels of times are correlated with each other.
    fn add_priors_of_times(&mut self) {
        let sd_db = self.before.sd.time_db;
        if sd_db <= 0.0 {
            return;
        }
        let cells = self.solver.cells;
        let (times, cost) = (self.place_of(2 * cells.n_nodes), precision(sd_db));
        let levels = &self.before.crossing_db[2 * cells.n_nodes..];
        cells.over_inverse_correlations(|row, column, entry| {
            self.matrix[(times + row, times + column)] += cost * entry;
            self.vector[times + row] -= cost * entry * levels[column];
            if row != column {
                self.vector[times + column] -= cost * entry * levels[row];
            }
        });
        for correlation in &cells.correlations {
            let fresh = 1.0 - correlation * correlation;
            self.half_log_determinant += 0.5 * libm::log(fresh / cost);
        }
    }

    /// The information about the parameters, levels that cross links eliminated; sets the variances of these.
    fn eliminate_crossing(&mut self) -> Option<DMatrix<f64>> {
        let (p, n) = (self.solver.n_parameters, self.crossing.len());
        let mut information = self.matrix.view((0, 0), (p, p)).into_owned();
        if n == 0 {
            return Some(information);
        }
        let factor = self.matrix.view((p, p), (n, n)).into_owned().cholesky()?;
        self.half_log_determinant +=
            factor.l_dirty().diagonal().iter().map(|d| libm::log(*d)).sum::<f64>();
        let inverse = factor.inverse();
        for (index, place) in self.crossing.clone().enumerate() {
            self.after.crossing_variance[place] = inverse[(index, index)];
        }
        let (cells, sd_db) = (self.solver.cells, self.before.sd.time_db);
        if self.crossing.start == 0 {
            let n = cells.n_nodes;
            let of_ends = (0..n * n).map(|index| inverse[(index / n, n + index % n)]);
            self.after.end_covariance.clear();
            self.after.end_covariance.extend(of_ends);
        }
        if 0.0 < sd_db {
            let times = 2 * cells.n_nodes - self.crossing.start;
            // The trace of their prior precision times their posterior covariance.
            let mut trace = 0.0;
            cells.over_inverse_correlations(|row, column, entry| {
                let count = if row == column { 1.0 } else { 2.0 };
                trace += count * entry * inverse[(times + row, times + column)];
            });
            let n_times = cells.correlations.len() as f64;
            self.after.times_determined = (n_times - precision(sd_db) * trace).clamp(1e-9, n_times);
        }
        let cross = self.matrix.view((p, 0), (n, p)).into_owned();
        information -= cross.transpose() * factor.solve(&cross);
        Some(information)
    }

    /// Solves the dense part. Only parameters are damped: random effects have a prior, which keeps their part positive definite.
    fn solved(&self, damping: f64) -> Option<DVector<f64>> {
        let mut matrix = self.matrix.clone();
        for i in 0..self.solver.n_parameters {
            matrix[(i, i)] = matrix[(i, i)] * (1.0 + damping) + 1e-12;
        }
        Some(matrix.cholesky()?.solve(&self.vector))
    }

    fn set_crossing(&mut self, solution: &DVector<f64>) {
        self.after.crossing_db.fill(0.0);
        for place in self.crossing.clone() {
            self.after.crossing_db[place] = solution[self.place_of(place)];
        }
    }

    fn set_links(&mut self, solution: &DVector<f64>) {
        let cost = precision(self.before.sd.link_db);
        self.after.link_db.fill(0.0);
        for cell in 0..self.link.n_cells() {
            let pull = self.link.gradient[cell] - cost * self.before.link_db[cell];
            self.after.link_db[cell] =
                (pull - self.link.along(cell, solution)) / (self.link.weight[cell] + cost);
        }
    }

    fn set_channels(&mut self, solution: &DVector<f64>) {
        let cost = precision(self.before.sd.channel_db);
        self.after.channel_db.fill(0.0);
        for cell in 0..self.channel.n_cells() {
            let weight = self.channel.weight[cell];
            let pull = self.channel.gradient[cell] - cost * self.before.channel_db[cell];
            let link_step = self.after.link_db[self.solver.cells.link_of_channel[cell] as usize];
            self.after.channel_db[cell] =
                (pull - self.channel.along(cell, solution) - weight * link_step) / (weight + cost);
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

    fn n_cells(&self) -> usize {
        self.weight.len()
    }

    /// Whether no row lies in a cell.
    fn has_no_row(&self, cell: usize) -> bool {
        self.weight[cell] == 0.0 && self.dense[cell].is_empty()
    }

    /// By how much the dense part moves a cell.
    fn along(&self, cell: usize, solution: &DVector<f64>) -> f64 {
        self.dense[cell].iter().map(|&(i, a)| a * solution[i]).sum()
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

#[cfg(test)]
mod tests {
    use super::super::RandomEffectSds;
    use super::*;

    #[test]
    fn of_two_nodes_the_sum_of_levels_is_known_though_neither_is() {
        let n = 200;
        let ends = |row: u32| (row % 2, 1 - row % 2);
        let cells = RowCells {
            link: vec![0; n],
            channel: vec![0; n],
            link_of_channel: vec![0],
            n_links: 1,
            nodes: (0..n as u32).map(ends).collect(),
            n_nodes: 2,
            times: Vec::new(),
            correlations: Vec::new(),
        };
        let sd = RandomEffectSds { tx_db: 5.0, rx_db: 5.0, ..RandomEffectSds::default() };
        let train: Vec<u32> = (0..n as u32).collect();
        let slope = RowLikelihood { over_level: 0.0, weight: 1.0, ..RowLikelihood::default() };
        let (slopes, random) = (vec![slope; n], Random::new(sd, &cells));
        let solver = Solver {
            cells: &cells,
            train: &train,
            slopes: &slopes,
            jacobian: &[],
            n_parameters: 0,
        };
        let step = solver.step(&random, &DMatrix::zeros(0, 0), &DVector::zeros(0), 0.0).unwrap();
        // A hundred rows of variance 1, and a prior of twice 25.
        let expected = 1.0 / (100.0 + 1.0 / 50.0);
        assert!((step.random.variance(&cells, 0) - expected).abs() < 1e-9);
        let alone = step.random.with_sds(RandomEffectSds::default(), &cells);
        assert_eq!(alone.variance(&cells, 0), 0.0);
    }
}
