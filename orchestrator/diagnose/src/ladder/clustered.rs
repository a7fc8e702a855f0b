//! What the slopes of a fit say of a term, of rows that depend on each other.

use super::limits;
use super::search::{Search, with_term};
use crate::gate;
use crate::score_test::passes;
use crate::score_test::{ScoreTest, ScoreTests};
use proto::effect::{CONSTANT, Level};
use study::linear::{Column, Dependence, Linearised};
use study::thresholds::{FAMILY_ERROR, FAR_HALF_INTERVALS, UNCORRECTED_LEVEL};
use study::{COMMON, Candidate, Study, TermId};
use tracing::debug;

impl<S: Study> Search<'_, S> {
    /// Whether what a term moves is beyond what rows that depend on each other may share: those of a node, and those that follow each
    /// other. A covariate that changes in time is no cause where the error drifts as slowly.
    pub(super) fn stands_clustered(&self, term: TermId, others: &[TermId]) -> bool {
        let candidate = &self.study.candidates()[term];
        let fit = self.full_fit(others, COMMON, None);
        if candidate.level == Level::Random {
            let agreement = self.study.agreement(&fit, term);
            debug!(name = candidate.name, ?agreement, "clustered");
            return agreement.is_none_or(|p_value| p_value < FAMILY_ERROR);
        }
        let Some(rows) = self.study.linearised(&fit) else { return true };
        let dependence = dependence_of(self.study, term);
        if let Some(passes) = self.study.passes(term) {
            return passes::p_value(&rows, passes) < FAMILY_ERROR;
        }
        let are_few = dependence.replicates.is_some();
        if candidate.level == Level::Place && dependence.nodes.is_none() && !are_few {
            // Judged on places left out, which blocks of time are not.
            return true;
        }
        let varies_in_time = candidate.level == Level::Time;
        if candidate.curve_over().is_some() {
            let columns = self.study.columns_of_curve(&fit, term);
            let has_times = dependence.times_s.iter().all(|time_s| time_s.is_finite());
            if columns.is_empty() || !varies_in_time || !has_times {
                return true;
            }
            let p_value = ScoreTests::new(&rows, &dependence).p_value_together(&columns);
            debug!(name = candidate.name, ?p_value, "clustered");
            return p_value.is_none_or(|p_value| p_value < UNCORRECTED_LEVEL);
        }
        if self.study.columns(&fit, term).is_empty() {
            return true;
        }
        let p_values = self.clustered_p_values(term, others, &dependence);
        debug!(name = candidate.name, ?p_values, "clustered");
        // Where nothing can be told, the gain on rows left out decides; not of a few replicates, one of which may be all that it is.
        let told = p_values.into_iter().flatten().reduce(f64::min);
        told.map_or(!are_few, |least| 2.0 * least < UNCORRECTED_LEVEL)
    }

    /// P-values of what a term moves beside others, by rows that depend on each other: as the likelihood weighs rows, and with equal weights.
    /// The likelihood has heavy tails and gives large errors a small weight. None where nothing can be told.
    fn clustered_p_values(
        &self,
        term: TermId,
        others: &[TermId],
        dependence: &Dependence,
    ) -> [Option<f64>; 2] {
        let fit = self.full_fit(others, COMMON, None);
        let with_effect = self.full_fit(&with_term(others, term), COMMON, Some(&fit));
        let [rows, left] = [&fit, &with_effect].map(|fit| self.study.linearised(fit));
        let (Some(rows), Some(left)) = (rows, left) else { return [None; 2] };
        let columns = self.study.columns(&fit, term);
        [(&rows, &left), (&rows.plain(), &left.plain())]
            .map(|(rows, left)| p_value(&ScoreTests::new(rows, dependence), left, &columns))
    }

    /// Whether an effect is significant by a few replicates after correction for all effects: by Student's t of what it moves in each. Gains of
    /// flights differ more than sizes of an effect do, so that a mean of few gains tells less.
    pub(super) fn is_replicated(&self, term: TermId, others: &[TermId]) -> bool {
        let candidate = &self.study.candidates()[term];
        let are_few = self.study.blocks(COMMON).replicates().is_some();
        if !are_few && self.study.passes(term).is_none() {
            return false;
        }
        let p_value = || {
            if let Some(passes) = self.study.passes(term) {
                let rows = self.study.linearised(&self.full_fit(others, COMMON, None))?;
                return Some(passes::p_value(&rows, passes));
            }
            let is_of_mean = candidate.level != Level::Random && candidate.curve_over().is_none();
            let dependence = dependence_of(self.study, term);
            is_of_mean.then(|| self.clustered_p_values(term, others, &dependence)[0])?
        };
        let is_effect = |it: &&Candidate| it.is_tried() && it.curve_over().is_none();
        let n = self.study.candidates().iter().filter(is_effect).count() as f64;
        p_value().is_some_and(|p_value| n * p_value < FAMILY_ERROR)
    }

    /// Whether what a term of robots moves differs between runs by so much that its mean over them may be chance, by Student's t. Parts of a
    /// run share what is the run's own. Not of what is limited to some rows.
    pub(crate) fn may_be_of_runs(&self, term: TermId, others: &[TermId]) -> bool {
        let dependence = dependence_of(self.study, term);
        if self.study.dependence().nodes.is_some()
            || dependence.replicates.is_some()
            || self.study.candidates()[term].only.is_some()
        {
            return false;
        }
        let replicates = Some(dependence.campaigns.clone());
        let of_runs = Dependence { replicates, ..dependence };
        let [p_value, _] = self.clustered_p_values(term, others, &of_runs);
        debug!(name = self.study.candidates()[term].name, ?p_value, "over runs");
        p_value.is_some_and(|p_value| FAMILY_ERROR <= p_value)
    }

    /// Whether an effect that is limited to some rows, or moves all alike, is asked for by the slopes of the fit of others. Of few blocks, such
    /// as those of one robot, a mean of gains tells little.
    pub(super) fn is_asked_for(&self, term: TermId, others: &[TermId]) -> bool {
        let candidate = &self.study.candidates()[term];
        self.study.blocks(COMMON).are_many()
            && (candidate.only.is_some() || candidate.linear_in == Some(CONSTANT))
            && limits::p_value(self.study, &self.full_fit(others, COMMON, None), term)
                < FAMILY_ERROR
    }

    /// Whether an effect of a measured covariate that varies in time is significant beside a drift in the model, by the likelihood with the
    /// drift integrated out: the test of generalised least squares, corrected for all candidates. Blocks of time that are left out tell
    /// little of it, as the drift follows both sides of a block whatever the cause is.
    pub(super) fn stands_beside_drift(&self, term: TermId, others: &[TermId]) -> bool {
        let candidate = &self.study.candidates()[term];
        if !candidate.follows_column_in_time()
            || !others.iter().any(|&other| self.study.is_drift(other))
        {
            return false;
        }
        let within = self.full_fit(others, COMMON, None);
        let general = self.full_fit(&with_term(others, term), COMMON, Some(&within));
        let p_value = self.likelihood_ratio_p_value(&general, &within, candidate.n_parameters);
        debug!(name = candidate.name, p_value, "beside drift");
        p_value < FAMILY_ERROR / self.n_tried() as f64
    }

    /// Whether a term is the level about which random effects vary, and is far from nothing beside them: it is not given up for them, which
    /// follow any level.
    pub(super) fn is_level_of_random(&self, term: TermId, others: &[TermId]) -> bool {
        let candidates = self.study.candidates();
        let is_random = |other: &TermId| candidates[*other].level == Level::Random;
        if candidates[term].linear_in != Some(CONSTANT) || !others.iter().any(is_random) {
            return false;
        }
        let fit = self.full_fit(&with_term(others, term), COMMON, None);
        let (estimates, _) = self.study.estimates(&fit, term);
        estimates.first().is_some_and(|level| {
            FAR_HALF_INTERVALS * (level.high - level.low) / 2.0 < level.value.abs()
        })
    }

    /// Whether all rows are off by a constant that is worth removing, beside these terms.
    pub(super) fn is_off(&self, terms: &[TermId]) -> bool {
        let gate = gate::gate(self.study, &self.full_fit(terms, COMMON, None));
        gate.misfits.iter().any(|misfit| misfit.of.is_none())
    }
}

/// Which rows may depend on each other in a test of a term.
pub(crate) fn dependence_of<S: Study>(study: &S, term: TermId) -> Dependence {
    let candidate = &study.candidates()[term];
    let mut dependence = study.dependence();
    // What overlaps is together: an effect is not refused because of blocks that are as short as they can be.
    dependence.shortest_s *= 2.0;
    if candidate.level == Level::Time && candidate.linear_in != Some(CONSTANT) {
        // Nodes see the same covariate at the same time: what is theirs does not follow it.
        dependence.nodes = None;
    }
    dependence
}

/// P-value of the most significant of several columns of an effect, corrected for their number, by what a fit with the effect leaves. None
/// where no column can be tested, or those that cannot be would raise the likelihood more: of a push in some direction, the component that
/// can be tested may be the one that is not there.
fn p_value(tests: &ScoreTests<'_>, with_effect: &Linearised, columns: &[Column]) -> Option<f64> {
    let (mut known, mut unknown_nats) = (Vec::<ScoreTest>::new(), 0.0);
    for column in columns {
        match tests.test_in_noise_of(column, with_effect) {
            Some(test) => known.push(test),
            None => unknown_nats += tests.rise(column, &[]),
        }
    }
    if known.is_empty() || known.iter().map(|test| test.rise).sum::<f64>() < unknown_nats {
        return None;
    }
    let least = known.iter().map(|test| test.p_value).fold(f64::INFINITY, f64::min);
    Some(least * known.len() as f64)
}
