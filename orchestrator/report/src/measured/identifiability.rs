//! What the design of the measurements can tell.

use super::MeasuredPage;
use crate::layout::number_cell;
use diagnose::identifiability::SizeOfParameter;
use maud::{Markup, html};
use numbers::format::number;

/// From which size on each effect would be found, and told apart from its nearest rivals.
pub(super) fn section(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let table = contents.answer.diagnosis()?.identifiability.as_ref()?;
    let unit = table.unit;
    let size = |size: Option<f64>| number_cell(number(size.unwrap_or(f64::NAN)));
    Some(html! {
        h2 { "What these data can tell" }
        p {
            "By their design alone, before any search, and by noise of " (number(table.noise)) " " (unit) ". From the first size on, 9 of \
             10 such campaigns would show the effect. From the second on they would also tell it apart from its nearest rivals. \
             These explain the share in brackets of what it moves. Sizes are root mean squares over the rows."
        }
        table {
            tr {
                th { "effect" }
                th.n { "found from (" (unit) ")" }
                th { "that is" }
                th.n { "told apart from (" (unit) ")" }
                th { "nearest rivals" }
            }
            @for effect in &table.effects {
                tr {
                    td { (effect.effect) }
                    (size(effect.found_from))
                    td { (effect.parameter.as_ref().map(SizeOfParameter::words).unwrap_or_default()) }
                    (size(effect.told_apart_from))
                    td { (effect.rivals_in_words().unwrap_or_default()) }
                }
            }
        }
        @if !table.without_size.is_empty() {
            p { "No size can be stated of these:" }
            table {
                @for lacking in &table.without_size {
                    tr { th scope="row" { (lacking.effects.join(", ")) } td { (lacking.because) } }
                }
            }
        }
    })
}
