//! Two campaigns: what changed between them.

/// Changes that are searched at most.
pub const MOST_CHANGES: usize = 6;
/// Effects in both campaigns that are fitted in a round beside differences, the most promising ones: a limit of time.
pub const MOST_IN_BOTH: usize = 4;
/// An effect in both campaigns is fitted if it promises at least this share of what the best difference does.
pub const IN_BOTH_SHARE: f64 = 0.3;
/// Two explanations are distinguished if one predicts held-out rows better at this p-value.
pub const DISTINGUISHED_LEVEL: f64 = 0.05;
/// Least rise of the log likelihood that a difference promises, to be tested (nats).
pub const DIFFERENCE_NATS: f64 = 8.0;
/// A difference is tested if it promises at least this share of what the best one does.
pub const DIFFERENCE_SHARE: f64 = 0.3;
/// Differences that are tested, the most promising ones: a limit of time.
pub const MOST_TESTED_DIFFERENCES: usize = 40;
/// Differences that are fitted, the most promising ones: a limit of time.
pub const MOST_FITTED_DIFFERENCES: usize = 8;
/// Those among them, at most, for which the score test is not significant.
pub const MOST_INSIGNIFICANT_DIFFERENCES: usize = 3;
/// A parameter is reported as unchanged if the margin of its difference is at most this share of its size.
pub const UNCHANGED_SHARE: f64 = 0.25;
/// Below this p-value of a change of the error, the verdict is not `nothing-changed`.
pub const DOUBTFUL_LEVEL: f64 = 0.05;
/// Fewest blocks of each campaign for a test of a change of the error.
pub const FEWEST_CHANGE_BLOCKS: usize = 10;
/// Campaign B was at new places if more than this share of its rows has no row of A in its block of places.
pub const NEW_PLACES_SHARE: f64 = 0.02;
/// Share of the rows of a campaign beyond each end of what counts as its range of a covariate: stray values are no range.
pub const RANGE_TAIL: f64 = 0.01;
/// Rows are compared within the range of a covariate that both campaigns share if it has at least this share of the rows of each. Of
/// less, the covariate is said to be another in the two campaigns.
pub const SHARED_RANGE: f64 = 0.5;
/// Two ranges of a covariate are alike if their common part has at least this share of the rows of each: nothing is left out for it.
pub const LIKE_RANGES: f64 = 0.9;
/// A change is fitted in A, too, if rows of B ask for less than this share of what rows of A do. Chosen: what a fit to both shares out is
/// as much in one as in the other.
pub const OF_A_SHARE: f64 = 0.5;
