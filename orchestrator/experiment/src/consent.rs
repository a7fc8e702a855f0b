//! What an experiment file asks for outside of its own folder, and what the user has agreed to.
//!
//! Programs that are started, lines of cluster scripts, files elsewhere and hosts that are called are *capabilities*. The kinds of the
//! keys say which key asks for one, so a new key of such a kind is found without another word here. [`load`](crate::load) and
//! [`read`](crate::read) refuse those that were not allowed, all at once, before anything is read, sent or started.

use super::reach::as_typed;
use super::{ExperimentKeys, OutputConfig, Overrides, ReachKeys, sweep, timeline};
use proto::config::{
    self, ClusterLine, FilePath, Lists, Node, Problem, Program, Section as _, TableSpec, Touch,
    TouchTarget, Url, Value,
};
use proto::site;
use std::fmt;
use std::path::{Component, Path, PathBuf};

/// Something that a file asks for outside of its own folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Capability {
    /// Path of the key that asks for it.
    pub key: String,
    /// What it asks for.
    pub action: Action,
}

/// What a file may ask for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// To run a program on this machine.
    Command {
        /// The program and its arguments, as one would type them.
        command: String,
        /// The folder in which it runs.
        folder: PathBuf,
    },
    /// To put a line into the script of a batch system, which executes or obeys it.
    ClusterLine {
        /// The line.
        line: String,
    },
    /// To read a file outside of the folder of the experiment file.
    ReadFile {
        /// The file.
        file: PathBuf,
    },
    /// To send the experiment to a program elsewhere, and do as it says.
    Call {
        /// Where it is.
        url: String,
        /// Files whose contents are sent, too.
        files: Vec<PathBuf>,
    },
}

impl Action {
    /// The option of the command line that allows it.
    #[must_use]
    pub fn option(&self) -> String {
        match self {
            Self::Command { .. } | Self::ClusterLine { .. } => "--allow-command".to_owned(),
            Self::ReadFile { file } => {
                format!("--allow-file {}", super::quoted(&file.display().to_string()))
            }
            Self::Call { url, .. } => format!("--allow-url {}", super::quoted(url)),
        }
    }
}

/// In words: what it would do.
impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command { command, folder } => write!(
                f,
                "run this program on your machine, in the folder {}: {command}",
                folder.display()
            ),
            Self::ClusterLine { line } => {
                write!(f, "put this into the script of a batch system: {}", super::quoted(line))
            }
            Self::ReadFile { file } => {
                write!(f, "read a file outside of the folder of this file: {}", file.display())
            }
            Self::Call { url, files } => {
                write!(f, "send this experiment")?;
                let files: Vec<String> =
                    files.iter().map(|file| file.display().to_string()).collect();
                if !files.is_empty() {
                    write!(f, " and the contents of {}", files.join(", "))?;
                }
                write!(f, " to {url}")
            }
        }
    }
}

/// What the user has agreed to, on the command line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Consent {
    /// `--allow-command`: commands, and lines of cluster scripts.
    pub commands: bool,
    /// `--allow-file`: these files, and all files in these folders.
    pub files: Vec<PathBuf>,
    /// `--allow-url`: these URLs.
    pub urls: Vec<String>,
    /// What is done of what the file asks for: the rest need not be allowed.
    pub acts: Acts,
}

/// What a command does of what a file asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Acts {
    /// Everything.
    #[default]
    Everything,
    /// It reads files, and starts and calls nothing.
    Reads,
    /// Nothing: it says what the file asks for. Files that were not allowed are not looked at.
    Nothing,
}

impl Consent {
    /// Whether it covers what a file asks for.
    #[must_use]
    pub fn covers(&self, action: &Action) -> bool {
        match action {
            Action::Command { .. } | Action::ClusterLine { .. } => self.commands,
            Action::ReadFile { file } => self.files.iter().any(|allowed| is_inside(file, allowed)),
            Action::Call { url, .. } => self
                .urls
                .iter()
                .any(|allowed| allowed.trim_end_matches('/') == url.trim_end_matches('/')),
        }
    }

    /// The keys whose files it does not allow to read, whatever is done.
    pub(super) fn unread<'a>(&self, capabilities: &'a [Capability]) -> Vec<&'a str> {
        let is_unread =
            |action: &Action| matches!(action, Action::ReadFile { .. }) && !self.covers(action);
        let unread = capabilities.iter().filter(|asked| is_unread(&asked.action));
        unread.map(|asked| asked.key.as_str()).collect()
    }

    /// A problem for each capability that it does not cover.
    #[must_use]
    pub fn refusals(&self, capabilities: &[Capability]) -> Vec<Problem> {
        let acts = |action: &Action| match self.acts {
            Acts::Everything => true,
            Acts::Reads => matches!(action, Action::ReadFile { .. }),
            Acts::Nothing => false,
        };
        let refused = |action: &Action| acts(action) && !self.covers(action);
        capabilities
            .iter()
            .filter(|capability| refused(&capability.action))
            .map(Capability::refusal)
            .collect()
    }
}

impl Capability {
    /// To read a file. `None`: it is in the folder `base` of the file that names it.
    #[must_use]
    pub fn of_file(key: String, file: &Path, base: &Path) -> Option<Self> {
        let file = absolute(Path::new(""), file);
        (!is_inside(&file, base)).then_some(Self { key, action: Action::ReadFile { file } })
    }

    /// To call a program elsewhere, which is sent these files, too. `None`: it is on this machine, and no file is sent to it.
    #[must_use]
    pub fn call(key: String, url: String, files: Vec<PathBuf>) -> Option<Self> {
        let needs = !files.is_empty() || !is_loopback(&url);
        needs.then_some(Self { key, action: Action::Call { url, files } })
    }

    fn refusal(&self) -> Problem {
        let message = format!(
            "would {}\n    Nothing was done. If you trust the file, allow {} with {}",
            self.action,
            if matches!(self.action, Action::Command { .. }) { "its commands" } else { "it" },
            self.action.option()
        );
        Problem::new(&*self.key, message)
    }
}

/// Whether a file is a folder's, at whatever depth, or that file itself. Links are followed.
fn is_inside(file: &Path, folder: &Path) -> bool {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    real(file).starts_with(real(folder))
}

/// A path without links and without `..`, as far as it exists.
fn real(path: &Path) -> PathBuf {
    if let Ok(real) = path.canonicalize() {
        return real;
    }
    let parent = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => real(parent),
        Some(_) => real(Path::new(".")),
        None => return path.to_owned(),
    };
    match path.components().next_back() {
        Some(Component::ParentDir) => parent.parent().map_or(parent.clone(), Path::to_owned),
        Some(Component::Normal(name)) => parent.join(name),
        _ => parent,
    }
}

/// The sections of an experiment file, with all that their keys name outside of it.
fn touches(tree: &Node) -> Vec<(&'static str, Vec<Touch>)> {
    let robots = robotsim::catalogue::Catalogue::built_in().lists();
    let network = netsim::catalogue::Catalogue::built_in().lists();
    let sections: [(&'static str, TableSpec, &Lists); 8] = [
        ("experiment", ExperimentKeys::SPEC, &Lists::NONE),
        ("site", site::SPEC, &Lists::NONE),
        ("robotsim", ReachKeys::SPEC, &Lists::NONE),
        ("robotsim", robotsim::config::SPEC, &robots),
        ("netsim", ReachKeys::SPEC, &Lists::NONE),
        ("netsim", netsim::config::SPEC, &network),
        ("output", OutputConfig::SPEC, &Lists::NONE),
        (sweep::KEY, sweep::SPEC, &Lists::NONE),
    ];
    let named = |node: &Node, path: &str, spec: &TableSpec, lists: &Lists| {
        config::check(node, path, spec, lists, &mut Vec::new()).touches
    };
    let tables = sections.into_iter().filter_map(|(section, spec, lists)| {
        Some((section, named(tree.get(section)?, section, &spec, lists)))
    });
    let entries = match tree.get("timeline").map(|node| &node.value) {
        Some(Value::List(entries)) => &entries[..],
        _ => &[],
    };
    let entries = entries.iter().enumerate().map(|(index, entry)| {
        let path = format!("timeline[{index}]");
        ("timeline", named(entry, &path, &timeline::EntryKeys::SPEC, &Lists::NONE))
    });
    tables.chain(entries).collect()
}

/// The keys of an experiment file that name files, each with the path written there.
pub(super) fn named_files(tree: &Node) -> impl Iterator<Item = (String, String)> {
    touches(tree).into_iter().flat_map(|(_, touches)| touches).filter_map(|touch| {
        let TouchTarget::File(FilePath(path)) = touch.target else { return None };
        Some((touch.key, path))
    })
}

/// Everything that an experiment file in the folder `base` asks for outside of it. What the command line gives in place of a key is
/// not asked for by the file, and contents that were recorded are not read again.
#[must_use]
pub fn capabilities(tree: &Node, base: &Path, overrides: &Overrides) -> Vec<Capability> {
    let mut found = Vec::new();
    let all = touches(tree);
    for (section, touches) in &all {
        let url_override = match *section {
            "robotsim" => overrides.robotsim_url.as_ref(),
            "netsim" => overrides.netsim_url.as_ref(),
            _ => None,
        };
        for Touch { key, target } in touches {
            let is_given = overrides.tls.is_some() && key.starts_with("experiment.tls.");
            if is_given || overrides.goes_on && key == "experiment.warm_start" {
                continue;
            }
            let action = match target {
                TouchTarget::File(FilePath(path)) => {
                    let file = absolute(base, path);
                    let is_recorded = overrides.has_file(section, &file);
                    (!is_recorded && !is_inside(&file, base)).then_some(Action::ReadFile { file })
                }
                TouchTarget::Program(Program(words)) => url_override.is_none().then(|| {
                    let folder = tree.get(section).and_then(|node| node.get("working_directory"));
                    let folder = match folder.map(|node| &node.value) {
                        Some(Value::Text(folder)) => folder,
                        _ => ".",
                    };
                    let command = as_typed(words);
                    Action::Command { command, folder: absolute(base, folder) }
                }),
                TouchTarget::Url(_) if url_override.is_some() => None,
                TouchTarget::Url(Url(url)) => {
                    let files = files_of(&all, section, base);
                    Capability::call(key.clone(), url.clone(), files).map(|call| call.action)
                }
                TouchTarget::ClusterLine(ClusterLine(line)) => {
                    Some(Action::ClusterLine { line: line.clone() })
                }
            };
            let action = action.filter(|action| !overrides.names(key, action));
            found.extend(action.map(|action| Capability { key: key.clone(), action }));
        }
    }
    found
}

/// The files that a section names.
fn files_of(all: &[(&'static str, Vec<Touch>)], section: &str, base: &Path) -> Vec<PathBuf> {
    let touches = all.iter().filter(|(other, _)| *other == section).flat_map(|(_, found)| found);
    let mut files: Vec<PathBuf> = touches
        .filter_map(|touch| match &touch.target {
            TouchTarget::File(FilePath(path)) => Some(absolute(base, path)),
            _ => None,
        })
        .collect();
    files.dedup();
    files
}

fn absolute(base: &Path, path: impl AsRef<Path>) -> PathBuf {
    let path = base.join(path);
    std::path::absolute(&path).unwrap_or(path)
}

/// Whether a URL leads to this machine: a name that means it, or an address of the loopback network.
fn is_loopback(url: &str) -> bool {
    let Ok(uri) = url.parse::<http::Uri>() else { return false };
    let host = uri.host().unwrap_or_default();
    let address = host.trim_start_matches('[').trim_end_matches(']');
    host.eq_ignore_ascii_case("localhost")
        || address.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests;
