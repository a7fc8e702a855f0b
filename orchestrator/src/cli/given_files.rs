//! The files that are given to a command: whether they exist, and are not given in each other's place.

use super::Failure;
use clap::ArgMatches;
use clap::error::{Error, ErrorKind};
use experiment::{FileKind, missing_file, program_name, quoted};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Arguments whose file must be TOML.
const TOML: [&str; 2] = ["config", "mapping"];
/// Options whose file must be a table, or a folder with one.
const TABLES: [&str; 5] = ["data", "like", "links", "positions", "heard"];
/// Further arguments that name a file or a folder that is read, and what it should be.
const OTHERS: [(&str, &str); 4] = [
    ("run", "the folder of a recorded run"),
    ("result", "the folder of a run or of a sweep, or an answer as JSON"),
    ("a", "the folder of a run or of a sweep"),
    ("b", "the folder of a run or of a sweep"),
];

/// Refuses files that do not exist, and files that are given in each other's place.
pub(super) fn check(matches: &ArgMatches) -> Result<(), Failure> {
    let Some((verb, matches)) = matches.subcommand() else { return Ok(()) };
    let path = |id: &&'static str| {
        let path = matches.try_get_one::<PathBuf>(id).ok().flatten();
        path.map(|path| (*id, path.as_path()))
    };
    let toml = TOML.iter().find_map(path);
    let tables: Vec<(&str, &Path)> = TABLES.iter().filter_map(path).collect();
    let others = OTHERS.iter().filter_map(|(id, what)| Some((path(id)?.1, Some(*what))));
    let files = toml.into_iter().chain(tables.clone()).map(|(_, path)| (path, None));
    for (path, what) in files.chain(others) {
        // What exists and cannot be read, the command says.
        if path.symlink_metadata().is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound)
        {
            let instead = what.map(|what| format!("; give {what}")).unwrap_or_default();
            let text = format!("{}: {}{instead}", path.display(), missing_file(path));
            return Err(Failure::request(text));
        }
    }
    let is = |path: &Path, kind| FileKind::of_file(path) == Some(kind);
    let table = toml.map(|(_, path)| path).filter(|path| is(path, FileKind::Table));
    let is_csv = |path: &Path| path.extension().is_some_and(|ending| ending == "csv");
    let configuration = tables.iter().find(|(_, path)| !is_csv(path) && is(path, FileKind::Toml));
    let shown = |path: &Path| quoted(&path.display().to_string());
    let program = program_name();
    let text = match (table, configuration) {
        (None, None) => match toml.filter(|(_, path)| verb != "convert" && is_mapping(path)) {
            None => return Ok(()),
            Some((_, path)) => format!(
                "{path} is a mapping file, which says how logs become a table; to make the table, use `{program} convert {path}`",
                path = shown(path)
            ),
        },
        (Some(table), Some((option, configuration))) => {
            let [table, configuration] = [table, configuration].map(shown);
            format!(
                "{table} is a table and {configuration} a configuration (TOML): give the configuration first, as in \
                 `{program} {verb} {configuration} --{option} {table}`"
            )
        }
        (Some(table), None) => in_place_of_toml(verb, &shown(table), !tables.is_empty()),
        (None, Some((option, configuration))) => {
            let toml = toml.map_or_else(String::new, |(_, path)| format!(" {}", shown(path)));
            format!(
                "--{option} {}: is a configuration (TOML), not a table of measurements; give a table, as in \
                 `{program} {verb}{toml} --{option} TABLE.csv`",
                shown(configuration)
            )
        }
    };
    Err(Failure::request(text))
}

/// Whether a file is a mapping, valid or not: no other configuration has a list of inputs.
fn is_mapping(path: &Path) -> bool {
    let text = experiment::text_of(path);
    text.is_ok_and(|text| text.lines().any(|line| line.trim() == "[[input]]"))
}

/// What to say of a table where a command takes TOML. `has_table`: an option names another table.
fn in_place_of_toml(verb: &str, table: &str, has_table: bool) -> String {
    let program = program_name();
    match verb {
        "convert" => format!(
            "{table} is a table, and convert takes a mapping file (TOML); to make measurements of a table, use \
             `{program} import {table}`"
        ),
        "run" | "sweep" => format!(
            "{table} is a table, and {verb} takes an experiment file (TOML); to see what the table holds, use \
             `{program} check --data {table}`"
        ),
        "check" if !has_table => format!(
            "{table} is a table, not an experiment file (TOML); to check it, use `{program} check --data {table}`"
        ),
        _ if has_table => format!(
            "{table} is a table, and {verb} takes a configuration (TOML) there, as in `{program} {verb} MODEL.toml`"
        ),
        _ => format!(
            "{table} is a table: give it with --data, after a configuration (TOML), as in \
             `{program} {verb} MODEL.toml --data {table}`"
        ),
    }
}

/// Refuses a table in place of TOML on a command line that lacks an option; `words`: all but the program.
pub(super) fn check_words(
    error: &Error,
    words: impl Iterator<Item = OsString>,
) -> Result<(), Failure> {
    let words: Vec<String> = words.map(|word| word.to_string_lossy().into_owned()).collect();
    let (Some(verb), ErrorKind::MissingRequiredArgument) = (words.first(), error.kind()) else {
        return Ok(());
    };
    // A word after an option is its value.
    let is_positional = |pair: &&[String]| pair.iter().all(|word| !word.starts_with('-'));
    let is_table = |word: &&String| FileKind::of_file(Path::new(word)) == Some(FileKind::Table);
    let table = words.windows(2).filter(is_positional).map(|pair| &pair[1]).find(is_table);
    match table {
        Some(table) => Err(Failure::request(in_place_of_toml(verb, &quoted(table), false))),
        None => Ok(()),
    }
}
