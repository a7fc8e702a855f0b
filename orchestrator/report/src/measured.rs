//! The page of a comparison or a diagnosis: a model against measurements in pictures, each with what to look at and what it
//! means. One file that opens without a network and needs no script.

mod errors;
mod ladder;
mod places;
pub(crate) mod words;

use super::svg::{Axis, Chart};
use super::text::escape;
use diagnose::compare::comparison::Comparison;
use diagnose::diagnosis::Diagnosis;
use measure::account::Account;
use numbers::format::count;
use numbers::statistics::quantile_nearest;
use proto::site::Site;
use serde::Serialize;
use std::fmt::Write as _;
use study::view::View;

/// Marks of a key: class of the mark, words.
pub(super) type Key = Vec<(&'static str, String)>;

/// A picture with its words.
pub(super) struct Picture {
    pub(super) title: String,
    /// What to look at.
    pub(super) look: String,
    /// What it means.
    pub(super) means: String,
    pub(super) key: Key,
    pub(super) svg: String,
    pub(super) is_wide: bool,
}

/// What the pictures of links need beside predictions.
#[derive(Clone, Debug)]
pub struct LinkRows {
    /// Places of sender and receiver of each row (m), and whether each of them moves.
    pub ends: Vec<[([f64; 2], bool); 2]>,
    /// Mote numbers of sender and receiver.
    pub motes: Vec<[u32; 2]>,
    /// Frames sent, and frames received of them, NaN where unknown.
    pub frames: Vec<[f64; 2]>,
    /// Step of the readings (dB), 0 if they are not rounded.
    pub quantum_db: f64,
}

/// What the pictures of robots need beside predictions.
#[derive(Clone, Debug)]
pub struct RobotRows {
    /// Tracks, as places over time (m).
    pub tracks: Vec<Vec<[f64; 2]>>,
    /// Where each window begins and ends (m).
    pub ends: Vec<[[f64; 2]; 2]>,
    /// Horizon (s), rmse of the model as configured, and of the model found (m).
    pub horizons: Vec<(f64, f64, Option<f64>)>,
}

/// Rows of one kind.
#[derive(Clone, Debug)]
pub enum Rows {
    /// Frames and possible receivers.
    Links(LinkRows),
    /// Windows of robots' tracks.
    Robots(RobotRows),
}

/// An answer about links or robots.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
pub enum MeasuredAnswer<'a> {
    /// How large the error is, and where.
    Comparison(&'a Comparison),
    /// Which effects are missing.
    Diagnosis(&'a Diagnosis),
}

impl<'a> MeasuredAnswer<'a> {
    /// The measurements that it is about.
    fn account(self) -> &'a Account {
        match self {
            Self::Comparison(comparison) => &comparison.account,
            Self::Diagnosis(diagnosis) => &diagnosis.account,
        }
    }

    /// The diagnosis, if it is one.
    fn diagnosis(self) -> Option<&'a Diagnosis> {
        match self {
            Self::Comparison(_) => None,
            Self::Diagnosis(diagnosis) => Some(diagnosis),
        }
    }
}

/// What goes into a page.
#[derive(Debug)]
pub struct Contents<'a> {
    /// Name of the configuration.
    pub config: String,
    /// The command that makes this page again.
    pub command: String,
    /// The answer.
    pub answer: MeasuredAnswer<'a>,
    /// The site of the configuration.
    pub site: &'a Site,
    /// The rows.
    pub rows: Rows,
    /// The model as configured, held out.
    pub before: View,
    /// The model that was found, held out, where one was.
    pub after: Option<View>,
    /// What errors may depend on: a value per row.
    pub covariates: Vec<(String, Vec<f64>)>,
}

impl Contents<'_> {
    fn unit(&self) -> &'static str {
        match self.rows {
            Rows::Links(_) => "dB",
            Rows::Robots(_) => "m",
        }
    }

    fn is_link(&self) -> bool {
        matches!(self.rows, Rows::Links(_))
    }

    /// Both models, with a class and a name.
    fn views(&self) -> Vec<(&'static str, &'static str, &View)> {
        let mut views = vec![("before", "as configured", &self.before)];
        if let Some(after) = &self.after {
            views.push(("after", "with what was found", after));
        }
        views
    }
}

/// The page.
#[must_use]
pub fn page(contents: &Contents<'_>) -> String {
    let (answer, account) = (contents.answer, contents.answer.account());
    let title = format!(
        "{}: {} against {}",
        if answer.diagnosis().is_some() { "Diagnosis" } else { "Comparison" },
        contents.config,
        account.data.file
    );
    let mut page = begin(&title);
    words::heading(&mut page, contents, &escape(&title));
    words::notices(&mut page, account);
    words::tiles(&mut page, contents);
    if let Some(diagnosis) = answer.diagnosis() {
        let ladder = ladder::pictures(diagnosis, contents.unit());
        figures(
            &mut page,
            "Which effects are missing",
            "Effects are added one at a time, each time the one that makes the model predict best what it has not seen, until none \
             does beyond chance.",
            &ladder,
        );
        words::parameters(&mut page, diagnosis);
        let ties = diagnosis.candidates.iter().map(|candidate| {
            let others = candidate.indistinguishable_from.iter().map(String::as_str);
            (candidate.effect.as_str(), others.collect())
        });
        let next = diagnosis.next_measurement.iter().map(|next| next.sentence.as_str());
        words::ties(&mut page, ties, next);
        words::left_over(&mut page, diagnosis);
    }
    figures(
        &mut page,
        "Where the model errs",
        "A model that is right errs alike everywhere. A bend or a slope over something is physics that the model lacks, or something \
         that goes along with it: look for the strongest, the others may be its shadows. Bars are 90 % intervals of a mean, as if \
         rows were independent.",
        &errors::by_covariate(contents),
    );
    figures(&mut page, "On the map", "", &places::maps(contents));
    figures(
        &mut page,
        "Does it know what it does not know?",
        "A model predicts a distribution, not a number: how strong, how likely to be received, how far off.",
        &errors::pictures(contents),
    );
    match answer {
        MeasuredAnswer::Diagnosis(diagnosis) => words::untestable(&mut page, diagnosis),
        MeasuredAnswer::Comparison(comparison) => words::scores(&mut page, comparison),
    }
    words::again(&mut page, contents);
    page.push_str("</main>\n</body>\n</html>\n");
    page
}

/// How a page begins.
pub(super) fn begin(title: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{}</title>\n<style>\n{}{}</style>\n</head>\n<body>\n<main>\n",
        escape(title),
        include_str!("style.css"),
        include_str!("measured/style.css")
    )
}

pub(super) fn figures(page: &mut String, heading: &str, intro: &str, pictures: &[Picture]) {
    if pictures.is_empty() {
        return;
    }
    let intro = if intro.is_empty() { String::new() } else { format!("<p>{}</p>", escape(intro)) };
    let _ = writeln!(page, "<h2>{}</h2>\n{intro}<div class=\"figures\">", escape(heading));
    for picture in pictures {
        let class = if picture.is_wide { " class=\"wide\"" } else { "" };
        let _ = write!(
            page,
            "<figure{class}>\n<figcaption><h3>{}</h3>\n<p>{}</p>\n<p class=\"means\">{}</p></figcaption>\n<ul class=\"key\">",
            escape(&picture.title),
            escape(&picture.look),
            escape(&picture.means)
        );
        for (mark, words) in &picture.key {
            let shape = super::mark(mark);
            let _ = write!(
                page,
                "<li><svg viewBox=\"0 0 26 12\" aria-hidden=\"true\">{shape}</svg>{}</li>",
                escape(words)
            );
        }
        let _ = write!(page, "</ul>\n<div class=\"plot\">{}</div>\n</figure>\n", picture.svg);
    }
    page.push_str("</div>\n");
}

/// Most dots of a scatter.
const MOST_DOTS: usize = 1500;

/// Rows to draw: all where they are few, else about [`MOST_DOTS`] of them, chosen by their numbers alone.
fn thinned(n: usize) -> impl Iterator<Item = usize> {
    let limit = if n <= MOST_DOTS { u64::MAX } else { u64::MAX / n as u64 * MOST_DOTS as u64 };
    (0..n).filter(move |&row| study::folds::scramble(row as u64) <= limit)
}

/// How many rows are drawn, in words.
fn drawn(n: usize) -> String {
    let n_drawn = thinned(n).count();
    if n_drawn < n {
        format!(" {} of {} rows are drawn.", count(n_drawn as u64), count(n as u64))
    } else {
        String::new()
    }
}

/// Values at shares of the sorted finite ones.
fn quantiles(values: impl Iterator<Item = f64>, shares: &[f64]) -> Option<Vec<f64>> {
    let mut known: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    if known.is_empty() {
        return None;
    }
    Some(shares.iter().map(|share| quantile_nearest(&known, *share)).collect())
}

/// Edges of at most `n` bins with about as many values each; none where the values do not differ.
fn edges(values: &[f64], n: usize) -> Option<Vec<f64>> {
    let shares: Vec<f64> = (0..=n).map(|k| k as f64 / n as f64).collect();
    let mut edges = quantiles(values.iter().copied(), &shares)?;
    edges.dedup();
    (2 <= edges.len()).then_some(edges)
}

/// The bin of a value.
fn bin(edges: &[f64], value: f64) -> usize {
    edges[1..edges.len() - 1].partition_point(|&edge| edge <= value)
}

/// A chart of half the page's width.
pub(super) fn half(x: Axis, y: Axis) -> Chart {
    Chart::new(x, y, super::figures::HALF, super::figures::HALF_HEIGHT)
}

#[cfg(test)]
mod tests;
