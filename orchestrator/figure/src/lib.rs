//! Figures for papers: what a run, a sweep or an answer shows, as numbers with their intervals, and drawn as vector files.
//!
//! | module | what |
//! |---|---|
//! | [`content`] | a figure: panels, axes, series, points; everything that a drawing or a table needs |
//! | [`run`] | the kinds of figures of a run, one function each |
//! | [`sweep`] | a figure of a sweep: metrics over what varies |
//! | [`answer`] | the kinds of figures of an answer of `compare`, `diagnose` and `power` |
//! | [`paint`] | a figure in shapes, which [`picture`] writes as PDF, SVG or PNG |
//! | [`table`] | the numbers of a figure as CSV |
//!
//! The Python package draws the same [`content::Figure`] with matplotlib.

pub mod answer;
pub mod content;
pub mod paint;
pub mod run;
mod scale;
pub mod sweep;
pub mod table;

use content::Figure;
use input::Reading;
use input::result::{ResultError, ResultFolder};
use proto::bounds::DESCRIPTION_BYTES;
use std::fmt::Write as _;
use std::path::Path;

/// A figure that is asked for.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Kinds of figures of a run or an answer, of which there is one; or metrics of a sweep, a panel each.
    pub kinds: Vec<String>,
    /// What a sweep's figure has along its axis: a key that varies, or `case`. `None`: the first that varies.
    pub x: Option<String>,
    /// What its lines or colours tell apart. `None`: everything else that varies.
    pub by: Option<String>,
    /// From this simulated time of a run on (s).
    pub from_s: Option<f64>,
    /// Until this simulated time (s).
    pub until_s: Option<f64>,
}

/// Why there is no figure.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The request cannot be met.
    #[error("{0}")]
    Request(String),
    /// A file of the result is not what was written, or cannot be read.
    #[error(transparent)]
    Unbelieved(#[from] ResultError),
}

/// The figure of a folder of a run or of a sweep, or of an answer in a file.
///
/// # Errors
///
/// There is no figure of that kind, with the list of those that there are; or a file cannot be read.
pub fn figure(path: &Path, request: &Request, reading: Reading) -> Result<Figure, FigureError> {
    let wrong = |what: &str| FigureError::Request(format!("{}: {what}", path.display()));
    if path.is_file() {
        let text = experiment::text_of(path).map_err(|error| wrong(&error.to_string()))?;
        let answer = serde_json::from_str(&text).map_err(|error| {
            wrong(&format!("is neither a folder of results nor an answer as JSON: {error}"))
        })?;
        return answer::figure(path, &answer, request);
    }
    let no_result = || wrong("is not the folder of a run or of a finished sweep");
    if !path.join("summary.json").is_file() {
        return Err(no_result());
    }
    let folder = ResultFolder::open(path, reading)?;
    let summary: serde_json::Value =
        serde_json::from_str(&folder.text(&DESCRIPTION_BYTES, "summary.json")?)
            .map_err(|_| no_result())?;
    let schema = summary["schema"].as_str().unwrap_or_default();
    if schema == sweep_schema() {
        sweep::figure(&folder, &summary, request)
    } else if schema.starts_with(record::SCHEMA_PREFIX) {
        run::figure(&folder, &summary, request)
    } else {
        Err(no_result())
    }
}

fn sweep_schema() -> &'static str {
    ::sweep::SUMMARY_SCHEMA
}

/// A kind of figure, with what it shows.
pub(crate) struct Kind<F: 'static> {
    /// Its name.
    pub name: &'static str,
    /// What it shows, in a few words.
    pub shows: &'static str,
    /// The file that it is made of; empty: the answer itself.
    pub file: &'static str,
    /// Makes it.
    pub draw: F,
}

/// The one kind that is asked for.
///
/// * `has`: whether there is a file of that name.
fn kind<'a, F>(
    path: &Path,
    kinds: &'a [Kind<F>],
    request: &Request,
    has: impl Fn(&str) -> bool,
) -> Result<&'a Kind<F>, FigureError> {
    let listed = || {
        let mut text = String::new();
        for kind in kinds.iter().filter(|kind| has(kind.file)) {
            let _ = write!(text, "\n  {:<13} {}", kind.name, kind.shows);
        }
        text
    };
    if let (Some(name), _) | (None, Some(name)) =
        (request.x.as_ref().map(|_| "--x"), request.by.as_ref().map(|_| "--by"))
    {
        let text = format!("{name}: is for sweeps, and {} is none", path.display());
        return Err(FigureError::Request(text));
    }
    let [wanted] = &request.kinds[..] else {
        let text = format!("{}: name one KIND of figure:{}", path.display(), listed());
        return Err(FigureError::Request(text));
    };
    let Some(kind) = kinds.iter().find(|kind| kind.name == wanted) else {
        let text = format!(
            "{wanted:?} is no KIND of figure of {}; there are:{}",
            path.display(),
            listed()
        );
        return Err(FigureError::Request(text));
    };
    if !has(kind.file) {
        let text = format!(
            "{wanted} needs {}, which {} lacks (section [output] of its configuration says which tables a run leaves); \
             there are:{}",
            kind.file,
            path.display(),
            listed()
        );
        return Err(FigureError::Request(text));
    }
    Ok(kind)
}
