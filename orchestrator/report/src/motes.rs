//! The motes of a network with protocols, one by one, as a table. It can be sorted without a script: each row carries its
//! place by every figure that rows can be sorted by.

use super::figures::network::depths;
use maud::{Markup, html};
use metrics::Measures;
use metrics::kpi::kpi_summary::KpiSummary;
use numbers::format::{count, count_of, number, percent, years};
use record::FinishedRun;
use std::cmp::Ordering;

/// A column: heading, what it says, and the cell of each mote.
struct MoteColumn {
    heading: &'static str,
    doc: &'static str,
    cells: Vec<String>,
}

/// What rows can be sorted by: words, and each mote's figure. Motes without one come last.
struct Key {
    words: &'static str,
    values: Vec<Option<f64>>,
    greatest_first: bool,
}

/// The table, if the network reported figures of its motes.
pub(super) fn section(contents: &FinishedRun<'_>) -> Option<Markup> {
    table(contents.summary.kpis.as_ref()?, contents.measures?)
}

/// The table. `kpis`: of `summary.json`.
fn table(kpis: &KpiSummary, measures: &Measures) -> Option<Markup> {
    let n = measures.kpis.motes.alive.len();
    if kpis.motes.is_empty() {
        return None;
    }
    let figures = Figures { kpis, measures, n };
    let shown = figures.shown();
    let columns: Vec<MoteColumn> =
        figures.columns().into_iter().filter(|column| column.says_something(&shown)).collect();
    let mut keys = figures.keys();
    keys.retain(|key| key.values.iter().any(Option::is_some));
    let places: Vec<Vec<usize>> = keys.iter().map(|key| key.places(&shown)).collect();
    let style_of_row = |row: usize| -> String {
        places.iter().enumerate().map(|(k, places)| format!("--k{k}:{};", places[row])).collect()
    };
    Some(html! {
        h2 { "Motes" }
        details.motes open[n <= MAX_OPEN] {
            summary { (count_of(n as u64, "mote")) " one by one" }
            p {
                "At the end of the run"
                @if let Some((_, period)) = kpis.energy_shown() {
                    "; radio on and lifetime: " (period.words())
                }
                ". Packets are the mote's own, of applications, to one destination; what ended at a mote is \
                 anything that it had to send."
                @if shown.len() < n {
                    " Of " (count(n as u64)) " motes these are the " (count(shown.len() as u64)) " that do worst: those that never \
                    joined, then those of whose packets the smallest share arrived, then those whose packets took longest."
                }
                " All figures of all motes are in " code { "summary.json" } ", " code { "kpis.motes" } ", and over time in "
                code { "motes.parquet" } "."
            }
            p.sort {
                "Sorted by "
                label { input type="radio" name="motes" checked; " number" }
                @for (k, key) in keys.iter().enumerate() {
                    " "
                    label { input type="radio" name="motes" id={ "motes-" (k) }; " " (key.words) }
                }
            }
            div.scroll {
                table style={ "--n:" (columns.len()) } {
                    thead { tr { @for column in &columns { th title=(column.doc) { (column.heading) } } } }
                    tbody {
                        @for (row, &mote) in shown.iter().enumerate() {
                            tr style=(style_of_row(row)) {
                                @for column in &columns { td { (column.cells[mote]) } }
                            }
                        }
                    }
                }
            }
        }
    })
}

/// Where the figures come from.
struct Figures<'a> {
    kpis: &'a KpiSummary,
    measures: &'a Measures,
    n: usize,
}

impl Figures<'_> {
    /// A figure of `summary.json` of each mote.
    fn values(&self, name: &str) -> Vec<Option<f64>> {
        self.kpis.motes.get(name).cloned().unwrap_or_else(|| vec![None; self.n])
    }

    /// The same of the period of which energy is shown.
    fn energy_values(&self, name: &str) -> Vec<Option<f64>> {
        let period = self.kpis.energy_shown().map_or("", |(_, period)| period.suffix());
        self.values(&format!("{name}{period}"))
    }

    fn is_root(&self, mote: usize) -> bool {
        self.measures.kpis.is_root(mote)
    }

    fn parent(&self, mote: usize) -> Option<u32> {
        self.measures.kpis.motes.parent.get(mote).copied().filter(|&parent| parent != u32::MAX)
    }

    /// The motes in the table.
    fn shown(&self) -> Vec<usize> {
        let mut motes: Vec<usize> = (0..self.n).collect();
        if MAX_ROWS < self.n {
            let joined_s = self.values("first_joined_s");
            let [ratio, latency_s] =
                ["delivery_ratio", "median_latency_s"].map(|name| self.values(name));
            let badness = |mote: usize| {
                let ratio = ratio[mote].unwrap_or(2.0);
                (joined_s[mote].is_some(), ratio, -latency_s[mote].unwrap_or(0.0))
            };
            motes.sort_by(|&a, &b| {
                let (a, b) = (badness(a), badness(b));
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
            });
            motes.truncate(MAX_ROWS);
            motes.sort_unstable();
        }
        motes
    }

    /// What ended at each mote, and the words for why.
    fn ended(&self) -> (Vec<Option<f64>>, Vec<String>) {
        let statistics = self.measures.kpis.statistics();
        let columns = statistics.map_or(&[][..], |statistics| &statistics.columns);
        let reasons: Vec<_> = columns
            .iter()
            .filter_map(|column| Some((column.name.strip_prefix("drops_")?, column)))
            .collect();
        let of_mote = |mote: usize| {
            let mut why: Vec<(f64, &str)> = reasons
                .iter()
                .filter_map(|(reason, column)| Some((column.get(mote)?, *reason)))
                .filter(|&(n, _)| n != 0.0)
                .collect();
            why.sort_by(|a, b| b.0.total_cmp(&a.0));
            let words: Vec<String> =
                why.iter().map(|(n, reason)| format!("{} {}", count(*n as u64), reason)).collect();
            let sum = (!reasons.is_empty()).then(|| why.iter().map(|(n, _)| n).sum());
            (sum, words.join(", "))
        };
        (0..self.n).map(of_mote).unzip()
    }

    /// Hops to the root along parents.
    fn depth(&self) -> Vec<Option<f64>> {
        let depths = depths(&self.measures.kpis.motes.parent);
        let is_in = |mote: usize| self.is_root(mote) || self.parent(mote).is_some();
        let depth = |mote: usize| depths.get(mote).copied().flatten().filter(|_| is_in(mote));
        (0..self.n).map(|mote| Some(depth(mote)? as f64)).collect()
    }

    fn columns(&self) -> Vec<MoteColumn> {
        let motes = &self.measures.kpis.motes;
        let each = |heading, doc, cell: &dyn Fn(usize) -> String| MoteColumn {
            heading,
            doc,
            cells: (0..self.n).map(cell).collect(),
        };
        let figure =
            |heading, doc, values: Vec<Option<f64>>, words: &dyn Fn(f64) -> String| MoteColumn {
                heading,
                doc,
                cells: values.into_iter().map(|value| value.map_or_else(dash, words)).collect(),
            };
        let known = |heading, doc, name: &str, words: &dyn Fn(f64) -> String| {
            figure(heading, doc, self.values(name), words)
        };
        let integer = |value: f64| count(value as u64);
        let (ended, why) = self.ended();
        let empty = self.values("battery_empty");
        vec![
            each("mote", "its number", &|mote| {
                let is_empty = empty[mote].is_some_and(|empty| empty != 0.0);
                let state = match (self.is_root(mote), motes.alive.get(mote)) {
                    (_, false) if is_empty => " battery empty",
                    (_, false) => " off",
                    (true, true) => " root",
                    (false, true) => "",
                };
                format!("{mote}{state}")
            }),
            known("joined (s)", "when it was first admitted", "first_joined_s", &number),
            each("parent", "its preferred parent", &|mote| {
                self.parent(mote).map_or_else(dash, |parent| parent.to_string())
            }),
            each("rank", "its routing rank", &|mote| {
                let rank = motes.rank.get(mote).filter(|&&rank| rank < INFINITE_RANK);
                rank.map_or_else(dash, u32::to_string)
            }),
            figure("hops", "to the root, along parents", self.depth(), &integer),
            known(
                "expected",
                "packets that it should have sent while it was alive",
                "expected",
                &integer,
            ),
            known("created", "packets created", "created", &integer),
            known("delivered", "packets delivered", "delivered", &integer),
            known("dropped", "packets dropped on the way", "dropped", &integer),
            known(
                "delivery",
                "delivered, of those delivered or dropped",
                "delivery_ratio",
                &percent,
            ),
            known("latency (s)", "from creation to delivery, median", "median_latency_s", &number),
            known("95 %", "95 % quantile of latency (s)", "p95_latency_s", &number),
            known("max", "longest latency (s)", "max_latency_s", &number),
            known(
                "parents",
                "changes of the preferred parent, the first choice apart",
                "parent_changes",
                &integer,
            ),
            figure(
                "radio on",
                "time the radio sent or listened, over the time the mote was on",
                self.energy_values("duty_cycle"),
                &percent,
            ),
            known("charge (C)", "charge drawn", "charge_uc", &|uc| number(uc / 1e6)),
            figure(
                "lifetime",
                "how long its battery lasts at that rate",
                self.energy_values("lifetime_years"),
                &|value| {
                    let (time, unit) = years(value);
                    format!("{time} {unit}")
                },
            ),
            MoteColumn {
                heading: "ended here",
                doc: "frames and datagrams of any kind that ended here without arriving: how many for which reason",
                cells: ended
                    .into_iter()
                    .zip(why)
                    .map(|(n, why)| match n {
                        None => dash(),
                        Some(_) if why.is_empty() => "0".to_owned(),
                        Some(_) => why,
                    })
                    .collect(),
            },
        ]
    }

    fn keys(&self) -> Vec<Key> {
        let key = |words, values, greatest_first| Key { words, values, greatest_first };
        vec![
            key("delivery, worst first", self.values("delivery_ratio"), false),
            key("latency, longest first", self.values("median_latency_s"), true),
            key("what ended here, most first", self.ended().0, true),
            key("hops, most first", self.depth(), true),
            key("joining, latest first", self.values("first_joined_s"), true),
            key("radio, longest on first", self.energy_values("duty_cycle"), true),
        ]
    }
}

impl MoteColumn {
    /// Whether any mote has something in it.
    fn says_something(&self, shown: &[usize]) -> bool {
        shown.iter().any(|&mote| !self.cells[mote].is_empty() && self.cells[mote] != dash())
    }
}

impl Key {
    /// The place of each of these motes by this figure, from 1.
    fn places(&self, shown: &[usize]) -> Vec<usize> {
        let mut rows: Vec<usize> = (0..shown.len()).collect();
        let value = |row: usize| self.values[shown[row]];
        rows.sort_by(|&a, &b| match (value(a), value(b)) {
            (Some(a), Some(b)) if self.greatest_first => b.total_cmp(&a),
            (Some(a), Some(b)) => a.total_cmp(&b),
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (None, None) => Ordering::Equal,
        });
        let mut places = vec![0; rows.len()];
        for (place, &row) in (1..).zip(&rows) {
            places[row] = place;
        }
        places
    }
}

/// Where there is nothing to say.
fn dash() -> String {
    "–".to_owned()
}

/// Most motes with which the table is open from the beginning.
const MAX_OPEN: usize = 60;
/// Most motes in the table.
const MAX_ROWS: usize = 500;
/// The rank of a mote without a way to a root (RFC 6550, § 17).
const INFINITE_RANK: u32 = 65_535;

#[cfg(test)]
mod tests {
    use super::*;

    use metrics::{Kpis, Task};
    use proto::site::Site;
    use proto::types::{AgentStates, Bitmap, MoteStates, MoteStatistics, Statistic};

    /// The section of so many motes, all children of mote 0, of which mote 7 has not joined.
    fn section_of(n: usize) -> String {
        let column = |name: &str, value: &dyn Fn(usize) -> f64| Statistic {
            name: name.to_owned(),
            values: (0..n).map(value).collect(),
            ..Statistic::default()
        };
        let mut joined = column("first_joined_ns", &|mote| 1e9 * mote as f64);
        let mut known = Bitmap::filled(n, true);
        known.set(7, false);
        joined.known = Some(known);
        let columns = vec![
            column("is_root", &|mote| f64::from(u8::from(mote == 0))),
            joined,
            column("charge_uc", &|mote| 1e6 * mote as f64),
            column("up_ns", &|_| 1e9),
            column("drops_max_retries", &|mote| f64::from(u8::from(mote == 3))),
            column("drops_no_route", &|mote| 2.0 * f64::from(u8::from(mote == 3))),
        ];
        let mut kpis = Kpis::new(None, Some(MoteStatistics { columns }));
        let parent = (0..n).map(|mote| if mote == 0 { u32::MAX } else { 0 }).collect();
        kpis.motes = MoteStates {
            alive: Bitmap::filled(n, true),
            rank: vec![512; n],
            parent,
            ..MoteStates::default()
        };
        let summary = kpis.summary();
        let states = AgentStates::at_origin(n);
        let measures = Measures::new(Task::from_config(""), Site::default(), &states, kpis);
        table(&summary.unwrap(), &measures).unwrap().into_string()
    }

    #[test]
    fn each_mote_has_its_row_and_figures_that_nobody_has_no_column() {
        let page = section_of(9);
        assert!(page.contains("<details class=\"motes\" open><summary>9 motes one by one"));
        assert_eq!(page.matches("<tr style").count(), 9);
        let row = |mote: &str| {
            page.split("<tr").find(|row| row.contains(&format!("<td>{mote}</td>"))).unwrap()
        };
        assert!(
            row("0 root").contains("<td>0 root</td><td>0</td><td>–</td><td>512</td><td>0</td>")
        );
        assert!(row("3").contains("<td>2 no_route, 1 max_retries</td>"), "{}", row("3"));
        assert!(row("7").contains("<td>7</td><td>–</td><td>0</td>"), "{}", row("7"));
        assert!(!page.contains(">latency (s)<") && !page.contains("latency, longest"), "{page}");
        assert!(!page.contains("NaN") && !page.contains("inf"));
    }

    #[test]
    fn of_many_motes_the_worst_are_shown_and_the_rest_is_said_to_be_missing() {
        let page = section_of(2 * MAX_ROWS);
        assert!(page.contains("<details class=\"motes\"><summary>1,000 motes one by one"));
        assert_eq!(page.matches("<tr style").count(), MAX_ROWS);
        assert!(page.contains("Of 1,000 motes these are the 500 that do worst"));
        assert!(page.contains("<td>7</td><td>–</td>"), "mote 7, which never joined");
        assert!(section_of(MAX_ROWS).matches("<tr style").count() == MAX_ROWS);
        assert!(!section_of(MAX_ROWS).contains("do worst"));
    }

    #[test]
    fn places_follow_the_figure_and_motes_without_one_come_last() {
        let values = vec![Some(0.5), None, Some(1.0), Some(0.2)];
        let key = |greatest_first| Key { words: "", values: values.clone(), greatest_first };
        assert_eq!(key(false).places(&[0, 1, 2, 3]), [2, 4, 3, 1]);
        assert_eq!(key(true).places(&[0, 1, 2, 3]), [2, 4, 1, 3]);
        assert_eq!(key(true).places(&[1, 3]), [2, 1]);
    }
}
