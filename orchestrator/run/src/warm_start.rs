//! Starting from a formed network: the file is read and compared with the experiment, and both simulators are put there.

use super::RunError;
use super::start::{SideIdentity, side};
use drive::peer::{Described, NetworkSide, Peer as _, Remote, RobotSide, Side as _, SideError};
use drive::{ConfigureRequests, Past, Wanted};
use experiment::{Plan, SideConfig};
use proto::config::{Problem, Refusal, join};
use proto::exchange::{ConfigureRequest, Configured};
use proto::types::{Coupling, seconds};
use record::formed::{FormedError, FormedNetwork, SimulatorVersion};
use record::{RecordError, StepRecord};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Files of formed networks that have been read, so that each of many trials need not read its own.
#[derive(Clone, Debug, Default)]
pub struct FormedFiles {
    read: Arc<Mutex<BTreeMap<PathBuf, Arc<FormedFile>>>>,
}

/// A file of a formed network.
#[derive(Debug)]
pub struct FormedFile {
    formed: FormedNetwork,
    /// In lower-case hexadecimal.
    sha256: String,
}

impl FormedFiles {
    /// The network that a plan starts from, if it starts from one; its checksum becomes part of the plan.
    ///
    /// # Errors
    ///
    /// A file that cannot be used, or everything in which the plan differs from the experiment that formed the network.
    pub fn open(&self, plan: &mut Plan) -> Result<Option<Arc<FormedFile>>, Refusal> {
        let Some(warm_start) = plan.warm_start.clone() else { return Ok(None) };
        let refused = |problems| Refusal::new(&plan.path, &plan.text, &plan.tree, problems);
        let path = &warm_start.path;
        let file = self.read(path).map_err(|error| {
            let message = format!("names a file that {error}");
            let problem = Problem::new("experiment.warm_start", message);
            refused(vec![problem.value(format!("{:?}", path.display().to_string()))])
        })?;
        let mut problems = Vec::new();
        if let Some(expected) = warm_start.sha256.filter(|expected| *expected != file.sha256) {
            let message = format!(
                "is not the checksum of {}, which is \"{}\": the file is another one than the run started from",
                path.display(),
                file.sha256
            );
            let problem = Problem::new("experiment.warm_start_sha256", message);
            problems.push(problem.value(format!("{expected:?}")));
        }
        differences(plan, path, &file.formed.configured, &mut problems);
        if !problems.is_empty() {
            return Err(refused(problems));
        }
        let section = plan.effective.get_mut("experiment").and_then(toml::Value::as_table_mut);
        if let Some(section) = section {
            section.insert("warm_start_sha256".to_owned(), file.sha256.clone().into());
        }
        Ok(Some(file))
    }

    /// The file, read when it is first asked for. Others wait meanwhile, since they mostly want the same one.
    fn read(&self, path: &Path) -> Result<Arc<FormedFile>, FormedError> {
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(file) = read.get(path) {
            return Ok(Arc::clone(file));
        }
        let (formed, sha256) = FormedNetwork::read(path)?;
        let file = Arc::new(FormedFile { formed, sha256 });
        read.insert(path.to_owned(), Arc::clone(&file));
        Ok(file)
    }
}

/// Everything in which the experiment differs from the one that formed the network, as far as the network depends on it.
fn differences(plan: &Plan, path: &Path, formed: &Configured, problems: &mut Vec<Problem>) {
    let file = path.display();
    let Configured { robots_request, robots_start, network_request, network_start } = formed;
    let (ours, theirs) = (&plan.experiment, &network_request.experiment);
    let mut differs = |key: &str, ours: String, theirs: String| {
        if ours != theirs {
            let message = format!("must be {theirs}, with which the network in {file} formed");
            problems.push(Problem::new(key, message).value(ours));
        }
    };
    let agents = |n: usize| n.to_string();
    differs("experiment.agents", agents(ours.agent_count), agents(theirs.agent_count));
    let coupling = |coupling| match coupling {
        Coupling::Sequential => "sequential",
        Coupling::Parallel => "parallel",
        Coupling::Event => "per packet (experiment.control_period = \"packet\")",
    };
    differs(
        "experiment.coupling",
        coupling(ours.coupling).to_owned(),
        coupling(theirs.coupling).to_owned(),
    );
    let period = |step_ns| format!("{} s", seconds(step_ns));
    differs("experiment.control_period", period(ours.step_ns), period(theirs.step_ns));
    let mut compare = Comparison { file: file.to_string(), problems };
    compare.tables("site", &plan.site_toml, &network_request.site_toml);
    compare.side("robotsim", &plan.robotsim, robots_request, &robots_start.effective_toml);
    compare.side("netsim", &plan.netsim, network_request, &network_start.effective_toml);
}

/// A section that travels as text.
fn parsed(text: &str) -> toml::Table {
    text.parse().unwrap_or_default()
}

/// A comparison with the configuration under which a network formed.
struct Comparison<'a> {
    file: String,
    problems: &'a mut Vec<Problem>,
}

impl Comparison<'_> {
    /// Compares a side's section: as it was written, or with its defaults filled in.
    fn side(&mut self, path: &str, ours: &SideConfig, theirs: &ConfigureRequest, effective: &str) {
        let effective = if effective.is_empty() { &theirs.config_toml } else { effective };
        let filled_in = ours.effective_toml.as_ref().unwrap_or(&ours.toml);
        let is_same = [filled_in, &ours.toml].into_iter().any(|ours| {
            [effective, &theirs.config_toml]
                .into_iter()
                .any(|theirs| parsed(ours) == parsed(theirs))
        });
        if !is_same {
            self.tables(path, filled_in, effective);
        }
        let names: BTreeSet<&String> = ours.files.keys().chain(theirs.files.keys()).collect();
        for name in names {
            // A name that one of them lacks differs in the table.
            if let (Some(ours), Some(theirs)) = (ours.files.get(name), theirs.files.get(name))
                && ours != theirs
            {
                let message = format!(
                    "names {name:?}, whose content differs from that with which the network in {} formed",
                    self.file
                );
                self.problems.push(Problem::new(path, message));
            }
        }
    }

    fn tables(&mut self, path: &str, ours: &str, theirs: &str) {
        self.values(
            path,
            Some(&toml::Value::Table(parsed(ours))),
            Some(&toml::Value::Table(parsed(theirs))),
        );
    }

    fn values(&mut self, path: &str, ours: Option<&toml::Value>, theirs: Option<&toml::Value>) {
        use toml::Value::{Array, Table};
        match (ours, theirs) {
            (ours, theirs) if ours == theirs => {}
            (Some(Table(ours)), Some(Table(theirs))) => {
                // Where another kind is chosen, all of its keys are others.
                let chosen = |key: &&str| matches!((ours.get(*key), theirs.get(*key)), (Some(a), Some(b)) if a != b);
                if let Some(key) = ["kind", "mode"].into_iter().find(chosen) {
                    self.values(&join(path, key), ours.get(key), theirs.get(key));
                    return;
                }
                let keys: BTreeSet<&String> = ours.keys().chain(theirs.keys()).collect();
                for key in keys {
                    self.values(&join(path, key), ours.get(key), theirs.get(key));
                }
            }
            (Some(Array(ours)), Some(Array(theirs)))
                if ours.len() == theirs.len()
                    && ours.iter().chain(theirs).all(|v| v.is_table()) =>
            {
                for (index, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
                    self.values(&format!("{path}[{index}]"), Some(ours), Some(theirs));
                }
            }
            (ours, theirs) => {
                let message = match theirs {
                    Some(theirs) => {
                        format!("must be {theirs}, with which the network in {} formed", self.file)
                    }
                    None => format!("must not be set: the network in {} formed without", self.file),
                };
                let problem = Problem::new(path, message);
                self.problems.push(match ours {
                    Some(ours) => problem.value(ours),
                    None => problem,
                });
            }
        }
    }
}

/// Both sides where the network has formed, and what was recorded until then.
pub(super) struct Placed {
    pub(super) exchange: Configured,
    pub(super) steps: Vec<StepRecord>,
    pub(super) past: Past,
}

impl FormedFile {
    /// Puts both sides where the network has formed. Later draws come from the plan's seed.
    pub(super) async fn place(
        &self,
        plan: &Plan,
        robots: &mut Remote<RobotSide>,
        network: &mut Remote<NetworkSide>,
        wanted: Wanted,
    ) -> Result<Placed, RunError> {
        let formed = &self.formed;
        can_restore(RobotSide::SIDE, robots.described(), &formed.robots).map_err(side)?;
        can_restore(NetworkSide::SIDE, network.described(), &formed.network).map_err(side)?;
        let asked =
            ConfigureRequests::from_plan(plan, robots.described(), network.described(), wanted);
        self.keeps(plan, &asked.network, network.described())?;
        let exchange = formed.configured.clone();
        let Configured { robots_request, robots_start, network_request, network_start } = &exchange;
        let at = formed.steps.last().map_or((0, 0), |last| (last.step, last.time_ns));
        let seed = Some(plan.experiment.seed);
        robots
            .restore(formed.robots_state.clone(), seed, robots_request, robots_start, at)
            .await
            .map_err(side)?;
        network
            .restore(formed.network_state.clone(), seed, network_request, network_start, at)
            .await
            .map_err(side)?;
        let past = Past { started: None, has_just_formed: !formed.steps.is_empty() };
        Ok(Placed { exchange, steps: formed.steps.clone(), past })
    }

    /// Refuses what `[output]` asks and the network did not keep while it formed.
    fn keeps(
        &self,
        plan: &Plan,
        asked: &ConfigureRequest,
        described: &Described,
    ) -> Result<(), RunError> {
        let kept = &self.formed.configured.network_request;
        let mut missing: Vec<String> = Vec::new();
        for record in asked.records.iter().filter(|record| described.records.contains(record)) {
            if !kept.records.contains(record) {
                missing.push(format!("{record:?}"));
            }
        }
        for column in asked.columns.iter().filter(|column| described.columns.contains(column)) {
            if !kept.columns.contains(column) {
                missing.push(format!("{column:?}"));
            }
        }
        if missing.is_empty() {
            return Ok(());
        }
        let message = format!(
            "asks for what the formed network does not keep: {}; save it again from an experiment with this [output]",
            missing.join(", ")
        );
        let problems = vec![Problem::new("output", message)];
        Err(RunError::Refused(Refusal::new(&plan.path, &plan.text, &plan.tree, problems)))
    }
}

/// Whether a side can be put where the network has formed, with another seed.
fn can_restore(
    side: &'static str,
    described: &Described,
    saved: &SimulatorVersion,
) -> Result<(), SideError> {
    let Described { name, version, .. } = described;
    let what = if !described.snapshots || !described.reseed {
        format!(
            "{name} does not support restoring a snapshot with another seed (reseed), which experiment.warm_start requires"
        )
    } else if (name, version) != (&saved.name, &saved.version) {
        format!(
            "{name} {version} cannot restore the formed network of experiment.warm_start, which {} {} made",
            saved.name, saved.version
        )
    } else {
        return Ok(());
    };
    Err(SideError::Cannot { side, what })
}

/// Saves the network where it has formed, with all steps until there.
pub(super) struct FormedSaver {
    path: PathBuf,
    sides: [SimulatorVersion; 2],
    configured: Configured,
    steps: Vec<StepRecord>,
    is_saved: bool,
}

impl FormedSaver {
    pub(super) fn new(
        path: PathBuf,
        robots: &SideIdentity,
        network: &SideIdentity,
        configured: Configured,
    ) -> Self {
        let sides = [robots, network].map(|side| SimulatorVersion {
            name: side.name.clone(),
            version: side.version.clone(),
        });
        Self { path, sides, configured, steps: Vec::new(), is_saved: false }
    }

    /// Takes a step, which may be one that an attempt before this one had taken.
    pub(super) fn step(&mut self, record: &StepRecord) {
        if !self.is_saved {
            self.steps.truncate(record.step as usize - 1);
            self.steps.push(record.clone());
        }
    }

    /// Whether the network has formed and is saved.
    pub(super) fn is_saved(&self) -> bool {
        self.is_saved
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file.
    pub(super) fn save(
        &mut self,
        robots_state: bytes::Bytes,
        network_state: bytes::Bytes,
    ) -> Result<(), RecordError> {
        let [robots, network] = self.sides.clone();
        let formed = FormedNetwork {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            robots,
            network,
            configured: self.configured.clone(),
            steps: std::mem::take(&mut self.steps),
            robots_state,
            network_state,
        };
        let sha256 = formed
            .write(&self.path)
            .map_err(|source| RecordError::Write { path: self.path.clone(), source })?;
        tracing::info!("the formed network is in {}, SHA-256 {sha256}", self.path.display());
        self.is_saved = true;
        Ok(())
    }
}
