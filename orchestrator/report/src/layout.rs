//! What all pages have in common: the shell around them, and the parts that come up in several.
//!
//! A page is one file that opens without a network. Without a script it shows everything; the script of figures adds tables,
//! values and zoom.

use super::svg::data::DATA_TAG;
use maud::{DOCTYPE, Markup, PreEscaped, Render, html};
use std::sync::LazyLock;

/// The style of all pages.
const STYLE: &str = include_str!("style.css");

/// The script of pages with figures, without indentation and lines of comments.
static FIGURES: LazyLock<String> = LazyLock::new(|| {
    let lines = include_str!("figures.js").lines().map(str::trim_start);
    lines.filter(|line| !line.starts_with("//")).collect::<Vec<_>>().join("\n")
});

/// A whole page. `style`: rules of this kind of page, beside those of all.
pub fn page(title: &str, style: &str, body: &Markup) -> String {
    page_with_scripts(title, style, &[], body)
}

/// The same with scripts, by their hashes: no other runs, and nothing is loaded.
pub fn page_with_scripts(title: &str, style: &str, scripts: &[String], body: &Markup) -> String {
    let figures = body.0.contains(DATA_TAG).then_some(FIGURES.as_str());
    let figures_hash = figures.map(view::page::source_hash);
    let scripts: String =
        scripts.iter().chain(&figures_hash).map(|hash| format!(" '{hash}'")).collect();
    let scripts = if scripts.is_empty() { " 'none'" } else { &scripts };
    let policy = format!(
        "default-src 'none'; script-src{scripts}; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action \
         'none'"
    );
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(policy);
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            body {
                main { (body) }
                @if let Some(figures) = figures { script { (PreEscaped(figures)) } }
            }
        }
    }
    .into_string()
}

/// What must be known before anything else on the page is believed, if there is anything.
pub fn notices(items: &[impl Render]) -> Option<Markup> {
    let list = html! {
        section.notice aria-label="Warnings" {
            ul { @for item in items { li { (item) } } }
        }
    };
    (!items.is_empty()).then_some(list)
}

/// The few numbers at the top of a page: name and value of each.
pub fn tiles<'a>(tiles: impl IntoIterator<Item = (&'a str, Markup)>) -> Markup {
    html! {
        dl.tiles {
            @for (name, value) in tiles {
                div.tile { dt { (name) } dd { (value) } }
            }
        }
    }
}

/// A number and its unit, of a tile.
pub fn with_unit(number: &str, unit: &str) -> Markup {
    html! { (number) " " small { (unit) } }
}

/// What a gain in log score means, where one is shown.
pub const NATS: &str = "A gain of g nats a row makes a held-out row eᵍ times as likely, in geometric mean over the rows: \
                        0.1 nats, 1.11 times.";

/// The unit of log scores, explained.
pub fn nats() -> Markup {
    html! { abbr title=(NATS) { "nats" } }
}

/// A picture under its heading, its words and the key to its marks.
///
/// * `words`: its paragraphs.
/// * `key`: its entries, see [`key_entry`].
pub fn figure(title: &str, words: &Markup, key: &Markup, svg: &Markup, is_wide: bool) -> Markup {
    html! {
        figure class=[is_wide.then_some("wide")] {
            figcaption { h3 { (title) } (words) }
            @if !key.0.is_empty() { ul.key { (key) } }
            div.plot { (svg) }
        }
    }
}

/// A picture of several panels under its words and the key to its marks. `id`: where links on the page lead.
pub fn figure_of(id: &str, words: &Markup, key: &Markup, panels: &Markup, is_wide: bool) -> Markup {
    html! {
        figure id=(id) class=[is_wide.then_some("wide")] {
            figcaption { (words) }
            ul.key { (key) }
            (panels)
        }
    }
}

/// An entry of a key: a mark and what it means. `mark`: the class that the mark has in the picture; `series`: the class of the
/// group of marks that it belongs to there.
pub fn key_entry(mark: &str, series: Option<&str>, words: &str) -> Markup {
    html! {
        li class=[series] { svg viewBox="0 0 26 12" aria-hidden="true" { (sample(mark)) } (words) }
    }
}

/// How a mark looks in a key.
fn sample(mark: &str) -> Markup {
    let path = |shape: &str| html! { path class=(mark) d=(shape) {} };
    match mark {
        "band" => path("M0,1H26V11H0Z"),
        ends if ends.starts_with("end ") => path("M13,6h0"),
        "span" | "foliage" => path("M0,1H26V11H0Z"),
        "start" | "end" | "mote" => path("M13,6h0"),
        "dot" | "dot after" | "trial" => path("M5,8h0M10,4h0M15,7h0M20,5h0"),
        dot if dot.starts_with("point ") => path("M13,6h0"),
        "interval" => html! {
            g.interval { path d="M13,1V11M10,1h6M10,11h6" {} circle cx="13" cy="6" r="3" {} }
        },
        filled if filled.starts_with("cell") || filled.starts_with('b') && filled != "before" => {
            path("M8,1H18V11H8Z")
        }
        _ => path("M0,6H26"),
    }
}

/// Text that is copied, as a block.
pub fn listing(text: &str) -> Markup {
    html! { pre { (text) } }
}

/// A cell of a table that holds a number, or a range of them.
pub fn number_cell(number: impl Render) -> Markup {
    html! { td.n { (number) } }
}
