//! `report.html`: a run in pictures and numbers, in one file that opens without a network. Only its player and the tools of
//! its figures need a script.
//!
//! The page is a list of sections. To add one, write a function like those of the list in a file of its own, and name it in
//! `SECTIONS`.

mod airtime;
pub mod between;
mod details;
mod figures;
pub mod layout;
pub mod measured;
mod moments;
mod motes;
pub mod packets;
mod player;
pub mod story;
pub mod svg;
mod top;
mod verdict;

use maud::{Markup, html};
use record::{FinishedRun, TRUTH_BASELINE};

/// A section of the page, or none where the run has nothing to show in it.
type Section = fn(&FinishedRun<'_>) -> Option<Markup>;

/// The page from top to bottom.
const SECTIONS: &[Section] = &[
    top::heading,
    verdict::section,
    top::notices,
    top::tiles,
    player::section,
    figures::section,
    airtime::section,
    motes::section,
    details::facts,
    details::again,
    details::delivery_in_numbers,
    details::provenance,
];

/// The page of a run: one HTML file that needs no other.
#[must_use]
pub fn page(contents: &FinishedRun<'_>) -> String {
    let name = &contents.header.name;
    let title =
        if is_truth(contents) { format!("{name} ({TRUTH_BASELINE})") } else { name.clone() };
    let sections = SECTIONS.iter().filter_map(|section| section(contents));
    let body = html! { @for section in sections { (section) } };
    layout::page_with_scripts(&title, "", &player::scripts(), &body)
}

/// Whether robots knew the truth in place of what they heard.
fn is_truth(contents: &FinishedRun<'_>) -> bool {
    contents.summary.baseline.is_some()
}

#[cfg(test)]
mod tests;
