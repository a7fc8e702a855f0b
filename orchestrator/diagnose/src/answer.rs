//! From a search to an answer: which effects, which structure, which numbers.

use super::bounds::{self, SizeBounds};
use super::cautions;
use super::certainty::{self, Remains};
use super::diagnosis::{
    Affects, AlsoAlong, Diagnosis, Directions, NearestEffect, Parameter, Rung, SCHEMA, Structure,
    Tested, Verdict,
};
use super::gain::Gain;
use super::gate::{self, Gate, Noisier};
use super::ladder::{self, CandidateTest, Ladder, Nearest, Search, without_term};
use super::next;
use super::pure_error::{PureError, pure_error};
use super::rivals::{rivals, told};
use super::scan::Unexplained;
use super::words;
use indexmap::IndexMap;
use measure::account::DataAccount;
use numbers::power::square;
use proto::effect::Level;
use std::sync::Arc;
use study::links::predict::directions::DirectionsApart;
use study::open::Subject;
use study::symbolic::FittedFormula;
use study::{COMMON, Candidate, Estimate, Study, TermId};
use tracing::debug;

/// The measurements that a diagnosis is about.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measurements<'a> {
    /// Of links or of robots.
    pub subject: Subject,
    /// Unit of errors in words.
    pub error_unit: &'static str,
    /// How many rows were searched, if that is to be said.
    pub searched: Option<usize>,
    /// The file, and how much of it was used.
    pub account: &'a DataAccount,
}

/// The study and the fit of some terms that numbers are taken from: of `all_rows`, where the search used some rows only.
/// `None`: the search used all.
pub(crate) fn numbers<'a, S: Study>(
    search: &Search<'a, S>,
    study: &'a S,
    all_rows: Option<&'a S>,
    terms: &[TermId],
) -> (&'a S, Arc<S::Fit>) {
    let found = search.full_fit(terms, COMMON, None);
    let Some(all_rows) = all_rows else { return (study, found) };
    if search.is_stopped() {
        return (study, found);
    }
    let fit = all_rows.fit(terms, &all_rows.fitted_rows(), COMMON, Some(&found));
    if search.is_stopped() { (study, found) } else { (all_rows, Arc::new(fit)) }
}

/// The answer of a search. `residuals`: structure that is left in the residuals. `all_rows`: the study of all rows, where the
/// search used some of them only.
pub(crate) fn answer<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    ladder: &Ladder,
    measurements: Measurements<'_>,
    residuals: &Unexplained,
    all_rows: Option<&S>,
) -> Diagnosis {
    let (numbers_of, fit) = numbers(search, study, all_rows, &ladder.accepted);
    let slopes = (!search.is_stopped()).then(|| numbers_of.linearised(&fit)).flatten();
    // Of links there are many groups of rows, each of which is tested: those of the subset.
    let is_of_subset = all_rows.is_some() && measurements.subject == Subject::Links;
    let of_subset = slopes.as_ref().filter(|_| is_of_subset).and_then(|_| {
        let found = search.full_fit(&ladder.accepted, COMMON, None);
        study.linearised(&found)
    });
    let (seen, seen_in) = match &of_subset {
        Some(rows) => (Some(rows), study),
        None => (slopes.as_ref(), numbers_of),
    };
    let gate = seen.map_or_else(Gate::default, |rows| gate::of_slopes(seen_in, rows));
    let unit = measurements.error_unit;
    let noisier = seen.and_then(|rows| gate::noisiest(seen_in, rows));
    let odd_group = noisier.map(|it| noisier_text(&it, unit));
    let lost = seen.and_then(|_| gate::lost_otherwise(numbers_of, &fit));
    let odd_group = odd_group.or_else(|| lost.as_deref().map(gate::nothing_but));
    let pure = seen.and_then(|rows| pure_error(rows, &seen_in.dependence()));
    debug!(?pure, "noise");
    let n_parts = seen.map_or(1.0, gate::parts);
    let sizes = slopes.map_or_else(Vec::new, |rows| {
        bounds::size_bounds(numbers_of, search.n_tried(), (&rows, &fit), &ladder.accepted)
    });
    let excess = pure.filter(|pure| pure.is_alarming()).map(|pure| Excess { pure, unit });
    let unexplained = unexplained(search, ladder, residuals, excess.as_ref());
    let (mut candidates, known) = tested(study, ladder, numbers_of, &fit);
    for &term in &ladder.accepted {
        let apart = directions_apart(search, ladder, term);
        if let Some(one) = listed(&mut candidates, &study.candidates()[term]) {
            if apart.is_some() {
                // What has no spread is said as a difference.
                one.warning = None;
            }
            one.directions = apart;
            let constant = cautions::constant_within(search, ladder, term);
            one.warning = one.warning.take().into_iter().chain(constant).reduce(joined);
        }
    }
    let structure = unexplained.iter().map(|it| it.covariate.as_str()).collect();
    let remains = Remains { gate: &gate, pure, n_parts, structure, lost: lost.as_deref() };
    // Beside something unknown, a bound holds for nothing.
    for bounds in sizes.iter().filter(|_| !remains.is_something()) {
        if let Some(one) = listed(&mut candidates, &study.candidates()[bounds.term]) {
            (one.upper, one.detectable) = (Some(bounds.upper), Some(bounds.detectable));
        }
    }
    let doubts = certainty::doubts(study, search, ladder, &known, &remains);
    for (term, why) in &doubts {
        if let Some(one) = listed(&mut candidates, &study.candidates()[*term]) {
            one.doubt = Some(why.clone());
        }
    }
    let Named { missing, missing_one_of, mut possible } = named(study, ladder, &doubts);
    let causes = unexplained.iter().filter_map(Structure::possible_cause);
    let causes = causes.map(|cause| (cause.effect.clone(), cause.why_not.clone()));
    for other in causes.chain(possible_by_size(study, ladder, &sizes)) {
        if possible.iter().all(|(name, _)| *name != other.0) {
            possible.push(other);
        }
    }
    let is_complete = ladder.stopped.is_none() && !search.is_stopped();
    let withheld: Vec<&str> =
        ladder.withheld().map(|term| study.candidates()[term].name.as_str()).collect();
    let contradicted = contradicted_text(study, search, ladder);
    let verdict = if ladder.too_little.is_some() && gate.misfits.is_empty() {
        Verdict::NothingFound
    } else if unexplained.iter().any(Structure::is_certain) {
        Verdict::UnexplainedStructure
    } else if let Some(verdict) = Verdict::of_missing(&missing, &missing_one_of) {
        verdict
    } else if !gate.misfits.is_empty() || !unexplained.is_empty() {
        Verdict::SomethingMissing
    } else if gate.tells_too_little()
        || !withheld.is_empty()
        || contradicted.is_some()
        || !possible.is_empty()
        || pure.is_some_and(|pure| pure.is_alarming())
        || odd_group.is_some()
        || !study.blocks(COMMON).are_many()
        || !is_complete
    {
        Verdict::NothingFound
    } else {
        Verdict::NothingMissing
    };
    let next_measurement = if search.is_stopped() {
        Vec::new()
    } else {
        next::measurements(study, search, ladder, &known)
    };
    let is_any_possible = !possible.is_empty();
    let (possible, possible_because): (Vec<String>, Vec<String>) = possible.into_iter().unzip();
    let mut diagnosis = Diagnosis {
        schema: SCHEMA,
        kind: measurements.subject,
        verdict,
        sentence: String::new(),
        missing,
        missing_one_of,
        possible,
        possible_because,
        measurement_defects: Vec::new(),
        identifiability: None,
        split: study.blocks(COMMON).unit,
        ladder: ladder
            .rungs
            .iter()
            // A search that was stopped at once has not even scored the model as configured.
            .filter(|rung| !(search.is_stopped() && rung.scores.log_score.is_nan()))
            .map(|rung| self::rung(study, rung))
            .collect(),
        candidates,
        rivals: rivals(study, search, ladder),
        unexplained,
        residuals_searched: residuals.is_searched,
        could_hide: gate.could_hide.map_or(f64::NAN, |(bound, ..)| bound),
        misfits: gate.misfits,
        next_measurement,
        complete: is_complete,
        too_little: ladder.too_little.clone().or_else(|| {
            if verdict != Verdict::NothingFound || is_any_possible {
                None
            } else if !withheld.is_empty() {
                Some(withheld_text(&withheld, measurements.subject))
            } else if contradicted.is_some() {
                contradicted
            } else {
                excess.as_ref().map(Excess::of_model).or(odd_group)
            }
        }),
        stopped_in_round: ladder.stopped,
        searched: measurements.searched,
        account: measurements.account.clone(),
        error_unit: measurements.error_unit,
    };
    diagnosis.sentence = words::sentence(&diagnosis);
    diagnosis
}

/// The difference between the directions of two nodes that an accepted effect of their levels explains.
fn directions_apart<S: Study>(
    search: &Search<'_, S>,
    ladder: &Ladder,
    term: TermId,
) -> Option<Directions> {
    if search.is_stopped() {
        return None;
    }
    let fit = search.full_fit(&without_term(&ladder.accepted, term), COMMON, None);
    let DirectionsApart { weaker: [from, to], difference_db, low_db, high_db } =
        search.study().directions_apart(&fit, term)?;
    let unit = "dB".to_owned();
    let weaker_by = Parameter { value: difference_db, unit, low: low_db, high: high_db };
    Some(Directions { from, to, weaker_by })
}

/// Two clauses of a warning as one.
fn joined(one: String, other: String) -> String {
    format!("{one}; {other}")
}

/// What is listed of a candidate.
fn listed<'a>(all: &'a mut [Tested], candidate: &Candidate) -> Option<&'a mut Tested> {
    let is_it = |one: &&mut Tested| {
        (one.effect.as_str(), &one.only) == (candidate.effect(), &candidate.only)
    };
    all.iter_mut().find(is_it)
}

/// Names for what was accepted.
struct Named {
    /// What is certain, each an effect, or several of which these data cannot tell which it is.
    missing: Vec<String>,
    /// Of these the latter.
    missing_one_of: Vec<Vec<String>>,
    /// What is not certain, and why not.
    possible: Vec<(String, String)>,
}

fn named<S: Study>(study: &S, ladder: &Ladder, doubts: &[(TermId, String)]) -> Named {
    let candidates = study.candidates();
    let mut named = Named { missing: Vec::new(), missing_one_of: Vec::new(), possible: Vec::new() };
    let effects = ladder.accepted.iter().filter(|&&term| candidates[term].curve_over().is_none());
    for &term in effects {
        let ties = ladder.test_of(term).map_or(&[][..], |test| &test.ties);
        let names = [&[term], ties].concat();
        let names: Vec<String> =
            names.into_iter().map(|term| candidates[term].name.clone()).collect();
        let one_of = names.join(" or ");
        if let Some((_, why)) = doubts.iter().find(|(doubted, _)| *doubted == term) {
            named.possible.push((one_of, why.clone()));
            continue;
        }
        named.missing.push(one_of);
        if 1 < names.len() {
            named.missing_one_of.push(names);
        }
    }
    named
}

/// Effects that were not accepted and whose score tests are significant at the level for what is possible, each with the reason why it is not
/// certain. Effects that are tied with an accepted one, withheld or contradicted are reported elsewhere.
fn possible_by_size<S: Study>(
    study: &S,
    ladder: &Ladder,
    sizes: &[SizeBounds],
) -> Vec<(String, String)> {
    let is_tied = |term: TermId| {
        ladder
            .accepted
            .iter()
            .any(|&it| ladder.test_of(it).is_some_and(|it| it.ties.contains(&term)))
    };
    let is_told = |term| ladder.withheld().chain(ladder.contradicted()).any(|it| it == term);
    let predicts_better =
        |term: TermId| ladder.test_of(term).is_some_and(|test| 0.0 < test.gain.gain);
    let may_be = |bounds: &&SizeBounds| {
        bounds.is_possible()
            && predicts_better(bounds.term)
            && !is_tied(bounds.term)
            && !is_told(bounds.term)
    };
    let why = |bounds: &SizeBounds| {
        (study.candidates()[bounds.term].name.clone(), MAY_BE_CHANCE.to_owned())
    };
    sizes.iter().filter(may_be).map(why).collect()
}

/// Of an effect that was not accepted, though its score test is significant at a lower level.
const MAY_BE_CHANCE: &str = "the gain on held-out rows may be chance, or too small to matter";

/// What is left beyond noise.
struct Excess<'a> {
    pure: PureError,
    unit: &'a str,
}

impl Excess<'_> {
    fn compared(&self) -> String {
        let Self { pure: PureError { remaining, pure, .. }, unit } = self;
        format!(
            "off by {remaining:.3} {unit} where rows that repeat each other differ by {pure:.3} {unit}"
        )
    }

    /// Where nothing was found.
    fn of_model(&self) -> String {
        format!(
            "nothing was found, but the model is {}: something may be missing that was not tested",
            self.compared()
        )
    }

    /// Where structure was found that explains a share of the squared error of the model without it. `is_in_model`: the excess is what is
    /// left with it, otherwise without it. None: it explains more than is left.
    fn beside(&self, explained: f64, is_in_model: bool) -> Option<String> {
        let PureError { remaining, pure, .. } = self.pure;
        let left = 1.0 - explained;
        let without = if is_in_model { square(remaining) / left } else { square(remaining) };
        (explained * without < left * without - square(pure)).then(|| {
            format!(
                "the model is still {}, so the cause may follow another quantity",
                self.compared()
            )
        })
    }
}

/// That one group scatters more than the others.
fn noisier_text(Noisier { of, errors: [own, others], .. }: &Noisier, unit: &str) -> String {
    format!(
        "nothing was found, but errors of {of} ({own:.3} {unit}) exceed those of the others ({others:.3} {unit}): its place, its clock or \
         its noise may be wrong"
    )
}

/// Why candidates that gain beyond chance are not named.
fn withheld_text(names: &[&str], subject: Subject) -> String {
    let dependent = match subject {
        Subject::Links => "rows that follow each other or share a node",
        Subject::Robots => "rows that follow each other",
    };
    format!(
        "nothing was found for certain: {} would predict rows left out better, but by no more than what {dependent} may have in common",
        names.join(", ")
    )
}

/// Why candidates that the measurements contradict are not named, if there are any.
fn contradicted_text<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    ladder: &Ladder,
) -> Option<String> {
    let why = |term: TermId| {
        let name = &study.candidates()[term].name;
        let why = search.contradiction(term, &ladder.accepted)?;
        Some(format!("{name} would predict rows left out better, but {why}"))
    };
    let all: Vec<String> = ladder.contradicted().filter_map(why).collect();
    (!all.is_empty()).then(|| format!("nothing was found for certain: {}", all.join("; ")))
}

fn rung<S: Study>(study: &S, rung: &ladder::LadderStep) -> Rung {
    let scores = &rung.scores;
    Rung {
        model: match rung.terms.last() {
            None => "as configured".to_owned(),
            Some(&term) => format!("+ {}", study.candidates()[term].name),
        },
        log_score: scores.log_score,
        rmse: scores.rmse,
        rmse_received_db: scores.rmse_received_db,
        rmse_heading_rad: scores.rmse_heading_rad,
        crps: scores.crps,
        reception_log_loss: scores.reception_log_loss,
    }
}

/// Structure that no effect explains: the curves that were accepted, and what a scan of the residuals found.
fn unexplained<S: Study>(
    search: &Search<'_, S>,
    ladder: &Ladder,
    residuals: &Unexplained,
    excess: Option<&Excess<'_>>,
) -> Vec<Structure> {
    let study = search.study();
    let curves = ladder.accepted.iter().enumerate();
    let named = |nearest: Nearest| NearestEffect {
        effect: nearest.names(study.candidates()),
        share: nearest.share.min(1.0),
        may_be_cause: nearest.may_be_cause(),
        why_not: nearest.why_not,
    };
    let mut laws = search.without_random(&ladder.accepted);
    laws.retain(|&term| study.candidates()[term].curve_over().is_none());
    let noisy_places = |covariate: &str| {
        let fit = search.full_fit(&laws, COMMON, None);
        study.position_noise_m(&fit, covariate).map(certainty::of_noisy_places)
    };
    let of_curve = |(step, &term): (usize, &TermId)| {
        let structure = curve(study, ladder, residuals, (step, term))?;
        let nearest = search.nearest_effect(term, &without_term(&ladder.accepted, term));
        let of_readings = excess.filter(|_| !structure.is_of_losses());
        let warning = of_readings.and_then(|excess| excess.beside(structure.explained, true));
        let of_node = || search.only_node_of(term, &ladder.accepted).map(certainty::of_one_node);
        let warning = warning.or_else(of_node).or_else(|| noisy_places(&structure.covariate));
        let of_runs = || certainty::between_runs(search, term, &ladder.accepted);
        let warning = warning.or_else(of_runs).or_else(|| certainty::of_few_blocks(study));
        Some(Structure { nearest_effect: nearest.map(named), warning, ..structure })
    };
    let mut structure: Vec<Structure> = curves.filter_map(of_curve).collect();
    if let Some(left) = &residuals.structure {
        let formula = left.formula.as_ref();
        // A curve is not exactly what it stands for: its rest shows over whatever goes with its covariate.
        let curves =
            ladder.accepted.iter().filter_map(|&term| study.candidates()[term].curve_over());
        let curves = curves.filter(|&other| other != left.covariate).map(str::to_owned);
        let mut others: Vec<String> = curves.chain(left.others.iter().cloned()).collect();
        others.sort_unstable();
        others.dedup();
        structure.push(Structure {
            covariate: left.covariate.clone(),
            affects: None,
            explained: left.explained,
            p_value: left.p_value,
            formula: formula.map(|formula| formula.text.clone()),
            target: formula.map(|formula| formula.target.to_owned()),
            also: formula.and_then(also),
            rmse_after: formula.map(|formula| formula.rmse),
            indistinguishable_from: others,
            nearest_effect: search.nearest_to_rest(left.nats(), ladder).map(named),
            warning: excess
                .and_then(|excess| excess.beside(left.explained, false))
                .or_else(|| noisy_places(&left.covariate))
                .or_else(|| certainty::of_runs_in_turn(study, &left.covariate)),
        });
    }
    structure
}

/// The structure for which an accepted curve stands; `step`: its place among what was accepted.
fn curve<S: Study>(
    study: &S,
    ladder: &Ladder,
    residuals: &Unexplained,
    (step, term): (usize, TermId),
) -> Option<Structure> {
    let candidate = &study.candidates()[term];
    let covariate = candidate.curve_over()?;
    let test = ladder.test_of(term)?;
    let (before, after) = (&ladder.rungs[step].scores, &ladder.rungs[step + 1].scores);
    let (affects, left) = if candidate.is_of_losses() {
        (Affects::Losses, after.reception_log_loss / before.reception_log_loss)
    } else {
        (Affects::Readings, after.mean_square() / before.mean_square())
    };
    // A curve over the same with other knots is not another cause.
    let others = test.ties.iter().filter_map(|&tie| study.candidates()[tie].curve_over());
    let formula: Option<&FittedFormula> = residuals.formulas.get(&candidate.name);
    Some(Structure {
        covariate: covariate.to_owned(),
        affects: Some(affects),
        explained: (1.0 - left).max(0.0),
        p_value: test.gain.p_value,
        formula: formula.map(|formula| formula.text.clone()),
        target: formula.map(|formula| formula.target.to_owned()),
        also: formula.and_then(also),
        rmse_after: Some(formula.map_or(after.rmse, |formula| formula.rmse)),
        indistinguishable_from: others
            .filter(|&other| other != covariate)
            .map(str::to_owned)
            .collect(),
        nearest_effect: None,
        warning: None,
    })
}

/// A formula along a second direction.
fn also(formula: &FittedFormula) -> Option<AlsoAlong> {
    let (text, target) = formula.also.as_ref()?;
    Some(AlsoAlong { formula: text.clone(), target: (*target).to_owned() })
}

/// The estimates of terms.
type Estimates = Vec<(TermId, Vec<Estimate>)>;

/// The level of the blocks on which the gain of a test is: of the common split, where that decided.
fn held_out_level<S: Study>(study: &S, level: Level, test: Option<&CandidateTest>) -> Level {
    match test {
        Some(test) if test.gain == test.common => COMMON,
        _ => study.judging_level(level),
    }
}

/// What to mind of an effect that was found only once a curve stood for something unknown: a curve is not exactly what it stands for.
const AFTER_CURVE: &str = "found beside structure that no effect explains, and may be part of it";

/// Whether an effect was accepted after a curve was.
fn is_after_curve<S: Study>(study: &S, ladder: &Ladder, term: TermId) -> bool {
    let candidates = study.candidates();
    let is_curve = |term: &TermId| candidates[*term].curve_over().is_some();
    !is_curve(&term) && ladder.accepted.iter().take_while(|&&other| other != term).any(is_curve)
}

/// The candidates with what became of them, and the estimates of those that were accepted.
fn tested<S: Study>(
    study: &S,
    ladder: &Ladder,
    numbers_of: &S,
    fit: &S::Fit,
) -> (Vec<Tested>, Estimates) {
    let candidates = study.candidates();
    let (mut listed, mut known) = (Vec::new(), Vec::new());
    for (term, candidate) in candidates.ids().zip(candidates.iter()) {
        let test = ladder.test_of(term);
        let accepted = ladder.accepted.contains(&term);
        // Of a curve and the one that stands in for it, one is listed.
        let stands_in = |&other: &TermId| candidates[other].stands_in_for == Some(term);
        if candidate.stands_in_for.is_some() && !accepted || ladder.accepted.iter().any(stands_in) {
            continue;
        }
        let gain = test.map_or(Gain::NONE, |test| test.gain);
        let is_other = |&&tie: &&TermId| {
            let [a, b] = [candidate, &candidates[tie]];
            a.curve_over().is_none() || a.curve_over() != b.curve_over()
        };
        let ties = test.map_or(&[][..], |test| &test.ties);
        let (mut parameters, mut warning) = (IndexMap::new(), None);
        let mut not_identifiable = Vec::new();
        if accepted {
            let (estimates, of_estimates) = numbers_of.estimates(fit, term);
            let (identified, others) = told(estimates.clone());
            parameters.extend(identified.iter().map(parameter));
            not_identifiable.extend(others.into_iter().map(|estimate| estimate.name));
            let follows_curve = is_after_curve(study, ladder, term);
            let step = ladder.accepted.iter().position(|other| *other == term);
            warning = of_estimates
                .into_iter()
                .chain(step.and_then(|step| cautions::only_in_log_score(candidate, ladder, step)))
                .chain(follows_curve.then(|| AFTER_CURVE.to_owned()))
                .reduce(joined);
            known.push((term, estimates));
        }
        listed.push(Tested {
            effect: candidate.effect().to_owned(),
            gain: gain.gain,
            held_out: study.blocks(held_out_level(study, candidate.level, test)).unit,
            standard_error: gain.standard_error,
            p_value: gain.p_value,
            accepted,
            doubt: None,
            upper: None,
            detectable: None,
            directions: None,
            indistinguishable_from: ties
                .iter()
                .filter(is_other)
                .map(|&tie| candidates[tie].name.clone())
                .collect(),
            only: candidate.only.clone(),
            warning,
            parameters,
            not_identifiable,
            settings: numbers_of.settings(fit, term),
            untestable: candidate.untestable.clone(),
        });
    }
    (listed, known)
}

pub(super) fn parameter(estimate: &Estimate) -> (String, Parameter) {
    let Estimate { name, value, unit, low, high, .. } = estimate;
    let parameter = Parameter { value: *value, unit: unit.clone(), low: *low, high: *high };
    (name.clone(), parameter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_share_no_node() {
        let why = |subject| withheld_text(&["slip", "wind"], subject);
        let of_robots = "nothing was found for certain: slip, wind would predict rows left out better, but by no more than what rows that \
                         follow each other may have in common";
        assert_eq!(why(Subject::Robots), of_robots);
        assert!(why(Subject::Links).contains("rows that follow each other or share a node may"));
    }
}
