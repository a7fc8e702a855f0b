//! Where and when an effect acts: the table `only` that every effect accepts.
//!
//! Each simulator describes its own table, with the keys of [`Span`] in it, and reads it by [`read`], so that both decide alike.

use crate::config::{Lists, Node, Problem, Section, TableSpec, check};
use crate::formula::{Bound, Formula, MOST_NAMES, Written};

/// The key of the table.
pub const KEY: &str = "only";
/// What the key of the table means.
pub const DOC: &str = "Limits the effect to some agents, runs, times or conditions; all keys given must hold. Absent: it acts everywhere and always.";
/// The key of its condition.
const WHERE: &str = "where";
/// No list of the table has more entries.
pub const MOST_ENTRIES: usize = 10_000;

/// The runs and times at which an effect acts.
#[derive(Clone, Debug, Section)]
pub struct Span {
    /// Numbers of the measured runs (column run) in which the effect acts. For comparisons with measurements; a simulation is no run of
    /// a campaign and refuses this key.
    #[key(length = 1..=MOST_ENTRIES)]
    runs: Option<Vec<u32>>,
    /// Time from which the effect acts (s), itself included. Absent: from the start.
    #[key(range = 0.0..=MOST_S)]
    from_s: Option<f64>,
    /// Time from which the effect no longer acts (s). Absent: it does not end.
    #[key(above = 0.0, most = MOST_S)]
    until_s: Option<f64>,
}

/// Nanoseconds of later times than this (s) do not fit into a time.
const MOST_S: f64 = 1e10;

/// A table `only`, as a simulator has read it.
#[derive(Clone, Debug)]
pub struct Limits {
    /// The key that lists whom the effect concerns, and its value.
    pub members: (&'static str, Option<Vec<u32>>),
    /// When it acts.
    pub span: Span,
    /// The key `where`.
    pub condition: Option<String>,
}

/// What limits an effect. `R`: how the condition reads a number off a situation.
#[derive(Clone, Debug)]
pub struct Only<R> {
    /// Ascending. `None`: all.
    members: Option<Vec<u32>>,
    /// Ascending. `None`: all.
    runs: Option<Vec<u32>>,
    /// From when on (s), to before when.
    span_s: [f64; 2],
    condition: Option<Bound<R>>,
}

/// What the table `only` of an effect that stands at `path` limits it to.
///
/// `names`: what a condition may use, and how each is read. Other names are columns of measurements or covariates of robots.
///
/// Nothing is returned where something is wrong, which is then among the problems.
pub fn read<R: Copy>(
    limits: Limits,
    path: &str,
    names: &[(&str, R)],
    problems: &mut Vec<Problem>,
) -> Option<Only<R>> {
    let Limits { members: (members_key, members), span, condition: text } = limits;
    let Span { runs, from_s, until_s } = span;
    let path = format!("{path}.{KEY}");
    let n_before = problems.len();
    if members.is_none()
        && runs.is_none()
        && from_s.is_none()
        && until_s.is_none()
        && text.is_none()
    {
        let message = format!(
            "must have at least one of the keys {members_key}, runs, from_s, until_s, {WHERE}; remove it if the effect acts everywhere"
        );
        problems.push(Problem::new(&*path, message).value("{}"));
    }
    let mut ascending = |key: &str, mut numbers: Vec<u32>| {
        numbers.sort_unstable();
        if let Some(twice) = numbers.windows(2).find(|pair| pair[0] == pair[1]) {
            let message = "must not list a number twice";
            problems.push(Problem::new(format!("{path}.{key}"), message).value(twice[0]));
        }
        numbers.dedup();
        numbers
    };
    let members = members.map(|numbers| ascending(members_key, numbers));
    let runs = runs.map(|numbers| ascending("runs", numbers));
    if let (Some(from_s), Some(until_s)) = (from_s, until_s)
        && until_s <= from_s
    {
        let message = format!("must be greater than from_s = {from_s}");
        problems.push(Problem::new(format!("{path}.until_s"), message).value(until_s));
    }
    let mut condition = None;
    if let Some(text) = text {
        let known: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        let key = format!("{path}.{WHERE}");
        match Formula::condition_of(&text, &known, &|_| true) {
            Ok(formula) if MOST_NAMES < formula.names().len() => {
                let message = format!("must not use more than {MOST_NAMES} names");
                problems.push(Problem::new(key, message).value(formula.names().len()));
            }
            Ok(formula) => {
                condition = Some(Written { formula, parameters: Vec::new() }.bound(names));
            }
            Err(error) => problems.push(Problem::new(key, error.to_string())),
        }
    }
    let span_s = [from_s.unwrap_or(f64::NEG_INFINITY), until_s.unwrap_or(f64::INFINITY)];
    (problems.len() == n_before).then_some(Only { members, runs, span_s, condition })
}

/// A table `only` as a program writes it, checked. `spec`: the simulator's own description of it; `rest`: what is asked of an effect that
/// has it, which stands at `path`.
pub fn checked(
    limits: &toml::Table,
    spec: &TableSpec,
    rest: impl FnOnce(&toml::Table, &str, &mut Vec<Problem>),
    path: &str,
    problems: &mut Vec<Problem>,
) -> toml::Table {
    let node = Node { value: (&toml::Value::Table(limits.clone())).into(), span: None };
    let place = format!("{path}.{KEY}");
    let table = check(&node, &place, spec, &Lists::NONE, problems).table;
    rest(&toml::Table::from_iter([(KEY.to_owned(), table.clone().into())]), path, problems);
    table
}

/// An effect with its table `only` alone, which need not have been checked: what is wrong with it is nobody's.
#[must_use]
pub fn checked_within(effect: &toml::Table, spec: &TableSpec) -> toml::Table {
    let limits = effect.get(KEY).and_then(toml::Value::as_table);
    let checked = |limits| checked(limits, spec, |_, _, _| (), "", &mut Vec::new());
    limits.map(|limits| (KEY.to_owned(), checked(limits).into())).into_iter().collect()
}

/// Adds a problem for every effect of `tables` that is limited to runs, which a simulation does not have. They stand at `path[0]`,
/// `path[1]`, …
pub fn refuse_runs<'a>(
    tables: impl IntoIterator<Item = &'a toml::Table>,
    path: &str,
    problems: &mut Vec<Problem>,
) {
    for (index, table) in tables.into_iter().enumerate() {
        let Some(runs) = table.get(KEY).and_then(|only| only.get("runs")) else { continue };
        let message = "applies to comparisons with measurements only, because a simulation is no run of a campaign; remove it to \
                       simulate the effect";
        let key = format!("{path}[{index}].{KEY}.runs");
        problems.push(Problem::new(key, message).value(runs));
    }
}

impl<R> Only<R> {
    /// Whether the effect concerns one of these.
    #[must_use]
    pub fn concerns(&self, members: &[u32]) -> bool {
        let is_listed = |list: &Vec<u32>| members.iter().any(|one| list.binary_search(one).is_ok());
        self.members.as_ref().is_none_or(is_listed)
    }

    /// Whether it acts in a run. `None`: the run is not known, and only effects that are limited to no runs act.
    #[must_use]
    pub fn acts_in(&self, run: Option<u32>) -> bool {
        let is_listed = |list: &Vec<u32>| run.is_some_and(|run| list.binary_search(&run).is_ok());
        self.runs.as_ref().is_none_or(is_listed)
    }

    /// Whether it acts at a time (s).
    #[must_use]
    pub fn acts_at(&self, time_s: f64) -> bool {
        self.span_s[0] <= time_s && time_s < self.span_s[1]
    }

    /// Whether it acts at a time (ns). Times in seconds count as the whole nanoseconds in them.
    #[must_use]
    pub fn acts_at_ns(&self, time_ns: u64) -> bool {
        // The cast takes what is negative for 0, and what is infinite for the greatest time.
        let [from_ns, until_ns] = self.span_s.map(|time_s| (time_s * 1e9) as u64);
        from_ns <= time_ns && time_ns < until_ns
    }

    /// The first time (s) after `time_s` at which it begins or ceases to act; infinite where there is none.
    #[must_use]
    pub fn next_change_s(&self, time_s: f64) -> f64 {
        self.span_s.into_iter().find(|&change_s| time_s < change_s).unwrap_or(f64::INFINITY)
    }

    /// Whether its condition holds in a situation, of which `value` reads numbers and `column` columns. A condition that a missing
    /// value decides does not hold.
    pub fn holds(
        &self,
        value: impl Fn(&R) -> Option<f64>,
        column: impl Fn(&str) -> Option<f64>,
    ) -> bool {
        self.condition.as_ref().is_none_or(|condition| condition.is_true(value, column))
    }

    /// The names that its condition uses.
    #[must_use]
    pub fn names(&self) -> &[String] {
        self.condition.as_ref().map_or(&[], Bound::names)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;

    #[derive(Section)]
    struct Effect {
        only: Option<Keys>,
    }

    #[derive(Section)]
    struct Keys {
        #[key(length = 1..=MOST_ENTRIES)]
        nodes: Option<Vec<u32>>,
        #[key(flatten)]
        span: Span,
        #[key(name = "where")]
        condition: Option<String>,
    }

    const NAMES: [(&str, usize); 2] = [("distance_m", 0), ("channel", 1)];

    fn read_text(text: &str) -> (Option<Only<usize>>, String) {
        let mut problems = Vec::new();
        let node = parse(&format!("only = {text}")).unwrap();
        let table = check(&node, "effect[2]", &Effect::SPEC, &Lists::NONE, &mut problems).table;
        let mut only = None;
        if problems.is_empty() {
            let Keys { nodes, span, condition } = Effect::read(&table).only.unwrap();
            let limits = Limits { members: ("nodes", nodes), span, condition };
            only = read(limits, "effect[2]", &NAMES, &mut problems);
        }
        (only, problems.iter().map(|problem| format!("{problem}\n")).collect())
    }

    fn only(text: &str) -> Only<usize> {
        let (only, problems) = read_text(text);
        assert_eq!(problems, "", "{text}");
        only.unwrap()
    }

    #[test]
    fn every_key_limits_from_both_sides() {
        let nodes = only("{ nodes = [7, 3] }");
        assert!(nodes.concerns(&[3, 4]) && nodes.concerns(&[4, 7]) && !nodes.concerns(&[4, 5]));
        assert!(nodes.acts_in(None) && nodes.acts_in(Some(2)) && nodes.acts_at(-1.0));
        let runs = only("{ runs = [2] }");
        assert!(runs.acts_in(Some(2)) && !runs.acts_in(Some(1)) && !runs.acts_in(None));
        let span = only("{ from_s = 10, until_s = 20.0 }");
        assert!(span.acts_at(10.0) && span.acts_at(19.999));
        assert!(!span.acts_at(9.999) && !span.acts_at(20.0));
        let at_ns = [9_999_999_999, 10_000_000_000, 19_999_999_999, 20_000_000_000];
        assert_eq!(at_ns.map(|at| span.acts_at_ns(at)), [false, true, true, false]);
        assert_eq!([0.0, 10.0, 20.0].map(|at| span.next_change_s(at)), [10.0, 20.0, f64::INFINITY]);
        let place = only("{ where = 'distance_m > 5 and humidity_pct < 50' }");
        let holds = |distance_m: f64, humidity_pct: Option<f64>| {
            place.holds(|&name| [Some(distance_m), None][name], |_| humidity_pct)
        };
        assert!(holds(6.0, Some(40.0)));
        assert!(!holds(4.0, Some(40.0)) && !holds(6.0, Some(60.0)) && !holds(6.0, None));
        assert_eq!(place.names(), ["distance_m", "humidity_pct"]);
    }

    #[test]
    fn a_missing_value_that_decides_nothing_does_not_matter() {
        let either = only("{ where = 'distance_m > 5 or channel == 11' }");
        assert!(either.holds(|&name| [Some(6.0), None][name], |_| None));
        assert!(!either.holds(|&name| [Some(4.0), None][name], |_| None));
    }

    #[test]
    fn refusals_name_the_place_and_what_is_allowed() {
        for (text, expected) in [
            (
                "{}",
                "effect[2].only: must have at least one of the keys nodes, runs, from_s, until_s, where; remove it if the effect acts \
                 everywhere, got {}\n",
            ),
            (
                "{ agents = [1] }",
                "effect[2].only.agents: is not a known key (nearest valid: nodes)\n",
            ),
            ("{ nodes = [] }", "effect[2].only.nodes: must have 1 to 10000 entries, got []\n"),
            ("{ nodes = [1, 1] }", "effect[2].only.nodes: must not list a number twice, got 1\n"),
            (
                "{ runs = [-1] }",
                "effect[2].only.runs[0]: must be a whole number from 0 to 4294967295, got -1 (nearest valid: 0)\n",
            ),
            (
                "{ from_s = 20, until_s = 20 }",
                "effect[2].only.until_s: must be greater than from_s = 20, got 20\n",
            ),
            (
                "{ from_s = -1 }",
                "effect[2].only.from_s: must be from 0 to 10000000000, got -1 (nearest valid: 0)\n",
            ),
            (
                "{ where = 'distanc_m > 5' }",
                "effect[2].only.where: unknown name distanc_m; did you mean distance_m?\n    distanc_m > 5\n    ^\n",
            ),
            (
                "{ where = 'distance_m' }",
                "effect[2].only.where: is a number, not a condition; compare it with another number by < <= > >= == or !=\n    distance_m\n              ^\n",
            ),
        ] {
            assert_eq!(read_text(text).1, expected, "{text}");
        }
    }

    #[test]
    fn a_simulation_refuses_runs() {
        let tables = ["only = { nodes = [1] }", "only = { runs = [2, 3] }", ""]
            .map(|text| text.parse::<toml::Table>().unwrap());
        let mut problems = Vec::new();
        refuse_runs(&tables, "netsim.phy.effect", &mut problems);
        assert_eq!(problems.len(), 1);
        let problem = problems[0].to_string();
        assert!(problem.starts_with("netsim.phy.effect[1].only.runs: applies to comparisons"));
        assert!(problem.ends_with("got [2, 3]"), "{problem}");
    }
}
