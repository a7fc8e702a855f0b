//! Predictions of rows by fits that have not seen them.

use super::ladder::Search;
use rayon::prelude::*;
use study::view::{RowPredictions, Viewed};
use study::{COMMON, TermId};

/// Every row as predicted by a fit to the other folds.
pub(crate) fn predictions<S: Viewed>(
    study: &S,
    search: &Search<'_, S>,
    terms: &[TermId],
) -> RowPredictions {
    let start = search.full_fit(terms, COMMON, None);
    let blocks = study.blocks(COMMON);
    let parts: Vec<(Vec<u32>, RowPredictions)> = (0..blocks.n_folds())
        .into_par_iter()
        .map(|fold| {
            let (train, test) = blocks.split(fold);
            if train.is_empty() {
                return (Vec::new(), RowPredictions::default());
            }
            let view = study.view(&study.fit(terms, &train, COMMON, Some(&start)));
            (test, view)
        })
        .collect();
    let mut view = study.view(&start);
    for (rows, part) in &parts {
        view.take(part, rows);
    }
    view
}
