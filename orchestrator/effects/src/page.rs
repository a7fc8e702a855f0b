//! The catalogue as a page of the documentation.

use super::{Listed, all, judged};
use std::fmt::Write as _;

/// docs/effects.md.
#[must_use]
pub fn page() -> String {
    let all = all();
    let mut page = String::from(
        "# Physical effects\n\nThe effects that can be added to the simulators' base models, and that `diagnose` tests on \
         measurements.\nThis page is generated from the lists that the programs use. `murmuration effects NAME` prints an \
         effect with a plot, `murmuration effects --json -` all effects as JSON.\n\nA run and a fit use the same function \
         with the same keys.\nAn effect that is not configured contributes exactly nothing.\nTo write an effect: \
         [adding-an-effect.md](adding-an-effect.md).\nThe base models: [radio.md](radio.md), \
         [robots.md](robots.md).\n\nContributions are in dB and added to the received power, so attenuation is negative. \
         `loss_db` is positive and attenuates; `…_per_…` is added with its sign.\n\n| effect | simulator | description | needs \
         |\n|---|---|---|---|\n",
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
    for field in effect.fields() {
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
    let _ = writeln!(page, "- Validity: {}", about.validity);
    let _ = writeln!(page, "- Signature in the residuals of a model without it: {}", about.trace);
    let _ = writeln!(page, "- Required in the measurements: {}.", effect.needs().join("; "));
    let _ = writeln!(page, "- Evaluation: {}.", judged(fit.level));
    if !fit.generalises.is_empty() {
        let names: Vec<String> = fit.generalises.iter().map(|name| format!("`{name}`")).collect();
        let _ = writeln!(
            page,
            "- Special cases, preferred if they explain as much: {}.",
            names.join(", ")
        );
    }
    if let Some(covariate) = effect.straight_over() {
        let _ = writeln!(
            page,
            "- A curve over `{covariate}` is preferred if a straight line does not suffice."
        );
    }
    let _ = writeln!(page, "\n```toml\n{}\n```", effect.example().trim_end());
}

/// Text in a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}
