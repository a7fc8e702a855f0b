//! Defects of the measurement in a diagnosis of links: what is wrong with the data rather than with the model.
//!
//! They are looked for under the model as configured. Those found are tested again under the model with every effect that a search of
//! the measurements as they are accepts: what a physical effect explains is no defect. The answer is then that of a search
//! of the corrected measurements.

use crate::answer::parameter;
use crate::diagnosis::{Diagnosis, Parameter, Tested, Verdict};
use crate::ladder::Search;
use crate::progress::SearchProgress;
use crate::{json_number, words};
use indexmap::IndexMap;
use measure::Rejected;
use measure::account::DataAccount;
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write as _;
use study::defects::evidence::Evidence;
use study::defects::{self, Correction, Defect, PREFIX, node_place};
use study::links::LinkStudy;
use study::{COMMON, Study as _, TermId};

/// A defect of the measurement.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MeasurementDefect {
    /// Its name: `measurement:register-floor`.
    pub name: String,
    /// What is wrong, as a clause.
    pub sentence: String,
    /// Probability of as strong a sign without the defect, before correction for the number of kinds.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
    /// The share of the squared error that it explains, or of the rows that it concerns, whichever is greater.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub share: f64,
    /// Its numbers by key, such as `shift_s`.
    pub parameters: IndexMap<String, Parameter>,
    /// Nodes that it concerns; empty: all.
    pub nodes: Vec<u32>,
    /// Runs that it concerns; empty: all.
    pub runs: Vec<u32>,
    /// Number of rows concerned.
    pub rows: usize,
    /// Line of the first of them.
    pub first_line: usize,
    /// Number of rows that were left out.
    pub left_out: usize,
    /// Number of rows that were changed.
    pub changed: usize,
    /// How the measurements were corrected.
    pub correction: String,
}

impl MeasurementDefect {
    /// Of a defect that was found.
    #[must_use]
    pub fn of(defect: &Defect) -> Self {
        let Correction { left_out, replaced, .. } = &defect.correction;
        Self {
            name: format!("{PREFIX}{}", defect.name),
            sentence: defect.clause.clone(),
            p_value: defect.p_value,
            share: defect.share,
            parameters: defect.estimates.iter().map(parameter).collect(),
            nodes: defect.nodes.clone(),
            runs: defect.runs.clone(),
            rows: defect.n_rows,
            first_line: defect.first_line,
            left_out: left_out.len(),
            changed: replaced.len(),
            correction: correction_in_words(&defect.correction),
        }
    }

    /// The defect as a person reads it on a terminal.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = format!(
            "{}: {} (p = {:.1e}; {} rows, first on line {})",
            self.name, self.sentence, self.p_value, self.rows, self.first_line
        );
        for (key, parameter) in &self.parameters {
            let _ = write!(text, ". {key} = {:.4}", parameter.value);
            if !parameter.unit.is_empty() {
                let _ = write!(text, " {}", parameter.unit);
            }
            if parameter.low < parameter.high {
                let _ = write!(text, " (90 %: {:.4} to {:.4})", parameter.low, parameter.high);
            }
        }
        let _ = write!(text, ". {}", self.correction);
        text
    }
}

/// How measurements are corrected, in words.
fn correction_in_words(correction: &Correction) -> String {
    let mut parts = Vec::new();
    if !correction.replaced.is_empty() {
        parts.push(format!("{} changed", rows(correction.replaced.len())));
    }
    if !correction.left_out.is_empty() {
        parts.push(format!("{} left out", rows(correction.left_out.len())));
    }
    if correction.limits_dbm.is_some() {
        parts.push("readings at the end are bounds of the power".to_owned());
    }
    if parts.is_empty() {
        parts.push("these rows are left out whenever the file is read".to_owned());
    }
    format!("Correction: {}", parts.join(", "))
}

fn rows(n: usize) -> String {
    if n == 1 { "1 row".to_owned() } else { format!("{n} rows") }
}

/// The clauses of all defects, if there are any.
pub(crate) fn clauses(defects: &[MeasurementDefect]) -> Option<String> {
    let clauses: Vec<&str> = defects.iter().map(|defect| defect.sentence.as_str()).collect();
    (!clauses.is_empty()).then(|| clauses.join("; "))
}

/// The defects of measured links. Only where some are suspected, the measurements as they are are searched for effects that explain
/// them. Where that search is stopped, what was suspected is returned, wrong places apart.
///
/// One defect makes others appear: where a node stands elsewhere, the clock of one that passes it seems to drift. Of those that change rows
/// the one that explains most is taken, and the others are looked for again in changed rows; what leaves rows out comes last.
pub(crate) fn find(study: &LinkStudy, report: &(dyn Fn(SearchProgress<'_>) + Sync)) -> Vec<Defect> {
    let mut before = Correction::default();
    let mut seen = under(study, &[], &before);
    if seen.is_empty() {
        return seen;
    }
    for defect in &seen {
        tracing::info!(name = defect.name, p = defect.p_value, "suspected");
    }
    let thin = study.thinned();
    let searched = thin.as_ref().unwrap_or(study);
    let search = Search::new(searched, report);
    let ladder = search.stepwise_selection();
    if ladder.stopped.is_some() {
        // A wall that the model lacks looks like a wrong place, too.
        seen.retain(|defect| !is_place(defect));
        return seen;
    }
    let names = |terms: &[TermId]| -> Vec<&str> {
        terms.iter().map(|&term| searched.candidates()[term].name.as_str()).collect()
    };
    let accepted = names(&ladder.accepted);
    let (mut found, mut changed): (Vec<Defect>, Option<LinkStudy>) = (Vec::new(), None);
    loop {
        let now = changed.as_ref().unwrap_or(study);
        let (places, others): (Vec<Defect>, Vec<Defect>) = seen.into_iter().partition(is_place);
        // A curve, or an effect that moves hardly anything but the rows of one node, is less simple than its place.
        let is_rival = |term: &TermId| {
            searched.candidates()[*term].curve_over().is_none()
                && !matches!(search.only_node_of(*term, &ladder.accepted),
                    Some(node) if places.iter().any(|place| place.nodes == [node]))
        };
        let rivals: Vec<TermId> = ladder.accepted.iter().copied().filter(is_rival).collect();
        let mut new = confirmed(now, &names(&rivals), places, &before);
        new.extend(confirmed(now, &accepted, others, &before));
        let moving = new.iter().filter(|defect| !defect.correction.replaced.is_empty());
        let Some(most) = moving.max_by(|a, b| a.share.total_cmp(&b.share)).cloned() else {
            found.extend(new);
            return found;
        };
        found.push(most);
        // Rows that are left out stay until the end, so that each keeps its number.
        before = joint_correction(&found);
        let replaced = before.replaced.clone();
        let corrected = study.corrected(&Correction { replaced, ..Correction::default() });
        let Ok(Some(corrected)) = corrected else { return found };
        seen = under(&corrected, &[], &before);
        seen.retain(|defect| found.iter().all(|it| !is_same(it, defect)));
        changed = Some(corrected);
    }
}

fn is_place(defect: &Defect) -> bool {
    defect.name == node_place::NAME
}

/// Whether two defects are of one kind, and concern the same nodes and runs.
fn is_same(one: &Defect, other: &Defect) -> bool {
    (one.name, &one.nodes, &one.runs) == (other.name, &other.nodes, &other.runs)
}

/// Defects under the model with some terms, its level and noise fitted, beside what was corrected already.
fn under(study: &LinkStudy, terms: &[TermId], before: &Correction) -> Vec<Defect> {
    let fit = study.fit(terms, &study.fitted_rows(), COMMON, None);
    Evidence::new(study, &fit).map_or_else(Vec::new, |evidence| defects::found(&evidence, before))
}

/// The suspected defects that are significant under the model with the accepted terms, too, each by its name. Of both p-values the greater
/// counts.
#[must_use]
fn confirmed(
    study: &LinkStudy,
    accepted: &[&str],
    suspected: Vec<Defect>,
    before: &Correction,
) -> Vec<Defect> {
    let candidates = study.candidates();
    let is_accepted = |term: &TermId| accepted.contains(&candidates[*term].name.as_str());
    let terms: Vec<TermId> = candidates.ids().filter(is_accepted).collect();
    if terms.is_empty() || suspected.is_empty() {
        return suspected;
    }
    let again = under(study, &terms, before);
    suspected
        .into_iter()
        .filter_map(|defect| {
            let other = again.iter().find(|other| is_same(other, &defect))?;
            Some(Defect { p_value: defect.p_value.max(other.p_value), ..defect })
        })
        .collect()
}

/// Defects under the model as configured, as answers list them.
#[must_use]
pub fn listed(study: &LinkStudy) -> Vec<MeasurementDefect> {
    let found = under(study, &[], &Correction::default());
    found.iter().map(MeasurementDefect::of).collect()
}

/// The corrections of all defects.
#[must_use]
pub(crate) fn joint_correction(defects: &[Defect]) -> Correction {
    defects.iter().fold(Correction::default(), |all, defect| all.and(&defect.correction))
}

/// The account of the corrected measurements: rows that were left out are listed by their defect.
#[must_use]
pub(crate) fn corrected_account(account: &DataAccount, defects: &[Defect]) -> DataAccount {
    let mut account = account.clone();
    account.used -= joint_correction(defects).left_out.len();
    account.rejected.extend(defects.iter().filter(|it| !it.correction.left_out.is_empty()).map(
        |defect| Rejected {
            reason: format!("{PREFIX}{}", defect.name),
            rows: defect.correction.left_out.len(),
            first_line: defect.first_line,
        },
    ));
    account
}

/// A diagnosis of corrected measurements with the defects that were corrected: first among what is missing, and as candidates
/// that were accepted.
#[must_use]
pub(crate) fn with_defects(mut diagnosis: Diagnosis, found: &[Defect]) -> Diagnosis {
    if found.is_empty() {
        return diagnosis;
    }
    let listed: Vec<MeasurementDefect> = found.iter().map(MeasurementDefect::of).collect();
    let names = listed.iter().map(|defect| defect.name.clone());
    diagnosis.missing = names.chain(diagnosis.missing).collect();
    if diagnosis.verdict == Verdict::NothingMissing && diagnosis.too_little.is_none() {
        diagnosis.verdict = Verdict::MissingEffects;
    }
    let candidates = listed.iter().map(|defect| Tested {
        effect: defect.name.clone(),
        held_out: "none",
        gain: f64::NAN,
        standard_error: f64::NAN,
        p_value: defect.p_value,
        accepted: true,
        doubt: None,
        directions: None,
        upper: None,
        detectable: None,
        only: None,
        indistinguishable_from: Vec::new(),
        warning: None,
        parameters: defect.parameters.clone(),
        not_identifiable: Vec::new(),
        settings: None,
        untestable: None,
    });
    diagnosis.candidates = candidates.chain(diagnosis.candidates).collect();
    diagnosis.measurement_defects = listed;
    diagnosis.sentence = words::sentence(&diagnosis);
    diagnosis
}
