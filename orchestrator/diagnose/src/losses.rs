//! What holds of two answers about one campaign: as if reception had no part in what was logged, and as if received frames alone had
//! been logged. Where nobody knows whether lost frames were logged, only that is certain which both say.

use crate::diagnosis::{Diagnosis, NextMeasurement, Structure, Verdict};
use crate::words;
use std::collections::BTreeSet;

/// Why what one answer alone says is not certain.
const IT_DEPENDS: &str = "it depends on whether lost frames were logged";

/// The first answer, as far as the other says the same.
pub(crate) fn agreed(mut found: Diagnosis, other: &Diagnosis) -> Diagnosis {
    let names = |one: &Diagnosis| -> BTreeSet<String> {
        let structure = one.unexplained.iter().map(Structure::named);
        one.missing.iter().cloned().chain(structure).collect()
    };
    if names(&found) == names(other) && found.verdict == other.verdict {
        widen(&mut found, other);
        return found;
    }
    let [either, or] = [other, &found].map(words::first_sentence);
    let is_in_both = |name: &String| other.missing.contains(name);
    let (certain, one_sided): (Vec<String>, Vec<String>) =
        found.missing.drain(..).partition(is_in_both);
    let only_there = other.missing.iter().filter(|name| !certain.contains(name)).cloned();
    found.possible = one_sided;
    found.possible.extend(only_there);
    found.possible_because = vec![IT_DEPENDS.to_owned(); found.possible.len()];
    found.unexplained.retain(|one| other.unexplained.iter().any(|it| it.named() == one.named()));
    for candidate in &mut found.candidates {
        let is_named =
            certain.iter().any(|name| name.split(" or ").any(|one| one == candidate.effect));
        let is_structure =
            candidate.effect.starts_with(study::CURVE) && !found.unexplained.is_empty();
        if candidate.accepted && !is_named && !is_structure {
            candidate.doubt = Some(IT_DEPENDS.to_owned());
        }
    }
    let either_way = match &certain[..] {
        [] => String::new(),
        certain => format!("missing either way: {}. ", certain.join(", ")),
    };
    found.too_little = Some(format!(
        "{either_way}Whether lost frames were logged is not known, and decides: if received frames alone were logged, {either}; if reception \
         had no part in it, {or}. Say which with --losses"
    ));
    found.missing = certain;
    found.missing_one_of.retain(|names| found.missing.contains(&names.join(" or ")));
    found.complete &= other.complete;
    found.verdict = if found.unexplained.is_empty() {
        Verdict::of_missing(&found.missing, &found.missing_one_of).unwrap_or(Verdict::NothingFound)
    } else {
        Verdict::UnexplainedStructure
    };
    found.sentence = found.too_little.clone().unwrap_or_default();
    found.next_measurement.insert(0, logged_losses(found.error_unit));
    widen(&mut found, other);
    found
}

/// What would tell which of two answers holds.
fn logged_losses(unit: &'static str) -> NextMeasurement {
    let between = ["received frames alone were logged", "reception had no part in it"];
    let sentence = "to distinguish the two answers, log lost frames too: each sender's sequence numbers or counts of sent frames are enough";
    NextMeasurement::of_new_conditions(
        between.map(str::to_owned),
        "losses_logged".to_owned(),
        unit,
        sentence.to_owned(),
    )
}

/// Intervals that hold either way.
fn widen(found: &mut Diagnosis, other: &Diagnosis) {
    for candidate in found.candidates.iter_mut().filter(|candidate| candidate.accepted) {
        let same = other
            .accepted()
            .find(|it| (&it.effect, &it.only) == (&candidate.effect, &candidate.only));
        for (key, parameter) in &mut candidate.parameters {
            if let Some(it) = same.and_then(|same| same.parameters.get(key)) {
                parameter.low = parameter.low.min(it.low);
                parameter.high = parameter.high.max(it.high);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_that_differ_by_what_was_logged_are_told_apart_by_logging_it() {
        let advice = logged_losses("dB");
        assert!(advice.sentence.contains("log lost frames too"));
        assert!(advice.rows.is_none() && advice.difference.is_nan());
        assert_eq!(advice.covariate, "losses_logged");
    }
}
