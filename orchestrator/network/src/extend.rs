//! Writes an experiment with effects on its network added, fitted to measured packets.

use super::candidate_fits::FittedEffect;
use super::candidates::CandidateEffect;
use super::extension::{NetworkExtension, SCHEMA};
use super::resimulate::ResimulationError;
use super::search::{NetworkSearch, RequestedEffects, SearchStep, parameters};
use diagnose::extend::ExtendError;
use experiment::{Acts, Overrides};
use numbers::format::with_unit;
use proto::config::Refusal;
use std::fmt::Write as _;
use std::path::Path;
use study::open::DataAccount;

/// Why nothing can be written.
#[derive(Debug, thiserror::Error)]
pub enum NetworkExtendError {
    /// There is nothing to add, or no such effect.
    #[error(transparent)]
    Extend(#[from] ExtendError),
    /// The network refuses it.
    #[error(transparent)]
    Resimulation(#[from] ResimulationError),
    /// The text would be no configuration: its tables are written so that none can follow.
    #[error("the effects cannot be appended to this file: {0}")]
    Text(#[from] Refusal),
}

/// An experiment with effects added.
#[derive(Clone, Debug)]
pub(crate) struct ExtendedNetwork {
    /// The new file's text.
    pub text: String,
    /// The effects that were added, each with its fit.
    pub added: Vec<(CandidateEffect, FittedEffect)>,
    /// The models before and after.
    pub rungs: [SearchStep; 2],
}

impl ExtendedNetwork {
    /// What was added, as an answer.
    #[must_use]
    pub(crate) fn answer(&self) -> NetworkExtension {
        let numbers = self.added.iter();
        NetworkExtension {
            schema: SCHEMA,
            kind: "network",
            added: self.added.iter().map(|(candidate, _)| candidate.name).collect(),
            parameters: numbers
                .map(|(candidate, fitted)| (candidate.name, parameters(candidate, fitted)))
                .collect(),
            p_value: self.rungs.each_ref().map(|rung| rung.among.placed.p_value),
            log_score: self.rungs.each_ref().map(|rung| rung.log_density),
        }
    }
}

/// The candidate of a name.
///
/// # Errors
///
/// There is none.
pub(crate) fn candidate(candidates: &[CandidateEffect], name: &str) -> Result<usize, ExtendError> {
    candidates.iter().position(|candidate| candidate.name == name).ok_or_else(|| {
        let names = || candidates.iter().map(|candidate| candidate.name);
        let hint = proto::config::most_similar(name, names()).map_or_else(
            || format!("choose from {}", names().collect::<Vec<_>>().join(", ")),
            |nearest| format!("did you mean {nearest}?"),
        );
        ExtendError::Unknown { name: name.to_owned(), hint }
    })
}

/// Fits effects and adds them to the text of an experiment.
///
/// # Errors
///
/// See [`NetworkExtendError`].
pub(crate) fn extend(
    diagnosis: &NetworkSearch<'_>,
    effects: &[usize],
    (path, text): (&Path, &str),
    account: &DataAccount,
) -> Result<ExtendedNetwork, NetworkExtendError> {
    if effects.is_empty() {
        return Err(ExtendError::Nothing.into());
    }
    let RequestedEffects { fitted: added, rungs } = diagnosis.fit(effects)?;
    let [before, after] = rungs.each_ref().map(|rung| rung.among.placed.p_value);
    let mut text = text.trim_end().to_owned();
    text.push('\n');
    for (candidate, fitted) in &added {
        let name = candidate.name;
        let [low, high] = fitted.interval;
        let _ = write!(
            text,
            "\n# {name}: fitted to {} (SHA-256 {}), {} of {} rows.\n# Consistency of these packets with the model: p = \
             {before:.3} before, {after:.3} with all added effects.\n# {} = {}, 90 % interval {low:.4} to \
             {high:.4}\n[[netsim.{}.effect]]\n{}",
            account.data.file,
            account.data.sha256,
            account.used,
            account.rows,
            candidate.parameter.key,
            with_unit(&fitted.value.to_string(), candidate.parameter.unit),
            candidate.layer,
            candidate.settings(fitted.value)
        );
    }
    experiment::read(path, text.clone(), &Overrides::default().acting(Acts::Nothing))?;
    Ok(ExtendedNetwork { text, added, rungs })
}
