//! From which amplitude on an effect would be accepted, and be certain.
//!
//! An amplitude a of a column x, of which x̃ is left beside what was estimated, raises the score of row i by a s x̃ + ½ a² w x̃², with the
//! slope s of the noise and the weight w. These gains meet all that [`acceptance`](crate::acceptance) and [`certainty`](crate::certainty) ask, in the blocks
//! that are held out for the effect. The least amplitude that does is found in half of such campaigns. One that is greater by 1.28
//! standard errors is found in 9 of 10 ([`DETECTABLE_PROBABILITY`]).

use super::noise::Noise;
use crate::acceptance::{is_certain_by_total, is_worth};
use crate::bounds::moved;
use crate::gain::Gain;
use crate::ladder::{Search, dependence_of};
use crate::score_test::{ScoreTest, ScoreTests};
use numbers::normal::Z_90;
use numbers::power::square;
use proto::effect::{CONSTANT, Level};
use statrs::distribution::{ContinuousCDF as _, Normal};
use study::linear::{Column, Dependence};
use study::thresholds::{
    DETECTABLE_PROBABILITY, FAMILY_ERROR, HOPELESS_NATS, IDENTIFIED_HALF, UNCORRECTED_LEVEL,
};
use study::{COMMON, Study, TermId};

/// Factor between amplitudes that are tried, and how often the first is multiplied by it at most.
const STEP: f64 = 1.02;
const MOST_STEPS: usize = 1000;

/// Tests of amplitudes beside noise.
pub(crate) struct Detection<'a, S: Study> {
    study: &'a S,
    noise: &'a Noise,
    /// Candidates that p-values are corrected for.
    n_tried: f64,
    /// Those of them that are effects.
    n_effects: f64,
}

/// The amplitudes of one column.
pub(crate) struct Amplitudes {
    /// From this one on it is found in 9 of 10 campaigns; none: at no amplitude.
    pub(crate) found: Option<f64>,
    /// From this one on the likelihood tells it from nothing at all, as it tells tied effects apart.
    pub(crate) apart: f64,
}

impl<'a, S: Study> Detection<'a, S> {
    pub(crate) fn new(search: &Search<'a, S>, noise: &'a Noise) -> Self {
        let study = search.study();
        let is_effect = |it: &&study::Candidate| it.is_tried() && it.curve_over().is_none();
        let n_effects = study.candidates().iter().filter(is_effect).count() as f64;
        Self { study, noise, n_tried: search.n_tried() as f64, n_effects }
    }

    /// The amplitudes of a column of an effect; none where it moves nothing beside what was estimated.
    pub(crate) fn amplitudes(&self, term: TermId, column: &Column) -> Option<Amplitudes> {
        let tested = Tested::new(self, term, column)?;
        let certain = self.study.blocks(COMMON).may_be_certain();
        let found = certain.then(|| tested.least_found()).flatten();
        let power = Normal::standard().inverse_cdf(DETECTABLE_PROBABILITY);
        let apart = 2.0 * tested.gain(1.0).apart_errors() + power;
        Some(Amplitudes {
            found: found.map(|least| least + power * tested.standard_error),
            apart: apart * tested.standard_error,
        })
    }
}

/// A column of an effect beside noise.
struct Tested<'a, S: Study> {
    detection: &'a Detection<'a, S>,
    term: TermId,
    /// Of each block of rows that are held out together: what an amplitude of 1 adds by its first power, what by its second, and rows.
    blocks: Vec<(f64, f64, usize)>,
    information: f64,
    /// What an amplitude of 1 moves (root mean square).
    moved: f64,
    /// Standard error of the amplitude, by the dependence of rows that is least favourable.
    standard_error: f64,
    /// By rows that depend on each other in time and by nodes; none where these are too few to tell.
    clustered: Option<ScoreTest>,
    /// The same as the rule for constants takes it.
    asked: Option<ScoreTest>,
    /// By runs.
    of_runs: Option<ScoreTest>,
}

impl<'a, S: Study> Tested<'a, S> {
    fn new(detection: &'a Detection<'a, S>, term: TermId, column: &Column) -> Option<Self> {
        let (study, rows) = (detection.study, &detection.noise.rows);
        let dependence = dependence_of(study, term);
        let tests = ScoreTests::new(rows, &dependence);
        let (left, information) = tests.beside_estimated(column)?;
        let clustered = tests.test(column, &[]);
        let own = study.dependence();
        let asked = ScoreTests::new(rows, &own).test(column, &[]);
        let are_runs_tested = own.nodes.is_none() && dependence.replicates.is_none();
        let of_runs = are_runs_tested.then(|| {
            let replicates = Some(dependence.campaigns.clone());
            let of_runs = Dependence { replicates, ..dependence.clone() };
            ScoreTests::new(rows, &of_runs).test(column, &[])
        });
        let blocks = study.blocks(study.candidates()[term].level);
        let n_blocks = blocks.dependent().iter().max().map_or(0, |&last| last as usize + 1);
        let mut sums = vec![(0.0, 0.0, 0); n_blocks];
        for (row, &block) in blocks.dependent().iter().enumerate() {
            if blocks.scored.as_ref().is_some_and(|scored| !scored[row]) {
                continue;
            }
            let sum = &mut sums[block as usize];
            for (part, x) in left[row].iter().enumerate() {
                sum.0 += rows.slopes[row][part] * x;
                sum.1 += 0.5 * rows.weights[row][part] * x * x;
            }
            sum.2 += 1;
        }
        let of_blocks = sums.iter().map(|(slope, ..)| square(*slope)).sum::<f64>().sqrt();
        let of_clusters = clustered.map_or(0.0, |test| test.standard_error);
        let of_rows = information.sqrt().recip();
        let standard_error = of_rows.max(of_blocks / information).max(of_clusters);
        Some(Self {
            detection,
            term,
            blocks: sums,
            information,
            moved: moved(&left, rows),
            standard_error,
            clustered,
            asked,
            of_runs: of_runs.flatten(),
        })
    }

    /// The least amplitude that is found by its expected gains.
    fn least_found(&self) -> Option<f64> {
        let first = self.standard_error;
        let all = std::iter::successors(Some(first), |amplitude| Some(amplitude * STEP));
        all.take(MOST_STEPS).find(|amplitude| self.is_found(*amplitude))
    }

    /// The gain of an amplitude on rows left out.
    fn gain(&self, amplitude: f64) -> Gain {
        let of = |(first, second, n): &(f64, f64, usize)| {
            (amplitude * first + square(amplitude) * second, *n)
        };
        let gain = Gain::of_sums(self.blocks.iter().map(of).collect());
        let study = self.detection.study;
        let are_many = study.blocks(study.candidates()[self.term].level).are_many();
        if are_many { gain } else { gain.by_students_t() }
    }

    /// Whether the effect would be accepted and be certain with this amplitude.
    fn is_found(&self, amplitude: f64) -> bool {
        let Detection { study, noise, n_tried, n_effects } = self.detection;
        let candidate = &study.candidates()[self.term];
        let gain = self.gain(amplitude);
        let rise = 0.5 * square(amplitude) * self.information;
        let p_value = |test: &Option<ScoreTest>| test.map(|test| test.p_value_of(amplitude));
        let clustered = p_value(&self.clustered);
        let is_replicated = || {
            study.blocks(COMMON).replicates().is_some()
                && clustered.is_some_and(|p_value| n_effects * p_value < FAMILY_ERROR)
        };
        let is_asked_for = || {
            study.blocks(COMMON).are_many()
                && candidate.linear_in == Some(CONSTANT)
                && p_value(&self.asked).is_some_and(|p_value| 2.0 * p_value < FAMILY_ERROR)
        };
        let square_moved = square(amplitude * self.moved);
        let share = || square_moved / (square(noise.rms) + square_moved);
        let is_by_itself = gain.p_value < FAMILY_ERROR;
        let is_by_total = || {
            let are_many = study.blocks(study.judging_level(candidate.level)).are_many();
            let n_tried = *n_tried as usize;
            are_many && is_by_itself && is_certain_by_total(&gain, n_tried, study.design_effect())
        };
        let is_significant = n_tried * gain.p_value < FAMILY_ERROR
            || is_replicated()
            || is_asked_for()
            || is_by_total();
        HOPELESS_NATS + candidate.n_parameters as f64 <= rise
            && is_significant
            && is_worth(gain.gain, 0.0, share)
            && self.stands_clustered(clustered)
            && Z_90 * self.standard_error <= IDENTIFIED_HALF * amplitude
            && p_value(&self.of_runs).is_none_or(|p_value| p_value < FAMILY_ERROR)
    }

    /// Whether the effect is beyond what rows that depend on each other may share.
    fn stands_clustered(&self, p_value: Option<f64>) -> bool {
        let study = self.detection.study;
        let are_few = study.blocks(COMMON).replicates().is_some();
        let is_judged_by_places = study.candidates()[self.term].level == Level::Place
            && study.dependence().nodes.is_none()
            && !are_few;
        is_judged_by_places || p_value.map_or(!are_few, |p_value| 2.0 * p_value < UNCORRECTED_LEVEL)
    }
}
