//! What a term adds to the mean level of every row, as a sum of columns times parameters: computed once.
//!
//! Most effects are such sums exactly. Others are near a point of interest, which is enough to tell whether a further term
//! is worth a fit.

use super::active::ActiveEffect;
use super::{TermSpec, TermState};
use crate::TermId;
use crate::links::rows::ModelledLinks;
use physics::effect::Effect;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Columns of a term: it adds `offset + Σ column · value` to the level of each row (dB).
#[derive(Clone, Debug, PartialEq)]
pub struct Basis {
    offset: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

impl Basis {
    /// Contribution of the term to a row's mean power (dB), at these values of its parameters.
    #[must_use]
    pub fn contribution(&self, values: &[f64], row: usize) -> f64 {
        self.columns
            .iter()
            .zip(values)
            .fold(self.offset[row], |sum, (column, value)| sum + column[row] * value)
    }

    /// Derivatives over a parameter, by row.
    #[must_use]
    pub fn column(&self, parameter: usize) -> &[f64] {
        &self.columns[parameter]
    }
}

/// Two ways of computing a sum agree to this.
const ROUNDING: f64 = 1e-8;
/// How many rows are looked at before all are.
const SAMPLE: usize = 64;

/// What an effect adds to rows; none where it changes more than the mean.
fn means(rows: &ModelledLinks, effect: &dyn Effect, which: &[usize]) -> Option<Vec<f64>> {
    which
        .iter()
        .map(|&row| {
            let added = rows.contribution(effect, row);
            (added.shift_db == 0.0 && added.ln_survival == 0.0).then_some(added.power_db)
        })
        .collect()
}

fn added(
    rows: &ModelledLinks,
    spec: &TermSpec,
    state: &TermState,
    which: &[usize],
) -> Option<Vec<f64>> {
    let effect = ActiveEffect::new(state.build(spec)?, rows);
    effect.is_plain().then(|| means(rows, effect.get(), which))?
}

/// Columns by differences of `share` of each parameter's small step.
fn columns(
    rows: &ModelledLinks,
    spec: &TermSpec,
    state: &TermState,
    which: &[usize],
    share: f64,
) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let levels = added(rows, spec, state, which)?;
    let mut all = Vec::new();
    for (k, parameter) in spec.parameters().iter().enumerate() {
        let mut displaced = state.clone();
        let mut step = share * parameter.step;
        if parameter.max < state.values[k] + step {
            step = -step;
        }
        displaced.values[k] += step;
        let displaced_levels = added(rows, spec, &displaced, which)?;
        all.push(levels.iter().zip(&displaced_levels).map(|(a, b)| (b - a) / step).collect());
    }
    let offset = (0..which.len())
        .map(|row| {
            levels[row]
                - all
                    .iter()
                    .zip(&state.values)
                    .map(|(c, v): (&Vec<f64>, _)| c[row] * v)
                    .sum::<f64>()
        })
        .collect();
    Some((offset, all))
}

/// The columns of an effect that is a sum of columns whatever its values; none where it is not.
fn exact(
    rows: &ModelledLinks,
    spec: &TermSpec,
    state: &TermState,
    which: &[usize],
) -> Option<Basis> {
    let (offset, columns) = columns(rows, spec, state, which, 1.0)?;
    let basis = Basis { offset, columns };
    for direction in [-1.0, 1.0, 0.0] {
        let mut displaced = state.clone();
        for (k, (value, parameter)) in
            displaced.values.iter_mut().zip(spec.parameters()).enumerate()
        {
            // To both ends of the ranges, and a little to alternate sides.
            let end = if direction < 0.0 { parameter.min } else { parameter.max };
            let side = if k % 2 == 0 { 2.0 } else { -2.0 };
            *value = if direction == 0.0 || !end.is_finite() {
                (*value + side * parameter.step).clamp(parameter.min, parameter.max)
            } else {
                end
            };
        }
        let displaced_levels = added(rows, spec, &displaced, which)?;
        let differs = displaced_levels.iter().enumerate().any(|(row, level)| {
            let sum = basis.contribution(&displaced.values, row);
            ROUNDING * (1.0 + level.abs()) < (sum - level).abs()
        });
        if differs {
            return None;
        }
    }
    Some(basis)
}

/// Bases of terms, each computed when it is first asked for.
#[derive(Debug, Default)]
pub struct Bases {
    exact: BasisCache,
    tangents: BasisCache,
}

/// By term and state: none where the term is no sum of columns.
type BasisCache = Mutex<BTreeMap<(TermId, String), Option<Arc<Basis>>>>;

impl Bases {
    /// The columns of a term in a state, whatever its values; none where it is no sum of columns. `keep`: for the next who
    /// asks.
    pub fn exact(
        &self,
        rows: &ModelledLinks,
        term: TermId,
        spec: &TermSpec,
        state: &TermState,
        keep: bool,
    ) -> Option<Arc<Basis>> {
        if !is_fitted_by_values(spec) {
            return None;
        }
        let compute = || {
            let step = (rows.len() / SAMPLE).max(1);
            let some: Vec<usize> = (0..rows.len()).step_by(step).collect();
            exact(rows, spec, state, &some)?;
            let all: Vec<usize> = (0..rows.len()).collect();
            exact(rows, spec, state, &all).map(Arc::new)
        };
        if !keep {
            return compute();
        }
        looked_up(&self.exact, (term, state.table.to_string()), compute)
    }

    /// The columns of a term near its values; none where it changes more than means.
    pub fn tangent(
        &self,
        rows: &ModelledLinks,
        term: TermId,
        spec: &TermSpec,
        state: &TermState,
    ) -> Option<Arc<Basis>> {
        if !is_fitted_by_values(spec) {
            return None;
        }
        looked_up(&self.tangents, (term, state.keys(spec).to_string()), || {
            let all: Vec<usize> = (0..rows.len()).collect();
            let (offset, columns) = columns(rows, spec, state, &all, 1e-3)?;
            Some(Arc::new(Basis { offset, columns }))
        })
    }
}

/// Whether a term is an effect whose parameters a fit sets.
fn is_fitted_by_values(spec: &TermSpec) -> bool {
    matches!(spec, TermSpec::Effect(_) | TermSpec::Limited(..) | TermSpec::Formula(..))
}

fn looked_up(
    known: &BasisCache,
    key: (TermId, String),
    compute: impl FnOnce() -> Option<Arc<Basis>>,
) -> Option<Arc<Basis>> {
    let look = || known.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(basis) = look().get(&key) {
        return basis.clone();
    }
    // Computed without the lock: two may do so at once, with the same result.
    let basis = compute();
    look().insert(key, basis.clone());
    basis
}
