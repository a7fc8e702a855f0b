//! Words on a run's page that lead to a moment of the run in its player.

use maud::{Markup, PreEscaped, Render as _, html};
use numbers::format::count_of;
use record::run_summary::RunSummary;

/// What robots do whose contacts are not resolved, as the warning of the summary says it.
const PASSED: &str = "went into or through walls and obstacles";

/// Words that the script of the player makes a button of, which goes to the first moment of a kind, and then to the next. Without a
/// script or a player they are words.
///
/// * `kind`: the name that the page has for it (`Moments.name` in `orchestrator/page/src/moments.ts`).
pub(super) fn moment(kind: &str, words: &Markup) -> Markup {
    html! { span data-moment=(kind) { (words) } }
}

/// A sentence in which the first count of collisions leads to them.
pub(super) fn with_moments(text: &str, summary: &RunSummary) -> Markup {
    let n = summary.task.as_ref().and_then(|task| task.number("collisions"));
    let collisions = n.map(|n| (count_of(n as u64, "collision"), "collision"));
    let phrases = collisions.into_iter().chain([(PASSED.to_owned(), "site_collision")]);
    let found = phrases.into_iter().find_map(|(phrase, kind)| {
        let (before, after) = text.split_once(&phrase)?;
        Some((before, moment(kind, &phrase.render()), after))
    });
    found.map_or_else(
        || text.render(),
        |(before, moment, after)| html! { (before) (moment) (after) },
    )
}

/// Parts with something between them.
pub(super) fn joined(parts: &[Markup], between: &str) -> Markup {
    let parts: Vec<&str> = parts.iter().map(|part| part.0.as_str()).collect();
    PreEscaped(parts.join(between))
}
