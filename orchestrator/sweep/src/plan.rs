//! A sweep that has been read and checked: its settings, its trials, and what identifies each.

use super::design::{self, Setting};
use super::metric_names;
use experiment::sweep::{self as spec, Keep, MOST_TRIALS, Sampling, Seeds, Sweep};
use experiment::{Action, Capability, Overrides, Plan};
use indexmap::IndexSet;
use metrics::Task;
use metrics::headline::Headline;
use proto::config::Refusal;
use proto::config::{IdleKey, Node, Problem, Value};
use proto::digest::hex;
use rayon::prelude::*;
use record::fingerprint;
use run::{self, FormedFiles};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// A valid sweep.
#[derive(Clone, Debug)]
pub(crate) struct SweepPlan {
    /// The file it came from.
    pub(crate) path: PathBuf,
    /// Its text.
    pub(crate) text: String,
    /// The experiment without what varies.
    base: Node,
    overrides: Overrides,
    /// Name of the experiment.
    pub(crate) name: String,
    /// The whole file with what the command line puts over it, as TOML text.
    pub(crate) written: String,
    /// What varies.
    pub(crate) sweep: Sweep,
    /// Every setting.
    pub(crate) settings: Vec<Setting>,
    /// Every seed.
    pub(crate) seeds: Vec<u64>,
    /// What identifies each setting: the digest of all that its trials depend on, but for the seed.
    identities: Vec<String>,
    /// How long a trial of each setting may take, relative to the others.
    efforts: Vec<f64>,
    /// A side runs elsewhere: its URL.
    pub(crate) elsewhere: Option<String>,
    /// What the file asks for outside of its own folder.
    pub(crate) capabilities: Vec<Capability>,
    /// What should be checked before the results are trusted.
    pub(crate) warnings: Vec<String>,
    /// No trial has a network with protocols, so none has figures of `kpis`.
    pub(crate) is_without_protocols: bool,
    /// Formed networks that trials start from.
    pub(crate) formed: FormedFiles,
}

/// A trial: a setting with a seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct SweepTrial {
    /// Number of the setting.
    pub(crate) setting: usize,
    /// Number of the seed in the list.
    pub(crate) seed: usize,
}

/// Where the trials of a sweep run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Machines {
    /// On this machine.
    This,
    /// On those of a batch system, which obeys what the file says for it.
    Cluster,
}

/// Reads and checks a sweep, every setting included.
///
/// # Errors
///
/// Every problem, with its place.
pub(crate) fn load(
    path: &Path,
    overrides: &Overrides,
    machines: Machines,
) -> Result<SweepPlan, Refusal> {
    let text = experiment::text_of(path)?;
    let (tree, mut problems) = experiment::opened(path, &text, overrides)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut capabilities = experiment::capabilities(&tree, folder, overrides);
    if machines == Machines::This {
        capabilities.retain(|asked| !matches!(asked.action, Action::ClusterLine { .. }));
    }
    problems.extend(overrides.consent.refusals(&capabilities));
    let refused = |problems| Err(Refusal::new(path, &text, &tree, problems));
    let mut base = tree.clone();
    let Some(section) = base.take(spec::KEY) else {
        problems.push(Problem::new(
            "",
            format!(
                "has no section [sweep], so there is nothing to vary; use {} run for a single experiment",
                experiment::program_name()
            ),
        ));
        return refused(problems);
    };
    let sweep = spec::read(&section, &mut problems);
    let seed = match base.get("experiment").and_then(|experiment| experiment.get("seed")) {
        Some(Node { value: Value::Integer(seed), .. }) => seed.unsigned_abs(),
        _ => 0,
    };
    overridden(&sweep, overrides, &mut problems);
    limits(&sweep, &mut problems);
    let of_metrics = metric_names::problems(&sweep, metric_names::robots(&base, &sweep, overrides));
    if !problems.is_empty() {
        problems.extend(of_metrics);
        return refused(problems);
    }
    let seeds = match &sweep.seeds {
        Seeds::Count(n) => (0..*n).map(|i| seed.saturating_add(i)).collect(),
        Seeds::These(seeds) => seeds.clone(),
    };
    let settings = design::settings(&sweep, seed);
    let formed = FormedFiles::default();
    let programs = Programs::default();
    let checked: Vec<Result<CheckedSetting, Refusal>> = settings
        .par_iter()
        .map(|setting| {
            let mut plan = plan_of(path, &text, &base, overrides, setting)?;
            formed.open(&mut plan)?;
            Ok(CheckedSetting {
                identity: identity(&plan, &programs),
                effort: effort(&plan),
                has_protocols: has_protocols(&plan),
                name: plan.name,
                elsewhere: plan.robotsim.url.or(plan.netsim.url),
                warnings: plan.warnings,
                idle: plan.idle,
                tree: plan.tree,
            })
        })
        .collect();
    let (good, wrong): (Vec<_>, Vec<_>) = checked.into_iter().partition(Result::is_ok);
    // Settings are checked in spite of a wrong metric: all problems are listed at once.
    let of_metrics = (!of_metrics.is_empty()).then(|| Refusal::new(path, &text, &tree, of_metrics));
    if let Some(refusal) = merged(wrong.into_iter().filter_map(Result::err).chain(of_metrics)) {
        return Err(refusal);
    }
    let good: Vec<CheckedSetting> = good.into_iter().flatten().collect();
    let warnings: IndexSet<&String> = good
        .iter()
        .flat_map(|checked| &checked.warnings)
        .filter(|warning| !has_influence_elsewhere(warning, &good))
        .collect();
    let mut warnings: Vec<String> = warnings.into_iter().cloned().collect();
    let is_without_protocols = good.iter().all(|checked| !checked.has_protocols);
    if is_without_protocols {
        warnings.extend(metric_names::of_protocols(&sweep));
    }
    Ok(SweepPlan {
        path: path.to_owned(),
        base,
        overrides: overrides.clone(),
        name: good.first().map(|checked| checked.name.clone()).unwrap_or_default(),
        written: tree.to_toml().as_table().map(toml::Table::to_string).unwrap_or_default(),
        sweep,
        settings,
        seeds,
        elsewhere: good.iter().find_map(|checked| checked.elsewhere.clone()),
        identities: good.iter().map(|checked| checked.identity.clone()).collect(),
        efforts: good.iter().map(|checked| checked.effort).collect(),
        capabilities,
        warnings,
        is_without_protocols,
        formed,
        text,
    })
}

fn merged(refusals: impl Iterator<Item = Refusal>) -> Option<Refusal> {
    refusals.reduce(|mut all, refusal| {
        all.merge(refusal);
        all
    })
}

struct CheckedSetting {
    identity: String,
    effort: f64,
    has_protocols: bool,
    name: String,
    elsewhere: Option<String>,
    warnings: Vec<String>,
    idle: Vec<IdleKey>,
    tree: Node,
}

/// Whether a warning is about a key that has no influence in some settings, but has some in others.
fn has_influence_elsewhere(warning: &str, settings: &[CheckedSetting]) -> bool {
    let mut idle = settings.iter().flat_map(|setting| &setting.idle);
    let Some(IdleKey { key, .. }) = idle.find(|idle| idle.warning == warning) else { return false };
    let is_idle = |setting: &CheckedSetting| setting.idle.iter().any(|idle| idle.key == *key);
    settings.iter().any(|setting| setting.tree.at(key).is_some() && !is_idle(setting))
}

/// Keys that the command line sets although the sweep varies them: every trial would replace that value.
fn overridden(sweep: &Sweep, overrides: &Overrides, problems: &mut Vec<Problem>) {
    let lists = sweep.lists.iter().map(|(key, _)| key);
    let varied: Vec<&String> = lists.chain(sweep.ranges.iter().map(|(key, _)| key)).collect();
    for assignment in &overrides.set {
        let key = assignment.split('=').next().unwrap_or_default().trim();
        let is_within = |varied: &str| {
            key.strip_prefix(varied).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        if varied.iter().any(|varied| is_within(varied)) {
            let message = "is varied by [sweep.vary], so --set cannot set it";
            problems.push(Problem::new(key, format!("{message} (in --set {assignment})")));
        }
    }
}

fn limits(sweep: &Sweep, problems: &mut Vec<Problem>) {
    let n_seeds = match &sweep.seeds {
        Seeds::Count(n) => *n,
        Seeds::These(seeds) => seeds.len() as u64,
    };
    let n_trials = design::n_settings(sweep).and_then(|n| n.checked_mul(n_seeds));
    if n_trials.is_none_or(|n| MOST_TRIALS.unsigned_abs() < n) {
        let n = n_trials.map_or_else(|| "more than 2^64".to_owned(), |n| n.to_string());
        let message = format!("defines too many trials; at most {MOST_TRIALS} are allowed");
        problems.push(Problem::new(spec::KEY, message).value(n));
    }
    let (most_samples, most_ranges) = design::SOBOL;
    if sweep.sampling == Sampling::Sobol {
        if most_samples < sweep.samples {
            let message = format!("must be at most {most_samples} with sampling = \"sobol\"");
            let problem = Problem::new("sweep.samples", message).value(sweep.samples);
            problems.push(problem.nearest(most_samples));
        }
        if most_ranges < sweep.ranges.len() {
            let message = format!(
                "has too many ranges for sampling = \"sobol\", which allows at most {most_ranges}; use \
                         \"latin-hypercube\""
            );
            problems.push(Problem::new("sweep.vary", message).value(sweep.ranges.len()));
        }
    }
}

/// The experiment of a setting, with the seed of the file.
fn plan_of(
    path: &Path,
    text: &str,
    base: &Node,
    overrides: &Overrides,
    setting: &Setting,
) -> Result<Plan, Refusal> {
    let mut tree = base.clone();
    let mut problems = Vec::new();
    for (key, value) in &setting.values {
        match tree.set(key, value.value.clone()) {
            // What is wrong with it is shown where the sweep says it.
            Ok(()) => {
                if let Some(node) = tree.at_mut(key) {
                    node.span.clone_from(&value.span);
                }
            }
            Err(problem) => problems.push(Problem {
                span: value.span.clone(),
                message: format!("{} (to set {key})", problem.message),
                ..problem
            }),
        }
    }
    experiment::of_tree(path, text, &tree, overrides, problems)
}

/// What is in the programs and scripts that settings start, each read once.
#[derive(Default)]
struct Programs(Mutex<BTreeMap<PathBuf, String>>);

impl Programs {
    /// The SHA-256 of a file; empty if it cannot be read. Starting it then says what is wrong with it.
    fn content_of(&self, file: PathBuf) -> String {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let content = known.entry(file).or_insert_with_key(|file| {
            fingerprint(file).map_or_else(|_| String::new(), |found| found.sha256)
        });
        content.clone()
    }
}

/// The digest of all that a trial depends on, but for its seed.
fn identity(plan: &Plan, programs: &Programs) -> String {
    let mut experiment = plan.effective.clone();
    experiment.remove("output");
    if let Some(table) = experiment.get_mut("experiment").and_then(toml::Value::as_table_mut) {
        // Results do not depend on these.
        let others = ["name", "seed", "accept_commands"];
        for key in others.iter().chain(&experiment::WITHOUT_EFFECT) {
            table.remove(*key);
        }
    }
    let mut hash = Sha256::new();
    hash.update(experiment.to_string());
    // Without links nobody asks when each frame was received.
    hash.update([u8::from(plan.output.columns().is_empty())]);
    for side in [&plan.robotsim, &plan.netsim] {
        hash.update(b"\0side\0");
        hash.update(side.effective_toml.as_ref().unwrap_or(&side.toml));
        hash.update(side.url.as_deref().unwrap_or_default());
        if let Some(command) = &side.command {
            for word in &command.words {
                hash.update(b"\0word\0");
                hash.update(word);
            }
            for file in command.files() {
                hash.update(programs.content_of(file));
            }
        }
        for (path, content) in &side.files {
            hash.update(path);
            hash.update(Sha256::digest(content));
        }
    }
    hex(&hash.finalize())[..32].to_owned()
}

/// Whether the network has protocols, as far as its configuration is known.
fn has_protocols(plan: &Plan) -> bool {
    let known = plan.netsim.effective_toml.as_ref().filter(|_| !plan.netsim.is_foreign());
    let config = known.and_then(|text| text.parse::<toml::Table>().ok());
    let mode = config.as_ref().and_then(|config| config.get("mode")?.as_str());
    mode != Some("propagation-only")
}

/// Roughly: steps times pairs of agents.
fn effort(plan: &Plan) -> f64 {
    let n = plan.experiment.agent_count as f64;
    plan.duration_ns as f64 / plan.experiment.step_ns as f64 * (n * n + 50.0)
}

impl SweepPlan {
    /// All trials, in the order of the table.
    pub(crate) fn trials(&self) -> impl Iterator<Item = SweepTrial> + '_ {
        (0..self.settings.len())
            .flat_map(|setting| (0..self.seeds.len()).map(move |seed| SweepTrial { setting, seed }))
    }

    /// Number of trials.
    pub(crate) fn n_trials(&self) -> usize {
        self.settings.len() * self.seeds.len()
    }

    /// What identifies a trial: two of the same are the same experiment.
    pub(crate) fn key(&self, trial: SweepTrial) -> String {
        format!("{}-{}", self.identities[trial.setting], self.seeds[trial.seed])
    }

    /// How long it may take, relative to others.
    pub(crate) fn effort(&self, trial: SweepTrial) -> f64 {
        self.efforts[trial.setting]
    }

    /// Whether everything is kept that it leaves.
    pub(crate) fn keeps(&self, trial: SweepTrial) -> bool {
        match self.sweep.keep {
            Keep::None => false,
            Keep::FirstSeed => trial.seed == 0,
            Keep::All => true,
        }
    }

    /// Its name, and that of the folder of what is kept.
    pub(crate) fn trial_name(&self, trial: SweepTrial) -> String {
        format!("setting-{}-seed-{}", trial.setting, self.seeds[trial.seed])
    }

    /// The experiment of a trial.
    ///
    /// # Errors
    ///
    /// None that was not found when the sweep was read, unless a file that it names has changed.
    pub(crate) fn plan(&self, trial: SweepTrial) -> Result<Plan, Refusal> {
        let mut base = self.base.clone();
        let seed = self.seeds[trial.seed];
        // The path exists: the experiment has a name.
        let _ = base.set("experiment.name", Value::Text(self.trial_name(trial)));
        let _ = base.set("experiment.seed", Value::Integer(seed.cast_signed()));
        let setting = &self.settings[trial.setting];
        let mut plan = plan_of(&self.path, &self.text, &base, &self.overrides, setting)?;
        if !self.keeps(trial) {
            plan.output.pcap = false;
            // The motes' figures at the end are those of the whole run.
            plan.output.motes = false;
        }
        Ok(plan)
    }

    /// Paths of the figures that runs of this sweep lead with, and of those beside them: first figures of all settings first.
    /// Settings whose file cannot be read here add none.
    pub(crate) fn leading_figures(&self) -> Vec<&'static str> {
        let mut headlines: Vec<&'static Headline> = Vec::new();
        for setting in 0..self.settings.len() {
            let Ok(plan) = self.plan(SweepTrial { setting, seed: 0 }) else { continue };
            let headline = Task::from_config(&plan.robotsim.toml).headline();
            let is_new = |headline: &&'static Headline| {
                !headlines.iter().any(|known| known.goals == headline.goals)
            };
            headlines.extend(headline.filter(is_new));
        }
        let first = headlines.iter().flat_map(|headline| headline.first);
        let beside = headlines.iter().flat_map(|headline| headline.beside);
        let paths: IndexSet<&str> = first.chain(beside).map(|shown| shown.path).collect();
        paths.into_iter().collect()
    }

    /// Keys that vary, in the order of the table.
    pub(crate) fn keys(&self) -> IndexSet<&str> {
        let values = self.settings.iter().flat_map(|setting| &setting.values);
        values.map(|(key, _)| key.as_str()).collect()
    }
}
