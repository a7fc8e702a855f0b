//! What logs may be: which columns are what, in which units, and the mapping and the first model that follow.
//!
//! | module | content |
//! |---|---|
//! | [`sniff`] | the format of a file |
//! | `profile` | what the columns of a log are like |
//! | `words` | words in the names of columns, by what they mean |
//! | `times` | columns of times |
//! | `readings` | columns of RSSI: signs, sentinels, missing values |
//! | `places` | positions: units, whose they are, swapped ends |
//! | `links`, `robots`, `packets` | the tables |
//! | `write` | the mapping and the model as text |
//!
//! A guess is a mapping like any other: what is wrong in it is corrected in its file.

mod links;
mod packets;
mod places;
mod profile;
mod readings;
mod robots;
pub mod sniff;
mod times;
mod words;
mod write;

pub use write::{CHECK, next_command};

use crate::files::natural_order;
use crate::tables::TableKind;
use measure::DataError;
use measure::formats::open;
use measure::memory::MemoryBudget;
use profile::{Profile, Sample};
use schemars::JsonSchema;
use serde::Serialize;
use sniff::Form;
use std::collections::BTreeMap;
use std::io::BufRead as _;
use std::path::{Path, PathBuf};

/// What logs are taken for.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Guess {
    /// The table that they become.
    pub table: TableKind,
    /// The columns of the table, what they are filled from, and why.
    pub columns: Vec<Guessed>,
    /// What was found in the logs that a user should know.
    pub findings: Vec<String>,
    /// What the logs do not say, with the answer that was taken.
    pub questions: Vec<Question>,
    /// Columns of the logs that are not used.
    pub unused: Vec<String>,
    /// The mapping file.
    pub mapping: String,
    /// A first model, for `compare`.
    pub model: String,
}

/// A column of the table.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Guessed {
    /// Its name.
    pub column: String,
    /// What it is filled from, as the mapping says it.
    pub from: String,
    /// Why.
    pub reason: String,
    /// Number of the input, from 0.
    pub input: usize,
}

/// A question that the logs leave open.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Question {
    /// Its name, by which `--answer` answers it.
    pub id: &'static str,
    /// The question.
    pub text: String,
    /// Possible answers: a word, and what it means.
    pub choices: Vec<(String, String)>,
    /// The answer that was taken, as a number of `choices`.
    pub answer: usize,
    /// Whether the answer was given, not guessed.
    pub is_answered: bool,
}

/// Answers by the names of the questions.
pub type Answers = BTreeMap<String, String>;

/// Why logs cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum GuessError {
    /// A log cannot be read.
    #[error(transparent)]
    Log(#[from] DataError),
    /// A log is of another kind.
    #[error("{path}: {what}", path = path.display())]
    Other {
        /// The log.
        path: PathBuf,
        /// What it is, and what reads it.
        what: String,
    },
    /// No table can be made of the logs: what is lacking.
    #[error("{0}")]
    NoTable(String),
    /// An answer is none of the choices.
    #[error("{0}")]
    Answer(String),
}

/// A log, or several with the same columns.
struct Log {
    /// Its place in the mapping: a path or a pattern.
    files: String,
    /// The names of its files.
    names: Vec<String>,
    form: Form,
    /// Columns of readings of several nodes, each of which makes a row of its own.
    melted: Option<Vec<String>>,
    sample: Sample,
    profiles: Vec<Profile>,
}

/// The name that a column of the log gets which has the names of melted columns.
const MELTED_NAME: &str = crate::formats::MELTED[0];
/// And the one which has their values.
const MELTED_VALUE: &str = crate::formats::MELTED[1];

impl Log {
    fn profile(&self, column: usize) -> &Profile {
        &self.profiles[column]
    }

    /// The column that fits best: the first with the highest score above 0.
    fn best(&self, score: impl Fn(&Profile) -> i32) -> Option<usize> {
        let scores = self.profiles.iter().map(score).enumerate();
        let best = scores
            .filter(|(_, score)| 0 < *score)
            .max_by_key(|(at, score)| (*score, usize::MAX - at));
        best.map(|(at, _)| at)
    }

    /// Describes its columns.
    fn describe(&mut self) {
        self.profiles =
            (0..self.sample.names.len()).map(|column| Profile::of(&self.sample, column)).collect();
    }

    /// Makes a row of each reading, if several columns have readings, each of another node.
    fn melt(&mut self) {
        if !["csv", "parquet", "json-lines"].contains(&self.form.format) {
            return;
        }
        let of_one_node = |column: &usize| {
            readings::is_of_one_node(&self.profiles[*column], &self.sample.numbers(*column))
        };
        let mut columns: Vec<usize> = (0..self.profiles.len()).filter(of_one_node).collect();
        // A reading that is named as such is that of the row; others are computed from it.
        let is_plain = |&column: &usize| {
            let words = &self.profiles[column].words;
            words.iter().all(|word| readings::PLAIN.contains(&&**word))
        };
        if columns.len() < 3 || columns.iter().any(is_plain) {
            return;
        }
        // Nodes that were hardly heard have columns with the same beginning.
        let names: Vec<&str> = columns.iter().map(|&column| &*self.sample.names[column]).collect();
        let (prefix, _) = words::common(&names);
        if 2 <= prefix.len() {
            let is_alike = |column: &usize| self.sample.names[*column].starts_with(prefix);
            columns = (0..self.profiles.len()).filter(is_alike).collect();
        }
        let names: Vec<String> =
            columns.iter().map(|&column| self.sample.names[column].clone()).collect();
        self.melted = Some(words::patterns(&names, &self.sample.names));
        self.sample.melt(&columns, MELTED_NAME, MELTED_VALUE);
        self.describe();
    }

    fn is_made_of(&self, format: &str) -> bool {
        self.form.format == format
    }
}

/// The questions of a guess, with the answers that were given.
struct Asked<'a> {
    answers: &'a Answers,
    questions: Vec<Question>,
}

impl Asked<'_> {
    /// Asks, and returns the word of the answer.
    ///
    /// * `likely`: the number of the choice that is taken unless another is given.
    fn ask(
        &mut self,
        id: &'static str,
        text: String,
        choices: &[(&str, &str)],
        likely: usize,
    ) -> String {
        if let Some(asked) = self.questions.iter().find(|question| question.id == id) {
            return asked.choices[asked.answer].0.clone();
        }
        let given = self.answers.get(id).and_then(|word| {
            choices.iter().position(|(choice, _)| choice.eq_ignore_ascii_case(word.trim()))
        });
        let answer = given.unwrap_or(likely);
        self.questions.push(Question {
            id,
            text,
            choices: choices
                .iter()
                .map(|(word, what)| ((*word).to_owned(), (*what).to_owned()))
                .collect(),
            answer,
            is_answered: given.is_some(),
        });
        choices[answer].0.to_owned()
    }

    /// Refuses answers to questions that were not asked, and words that are no choice.
    fn check(&self) -> Result<(), GuessError> {
        for (id, word) in self.answers {
            let Some(question) = self.questions.iter().find(|question| question.id == id) else {
                let ids: Vec<&str> = self.questions.iter().map(|question| question.id).collect();
                let open = if ids.is_empty() { "there is none".to_owned() } else { ids.join(", ") };
                return Err(GuessError::Answer(format!(
                    "--answer {id}: is no question about these files; open: {open}"
                )));
            };
            if !question.is_answered {
                let words: Vec<&str> =
                    question.choices.iter().map(|(word, _)| word.as_str()).collect();
                let text =
                    format!("--answer {id}: must be one of {}, got {word:?}", words.join(", "));
                return Err(GuessError::Answer(text));
            }
        }
        Ok(())
    }
}

/// What a table is made of, before it is text.
struct Draft {
    table: TableKind,
    inputs: Vec<DraftInput>,
    /// Keys at the top of the mapping, as TOML, each with a comment.
    top: Vec<(String, String)>,
    findings: Vec<String>,
    /// What cannot be known, as comments in the mapping.
    unknown: Vec<String>,
    /// Sections of the model, as TOML with comments.
    model: String,
}

struct DraftInput {
    log: usize,
    /// Column, source as TOML, reason.
    columns: Vec<(String, String, String)>,
    covariates: Vec<(String, String, String)>,
    /// Further keys, as TOML.
    keys: Vec<(String, String)>,
    /// Keys at the top of the mapping that its columns need, as TOML.
    top: Vec<(String, String)>,
}

impl DraftInput {
    fn new(log: usize) -> Self {
        Self { log, columns: Vec::new(), covariates: Vec::new(), keys: Vec::new(), top: Vec::new() }
    }

    fn add(&mut self, column: &str, source: impl Into<String>, reason: impl Into<String>) {
        self.columns.push((column.to_owned(), source.into(), reason.into()));
    }

    fn has(&self, column: &str) -> bool {
        self.columns.iter().any(|(known, _, _)| known == column)
    }
}

/// Guesses what files are.
///
/// * `files`: the paths, each with what the mapping calls it.
///
/// # Errors
///
/// A file cannot be read, or no table can be made of them.
pub fn guess(
    files: &[(PathBuf, String)],
    answers: &Answers,
    budget: MemoryBudget,
) -> Result<Guess, GuessError> {
    let logs = read_logs(files, budget)?;
    let mut asked = Asked { answers, questions: Vec::new() };
    let mut reasons = Vec::new();
    let drafts = [packets::draft, links::draft, robots::draft];
    let mut found = None;
    for draft in drafts {
        match draft(&logs, &mut asked) {
            Ok(draft) => {
                found = Some(draft);
                break;
            }
            Err(reason) => reasons.push(reason),
        }
    }
    let Some(draft) = found else { return Err(GuessError::NoTable(nothing(&logs, &reasons))) };
    asked.check()?;
    Ok(write::guess(&logs, draft, asked.questions))
}

/// Why nothing can be made of logs, and what they have.
fn nothing(logs: &[Log], reasons: &[String]) -> String {
    let mut text = String::from("no table of measurements can be made of these columns:");
    for log in logs {
        text.push_str(&format!(
            "\n  {} ({}): {}",
            log.files,
            log.form.reason,
            crate::listed(log.sample.names.iter().map(String::as_str))
        ));
    }
    for reason in reasons.iter().filter(|reason| !reason.is_empty()) {
        text.push_str(&format!("\n  {reason}"));
    }
    for profile in logs.iter().flat_map(|log| &log.profiles).filter(|own| readings::is_empty(own)) {
        text.push_str(&format!("\n  {} has no reading in any row looked at", profile.name));
    }
    text.push_str("\nIf a column is there under another name, write a mapping file and use convert: docs/importing.md");
    text
}

/// Reads the beginnings of files. Files with the same columns are one log.
fn read_logs(files: &[(PathBuf, String)], budget: MemoryBudget) -> Result<Vec<Log>, GuessError> {
    let mut sorted: Vec<&(PathBuf, String)> = files.iter().collect();
    sorted.sort_by(|a, b| natural_order(&a.1, &b.1));
    sorted.dedup_by(|a, b| a.1 == b.1);
    let mut logs: Vec<Log> = Vec::new();
    for (path, name) in sorted {
        let form = form_of(path, budget)?;
        let sample = read_sample(path, &form, budget)?;
        let known = logs
            .iter_mut()
            .find(|log| log.sample.names == sample.names && log.form.format == form.format);
        if let Some(log) = known {
            let room = profile::MOST_ROWS.saturating_sub(log.sample.rows.len());
            log.sample.is_cut |= sample.is_cut || room < sample.rows.len();
            let n_new = room.min(sample.rows.len());
            log.sample.files.extend(std::iter::repeat_n(log.names.len(), n_new));
            log.sample.rows.extend(sample.rows.into_iter().take(room));
            log.names.push(name.clone());
            // A file whose numbers all are whole does not show a decimal comma.
            if log.form.keys.len() < form.keys.len() {
                log.form = form;
            }
            continue;
        }
        logs.push(Log {
            files: name.clone(),
            names: vec![name.clone()],
            form,
            melted: None,
            sample,
            profiles: Vec::new(),
        });
    }
    for log in &mut logs {
        if 1 < log.names.len() {
            log.files = words::pattern(&log.names);
            log.sample.add_fields(&log.files, &log.names);
        }
        if log.sample.rows.is_empty() {
            let broken =
                log.sample.broken.1.clone().map_or_else(String::new, |text| format!(": {text}"));
            return Err(GuessError::NoTable(format!(
                "{}: has no row that can be read{broken}",
                log.files
            )));
        }
        log.describe();
        log.melt();
    }
    Ok(logs)
}

/// So much of a file is looked at for its format (bytes): several lines of the longest that are read.
const SNIFFED_BYTES: usize = 4 << 20;

fn form_of(path: &Path, budget: MemoryBudget) -> Result<Form, GuessError> {
    let mut content = open(path, budget)?.uncounted().0;
    let failed = |source| DataError::Read { path: path.to_owned(), source };
    let mut begin = Vec::new();
    while begin.len() < SNIFFED_BYTES {
        let more = content.fill_buf().map_err(failed)?;
        if more.is_empty() {
            break;
        }
        let n = more.len();
        begin.extend_from_slice(more);
        content.consume(n);
    }
    if begin.is_empty() {
        return Err(GuessError::Other {
            path: path.to_owned(),
            what: "the file is empty".to_owned(),
        });
    }
    sniff::sniff(&begin).map_err(|what| GuessError::Other {
        path: path.to_owned(),
        what: format!("this is {what}"),
    })
}

fn read_sample(path: &Path, form: &Form, budget: MemoryBudget) -> Result<Sample, GuessError> {
    let format = crate::formats::BUILT_IN.iter().find(|format| format.variant.name == form.format);
    let format = format.unwrap_or(&crate::formats::BUILT_IN[0]);
    let keys: toml::Table =
        form.keys.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
    let mut text = String::from("table = \"links\"\n[[input]]\nfiles = \"x\"\n");
    text.push_str(&format!("format = \"{}\"\n{keys}", form.format));
    let keys = crate::mapping::input_keys(&text);
    let mut rows = (format.open)(path, open(path, budget)?, &keys)?;
    Ok(Sample::read(&mut *rows)?)
}
