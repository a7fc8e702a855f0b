//! What changed, in words: the sentence, and the text of the terminal.

use super::{Between, BetweenVerdict, Change, Changed, SidesOf, Spans};
use crate::defects::MeasurementDefect;
use crate::diagnosis::Parameter;
use crate::gate::Misfit;
use std::fmt::Write as _;
use study::thresholds::{DOUBTFUL_LEVEL, FEWEST_REPLICATES};

/// The verdict on two campaigns in a sentence.
#[must_use]
pub fn sentence(between: &Between) -> String {
    let list =
        |changes: &[Change]| changes.iter().map(change_sentence).collect::<Vec<_>>().join(", and ");
    let mut text = match between.verdict {
        BetweenVerdict::Changed => format!("changed: {}", list(&between.changed)),
        BetweenVerdict::CannotTell if has_defects(between) => defective(between),
        BetweenVerdict::CannotTell => format!(
            "{} differ: {}{}",
            if has_few_recordings(between) { "these recordings" } else { "A and B" },
            list(&between.possible),
            not_certain(&between.possible)
        ),
        BetweenVerdict::SomethingChanged => something_changed(between),
        BetweenVerdict::NothingChanged | BetweenVerdict::NothingFound if !between.complete => {
            "no change was found until then".to_owned()
        }
        BetweenVerdict::NothingChanged => format!(
            "nothing changed that these data could show: a difference of up to {} {} could hide in them",
            short(between.could_hide),
            between.error_unit
        ),
        BetweenVerdict::NothingFound => nothing_found(between),
    };
    if !between.complete {
        text = format!("stopped before its end; this may still change: {text}");
    }
    if between.verdict != BetweenVerdict::NothingFound {
        text.push_str(&confounding(between));
    }
    text
}

/// Whether a campaign has fewer recordings than tell how much recordings differ by themselves.
fn has_few_recordings(between: &Between) -> bool {
    let SidesOf { a, b } = between.recordings;
    a.min(b) < FEWEST_REPLICATES
}

/// Why changes are not certain, each reason once.
fn not_certain(changes: &[Change]) -> String {
    let mut reasons: Vec<&str> = changes.iter().filter_map(|it| it.doubt.as_deref()).collect();
    reasons.dedup();
    if reasons.is_empty() {
        return String::new();
    }
    format!(". This is not certain, because {}", reasons.join("; "))
}

fn has_defects(between: &Between) -> bool {
    !between.measurement_defects.a.is_empty() || !between.measurement_defects.b.is_empty()
}

/// Defects of the measurement, which may look like changes.
fn defective(between: &Between) -> String {
    let SidesOf { a, b } = &between.measurement_defects;
    let of = |name: &str, list: &[MeasurementDefect]| {
        let sentences: Vec<&str> = list.iter().map(|defect| defect.sentence.as_str()).collect();
        (!list.is_empty()).then(|| format!("the measurement {name}: {}", sentences.join("; ")))
    };
    let defects: Vec<String> = [of("A", a), of("B", b)].into_iter().flatten().collect();
    let changes: Vec<String> =
        between.changed.iter().chain(&between.possible).map(change_sentence).collect();
    let found = if changes.is_empty() {
        String::new()
    } else {
        format!(". Without the correction these look like changes: {}", changes.join(", and "))
    };
    format!(
        "correct the measurements first (extend --corrected-data), because their defects may look like changes: {}{found}",
        defects.join(". ")
    )
}

fn something_changed(between: &Between) -> String {
    let unit = between.error_unit;
    let mut reasons: Vec<String> = between
        .unexplained
        .first()
        .map(|misfit| format!("beyond A, {}", misfit.sentence()))
        .into_iter()
        .collect();
    if let Some(error) = &between.error {
        reasons.push(format!(
            "the model of A predicts B with an error of {} {unit}, and A itself with {} {unit}",
            short(error.rmse_b),
            short(error.rmse_a)
        ));
    }
    format!("something changed, and these data do not show which effect: {}", reasons.join("; "))
}

fn nothing_found(between: &Between) -> String {
    if let Some(why) = &between.too_little {
        return format!("no change was found, but {why}");
    }
    let doubtful = between.error.as_ref().filter(|error| error.doubtful_p_value() < DOUBTFUL_LEVEL);
    if let Some(error) = doubtful {
        let unit = between.error_unit;
        return format!(
            "no change was found, but it is doubtful that there is none: the model of A predicts B with an error of {} {unit}, \
             and A itself with {} {unit} (p = {:.2})",
            short(error.rmse_b),
            short(error.rmse_a),
            error.doubtful_p_value()
        );
    }
    if between.could_hide.is_finite() {
        return format!(
            "no change was found, but these data are too few to exclude one: a difference of up to {} {} could hide in them",
            short(between.could_hide),
            between.error_unit
        );
    }
    "no change was found, but these data are too few to exclude one".to_owned()
}

/// Conditions that the campaigns do not share, whose effects are indistinguishable from a change.
fn confounding(between: &Between) -> String {
    let mut reasons: Vec<String> = between
        .confounded
        .iter()
        .map(|it| {
            let Spans { a, b } = it.spans;
            format!(
                "{} was {} to {} in A and {} to {} in B",
                it.covariate,
                short(a[0]),
                short(a[1]),
                short(b[0]),
                short(b[1])
            )
        })
        .collect();
    if let Some(spans) = between.time_of_day_h.filter(Spans::are_apart) {
        reasons.push(time_of_day(&spans));
    }
    if reasons.is_empty() {
        return String::new();
    }
    format!(
        ". The campaigns do not overlap in these, so their effects are indistinguishable from a change: {}",
        reasons.join("; ")
    )
}

/// When both campaigns were measured, in clock times (UTC).
#[must_use]
pub fn time_of_day(Spans { a, b }: &Spans) -> String {
    let clock = |hours: f64| {
        let minutes = (60.0 * hours).round() as u64 % (24 * 60);
        format!("{:02}:{:02}", minutes / 60, minutes % 60)
    };
    format!(
        "A was measured {} to {} UTC, B {} to {} UTC",
        clock(a[0]),
        clock(a[1]),
        clock(b[0]),
        clock(b[1])
    )
}

fn change_sentence(change: &Change) -> String {
    let of = change.only.as_ref().map(|only| format!(" ({})", limits(only))).unwrap_or_default();
    let parameters: Vec<String> =
        change.parameters.iter().map(|(key, changed)| changed_parameter(key, changed)).collect();
    let colon = if parameters.is_empty() { "" } else { ": " };
    let ties = &change.indistinguishable_from;
    let or = if ties.is_empty() { String::new() } else { format!(", or {}", ties.join(", or ")) };
    format!("{}{of}{colon}{}{or}", change.effect, parameters.join(", "))
}

/// To which nodes or robots a change is limited: `nodes = [3]`.
#[must_use]
pub fn limits(only: &toml::Table) -> String {
    let keys: Vec<String> = only.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    keys.join(", ")
}

fn changed_parameter(key: &str, changed: &Changed) -> String {
    let unit = if changed.unit == NO_UNIT { "" } else { &changed.unit };
    let Parameter { value, low, high, .. } = &changed.b;
    let text = match (&changed.a, &changed.difference) {
        (Some(a), Some(difference)) => format!(
            "{key} {} {unit} in A, {} {unit} in B, difference {} {unit} (90 %: {} to {})",
            short(a.value),
            short(*value),
            short(difference.value),
            short(difference.low),
            short(difference.high)
        ),
        _ => format!(
            "{key} {} {unit} (90 %: {} to {}) in B, absent from A",
            short(*value),
            short(*low),
            short(*high)
        ),
    };
    // Of a number without a unit no space is left in its place.
    text.replace("  ", " ").replace(" ,", ",")
}

/// A parameter with its interval: `payload_kg 0.00250 kg (90 %: 0.00240 to 0.00260)`.
pub(super) fn interval(key: &str, Parameter { value, unit, low, high }: &Parameter) -> String {
    let unit = if unit == NO_UNIT { "" } else { unit };
    let text =
        format!("{key} {} {unit} (90 %: {} to {})", short(*value), short(*low), short(*high));
    text.replace("  ", " ")
}

/// The unit of a number without one.
const NO_UNIT: &str = "1";

/// A number with three digits.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value:.0}");
    }
    let digits = 2.0 - libm::floor(libm::log10(value.abs()));
    format!("{value:.*}", digits.clamp(0.0, 9.0) as usize)
}

/// The answer as a person reads it on a terminal.
#[must_use]
pub fn text(between: &Between) -> String {
    let mut text = String::new();
    let unit = between.error_unit;
    if let Some(error) = &between.error {
        let _ = writeln!(
            text,
            "{:<34} {:>12} {:>10}\n{:<34} {:>12.4} {:>10.4}\n{:<34} {:>12.4} {:>10.4}\n",
            "model fitted to A",
            "log score",
            format!("rmse {unit}"),
            "A (blocks of time held out)",
            error.log_score_a,
            error.rmse_a,
            "B",
            error.log_score_b,
            error.rmse_b
        );
        if let (Some(log_score), Some(rmse)) =
            (error.log_score_b_with_changes, error.rmse_b_with_changes)
        {
            text.pop();
            let _ = writeln!(
                text,
                "{:<34} {log_score:>12.4} {rmse:>10.4}\n",
                "B with the changes (held out)"
            );
        }
    }
    for (what, changes) in [("changed", &between.changed), ("possible change", &between.possible)] {
        for change in changes {
            change_lines(&mut text, what, change);
        }
    }
    for common in &between.common {
        let of = common.only.as_ref().map(|only| format!(" ({})", limits(only)));
        let parameters: Vec<String> = common
            .parameters
            .iter()
            .map(|(key, it)| {
                let Parameter { value, unit, low, high } = it;
                format!("{key} = {value:.4} {unit} (90 %: {low:.4} to {high:.4})")
            })
            .collect();
        let colon = if parameters.is_empty() { "" } else { ": " };
        let _ = writeln!(
            text,
            "missing in both: {}{}{colon}{}",
            common.effect,
            of.unwrap_or_default(),
            parameters.join(", ")
        );
    }
    for same in &between.same {
        let Parameter { unit, low, high, .. } = &same.difference;
        let _ = writeln!(
            text,
            "the same within {} {unit}: {} (B less A, 90 %: {} to {} {unit})",
            short(same.within),
            same.what,
            short(*low),
            short(*high)
        );
    }
    if !between.not_found.is_empty() {
        let _ = writeln!(text, "tested and not found: {}", between.not_found.join(", "));
    }
    for misfit in &between.unexplained {
        let _ = writeln!(
            text,
            "unexplained: beyond A, {}, +- {:.4} (p = {:.1e})",
            Misfit::sentence(misfit),
            misfit.standard_error,
            misfit.p_value
        );
    }
    notes(&mut text, between);
    let _ = writeln!(text, "\n{}", between.sentence);
    text
}

fn change_lines(text: &mut String, what: &str, change: &Change) {
    let _ = writeln!(text, "{what}: {}", change_sentence(change));
    let _ = writeln!(
        text,
        "  gain {:.4} +- {:.4} nats per row (blocks of time held out), p = {:.1e}",
        change.gain, change.standard_error, change.p_value
    );
    if !change.ruled_out.is_empty() {
        let others = change.ruled_out.join(", ");
        let _ = writeln!(text, "  ruled out, because they predict held-out rows worse: {others}");
    }
    if let Some(why) = &change.doubt {
        let _ = writeln!(text, "  not certain, because {why}");
    }
    if let Some(warning) = &change.warning {
        let _ = writeln!(text, "  warning: {warning}");
    }
}

fn notes(text: &mut String, between: &Between) {
    let SidesOf { a, b } = &between.measurement_defects;
    for (name, defect) in a.iter().map(|it| ("A", it)).chain(b.iter().map(|it| ("B", it))) {
        let _ = writeln!(text, "{name}: {}", defect.text());
    }
    match &between.time_of_day_h {
        Some(spans) => {
            let _ = writeln!(text, "{}", time_of_day(spans));
        }
        None => {
            let _ = writeln!(
                text,
                "time of day: unknown. Give time_s as epoch times, or a column start_epoch_s, in both files"
            );
        }
    }
    let [a, b] = [&between.shared.a, &between.shared.b];
    if a.rows + b.rows < a.of + b.of {
        let _ = writeln!(
            text,
            "compared under the conditions that both share: {} of {} rows of A, {} of {} of B",
            a.rows, a.of, b.rows, b.of
        );
    }
    if let Some(caution) = &between.caution {
        let _ = writeln!(text, "note: {caution}");
    }
    for effect in &between.of_time_in_a {
        let _ = writeln!(
            text,
            "A varies with the time since its start ({effect}), which is not carried over to B"
        );
    }
    if !between.left_out_columns.is_empty() {
        let _ = writeln!(
            text,
            "not used, because only one of the files has them: {}",
            between.left_out_columns.join(", ")
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        assert_eq!(short(-5.9871), "-5.99");
        assert_eq!(short(0.012_345), "0.0123");
        assert_eq!(short(1234.5), "1234");
        assert_eq!(short(0.0), "0");
    }

    #[test]
    fn times_of_day_are_clock_times() {
        let spans = Spans { a: [8.0, 10.0], b: [20.25, 23.999] };
        let expected = "A was measured 08:00 to 10:00 UTC, B 20:15 to 00:00 UTC";
        assert_eq!(time_of_day(&spans), expected);
    }

    #[test]
    fn a_change_is_said_with_both_values_and_the_difference() {
        let parameter =
            |value: f64, low: f64, high: f64| Parameter { value, unit: "dB".to_owned(), low, high };
        let b = parameter(-11.0, -11.3, -10.7);
        let difference = Some(parameter(-6.0, -6.4, -5.6));
        let a = Some(parameter(-5.0, -5.2, -4.8));
        let changed = Changed { unit: "dB".to_owned(), a, b: b.clone(), difference };
        assert_eq!(
            changed_parameter("gain_db", &changed),
            "gain_db -5.00 dB in A, -11.0 dB in B, difference -6.00 dB (90 %: -6.40 to -5.60)"
        );
        let new = Changed { unit: "dB".to_owned(), a: None, b, difference: None };
        assert_eq!(
            changed_parameter("gain_db", &new),
            "gain_db -11.0 dB (90 %: -11.3 to -10.7) in B, absent from A"
        );
    }
}
