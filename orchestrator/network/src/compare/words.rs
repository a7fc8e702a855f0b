//! A comparison of a network in words: the text of the terminal.

use super::shown;
use crate::comparison::NetworkComparison;
use numbers::format::capitalised;
use std::fmt::Write as _;

/// A comparison as a person reads it on a terminal.
#[must_use]
pub(crate) fn text(comparison: &NetworkComparison) -> String {
    let among = &comparison.among;
    let mut text = format!(
        "{:<20} {:>12}   {:<28} {:>8}\n",
        "figure",
        "measured",
        format!("model, 90 % of {} seeds", among.seeds),
        "p"
    );
    for kpi in &among.kpis {
        let p = kpi.p_value.map_or("–".to_owned(), |p_value| format!("{p_value:.3}"));
        let [low, high] = [kpi.model.low, kpi.model.high].map(|end| shown(end, kpi.unit));
        let model = if kpi.model.low.is_nan() { low } else { format!("{low} to {high}") };
        let measured = shown(kpi.measured, kpi.unit);
        let _ = writeln!(text, "{:<20} {measured:>12}   {model:<28} {p:>8}", kpi.name);
    }
    let outside = among.motes.iter().filter(|mote| mote.is_outside);
    let outside: Vec<String> = outside.map(|mote| mote.mote.to_string()).collect();
    if !outside.is_empty() {
        let _ = writeln!(
            text,
            "the delivery ratio of motes {} is outside the 90 % interval of the seeds",
            outside.join(", ")
        );
    }
    let _ = write!(text, "\n{}", capitalised(&comparison.sentence));
    text
}
