//! From two files of measurements to what changed between them.

use super::answer::{Campaigns, answer};
use super::contrast::Sides;
use super::pairs::pairs;
use super::search::{BaseTerm, search};
use super::{Between, SidesOf, Spans};
use crate::ladder::Search;
use crate::measured::{Measured, opened};
use crate::pipeline::Campaign;
use crate::progress::SearchProgress;
use crate::request::{DiagnoseError, Observer, Request, stop_flag};
use measure::config::Compared;
use measure::pooled::{Pooled, pool};
use measure::table::DataTable;
use measure::{packets, time_of_day};
use study::choices::Choices;
use study::links::LinkStudy;
use study::open::{self, OpenError, Subject};
use study::robots::RobotStudy;
use study::thresholds::{FEWEST_BLOCKS, FEWEST_REPLICATES};
use study::{COMMON, Study};

/// A model and the measurements of two campaigns, of links or of robots.
#[derive(Clone, Debug)]
pub struct BetweenRequest<'a> {
    /// The configuration: the model.
    pub config: &'a Compared,
    /// The measurements of the first campaign, then of the second.
    pub tables: [&'a DataTable; 2],
    /// Selection of rows, and prediction horizon of robots.
    pub choices: Choices,
    /// Whether all rows are searched, however long that takes. Otherwise a subset of them is where there are many.
    pub is_thorough: bool,
}

/// Why two campaigns have no answer.
#[derive(Debug, thiserror::Error)]
pub enum BetweenError {
    /// One of the files, or both together, cannot be used.
    #[error(transparent)]
    Open(#[from] DiagnoseError),
    /// One of the files holds packets.
    #[error(
        "{file}: does not apply to packets, which are compared as one run; diagnose each file with --data"
    )]
    Packets {
        /// Its path.
        file: String,
    },
    /// The two files do not go together.
    #[error("{0}")]
    Mismatch(String),
}

impl From<OpenError> for BetweenError {
    fn from(error: OpenError) -> Self {
        Self::Open(error.into())
    }
}

/// Finds which changes of the model of the first campaign are needed to predict the second.
///
/// A search that is stopped gives the answer that it has until then, with `complete` false.
///
/// # Errors
///
/// One of the files cannot be used, or the two do not go together.
pub fn between(
    request: &BetweenRequest<'_>,
    observer: &dyn Observer,
) -> Result<Between, BetweenError> {
    let [a, b] = request.tables;
    let subject = subject(request.tables)?;
    let pooled = pool(a, b).map_err(BetweenError::Mismatch)?;
    match subject {
        Subject::Links => answered::<LinkStudy>(request, &pooled, observer),
        Subject::Robots => answered::<RobotStudy>(request, &pooled, observer),
    }
}

/// The subject of both files.
fn subject(tables: [&DataTable; 2]) -> Result<Subject, BetweenError> {
    if let Some(table) = tables.into_iter().find(|table| packets::has_shape(table).is_ok()) {
        return Err(BetweenError::Packets { file: table.path.display().to_string() });
    }
    let [a, b] = tables.map(open::subject);
    let (a, b) = (a?, b?);
    if a != b {
        let name =
            |subject| if subject == Subject::Links { "link samples" } else { "robot samples" };
        return Err(BetweenError::Mismatch(format!(
            "{} holds {} and {} holds {}; give two files of the same kind",
            tables[0].path.display(),
            name(a),
            tables[1].path.display(),
            name(b)
        )));
    }
    Ok(a)
}

/// Searches the first campaign, then both.
fn answered<S: Measured>(
    request: &BetweenRequest<'_>,
    pooled: &Pooled,
    observer: &dyn Observer,
) -> Result<Between, BetweenError> {
    let report = |progress: SearchProgress<'_>| observer.progress(progress);
    let of = |table| Request::new(request.config, table).with_choices(request.choices.clone());
    let [a, b] = request.tables;
    let mut a = Campaign::of(opened::<S>(&of(a), observer)?);
    let mut b = Campaign::of(opened::<S>(&of(b), observer)?);
    if let Some(why) = a.study.mismatch(&b.study) {
        return Err(BetweenError::Mismatch(why.to_owned()));
    }
    let study = S::open(&of(&pooled.table))?.0.stopping(&stop_flag(observer));
    a.find_defects(observer);
    b.find_defects(observer);
    let defects = SidesOf { a: a.listed_defects(), b: b.listed_defects() };
    let some_rows = |study: &S| if request.is_thorough { None } else { study.some_rows() };
    let some = some_rows(&study);
    let searched = some.as_ref().map(S::n_rows);
    let mut study = some.unwrap_or(study);
    let sides = Sides::of(&study, &pooled.second_runs).ok_or_else(|| {
        BetweenError::Mismatch("one of the two files has no row that can be used".to_owned())
    })?;
    a.study = some_rows(&a.study).unwrap_or(a.study);
    let too_little = [("A", too_few_blocks(&a.study)), ("B", too_few_blocks(&b.study))]
        .into_iter()
        .find_map(|(name, why)| Some(format!("{name} has only {}", why?)));
    let (ladder, _) = a.select(&report);
    let base = BaseTerm::of(&a.study, &ladder.accepted);
    let found = search(&mut study, &base, &sides, &report);
    let pairs = pairs(&mut study, &found, &sides);
    let campaigns = Campaigns {
        subject: S::SUBJECT,
        error_unit: study.error_unit(),
        searched,
        accounts: [&a.account, &b.account],
        too_little: too_little.as_deref(),
        time_of_day_h: time_of_day_h(request.tables),
        left_out_columns: &pooled.left_out,
        defects: &defects,
        is_base_complete: ladder.stopped.is_none(),
    };
    let search = Search::new(&study, &report).with_known(found.known.clone());
    Ok(answer(&study, &found, &pairs, &sides, &search, campaigns))
}

/// Why a campaign alone has too few blocks to find anything in.
fn too_few_blocks<S: Study>(study: &S) -> Option<String> {
    let blocks = study.blocks(COMMON);
    (!blocks.may_be_certain()).then(|| {
        format!(
            "{} {}, and at least {FEWEST_BLOCKS}, or {FEWEST_REPLICATES} runs, are required",
            blocks.n_scored(),
            blocks.unit
        )
    })
}

/// When both were measured, in hours since midnight (UTC).
fn time_of_day_h(tables: [&DataTable; 2]) -> Option<Spans> {
    let hours = |table: &DataTable| -> Option<Vec<f64>> {
        Some(time_of_day::epoch_s(table)?.into_iter().map(time_of_day::hours).collect())
    };
    Spans::of(&hours(tables[0])?, &hours(tables[1])?)
}
