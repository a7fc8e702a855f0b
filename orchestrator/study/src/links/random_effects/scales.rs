//! Over what the random levels of a fit change, and the cells of rows that share one.

use super::cells::{self, FINEST_M};
use super::{RowCells, Scales};
use crate::links::LinkStudy;
use crate::links::terms::{TermSpec, TermState};
use crate::thresholds::DEFAULT_DECORRELATION_M;
use proto::effect::Level;
use std::sync::{Arc, PoisonError};

/// The key of the time over which a level drifts.
pub(in crate::links) const CORRELATION_S: &str = "correlation_s";

impl LinkStudy {
    /// Lengths over which shadowing may change (m).
    pub(in crate::links) fn lengths(&self) -> impl Iterator<Item = f64> {
        self.lengths_m.iter().copied().filter(|length| FINEST_M < *length)
    }

    /// The cells of rows that share random levels.
    pub(in crate::links) fn cells(&self, scales: Scales) -> Arc<RowCells> {
        let apart = |length: &f64| libm::log(length / scales.decorrelation_m).abs();
        let nearest = self.lengths_m.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
        let nearest = Scales {
            decorrelation_m: nearest.copied().unwrap_or(DEFAULT_DECORRELATION_M),
            ..scales
        };
        let mut known = self.cells.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, cells)) = known.iter().find(|(scales, _)| *scales == nearest) {
            return Arc::clone(cells);
        }
        let cells = Arc::new(cells::cells_of(&self.rows, nearest));
        known.push((nearest, Arc::clone(&cells)));
        cells
    }

    /// Over what random levels change, in the states of a fit.
    pub(in crate::links) fn scales(
        &self,
        specs: &[&TermSpec],
        states: &[TermState],
        level: Level,
    ) -> Scales {
        let number = |wanted: fn(&TermSpec) -> bool, key: &str| {
            let of_term = specs.iter().zip(states).find(move |(spec, _)| wanted(spec))?.1;
            of_term.table.get(key).and_then(toml::Value::as_float)
        };
        let has_fading = specs.iter().any(|spec| matches!(spec, TermSpec::Multipath(_)));
        let fades = has_fading && level != Level::Place;
        let decorrelation_m =
            number(|spec| matches!(spec, TermSpec::Shadowing(_)), "decorrelation_m")
                .unwrap_or(if fades { FINEST_M } else { DEFAULT_DECORRELATION_M });
        let scales = Scales {
            decorrelation_m,
            drift_s: number(|spec| matches!(spec, TermSpec::Drift(_)), CORRELATION_S),
            link_drift_s: number(|spec| matches!(spec, TermSpec::LinkDrift(_)), CORRELATION_S),
        };
        scales.configured(&self.rows)
    }
}
