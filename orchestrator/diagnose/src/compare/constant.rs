//! The constant by which readings of links lie off the model, alike on all rows.
//!
//! Where a model is far off by a constant, errors about the mean reading of received frames depend on whatever reception depends
//! on: distances, heights, receivers. Covariates are therefore ranked by the errors beside that constant.

use super::comparison::Offset;
use crate::ladder::Search;
use proto::effect::CONSTANT;
use study::links::LinkStudy;
use study::links::predict::LinkResiduals;
use study::{COMMON, Study as _};

/// The model with a constant fitted.
pub(super) struct Constant {
    /// The constant itself, if it is significant.
    pub(super) offset_db: Option<Offset>,
    /// Readings less predictions (dB), beside the constant.
    pub(super) deviation: Vec<f64>,
    /// Surprise of reception, beside the constant.
    pub(super) surprise: Vec<f64>,
}

/// Fits the constant. None where nothing was read, or no effect of the catalogue is a constant.
pub(super) fn found(study: &LinkStudy, search: &Search<'_, LinkStudy>) -> Option<Constant> {
    let is_constant = |candidate: &study::Candidate| {
        candidate.linear_in == Some(CONSTANT) && candidate.untestable.is_none()
    };
    let term = study.candidates().find(is_constant)?;
    let parent = search.full_fit(&[], COMMON, None);
    let fit = search.full_fit(&[term], COMMON, Some(&parent));
    let LinkResiduals { deviation, surprise, .. } = study.residuals(&fit);
    let (estimates, _) = study.estimates(&fit, term);
    let offset_db = estimates.first().and_then(|it| Offset::significant(it.value, it.low, it.high));
    Some(Constant { offset_db, deviation, surprise })
}
