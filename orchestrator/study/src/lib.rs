//! Studies: measurements with a model of them, as the search for missing effects needs them.
//!
//! The search itself knows neither radio nor robots: it adds terms to a model, fits, and compares how
//! well data that were left out are predicted. A [`Study`] compares one file of measurements with one configuration.

pub mod choices;
pub mod defects;
pub mod folds;
pub mod formula;
pub mod knots;
mod limits;
pub mod linear;
pub mod links;
pub mod open;
pub mod robots;
mod stop;
pub mod symbolic;
mod term;
pub mod thresholds;
pub mod view;

pub use limits::{NotLimited, limited_name, span_s};
pub use stop::StopFlag;
pub use term::{PerTerm, TermId};

use defects::node_place::NodeLevel;
use folds::Blocks;
use linear::{Column, Dependence, Direction, Linearised, Partition, Signature, SignatureSize};
use links::predict::directions::DirectionsApart;
use links::rows::passes::Passes;
use proto::effect::{About, Level, Need, Parameter};
use serde::Serialize;
use symbolic::FittedFormula;

/// Before the covariate in the name of a curve of what is read …
pub const CURVE: &str = "curve:";
/// … and of one of the share of frames that are lost.
pub const LOSS_CURVE: &str = "loss-curve:";
/// Of those of either kind with many knots.
pub const FINE: &str = "fine-";

/// A term that may be missing from the model: an effect of the catalogue, or a smooth curve over a covariate.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// `two-ray-ground`, `curve:humidity_pct`, …
    pub name: String,
    /// What people should know of it; none for curves.
    pub about: Option<&'static About>,
    /// It spreads single frames, independently of each other, and moves no mean.
    pub is_spread: bool,
    /// Over what its covariate varies, which decides the blocks that are held out to judge it.
    pub level: Level,
    /// What an effect of the catalogue declares of the parameters that are estimated; empty for curves and formulas.
    pub parameters: &'static [Parameter],
    /// How many numbers a fit of it sets, places of a search included.
    pub n_parameters: usize,
    /// Names of the effects that are nested in it.
    pub generalises: Vec<String>,
    /// The covariate in which it is linear.
    pub linear_in: Option<&'static str>,
    /// A curve over a covariate that was not given, but follows from time and places.
    pub is_derived: bool,
    /// Why it cannot be tested on these data: `needs positive antenna heights`.
    pub untestable: Option<String>,
    /// To which rows it is limited, if it is: its table `only`.
    pub only: Option<toml::Table>,
    /// The effect of which this is another one, by number: it is tried where that is in the model.
    pub another_of: Option<TermId>,
    /// The curve without a constant part that this is, with one. It is not tried by itself, but stands in for that curve where
    /// it explains what an effect did that was accepted before.
    pub stands_in_for: Option<TermId>,
}

impl Candidate {
    /// What is declared of an estimated parameter; none of what a search finds beside, such as places.
    #[must_use]
    pub fn parameter(&self, estimate: &Estimate) -> Option<&'static Parameter> {
        self.parameters.iter().find(|parameter| parameter.key == estimate.name)
    }

    /// The covariate of a curve.
    #[must_use]
    pub fn curve_over(&self) -> Option<&str> {
        let name = self.coarse();
        name.strip_prefix(CURVE).or_else(|| name.strip_prefix(LOSS_CURVE))
    }

    /// The name, of a curve with many knots that of the one with few.
    fn coarse(&self) -> &str {
        self.name.strip_prefix(FINE).unwrap_or(&self.name)
    }

    /// The name of the effect, without what limits it.
    #[must_use]
    pub fn effect(&self) -> &str {
        match &self.only {
            Some(only) => self.name.strip_suffix(&limits::suffix(only)).unwrap_or(&self.name),
            None => &self.name,
        }
    }

    /// Whether it is tried: it can be tested, and does not only stand in for another.
    #[must_use]
    pub fn is_tried(&self) -> bool {
        self.untestable.is_none() && self.stands_in_for.is_none()
    }

    /// Whether it is tried on top of these terms.
    #[must_use]
    pub fn is_tried_beside(&self, terms: &[TermId]) -> bool {
        self.is_tried() && self.another_of.is_none_or(|first| terms.contains(&first))
    }

    /// Whether it is an effect of a measured covariate that varies in time.
    #[must_use]
    pub fn follows_column_in_time(&self) -> bool {
        let needs = self.about.map_or(&[][..], |about| about.needs);
        self.level == Level::Time && needs.iter().any(|need| matches!(need, Need::Column(_)))
    }

    /// Whether it may act on some rows only: an effect of the catalogue, without limits, that moves means.
    #[must_use]
    pub fn may_be_limited(&self) -> bool {
        self.is_tried()
            && self.only.is_none()
            && self.about.is_some()
            && self.level != Level::Random
    }

    /// It is a curve of the share of frames that are lost, not of what is read.
    #[must_use]
    pub fn is_of_losses(&self) -> bool {
        self.coarse().starts_with(LOSS_CURVE)
    }
}

/// Held-out scores of one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowScore {
    /// Log predictive density or probability (nats).
    pub log: f64,
    /// Squared error (dB² or m²); NaN where nothing was read.
    pub squared_error: f64,
    /// Of links: square of the reading less the predicted mean level, whatever is received (dB²); NaN where nothing was read. The
    /// squared error, in contrast, is about the mean reading of frames that are received.
    pub plain_squared_error: f64,
    /// Of robots whose body turns: squared error of the predicted heading (rad²); NaN otherwise. The log density includes the heading, as far as that counts.
    pub heading_squared_error_rad2: f64,
    /// The same: log predictive density (nats) of the position alone.
    pub log_of_position: f64,
    /// Continuous ranked probability score (dB or m); NaN where nothing was read.
    pub crps: f64,
    /// Log loss of the prediction of reception (nats); NaN where it is unknown.
    pub reception_log_loss: f64,
}

/// A fitted parameter with its 90 % interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Key of the parameter in the configuration.
    pub name: String,
    /// The estimated value, in its unit.
    pub value: f64,
    /// Unit of the value and of both ends.
    pub unit: String,
    /// Lower end of the 90 % interval.
    pub low: f64,
    /// Upper end of the 90 % interval.
    pub high: f64,
    /// Whether the data say anything of it. If not, `value` is what a configuration needs, and no estimate.
    pub is_identifiable: bool,
}

impl Estimate {
    /// A number with its 90 % interval, from its lower to its upper end. The interval is widened to include the number, and an end that
    /// is NaN is the number itself.
    #[must_use]
    pub fn new(name: &str, unit: &str, value: f64, (low, high): (f64, f64)) -> Self {
        let (low, high) = (low.min(value), high.max(value));
        let (name, unit) = (name.to_owned(), unit.to_owned());
        Self { name, value, unit, low, high, is_identifiable: true }
    }

    /// The same where the data say nothing of it.
    #[must_use]
    pub fn not_identifiable(self) -> Self {
        Self { is_identifiable: false, ..self }
    }
}

/// The split on which candidates are ordered and rungs of the ladder are compared.
pub const COMMON: Level = Level::Time;

/// By how much the predictions of two models differ, and the covariates of the rows.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictionDifference {
    /// Absolute difference of the two predictions of each row.
    pub by_row: Vec<f64>,
    /// Its unit: `dB`, `points of delivery`, `m`.
    pub unit: &'static str,
    /// How much each row tells of it: the inverse of the variance of what is measured of it (1/unit²); 0 where nothing is.
    pub information: Vec<f64>,
    /// Covariates: a name, and a value per row.
    pub covariates: Vec<(String, Vec<f64>)>,
}

/// Residuals of all rows under a fit, for a search of structure over covariates.
#[derive(Clone, Debug, PartialEq)]
pub struct Residuals {
    /// Standardised residuals, a value per row; NaN where there is none. Each component has mean 0 and variance 1 where the model is
    /// right.
    pub components: Vec<Component>,
    /// Mean squared error of the rows (dB² or m²), where it is to be computed from the rows that were fitted; otherwise that of rows
    /// left out counts.
    pub mean_square: Option<f64>,
}

/// One component of residuals.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// A value per row.
    pub standardised: Vec<f64>,
    /// It is part of the error whose mean square the configured model is compared by; surprise of reception is not.
    pub is_of_error: bool,
}

/// Measurements compared with a configuration.
pub trait Study: Sync {
    /// A model fitted to some rows.
    type Fit: Clone + Send + Sync;

    /// What may be missing, in a fixed order.
    fn candidates(&self) -> &PerTerm<Candidate>;

    /// How many rows there are: frames, sums of frames, or windows of motion.
    fn n_rows(&self) -> usize;

    /// Whether fits are to stop. Those that are made from then on have not converged.
    fn is_stopped(&self) -> bool {
        false
    }

    /// Design effect: how many rows carry the information of one independent row; 1 where rows are independent.
    fn design_effect(&self) -> f64 {
        1.0
    }

    /// Rows that fits may see: all, but those that are only scored.
    fn fitted_rows(&self) -> Vec<u32> {
        self.blocks(COMMON).fitted()
    }

    /// Which rows are independent of which, where a covariate varies at this level.
    fn blocks(&self, level: Level) -> &Blocks;

    /// The level whose blocks are held out to judge a term: random effects are judged on blocks of time by default.
    fn judging_level(&self, level: Level) -> Level {
        if level == Level::Random { Level::Time } else { level }
    }

    /// Sender and receiver of each row, each of which has a level of its own, if a term is a random effect of such levels. None: it is
    /// something else.
    fn nodes_with_levels(&self, _term: TermId) -> Option<Vec<[u32; 2]>> {
        None
    }

    /// The same measurements with one node elsewhere than surveyed, and what is wrong then, as a clause: where another place explains
    /// so much of what a fit leaves beside a level of the node, random effects apart, that it is no chance by itself. None: no place does.
    fn resurveyed(&self, _fit: &Self::Fit, _level: NodeLevel) -> Option<(String, Self)>
    where
        Self: Sized,
    {
        None
    }

    /// Whether noise of another skew and other tails explains as much as a term that spreads single frames: by fits with it and without it.
    fn is_shape_of_noise(&self, _with: &Self::Fit, _without: &Self::Fit) -> bool {
        false
    }

    /// The standard deviation (m) of positions that is likeliest under a fit, where a covariate follows from positions and this noise is no
    /// chance by itself: a right model of noisy positions has errors over distance and strength (regression dilution). None: positions may
    /// be right.
    fn position_noise_m(&self, _fit: &Self::Fit, _covariate: &str) -> Option<f64> {
        None
    }

    /// Whether measured headings drift against the course that positions show.
    fn do_headings_drift(&self) -> bool {
        false
    }

    /// Whether the size of a term of a fit is nearly collinear with a number of another term.
    fn is_collinear(&self, _fit: &Self::Fit, _term: TermId) -> bool {
        false
    }

    /// Whether an effect begins at a time that is fitted.
    fn begins_in_time(&self, _term: TermId) -> bool {
        false
    }

    /// Which rows are at the beginning of a track, where motion depends on what was before. None: rows are no motion.
    fn beginnings(&self) -> Option<Vec<bool>> {
        None
    }

    /// Fits the configured model, its noise, and the terms (indices of candidates) together, to convergence.
    ///
    /// * `train`: the rows.
    /// * `level`: at which the fit will be judged. At [`Level::Place`] every model has random effects per link or
    ///   node, so that a constant of a link cannot pass for another effect.
    /// * `start`: a fit of fewer or other terms, from which the search may start.
    fn fit(
        &self,
        terms: &[TermId],
        train: &[u32],
        level: Level,
        start: Option<&Self::Fit>,
    ) -> Self::Fit;

    /// A quick fit to all rows of the last of `terms` on top of its parent: whether it is worth a fit. What the parent has is
    /// held or taken for straight lines. None where there is no quick way.
    fn screen(&self, _terms: &[TermId], _level: Level, _parent: &Self::Fit) -> Option<Self::Fit> {
        None
    }

    /// Absolute differences of the predictions of two fits, row by row; `None` where they cannot be computed.
    fn prediction_difference(
        &self,
        _one: &Self::Fit,
        _other: &Self::Fit,
    ) -> Option<PredictionDifference> {
        None
    }

    /// Covariates over which residuals may have structure: a name, and a value per row (NaN where unknown).
    fn scanned_covariates(&self) -> Vec<(String, Vec<f64>)>;

    /// The partitions into blocks under which structure must be significant; empty where there are too few blocks for a scan.
    fn scanned_blocks(&self) -> Vec<&Blocks>;

    /// Residuals of all rows under a fit.
    fn scanned_residuals(&self, fit: &Self::Fit) -> Residuals;

    /// A short formula of the covariate of an accepted curve, for the residuals of a fit without that curve. None where the term is no
    /// curve, or no formula fits.
    fn formula_of_curve(&self, term: TermId, fit_without: &Self::Fit) -> Option<FittedFormula>;

    /// A short formula of a covariate for the residuals of a fit.
    fn formula_of_residuals(&self, covariate: &str, fit: &Self::Fit) -> Option<FittedFormula>;

    /// A fit with a parameter of a term at another value, all others following; none where the term has no such parameter.
    fn with_parameter_held(
        &self,
        _fit: &Self::Fit,
        _term: TermId,
        _key: &str,
        _value: f64,
    ) -> Option<Self::Fit> {
        None
    }

    /// Slopes of the log likelihoods of all rows at a fit; none where they cannot be computed.
    fn linearised(&self, fit: &Self::Fit) -> Option<Linearised>;

    /// What an effect that may be added to a fit would move, at each of the places where a search for it starts: by the amplitude
    /// it has there. Empty where it does something else than move means.
    fn columns(&self, fit: &Self::Fit, term: TermId) -> Vec<Column>;

    /// The same columns, each with the number of the effect that makes its amplitude.
    fn signatures(&self, fit: &Self::Fit, term: TermId) -> Vec<Signature> {
        let columns = self.columns(fit, term).into_iter().enumerate();
        columns
            .map(|(shape, column)| Signature { column, size: SignatureSize::Unknown, shape })
            .collect()
    }

    /// Whether a search decides where, on which node or when an effect acts.
    fn is_searched_for(&self, _term: TermId) -> bool {
        false
    }

    /// What the numbers of a curve that may be added to a fit would move, by unit of each. Empty where it does something else than
    /// move means, and for effects.
    fn columns_of_curve(&self, fit: &Self::Fit, term: TermId) -> Vec<Column>;

    /// Constants that rows may be off by.
    fn directions(&self) -> Vec<Direction>;

    /// Ways to divide rows into groups.
    fn partitions(&self) -> Vec<Partition>;

    /// Which rows may depend on each other.
    fn dependence(&self) -> Dependence;

    /// Why measurements contradict a term of a fit: they show what it rules out. None: they do not.
    fn contradiction(&self, _fit: &Self::Fit, _term: TermId) -> Option<String> {
        None
    }

    /// Adds an effect that may be added to the model as one that is limited to some rows, and returns the number of the new
    /// candidate.
    ///
    /// * `term`: the number of the effect among the candidates.
    /// * `limits`: the table `only` of the effect.
    ///
    /// # Errors
    ///
    /// The limits are wrong, or the candidate is none that can be limited.
    fn add_limited(&mut self, term: TermId, limits: &toml::Table) -> Result<TermId, NotLimited>;

    /// Passes of a node through all bearings, where a term is judged by these: a few are replicates of the pattern of its antenna. None: it
    /// is judged by blocks of its level.
    fn passes(&self, _term: TermId) -> Option<&Passes> {
        None
    }

    /// The difference between both directions of the only pair of nodes that a fit leaves, where a term has levels of nodes and the
    /// difference is significant. Levels of two nodes have no spread, but this difference has a size.
    fn directions_apart(&self, _fit: &Self::Fit, _term: TermId) -> Option<DirectionsApart> {
        None
    }

    /// Whether a term is a random level that all rows share and that drifts in time. The log likelihood of a fit has it integrated out.
    fn is_drift(&self, _term: TermId) -> bool {
        false
    }

    /// Of a random level that rows share: the probability of as much agreement of these rows, in what a fit without it leaves, by
    /// chance. None for all else.
    fn agreement(&self, _fit: &Self::Fit, _term: TermId) -> Option<f64> {
        None
    }

    /// The span of time, as a table `only`, in which an effect whose place is sought promises much more than always, on top of a fit;
    /// with what it promises (nats).
    fn span_of_search(&self, _fit: &Self::Fit, _term: TermId) -> Option<(toml::Table, f64)> {
        None
    }

    /// Adds another of an effect of which several may act, and returns the number of the new candidate; none where that makes no sense.
    fn add_another(&mut self, _term: TermId) -> Option<TermId> {
        None
    }

    /// Log likelihood of the rows to which it was fitted (nats), its penalties included.
    fn log_likelihood(&self, fit: &Self::Fit) -> f64;

    /// Predicts rows that the fit has not seen.
    fn scores(&self, fit: &Self::Fit, test: &[u32]) -> Vec<RowScore>;

    /// Parameters of a term, with intervals, from a fit to all rows; and a warning where two of them are not identifiable.
    fn estimates(&self, fit: &Self::Fit, term: TermId) -> (Vec<Estimate>, Option<String>);

    /// The configuration of a term as fitted: the keys of its section, `kind` among them. None where it is not in the fit,
    /// or is no effect.
    fn settings(&self, fit: &Self::Fit, term: TermId) -> Option<toml::Table>;
}

/// Whether a value lies at an end of a parameter's range: nearer than a thousandth of the step that changes predictions a little. Where
/// the range is positive and spans two decades, a thousandth of the value counts instead.
#[must_use]
pub fn is_at_bound(parameter: &Parameter, value: f64) -> bool {
    let Parameter { min, max, step, .. } = *parameter;
    let spans_decades = 0.0 < min && 100.0 * min <= max;
    let near = 1e-3 * if spans_decades { value } else { step };
    value - min < near || max - value < near
}

/// Whether an interval from `low` to `high` is as wide as a range from `min` to `max`, so that the data say nothing of the parameter.
pub(crate) fn is_as_wide([low, high]: [f64; 2], [min, max]: [f64; 2]) -> bool {
    max - min <= high - low
}

/// What to mind of a parameter: the data say nothing of it, or it is at a bound of its range.
#[must_use]
pub(crate) fn caution(parameter: &Parameter, estimate: &Estimate) -> Option<String> {
    let Parameter { key, min, max, .. } = parameter;
    if !estimate.is_identifiable {
        Some(format!("{key} is not identifiable from these data"))
    } else if is_at_bound(parameter, estimate.value) {
        Some(format!("{key} is at the bound of its range, {min} to {max}"))
    } else {
        None
    }
}

/// Several cautions as one.
pub(crate) fn joined(cautions: Vec<String>) -> Option<String> {
    (!cautions.is_empty()).then(|| cautions.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMETER: Parameter = Parameter {
        key: "sd_db",
        unit: "dB",
        min: 0.0,
        max: 20.0,
        starts: &[1.0],
        step: 0.1,
        null: None,
        plausible: None,
    };

    #[test]
    fn an_interval_includes_its_value() {
        let ends = |value, interval| {
            let Estimate { low, high, .. } = Estimate::new("a", "m", value, interval);
            (low, high)
        };
        assert_eq!(ends(2.0, (1.0, 3.0)), (1.0, 3.0));
        assert_eq!(ends(310.0, (47.0, 156.0)), (47.0, 310.0));
        assert_eq!(ends(300.0, (337.44, 280.0)), (300.0, 300.0));
        assert_eq!(ends(2.0, (f64::NAN, f64::NAN)), (2.0, 2.0));
    }

    #[test]
    fn a_bound_of_a_range_that_spans_decades_is_judged_on_a_log_scale() {
        let limit = Parameter { min: 0.01, max: 1e6, step: 0.05, ..PARAMETER };
        let at_bound = |value| is_at_bound(&limit, value);
        assert!(!at_bound(0.34) && !at_bound(0.011) && !at_bound(9e5));
        assert!(at_bound(0.01) && at_bound(0.010_001) && at_bound(999_900.0) && at_bound(1e6));
    }

    #[test]
    fn a_parameter_at_a_bound_or_not_identifiable_is_cautioned_against() {
        let of = |value| caution(&PARAMETER, &Estimate::new("sd_db", "dB", value, (0.0, 1.0)));
        assert_eq!(of(1.0), None);
        assert_eq!(of(19.999), None);
        let at_bound = Some("sd_db is at the bound of its range, 0 to 20".to_owned());
        assert_eq!((of(0.0), of(20.0)), (at_bound.clone(), at_bound));
        let unknown = Estimate::new("sd_db", "dB", 20.0, (0.0, 20.0)).not_identifiable();
        let said = caution(&PARAMETER, &unknown);
        assert_eq!(said.as_deref(), Some("sd_db is not identifiable from these data"));
        assert_eq!(joined(Vec::new()), None);
        assert_eq!(joined(vec!["a".to_owned(), "b".to_owned()]).as_deref(), Some("a; b"));
    }
}
