//! The catalogue as a page of the documentation.

use super::{Listed, all, judged};
use std::fmt::Write as _;

/// docs/effects.md.
#[must_use]
pub fn page() -> String {
    let all = all();
    let mut page = String::from(
        "# Physical effects\n\n\
         What can be added to the simulators' base models, and what a search for missing physics tries on measurements.\n\
         This page is made from the lists that the programs use; `orchestrator effects NAME` says the same with a picture, \
         `orchestrator effects --json -` gives all of it as JSON.\n\n\
         An effect is used alike by a run and by a fit: the same function of the same keys.\n\
         One that is not configured contributes exactly nothing.\n\
         How to write one: [adding-an-effect.md](adding-an-effect.md).\n\
         What the base models are: [radio.md](radio.md), [robots.md](robots.md).\n\n\
         Contributions are dB added to the received power, so attenuation is negative; `loss_db` is positive and attenuates, \
         `…_per_…` is added with its sign.\n\n\
         | effect | of | what | needs |\n|---|---|---|---|\n",
    );
    for effect in &all {
        let _ = writeln!(
            page,
            "| [`{0}`](#{1}) | {2} | {3} | {4} |",
            effect.variant.name,
            anchor(effect, &all),
            effect.of,
            cell(effect.variant.doc),
            cell(&effect.needs().join("; ")),
        );
    }
    for effect in &all {
        section(&mut page, effect, &all);
    }
    page
}

/// Heading of an effect: its name, with what it is about where two have the same.
fn heading(effect: &Listed, all: &[Listed]) -> String {
    let name = effect.variant.name;
    match all.iter().filter(|other| other.variant.name == name).count() {
        1 => name.to_owned(),
        _ => format!("{name}: {}", effect.of),
    }
}

fn anchor(effect: &Listed, all: &[Listed]) -> String {
    heading(effect, all).replace(": ", "-")
}

fn section(page: &mut String, effect: &Listed, all: &[Listed]) {
    let (about, fit) = (effect.about, effect.fit);
    let _ = write!(page, "\n## {}\n\n{}\n\n", heading(effect, all), effect.variant.doc);
    let _ = writeln!(page, "{}\n", about.mechanism);
    let _ = writeln!(page, "```text\n{}\n```\n", about.equation);
    let _ = writeln!(page, "| key | meaning | range | fitted |\n|---|---|---|---|");
    for field in effect.variant.fields {
        let _ = writeln!(
            page,
            "| `{}` | {} | {} | {} |",
            field.key,
            cell(field.doc),
            cell(&effect.range(field)),
            effect.fitted(field.key).map_or("–".to_owned(), |fitted| cell(&fitted)),
        );
    }
    let _ = writeln!(page, "\n- Source: {}", about.source);
    let _ = writeln!(page, "- Where it holds: {}", about.validity);
    let _ = writeln!(page, "- In the residuals of a model without it: {}", about.trace);
    let _ = writeln!(page, "- Needs {}.", effect.needs().join("; "));
    let _ = writeln!(page, "- Judged {}.", judged(fit.level));
    if !fit.generalises.is_empty() {
        let names: Vec<String> = fit.generalises.iter().map(|name| format!("`{name}`")).collect();
        let _ = writeln!(page, "- Gives way to {} where that explains as much.", names.join(", "));
    }
    if let Some(covariate) = effect.straight_over() {
        let _ = writeln!(
            page,
            "- Gives way to a curve over `{covariate}` where that explains what a straight line cannot."
        );
    }
    let _ = writeln!(page, "\n```toml\n{}\n```", effect.example().trim_end());
}

/// Text in a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}
