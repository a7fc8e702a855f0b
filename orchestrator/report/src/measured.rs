//! The page of a comparison or a diagnosis: a model against measurements in pictures, each with what to look at and what it
//! means. One file that opens without a network and shows everything without a script.

mod errors;
mod identifiability;
pub(crate) mod ladder;
mod places;
pub(crate) mod words;

use super::layout;
use super::svg::{Axis, Chart};
use diagnose::compare::comparison::Comparison;
use diagnose::diagnosis::Diagnosis;
use diagnose::rows::{MeasuredRows, PredictedRows};
use maud::{Markup, html};
use measure::account::DataAccount;
use numbers::format::count;
use numbers::statistics::quantile_nearest;
use proto::site::Site;
use serde::Serialize;
use study::view::RowPredictions;

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
    pub(super) svg: Markup,
    pub(super) is_wide: bool,
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
    fn account(self) -> &'a DataAccount {
        match self {
            Self::Comparison(comparison) => &comparison.account,
            Self::Diagnosis(diagnosis) => &diagnosis.account,
        }
    }

    /// The comparison, if it is one.
    fn comparison(self) -> Option<&'a Comparison> {
        match self {
            Self::Comparison(comparison) => Some(comparison),
            Self::Diagnosis(_) => None,
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
pub struct MeasuredPage<'a> {
    /// Name of the configuration.
    pub config: String,
    /// The command that makes this page again.
    pub command: String,
    /// The comparison or diagnosis that the page shows.
    pub answer: MeasuredAnswer<'a>,
    /// The site of the configuration.
    pub site: &'a Site,
    /// The measured rows with the predictions of both models.
    pub rows: PredictedRows,
}

impl MeasuredPage<'_> {
    fn title(&self) -> String {
        let kind = if self.answer.diagnosis().is_some() { "Diagnosis" } else { "Comparison" };
        format!("{kind}: {} against {}", self.config, self.answer.account().data.file)
    }

    fn unit(&self) -> &'static str {
        match self.rows.rows {
            MeasuredRows::Links(_) => "dB",
            MeasuredRows::Robots(_) => "m",
        }
    }

    /// Whether it is known of some frames that they were lost.
    fn knows_losses(&self) -> bool {
        let MeasuredRows::Links(links) = &self.rows.rows else { return false };
        links.frames.iter().any(|[sent, got]| got.is_finite() && got < sent)
    }

    fn is_link(&self) -> bool {
        matches!(self.rows.rows, MeasuredRows::Links(_))
    }

    /// Both models, with a class and a name.
    fn views(&self) -> Vec<(&'static str, &'static str, &RowPredictions)> {
        let mut views = vec![("before", "as configured", &self.rows.before)];
        if let Some(after) = &self.rows.after {
            views.push(("after", "with what was found", after));
        }
        views
    }
}

/// A section of the page, or none where the answer has nothing to show in it.
type Section = fn(&MeasuredPage<'_>) -> Option<Markup>;

/// The page from top to bottom.
const SECTIONS: &[Section] = &[
    words::heading,
    words::notices,
    words::tiles,
    ladder::section,
    words::parameters,
    words::ties,
    words::unexplained,
    words::not_found,
    identifiability::section,
    errors::by_covariate,
    places::maps,
    errors::of_distributions,
    words::untestable,
    words::scores,
    words::again,
];

/// The style of pages about measurements, beside that of all pages.
pub(super) const STYLE: &str = include_str!("measured/style.css");

/// The page of a comparison or diagnosis of links or robots: one HTML file that needs no other.
#[must_use]
pub fn page(contents: &MeasuredPage<'_>) -> String {
    let sections = SECTIONS.iter().filter_map(|section| section(contents));
    layout::page(&contents.title(), STYLE, &html! { @for section in sections { (section) } })
}

/// Pictures under a heading, with a paragraph before them if `intro` is not empty; none where there are no pictures.
pub(super) fn figures(heading: &str, intro: &str, pictures: &[Picture]) -> Option<Markup> {
    let figures = html! {
        h2 { (heading) }
        @if !intro.is_empty() { p { (intro) } }
        div.figures { @for picture in pictures { (picture.markup()) } }
    };
    (!pictures.is_empty()).then_some(figures)
}

impl Picture {
    fn markup(&self) -> Markup {
        let words = html! { p { (self.look) } p.means { (self.means) } };
        let key =
            html! { @for (mark, words) in &self.key { (layout::key_entry(mark, None, words)) } };
        layout::figure(&self.title, &words, &key, &self.svg, self.is_wide)
    }
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
