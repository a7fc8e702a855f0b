//! `murmuration import`: what logs are, guessed and shown; then a mapping, a table and a first model.

use super::convert::{checked, print};
use super::{Failure, ReadArgs, check_json, place_for, write_json};
use ::convert::files::is_pattern;
use ::convert::guess::{Answers, Guess, GuessError, Guessed, Question, guess, next_command};
use ::convert::mapping::Mapping;
use ::convert::output::{self, OutputFormat};
use ::convert::{Conversion, Converted, listed};
use clap::Args;
use experiment::{as_file_name, missing_file, program_name, quoted};
use numbers::layout::TextTable;
use schemars::JsonSchema;
use serde::Serialize;
use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use terminal::{say, warn_all};

#[derive(Args)]
pub(super) struct ImportArgs {
    /// The logs: CSV, TSV, Parquet, JSON lines, K7, or logs of OpenWSN or Contiki; several files belong together
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Write the mapping, the table and the model to this folder
    #[arg(long, value_name = "DIR", default_value = ".", alias = "output")]
    out: PathBuf,
    /// Begin the names of the files with this [default: the name of the first log]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Take the likely answer to every question, and write without asking
    #[arg(long, short)]
    yes: bool,
    /// Answer a question, as in --answer time-unit=ms. Repeatable
    #[arg(long, value_name = "QUESTION=WORD")]
    answer: Vec<String>,
    #[command(flatten)]
    read: ReadArgs,
    /// Replace files that exist
    #[arg(long)]
    replace: bool,
    /// Write what was guessed and converted as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What the schema of the answer is called.
const SCHEMA: &str = "import/1";

/// What logs were taken for, and what became of them.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Import {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    schema: &'static str,
    /// What the logs were taken for.
    guess: Guess,
    /// How they became a table.
    conversion: Conversion,
    /// The files that were written: mapping, table and model.
    files: Vec<PathBuf>,
}

/// The files that an import writes.
struct Places {
    mapping: PathBuf,
    table: PathBuf,
    model: PathBuf,
}

/// `murmuration import`.
pub(super) fn import(args: &ImportArgs) -> Result<(), Failure> {
    if !args.out.is_dir() {
        let text = format!("--out {}: is no folder; make it first", args.out.display());
        return Err(Failure::request(text));
    }
    check_json(args.json.as_deref())?;
    let name = name(args)?;
    let folder = args.out.canonicalize().map_err(Failure::work)?;
    let files: Vec<(PathBuf, String)> =
        args.files.iter().map(|file| in_mapping(file, &folder)).collect::<Result<_, _>>()?;
    let mut answers = answers(&args.answer)?;
    let is_asked = !args.yes && std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
    let guessed = loop {
        let guessed =
            guess(&files, &answers, args.read.reading().budget).map_err(|error| refused(&error))?;
        let open = guessed.questions.iter().find(|question| !question.is_answered);
        match open.filter(|_| is_asked) {
            Some(question) => {
                let word = ask(question)?;
                answers.insert(question.id.to_owned(), word);
            }
            None => break guessed,
        }
    };
    let place = |file: String| {
        if args.out == Path::new(".") { PathBuf::from(file) } else { args.out.join(file) }
    };
    let places = Places {
        mapping: place(format!("{name}-map.toml")),
        table: place(format!("{name}-{}.csv", guessed.table.name())),
        model: place(format!("{name}-model.toml")),
    };
    let all = [&places.mapping, &places.table, &places.model];
    let existing: Vec<String> =
        all.iter().filter(|path| path.exists()).map(|path| path.display().to_string()).collect();
    let mapping =
        Mapping::of_text(&places.mapping, guessed.mapping.clone()).map_err(|refusal| {
            let text = format!(
                "the guess is no valid mapping. Write it by hand (docs/importing.md):\n{refusal}"
            );
            Failure::work(text)
        })?;
    let converted = checked(::convert::convert(&mapping, args.read.reading()))?;
    show(&guessed, &converted);
    let open: Vec<&Question> =
        guessed.questions.iter().filter(|question| !question.is_answered).collect();
    if !args.yes && !is_asked {
        return Err(Failure::request(to_answer(&open)));
    }
    if !existing.is_empty() && !args.replace {
        let text =
            format!("{}: exist already; give another --name, or --replace", existing.join(", "));
        return Err(Failure::request(text));
    }
    if is_asked && !confirmed(&places)? {
        return Err(Failure::request("nothing was written"));
    }
    write(&places, &guessed, &converted, args.replace)?;
    say("");
    print(&places.table, &converted.answer);
    say(format!("\nwrote {}", places.table.display()));
    say(format!("      {}  which columns became what", places.mapping.display()));
    say(format!("      {}  a first model", places.model.display()));
    let shown = |path: &Path| quoted(&path.to_string_lossy());
    let next = next_command(guessed.table, &shown(&places.model), &shown(&places.table));
    say(format!("\nCheck the lines marked CHECK in both, then:\n  {} {next}", program_name()));
    let answer = Import {
        schema: SCHEMA,
        guess: guessed,
        conversion: converted.answer,
        files: all.map(|path| path.clone()).into(),
    };
    write_json(args.json.as_deref(), &answer)
}

/// How the names of the files begin.
fn name(args: &ImportArgs) -> Result<String, Failure> {
    if let Some(name) = &args.name {
        if experiment::is_file_name(name) {
            return Ok(name.clone());
        }
        return Err(Failure::request(format!(
            "--name {name:?}: must be 1 to 100 letters, digits, '-', '_' or '.', not starting with '.' or '-'; use {}",
            as_file_name(name)
        )));
    }
    let first = args.files.first().and_then(|file| file.file_name()).unwrap_or_default();
    let first = first.to_string_lossy();
    let stem = first.trim_start_matches('.').split('.').next().unwrap_or_default();
    Ok(as_file_name(stem))
}

/// A log, and what a mapping in a folder calls it: a path that is relative to the folder, if the log lies in it.
fn in_mapping(file: &Path, folder: &Path) -> Result<(PathBuf, String), Failure> {
    let whole = file.canonicalize().map_err(|error| {
        let what = match error.kind() {
            std::io::ErrorKind::NotFound => missing_file(file),
            kind => format!("cannot be read: {}", std::io::Error::from(kind)),
        };
        Failure::request(format!("{}: {what}", file.display()))
    })?;
    if whole.is_dir() {
        return Err(Failure::request(format!(
            "{}: is a folder; give the files in it. A folder of ROS 2 is read by the Python package: python -m murmuration.importers {}",
            file.display(),
            file.display()
        )));
    }
    if whole.extension().is_some_and(|ending| ending == "toml") {
        let (program, path) = (program_name(), file.display());
        return Err(Failure::request(format!(
            "{path}: is a configuration (TOML), and import takes logs; a mapping file is used by `{program} convert {path}`, \
             a model is checked by `{program} check {path}`"
        )));
    }
    let name = whole.strip_prefix(folder).unwrap_or(&whole).to_string_lossy().into_owned();
    if is_pattern(&name) {
        return Err(Failure::request(format!(
            "{}: its path has *, ? or braces, which stand for other names in a mapping; rename it",
            file.display()
        )));
    }
    Ok((whole, name))
}

fn answers(given: &[String]) -> Result<Answers, Failure> {
    let pair = |text: &String| {
        let (id, word) = text.split_once('=').ok_or_else(|| {
            Failure::request(format!("--answer {text}: must be QUESTION=WORD, as in time-unit=ms"))
        })?;
        Ok((id.trim().to_owned(), word.trim().to_owned()))
    };
    given.iter().map(pair).collect()
}

fn refused(error: &GuessError) -> Failure {
    match error {
        GuessError::Log(error) => Failure::of_data(error),
        GuessError::Other { .. } | GuessError::NoTable(_) | GuessError::Answer(_) => {
            Failure::request(error)
        }
    }
}

/// Asks a question on the terminal until a choice is given.
fn ask(question: &Question) -> Result<String, Failure> {
    say(format!("\n{}", question.text));
    for (number, (word, what)) in (1..).zip(&question.choices) {
        let likely = if number == question.answer + 1 { "  (likely)" } else { "" };
        say(format!("  {number}  {word}: {what}{likely}"));
    }
    let choices = &question.choices;
    let answer = |text: &str| match text {
        "" => Some(choices[question.answer].0.clone()),
        text => {
            let by_number =
                text.parse::<usize>().ok().and_then(|number| choices.get(number.checked_sub(1)?));
            let by_word = || choices.iter().find(|(word, _)| word.eq_ignore_ascii_case(text));
            by_number.or_else(by_word).map(|(word, _)| word.clone())
        }
    };
    loop {
        let text = prompt(&format!("1 to {} [{}]: ", choices.len(), question.answer + 1))?;
        if let Some(word) = answer(text.trim()) {
            return Ok(word);
        }
        say(format!("{:?} is none of the choices.", text.trim()));
    }
}

/// Writes a prompt and reads a line.
fn prompt(text: &str) -> Result<String, Failure> {
    let _ = write!(std::io::stderr(), "{text}");
    let _ = std::io::stderr().flush();
    let mut line = String::new();
    match std::io::stdin().read_line(&mut line) {
        Ok(0) | Err(_) => Err(Failure::request("no answer; nothing was written")),
        Ok(_) => Ok(line),
    }
}

/// Whether the files are to be written.
fn confirmed(places: &Places) -> Result<bool, Failure> {
    let names =
        [&places.mapping, &places.table, &places.model].map(|path| path.display().to_string());
    loop {
        let text = prompt(&format!("\nWrite {}? [Y/n] ", names.join(", ")))?;
        match text.trim().to_lowercase().as_str() {
            "" | "y" | "yes" => return Ok(true),
            "n" | "no" => return Ok(false),
            _ => {}
        }
    }
}

/// What to say where nobody can be asked.
fn to_answer(open: &[&Question]) -> String {
    let mut text = String::from("nothing was written: accept this with --yes");
    if open.is_empty() {
        return text;
    }
    text.push_str(", or answer first:");
    for question in open {
        text.push_str(&format!("\n  {}", question.text));
        for (word, what) in &question.choices {
            text.push_str(&format!("\n    --answer {}={word}  {what}", question.id));
        }
    }
    text
}

/// The guess with its reasons, and the first rows.
fn show(guessed: &Guess, converted: &Converted) {
    say(format!("These are {}:", guessed.table.name()));
    let headings = ["column", "from", "because"];
    let mut table = TextTable::new(headings).text_in(1).text_in(2).indented(2);
    for Guessed { column, from, reason, .. } in &guessed.columns {
        table.row([column.as_str(), from.trim_matches('"'), reason]);
    }
    say(table.text().trim_end());
    for finding in &guessed.findings {
        say(format!("  found: {finding}"));
    }
    if !guessed.unused.is_empty() {
        say(format!("  not used: {}", listed(guessed.unused.iter().map(String::as_str))));
    }
    say("\nThe first rows:");
    let rows = &converted.table;
    let n = rows.n_rows().min(3);
    let numbers = (1..=n).map(|row| row.to_string());
    let mut table = TextTable::new(std::iter::once(String::new()).chain(numbers)).indented(2);
    for name in rows.names() {
        let values = rows.column(name).unwrap_or_default()[..n].iter();
        let shown =
            values.map(|value| if value.is_finite() { short(*value) } else { String::new() });
        table.row(std::iter::once(name.clone()).chain(shown));
    }
    say(table.text().trim_end());
    warn_all(guessed.questions.iter().filter(|question| !question.is_answered).map(|question| {
        format!("{} Taken: {}", question.text, question.choices[question.answer].0)
    }));
}

/// A number in at most ten characters or so.
fn short(value: f64) -> String {
    let rounded = (value * 1e4).round() / 1e4;
    if value != 0.0 && rounded == 0.0 {
        format!("{value:.2e}")
    } else {
        format!("{}", rounded + 0.0)
    }
}

/// Writes the three files: they get their names when all are whole.
fn write(
    places: &Places,
    guessed: &Guess,
    converted: &Converted,
    is_replaced: bool,
) -> Result<(), Failure> {
    let failed =
        |path: &Path, error: std::io::Error| Failure::work(format!("{}: {error}", path.display()));
    let draft = |path: &Path| place_for("--out", path).map_err(Failure::work);
    let [mut table, mut mapping, mut model] =
        [draft(&places.table)?, draft(&places.mapping)?, draft(&places.model)?];
    output::write(&converted.table, OutputFormat::Csv, &mut table)
        .map_err(|error| failed(&places.table, error))?;
    mapping
        .write_all(guessed.mapping.as_bytes())
        .map_err(|error| failed(&places.mapping, error))?;
    model.write_all(guessed.model.as_bytes()).map_err(|error| failed(&places.model, error))?;
    for (draft, path) in
        [table, mapping, model].into_iter().zip([&places.table, &places.mapping, &places.model])
    {
        let placed = if is_replaced { draft.replace(path) } else { draft.place(path) };
        placed.map_err(|error| failed(path, error))?;
    }
    Ok(())
}
