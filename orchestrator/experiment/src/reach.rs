//! How a simulator is reached: it runs already, a command of the file starts it, or it is the one that comes with this program.

use proto::config::{self, Lists, Node, Problem, Program, Section, Url, Value};
use std::path::{Path, PathBuf};

/// How a simulator other than the built-in one is reached.
///
/// These keys of `[netsim]` and `[robotsim]` are the orchestrator's. They are not sent to the simulator.
#[derive(Section)]
pub struct ReachKeys {
    /// URL of a running simulator: http://HOST:PORT, or https:// with [experiment.tls]. Absent: the orchestrator starts one.
    url: Option<Url>,
    /// Program and arguments that start a simulator, instead of url. It must serve at the address in the environment variable
    /// MURMURATION_LISTEN, and is ended with the run. Requires --allow-command.
    command: Option<Program>,
    /// Folder in which command runs, relative to this file. Paths in command are relative to it. Absent: the folder of this file.
    working_directory: Option<String>,
}

/// A command that starts a simulator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SideCommand {
    /// The program and its arguments: at least one word.
    pub words: Vec<String>,
    /// The folder in which it runs, absolute.
    pub folder: PathBuf,
}

impl SideCommand {
    /// The files in the folder, or below it, that its words name: the program itself or a script.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        let Ok(folder) = self.folder.canonicalize() else { return Vec::new() };
        let files = self.words.iter().filter_map(|word| folder.join(word).canonicalize().ok());
        files.filter(|file| file.is_file() && file.starts_with(&folder)).collect()
    }

    /// As one would type it.
    #[must_use]
    pub fn shown(&self) -> String {
        as_typed(&self.words)
    }
}

/// Words as one would type them.
pub(super) fn as_typed(words: &[String]) -> String {
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

/// A word for a shell, in quotation marks where it needs them. Characters that a terminal would obey or hide are escaped.
#[must_use]
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=:,+@%".contains(c);
    let is_visible = |c: char| c == ' ' || c.is_ascii_graphic() || c.is_alphanumeric();
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else if word.chars().all(is_visible) {
        format!("'{}'", word.replace('\'', "'\\''"))
    } else {
        format!("{word:?}")
    }
}

/// What a section says of how its simulator is reached.
pub(super) struct Reach {
    /// Where it runs already, with what the command line says.
    pub(super) url: Option<String>,
    /// What starts it, unless it runs already.
    pub(super) command: Option<SideCommand>,
    /// The keys as they are recorded: the folder of a command is absolute, since the record lies elsewhere than the file.
    pub(super) written: toml::Table,
}

/// Whether a section is of a simulator that checks its own configuration.
pub(super) fn is_foreign(section: &Node) -> bool {
    ["url", "command"].iter().any(|key| section.get(key).is_some())
}

/// Takes the keys out of a section, collecting problems. `base`: the folder of the file.
pub(super) fn take(
    section: &mut Node,
    path: &str,
    url_override: Option<&String>,
    base: &Path,
    problems: &mut Vec<Problem>,
) -> Reach {
    let mut entries = Vec::new();
    for field in ReachKeys::SPEC.fields {
        entries.extend(section.take(field.key).map(|node| (field.key.to_owned(), None, node)));
    }
    let keys = Node { value: Value::Table(entries), span: None };
    let mut written = config::check(&keys, path, &ReachKeys::SPEC, &Lists::NONE, problems).table;
    let reach = ReachKeys::read(&written);
    let has = |key: &str| keys.get(key).is_some();
    if has("url") && has("command") {
        let message = format!(
            "cannot be given together with {path}.url: give command if the simulator is to be started, or url if it runs already"
        );
        problems.push(Problem::new(format!("{path}.command"), message));
    }
    if has("working_directory") && !has("command") {
        let message = format!("applies only with {path}.command; remove it");
        problems.push(Problem::new(format!("{path}.working_directory"), message));
    }
    let url = match (url_override, reach.url) {
        (Some(url), _) => checked_url(&format!("--{path}"), url, problems),
        (None, Some(Url(url))) => checked_url(&format!("{path}.url"), &url, problems),
        (None, None) => None,
    };
    let folder = base.join(reach.working_directory.as_deref().unwrap_or("."));
    let command = reach.command.map(|Program(words)| {
        let folder = std::path::absolute(&folder).unwrap_or(folder);
        SideCommand { words, folder }
    });
    if let Some(command) = &command {
        let folder = command.folder.display().to_string();
        written.insert("working_directory".to_owned(), folder.into());
    }
    Reach { command: command.filter(|_| url_override.is_none()), url, written }
}

fn checked_url(path: &str, url: &str, problems: &mut Vec<Problem>) -> Option<String> {
    let host = url.strip_prefix("http://").or_else(|| url.strip_prefix("https://"));
    if host.is_some_and(|host| !host.is_empty()) && url.parse::<http::Uri>().is_ok() {
        return Some(url.to_owned());
    }
    let mut problem = Problem::new(path, "must be http://HOST:PORT or https://HOST:PORT")
        .value(format!("{url:?}"));
    if host.is_none() && !url.contains("://") && !url.is_empty() {
        problem = problem.nearest(format!("\"http://{url}\""));
    }
    problems.push(problem);
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(text: &str, url: Option<&String>) -> (Reach, Vec<String>) {
        let mut section = config::parse(text).unwrap();
        let mut problems = Vec::new();
        let reach = take(&mut section, "robotsim", url, Path::new("/a/b"), &mut problems);
        assert_eq!(section.to_toml().to_string(), "{ own = 1 }");
        (reach, problems.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn a_command_runs_in_the_folder_of_the_file_or_beside_it() {
        let (reach, problems) = taken("own = 1\ncommand = [\"python\", \"my robots.py\"]", None);
        let command = reach.command.unwrap();
        assert_eq!(problems, Vec::<String>::new());
        assert_eq!(command.folder, Path::new("/a/b"));
        assert_eq!(command.shown(), "python 'my robots.py'");
        assert_eq!(reach.written["working_directory"].as_str(), Some("/a/b"));
        let text = "own = 1\ncommand = [\"./run\"]\nworking_directory = \"sims\"";
        assert_eq!(taken(text, None).0.command.unwrap().folder, Path::new("/a/b/sims"));
    }

    #[test]
    fn a_url_of_the_command_line_replaces_a_command() {
        let url = "http://127.0.0.1:1".to_owned();
        let (reach, problems) = taken("own = 1\ncommand = [\"x\"]", Some(&url));
        assert_eq!((reach.command, reach.url, problems), (None, Some(url), Vec::new()));
    }

    #[test]
    fn what_contradicts_itself_is_refused_by_name() {
        let (_, problems) = taken("own = 1\nurl = \"http://a:1\"\ncommand = [\"x\"]", None);
        assert!(
            problems[0].starts_with("robotsim.command: cannot be given together with robotsim.url")
        );
        let (_, problems) = taken("own = 1\nworking_directory = \"x\"", None);
        assert!(
            problems[0]
                .starts_with("robotsim.working_directory: applies only with robotsim.command")
        );
        for wrong in ["[]", "\"python x.py\"", "[1]", "[\"\"]"] {
            let (_, problems) = taken(&format!("own = 1\ncommand = {wrong}"), None);
            assert!(problems[0].starts_with("robotsim.command"), "{problems:?}");
        }
    }

    #[test]
    fn a_command_hides_nothing_from_a_terminal() {
        assert_eq!(quoted("a\u{1b}[2Kb"), "\"a\\u{1b}[2Kb\"");
        assert_eq!(quoted("a\nb"), "\"a\\nb\"");
        assert_eq!(quoted("it's"), "'it'\\''s'");
        assert!(!quoted("x\u{202e}y").contains('\u{202e}'));
    }
}
