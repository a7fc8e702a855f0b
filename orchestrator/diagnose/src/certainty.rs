//! What of all that was accepted is certain. A selection accepts what predicts rows left out better. A name is certain only if the data
//! also tell how large the effect is, and show what is its own. The size must be plausible, and nothing else may be open that the effect
//! may be part of.

use crate::gate::Gate;
use crate::ladder::{Channel, Ladder, Search, without_term};
use crate::pure_error::PureError;
use numbers::format::with_unit;
use proto::effect::{CONSTANT, Level, Need, Parameter};
use std::collections::BTreeMap;
use study::links::predict::directions::DirectionsApart;
use study::thresholds::{FEWEST_BLOCKS, FEWEST_REPLICATES, IDENTIFIED_HALF, LACK_OF_FIT_RATIO};
use study::{COMMON, Candidate, Estimate, Study, TermId, is_at_bound};

/// What is seen of the model with all that was accepted.
pub(crate) struct Remains<'a> {
    /// Constants by which it is wrong.
    pub gate: &'a Gate,
    /// What it leaves beside what repeats differ by.
    pub pure: Option<PureError>,
    /// In how many directions rows have an error.
    pub n_parts: f64,
    /// Covariates over which there is structure that no effect explains.
    pub structure: Vec<&'a str>,
    /// What it says of a node whose frames are lost otherwise.
    pub lost: Option<&'a str>,
}

impl Remains<'_> {
    /// Whether something else is missing.
    pub(crate) fn is_something(&self) -> bool {
        !self.structure.is_empty()
            || !self.gate.misfits.is_empty()
            || self.pure.is_some_and(|pure| pure.is_alarming())
    }

    /// What a model that leaves nothing but noise would gain (nats per row), where more is left; else 0.
    fn unexplained_nats(&self) -> f64 {
        let alarming = self.pure.filter(|pure| pure.is_alarming());
        alarming.map_or(0.0, |pure| self.n_parts * libm::log(pure.remaining / pure.pure))
    }
}

/// Why each accepted effect is not certain; none: it is.
pub(crate) fn doubts<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    ladder: &Ladder,
    known: &[(TermId, Vec<Estimate>)],
    remains: &Remains<'_>,
) -> Vec<(TermId, String)> {
    let candidates = study.candidates();
    let is_effect = |term: &TermId| candidates[*term].curve_over().is_none();
    let effects: Vec<TermId> = ladder.accepted.iter().copied().filter(is_effect).collect();
    let worse = search.worse_channel(&ladder.accepted, &[]);
    let are_places_tested = candidates.iter().any(|it| it.is_tried() && it.level == Level::Place);
    // What moves readings weakens frames, too. Where readings are given nothing does.
    let are_readings_tested =
        candidates.iter().any(|it| it.about.is_some() && it.is_tried() && !needs_losses(it));
    let doubt = |(place, &term): (usize, &TermId)| {
        let candidate = &candidates[term];
        let others = without_term(&ladder.accepted, term);
        let estimates = known.iter().find(|(other, _)| *other == term);
        let estimates = estimates.map_or(&[][..], |(_, estimates)| estimates);
        let why = implausible(candidate, estimates)
            .or_else(|| {
                // Of two nodes the spread of levels has no size, and the difference between both directions has one.
                let fit = search.full_fit(&others, COMMON, None);
                let apart = study.directions_apart(&fit, term);
                if apart.is_some_and(is_apart) { None } else { unidentified(candidate, estimates) }
            })
            .or_else(|| of_unknown_shape(candidate, estimates))
            .or_else(|| at_bound(candidate, estimates))
            .or_else(|| of_few_blocks(study))
            .or_else(|| search.may_be_of_runs(term, &others).then(|| RUNS.to_owned()))
            .or_else(|| between_runs(search, term, &ladder.accepted))
            .or_else(|| {
                let is_open = candidate.is_spread && !is_independent(remains.pure);
                is_open.then(|| SPREAD.to_owned())
            })
            .or_else(|| search.is_shape_of_noise(term, &ladder.accepted).then(|| NOISE.to_owned()))
            .or_else(|| {
                let gain = ladder.test_of(term)?.gain.gain;
                let is_small = 0 < place && gain < remains.unexplained_nats();
                let is_collinear = || {
                    let fit = search.full_fit(&ladder.accepted, COMMON, None);
                    study.is_collinear(&fit, term)
                };
                let is_part = remains.is_something()
                    && candidate.linear_in != Some(CONSTANT)
                    && (is_small
                        || (needs_losses(candidate) && are_readings_tested)
                        || is_collinear()
                        || !search.survives_beside_curves(term, ladder, &remains.structure));
                is_part.then(|| PART.to_owned())
            })
            .or_else(|| {
                let lost = remains.lost.filter(|_| needs_losses(candidate))?;
                Some(format!("{lost}, and that node may be the cause"))
            })
            .or_else(|| (are_places_tested && is_passage(candidate)).then(|| PASSAGE.to_owned()))
            .or_else(|| search.only_node_of(term, &ladder.accepted).map(of_one_node))
            .or_else(|| {
                let is_first = search.is_of_beginnings(term, &ladder.accepted);
                is_first.then(|| BEGINNING.to_owned())
            })
            .or_else(|| {
                // A model that is not complete misses more than a place.
                let is_complete = ladder.stopped.is_none();
                let place = is_complete.then(|| search.place_instead_of(term, &ladder.accepted));
                place.flatten().map(|it| as_well(&it))
            })
            .or_else(|| search.contradiction(term, &others))
            .or_else(|| worse.clone())
            .or_else(|| search.may_be_drift(term, &others).then(|| DRIFT.to_owned()))
            .or_else(|| search.channel_without(term, &others).map(of_one_channel));
        why.map(|why| (term, why))
    };
    let mut doubts: Vec<(TermId, String)> = effects.iter().enumerate().filter_map(doubt).collect();
    // What shows only beside an effect that is not certain is not certain.
    let doubted: Vec<TermId> = doubts.iter().map(|(term, _)| *term).collect();
    if !doubted.is_empty() && ladder.stopped.is_none() {
        let certain = effects.into_iter().filter(|term| !doubted.contains(term));
        let needing = certain.filter(|&term| search.needs(term, &doubted, &ladder.accepted));
        doubts.extend(needing.map(|term| {
            let names: Vec<&str> = doubted.iter().map(|it| candidates[*it].name.as_str()).collect();
            (term, format!("it shows only beside {}", names.join(", ")))
        }));
    }
    doubts
}

/// Of blocks that are few and follow each other in one recording.
pub(crate) fn of_few_blocks<S: Study>(study: &S) -> Option<String> {
    let blocks = study.blocks(COMMON);
    (!blocks.may_be_certain()).then(|| {
        format!(
            "these data are {} {} that follow each other, and at least {FEWEST_BLOCKS}, or {FEWEST_REPLICATES} runs, are required",
            blocks.n_scored(),
            blocks.unit
        )
    })
}

/// Whether the difference between two directions is known to within half of it, either way.
fn is_apart(apart: DirectionsApart) -> bool {
    (apart.high_db - apart.low_db) / 2.0 <= IDENTIFIED_HALF * apart.difference_db
}

/// Whether an effect shows in lost frames alone, of which whatever else weakens frames is a cause, too.
fn needs_losses(candidate: &Candidate) -> bool {
    candidate.about.is_some_and(|about| about.needs.contains(&Need::Losses))
}

/// Whether an effect is limited to some robots or nodes, and ends.
fn is_passage(candidate: &Candidate) -> bool {
    let has = |key: &str| candidate.only.as_ref().is_some_and(|only| only.contains_key(key));
    (has("agents") || has("nodes")) && has("until_s")
}

/// Of an effect of some robots or nodes that ends.
const PASSAGE: &str =
    "what acts in a place that only these passed, and only in that time, looks the same";

/// Of an effect that spreads single frames.
const SPREAD: &str =
    "these data do not show that what it spreads is independent from frame to frame";
/// Of an effect that spreads single frames as noise of another shape does.
const NOISE: &str = "noise of another skew or other tails explains these data as well";
/// Of an effect that gains nothing beside a free curve, or less than is left unexplained.
pub(crate) const PART: &str = "something else is missing, of which this may be a part";

/// Of an effect whose size differs between runs.
const RUNS: &str = "it differs between runs by so much that its mean over these may be chance";
const BETWEEN_RUNS: &str =
    "it has one value for each run, and between runs more than the time may differ";

/// Of structure that a search left over the time, where runs follow each other: it differs between these.
pub(crate) fn of_runs_in_turn<S: Study>(study: &S, covariate: &str) -> Option<String> {
    let dependence = study.dependence();
    (covariate == "time_s" && are_in_turn(&dependence.campaigns, &dependence.times_s))
        .then(|| BETWEEN_RUNS.to_owned())
}

/// Whether there are several runs, none of which begins before another has ended.
fn are_in_turn(runs: &[u32], times_s: &[f64]) -> bool {
    let mut spans: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
    for (run, &time_s) in runs.iter().zip(times_s).filter(|(_, time_s)| time_s.is_finite()) {
        let [begin_s, end_s] = spans.entry(*run).or_insert([time_s; 2]);
        (*begin_s, *end_s) = (begin_s.min(time_s), end_s.max(time_s));
    }
    let mut spans: Vec<[f64; 2]> = spans.into_values().collect();
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    1 < spans.len() && spans.windows(2).all(|pair| pair[0][1] <= pair[1][0])
}

/// Of an effect or structure that follows the time and has one value for each run.
pub(crate) fn between_runs<S: Study>(
    search: &Search<'_, S>,
    term: TermId,
    accepted: &[TermId],
) -> Option<String> {
    search.is_between_runs(term, accepted).then(|| BETWEEN_RUNS.to_owned())
}

/// Of an effect that turns robots whose headings are not those of their course.
const DRIFT: &str = "measured headings drift against the course that positions show, so that their sensor may be wrong";

/// Of an effect that moves hardly anything but the first windows of tracks.
pub(crate) const BEGINNING: &str =
    "nearly all that it moves is at the beginnings of tracks, before which the motion is not known";

/// Of an effect that moves positions and headings, of which one does not show it.
fn of_one_channel(silent: Channel) -> String {
    let shown = match silent {
        Channel::Positions => "only headings show it, and their sensor may drift",
        Channel::Headings => "headings do not show it, and their sensor may drift",
    };
    shown.to_owned()
}

/// Of an effect or structure that moves hardly anything but the rows of one node.
pub(crate) fn of_one_node(node: u32) -> String {
    format!(
        "nearly all that it moves has node {node} in common, whose position or antenna may be another"
    )
}

/// Of structure over what follows from positions, if these are as noisy as is likeliest (m).
pub(crate) fn of_noisy_places(sd_m: f64) -> String {
    format!(
        "positions of moving nodes may be off by {sd_m:.2} m (standard deviation), which has such structure, too"
    )
}

/// Of an effect that the place of a node explains as well.
fn as_well(place: &str) -> String {
    format!("these data are predicted as well without it if {place}")
}

/// Which estimate of an effect is physically implausible: its whole interval is outside the plausible range.
pub(crate) fn implausible(candidate: &Candidate, estimates: &[Estimate]) -> Option<String> {
    estimates.iter().filter(|estimate| estimate.is_identifiable).find_map(|estimate| {
        let Estimate { name, value, low, high, unit, .. } = estimate;
        let plausible = candidate.parameter(estimate)?.plausible?;
        let is_outside = *high < plausible.min || plausible.max < *low;
        is_outside.then(|| {
            format!(
                "its {name} of {} ({} to {}) is outside the plausible range of {} to {} ({})",
                with_unit(&number(*value), unit),
                number(*low),
                number(*high),
                plausible.min,
                with_unit(&plausible.max.to_string(), unit),
                plausible.source
            )
        })
    })
}

/// Which size of an effect is not known to within a factor: the first spread of a random effect. Of another effect it is the first
/// parameter that has a value at which the effect does nothing.
pub(crate) fn unidentified(candidate: &Candidate, estimates: &[Estimate]) -> Option<String> {
    let size = if candidate.level == Level::Random {
        estimates.first().filter(|spread| !is_identified(spread))
    } else {
        let null = |size: &Estimate| candidate.parameter(size)?.null;
        let size = estimates.iter().find_map(|size| Some((size, null(size)?)));
        size.filter(|(size, null)| !is_size_identified(size, *null)).map(|(size, _)| size)
    }?;
    Some(format!(
        "{} is not identified, it may be {} to {}",
        size.name,
        number(size.low),
        with_unit(&number(size.high), &size.unit)
    ))
}

/// Which other parameter of an effect these data do not determine, where what the effect does depends on it: how far downwash reaches.
/// Random effects are judged by their spreads. Of an effect that is linear in a covariate the other parameter is the covariate's zero.
pub(crate) fn of_unknown_shape(candidate: &Candidate, estimates: &[Estimate]) -> Option<String> {
    if candidate.level == Level::Random || candidate.linear_in.is_some() {
        return None;
    }
    let unknown =
        estimates.iter().find(|it| !it.is_identifiable && candidate.parameter(it).is_some())?;
    Some(format!("what it does depends on its {}, which these data do not determine", unknown.name))
}

/// Which size of an effect is at the bound of its range that is farther from no effect: the data ask for something else.
pub(crate) fn at_bound(candidate: &Candidate, estimates: &[Estimate]) -> Option<String> {
    let (size, parameter) = estimates
        .iter()
        .find_map(|size| {
            let parameter = candidate.parameter(size)?;
            parameter.null.map(|null| (size, parameter, null)).filter(|(size, parameter, null)| {
                let is_null = (size.value - null).abs() < parameter.step;
                is_at_bound(parameter, size.value) && !is_null
            })
        })
        .map(|(size, parameter, _)| (size, parameter))?;
    let Parameter { key, min, max, .. } = parameter;
    Some(format!(
        "its {key} of {} is at the bound of its range, {min} to {max}",
        with_unit(&number(size.value), &size.unit)
    ))
}

fn number(value: f64) -> String {
    format!("{value:.3}")
}

/// Whether the spread of a random effect is known to within a factor.
fn is_identified(spread: &Estimate) -> bool {
    spread.is_identifiable
        && 0.0 < spread.low
        && libm::log(spread.high / spread.low) / 2.0 <= IDENTIFIED_HALF
}

/// Whether the distance of a size from the value at which its effect does nothing is known to within half of it, either way.
pub(crate) fn is_size_identified(size: &Estimate, null: f64) -> bool {
    let half = (size.high - size.low) / 2.0;
    size.is_identifiable && half <= IDENTIFIED_HALF * (size.value - null).abs()
}

/// Whether the data show that rows that repeat each other differ by all that is left.
fn is_independent(pure: Option<PureError>) -> bool {
    pure.is_some_and(|pure| pure.greatest_ratio < LACK_OF_FIT_RATIO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ladder::tests::candidate;
    use proto::effect::Plausible;

    #[test]
    fn runs_are_in_turn_where_none_begins_before_another_has_ended() {
        assert!(are_in_turn(&[2, 2, 7, 7], &[50.0, 60.0, 10.0, 20.0]));
        assert!(!are_in_turn(&[2, 2, 7, 7], &[0.0, 60.0, 0.0, 60.0]), "times since each began");
        assert!(!are_in_turn(&[2, 2, 2], &[0.0, 1.0, f64::NAN]), "one run");
    }

    #[test]
    fn a_spread_is_identified_within_a_factor() {
        let of = |low, high| Estimate::new("sd_db", "dB", 1.7, (low, high));
        assert!(is_identified(&of(1.1, 2.6)));
        assert!(!is_identified(&of(0.045, 296.0)) && !is_identified(&of(0.0, 2.0)));
        assert!(!is_identified(&of(1.5, 2.0).not_identifiable()));
    }

    #[test]
    fn a_size_is_identified_to_within_half_of_its_distance_from_the_null() {
        let of = |value, low, high| Estimate::new("scale", "1", value, (low, high));
        assert!(is_size_identified(&of(-8.0, -12.0, -4.0), 0.0));
        assert!(!is_size_identified(&of(8.0, 3.0, 13.0), 0.0));
        assert!(is_size_identified(&of(0.9, 0.86, 0.94), 1.0));
        assert!(!is_size_identified(&of(0.9, 0.84, 0.96), 1.0));
        assert!(!is_size_identified(&of(8.0, 7.0, 9.0).not_identifiable(), 0.0));
    }

    /// The candidate of an effect of the catalogue.
    fn of_parameters(parameters: &'static [Parameter], level: Level) -> Candidate {
        let n_parameters = parameters.len();
        Candidate { level, parameters, n_parameters, ..candidate("an-effect") }
    }

    const SLOPE: Parameter = Parameter {
        key: "db_per_hour",
        unit: "dB/h",
        min: -100.0,
        max: 0.0,
        starts: &[-0.5],
        step: 0.01,
        null: Some(0.0),
        plausible: Some(Plausible { min: -20.0, max: 0.0, source: "a data sheet" }),
    };
    const PLACE: Parameter = Parameter { key: "x_m", null: None, plausible: None, ..SLOPE };

    #[test]
    fn an_estimate_is_implausible_if_its_whole_interval_is_outside_the_range() {
        let sag = of_parameters(&[PLACE, SLOPE], Level::Time);
        let of = |low, high| {
            let slope = Estimate::new("db_per_hour", "dB/h", -27.0, (low, high));
            let place = Estimate::new("x_m", "m", -50.0, (-51.0, -49.0));
            let beside = Estimate::new("from_m", "m", -50.0, (-51.0, -49.0));
            [place, beside, slope]
        };
        let expected = "its db_per_hour of -27.000 dB/h (-29.000 to -25.000) is outside the plausible range of -20 to 0 dB/h (a data sheet)";
        assert_eq!(implausible(&sag, &of(-29.0, -25.0)).as_deref(), Some(expected));
        assert_eq!(implausible(&sag, &of(-36.0, -20.0)), None);
        let unknown = of(-29.0, -25.0).map(Estimate::not_identifiable);
        assert_eq!(implausible(&sag, &unknown), None);
    }

    #[test]
    fn the_first_size_of_an_effect_must_be_identified_and_of_a_random_one_the_first_spread() {
        let place = Estimate::new("x_m", "m", -1.0, (-60.0, -0.1));
        let of =
            |low, high| [place.clone(), Estimate::new("db_per_hour", "dB/h", -8.0, (low, high))];
        let sag = of_parameters(&[PLACE, SLOPE], Level::Time);
        assert_eq!(unidentified(&sag, &of(-11.0, -5.0)), None);
        let expected = "db_per_hour is not identified, it may be -15.000 to -1.000 dB/h";
        assert_eq!(unidentified(&sag, &of(-15.0, -1.0)).as_deref(), Some(expected));
        let place_only = of_parameters(&[PLACE], Level::Place);
        assert_eq!(unidentified(&place_only, std::slice::from_ref(&place)), None);
        let random = of_parameters(&[SLOPE], Level::Random);
        let spread = Estimate::new("sd_db", "dB", 1.7, (0.045, 296.0));
        assert!(unidentified(&random, &[spread]).is_some());
    }

    #[test]
    fn a_size_at_the_far_bound_of_its_range_is_doubted() {
        let lag = Parameter { key: "tau_s", min: 0.0, max: 10.0, null: Some(0.0), ..SLOPE };
        let lag = of_parameters(Box::leak(Box::new([lag])), Level::Time);
        let of = |value: f64| {
            at_bound(&lag, &[Estimate::new("tau_s", "s", value, (0.9 * value, 1.1 * value))])
        };
        assert_eq!(of(0.3), None);
        assert_eq!(of(0.0), None);
        let expected = "its tau_s of 10.000 s is at the bound of its range, 0 to 10";
        assert_eq!(of(10.0).as_deref(), Some(expected));
    }

    #[test]
    fn what_ends_for_some_robots_may_be_a_place_that_they_passed() {
        let of = |only: &str| Candidate {
            only: Some(only.parse().unwrap()),
            ..of_parameters(&[SLOPE], Level::Time)
        };
        assert!(is_passage(&of("agents = [2]\nuntil_s = 93.6")));
        assert!(is_passage(&of("nodes = [2]\nfrom_s = 3.0\nuntil_s = 93.6")));
        for lasting in ["agents = [2]\nfrom_s = 93.6", "until_s = 93.6", "agents = [2]"] {
            assert!(!is_passage(&of(lasting)));
        }
    }

    #[test]
    fn an_effect_whose_reach_is_unknown_is_doubted_and_the_zero_of_a_covariate_is_not() {
        let size = Estimate::new("db_per_hour", "dB/h", -8.0, (-9.0, -7.0));
        let reach = Estimate::new("x_m", "m", -1.0, (-100.0, 0.0));
        let downwash = of_parameters(&[SLOPE, PLACE], Level::Time);
        let known = [size.clone(), reach.clone()];
        let unknown = [size.clone(), reach.clone().not_identifiable()];
        assert_eq!(of_unknown_shape(&downwash, &known), None);
        let expected = "what it does depends on its x_m, which these data do not determine";
        assert_eq!(of_unknown_shape(&downwash, &unknown).as_deref(), Some(expected));
        let linear = Candidate { linear_in: Some("temperature_c"), ..downwash.clone() };
        let random = Candidate { level: Level::Random, ..downwash.clone() };
        for candidate in [linear, random] {
            assert_eq!(of_unknown_shape(&candidate, &unknown), None);
        }
        // Of a place that a search finds nothing is declared.
        let found = Estimate::new("from_m", "m", -1.0, (-100.0, 0.0)).not_identifiable();
        assert_eq!(of_unknown_shape(&downwash, &[size, reach, found]), None);
    }

    #[test]
    fn what_repeats_share_is_not_independent_from_frame_to_frame() {
        let of = |greatest_ratio| {
            let least_ratio = 2.0 - greatest_ratio;
            PureError { remaining: 1.0, pure: 1.0, least_ratio, greatest_ratio }
        };
        assert!(is_independent(Some(of(1.2))));
        assert!(!is_independent(Some(of(1.7))) && !is_independent(None));
    }
}
