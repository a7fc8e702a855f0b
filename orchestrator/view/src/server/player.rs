//! The page that shows runs: its files, and its calls.

use super::connections::{BODY, Trust};
use super::{Access, Refused, RunSource, Shown, file};
use crate::live::Viewer;
use crate::page::{INDEX, SCRIPT, STYLE};
use crate::recorded::MOST_FRAMES;
use crate::view;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Path, Query, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use futures::StreamExt as _;
use hyper::service::Service as _;
use hyper_util::service::TowerToHyperService;
use prost::Message as _;
use std::collections::BTreeMap;

/// The page of some runs.
pub fn player(access: &Access, shown: Shown) -> Router {
    let calls = Router::new()
        .route("/runs", get(runs))
        .route("/runs/{run}/overview", get(overview))
        .route("/runs/{run}/frames", get(frames))
        .route("/live", get(live))
        .route("/control", post(control).layer(middleware::from_fn(in_time)))
        .fallback(async || Refused(StatusCode::NOT_FOUND, "no such call".to_owned()));
    Router::new()
        .nest("/api", access.guard(calls))
        .route("/", get(|| async { player_file("") }))
        .route("/page.js", get(|| async { player_file("page.js") }))
        .route("/page.css", get(|| async { player_file("page.css") }))
        .with_state(shown)
}

/// A file of that page by its name; its first one has none.
#[must_use]
pub fn player_file(name: &str) -> Response {
    match name {
        "" => file("text/html; charset=utf-8", INDEX),
        "page.js" => file("text/javascript; charset=utf-8", SCRIPT),
        "page.css" => file("text/css; charset=utf-8", STYLE),
        _ => Refused(StatusCode::NOT_FOUND, "no such page".to_owned()).into_response(),
    }
}

/// Answers a request for `path`, which begins with `/`, of a site that is part of another one.
pub async fn within(site: Router, path: &str, request: Request) -> Response {
    let (parts, body) = request.into_parts();
    let query = parts.uri.query().map(|query| format!("?{query}")).unwrap_or_default();
    let mut inner = Request::new(body);
    let Ok(uri) = format!("{path}{query}").parse() else {
        return Refused(StatusCode::NOT_FOUND, "no such page".to_owned()).into_response();
    };
    *inner.uri_mut() = uri;
    *inner.method_mut() = parts.method;
    *inner.headers_mut() = parts.headers;
    // What else the outer site knows of the request, such as parts of its path, is not of the inner one.
    if let Some(trust) = parts.extensions.get::<Trust>() {
        inner.extensions_mut().insert(trust.clone());
    }
    match TowerToHyperService::new(site).call(inner).await {
        Ok(response) => response,
        Err(never) => match never {},
    }
}

/// Refuses a request whose body does not arrive in time.
async fn in_time(request: Request, next: Next) -> Response {
    let late = |_| Refused(StatusCode::REQUEST_TIMEOUT, "the request did not arrive".to_owned());
    let answered = tokio::time::timeout(BODY, next.run(request)).await;
    answered.map_err(late).into_response()
}

fn message(bytes: impl Into<Body>) -> Response {
    ([(header::CONTENT_TYPE, "application/octet-stream")], bytes.into()).into_response()
}

async fn runs(State(shown): State<Shown>) -> Response {
    let runs = shown.all().into_iter().map(|run| match run {
        RunSource::Recorded(run) => run.run().clone(),
        RunSource::Live(run) => run.run(),
    });
    let measurements = shown.measurements.as_deref().cloned();
    message(view::Runs { runs: runs.collect(), measurements }.encode_to_vec())
}

async fn overview(
    State(shown): State<Shown>,
    Path(number): Path<usize>,
) -> Result<Response, Refused> {
    match shown.run(number)? {
        RunSource::Recorded(run) => run
            .overview()
            .map(message)
            .map_err(|failure| Refused(StatusCode::INTERNAL_SERVER_ERROR, failure)),
        RunSource::Live(run) => Ok(message(run.overview().encode_to_vec())),
    }
}

async fn frames(
    State(shown): State<Shown>,
    Path(number): Path<usize>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Response, Refused> {
    let number_of = |key: &str| -> Result<u64, Refused> {
        let value = query.get(key).ok_or_else(|| {
            Refused(StatusCode::BAD_REQUEST, format!("{key} is missing: must be a whole number"))
        })?;
        value.parse().map_err(|_| {
            let text = format!("{key}: must be a whole number from 0, got {value:?}");
            Refused(StatusCode::BAD_REQUEST, text)
        })
    };
    let (from_ns, until_ns) = (number_of("from_ns")?, number_of("until_ns")?);
    let most = number_of("most")?;
    if MOST_FRAMES as u64 <= most.saturating_sub(1) {
        let text = format!("most: must be from 0 to {MOST_FRAMES}, got {most}");
        return Err(Refused(StatusCode::BAD_REQUEST, text));
    }
    let most = most as usize;
    let run = shown.run(number)?;
    let frames = tokio::task::spawn_blocking(move || match run {
        RunSource::Recorded(run) => run.frames(from_ns, until_ns, most),
        RunSource::Live(run) => Ok(run.frames(from_ns, until_ns, most)),
    });
    let failed = |text: String| Refused(StatusCode::INTERNAL_SERVER_ERROR, text);
    let frames = frames.await.map_err(|error| failed(error.to_string()))?;
    let frames = frames.map_err(|error| failed(error.to_string()))?;
    Ok(message(view::Frames { frames }.encode_to_vec()))
}

async fn live(State(shown): State<Shown>) -> Result<Response, Refused> {
    let RunSource::Live(run) = shown.run(0)? else {
        return Err(Refused(StatusCode::CONFLICT, "this run has ended: replay it".to_owned()));
    };
    let messages = futures::stream::unfold(run.viewer(), async |mut viewer: Viewer| {
        let next = viewer.next().await?;
        Some((Ok::<Bytes, std::convert::Infallible>(next), viewer))
    });
    Ok(message(Body::from_stream(messages.boxed())))
}

async fn control(State(shown): State<Shown>, body: Bytes) -> Result<Response, Refused> {
    let RunSource::Live(run) = shown.run(0)? else {
        return Err(Refused(StatusCode::CONFLICT, "this run has ended".to_owned()));
    };
    if !run.run().controllable {
        let text = "this run is shown only: start it with --live-control to pause and step it here";
        return Err(Refused(StatusCode::FORBIDDEN, text.to_owned()));
    }
    let asked = view::Control::decode(body)
        .map_err(|error| Refused(StatusCode::BAD_REQUEST, format!("not a Control: {error}")))?;
    run.pace().control(asked.kind());
    Ok(StatusCode::NO_CONTENT.into_response())
}
