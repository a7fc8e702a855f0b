use super::*;
use proto::rng::{Draws, Purpose};
use study::thresholds::FEWEST_CLUSTERS;

/// Rows of some series in turn, each with noise of variance 1.
struct Made {
    rows: Linearised,
    dependence: Dependence,
}

fn column(n: usize, value: impl Fn(usize) -> f64) -> Column {
    (0..n).map(|row| [value(row), 0.0, 0.0]).collect()
}

impl Made {
    /// `n_series` series of `n_each` rows, a second apart, with what `left` says.
    fn new(n_series: usize, n_each: usize, left: impl Fn(usize) -> f64) -> Self {
        let n = n_series * n_each;
        Self {
            rows: Linearised {
                slopes: column(n, &left),
                weights: column(n, |_| 1.0),
                estimated: Vec::new(),
                errors: column(n, &left),
                directions: Vec::new(),
            },
            dependence: Dependence {
                times_s: (0..n).map(|row| (row / n_series) as f64).collect(),
                series: (0..n).map(|row| (row % n_series) as u32).collect(),
                campaigns: vec![0; n],
                shortest_s: 2.0,
                nodes: None,
                replicates: None,
            },
        }
    }

    fn test(&self, column: &Column, beside: &[&Column]) -> Option<ScoreTest> {
        ScoreTests::new(&self.rows, &self.dependence).test(column, beside)
    }
}

fn normal(seed: u64, row: usize) -> f64 {
    Draws::new(seed, Purpose::Resample).normal(row as u64, 0, 0)
}

#[test]
fn an_amplitude_is_found_with_the_error_of_independent_rows() {
    let n = 4000;
    let x = column(n, |row| normal(2, row));
    let made = Made::new(4, 1000, |row| 0.1 * x[row][0] + normal(1, row));
    let test = made.test(&x, &[]).unwrap();
    assert!((test.amplitude - 0.1).abs() < 4.0 / f64::sqrt(n as f64), "{test:?}");
    let expected = 1.0 / f64::sqrt(n as f64);
    assert!((test.standard_error / expected - 1.0).abs() < 0.15, "{test:?}");
    assert!(test.p_value < 1e-6 && 15.0 < test.rise, "{test:?}");
    // Significantly more than a twentieth, not than an eighth.
    assert!(test.p_value_beyond(0.05) < 0.01 && 0.05 < test.p_value_beyond(0.125), "{test:?}");
    assert!((0.1..0.15).contains(&test.upper_bound(0.1)), "{test:?}");
}

#[test]
fn what_was_estimated_or_stands_beside_is_not_told_again() {
    let x = column(2000, |row| (row % 7) as f64);
    let mut made = Made::new(4, 500, |row| (row % 7) as f64 + normal(1, row));
    let other = column(2000, |row| 3.0 * (row % 7) as f64);
    assert!(made.test(&x, &[]).unwrap().p_value < 1e-6);
    assert_eq!(made.test(&x, &[&other]), None);
    made.rows.estimated = vec![other];
    assert_eq!(made.test(&x, &[]), None);
}

#[test]
fn the_null_is_rejected_as_often_as_stated_with_white_and_with_correlated_noise() {
    for persistence in [0.0, 0.9] {
        let n_found = (0..400)
            .filter(|&seed| {
                // Every series has a noise of its own that lasts for ten rows.
                let mut noise = vec![0.0; 2000];
                for row in 0..2000 {
                    let before = if row < 4 { 0.0 } else { noise[row - 4] };
                    noise[row] = persistence * before + normal(seed, row);
                }
                let made = Made::new(4, 500, |row| noise[row]);
                let slow = column(2000, |row| libm::sin(row as f64 / 800.0));
                made.test(&slow, &[]).is_some_and(|test| test.p_value < 0.05)
            })
            .count();
        assert!((4..=36).contains(&n_found), "{persistence}: {n_found} of 400");
    }
}

#[test]
fn what_lasts_for_the_whole_campaign_cannot_be_told() {
    let wave = |row: usize| libm::sin((row / 4) as f64 / 60.0);
    let made = Made::new(4, 500, |row| wave(row) + 0.1 * normal(1, row));
    assert_eq!(made.test(&column(2000, |row| (row / 4) as f64), &[]), None);
}

#[test]
fn links_that_share_nodes_are_not_independent() {
    // 12 nodes, every pair 20 times; the offset of a node is in all its links.
    let mut ends = Vec::new();
    for _ in 0..20 {
        for a in 0..12_u32 {
            ends.extend((a + 1..12).map(|b| [a, b]));
        }
    }
    let n = ends.len();
    let n_found = |offset: f64| {
        (0..200)
            .filter(|&seed| {
                let off = |node: u32| offset * normal(seed, 100_000 + node as usize);
                let mut made = Made::new(1, n, |row| {
                    off(ends[row][0]) + off(ends[row][1]) + normal(seed, row)
                });
                made.dependence.nodes = Some(ends.clone());
                let level = column(n, |_| 1.0);
                made.test(&level, &[]).is_some_and(|test| test.p_value < 0.05)
            })
            .count()
    };
    assert!(n_found(2.0) <= 24, "{} of 200", n_found(2.0));
    assert!(n_found(0.0) <= 20, "{} of 200", n_found(0.0));
}

#[test]
fn a_few_clusters_tell_nothing() {
    let of = |n_each: usize| {
        let made = Made::new(1, n_each, |row| 0.5 + normal(1, row));
        made.test(&column(n_each, |_| 1.0), &[])
    };
    assert!(of(2 * FEWEST_CLUSTERS + 2).is_some());
    assert_eq!(of(2 * FEWEST_CLUSTERS - 4), None);
}

/// The p-value of a level of flights of 30 rows, of which each has a level of its own (standard deviation 1) beside this one.
fn p_of_flights(seed: u64, n_flights: usize, level: f64) -> Option<f64> {
    let n = 30 * n_flights;
    let own = |row: usize| normal(seed, 100_000 + row / 30);
    let mut made = Made::new(1, n, |row| level + own(row) + normal(seed, row));
    made.dependence.replicates = Some((0..n).map(|row| (row / 30) as u32).collect());
    Some(made.test(&column(n, |_| 1.0), &[])?.p_value)
}

#[test]
fn a_few_flights_are_judged_by_what_they_differ_by() {
    for n_flights in [4, 8, 15] {
        let found = |seed: &u64| p_of_flights(*seed, n_flights, 0.0).unwrap() < 0.05;
        let n_found = (1..=400).filter(found).count();
        // 5 % of 400 are 20, with a standard deviation of 4.4.
        assert!((8..=33).contains(&n_found), "{n_found} of 400 with {n_flights} flights");
    }
    // The signs of four flights alone would leave 12.5 %.
    assert!(p_of_flights(1, 4, 30.0).unwrap() < 0.001);
    assert_eq!(p_of_flights(1, 3, 30.0), None);
}

#[test]
fn what_one_flight_alone_shows_is_not_tested() {
    let n = 240;
    let mut made = Made::new(1, n, |row| normal(1, row));
    made.dependence.replicates = Some((0..n).map(|row| (row / 30) as u32).collect());
    let of_one = column(n, |row| if row < 30 { 1.0 } else { 0.0 });
    assert_eq!(made.test(&of_one, &[]), None);
}

#[test]
fn what_shows_in_few_rows_of_many_series_is_found() {
    // Blocks of single series are many and most of them say nothing; blocks across series are few. The skewness of one is not that of the
    // other.
    let x = column(40 * 200, |row| if row % 40 == 7 { 4.0 } else { 0.2 * normal(5, row).abs() });
    let made = Made::new(40, 200, |row| 0.5 * x[row][0] + normal(6, row));
    let test = made.test(&x, &[]).unwrap();
    assert!(test.p_value < 1e-6, "{test:?}");
}

#[test]
fn what_levels_of_nodes_move_has_nothing_left_beside_them() {
    let n = 600;
    let made = Made::new(1, n, |row| normal(1, row));
    let nodes: Vec<[u32; 2]> = (0..n as u32).map(|row| [row % 5, 5 + row % 4]).collect();
    let tests = ScoreTests::new(&made.rows, &made.dependence);
    let left = |value: &dyn Fn(usize) -> f64| tests.left_beside_nodes(&column(n, value), &nodes);
    let of_nodes = |row: usize| 3.0 * f64::from(nodes[row][0]) - f64::from(nodes[row][1]);
    assert_eq!(left(&of_nodes), Some(0.0));
    // Half of the variance is the nodes' own.
    let scale = 5.0;
    let half = left(&|row| of_nodes(row) + scale * normal(2, row)).unwrap();
    let of_nodes_variance = 9.0 * 2.0 + 1.25;
    let expected = scale * scale / (scale * scale + of_nodes_variance);
    assert!((half - expected).abs() < 0.05, "{half} {expected}");
    assert_eq!(left(&|_| 1.0), None);
}
