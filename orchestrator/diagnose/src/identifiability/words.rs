//! The table of what measurements can tell, as people read it.

use super::{EffectSize, Identifiability, SizeOfParameter};
use crate::gate::decimals;
use numbers::format::{percent, with_unit, wrapped};
use numbers::layout::{TextTable, WIDTH};
use std::fmt::Write as _;

/// How many effects are listed on a terminal: those whose rivals explain most.
const MOST_LISTED: usize = 12;

impl SizeOfParameter {
    /// The parameter in words: `gain_db by 0.56 dB`.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { key, unit, by, value } = self;
        let (how, number) = if by.is_some() { ("by", by) } else { ("of", value) };
        let number = number.map(size).unwrap_or_default();
        format!("{key} {how} {}", with_unit(&number, unit))
    }
}

impl EffectSize {
    /// The rivals in words, with the share that they explain; none where there are none.
    #[must_use]
    pub fn rivals_in_words(&self) -> Option<String> {
        (!self.rivals.is_empty())
            .then(|| format!("{} ({})", self.rivals.join(" + "), percent(self.explained)))
    }
}

/// A size with two digits.
fn size(value: f64) -> String {
    format!("{value:.*}", decimals(value, 0.0))
}

/// The table as a person reads it on a terminal.
#[must_use]
pub fn text(table: &Identifiability) -> String {
    let Identifiability { noise, unit, effects, without_size } = table;
    let noise = with_unit(&size(*noise), unit);
    let mut text = format!(
        "what these data can tell, before any search (rms over the rows; noise {noise}):\n"
    );
    let or_none = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), size);
    let headings = [
        "effect".to_owned(),
        format!("found from {unit}"),
        "that is".to_owned(),
        format!("told apart from {unit}"),
        "its nearest rival (what it explains)".to_owned(),
    ];
    let rows = effects.iter().take(MOST_LISTED).map(|effect| {
        [
            effect.effect.clone(),
            or_none(effect.found_from),
            effect.parameter.as_ref().map(SizeOfParameter::words).unwrap_or_default(),
            or_none(effect.told_apart_from),
            effect.rivals_in_words().unwrap_or_else(|| "-".to_owned()),
        ]
    });
    let rows: Vec<[String; 5]> = rows.collect();
    // Sizes that are stated of no effect have no columns.
    let is_empty =
        |column: usize| rows.iter().all(|row| row[column].is_empty() || row[column] == "-");
    let columns: Vec<usize> = (0..5).filter(|&it| it == 0 || !is_empty(it)).collect();
    let mut aligned = TextTable::new(columns.iter().map(|&it| headings[it].clone())).indented(2);
    for (place, _) in columns.iter().enumerate().filter(|(_, column)| [2, 4].contains(*column)) {
        aligned = aligned.text_in(place);
    }
    for row in &rows {
        aligned.row(columns.iter().map(|&it| row[it].clone()));
    }
    if !rows.is_empty() {
        text.push_str(&aligned.text());
    }
    if MOST_LISTED < effects.len() {
        let _ = writeln!(text, "  and {} more; --json lists all", effects.len() - MOST_LISTED);
    }
    if !without_size.is_empty() {
        text.push_str("  no size before a search:\n");
    }
    for lacking in without_size {
        let is_of_all = effects.iter().all(|it| lacking.effects.contains(&it.effect));
        let names = if is_of_all && !effects.is_empty() {
            "all of these".to_owned()
        } else {
            lacking.effects.join(", ")
        };
        let entry = format!("{names} ({})", lacking.because);
        let _ = writeln!(text, "    {}", wrapped(&entry, "      ", WIDTH).trim_start());
    }
    text
}
