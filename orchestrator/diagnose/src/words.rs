//! A diagnosis in words: its sentence, and the text of the terminal.

use super::defects;
use super::diagnosis::{
    Diagnosis, Directions, NearestEffect, Parameter, Structure, Tested, Verdict,
};
use super::gate::{Misfit, decimals};
use indexmap::IndexMap;
use numbers::format::{capitalised, with_unit, wrapped};
use numbers::layout::{TextTable, WIDTH};
use std::fmt::Write as _;
use study::defects::PREFIX;
use study::thresholds::PLAIN_ERROR_SHARE;

/// What a diagnosis came to: the verdict in a sentence, and in further ones what is possible beside it, with the reason why it is not certain.
#[must_use]
pub fn sentence(diagnosis: &Diagnosis) -> String {
    let first = first_sentence(diagnosis);
    if is_before_any_result(diagnosis) {
        return first;
    }
    [first]
        .into_iter()
        .chain(further(diagnosis).iter().map(|it| capitalised(it)))
        .collect::<Vec<_>>()
        .join(". ")
}

/// The verdict in a sentence.
pub(crate) fn first_sentence(diagnosis: &Diagnosis) -> String {
    // What a search that was stopped has not found may be there.
    let is_open = !diagnosis.complete
        && diagnosis.possible.is_empty()
        && matches!(diagnosis.verdict, Verdict::NothingFound | Verdict::NothingMissing);
    let found =
        if is_open { "no effect was found until then".to_owned() } else { verdict(diagnosis) };
    let found = match defects::clauses(&diagnosis.measurement_defects) {
        Some(clauses) => {
            format!("the measurement is wrong: {clauses}. With that corrected, {found}")
        }
        None => found,
    };
    match diagnosis.stopped_in_round {
        None if diagnosis.complete => found,
        None => format!("stopped after the search; what follows from it may still change: {found}"),
        Some(round) if is_before_any_result(diagnosis) => {
            format!("stopped in round {round}, before any result")
        }
        Some(round) => {
            format!("stopped in round {round}; partial result, which may still change: {found}")
        }
    }
}

fn is_before_any_result(diagnosis: &Diagnosis) -> bool {
    diagnosis.stopped_in_round.is_some() && diagnosis.ladder.len() < 2
}

/// The verdict of a complete search on measurements without defects.
fn verdict(diagnosis: &Diagnosis) -> String {
    let missing = effects(diagnosis).join(", then ");
    match (&diagnosis.too_little, diagnosis.verdict) {
        (None, Verdict::SomethingMissing) if diagnosis.misfits.is_empty() => {
            format!("something is missing: {}", structures(diagnosis.unexplained.iter()))
        }
        (why, Verdict::SomethingMissing) => {
            let why = why.as_ref().map(|why| format!(" ({why})")).unwrap_or_default();
            let misfit = diagnosis.misfits.first().map(Misfit::sentence).unwrap_or_default();
            format!("something is missing, and these data do not say what: {misfit}{why}")
        }
        (Some(why), _) => why.clone(),
        (None, Verdict::NothingFound) if !diagnosis.possible.is_empty() => {
            "nothing is certain".to_owned()
        }
        (None, Verdict::NothingFound) if diagnosis.could_hide.is_nan() => {
            "nothing was found, but these data are too few to tell how great an error could hide in them"
                .to_owned()
        }
        (None, Verdict::NothingFound) => format!(
            "nothing was found, but these data are too few to tell: an error of up to {:.2} {} could hide in them",
            diagnosis.could_hide, diagnosis.error_unit
        ),
        (None, Verdict::NothingMissing) => {
            format!("no missing effect is detectable in these data{}", at_most(diagnosis))
        }
        (None, Verdict::MissingEffects) if missing.is_empty() => {
            "no missing effect is detectable".to_owned()
        }
        (None, Verdict::MissingEffects | Verdict::MissingOneOf) => {
            let ties = if diagnosis.missing_one_of.is_empty() {
                ""
            } else {
                " (these data cannot tell which)"
            };
            format!("missing: {missing}{ties}")
        }
        (None, Verdict::UnexplainedStructure) => {
            let certain = diagnosis.unexplained.iter().filter(|it| it.is_certain());
            format!("found {}, which no known effect explains", structures(certain))
        }
    }
}

/// What follows the verdict, each a sentence.
fn further(diagnosis: &Diagnosis) -> Vec<String> {
    let mut all = Vec::new();
    if diagnosis.too_little.is_none() || diagnosis.verdict == Verdict::SomethingMissing {
        let missing = effects(diagnosis).join(", then ");
        if diagnosis.verdict == Verdict::UnexplainedStructure && !missing.is_empty() {
            all.push(format!("also missing: {missing}"));
        }
        let certain = diagnosis.accepted().filter(|candidate| candidate.doubt.is_none());
        all.extend(certain.filter_map(directions));
        all.extend(possible(diagnosis));
        all.extend(open_structure(diagnosis));
    }
    let is_named = matches!(diagnosis.verdict, Verdict::MissingEffects | Verdict::MissingOneOf);
    let misfit = diagnosis.misfits.first().filter(|_| is_named && diagnosis.too_little.is_none());
    all.extend(misfit.map(|it| format!("something else is missing: {}", it.sentence())));
    all
}

/// How much weaker one direction of two nodes is, and what that cannot be told from.
fn directions(candidate: &Tested) -> Option<String> {
    let Directions { from, to, weaker_by: Parameter { value, low, high, .. } } =
        candidate.directions.as_ref()?;
    Some(format!(
        "frames from node {from} to node {to} arrive {value:.1} dB weaker than from {to} to {from} (90 %: {low:.1} to {high:.1}). Two nodes do \
         not tell a weaker transmitter of {from} from a less sensitive receiver of {to}, nor which direction is right from system-gain"
    ))
}

/// Effects that may be missing, those together that are not certain for one reason.
fn possible(diagnosis: &Diagnosis) -> impl Iterator<Item = String> {
    let is_beside =
        !effects(diagnosis).is_empty() || diagnosis.verdict == Verdict::UnexplainedStructure;
    let also = if is_beside { "also " } else { "" };
    let mut groups: IndexMap<(String, &str), Vec<&str>> = IndexMap::new();
    for (name, why) in diagnosis.possible.iter().zip(&diagnosis.possible_because) {
        let explained = diagnosis.unexplained.iter().find_map(|structure| {
            let cause = structure.possible_cause().filter(|cause| cause.effect == *name)?;
            let percent = 100.0 * cause.share;
            Some(format!(", which would explain {percent:.0} % of {}", structure.named()))
        });
        groups.entry((explained.unwrap_or_default(), why)).or_default().push(name);
    }
    groups.into_iter().map(move |((explained, why), names)| {
        format!("possibly {also}{}{explained}: not certain, because {why}", listed(&names))
    })
}

/// Names in a sentence: `a, b and c`.
fn listed(names: &[&str]) -> String {
    match names {
        [others @ .., last] if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        _ => names.concat(),
    }
}

/// Names of structures, each once.
fn structures<'a>(all: impl Iterator<Item = &'a Structure>) -> String {
    let mut names: Vec<String> = Vec::new();
    for name in all.map(Structure::named) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(", and ")
}

/// Structure whose cause nobody knows to follow its covariate, where the verdict is something else.
fn open_structure(diagnosis: &Diagnosis) -> Vec<String> {
    let is_open = |it: &&Structure| !it.is_certain() && it.possible_cause().is_none();
    let open = || diagnosis.unexplained.iter().filter(is_open);
    let named = match diagnosis.verdict {
        Verdict::UnexplainedStructure => return Vec::new(),
        Verdict::MissingEffects | Verdict::MissingOneOf => structures(open()),
        _ => String::new(),
    };
    let seen = (!named.is_empty()).then(|| format!("something else is missing, seen as {named}"));
    seen.into_iter().chain(open().find_map(|it| it.warning.clone())).collect()
}

/// The effect that may be the largest of those that were not found.
fn at_most(diagnosis: &Diagnosis) -> String {
    let largest = diagnosis.not_found().into_iter().next();
    largest.map_or_else(String::new, |(effect, upper, _)| {
        format!(
            "; of those tested, {effect} may be the largest, with at most {}",
            with_unit(&size(upper), diagnosis.error_unit)
        )
    })
}

/// A size with two digits.
fn size(value: f64) -> String {
    format!("{value:.*}", decimals(value, 0.0))
}

/// Names of the effects that are missing, defects of the measurement apart.
fn effects(diagnosis: &Diagnosis) -> Vec<&str> {
    let is_effect = |name: &&str| !name.starts_with(PREFIX);
    diagnosis.missing.iter().map(String::as_str).filter(is_effect).collect()
}

/// A diagnosis as a person reads it on a terminal.
#[must_use]
pub fn text(diagnosis: &Diagnosis) -> String {
    let mut text = format!("{}\n\n", diagnosis.sentence);
    ladder(&mut text, diagnosis);
    plain_error(&mut text, diagnosis);
    let _ = writeln!(text);
    for defect in &diagnosis.measurement_defects {
        let _ = writeln!(text, "{}", defect.text());
    }
    let is_effect = |candidate: &&Tested| !candidate.effect.starts_with(PREFIX);
    for candidate in diagnosis.accepted().filter(is_effect) {
        accepted(&mut text, candidate, diagnosis);
    }
    for (place, structure) in diagnosis.unexplained.iter().enumerate() {
        unexplained(&mut text, structure, &diagnosis.unexplained[..place]);
    }
    not_found(&mut text, diagnosis);
    untestable(&mut text, diagnosis);
    for misfit in &diagnosis.misfits {
        let _ = writeln!(
            text,
            "wrong: {}, +- {:.*} (p = {:.1e})",
            misfit.sentence(),
            4,
            misfit.standard_error,
            misfit.p_value
        );
    }
    for next in &diagnosis.next_measurement {
        let _ = writeln!(text, "{}", next.sentence);
    }
    text
}

fn ladder(text: &mut String, diagnosis: &Diagnosis) {
    let unit = diagnosis.error_unit;
    let first = diagnosis.ladder.first();
    if first.is_none() {
        return;
    }
    let has_losses = first.is_some_and(|rung| !rung.reception_log_loss.is_nan());
    let has_headings = first.is_some_and(|rung| rung.rmse_heading_rad.is_some());
    let head = format!("model ({} held out)", diagnosis.split);
    let headings = [head, "log score".to_owned(), format!("rmse {unit}"), format!("crps {unit}")];
    let loss = has_losses.then(|| "reception loss".to_owned());
    let heading = has_headings.then(|| "rmse heading rad".to_owned());
    let mut table = TextTable::new(headings.into_iter().chain(loss).chain(heading));
    for rung in &diagnosis.ladder {
        let loss = has_losses.then_some(rung.reception_log_loss);
        let numbers = [rung.log_score, rung.rmse, rung.crps].into_iter().chain(loss);
        let numbers = numbers.chain(rung.rmse_heading_rad).map(|number| format!("{number:.4}"));
        table.row(std::iter::once(rung.model.clone()).chain(numbers));
    }
    text.push_str(&table.text());
}

/// The plain error of received frames, where the error about the mean reading of received frames is another.
fn plain_error(text: &mut String, diagnosis: &Diagnosis) {
    let (Some(first), Some(last)) = (diagnosis.ladder.first(), diagnosis.ladder.last()) else {
        return;
    };
    let (Some(before), Some(after)) = (first.rmse_received_db, last.rmse_received_db) else {
        return;
    };
    if (first.rmse / before - 1.0).abs() <= PLAIN_ERROR_SHARE {
        return;
    }
    let with = if diagnosis.ladder.len() < 2 {
        String::new()
    } else {
        format!(", {after:.4} dB with all that was accepted")
    };
    let _ = writeln!(
        text,
        "plain error of received frames (reading less mean level): {before:.4} dB as configured{with}"
    );
}

/// Parameters in words, and which of them are not identifiable.
fn numbers_of(parameters: &IndexMap<String, Parameter>, not_identifiable: &[String]) -> String {
    let known = parameters.iter().map(|(key, parameter)| {
        let Parameter { value, low, high, unit } = parameter;
        let n = decimals(*value, 4.0);
        let value = with_unit(&format!("{value:.n$}"), unit);
        format!("{key} = {value} (90 %: {low:.n$} to {high:.n$})")
    });
    let unknown = not_identifiable.iter().map(|key| format!("{key} not identifiable"));
    known.chain(unknown).collect::<Vec<_>>().join(", ")
}

fn accepted(text: &mut String, candidate: &Tested, diagnosis: &Diagnosis) {
    let parameters = numbers_of(&candidate.parameters, &candidate.not_identifiable);
    let name = candidate.name();
    let _ = write!(
        text,
        "{name}: gain {:.4} +- {:.4} nats per row ({} held out)",
        candidate.gain, candidate.standard_error, candidate.held_out
    );
    // A curve has no parameters with a meaning.
    if !parameters.is_empty() {
        let _ = write!(text, ". {parameters}");
    }
    let _ = writeln!(text);
    if !candidate.indistinguishable_from.is_empty() {
        let others = candidate.indistinguishable_from.join(", ");
        let _ = writeln!(text, "  indistinguishable on these data from {others}");
        for rival in diagnosis.rivals_of(&name) {
            let numbers = numbers_of(&rival.parameters, &rival.not_identifiable);
            let _ = writeln!(text, "  {} in its place: {numbers}", rival.effect);
        }
    }
    if let Some(directions) = directions(candidate).filter(|_| candidate.doubt.is_some()) {
        let _ = writeln!(text, "  {directions}");
    }
    if let Some(warning) = &candidate.warning {
        let _ = writeln!(text, "  warning: {warning}");
    }
}

/// How large what was not found may be.
fn not_found(text: &mut String, diagnosis: &Diagnosis) {
    let bounded = diagnosis.not_found();
    if bounded.is_empty() {
        return;
    }
    let unit = diagnosis.error_unit;
    let head = "not found (rms over the rows)";
    let heads = [format!("at most {unit}"), format!("detectable from {unit}")];
    let mut table = TextTable::new(std::iter::once(head.to_owned()).chain(heads));
    for (effect, upper, detectable) in bounded {
        table.row([effect.to_owned(), size(upper), size(detectable)]);
    }
    text.push_str(&table.text());
}

/// Effects that these data cannot show, those together that lack the same.
fn untestable(text: &mut String, diagnosis: &Diagnosis) {
    let mut lacking: IndexMap<&str, Vec<&str>> = IndexMap::new();
    for candidate in &diagnosis.candidates {
        if let Some(why) = &candidate.untestable {
            lacking.entry(why).or_default().push(&candidate.effect);
        }
    }
    if !lacking.is_empty() {
        let _ = writeln!(text, "not testable on these data:");
    }
    for (why, effects) in lacking {
        let entry = wrapped(&format!("{} ({why})", effects.join(", ")), "    ", WIDTH);
        let _ = writeln!(text, "  {}", entry.trim_start());
    }
}

/// A structure; what was printed of those `before` is not repeated.
fn unexplained(text: &mut String, structure: &Structure, before: &[Structure]) {
    let same = before.iter().find(|it| it.is_over_same(structure));
    let further = if same.is_some() { "further " } else { "" };
    let error = if structure.is_of_losses() { "log loss of reception" } else { "squared error" };
    let formulas: Vec<String> = structure
        .formulas()
        .map(|(formula, target)| match target {
            "mean" => format!("{formula} dB"),
            "loss" => format!("{formula} of the frames"),
            direction => format!("{formula} m/s {direction}"),
        })
        .collect();
    let colon = if formulas.is_empty() { "" } else { ": " };
    let _ = writeln!(
        text,
        "unexplained: {further}{} explains {:.1} % of the {error}{colon}{}",
        structure.named(),
        100.0 * structure.share(),
        formulas.join(", and ")
    );
    let is_new = |nearest: &&NearestEffect| {
        let other = same.and_then(|same| same.nearest_effect.as_ref());
        other.is_none_or(|other| other.effect != nearest.effect)
    };
    if let Some(nearest) = structure.nearest_effect.as_ref().filter(is_new) {
        let _ = writeln!(
            text,
            "  nearest known effect: {}, {:.0} % of its gain; not accepted, because {}",
            nearest.effect,
            100.0 * nearest.share,
            nearest.why_not
        );
    }
    let is_new = |why: &&String| same.is_none_or(|same| same.warning.as_ref() != Some(why));
    if let Some(warning) = structure.warning.as_ref().filter(is_new) {
        let _ = writeln!(text, "  warning: {warning}");
    }
}

#[cfg(test)]
mod tests;
