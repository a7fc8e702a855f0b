//! Effects that predict one channel better and that the measurements contradict nevertheless.

use super::search::{Search, with_term};
use crate::gain::{Gain, Scores};
use study::thresholds::{FAMILY_ERROR, WORSE_SHARE};
use study::{COMMON, RowScore, Study, TermId};

impl<S: Study> Search<'_, S> {
    /// Why the measurements contradict a term beside others: they show what it rules out, or headings are predicted worse with it. None:
    /// they do not. A curve names no cause, and is not contradicted.
    pub(crate) fn contradiction(&self, term: TermId, others: &[TermId]) -> Option<String> {
        if self.study.candidates()[term].curve_over().is_some() || self.is_stopped() {
            return None;
        }
        let with = with_term(others, term);
        let fit = self.full_fit(&with, COMMON, None);
        self.study
            .contradiction(&fit, term)
            .or_else(|| self.worse_headings(&with, others))
            .or_else(|| self.worse_scatter(term, &with, others))
    }

    /// Whether readings are predicted worse with an effect that spreads them, by the continuous ranked probability score: a broad density
    /// for all rows may gain likelihood on few rows that are far off, and lose on all others.
    fn worse_scatter(&self, term: TermId, with: &[TermId], without: &[TermId]) -> Option<String> {
        if !self.study.candidates()[term].is_spread {
            return None;
        }
        let [before, after] = [without, with].map(|terms| self.held_out_scores(terms, COMMON));
        let blocks = self.study.blocks(COMMON).dependent();
        let loss = Gain::of(&after, &before, blocks, |row: &RowScore| row.crps);
        let [before, after] = [&before, &after].map(|rows| Scores::mean(rows).crps);
        (loss.standard_error < loss.gain).then(|| {
            format!("the CRPS of readings would be {after:.3} dB instead of {before:.3} dB")
        })
    }

    /// By how much headings are predicted worse by one model than by another; none: no worse.
    pub(crate) fn worse_headings(&self, with: &[TermId], without: &[TermId]) -> Option<String> {
        let before = self.held_out_scores(without, COMMON);
        if before.iter().all(|row| row.heading_squared_error_rad2.is_nan()) {
            return None;
        }
        let after = self.held_out_scores(with, COMMON);
        let [rmse_before, rmse_after] =
            [&before, &after].map(|rows| Scores::mean(rows).rmse_heading_rad.unwrap_or(f64::NAN));
        let blocks = self.study.blocks(COMMON).dependent();
        let error = |row: &RowScore| row.heading_squared_error_rad2;
        let loss = Gain::of(&after, &before, blocks, error);
        let least = (1.0 + WORSE_SHARE).sqrt() * rmse_before;
        (loss.p_value < FAMILY_ERROR && least < rmse_after).then(|| {
            format!("headings would be off by {rmse_after:.3} rad instead of {rmse_before:.3} rad")
        })
    }
}
