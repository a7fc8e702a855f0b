//! Mapping files: which logs there are, and which columns of a table their fields fill.

mod sources;
mod spec;

pub use sources::{Change, Source};
pub use spec::schema;

use crate::formats::{BUILT_IN, Format};
use crate::tables::{self, Content, SourceKey, TableKind};
use crate::time::{self, Dates, NS_PER_S};
use proto::bounds::CONFIGURATION_BYTES;
use proto::config::{
    Choice, FilePath, Key as _, Node, Problem, Refusal, Section as _, Value, check, most_similar,
    parse,
};
use spec::{InputKeys, MappingKeys, StartKey, lists};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A mapping.
#[derive(Clone, Debug)]
pub struct Mapping {
    /// The mapping file.
    pub path: PathBuf,
    text: String,
    tree: Node,
    /// The table to write.
    pub table: TableKind,
    /// The logs; the first has the rows of the table.
    pub inputs: Vec<Input>,
    /// Numbers of nodes or robots that the mapping states, by name.
    pub names: BTreeMap<String, u32>,
    /// From when times count.
    pub start: Start,
    /// Latitude and longitude (degrees) of the origin of the plane; `None`: the first fix.
    pub origin_deg: Option<[f64; 2]>,
    /// Link samples are summed up over periods of this length (ns).
    pub aggregate_ns: Option<i64>,
    /// What is missing in gaps of the sequence numbers becomes rows of lost packets or frames.
    pub is_lost_from_gaps: bool,
    /// Sequence numbers begin anew after the number before this one; `None`: as the numbers show.
    pub sequence_modulus: Option<u64>,
    /// Whether the logs have the frames that were lost, as the mapping states it.
    pub losses: Option<LoggedLosses>,
    /// How the logs write dates.
    pub dates: Dates,
    /// Rows that repeat an earlier row in every field of the log are rejected.
    pub is_without_repeats: bool,
}

/// From when times count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// From the start that the log states; or, for dates and epoch times, from the first row of each run.
    Automatic,
    /// Times stay as they are.
    AsWritten,
    /// From this time (ns).
    At(i64),
}

/// Whether logs have the frames that were lost.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoggedLosses {
    /// Every frame that was sent has a row, or is counted.
    Logged,
    /// Only frames that were received have a row.
    NotLogged,
}

/// What becomes of rows that repeat an earlier row of their file in every field.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repeats {
    /// They are rows like others.
    Keep,
    /// They are rejected.
    Drop,
}

/// Log files of one format.
#[derive(Clone, Debug)]
pub struct Input {
    /// Path of the file, relative to the mapping file; with `*` and `?`, of several.
    pub files: String,
    /// Their format.
    pub format: &'static Format,
    /// The keys of the format.
    pub keys: toml::Table,
    /// What columns are filled from.
    pub columns: Vec<Target>,
    /// Names of columns of which each makes a row of its own, or patterns for them.
    pub melt: Vec<String>,
    /// Counters count from the start of the log.
    pub is_cumulative: bool,
    /// How its rows are joined onto those of the first input.
    pub join: Join,
}

/// A column and what it is filled from.
#[derive(Clone, Debug)]
pub struct Target {
    /// Name of the column.
    pub name: String,
    /// What its values are.
    pub content: Content,
    /// What it is filled from.
    pub source: Source,
    /// The mapping states it; otherwise the format does.
    pub is_stated: bool,
}

/// How rows are joined by time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Join {
    /// Which row is taken.
    pub kind: JoinKind,
    /// How far in time it may be (ns).
    pub within_ns: i64,
}

/// Which row is joined.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum JoinKind {
    /// The last one before it, as for the command in force.
    Latest,
    /// The one nearest in time.
    Nearest,
    /// The one before and the one after, interpolated linearly; angles along the shorter arc.
    Interpolated,
}

impl Input {
    /// Whether it has a column.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|target| target.name == name)
    }
}

impl Mapping {
    /// Reads a mapping file.
    ///
    /// # Errors
    ///
    /// It cannot be read; or every problem that it has, with its place.
    #[expect(clippy::disallowed_methods, reason = "a mapping is a file")]
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        let text = std::fs::File::open(path)
            .and_then(|file| CONFIGURATION_BYTES.read_text(file))
            .map_err(|error| Refusal::of_file(path, format!("cannot be read: {error}")))?;
        Self::of_text(path, text)
    }

    /// Reads the text of a mapping file; `path` is named in refusals.
    ///
    /// # Errors
    ///
    /// Every problem that it has, with its place.
    pub fn of_text(path: &Path, text: String) -> Result<Self, Refusal> {
        let tree = parse(&text)
            .map_err(|problems| Refusal::new(path, &text, &Node::empty_table(), problems))?;
        let mut problems = Vec::new();
        let checked = check(&tree, "", &MappingKeys::SPEC, &lists(), &mut problems).table;
        let keys = MappingKeys::read(&checked);
        let start = start(keys.start, &mut problems);
        let names = names(tree.get("names"), &mut problems);
        let inputs: Vec<Input> = (0..)
            .zip(keys.input)
            .map(|(number, table)| input(&tree, number, table, keys.table, &mut problems))
            .collect();
        let mut mapping = Self {
            path: path.to_owned(),
            text,
            tree,
            // Unknown only where the mapping is refused.
            table: keys.table.unwrap_or(TableKind::Links),
            inputs,
            names,
            start,
            origin_deg: keys.origin_deg,
            aggregate_ns: keys.aggregate_s.map(|period_s| (period_s * 1e9) as i64),
            is_lost_from_gaps: false,
            sequence_modulus: keys.sequence_modulus,
            losses: keys.losses,
            dates: Dates {
                order: keys.date_order,
                offset_s: (keys.utc_offset_h * 3600.0).round() as i64,
            },
            is_without_repeats: keys.repeats == Repeats::Drop,
        };
        mapping.is_lost_from_gaps =
            keys.lost_from_gaps.unwrap_or_else(|| mapping.is_lost_from_gaps_by_default());
        mapping.check_inputs(&mut problems);
        if problems.is_empty() { Ok(mapping) } else { Err(mapping.refuse(problems)) }
    }

    /// Problems of this file, placed on its lines.
    #[must_use]
    pub fn refuse(&self, problems: Vec<Problem>) -> Refusal {
        Refusal::new(&self.path, &self.text, &self.tree, problems)
    }

    /// What inputs have to do with each other.
    fn check_inputs(&self, problems: &mut Vec<Problem>) {
        let Some((first, further)) = self.inputs.split_first() else {
            if problems.is_empty() {
                problems.push(Problem::new("input", "must have at least one table ([[input]])"));
            }
            return;
        };
        let written = |number: usize, key: &str| match self.tree.get("input").map(|n| &n.value) {
            Some(Value::List(list)) => list.get(number).is_some_and(|node| node.get(key).is_some()),
            _ => false,
        };
        for key in ["join", "within_s"].iter().filter(|key| written(0, key)) {
            let message = "does not apply to the first input, onto which the others are joined";
            problems.push(Problem::new(format!("input[0].{key}"), message));
        }
        for (number, input) in (1..).zip(further) {
            let path = format!("input[{number}]");
            if !input.has("time_s") && !input.has("node") {
                let message = "must have time_s, node or both: its rows are joined by them";
                problems.push(Problem::new(format!("{path}.columns"), message));
            }
            if input.has("time_s") && !first.has("time_s") {
                let message = "is joined by time, but the first input has no time_s";
                problems.push(Problem::new(format!("{path}.columns.time_s"), message));
            }
            let is_key = |name: &str| ["time_s", "node", "agent"].contains(&name);
            for target in input.columns.iter().filter(|target| !is_key(&target.name)) {
                let others = &self.inputs[..number];
                if !input.has("node") && others.iter().any(|other| other.has(&target.name)) {
                    let message = "is filled by an earlier input as well; remove one of them";
                    problems.push(Problem::new(format!("{path}.columns.{}", target.name), message));
                }
            }
        }
        let has_samples =
            self.table == TableKind::Links && self.inputs.iter().any(|input| input.has("received"));
        if self.aggregate_ns.is_some() && !has_samples {
            let message =
                "sums up link samples: it requires table = \"links\" and the column received";
            problems.push(Problem::new(spec::AGGREGATE_S, message));
        }
        self.check_losses(first, problems);
        if !problems.is_empty() {
            return;
        }
        let lacking = self.table.lacking(&self.column_names());
        if !lacking.is_empty() {
            problems.push(Problem::new(
                "input[0].columns",
                format!("a table of {} also requires {}", self.table.name(), lacking.join(", ")),
            ));
        }
    }

    /// Link samples with sequence numbers show what was lost, unless the log has it.
    fn is_lost_from_gaps_by_default(&self) -> bool {
        self.table == TableKind::Links
            && self.losses != Some(LoggedLosses::Logged)
            && self.inputs.iter().any(|input| input.has("sequence"))
    }

    /// Checks the keys about lost frames and packets.
    fn check_losses(&self, first: &Input, problems: &mut Vec<Problem>) {
        let is_links = self.table == TableKind::Links;
        let has_sequence = self.inputs.iter().any(|input| input.has("sequence"));
        if self.is_lost_from_gaps && !(self.table != TableKind::Robots && has_sequence) {
            let message = "makes lost packets or frames of gaps in sequence numbers: it requires table = \"packets\" or \"links\", and \
                           the column sequence";
            problems.push(Problem::new(spec::LOST_FROM_GAPS, message));
        } else if self.is_lost_from_gaps && is_links {
            const NEEDED: [&str; 5] = ["sequence", "time_s", "tx", "rx", "received"];
            if !NEEDED.iter().all(|name| first.has(name)) || first.has("frames") {
                let message = "shows lost frames of link samples: the first input must have sequence, time_s, tx, rx and received (1, if \
                               only frames that were received are in the log), without frames. Otherwise, write lost_from_gaps = false";
                let with = self.inputs.iter().position(|input| input.has("sequence")).unwrap_or(0);
                problems.push(Problem::new(format!("input[{with}].columns.sequence"), message));
            }
            if self.losses == Some(LoggedLosses::Logged) {
                let message = "says that lost frames are in the log, so lost_from_gaps = true would add them again; remove one of them";
                problems.push(Problem::new(spec::LOSSES, message));
            }
        }
        if self.sequence_modulus.is_some() && !has_sequence {
            problems.push(Problem::new(spec::SEQUENCE_MODULUS, "requires the column sequence"));
        }
        if self.losses.is_some() && !is_links {
            let message = "says which frames a log of links has: it requires table = \"links\"";
            problems.push(Problem::new(spec::LOSSES, message));
        }
    }

    /// Whether frames that were lost are in the table: lost rows are added, the mapping states it, or frames that were sent are
    /// counted. `None`: unknown.
    #[must_use]
    pub fn are_losses_logged(&self) -> Option<bool> {
        if self.table != TableKind::Links {
            return None;
        }
        if self.is_lost_from_gaps {
            return Some(true);
        }
        let is_counted = self.inputs.iter().any(|input| input.has("frames"));
        self.losses.map(|losses| losses == LoggedLosses::Logged).or(is_counted.then_some(true))
    }

    /// Names of the columns that the table will have.
    fn column_names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for input in &self.inputs {
            let prefixes = if input.has("node") { &["tx_", "rx_"][..] } else { &[""] };
            for (target, prefix) in
                input.columns.iter().flat_map(|target| prefixes.iter().map(move |p| (target, p)))
            {
                match &*target.name {
                    "time_s" | "node" if !prefix.is_empty() => {}
                    "latitude_deg" => {
                        names.extend([format!("{prefix}x_m"), format!("{prefix}y_m")]);
                    }
                    "received_frames" => names.push("pdr".to_owned()),
                    name => names.push(format!("{prefix}{name}")),
                }
            }
        }
        names
    }
}

/// The keys of the first input of a mapping, with their defaults.
pub(crate) fn input_keys(text: &str) -> toml::Table {
    let Ok(tree) = parse(text) else { return toml::Table::new() };
    let checked = check(&tree, "", &MappingKeys::SPEC, &lists(), &mut Vec::new()).table;
    MappingKeys::read(&checked).input.into_iter().next().unwrap_or_default()
}

fn start(key: Option<StartKey>, problems: &mut Vec<Problem>) -> Start {
    let text = match key {
        None => return Start::Automatic,
        Some(StartKey::Text(text)) if text == spec::AS_WRITTEN => return Start::AsWritten,
        Some(StartKey::Text(text)) => text,
        Some(StartKey::Epoch(time_s)) => toml::Value::Float(time_s).to_string(),
    };
    match time::parse(&text, NS_PER_S) {
        Some(start_ns) => Start::At(start_ns),
        None => {
            let message =
                "must be a date such as 2018-01-11T16:32:22, an epoch time (s), or \"as-written\"";
            problems.push(Problem::new("start", message).value(format!("{text:?}")));
            Start::Automatic
        }
    }
}

fn names(node: Option<&Node>, problems: &mut Vec<Problem>) -> BTreeMap<String, u32> {
    let mut numbers: BTreeMap<String, u32> = BTreeMap::new();
    let Some(node) = node else { return numbers };
    let Value::Table(entries) = &node.value else {
        let message = "must be a table of numbers by name, such as { gateway = 0 }";
        problems.push(Problem::new("names", message).value(node.show()));
        return numbers;
    };
    for (name, _, node) in entries {
        let path = format!("names.{name}");
        match node.value {
            Value::Integer(number @ 0..=MOST_NUMBER) => {
                let number = number as u32;
                if let Some((other, _)) = numbers.iter().find(|(_, taken)| **taken == number) {
                    let message = format!("must differ from the number of {other:?}");
                    problems.push(Problem::new(path, message).value(number));
                } else {
                    numbers.insert(name.clone(), number);
                }
            }
            _ => {
                let message = format!("must be a whole number from 0 to {MOST_NUMBER}");
                problems.push(Problem::new(path, message).value(node.show()));
            }
        }
    }
    numbers
}

/// Greatest number of a node or robot.
const MOST_NUMBER: i64 = 1_000_000_000;

fn input(
    tree: &Node,
    number: usize,
    table: toml::Table,
    kind: Option<TableKind>,
    problems: &mut Vec<Problem>,
) -> Input {
    let path = format!("input[{number}]");
    let keys = InputKeys::read(&table);
    let name = proto::config::tag(&table, "format").unwrap_or_default();
    let found = BUILT_IN.iter().find(|format| format.variant.name == name);
    let format = found.unwrap_or(&BUILT_IN[0]);
    if found.is_some() {
        (format.check)(&table, &path, problems);
    }
    let mut columns: Vec<Target> = Vec::new();
    for (name, value) in &keys.columns {
        let path = format!("{path}.columns.{name}");
        let (Some(column), Some(key)) = (tables::known(name), SourceKey::from_value(value)) else {
            continue;
        };
        if let Some(kind) = kind.filter(|&kind| !column.is_of(kind)) {
            let mut problem = Problem::new(
                path,
                format!(
                    "is not a column of a table of {}, whose columns are {}",
                    kind.name(),
                    kind.columns().collect::<Vec<_>>().join(", ")
                ),
            );
            problem.nearest = most_similar(name, kind.columns()).map(str::to_owned);
            problems.push(problem);
            continue;
        }
        columns.extend(sources::target(name, column.content, key, &path, problems));
    }
    let node = match tree.get("input").map(|node| &node.value) {
        Some(Value::List(list)) => list.get(number).and_then(|node| node.get("covariates")),
        _ => None,
    };
    sources::covariates(node, &format!("{path}.covariates"), &mut columns, problems);
    for (target_name, field) in format.columns {
        let is_there = columns.iter().any(|target| target.name == *target_name);
        let column = tables::known(target_name);
        let is_node = target_name.ends_with("_node");
        let further = if is_node { Content::Label } else { Content::Number };
        if !is_there && column.is_none_or(|column| kind.is_none_or(|kind| column.is_of(kind))) {
            columns.push(Target {
                name: (*target_name).to_owned(),
                content: column.map_or(further, |column| column.content),
                source: Source::Column {
                    name: (*field).to_owned(),
                    unit: None,
                    change: Change::NONE,
                },
                is_stated: false,
            });
        }
    }
    let has = |name: &str| columns.iter().any(|target| target.name == name);
    for (name, other) in [("latitude_deg", "longitude_deg"), ("longitude_deg", "latitude_deg")] {
        if has(name) && !has(other) {
            let message = format!("requires {other}");
            problems.push(Problem::new(format!("{path}.columns.{name}"), message));
        }
    }
    if has("latitude_deg") && (has("x_m") || has("y_m")) {
        let message = "gives x_m and y_m, which are filled as well; remove one of them";
        problems.push(Problem::new(format!("{path}.columns.latitude_deg"), message));
    }
    if has("received_frames") && (!has("frames") || has("pdr")) {
        let message = "requires frames, and excludes pdr: it is their quotient";
        problems.push(Problem::new(format!("{path}.columns.received_frames"), message));
    }
    if kind == Some(TableKind::Links) && !has("node") {
        const OF_NODES: [&str; 6] =
            ["x_m", "y_m", "z_m", "heading_rad", "latitude_deg", "longitude_deg"];
        for name in OF_NODES.into_iter().filter(|name| has(name)) {
            let message = "belongs to a node, so the input must have node as well";
            problems.push(Problem::new(format!("{path}.columns.{name}"), message));
        }
    }
    Input {
        files: keys.files.map(|FilePath(files)| files).unwrap_or_default(),
        format,
        keys: table,
        columns,
        melt: keys.melt.unwrap_or_default(),
        is_cumulative: keys.cumulative,
        join: Join { kind: keys.join, within_ns: (keys.within_s * 1e9) as i64 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        Mapping::of_text(Path::new("map.toml"), text.to_owned()).unwrap_err().to_string()
    }

    #[test]
    fn every_problem_is_named_with_its_line_and_what_is_allowed() {
        let said = refusal(
            "table = \"robot\"\n\
             names = { a = 1, b = 1 }\n\
             [[input]]\n\
             files = \"*.csv\"\n\
             format = \"csvs\"\n\
             columns = { time_s = [\"s\"], agnt = 0, x_m = [\"a\", \"b\"], y_m = { column = \"y\", unit = \"deg\" } }\n\
             covariates = { heading_rad = \"h\", \"a b\" = \"c\" }\n\
             [[input]]\n\
             files = \"b.csv\"\n\
             columns = { source = \"x\" }\n",
        );
        for part in [
            "map.toml:1: table: must be one of \"links\", \"robots\", \"packets\", got \"robot\" (nearest valid: \"robots\")",
            "map.toml:2: names.b: must differ from the number of \"a\", got 1",
            "map.toml:5: input[0].format: must be one of \"csv\", \"json-lines\", \"parquet\", \"k7\", \"openwsn-packets\", \"openwsn-transmissions\", \"contiki-packets\", got \"csvs\" (nearest valid: \"csv\")",
            "map.toml:6: input[0].columns.agnt: is not a known key (nearest valid: agent)",
            "map.toml:6: input[0].columns.y_m.unit: must be one of m, cm, mm, km, ft, got \"deg\"",
            "map.toml:7: input[0].covariates.heading_rad: is no covariate",
            "map.toml:7: input[0].covariates.a b: must be a name",
            "map.toml:10: input[1].columns: must have time_s, node or both",
        ] {
            assert!(said.contains(part), "{part}\nis not in\n{said}");
        }
    }

    #[test]
    fn a_mapping_that_lacks_a_column_is_refused_with_the_column() {
        let said = refusal(
            "table = \"robots\"\n[[input]]\nfiles = \"a.csv\"\ncolumns = { time_s = \"t\", agent = 0, x_m = \"x\", y_m = \"y\" }\n",
        );
        assert!(
            said.contains("a table of robots also requires cmd_vx_mps and cmd_vy_mps"),
            "{said}"
        );
        assert!(refusal("table = \"links\"\n").contains("input: is missing"));
        let said = refusal("table = \"robots\"\n[[input]]\nfiles = \"a.k7\"\nformat = \"k7\"\n");
        assert!(said.contains("also requires agent, x_m"), "{said}");
    }

    #[test]
    fn only_link_samples_are_summed_up() {
        let text = |columns: &str| {
            format!(
                "table = \"links\"\naggregate_s = 60\n[[input]]\nfiles = \"a\"\ncolumns = {{ time_s = \"t\", tx = \"a\", \
                 rx = \"b\", rssi_dbm = \"r\", {columns} }}\n"
            )
        };
        let mapping = Mapping::of_text(Path::new("map.toml"), text("received = \"ok\"")).unwrap();
        assert_eq!(mapping.aggregate_ns, Some(60_000_000_000));
        let said = refusal(&text("frames = \"n\", pdr = \"p\""));
        assert!(said.contains("map.toml:2: aggregate_s: sums up link samples"), "{said}");
        assert!(refusal("table = \"links\"\naggregate_s = 0\n").contains("0.001"));
    }

    #[test]
    fn sequence_numbers_of_link_samples_show_lost_frames_unless_the_log_has_them() {
        let text = |top: &str, columns: &str| {
            format!(
                "table = \"links\"\n{top}\n[[input]]\nfiles = \"a\"\ncolumns = {{ time_s = \"t\", tx = \"a\", rx = \"b\", rssi_dbm = \
                 \"r\", {columns} }}\n"
            )
        };
        let mapping = |top: &str, columns: &str| {
            Mapping::of_text(Path::new("map.toml"), text(top, columns)).unwrap()
        };
        const NUMBERED: &str = "received = 1, sequence = \"n\"";
        const COUNTED: &str = "frames = \"n\", pdr = \"p\"";
        for (top, columns, is_lost_from_gaps, losses_logged) in [
            ("", NUMBERED, true, Some(true)),
            ("losses = \"not-logged\"", NUMBERED, true, Some(true)),
            ("losses = \"logged\"", NUMBERED, false, Some(true)),
            ("lost_from_gaps = false", NUMBERED, false, None),
            ("losses = \"not-logged\"", "received = 1", false, Some(false)),
            ("", "received = 1", false, None),
            ("", COUNTED, false, Some(true)),
            ("losses = \"not-logged\"", COUNTED, false, Some(false)),
        ] {
            let mapping = mapping(top, columns);
            let found = (mapping.is_lost_from_gaps, mapping.are_losses_logged());
            assert_eq!(found, (is_lost_from_gaps, losses_logged), "{top} {columns}");
        }
        for (top, columns, part) in [
            ("", "frames = \"n\", pdr = \"p\", sequence = \"n\"", "sequence: shows lost frames"),
            ("lost_from_gaps = true", COUNTED, "map.toml:2: lost_from_gaps: makes lost packets"),
            (
                "losses = \"logged\"\nlost_from_gaps = true",
                NUMBERED,
                "map.toml:2: losses: says that lost frames are in the log",
            ),
            ("sequence_modulus = 256", COUNTED, "sequence_modulus: requires the column sequence"),
        ] {
            let said = refusal(&text(top, columns));
            assert!(said.contains(part), "{part}\nis not in\n{said}");
        }
        let covariate = text("", "received = 1") + "covariates = { losses_logged = 1 }\n";
        assert!(refusal(&covariate).contains("is no covariate; write losses"));
    }

    #[test]
    fn columns_of_another_table_are_refused() {
        let said =
            refusal("table = \"packets\"\n[[input]]\nfiles = \"a\"\ncolumns = { tx = \"a\" }\n");
        assert!(
            said.contains("input[0].columns.tx: is not a column of a table of packets"),
            "{said}"
        );
    }
}
