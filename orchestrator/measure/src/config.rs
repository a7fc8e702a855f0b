//! The part of a configuration that is compared with measurements.

use bytes::Bytes;
use physics::Model;
use proto::config::{Node, Problem, Refusal, Value};
use proto::site::{self, Site};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A configuration as far as a comparison needs it: `[site]`, `[netsim.phy]`, `[robotsim.dynamics]`. Everything else may be
/// there, and is not read.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Path of the configuration file.
    pub path: PathBuf,
    /// Text of the file (TOML), as written.
    pub text: String,
    /// Keys that were set over the text, such as `netsim.phy.propagation=friis`.
    pub set: Vec<String>,
    /// What it says, with the keys that were set.
    pub tree: Node,
    /// Walls, obstacles, ground.
    pub site: Site,
    /// What it can choose by name.
    pub catalogues: Catalogues,
    /// Contents of the files that `[netsim.phy]` names, by the path written there.
    pub files: BTreeMap<String, Bytes>,
}

/// The lists of both simulators: what configurations can choose by name, and so what a diagnosis tries. By default what is built in.
#[derive(Clone, Debug, Default)]
pub struct Catalogues {
    /// Of `[netsim]`.
    pub radio: physics::catalogue::Catalogue,
    /// Of `[robotsim]`.
    pub robots: robotsim::catalogue::Catalogue,
}

/// Sections that a file may have.
const SECTIONS: [&str; 7] =
    ["experiment", "site", "robotsim", "netsim", "timeline", "output", "sweep"];

impl Compared {
    /// Reads the text of a configuration; `path` is named in refusals.
    ///
    /// # Errors
    ///
    /// Every problem it has, with its place.
    pub fn of_text(path: &Path, text: String, set: &[String]) -> Result<Self, Refusal> {
        let mut tree = proto::config::parse(&text)
            .map_err(|problems| Refusal::new(path, &text, &Node::empty_table(), problems))?;
        let mut problems = Vec::new();
        for assignment in set {
            if let Err(problem) = proto::config::set(&mut tree, assignment) {
                problems.push(problem);
            }
        }
        if let Value::Table(entries) = &tree.value {
            for (key, ..) in entries {
                if !SECTIONS.contains(&key.as_str()) {
                    let mut problem = Problem::new(
                        key,
                        format!("is not a known section; the sections are {}", SECTIONS.join(", ")),
                    );
                    problem.nearest = proto::config::most_similar(key, SECTIONS).map(str::to_owned);
                    problems.push(problem);
                }
            }
        }
        let empty = Node::empty_table();
        let (site, _) = site::read(tree.get("site").unwrap_or(&empty), "site", &mut problems);
        if !problems.is_empty() {
            return Err(Refusal::new(path, &text, &tree, problems));
        }
        let catalogues = Catalogues::default();
        let (path, set, files) = (path.to_owned(), set.to_vec(), BTreeMap::new());
        Ok(Self { path, text, set, tree, site, catalogues, files })
    }

    /// Another text under the same path, keys, files and catalogues, such as this one with an effect added.
    ///
    /// # Errors
    ///
    /// Every problem it has, with its place.
    pub fn with_text(&self, text: String) -> Result<Self, Refusal> {
        let other = Self::of_text(&self.path, text, &self.set)?;
        Ok(other.with_catalogues(self.catalogues.clone()).with_files(self.files.clone()))
    }

    /// The same with the contents of the files that `[netsim.phy]` names.
    #[must_use]
    pub fn with_files(self, files: BTreeMap<String, Bytes>) -> Self {
        Self { files, ..self }
    }

    /// The same where other things can be chosen by name, such as effects of a user's own.
    #[must_use]
    pub fn with_catalogues(self, catalogues: Catalogues) -> Self {
        Self { catalogues, ..self }
    }

    /// The same with one more key set.
    ///
    /// # Errors
    ///
    /// There can be no such key.
    pub fn with_key(&self, assignment: &str) -> Result<Self, Refusal> {
        let mut other = self.clone();
        proto::config::set(&mut other.tree, assignment)
            .map_err(|problem| self.refuse(vec![problem]))?;
        other.set.push(assignment.to_owned());
        Ok(other)
    }

    /// A section of a section: `("netsim", "phy")`. Empty where it is not there.
    #[must_use]
    pub fn section(&self, side: &str, name: &str) -> Node {
        let section = self.tree.get(side).and_then(|side| side.get(name));
        section.cloned().unwrap_or_else(Node::empty_table)
    }

    /// The radio as configured, and its effective table.
    ///
    /// * `n_motes`: one more than the highest number of a mote.
    ///
    /// # Errors
    ///
    /// Every problem that `[netsim.phy]` has, with its place.
    pub fn radio(&self, n_motes: usize) -> Result<(Model, toml::Table), Refusal> {
        let phy = self.section("netsim", "phy");
        let catalogue = &self.catalogues.radio;
        physics::section::read(&phy, "netsim.phy", n_motes, &self.files, catalogue)
            .map_err(|problems| self.refuse(problems))
    }

    /// Problems of this file, placed on its lines.
    #[must_use]
    pub fn refuse(&self, problems: Vec<Problem>) -> Refusal {
        Refusal::new(&self.path, &self.text, &self.tree, problems)
    }
}
