//! The `[sweep]` section: what varies, and how often.

mod engines;

pub use engines::{HyperQueueOptions, SlurmOptions};

use proto::config::{self, Choice, Lists, Node, OneOf, Problem, Section, TableSpec, Value, join};
use std::collections::BTreeSet;

/// Name of the section.
pub const KEY: &str = "sweep";

/// A sweep over this experiment: every case with every combination of values and every sample of the ranges, each with every seed. Run
/// it with `murmuration sweep`.
#[derive(Section)]
pub(super) struct SweepKeys {
    /// Number of seeds, from experiment.seed on, or a list of seeds. Every setting runs with the same seeds, so settings can be compared
    /// in pairs.
    #[key(default = 1)]
    seeds: Seeds,
    /// Keys of the file to vary. A list of values is run in all combinations. A range { min, max } is sampled, with scale = "log" if
    /// ratios matter and whole = true for whole numbers.
    #[expect(dead_code, reason = "its entries are read with their places in the file")]
    vary: Option<toml::Value>,
    /// Cases, each with a name and values of several keys that are varied together.
    #[expect(dead_code, reason = "its entries are read with their places in the file")]
    case: Option<toml::Value>,
    /// Number of samples of the ranges, drawn jointly.
    #[key(range = 1..=MOST_TRIALS)]
    samples: Option<usize>,
    /// How ranges are sampled.
    #[key(default = Sampling::Sobol)]
    sampling: Sampling,
    /// Which trials keep the complete recording of their run, in addition to their row in the table.
    #[key(default = Keep::None)]
    keep: Keep,
    /// Metrics that the report shows, each by short name (`murmuration metrics` lists them) or by path of summary.json. Columns of the
    /// table have these names. Absent: metrics of the task and of delivery that differ between trials.
    #[key(length = 1..=100)]
    metrics: Option<Vec<String>>,
    #[key(default, doc = SlurmOptions::SPEC.doc)]
    slurm: SlurmOptions,
    #[key(default, doc = HyperQueueOptions::SPEC.doc)]
    hyperqueue: HyperQueueOptions,
}

/// A range to sample.
#[derive(Section)]
struct RangeKeys {
    /// Lower end.
    min: f64,
    /// Upper end.
    max: f64,
    /// Scale on which samples are uniform.
    #[key(default = Scale::Linear)]
    scale: Scale,
    /// Whether samples are whole numbers, both ends included.
    #[key(default = false)]
    whole: bool,
}

/// On which scale samples of a range are uniform.
#[derive(Choice, Clone, Copy, PartialEq, Eq)]
enum Scale {
    /// The value.
    Linear,
    /// Its logarithm.
    Log,
}

/// More trials than this are a mistake.
pub const MOST_TRIALS: i64 = 1_000_000;

/// What varies, and how often.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Seeds under which every setting is run, in order.
    pub seeds: Seeds,
    /// Cases; none: one without a name.
    pub cases: Vec<Case>,
    /// Keys that take each value of a list.
    pub lists: Vec<(String, Vec<Node>)>,
    /// Keys whose values are sampled from a range.
    pub ranges: Vec<(String, ParameterRange)>,
    /// Number of points sampled from the ranges.
    pub samples: usize,
    /// How they are taken.
    pub sampling: Sampling,
    /// Which files of each trial are kept.
    pub keep: Keep,
    /// What the report shows, if it is said: short names or paths of `summary.json`.
    pub metrics: Option<Vec<String>>,
    /// What `--engine slurm` asks for.
    pub slurm: SlurmOptions,
    /// What `--engine hyperqueue` asks for.
    pub hyperqueue: HyperQueueOptions,
}

/// The seeds under which every setting is run.
#[derive(Clone, Debug, PartialEq, Eq, OneOf)]
pub enum Seeds {
    /// This many consecutive seeds, the first being that of the experiment.
    Count(#[key(range = 1..=MOST_TRIALS)] u64),
    /// A list of seeds, each used once per setting.
    These(#[key(length = 1..=MOST_TRIALS as usize)] Vec<u64>),
}

/// Values that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Its name.
    pub name: String,
    /// Key and value.
    pub values: Vec<(String, Node)>,
}

/// A range of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterRange {
    /// Where it stands in the file.
    pub span: Option<std::ops::Range<usize>>,
    /// Least value of the range.
    pub min: f64,
    /// Greatest value of the range.
    pub max: f64,
    /// Whether the logarithm of the value is sampled uniformly, rather than the value.
    pub is_log: bool,
    /// Whether values are whole numbers.
    pub is_whole: bool,
}

/// How ranges are sampled.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// A Sobol sequence with Owen scrambling; best with a power of two. Increasing samples keeps the existing ones.
    Sobol,
    /// A Latin hypercube: one sample in each of equally many equal slices of every range.
    LatinHypercube,
}

/// Which trials keep their recording.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// No trial.
    None,
    /// The trial of each setting with the first seed.
    FirstSeed,
    /// All trials.
    All,
}

/// Description of the section.
pub(super) const SPEC: TableSpec = SweepKeys::SPEC;

/// Reads the section, adding to `problems`.
pub fn read(node: &Node, problems: &mut Vec<Problem>) -> Sweep {
    let checked = config::check(node, KEY, &SweepKeys::SPEC, &Lists::NONE, problems);
    let keys = SweepKeys::read(&checked.table);
    engines::check_lines(&checked.touches, &keys.slurm, problems);
    engines::check_options(&keys.slurm.options, problems);
    let mut reader = SweepReader { problems, lists: Vec::new(), ranges: Vec::new() };
    if let Some(vary) = node.get("vary") {
        reader.varied(vary, "sweep.vary", "");
    }
    let cases = node.get("case").map(|cases| reader.cases(cases)).unwrap_or_default();
    let SweepReader { lists, ranges, .. } = reader;
    match (keys.samples, ranges.is_empty()) {
        (None, false) if node.get("samples").is_none() => problems.push(Problem::new(
            "sweep.samples",
            "is missing: must be the number of samples of the ranges, such as 64",
        )),
        (Some(_), true) => problems.push(Problem::new(
            "sweep.samples",
            "has nothing to sample: no key of [sweep.vary] has a range { min, max }; add one, or remove this key",
        )),
        _ => {}
    }
    if lists.is_empty() && ranges.is_empty() && cases.is_empty() && node.get("seeds").is_none() {
        problems
            .push(Problem::new(KEY, "varies nothing: add [sweep.vary], [[sweep.case]] or seeds"));
    }
    if let Seeds::These(seeds) = &keys.seeds {
        check_seeds(seeds, problems);
    }
    Sweep {
        seeds: keys.seeds,
        samples: keys.samples.filter(|_| !ranges.is_empty()).unwrap_or(1),
        cases,
        lists,
        ranges,
        sampling: keys.sampling,
        keep: keys.keep,
        metrics: keys.metrics,
        slurm: keys.slurm,
        hyperqueue: keys.hyperqueue,
    }
}

fn check_seeds(seeds: &[u64], problems: &mut Vec<Problem>) {
    let mut known = BTreeSet::new();
    for (index, seed) in seeds.iter().enumerate() {
        if !known.insert(seed) {
            problems.push(
                Problem::new(format!("sweep.seeds[{index}]"), "must differ from the other seeds")
                    .value(seed),
            );
        }
    }
}

struct SweepReader<'a> {
    problems: &'a mut Vec<Problem>,
    lists: Vec<(String, Vec<Node>)>,
    ranges: Vec<(String, ParameterRange)>,
}

impl SweepReader<'_> {
    /// A problem with what stands at a node, whose key may be written in one piece, so that no path leads there.
    fn wrong(&mut self, problem: Problem, node: &Node) {
        self.problems.push(Problem { span: node.span.clone(), ..problem });
    }

    fn is_varied(&self, key: &str) -> bool {
        self.lists.iter().any(|(known, _)| known == key)
            || self.ranges.iter().any(|(known, _)| known == key)
    }

    /// Refuses a key that makes no other experiment, or is said twice.
    fn judge(&mut self, key: &str, path: &str, node: &Node) {
        let instead = match key.split('.').next() {
            _ if key == "experiment.seed" => "cannot be varied; use sweep.seeds instead",
            _ if key == "experiment.name" => "cannot be varied: the sweep names each trial",
            Some("output") => {
                "cannot be varied: it does not change the results. Use sweep.keep to choose which runs are kept"
            }
            Some(KEY) => "cannot be varied in a sweep",
            _ if self.is_varied(key) => "is varied twice in [sweep.vary]",
            _ => return,
        };
        self.wrong(Problem::new(path, instead), node);
    }

    /// Lists and ranges below `key`, which may be written as one dotted key or as tables.
    fn varied(&mut self, node: &Node, path: &str, key: &str) {
        match &node.value {
            Value::Table(_) if node.get("min").is_some() || node.get("max").is_some() => {
                self.judge(key, path, node);
                if let Some(range) = self.range(node, path) {
                    self.ranges.push((key.to_owned(), range));
                }
            }
            Value::Table(entries) => {
                for (name, _, child) in entries {
                    self.varied(child, &join(path, name), &join(key, name));
                }
            }
            Value::List(values) if !values.is_empty() => {
                self.judge(key, path, node);
                for (index, value) in values.iter().enumerate() {
                    if values[..index].iter().any(|before| before.to_toml() == value.to_toml()) {
                        let problem = Problem::new(path, "must list each value only once")
                            .value(value.show());
                        self.wrong(problem, node);
                    }
                }
                self.lists.push((key.to_owned(), values.clone()));
            }
            _ => {
                let message = "must be a list of values, or a range { min = …, max = … }";
                self.wrong(Problem::new(path, message).value(node.show()), node);
            }
        }
    }

    fn range(&mut self, node: &Node, path: &str) -> Option<ParameterRange> {
        let before = self.problems.len();
        let table = config::check(node, path, &RangeKeys::SPEC, &Lists::NONE, self.problems).table;
        let keys = RangeKeys::read(&table);
        let range = ParameterRange {
            span: node.span.clone(),
            min: keys.min,
            max: keys.max,
            is_log: keys.scale == Scale::Log,
            is_whole: keys.whole,
        };
        let mut wrong = |key: &str, message: String, value: f64| {
            self.problems.push(Problem::new(join(path, key), message).value(value));
        };
        if range.max <= range.min {
            wrong("max", format!("must be greater than min ({})", range.min), range.max);
        }
        if range.is_log && range.min <= 0.0 {
            wrong("min", "must be greater than 0 with scale = \"log\"".to_owned(), range.min);
        }
        for (key, end) in [("min", range.min), ("max", range.max)] {
            if range.is_whole && libm::round(end) != end {
                wrong(key, "must be a whole number with whole = true".to_owned(), end);
            }
        }
        for problem in &mut self.problems[before..] {
            problem.span.clone_from(&node.span);
        }
        (before == self.problems.len()).then_some(range)
    }

    fn cases(&mut self, node: &Node) -> Vec<Case> {
        let Value::List(tables) = &node.value else {
            let message = "must be an array of tables ([[sweep.case]])";
            self.wrong(Problem::new("sweep.case", message).value(node.show()), node);
            return Vec::new();
        };
        let mut cases: Vec<Case> = Vec::new();
        for (index, table) in tables.iter().enumerate() {
            let path = format!("sweep.case[{index}]");
            let Value::Table(entries) = &table.value else {
                self.wrong(Problem::new(path, "must be a table").value(table.show()), table);
                continue;
            };
            let name = match table.get("name").map(|name| &name.value) {
                Some(Value::Text(name)) if !name.is_empty() => name.clone(),
                _ => {
                    let message = "is missing: must be a text in quotes that identifies the case";
                    self.wrong(Problem::new(join(&path, "name"), message), table);
                    String::new()
                }
            };
            if cases.iter().any(|case| case.name == name) {
                let problem = Problem::new(join(&path, "name"), "is also the name of another case")
                    .value(&name);
                self.wrong(problem, table.get("name").unwrap_or(table));
            }
            let mut values = Vec::new();
            for (key, _, child) in entries.iter().filter(|(key, ..)| key != "name") {
                leaves(child, key, &mut values);
            }
            for (key, value) in &values {
                self.judge(key, &join(&path, key), value);
            }
            cases.push(Case { name, values });
        }
        cases
    }
}

/// Every value below `key` that is not a table.
fn leaves(node: &Node, key: &str, values: &mut Vec<(String, Node)>) {
    match &node.value {
        Value::Table(entries) if !entries.is_empty() => {
            for (name, _, child) in entries {
                leaves(child, &join(key, name), values);
            }
        }
        _ => values.push((key.to_owned(), node.clone())),
    }
}
