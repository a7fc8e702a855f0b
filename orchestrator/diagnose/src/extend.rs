//! Writes a configuration with a missing effect added, fitted.

pub mod extension;

use crate::answer::numbers;
use crate::gain::Scores;
use crate::ladder::Search;
use crate::measured::Measured;
use ::numbers::format::with_unit;
use extension::{Extension, SCHEMA};
use measure::config::Compared;
use std::fmt::Write as _;
use study::open::DataAccount;
use study::{COMMON, Study, TermId};

/// Why nothing can be added.
#[derive(Debug, thiserror::Error)]
pub enum ExtendError {
    /// There is no such candidate.
    #[error("{name:?} is not an effect of this model; {hint}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// What there is.
        hint: String,
    },
    /// It cannot be tested.
    #[error("{name} cannot be fitted to these data: it {why}")]
    Untestable {
        /// What was asked for.
        name: String,
        /// What is lacking.
        why: String,
    },
    /// Nothing was accepted.
    #[error("nothing to add: diagnose accepts no effect on these data")]
    Nothing,
}

/// A configuration with effects added.
#[derive(Clone, Debug)]
pub struct ExtendedConfig {
    /// The new file's text.
    pub text: String,
    /// What was added, and what it gains.
    pub answer: Extension,
}

/// The candidate of a name.
///
/// # Errors
///
/// There is none, or the data do not suffice for it.
pub(crate) fn candidate<S: Study>(study: &S, name: &str) -> Result<TermId, ExtendError> {
    let candidates = study.candidates();
    let found = candidates
        .find(|candidate| candidate.name == name && candidate.curve_over().is_none())
        .ok_or_else(|| {
            let names = candidates
                .iter()
                .filter(|candidate| candidate.curve_over().is_none())
                .map(|candidate| candidate.name.as_str());
            let hint = proto::config::most_similar(name, names.clone()).map_or_else(
                || format!("choose from {}", names.collect::<Vec<_>>().join(", ")),
                |nearest| format!("did you mean {nearest}?"),
            );
            ExtendError::Unknown { name: name.to_owned(), hint }
        })?;
    match &candidates[found].untestable {
        Some(why) => Err(ExtendError::Untestable { name: name.to_owned(), why: why.clone() }),
        None => Ok(found),
    }
}

/// Fits several new terms in two ways, and keeps the likelier fit. Together, each term starts where it would by itself. One after
/// the other, each starts from the residuals of those before it: a disturbed band shows only once the reception curve is right.
fn fit_together<S: Study>(study: &S, search: &Search<'_, S>, terms: &[TermId]) {
    if terms.len() < 2 || search.is_stopped() {
        return;
    }
    let all = study.fitted_rows();
    let mut best = study.fit(terms, &all, COMMON, None);
    let mut parent = None;
    for n in 1..=terms.len() {
        parent = Some(study.fit(&terms[..n], &all, COMMON, parent.as_ref()));
    }
    if let Some(stepwise) = parent
        && study.log_likelihood(&best) < study.log_likelihood(&stepwise)
    {
        best = stepwise;
    }
    search.full_fit(terms, COMMON, Some(&best));
}

/// The configuration with terms added: the text as it was, then the new sections with the fit's provenance.
///
/// * `all_rows`: the study of all rows, if the search used some of them only.
///
/// # Errors
///
/// There is nothing to add.
pub(crate) fn extended_config<S: Measured>(
    (config, account): (&Compared, &DataAccount),
    study: &S,
    search: &Search<'_, S>,
    terms: &[TermId],
    all_rows: Option<&S>,
) -> Result<ExtendedConfig, ExtendError> {
    let candidates = study.candidates();
    let terms: Vec<TermId> =
        terms.iter().copied().filter(|&term| candidates[term].curve_over().is_none()).collect();
    if terms.is_empty() {
        return Err(ExtendError::Nothing);
    }
    fit_together(study, search, &terms);
    let (measured, fit) = numbers(search, study, all_rows, &terms);
    let before = Scores::mean(&search.held_out_scores(&[], COMMON));
    let after = Scores::mean(&search.held_out_scores(&terms, COMMON));
    let mut text = config.text.trim_end().to_owned();
    text.push('\n');
    let complete = !search.is_stopped();
    if !complete {
        text.push_str(
            "\n# The search was stopped before its end: further effects may be missing.\n",
        );
    }
    let mut names = Vec::new();
    for &term in &terms {
        let name = &candidates[term].name;
        names.push(name.clone());
        let (estimates, warning) = measured.estimates(&fit, term);
        let _ = write!(
            text,
            "\n# {name}: fitted to {} (SHA-256 {}), {} of {} rows.\n# Held-out log score {:.4} before and {:.4} with all \
             added effects; rmse {:.4} and {:.4}.\n",
            account.data.file,
            account.data.sha256,
            account.used,
            account.rows,
            before.log_score,
            after.log_score,
            before.rmse,
            after.rmse,
        );
        for estimate in estimates.iter().filter(|estimate| estimate.is_identifiable) {
            let _ = writeln!(
                text,
                "# {} = {}, 90 % interval {:.4} to {:.4}",
                estimate.name,
                with_unit(&format!("{:.4}", estimate.value), &estimate.unit),
                estimate.low,
                estimate.high
            );
        }
        if let Some(warning) = warning {
            let _ = writeln!(text, "# warning: {warning}");
        }
        let _ = writeln!(text, "[[{}]]", S::EFFECT_SECTION);
        // Tables within it stay on one line: a heading would begin a section of its own.
        for (key, value) in measured.settings(&fit, term).iter().flatten() {
            let _ = writeln!(text, "{key} = {value}");
        }
    }
    let answer = Extension {
        schema: SCHEMA,
        added: names,
        complete,
        log_score: [before.log_score, after.log_score],
        rmse: [before.rmse, after.rmse],
        error_unit: study.error_unit(),
    };
    Ok(ExtendedConfig { text, answer })
}
