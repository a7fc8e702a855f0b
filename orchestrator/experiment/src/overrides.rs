//! What the command line puts over an experiment file.

use super::Tls;
use super::consent::{Action, Acts, Consent};
use super::sides::file_name;
use bytes::Bytes;
use proto::config::{self, Node, Problem, Refusal, Value, set};
use std::collections::BTreeMap;
use std::path::Path;

/// What the command line puts over the file.
#[derive(Clone, Debug, std::default::Default)]
pub struct Overrides {
    /// `--set key=value`, in order.
    pub set: Vec<String>,
    /// `--seed`.
    pub seed: Option<u64>,
    /// `--netsim`.
    pub netsim_url: Option<String>,
    /// `--robotsim`.
    pub robotsim_url: Option<String>,
    /// `--tls-ca`, `--tls-cert`, `--tls-key`.
    pub tls: Option<Tls>,
    /// Files that a section names, by the section and the file's name, in place of those on the disk: of an experiment that was
    /// recorded with them.
    pub files: BTreeMap<(String, String), Bytes>,
    /// The run goes on from a checkpoint: the formed network that it began with is not read again.
    pub goes_on: bool,
    /// `--allow-command`, `--allow-file`, `--allow-url`.
    pub consent: Consent,
}

impl Overrides {
    /// The same for a command that does less of what the file asks for.
    #[must_use]
    pub fn acting(&self, acts: Acts) -> Self {
        Self { consent: Consent { acts, ..self.consent.clone() }, ..self.clone() }
    }

    /// Whether `--set` gives a key that names a file or a URL: whoever types it agrees. A program is more than its name.
    pub(super) fn names(&self, key: &str, action: &Action) -> bool {
        let is_set = |assignment: &String| {
            let set = assignment.split('=').next().unwrap_or_default().trim();
            key.strip_prefix(set)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        matches!(action, Action::ReadFile { .. } | Action::Call { .. })
            && self.set.iter().any(is_set)
    }

    /// Whether the content of a file that a section names is known without reading it.
    pub(super) fn has_file(&self, section: &str, file: &Path) -> bool {
        self.files.contains_key(&(section.to_owned(), file_name(file)))
    }
}

/// Parses the text of an experiment file and puts the overrides over it. Returns it with what is wrong with those.
pub fn opened(
    path: &Path,
    text: &str,
    overrides: &Overrides,
) -> Result<(Node, Vec<Problem>), Refusal> {
    let mut tree = config::parse(text)
        .map_err(|problems| Refusal::new(path, text, &Node::empty_table(), problems))?;
    let mut problems = Vec::new();
    for assignment in &overrides.set {
        if let Err(problem) = set(&mut tree, assignment) {
            problems.push(problem);
        }
    }
    if let Some(seed) = overrides.seed {
        match i64::try_from(seed) {
            Ok(seed) => {
                if let Err(problem) = tree.set("experiment.seed", Value::Integer(seed)) {
                    problems.push(problem);
                }
            }
            Err(_) => problems.push(
                Problem::new("--seed", format!("must be at most {}", i64::MAX))
                    .value(seed)
                    .nearest(i64::MAX),
            ),
        }
    }
    Ok((tree, problems))
}
