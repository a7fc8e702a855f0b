//! The page that shows the table, its calls, and the pages that it links to.
//!
//! | path | content |
//! |---|---|
//! | `/` | the page |
//! | `/api/about` | the folder, and what figures and series there are |
//! | `/api/rows?since=N` | rows that have changed after change N |
//! | `/api/series?id=N&points=N` | the series of a run |
//! | `/report/N/KEY` | a report, which may do nothing but show itself; its key opens nothing else |
//! | `/play/N/` | the page that plays a run |
//!
//! A result is named by a number that the table has given it, never by a path.

use crate::listing::is_file;
use crate::series::{MOST_POINTS, SERIES};
use crate::table::ResultsTable;
use axum::Router;
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use experiment::program_name;
use proto::bounds::Bound;
use record::metric::{SHARE, metrics};
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::Semaphore;
use view::recorded::RecordedRun;
use view::server::{Access, Refused, RunSource, Shown, file, player, player_file, within};

const INDEX: &str = include_str!("../../page/dist/runs.html");
const SCRIPT: &str = include_str!("../../page/dist/runs.js");
const STYLE: &str = include_str!("../../page/dist/runs.css");

/// A report of more bytes is not served.
const MOST_REPORT_BYTES: Bound = Bound { what: "size of a report (bytes)", most: 64 << 20 };
/// So many runs are kept open for their pages.
const MOST_PLAYED: usize = 4;

/// What a report may do: run the scripts that are in it and show pictures that are in it. It has an origin of its own, so it cannot
/// ask this server for anything.
const REPORT_POLICY: &str = "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; \
     style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

#[derive(Clone)]
struct Site {
    table: Arc<ResultsTable>,
    access: Access,
    /// Runs that are played, the latest last.
    played: Arc<Mutex<VecDeque<(u32, Shown)>>>,
    /// One table of a run is read at a time.
    reads: Arc<Semaphore>,
}

/// The site of a table.
pub fn site(table: ResultsTable, access: &Access) -> Router {
    let site = Site {
        table: Arc::new(table),
        access: access.clone(),
        played: Arc::default(),
        reads: Arc::new(Semaphore::new(1)),
    };
    let calls = Router::new()
        .route("/about", get(about))
        .route("/rows", get(rows))
        .route("/series", get(series))
        .fallback(async || Refused(StatusCode::NOT_FOUND, "no such call".to_owned()));
    let of_player = Router::new().route("/{*call}", get(play)).fallback(play_nothing);
    Router::new()
        .nest("/api", access.guard(calls))
        .nest("/play/{id}/api", access.guard(of_player))
        .route("/", get(|| async { file("text/html; charset=utf-8", INDEX) }))
        .route("/runs.js", get(|| async { file("text/javascript; charset=utf-8", SCRIPT) }))
        .route("/runs.css", get(|| async { file("text/css; charset=utf-8", STYLE) }))
        .route("/play/{id}/", get(|| async { player_file("") }))
        .route("/play/{id}/{file}", get(player_page))
        .route("/report/{id}/{key}", get(report))
        .with_state(site)
}

async fn player_page(Path((_, name)): Path<(String, String)>) -> Response {
    player_file(&name)
}

async fn play_nothing() -> Refused {
    Refused(StatusCode::NOT_FOUND, "no such call".to_owned())
}

fn answer(value: &Value) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], value.to_string()).into_response()
}

fn failed(error: impl ToString) -> Refused {
    Refused(StatusCode::INTERNAL_SERVER_ERROR, error.to_string())
}

fn no_result(id: u32) -> Refused {
    Refused(StatusCode::NOT_FOUND, format!("no result {id} is in the folder any more"))
}

/// Does what may wait for the disk.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Refused> + Send + 'static,
) -> Result<T, Refused> {
    tokio::task::spawn_blocking(work).await.map_err(failed)?
}

/// A whole number of a query.
fn whole(query: &BTreeMap<String, String>, key: &str, most: u64) -> Result<u64, Refused> {
    let wrong = |got: &str| {
        let text = format!("{key}: must be a whole number from 0 to {most}, got {got}");
        Refused(StatusCode::BAD_REQUEST, text)
    };
    let value = query.get(key).ok_or_else(|| wrong("none"))?;
    value.parse().ok().filter(|value| *value <= most).ok_or_else(|| wrong(&format!("{value:?}")))
}

fn id_of(query: &BTreeMap<String, String>) -> Result<u32, Refused> {
    Ok(whole(query, "id", u32::MAX.into())? as u32)
}

async fn about(State(site): State<Site>) -> Response {
    let figures = metrics().iter().filter_map(|metric| {
        let short = metric.short?;
        let unit = if metric.unit == Some(SHARE) { "%" } else { metric.axis_unit().unwrap_or("") };
        Some(json!({
            "name": short.name,
            "label": metric.label,
            "unit": unit,
            "better": metric.better.name(),
        }))
    });
    answer(&json!({
        "folder": site.table.folder().display().to_string(),
        "program": program_name(),
        "figures": figures.collect::<Vec<Value>>(),
        "series": SERIES,
    }))
}

async fn rows(
    State(site): State<Site>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Response, Refused> {
    let since = whole(&query, "since", u64::MAX)?;
    blocking(move || {
        let report_of = |id| format!("report/{id}/{}", key_of_report(&site.access, id));
        Ok(answer(&site.table.changes(since, report_of)))
    })
    .await
}

async fn series(
    State(site): State<Site>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Response, Refused> {
    let id = id_of(&query)?;
    let n_points = whole(&query, "points", MOST_POINTS)? as usize;
    let permit = site.reads.clone().acquire_owned().await.map_err(failed)?;
    blocking(move || {
        let series = site.table.series(id).ok_or_else(|| no_result(id))?;
        drop(permit);
        let series = series.map_err(|text| Refused(StatusCode::CONFLICT, text))?;
        Ok(answer(&json!(series.thinned(n_points))))
    })
    .await
}

/// What opens a report.
fn key_of_report(access: &Access, id: u32) -> String {
    access.key_of(&format!("report {id}"))
}

async fn report(
    State(site): State<Site>,
    Path((id, key)): Path<(u32, String)>,
) -> Result<Response, Refused> {
    if !view::server::is_same(key.as_bytes(), key_of_report(&site.access, id).as_bytes()) {
        let text = "open the report from the page of this program: its key is of another one";
        return Err(Refused(StatusCode::UNAUTHORIZED, text.to_owned()));
    }
    blocking(move || {
        let (path, _) = site.table.place(id).ok_or_else(|| no_result(id))?;
        if !is_file(&path.join("report.html")) {
            return Err(no_result(id));
        }
        let conflict = |text: String| Refused(StatusCode::CONFLICT, text);
        let folder = site.table.open(&path).map_err(conflict)?;
        let page = folder.bytes(&MOST_REPORT_BYTES, "report.html");
        let page = page.map_err(|error| conflict(error.to_string()))?;
        let headers: [(HeaderName, HeaderValue); 2] = [
            (header::CONTENT_TYPE, HeaderValue::from_static("text/html; charset=utf-8")),
            (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(REPORT_POLICY)),
        ];
        Ok((headers, page).into_response())
    })
    .await
}

async fn play(
    State(site): State<Site>,
    Path((id, call)): Path<(u32, String)>,
    request: Request,
) -> Result<Response, Refused> {
    let access = site.access.clone();
    let shown = blocking(move || opened(&site, id)).await?;
    Ok(within(player(&access, shown), &format!("/api/{call}"), request).await)
}

/// The run that is played, opened if need be.
fn opened(site: &Site, id: u32) -> Result<Shown, Refused> {
    let played = || site.played.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, shown)) = played().iter().find(|(own, _)| *own == id) {
        return Ok(shown.clone());
    }
    let conflict = |text: String| Refused(StatusCode::CONFLICT, text);
    let (path, _) = site.table.place(id).ok_or_else(|| no_result(id))?;
    let folder = site.table.open(&path).map_err(conflict)?;
    let run = RecordedRun::open(&folder).map_err(|error| conflict(error.to_string()))?;
    let run = Arc::new(run);
    // The page asks for the overview, and then shows why it cannot be read.
    run.read_in_background(|_: &str| {});
    let shown = Shown::new(vec![RunSource::Recorded(run)]);
    let mut played = played();
    played.push_back((id, shown.clone()));
    if MOST_PLAYED < played.len() {
        played.pop_front();
    }
    Ok(shown)
}
