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
use proto::config::most_similar;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A figure that is asked for.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Kinds of figures of a run or an answer, of which there is one; or metrics of a sweep, a panel each.
    pub kinds: Vec<String>,
    /// What a sweep's figure has along its axis: a key that varies, or `case`. `None`: the first that varies.
    pub x: Option<String>,
    /// What its lines or colours tell apart. `None`: everything else that varies.
    pub by: Option<String>,
    /// From this simulated time of a run on (s); of runs whose robots started at different times, since then.
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

/// The figure of a folder of a run or of a sweep, or of an answer in a file; of several runs over each other.
///
/// # Errors
///
/// There is no figure of that kind, with the list of those that there are; or a file cannot be read.
pub fn figure(
    paths: &[PathBuf],
    request: &Request,
    reading: Reading,
) -> Result<Figure, FigureError> {
    if let (Some(from_s), Some(until_s)) = (request.from_s, request.until_s)
        && until_s <= from_s
    {
        let text = format!("--until {until_s}: must be after --from {from_s}");
        return Err(FigureError::Request(text));
    }
    match paths {
        [] => Err(FigureError::Request("name a result".to_owned())),
        [path] => of_one(path, request, reading),
        paths => {
            let results = paths.iter().map(|path| opened(path, reading));
            let results: Vec<(ResultFolder, Value)> = results.collect::<Result<_, _>>()?;
            run::figure_of_several(&results, request)
        }
    }
}

fn of_one(path: &Path, request: &Request, reading: Reading) -> Result<Figure, FigureError> {
    if path.is_file() {
        let wrong = |what: &str| FigureError::Request(format!("{}: {what}", path.display()));
        let text = experiment::text_of(path).map_err(|error| wrong(&error.to_string()))?;
        let answer = serde_json::from_str(&text).map_err(|error| {
            wrong(&format!("is neither a folder of results nor an answer as JSON: {error}"))
        })?;
        return answer::figure(path, &answer, request);
    }
    let (folder, summary) = opened(path, reading)?;
    if is_run(&summary) {
        run::figure(&folder, &summary, request)
    } else {
        sweep::figure(&folder, &summary, request)
    }
}

/// The folder of a run or a sweep with its summary.
fn opened(path: &Path, reading: Reading) -> Result<(ResultFolder, Value), FigureError> {
    let no_result = || {
        let what = match path.exists() {
            true => "is not the folder of a run or of a finished sweep",
            false => "does not exist",
        };
        FigureError::Request(format!("{}: {what}", path.display()))
    };
    if !path.join("summary.json").is_file() {
        return Err(no_result());
    }
    let folder = ResultFolder::open(path, reading)?;
    let summary: Value = serde_json::from_str(&folder.text(&DESCRIPTION_BYTES, "summary.json")?)
        .map_err(|_| no_result())?;
    if is_run(&summary) || summary["schema"] == sweep_schema() {
        Ok((folder, summary))
    } else {
        Err(no_result())
    }
}

fn is_run(summary: &Value) -> bool {
    let schema = summary["schema"].as_str().unwrap_or_default();
    schema != sweep_schema() && schema.starts_with(record::SCHEMA_PREFIX)
}

/// Whether this is the name of a kind of figures of a run.
#[must_use]
pub fn is_kind_of_run(name: &str) -> bool {
    run::KINDS.iter().any(|kind| kind.name == name)
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

/// Whose figure is asked for.
struct Wanted<'a, F: 'static> {
    /// What it is called.
    what: String,
    /// Whether there is a file of that name.
    has: &'a dyn Fn(&str) -> bool,
    /// Whether what there is suffices for a kind whose file is there.
    can_draw: &'a dyn Fn(&Kind<F>) -> bool,
}

/// The one kind that is asked for.
fn kind<'a, F>(
    wanted: &Wanted<'_, F>,
    kinds: &'a [Kind<F>],
    request: &Request,
) -> Result<&'a Kind<F>, FigureError> {
    let Wanted { what, has, can_draw } = wanted;
    let listed = || {
        let mut text = String::new();
        for kind in kinds.iter().filter(|kind| has(kind.file) && can_draw(kind)) {
            let _ = write!(text, "\n  {:<13} {}", kind.name, kind.shows);
        }
        text
    };
    if let (Some(name), _) | (None, Some(name)) =
        (request.x.as_ref().map(|_| "--x"), request.by.as_ref().map(|_| "--by"))
    {
        let text = format!("{name}: is for sweeps, and {what} is none");
        return Err(FigureError::Request(text));
    }
    let name = match &request.kinds[..] {
        [] => {
            let text = format!("{what}: name one KIND of figure:{}", listed());
            return Err(FigureError::Request(text));
        }
        [name] => name,
        several => {
            let unknown = several.iter().find(|name| kinds.iter().all(|kind| kind.name != **name));
            let problem = match unknown {
                Some(name) => {
                    format!("{name:?} is neither a folder of results nor a KIND of figure")
                }
                None => {
                    format!("has one KIND at a time, and {} were given", several.join(", "))
                }
            };
            let text = format!("{what}: {problem}; name one of:{}", listed());
            return Err(FigureError::Request(text));
        }
    };
    let Some(kind) = kinds.iter().find(|kind| kind.name == name) else {
        let nearest = most_similar(name, kinds.iter().map(|kind| kind.name))
            .map(|name| format!(" (nearest: {name})"))
            .unwrap_or_default();
        let text =
            format!("{name:?} is no KIND of figure of {what}{nearest}; there are:{}", listed());
        return Err(FigureError::Request(text));
    };
    if !has(kind.file) {
        let text = format!(
            "{name} needs {}, which {what} lacks (section [output] of its configuration says which tables a run leaves); \
             there are:{}",
            kind.file,
            listed()
        );
        return Err(FigureError::Request(text));
    }
    Ok(kind)
}
