//! Effects that predict one channel better and that the measurements contradict nevertheless.

use super::search::{Search, with_term, without_term};
use crate::gain::{Gain, Scores};
use study::linear::Column;
use study::thresholds::{CATALOGUE_SHARE, FAMILY_ERROR, UNCORRECTED_LEVEL, WORSE_SHARE};
use study::{COMMON, RowScore, Study, TermId};

/// An effect moves headings if it moves one by this (rad).
const TURNED_RAD: f64 = 1e-9;

/// What is measured of bodies that turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Channel {
    Positions,
    Headings,
}

impl<S: Study> Search<'_, S> {
    /// Why the measurements contradict a term beside others: they show what it rules out, or a channel is predicted worse with it. None:
    /// they do not. A curve names no cause, and is not contradicted.
    pub(crate) fn contradiction(&self, term: TermId, others: &[TermId]) -> Option<String> {
        if self.study.candidates()[term].curve_over().is_some() || self.is_stopped() {
            return None;
        }
        let with = with_term(others, term);
        let fit = self.full_fit(&with, COMMON, None);
        self.study
            .contradiction(&fit, term)
            .or_else(|| self.worse_channel(&with, others))
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

    /// Whether noise of another shape explains as much as a term of a selection that spreads single frames. Both are compared without random
    /// effects.
    pub(crate) fn is_shape_of_noise(&self, term: TermId, accepted: &[TermId]) -> bool {
        if !self.study.candidates()[term].is_spread {
            return false;
        }
        let laws = self.without_random(accepted);
        let [with, without] = [laws.clone(), without_term(&laws, term)]
            .map(|terms| self.full_fit(&terms, COMMON, None));
        self.study.is_shape_of_noise(&with, &without)
    }

    /// Whether a term of a selection gains nothing without some others (p >= 5 % on held-out rows).
    pub(crate) fn needs(&self, term: TermId, others: &[TermId], accepted: &[TermId]) -> bool {
        let alone: Vec<TermId> =
            accepted.iter().copied().filter(|it| !others.contains(it)).collect();
        let [with, without] = [alone.clone(), without_term(&alone, term)]
            .map(|terms| self.held_out_scores(&terms, COMMON));
        let blocks = self.study.blocks(COMMON).dependent();
        UNCORRECTED_LEVEL <= Gain::from_scores(&with, &without, blocks).p_value
    }

    /// By how much headings, or positions beside them, are predicted worse by one model than by another; none: no worse.
    pub(crate) fn worse_channel(&self, with: &[TermId], without: &[TermId]) -> Option<String> {
        self.worse_headings(with, without).or_else(|| {
            let loss = self.gain_of_positions(without, with)?;
            (loss.p_value < FAMILY_ERROR).then(|| {
                format!("positions would be predicted worse by {:.3} nats per row", loss.gain)
            })
        })
    }

    /// Which of positions and headings do not show a term beside others (p < 5 %) though it moves them; none: both show it, or headings
    /// are not measured.
    pub(crate) fn channel_without(&self, term: TermId, others: &[TermId]) -> Option<Channel> {
        let with = with_term(others, term);
        if UNCORRECTED_LEVEL <= self.gain_of_positions(&with, others)?.p_value {
            return Some(Channel::Positions);
        }
        let columns = self.study.columns(&self.full_fit(others, COMMON, None), term);
        let turns = columns.iter().flatten().any(|moved| TURNED_RAD < moved[2].abs());
        let of_heading = |row: &RowScore| row.log - row.log_of_position;
        let gain = self.gain_of_channel(&with, others, of_heading)?;
        (turns && UNCORRECTED_LEVEL <= gain.p_value).then_some(Channel::Headings)
    }

    /// Whether a term turns robots rather than moves them along, and measured headings drift: the sensor may be what turns.
    pub(crate) fn may_be_drift(&self, term: TermId, others: &[TermId]) -> bool {
        let across = |column: &Column| {
            let known = column.iter().filter(|moved| (moved[0] * moved[1]).is_finite());
            known.fold([0.0; 2], |[across, all], moved| {
                let turned = moved[1] * moved[1] + moved[2] * moved[2];
                [across + turned, all + turned + moved[0] * moved[0]]
            })
        };
        let turns = |column: &Column| {
            let [across, all] = across(column);
            CATALOGUE_SHARE * all < across
        };
        self.study.do_headings_drift()
            && self.study.columns(&self.full_fit(others, COMMON, None), term).iter().any(turns)
    }

    /// Gain of one model over another in the held-out log score of positions; none where no headings are measured beside them.
    fn gain_of_positions(&self, with: &[TermId], without: &[TermId]) -> Option<Gain> {
        self.gain_of_channel(with, without, |row| row.log_of_position)
    }

    fn gain_of_channel(
        &self,
        with: &[TermId],
        without: &[TermId],
        score: impl Fn(&RowScore) -> f64,
    ) -> Option<Gain> {
        let [before, after] = [without, with].map(|terms| self.held_out_scores(terms, COMMON));
        let blocks = self.study.blocks(COMMON).dependent();
        let gain = Gain::of(&after, &before, blocks, score);
        (0 < gain.n_rows).then_some(gain)
    }

    fn worse_headings(&self, with: &[TermId], without: &[TermId]) -> Option<String> {
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
