//! Who heard whom: in the last period of a run, and in each one before it for those who ask.

use super::plan::{between, plan, plan_width};
use super::{Figure, HALF, dots_by_group};
use maud::{Markup, html};
use metrics::Measures;
use metrics::hearing::HeardPeriod;
use numbers::format::{count, count_of, number};
use proto::types::seconds;

/// The picture, if the network reports who has heard whom.
pub(super) fn figure(measures: &Measures) -> Option<Figure> {
    let mut periods = measures.hearing.periods();
    // Without protocols there is no network to be connected.
    measures.kpis.heard_links.as_ref()?;
    // Where nobody was heard there is nothing to draw.
    periods.retain(|period| !period.pairs.is_empty());
    let last = periods.pop().filter(|last| !last.places.is_empty())?;
    let width = plan_width(&last.places);
    let mut chart = plan(&last.places, width);
    let thinned = links(&mut chart, &last, MAX_LINES);
    let motes = || last.places.iter().enumerate();
    let mut key = dots_by_group(&mut chart, &measures.task, ["mote", "mote"], motes());
    chart.numbers(motes().filter_map(|(mote, place)| Some((mote, (*place)?))));
    let n = last.places.iter().flatten().count();
    let n_both = last.pairs.values().filter(|&&both| both).count();
    let dead = match last.places.len() - n {
        0 => String::new(),
        n => format!(" Left out, not working then: {}.", count_of(n as u64, "mote")),
    };
    let sentence = format!(
        "Which motes heard each other {}: {}, {} of them both ways, {} neighbours a mote on average; drawn where they are at the end of \
         that period.{dead}{thinned}",
        words(measures, &last),
        count_of(last.pairs.len() as u64, "pair"),
        count(n_both as u64),
        number(2.0 * last.pairs.len() as f64 / n.max(1) as f64)
    );
    key.push(("link", "both heard each other".into()));
    if n_both < last.pairs.len() {
        key.push(("link one-way", "one heard the other".into()));
    }
    let svg = chart.finish("connectivity", "Connectivity", &sentence);
    let svg = html! { (svg) (earlier(measures, &periods)) };
    Some(Figure { title: "Connectivity", sentence, key, svg, is_wide: HALF < width })
}

/// The periods before the last, each to be opened.
fn earlier(measures: &Measures, periods: &[HeardPeriod]) -> Markup {
    html! {
        @if !periods.is_empty() {
            div.periods {
                span.soft { "Before that:" }
                @for (index, period) in periods.iter().enumerate() {
                    details name="connectivity" {
                        summary { (words(measures, period)) }
                        (small(measures, index, period))
                    }
                }
            }
        }
    }
}

fn small(measures: &Measures, index: usize, period: &HeardPeriod) -> Markup {
    let mut chart = plan(&period.places, HALF);
    let thinned = links(&mut chart, period, MAX_SMALL_LINES);
    let motes = || period.places.iter().enumerate();
    dots_by_group(&mut chart, &measures.task, ["mote", "mote"], motes());
    chart.numbers(motes().filter_map(|(mote, place)| Some((mote, (*place)?))));
    let pairs = count_of(period.pairs.len() as u64, "pair");
    let text = format!("{pairs} of motes heard each other {}.{thinned}", words(measures, period));
    let svg = chart.finish(&format!("connectivity-{index}"), "Connectivity", &text);
    html! { p { (text) } (svg) }
}

/// Draws the pairs; says so where it does not draw all.
fn links(chart: &mut crate::svg::Chart, period: &HeardPeriod, most: usize) -> String {
    let every = period.pairs.len().div_ceil(most).max(1);
    let drawn = |wanted: bool| {
        let chosen = period.pairs.iter().step_by(every).filter(move |&(_, &both)| both == wanted);
        chosen.filter_map(|(&(a, b), _)| {
            Some((format!("{a} and {b}"), between(&period.places, a, b)?))
        })
    };
    for (class, both) in [("link", true), ("link one-way", false)] {
        let (names, lines): (Vec<String>, Vec<_>) = drawn(both).unzip();
        chart.names(names);
        chart.segments(class, lines);
    }
    if every < 2 {
        return String::new();
    }
    chart.note(format!("One pair of {every} is drawn"));
    format!(" One pair of {every} is drawn.")
}

/// When a period was, in simulated time.
fn words(measures: &Measures, period: &HeardPeriod) -> String {
    let [from, until] = [period.from_ns, period.until_ns].map(|ns| number(seconds(ns)));
    let until_start = period.until_ns <= measures.start_ns;
    format!("from {from} to {until} s{}", if until_start { ", robots waiting" } else { "" })
}

/// Most lines of the plan of the last period, and of one before it.
const MAX_LINES: usize = 8000;
const MAX_SMALL_LINES: usize = 1000;
