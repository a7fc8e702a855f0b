//! Clusters of rows that may depend on each other, and the variance of a sum over rows.

use std::collections::BTreeMap;
use study::linear::Dependence;
use study::thresholds::{
    COUNTED_INFORMATION, FEWEST_CLUSTERS, FEWEST_NODES, FEWEST_REPLICATES, MOST_IN_ONE_CLUSTER,
    NEIGHBOUR_CORRELATION,
};

/// How a sum over rows may vary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    pub(super) variance: f64,
    pub(super) freedom: f64,
    pub(super) n_clusters: usize,
    /// Skewness of the sum: that of the clusters over the root of their number, at most 1.
    pub(super) skewness: f64,
}

/// Which rows may depend on each other.
#[derive(Debug)]
pub(super) struct Clusters<'a> {
    dependence: &'a Dependence,
    has_times: bool,
    first_s: f64,
    length_s: f64,
    n_series: usize,
    n_campaigns: usize,
    /// Pairs of nodes by row, and the nodes of each pair.
    pairs: Option<(Vec<u32>, Vec<[u32; 2]>)>,
}

/// Sums over clusters: of what varies, and the shares of the information.
struct Sums {
    values: Vec<f64>,
    informations: Vec<f64>,
    /// How neighbours are correlated.
    correlation: f64,
}

impl Sums {
    fn new(n: usize) -> Self {
        Self { values: vec![0.0; n], informations: vec![0.0; n], correlation: 0.0 }
    }

    fn add(&mut self, cluster: usize, value: f64, information: f64) {
        self.values[cluster] += value;
        self.informations[cluster] += information;
    }
}

impl<'a> Clusters<'a> {
    pub(super) fn new(dependence: &'a Dependence) -> Self {
        let Dependence { times_s, series, campaigns, shortest_s, nodes, .. } = dependence;
        let count = |numbers: &[u32]| numbers.iter().max().map_or(0, |&last| last as usize + 1);
        let first_s = times_s.iter().copied().fold(f64::INFINITY, f64::min);
        let last_s = times_s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let has_times = times_s.iter().all(|time_s| time_s.is_finite()) && 0.0 < *shortest_s;
        let pairs = nodes.as_ref().map(|nodes| {
            let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
            let mut all: Vec<[u32; 2]> = nodes.iter().copied().map(sorted).collect();
            all.sort_unstable();
            all.dedup();
            let number =
                |&ends: &[u32; 2]| all.binary_search(&sorted(ends)).unwrap_or_default() as u32;
            (nodes.iter().map(number).collect(), all)
        });
        Self {
            dependence,
            has_times,
            first_s,
            length_s: last_s - first_s,
            n_series: count(series),
            n_campaigns: count(campaigns),
            pairs,
        }
    }

    /// How the sum of scores may vary, by what their step left of them. None where there are too few clusters.
    pub(super) fn spread(&self, left: &[f64], informations: &[f64]) -> Option<Spread> {
        if let Some(of_row) = &self.dependence.replicates {
            return of_replicates(of_row, left, informations);
        }
        let mut spreads = Vec::new();
        let mut in_pairs_and_time = None;
        if self.has_times {
            let Dependence { series, campaigns, .. } = self.dependence;
            let (across, length_s) =
                self.in_blocks((campaigns, self.n_campaigns), left, informations)?;
            if self.pairs.is_none() {
                let (within, _) = self.in_blocks((series, self.n_series), left, informations)?;
                spreads.push(of_sums(&within, FEWEST_CLUSTERS)?);
            }
            if 1 < self.n_series || self.pairs.is_some() {
                spreads.push(of_sums(&across, FEWEST_CLUSTERS)?);
            }
            in_pairs_and_time = Some(length_s);
        }
        if self.pairs.is_some() {
            let by_node = self.by_node(left, informations)?;
            let both = in_pairs_and_time
                .map_or(0.0, |length_s| self.variance_both(left, informations, length_s));
            let time = spreads.first().map_or(0.0, |time| time.variance);
            let variance = (by_node.variance + time - both).max(by_node.variance).max(time);
            spreads.push(Spread { variance, ..by_node });
        }
        let widest = spreads.iter().map(|spread| spread.variance).fold(0.0, f64::max);
        let least =
            |value: fn(&Spread) -> f64| spreads.iter().map(value).fold(f64::INFINITY, f64::min);
        let first = spreads.iter().max_by(|a, b| a.variance.total_cmp(&b.variance))?;
        (0.0 < widest).then_some(Spread {
            variance: widest,
            freedom: least(|spread| spread.freedom),
            n_clusters: spreads.iter().map(|spread| spread.n_clusters).min()?,
            skewness: first.skewness,
        })
    }

    /// Sums of several scores over blocks of time, in series and across those of a campaign, so long that neighbours are not correlated.
    /// None where there are too few blocks.
    pub(super) fn in_time(&self, left: &[Vec<f64>]) -> Option<Vec<Vec<Vec<f64>>>> {
        if !self.has_times || self.dependence.replicates.is_some() {
            return None;
        }
        let series = self.pairs.is_none().then_some(&self.dependence.series);
        let dimensions = series.into_iter().chain([&self.dependence.campaigns]);
        dimensions.map(|of_row| self.vectors(left, of_row)).collect()
    }

    fn vectors(&self, left: &[Vec<f64>], of_row: &[u32]) -> Option<Vec<Vec<f64>>> {
        let found = self.lengths_s().find_map(|length_s| {
            let mut sums: BTreeMap<(u32, usize), Vec<f64>> = BTreeMap::new();
            for (row, number) in of_row.iter().enumerate() {
                let key = (*number, self.block(row, length_s));
                let sum = sums.entry(key).or_insert_with(|| vec![0.0; left.len()]);
                for (sum, left) in sum.iter_mut().zip(left) {
                    *sum += left[row];
                }
            }
            let (mut products, mut squares, mut n) = (0.0, 0.0, 0.0);
            for ((key, sum), (next, after)) in sums.iter().zip(sums.iter().skip(1)) {
                if key.0 == next.0 && key.1 + 1 == next.1 {
                    products += sum.iter().zip(after).map(|(a, b)| a * b).sum::<f64>();
                    squares += 0.5 * sum.iter().chain(after).map(|a| a * a).sum::<f64>();
                    n += left.len() as f64;
                }
            }
            let is_correlated = NEIGHBOUR_CORRELATION.max(2.0 / f64::sqrt(n)) < products / squares;
            (!is_correlated).then(|| sums.into_values().collect::<Vec<_>>())
        })?;
        (FEWEST_CLUSTERS.max(2 * left.len()) <= found.len()).then_some(found)
    }

    /// The block of time of a row where blocks are `length_s` long.
    fn block(&self, row: usize, length_s: f64) -> usize {
        ((self.dependence.times_s[row] - self.first_s) / length_s) as usize
    }

    /// Lengths of blocks that are tried (s): each twice as long as the one before.
    fn lengths_s(&self) -> impl Iterator<Item = f64> + '_ {
        let doubled = |length_s: &f64| Some(2.0 * length_s);
        std::iter::successors(Some(self.dependence.shortest_s), doubled).take_while(|length_s| {
            length_s * FEWEST_CLUSTERS as f64 <= 2.0 * self.length_s * self.n_series as f64
        })
    }

    /// Sums over blocks of time within each of `n` numbers of rows, so long that neighbours are not correlated; and their length (s).
    fn in_blocks(
        &self,
        (of_row, n): (&[u32], usize),
        left: &[f64],
        informations: &[f64],
    ) -> Option<(Sums, f64)> {
        self.lengths_s().find_map(|length_s| {
            let n_blocks = (self.length_s / length_s) as usize + 1;
            let mut sums = Sums::new(n_blocks * n);
            for (row, (value, information)) in left.iter().zip(informations).enumerate() {
                let first = of_row[row] as usize * n_blocks;
                sums.add(first + self.block(row, length_s), *value, *information);
            }
            let is_same = |a: usize, b: usize| a / n_blocks == b / n_blocks;
            sums.correlation = uncorrelated(&sums, is_same)?;
            Some((sums, length_s))
        })
    }

    /// By nodes: rows that share one may depend on each other.
    fn by_node(&self, left: &[f64], informations: &[f64]) -> Option<Spread> {
        let (pair_of_row, pairs) = self.pairs.as_ref()?;
        let mut of_pairs = Sums::new(pairs.len());
        for (row, (value, information)) in left.iter().zip(informations).enumerate() {
            of_pairs.add(pair_of_row[row] as usize, *value, *information);
        }
        let total: f64 = of_pairs.informations.iter().sum();
        let mut of_nodes: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
        let mut within = 0.0;
        for ((value, information), ends) in
            of_pairs.values.iter().zip(&of_pairs.informations).zip(pairs)
        {
            for end in ends {
                let sums = of_nodes.entry(*end).or_default();
                sums.0 += value;
                sums.1 += information;
            }
            within += value * value / (1.0 - information / total).max(MOST_IN_ONE_CLUSTER);
        }
        // Every row counts at both of its nodes.
        let touching: f64 = of_nodes
            .values()
            .map(|(value, information)| {
                value * value / (1.0 - 0.5 * information / total).max(MOST_IN_ONE_CLUSTER)
            })
            .sum();
        let mean = 2.0 * total / of_nodes.len() as f64;
        let n = of_nodes
            .values()
            .filter(|(_, information)| COUNTED_INFORMATION * mean < *information)
            .count();
        let squares: f64 = of_nodes.values().map(|(_, j)| j * j / (4.0 * total * total)).sum();
        let freedom = (1.0 / squares - 1.0).min(n as f64 - 1.0);
        let of_nodes: Vec<f64> = of_nodes.values().map(|(value, _)| *value).collect();
        (FEWEST_NODES <= n && 1.0 <= freedom).then_some(Spread {
            variance: (touching - within).max(within),
            freedom,
            n_clusters: n.max(FEWEST_CLUSTERS.min(pairs.len())),
            skewness: skewness_of_sum(&of_nodes),
        })
    }

    /// Variance of sums over pairs of nodes and blocks of time.
    fn variance_both(&self, left: &[f64], informations: &[f64], length_s: f64) -> f64 {
        let Some((pair_of_row, _)) = &self.pairs else { return 0.0 };
        let mut sums: BTreeMap<(u32, u32, usize), f64> = BTreeMap::new();
        for (row, value) in left.iter().enumerate().filter(|(row, _)| 0.0 < informations[*row]) {
            let key = (pair_of_row[row], self.dependence.campaigns[row], self.block(row, length_s));
            *sums.entry(key).or_default() += value;
        }
        sums.values().map(|sum| sum * sum).sum()
    }
}

/// How sums of clusters that follow each other are correlated; none where it is too much.
fn uncorrelated(sums: &Sums, is_same: impl Fn(usize, usize) -> bool) -> Option<f64> {
    let counts = counting(sums);
    let pairs = (1..sums.values.len())
        .filter(|&next| is_same(next - 1, next) && counts[next - 1] && counts[next]);
    let (mut products, mut n) = (0.0, 0.0);
    let (mut first, mut second) = (0.0, 0.0);
    for next in pairs {
        let (a, b) = (sums.values[next - 1], sums.values[next]);
        products += a * b;
        first += a * a;
        second += b * b;
        n += 1.0;
    }
    let correlation = products / (first * second).sqrt();
    if !correlation.is_finite() {
        return Some(0.0);
    }
    (correlation <= NEIGHBOUR_CORRELATION.max(2.0 / f64::sqrt(n))).then_some(correlation.max(0.0))
}

/// Which clusters carry information.
fn counting(sums: &Sums) -> Vec<bool> {
    let n = sums.informations.iter().filter(|j| 0.0 < **j).count() as f64;
    let mean = sums.informations.iter().sum::<f64>() / n;
    sums.informations.iter().map(|j| COUNTED_INFORMATION * mean < *j).collect()
}

/// How a sum over a few replicates varies. Their sums count as normal: the signs of so few bound a p-value far above what Student's t
/// says, and their skewness is mostly chance.
fn of_replicates(of_row: &[u32], left: &[f64], informations: &[f64]) -> Option<Spread> {
    let mut sums = Sums::new(of_row.iter().max().map_or(0, |&last| last as usize + 1));
    for ((replicate, value), information) in of_row.iter().zip(left).zip(informations) {
        sums.add(*replicate as usize, *value, *information);
    }
    let spread = of_sums(&sums, FEWEST_REPLICATES)?;
    Some(Spread { n_clusters: usize::MAX, skewness: 0.0, ..spread })
}

/// How a sum over independent clusters varies. None where there are fewer than `fewest`, or one decides alone.
fn of_sums(sums: &Sums, fewest: usize) -> Option<Spread> {
    let total: f64 = sums.informations.iter().sum();
    let counts = counting(sums);
    let n = counts.iter().filter(|counts| **counts).count();
    let most = sums.informations.iter().copied().fold(0.0, f64::max);
    if n < fewest || MOST_IN_ONE_CLUSTER * total < most {
        return None;
    }
    let both = || sums.values.iter().zip(&sums.informations);
    let values: Vec<f64> = both().map(|(v, j)| v / (1.0 - j / total).sqrt()).collect();
    let squares: f64 = sums.informations.iter().map(|j| j * j).sum();
    let counted: Vec<f64> =
        values.iter().zip(&counts).filter(|(_, counts)| **counts).map(|(v, _)| *v).collect();
    Some(Spread {
        variance: values.iter().map(|value| value * value).sum::<f64>()
            * (1.0 + 2.0 * sums.correlation),
        freedom: (total * total / squares - 1.0).max(1.0),
        n_clusters: n,
        skewness: skewness_of_sum(&counted),
    })
}

/// Skewness of the sum of independent values.
fn skewness_of_sum(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let moment = |power: i32| {
        values.iter().map(|v| numbers::power::integer_power(v - mean, power)).sum::<f64>() / n
    };
    let skewness = moment(3) / (moment(2) * moment(2).sqrt() * n.sqrt());
    if skewness.is_finite() { skewness } else { 0.0 }
}
