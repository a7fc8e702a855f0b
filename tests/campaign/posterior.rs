//! What the true model knows of a random effect from the rows of other times.

use super::effect::Random;
use super::field::{Cholesky, Kernel, matrix, pairs};
use super::world::World;

/// What a row tells about its random part f: log likelihood -w/2 (f - at)² + const.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    /// The value that fits it best (dB).
    pub(crate) at_db: f64,
    /// Its weight w (1/dB²).
    pub(crate) weight: f64,
}

/// Mean (dB) and variance (dB²) of the random part of each row, from the evidence of the rows of other folds only.
///
/// Newton's method for the mode (Rasmussen and Williams 2006, § 3.4): `evidence` says what a row tells where its part is
/// some value. Effects that belong to nodes are eliminated by the matrix inversion lemma, those that belong to pairs make
/// one block per pair.
pub(crate) fn foretold(
    world: &World,
    random: &[Random],
    folds: &[usize],
    evidence: impl Fn(usize, f64) -> Evidence,
) -> Vec<(f64, f64)> {
    let mut foretold = vec![(0.0, 0.0); world.rows.len()];
    let n_folds = folds.iter().max().map_or(0, |last| last + 1);
    for fold in 0..n_folds {
        let mut modes = vec![0.0; world.rows.len()];
        // The likelihood of losses is close to quadratic over a step: it converges to 1e-3 dB in five.
        for step in 0..6 {
            let told: Vec<Evidence> =
                modes.iter().enumerate().map(|(row, &mode)| evidence(row, mode)).collect();
            let posterior = Posterior::given(world, random, &told, |row| folds[row] != fold);
            if step < 5 {
                posterior.each(world, |row| folds[row] != fold, |row, mean, _| modes[row] = mean);
            } else {
                let set = |row: usize, mean, variance| foretold[row] = (mean, variance);
                posterior.each(world, |row| folds[row] == fold, set);
            }
        }
    }
    foretold
}

/// The Gaussian posterior for given evidence.
struct Posterior {
    kernels: Vec<Kernel>,
    blocks: Vec<Block>,
    /// Node effects: their mean, and the factor of their precision.
    nodes: Option<(Vec<f64>, Cholesky)>,
    n_nodes: usize,
}

/// A pair of nodes.
struct Block {
    rows: Vec<usize>,
    known: Vec<usize>,
    /// Of the covariance of its evidence.
    factor: Cholesky,
    /// The evidence less the mean of the node effects, solved.
    weights: Vec<f64>,
}

impl Posterior {
    fn given(
        world: &World,
        random: &[Random],
        told: &[Evidence],
        is_known: impl Fn(usize) -> bool,
    ) -> Self {
        let kernels: Vec<Kernel> = random
            .iter()
            .filter_map(|part| if let Random::Pairs(kernel) = part { Some(*kernel) } else { None })
            .collect();
        let variances = random.iter().find_map(|part| {
            if let Random::Nodes(variances) = part { Some(*variances) } else { None }
        });
        let n_nodes = world.n_nodes;
        let mut blocks: Vec<Block> = pairs(&world.rows)
            .into_iter()
            .map(|rows| {
                let known: Vec<usize> = rows.iter().copied().filter(|&row| is_known(row)).collect();
                let factor = Cholesky::factorise(matrix(known.len(), |i, j| {
                    let noise = if i == j { 1.0 / told[known[i]].weight } else { 0.0 };
                    covariance(&kernels, world, known[i], known[j]) + noise
                }));
                let values: Vec<f64> = known.iter().map(|&row| told[row].at_db).collect();
                let weights = factor.solve(&values);
                Block { rows, known, factor, weights }
            })
            .collect();
        let nodes = variances.map(|variances| {
            let mut precision = matrix(2 * n_nodes, |i, j| {
                if i == j { 1.0 / variances[usize::from(n_nodes <= i)] } else { 0.0 }
            });
            let mut right = vec![0.0; 2 * n_nodes];
            for block in &blocks {
                for (column, solved) in block.columns(world) {
                    for (&row, &value) in block.known.iter().zip(&solved) {
                        for other in members(world, row) {
                            if other <= column {
                                precision[column][other] += value;
                            }
                        }
                    }
                }
                for (&row, &weight) in block.known.iter().zip(&block.weights) {
                    for member in members(world, row) {
                        right[member] += weight;
                    }
                }
            }
            let factor = Cholesky::factorise(precision);
            (factor.solve(&right), factor)
        });
        if let Some((means, _)) = &nodes {
            for block in &mut blocks {
                let values: Vec<f64> = block
                    .known
                    .iter()
                    .map(|&row| {
                        let known: f64 = members(world, row).map(|k| means[k]).iter().sum();
                        told[row].at_db - known
                    })
                    .collect();
                block.weights = block.factor.solve(&values);
            }
        }
        Self { kernels, blocks, nodes, n_nodes }
    }

    /// Mean and variance of each row asked for.
    fn each(
        &self,
        world: &World,
        is_asked: impl Fn(usize) -> bool,
        mut set: impl FnMut(usize, f64, f64),
    ) {
        for block in &self.blocks {
            for &row in block.rows.iter().filter(|&&row| is_asked(row)) {
                let cross: Vec<f64> = block
                    .known
                    .iter()
                    .map(|&known| covariance(&self.kernels, world, row, known))
                    .collect();
                let solved = block.factor.solve(&cross);
                let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
                let mut mean = dot(&cross, &block.weights);
                let mut variance =
                    covariance(&self.kernels, world, row, row) - dot(&cross, &solved);
                if let Some((means, factor)) = &self.nodes {
                    let mut unseen = vec![0.0; 2 * self.n_nodes];
                    for member in members(world, row) {
                        unseen[member] += 1.0;
                        mean += means[member];
                    }
                    for (&known, &part) in block.known.iter().zip(&solved) {
                        for member in members(world, known) {
                            unseen[member] -= part;
                        }
                    }
                    variance += dot(&unseen, &factor.solve(&unseen));
                }
                set(row, mean, variance.max(0.0));
            }
        }
    }
}

impl Block {
    /// For each node effect that its rows have: that column of the design, solved.
    fn columns(&self, world: &World) -> Vec<(usize, Vec<f64>)> {
        let Some(&first) = self.known.first() else { return Vec::new() };
        let [a, b] = [world.rows[first].tx, world.rows[first].rx];
        [a, b, a + world.n_nodes, b + world.n_nodes]
            .into_iter()
            .map(|column| {
                let has = |row: &usize| f64::from(u8::from(members(world, *row).contains(&column)));
                let design: Vec<f64> = self.known.iter().map(has).collect();
                (column, self.factor.solve(&design))
            })
            .collect()
    }
}

/// The node effects of a row: its sender's, and its receiver's.
fn members(world: &World, row: usize) -> [usize; 2] {
    [world.rows[row].tx, world.rows[row].rx + world.n_nodes]
}

fn covariance(kernels: &[Kernel], world: &World, one: usize, other: usize) -> f64 {
    kernels.iter().map(|kernel| kernel.covariance(&world.rows[one], &world.rows[other])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Layout;

    #[test]
    fn elimination_of_the_nodes_is_exact() {
        let layout = Layout { n_fixed: 3, n_moving: 2, ..Layout::standard() };
        let world = World::new(1, &layout, &[], 80);
        let kernel = Kernel::Place { variance: 2.0, decorrelation_m: 9.0 };
        let random = [Random::Nodes([3.0, 1.5]), Random::Pairs(kernel)];
        let told: Vec<Evidence> = (0..world.rows.len())
            .map(|row| Evidence {
                at_db: (row as f64).sin(),
                weight: 0.5 + 0.3 * (row as f64).cos(),
            })
            .collect();
        let is_known = |row: usize| !row.is_multiple_of(3);
        let known: Vec<usize> = (0..world.rows.len()).filter(|&row| is_known(row)).collect();
        // All at once: one dense covariance.
        let dense = |one: usize, other: usize| {
            let [a, b] = [one, other].map(|row| members(&world, row));
            let same = |k: usize, variance: f64| if a[k] == b[k] { variance } else { 0.0 };
            let pair = |row: usize| {
                let row = world.rows[row];
                [row.tx.min(row.rx), row.tx.max(row.rx)]
            };
            let block = if pair(one) == pair(other) {
                kernel.covariance(&world.rows[one], &world.rows[other])
            } else {
                0.0
            };
            same(0, 3.0) + same(1, 1.5) + block
        };
        let factor = Cholesky::factorise(matrix(known.len(), |i, j| {
            let noise = if i == j { 1.0 / told[known[i]].weight } else { 0.0 };
            dense(known[i], known[j]) + noise
        }));
        let values: Vec<f64> = known.iter().map(|&row| told[row].at_db).collect();
        let weights = factor.solve(&values);
        let posterior = Posterior::given(&world, &random, &told, is_known);
        let mut n = 0;
        posterior.each(
            &world,
            |row| !is_known(row),
            |row, mean, variance| {
                let cross: Vec<f64> = known.iter().map(|&other| dense(row, other)).collect();
                let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
                let expected = dense(row, row) - dot(&cross, &factor.solve(&cross));
                assert!((mean - dot(&cross, &weights)).abs() < 1e-9);
                assert!((variance - expected).abs() < 1e-9, "{variance} {expected}");
                n += 1;
            },
        );
        assert!(20 < n);
    }
}
