//! Which frames took the cells of a run.

use super::layout::number_cell;
use maud::{Markup, html};
use numbers::format::{count, percent};
use record::FinishedRun;

/// Frames by what they are for, if the network counts them so: since the robots started, if they have.
pub(super) fn section(contents: &FinishedRun<'_>) -> Option<Markup> {
    let kpis = contents.summary.kpis.as_ref()?;
    let (frames, period) = match kpis.since_start.frames_by_kind.as_ref() {
        Some(frames) => (frames, "since the robots started"),
        None => (kpis.frames_by_kind.as_ref()?, "in the whole run"),
    };
    let headings = ["transmissions", "share", "of which repeated", "unicast", "acknowledged"];
    Some(html! {
        h2 { "Where the airtime went" }
        p { "Transmissions " (period) ", each of which took a cell. Most first." }
        table {
            tr { th scope="col" { "frames" } @for heading in headings { th.n scope="col" { (heading) } } }
            @for (kind, of) in frames {
                tr {
                    th scope="row" { (kind) }
                    (number_cell(count(of.transmissions)))
                    (number_cell(percent(of.share)))
                    (number_cell(count(of.repeated)))
                    (number_cell(count(of.unicast)))
                    (number_cell(of.acknowledged_ratio.map_or_else(String::new, percent)))
                }
            }
        }
    })
}
