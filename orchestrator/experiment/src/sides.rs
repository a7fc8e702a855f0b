//! The sections of the two simulators: read here, judged by the simulator itself if it is ours to start.

use super::Overrides;
use super::consent::{self, Action};
use super::reach::{self, SideCommand};
use bytes::Bytes;
use proto::bounds::NAMED_FILE_BYTES;
use proto::config::{self, FileReference, Node, Problem, Value};
use proto::side::Setup;
use proto::site::Site;
use proto::types::Experiment;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// One side's section.
#[derive(Clone, Debug)]
pub struct SideConfig {
    /// Where it runs already; `None`: it is started here.
    pub url: Option<String>,
    /// What starts it here; `None`: it is the one that comes with this program, or runs already.
    pub command: Option<SideCommand>,
    /// Its section without the orchestrator's keys, as written, as TOML text.
    pub toml: String,
    /// The same with defaults filled in, if it is a valid section of the simulator that comes with this program: what
    /// that simulator is sent, so that a record's own configuration gives the same record.
    pub effective_toml: Option<String>,
    /// The files that the section names, by the path written there.
    pub files: BTreeMap<String, Bytes>,
    /// Where those files are: path of the key, absolute path of the file.
    pub places: Vec<(String, String)>,
    /// The orchestrator's own keys of the section, as they are recorded.
    pub written_reach: toml::Table,
}

impl SideConfig {
    /// Whether it is another simulator than the one that comes with this program: it checks its own configuration.
    #[must_use]
    pub fn is_foreign(&self) -> bool {
        self.url.is_some() || self.command.is_some()
    }
}

/// Reads both sections, collecting problems.
pub(super) struct Sides<'a> {
    pub(super) base: &'a Path,
    pub(super) site: &'a Site,
    pub(super) experiment: &'a Experiment,
    /// The number of agents is known: without it, nothing that counts agents can be judged.
    pub(super) known: bool,
    /// Files in place of those on the disk, by section and name.
    pub(super) files: &'a BTreeMap<(String, String), Bytes>,
    /// Keys with files that may not be read.
    pub(super) unread: Vec<&'a str>,
    pub(super) problems: &'a mut Vec<Problem>,
}

impl Sides<'_> {
    /// Reads one side's section, and checks it if the side is ours to start: with `check`, or, as long as the number of agents
    /// is not known, its keys alone with `keys`.
    pub(super) fn read(
        &mut self,
        node: &Node,
        path: &str,
        url_override: Option<&String>,
        keys: impl Fn(&Node, &str, &mut Vec<Problem>),
        files: impl Fn(&Node, &str) -> Vec<FileReference>,
        check: impl Fn(&Setup) -> Result<(toml::Table, Vec<String>), Vec<Problem>>,
    ) -> (SideConfig, Vec<String>) {
        let mut own = node.clone();
        let mut refused = BTreeSet::new();
        if !matches!(own.value, Value::Table(_)) {
            self.problems.push(Problem::new(path, "must be a table").value(node.show()));
            own = Node::empty_table();
            refused.insert(path.to_owned());
        }
        let reach = reach::take(&mut own, path, url_override, self.base, self.problems);
        let is_foreign = reach.url.is_some() || reach.command.is_some();
        let mut contents = BTreeMap::new();
        let mut places = Vec::new();
        for reference in files(&own, path) {
            let file = self.base.join(&reference.path);
            let place = std::path::absolute(&file).unwrap_or_else(|_| file.clone());
            // The side is sent a name, not a place: the same wherever the file lies.
            let name = file_name(&place);
            let known = self.files.get(&(path.to_owned(), name.clone()));
            if self.unread.contains(&reference.key.as_str()) {
                // Refused elsewhere, with all that the file asks for.
                refused.insert(reference.key);
                contents.insert(reference.path, Bytes::new());
                continue;
            }
            let content = match known {
                Some(content) => Ok(content.clone()),
                None => read_named(&reference.key, &reference.path, &file),
            };
            match content {
                Ok(content) => {
                    let key = reference
                        .key
                        .strip_prefix(path)
                        .map_or("", |key| key.trim_start_matches('.'));
                    if let Some(node) = own.at_mut(key) {
                        node.value = Value::Text(name.clone());
                    }
                    places.push((reference.key, place.display().to_string()));
                    contents.insert(name, content);
                }
                Err(problem) => {
                    refused.insert(reference.key.clone());
                    self.problems.push(problem);
                    // Stands for the file, so that the rest of the section is still checked.
                    contents.insert(reference.path, Bytes::new());
                }
            }
        }
        let mut warnings = Vec::new();
        let mut effective_toml = None;
        if self.known {
            let setup = Setup {
                experiment: self.experiment.clone(),
                site: self.site.clone(),
                config: own.clone(),
                path: path.to_owned(),
                files: contents.clone(),
                columns: Vec::new(),
                records: Vec::new(),
            };
            match check(&setup) {
                Ok((effective, found)) => {
                    effective_toml = Some(effective.to_string());
                    if !is_foreign {
                        warnings = found;
                    }
                }
                // A simulator elsewhere judges for itself.
                Err(_) if is_foreign => {}
                Err(found) => {
                    // A file that is missing was reported above; what its stand-in lacks is no news.
                    self.problems.extend(found.into_iter().filter(|p| !refused.contains(&p.path)));
                }
            }
        } else if !is_foreign {
            keys(&own, path, self.problems);
        }
        let toml = own.to_toml().as_table().map(toml::Table::to_string).unwrap_or_default();
        let side = SideConfig {
            url: reach.url,
            command: reach.command,
            toml,
            effective_toml,
            files: contents,
            places,
            written_reach: reach.written,
        };
        (side, warnings)
    }
}

/// Robots that send messages to single ones of them need a network that carries those, up and down. Of a simulator elsewhere
/// nothing is known.
pub(super) fn check_messages(
    robotsim: &SideConfig,
    netsim: &SideConfig,
    problems: &mut Vec<Problem>,
) {
    let effective = |side: &SideConfig| {
        let text = side.effective_toml.as_ref().filter(|_| !side.is_foreign())?;
        toml::from_str::<toml::Table>(text).ok()
    };
    let (Some(robots), Some(network)) = (effective(robotsim), effective(netsim)) else { return };
    let catalogue = robotsim::catalogue::Catalogue::built_in();
    let Some(controller) = robotsim::config::messaging_controller(&robots, catalogue) else {
        return;
    };
    let mode = network.get("mode").and_then(toml::Value::as_str).unwrap_or_default();
    if mode != "6tisch" {
        let message = format!(
            "requires a network that routes messages, which netsim.mode = {mode:?} does not, or knowledge = \"truth\""
        );
        problems.push(
            Problem::new("robotsim.controller.kind", message)
                .value(format!("{controller:?}"))
                .nearest("netsim.mode = \"6tisch\""),
        );
    } else if network.get("rpl").and_then(|rpl| rpl.get("routes_down")?.as_bool()) == Some(false) {
        let message = format!(
            "must be true with the controller {controller:?}, which sends messages down to single robots"
        );
        problems.push(Problem::new("netsim.rpl.routes_down", message).value(false).nearest(true));
    }
}

/// The content of a file that a key names, by the path written there.
fn read_named(key: &str, written: &str, file: &Path) -> Result<Bytes, Problem> {
    let content = std::fs::File::open(file).and_then(|file| NAMED_FILE_BYTES.read(file));
    content.map(Bytes::from).map_err(|error| {
        let reason = if error.kind() == std::io::ErrorKind::NotFound {
            missing_file(file)
        } else {
            format!("cannot be read: {error}")
        };
        Problem::new(key, format!("names a file that {reason}")).value(format!("{written:?}"))
    })
}

/// The contents of the files that the keys of a table name, such as those of `netsim.phy`, by the path written there. Files outside of
/// the folder `base` of the configuration need consent.
///
/// # Errors
///
/// Every file that may not be read, does not exist or cannot be read.
pub fn named_files(
    base: &Path,
    tree: &Node,
    table: &str,
    overrides: &Overrides,
) -> Result<BTreeMap<String, Bytes>, Vec<Problem>> {
    let is_within = |key: &str| key.strip_prefix(table).is_some_and(|rest| rest.starts_with('.'));
    let mut asked = consent::capabilities(tree, base, overrides);
    asked.retain(|asked| is_within(&asked.key) && matches!(asked.action, Action::ReadFile { .. }));
    let mut problems = overrides.consent.refusals(&asked);
    let unread = overrides.consent.unread(&asked);
    let mut contents = BTreeMap::new();
    for (key, written) in consent::named_files(tree) {
        if !is_within(&key) || unread.contains(&key.as_str()) {
            continue;
        }
        match read_named(&key, &written, &base.join(&written)) {
            Ok(content) => _ = contents.insert(written, content),
            Err(problem) => problems.push(problem),
        }
    }
    if problems.is_empty() { Ok(contents) } else { Err(problems) }
}

/// The last part of a path.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name()
        .map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// What to say of a file that does not exist, with the most similar name in its folder.
#[must_use]
pub fn missing_file(path: &Path) -> String {
    let sibling = path.file_name().and_then(|wanted| {
        let folder =
            path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .ok()?
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
        names.sort();
        let nearest = most_similar_file(wanted.to_str()?, &names)?.to_owned();
        Some(path.with_file_name(nearest))
    });
    match sibling {
        Some(sibling) => format!("does not exist (nearest: {})", sibling.display()),
        None => "does not exist".to_owned(),
    }
}

/// The name that is most similar to that of a file, if their parts before the ending are similar enough. An equal ending alone
/// makes no similar name.
fn most_similar_file<'a>(wanted: &str, names: &'a [String]) -> Option<&'a str> {
    let stem = |name: &str| match name.rsplit_once('.') {
        Some((stem, _)) if !stem.is_empty() => stem.to_owned(),
        _ => name.to_owned(),
    };
    let wanted_stem = stem(wanted);
    let is_similar = |name: &&str| config::most_similar(&wanted_stem, [&*stem(name)]).is_some();
    config::most_similar(wanted, names.iter().map(String::as_str).filter(is_similar))
}

#[cfg(test)]
mod tests {
    use super::most_similar_file;

    #[test]
    fn a_file_is_near_by_its_name_and_not_by_its_ending_alone() {
        let names = ["flocking.toml", "push.csv", "push.toml", "sensors-rrsf.toml"];
        let names = names.map(str::to_owned);
        for (wanted, nearest) in [
            ("floking.toml", Some("flocking.toml")),
            ("push.cvs", Some("push.csv")),
            ("push.tml", Some("push.toml")),
            ("nothere.toml", None),
        ] {
            assert_eq!(most_similar_file(wanted, &names), nearest, "{wanted}");
        }
    }
}
