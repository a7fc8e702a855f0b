//! The log likelihood of rows near a fit: by how much each row wants its predicted mean moved, and what columns would move it.
//!
//! A search for effects that act on one robot, one node or in one part of the time asks many questions of one fit. Each is answered
//! from the slopes of the rows' log likelihoods (efficient scores), without another fit.

use proto::effect::Parameter;

/// By how much something moves the predicted mean of each row, part by part: of links the level (dB); of robots where a window ends,
/// along, across and above the predicted motion (m). Of bodies that turn the third part is the heading (rad).
pub type Column = Vec<[f64; 3]>;

/// What an effect moves at one of the places where a search for it starts.
#[derive(Clone, Debug)]
pub struct Signature {
    /// The column, by the amplitude that the effect has there.
    pub column: Column,
    /// The number of the effect that makes that amplitude.
    pub size: SignatureSize,
    /// Which of the effect's signatures differ by their sizes only: those of one number.
    pub shape: usize,
}

/// Which number of an effect makes the amplitude of a signature.
#[derive(Clone, Copy, Debug)]
pub enum SignatureSize {
    /// A parameter, by this distance from the value at which the effect does nothing.
    By(Parameter, f64),
    /// A parameter that has no such value, such as a limit: at this value.
    At(Parameter, f64),
    /// Several numbers, or none.
    Unknown,
}

/// A column on some rows only.
#[must_use]
pub fn on_rows(column: &Column, rows: &[u32]) -> Column {
    let mut limited = vec![[0.0; 3]; column.len()];
    for &row in rows {
        limited[row as usize] = column[row as usize];
    }
    limited
}

/// Slopes of the log likelihood of each row at a fit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linearised {
    /// Derivative of a row's log likelihood by the mean of each part.
    pub slopes: Column,
    /// Information of a row about the mean of each part: minus the second derivative.
    pub weights: Column,
    /// What the parameters that were estimated move, by unit of each.
    pub estimated: Vec<Column>,
    /// Measured less predicted; NaN where nothing was measured, and of headings.
    pub errors: Column,
    /// Cosine and sine of the direction along which the first part of each row lies, from the east; empty where parts have none.
    pub directions: Vec<[f64; 2]>,
}

impl Linearised {
    /// The same where some rows alone tell anything.
    #[must_use]
    pub fn of_rows(&self, counts: &[bool]) -> Self {
        let of = |values: &Column| -> Column {
            let rows = values.iter().zip(counts);
            rows.map(|(value, counts)| if *counts { *value } else { [0.0; 3] }).collect()
        };
        Self { slopes: of(&self.slopes), weights: of(&self.weights), ..self.clone() }
    }

    /// The same with the errors themselves for slopes. A likelihood with heavy tails passes over rows that are far off; where these are all
    /// of one robot, they are no outliers.
    #[must_use]
    pub fn plain(&self) -> Self {
        let known = || self.errors.iter().flatten().filter(|error| error.is_finite());
        let squares: f64 = known().map(|error| error * error).sum();
        let weight = known().count() as f64 / squares.max(f64::MIN_POSITIVE);
        let of = |value: fn(f64) -> f64| {
            let scaled = |error: f64| if error.is_finite() { weight * value(error) } else { 0.0 };
            self.errors.iter().map(|errors| errors.map(scaled)).collect()
        };
        let (slopes, weights) = (of(|error| error), of(|_| 1.0));
        Self { slopes, weights, ..self.clone() }
    }
}

/// A constant that every row may be off by.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// What is off, in words: `readings are off`, `robots are off to the left`.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What one unit moves.
    pub column: Column,
}

/// Rows that have something in common: those of one robot, of one sender.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Which one: its number.
    pub id: u32,
    /// Its rows.
    pub rows: Vec<u32>,
}

/// A way to divide rows into groups.
#[derive(Clone, Debug, PartialEq)]
pub struct Partition {
    /// What a group is, in words: `robot`, `sender`, `campaign`.
    pub of: &'static str,
    /// The key of a table `only` that limits an effect to a group; none where there is none.
    pub key: Option<&'static str>,
    /// The groups, by their numbers.
    pub groups: Vec<Group>,
}

/// Which rows may depend on each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dependence {
    /// The time of each row (s); NaN where it is unknown.
    pub times_s: Vec<f64>,
    /// The series to which each row belongs, within which errors may be correlated in time: a robot's track, a campaign.
    pub series: Vec<u32>,
    /// The campaign of each row, by number from 0: what happens at one time of it may concern all its series.
    pub campaigns: Vec<u32>,
    /// Length of the shortest blocks of time (s).
    pub shortest_s: f64,
    /// The two nodes of each row, where rows are of links.
    pub nodes: Option<Vec<[u32; 2]>>,
    /// The replicate of each row, where a few of these take the place of blocks of time and of nodes: flights of a campaign. They are
    /// independent by design.
    pub replicates: Option<Vec<u32>>,
}

/// Keys as numbers from 0, in the order in which the keys sort.
pub(crate) fn numbered(keys: impl Iterator<Item = u32>) -> Vec<u32> {
    let keys: Vec<u32> = keys.collect();
    let mut sorted = keys.clone();
    sorted.sort_unstable();
    sorted.dedup();
    keys.iter().map(|key| sorted.binary_search(key).unwrap_or_default() as u32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_slopes_are_errors_over_their_mean_square() {
        let rows = Linearised {
            slopes: vec![[0.0; 3]; 3],
            weights: vec![[0.0; 3]; 3],
            estimated: Vec::new(),
            errors: vec![[3.0, f64::NAN, f64::NAN], [f64::NAN; 3], [-1.0, f64::NAN, f64::NAN]],
            directions: Vec::new(),
        };
        // The mean square is 5.
        let plain = rows.plain();
        let of = |parts: &Column| parts.iter().flatten().copied().collect::<Vec<f64>>();
        let expected = [0.6, 0.0, 0.0, 0.0, 0.0, 0.0, -0.2, 0.0, 0.0];
        for (slope, expected) in of(&plain.slopes).into_iter().zip(expected) {
            assert!((slope - expected).abs() < 1e-12, "{slope}");
        }
        assert_eq!(of(&plain.weights), [0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0]);
    }
}
