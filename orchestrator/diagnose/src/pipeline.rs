//! The questions about one campaign, each one function: [`compare()`], [`diagnose()`], [`extend()`]. What they do between reading the
//! measurements and the answer stands here and nowhere else.
//!
//! ```text
//! open → look for defects → correct → thin → identifiability → select effects → scan residuals → answer
//! ```

use crate::answer::{self, Measurements};
use crate::compare::comparison::Comparison;
use crate::corrected_data::CorrectedData;
use crate::defects::{self, MeasurementDefect};
use crate::diagnosis::Diagnosis;
use crate::extend::{self, ExtendError, ExtendedConfig};
use crate::identifiability;
use crate::ladder::{self, Known, Ladder, Search};
use crate::losses;
use crate::measured::{Added, Measured, opened};
use crate::progress::SearchProgress;
use crate::request::{DiagnoseError, Observer, Request, Stopped, stop_flag};
use crate::rows::{self, PredictedRows};
use crate::scan;
use measure::account::DataAccount;
use std::sync::Arc;
use study::TermId;
use study::defects::Defect;
use study::formula::{FORMULA, FormulaRequest};
use study::links::LinkStudy;
use study::open::{self, Subject};
use study::robots::RobotStudy;

/// An answer, and the rows that it is about.
#[derive(Clone, Debug)]
pub struct Answered<A> {
    /// The answer.
    pub answer: A,
    /// The rows that were searched, where the request wants them.
    pub rows: Option<PredictedRows>,
    /// How many rows were searched, where these are some of all; parameters are fitted to all.
    pub subset: Option<usize>,
}

/// Compares the model as configured with the measurements; only the noise is fitted.
///
/// # Errors
///
/// One of the files cannot be used.
pub fn compare(
    request: &Request<'_>,
    observer: &dyn Observer,
) -> Result<Answered<Comparison>, DiagnoseError> {
    match open::subject(request.table)? {
        Subject::Links => compared(&opened::<LinkStudy>(request, observer)?, request, observer),
        Subject::Robots => compared(&opened::<RobotStudy>(request, observer)?, request, observer),
    }
}

fn compared<S: Measured>(
    (study, account): &(S, DataAccount),
    request: &Request<'_>,
    observer: &dyn Observer,
) -> Result<Answered<Comparison>, DiagnoseError> {
    let report = |progress: SearchProgress<'_>| observer.progress(progress);
    let search = Search::new(study, &report);
    let answer = study.comparison(&search, account);
    let rows = request.wants_rows.then(|| rows::predicted(study, &search, &[]));
    Ok(Answered { answer, rows, subset: None })
}

/// Finds the effects that the model lacks.
///
/// A search that is stopped gives the answer that it has until then, with `complete` false.
///
/// # Errors
///
/// One of the files cannot be used.
pub fn diagnose(
    request: &Request<'_>,
    observer: &dyn Observer,
) -> Result<Answered<Diagnosis>, DiagnoseError> {
    match open::subject(request.table)? {
        Subject::Links => diagnosed(opened::<LinkStudy>(request, observer)?, request, observer),
        Subject::Robots => diagnosed(opened::<RobotStudy>(request, observer)?, request, observer),
    }
}

/// The answer; where nobody knows whether lost frames were logged, what holds either way.
fn diagnosed<S: Measured>(
    opened: (S, DataAccount),
    request: &Request<'_>,
    observer: &dyn Observer,
) -> Result<Answered<Diagnosis>, DiagnoseError> {
    let otherwise = opened.0.as_received().map(|study| (study, opened.1.clone()));
    let mut campaign = Campaign::corrected(opened, observer)?;
    campaign.take_subset(request);
    let table = identifiability::table(&Search::new(campaign.searched().0, &|_| {}));
    if let Some(table) = &table {
        observer.identifiability(table);
    }
    let mut found = searched(campaign, request, observer);
    found.answer.identifiability = table;
    let Some(otherwise) = otherwise else { return Ok(found) };
    let mut otherwise = Campaign::corrected(otherwise, observer)?;
    otherwise.take_subset(request);
    let other = searched(otherwise, &Request { wants_rows: false, ..request.clone() }, observer);
    Ok(Answered { answer: losses::agreed(found.answer, &other.answer), ..found })
}

fn searched<S: Measured>(
    mut campaign: Campaign<S>,
    request: &Request<'_>,
    observer: &dyn Observer,
) -> Answered<Diagnosis> {
    let report = |progress: SearchProgress<'_>| observer.progress(progress);
    let (ladder, known) = campaign.select(&report);
    let (study, whole) = campaign.searched();
    let search = Search::new(study, &report).with_known(known);
    let residuals = scan::scan_residuals(study, &search, &ladder);
    let measurements = Measurements {
        subject: S::SUBJECT,
        error_unit: study.error_unit(),
        searched: (S::SUBJECT == Subject::Links || whole.is_some()).then(|| study.n_rows()),
        account: &campaign.account,
    };
    let found = answer::answer(study, &search, &ladder, measurements, &residuals, whole);
    let answer = defects::with_defects(found, &campaign.defects);
    let rows = request.wants_rows.then(|| rows::predicted(study, &search, &ladder.accepted));
    Answered { answer, rows, subset: whole.map(|_| study.n_rows()) }
}

/// What a configuration is extended by, and how.
#[derive(Clone, Debug, Default)]
pub struct Extending {
    /// The effects.
    pub effects: Effects,
    /// An expression of the user's, fitted and added beside the effects.
    pub formula: Option<FormulaRequest>,
    /// Links only: whether the measurements are corrected first, and the corrected file is wanted.
    pub wants_corrected: bool,
    /// Whether the effects that were accepted until a search was stopped are added.
    pub accepts_partial: bool,
}

/// Which effects are added.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Effects {
    /// Those that [`diagnose()`] accepts.
    #[default]
    Accepted,
    /// Those of these names.
    Named(Vec<String>),
}

impl Extending {
    /// By the effects of these names.
    #[must_use]
    pub fn named(names: &[&str]) -> Self {
        let names = names.iter().map(|&name| name.to_owned()).collect();
        Self { effects: Effects::Named(names), ..Self::default() }
    }
}

/// The result of an extension.
#[derive(Clone, Debug)]
pub struct Extended {
    /// The extended configuration; none where no effect is missing in corrected measurements, which are then all that was asked for.
    pub config: Option<ExtendedConfig>,
    /// The corrected measurements, if they are wanted.
    pub corrected: Option<CorrectedData>,
}

/// Adds effects to the model, fitted to the measurements.
///
/// # Errors
///
/// One of the files cannot be used, an effect cannot be added, or the work was stopped before there was anything to add.
pub fn extend(
    request: &Request<'_>,
    extending: &Extending,
    observer: &dyn Observer,
) -> Result<Extended, DiagnoseError> {
    match open::subject(request.table)? {
        Subject::Links => {
            extended(opened::<LinkStudy>(request, observer)?, (request, extending), observer)
        }
        Subject::Robots => {
            if extending.wants_corrected {
                return Err(DiagnoseError::CorrectedRobots);
            }
            extended(opened::<RobotStudy>(request, observer)?, (request, extending), observer)
        }
    }
}

fn extended<S: Measured>(
    opened: (S, DataAccount),
    (request, extending): (&Request<'_>, &Extending),
    observer: &dyn Observer,
) -> Result<Extended, DiagnoseError> {
    let report = |progress: SearchProgress<'_>| observer.progress(progress);
    let is_searched = extending.effects == Effects::Accepted;
    let mut corrected = None;
    let mut campaign = if is_searched || extending.wants_corrected {
        let mut campaign = Campaign::of(opened);
        campaign.find_defects(observer);
        if extending.wants_corrected {
            if stop_flag(observer).is_set() {
                return Err(DiagnoseError::Stopped(Stopped::Defects));
            }
            corrected = Some(campaign.study.corrected_data(request.table, &campaign.defects)?);
        }
        observer.defects(&campaign.listed_defects());
        campaign.correct()?
    } else {
        Campaign::of(opened)
    };
    if let Some(wanted) = &extending.formula {
        campaign.study.with_formula(wanted)?;
    }
    let (terms, known) = match &extending.effects {
        Effects::Accepted => {
            campaign.take_subset(request);
            let (ladder, known) = campaign.select(&report);
            if ladder.stopped.is_some() && !extending.accepts_partial {
                return Err(DiagnoseError::Stopped(Stopped::Search));
            }
            if ladder.stopped.is_some() && ladder.accepted.is_empty() {
                return Err(DiagnoseError::Stopped(Stopped::NothingAccepted));
            }
            (ladder.accepted, known)
        }
        Effects::Named(names) => {
            let formula = extending.formula.as_ref().map(|_| FORMULA);
            let names = names.iter().map(String::as_str).chain(formula);
            let terms: Result<Vec<TermId>, ExtendError> =
                names.map(|name| extend::candidate(&campaign.study, name)).collect();
            (terms?, Arc::default())
        }
    };
    let (study, whole) = campaign.searched();
    let search = Search::new(study, &report).with_known(known);
    let added =
        extend::extended_config((request.config, &campaign.account), study, &search, &terms, whole);
    if search.is_stopped() && !extending.accepts_partial {
        return Err(DiagnoseError::Stopped(Stopped::Fit));
    }
    let config = match added {
        Err(ExtendError::Nothing) if extending.wants_corrected => None,
        added => {
            let config = added?;
            let names = &config.answer.added;
            let added = Added { terms: &terms, names, text: &config.text };
            study.require_executed(request, &search, added)?;
            Some(config)
        }
    };
    Ok(Extended { config, corrected })
}

/// Names of all that score tests find beyond chance in the model as configured, without a search: constants by which rows are off,
/// effects, and effects on some rows only. Each kind has the error probability of a family of its own. For many null campaigns in
/// little time.
///
/// # Errors
///
/// One of the files cannot be used.
pub fn screen(
    request: &Request<'_>,
    observer: &dyn Observer,
) -> Result<Vec<String>, DiagnoseError> {
    Ok(match open::subject(request.table)? {
        Subject::Links => ladder::screened(&opened::<LinkStudy>(request, observer)?.0),
        Subject::Robots => ladder::screened(&opened::<RobotStudy>(request, observer)?.0),
    })
}

/// Measurements on their way to an answer.
pub(crate) struct Campaign<S> {
    /// All rows.
    pub(crate) study: S,
    /// Some of the rows, which are searched, where there are many.
    pub(crate) thin: Option<S>,
    pub(crate) account: DataAccount,
    pub(crate) defects: Vec<Defect>,
}

impl<S: Measured> Campaign<S> {
    /// Measurements as they were read.
    pub(crate) fn of((study, account): (S, DataAccount)) -> Self {
        Self { study, thin: None, account, defects: Vec::new() }
    }

    /// The same with their defects found and corrected.
    fn corrected(opened: (S, DataAccount), observer: &dyn Observer) -> Result<Self, DiagnoseError> {
        let mut campaign = Self::of(opened);
        campaign.find_defects(observer);
        campaign.correct()
    }

    /// Looks for defects of the measurement.
    pub(crate) fn find_defects(&mut self, observer: &dyn Observer) {
        self.defects = self.study.defects(observer);
    }

    /// The defects that were found, as answers list them.
    pub(crate) fn listed_defects(&self) -> Vec<MeasurementDefect> {
        self.defects.iter().map(MeasurementDefect::of).collect()
    }

    /// The same with the defects that were found corrected.
    fn correct(self) -> Result<Self, DiagnoseError> {
        let account = defects::corrected_account(&self.account, &self.defects);
        let corrected = self.study.without_defects(&self.defects)?;
        Ok(Self { study: corrected.unwrap_or(self.study), account, ..self })
    }

    /// Searches a subset of the rows from now on, unless all are asked for or few enough.
    fn take_subset(&mut self, request: &Request<'_>) {
        self.thin = if request.is_thorough { None } else { self.study.some_rows() };
    }

    /// The study that is searched, and that of all rows where it has some only.
    pub(crate) fn searched(&self) -> (&S, Option<&S>) {
        self.thin.as_ref().map_or((&self.study, None), |thin| (thin, Some(&self.study)))
    }

    /// Selects effects, limited ones among them.
    pub(crate) fn select(
        &mut self,
        report: &(dyn Fn(SearchProgress<'_>) + Sync),
    ) -> (Ladder, Arc<Known<S::Fit>>) {
        match &mut self.thin {
            Some(thin) => ladder::select(thin, Some(&mut self.study), report),
            None => ladder::select(&mut self.study, None, report),
        }
    }
}

#[cfg(test)]
mod tests;
