//! Turns replies into files, step by step, in the order they come. For `run.mcap` they become messages again, here and nowhere
//! else.

use super::checkpoint::{Checkpoint, Reserve};
use super::log::{MessageLog, configuration_messages, step_messages};
use super::pcap::{self, Capture, CapturePart};
use super::periods::Periods;
use super::run_summary::OrdersFromOutside;
use super::scene::foxglove::log::Level;
use super::scene::{self, SceneLog};
use super::tables::Tables;
use super::{RecordError, RunHeader, StepRecord};
use bytes::Bytes;
use input::fingerprint::Fingerprint;
use metrics::kpi::{Applications, Kpis};
use metrics::measures::{KILL, Measures};
use metrics::task::Task;
use proto::config;
use proto::digest::Digest;
use proto::exchange::Configured;
use proto::site;
use proto::types::{Coupling, MoteOrder, MoteStates, NetRecord};
use proto_messages::v1;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What comes to be recorded.
pub(crate) enum Event {
    /// Both sides are configured.
    Configured(Box<Configured>),
    /// Both sides have answered these steps and agree on their digests.
    Steps(Vec<StepRecord>),
    /// The radio's traffic of steps that were recorded before, and come without it.
    Capture(CapturePart),
    /// Both sides' states after the latest step.
    Checkpoint(Box<States>),
}

/// Both sides' states after the latest step, and where sides run that were not started here.
#[derive(Clone, Debug, Default)]
pub struct States {
    /// The robots' state; `None`: they keep no snapshots.
    pub robots: Option<Bytes>,
    /// The network's state; `None`: it keeps no snapshots.
    pub network: Option<Bytes>,
    /// URLs: robots, network.
    pub urls: [Option<String>; 2],
}

/// The files being written, and the measures of the run so far.
pub(crate) struct RunWriter {
    n_agents: usize,
    coupling: Coupling,
    dir: PathBuf,
    log: Option<MessageLog>,
    scene: Option<SceneLog>,
    capture: Option<Capture>,
    capture_header_bytes: usize,
    tables: Tables,
    run: Option<Run>,
    reserve: Reserve,
}

/// What a configured run has come to.
struct Run {
    measures: Measures,
    net_warnings: Vec<String>,
    periods: Periods,
    n_steps: u64,
    /// Steps with orders, each with a message of its own.
    n_ordered: u64,
    orders: OrdersFromOutside,
    digest: Option<Digest>,
}

/// What is left when all files are whole.
pub(crate) struct Written {
    /// Measures; `None` of a run that was never configured.
    pub measures: Option<Measures>,
    /// What the network warned of.
    pub net_warnings: Vec<String>,
    /// Orders from other programs that took effect.
    pub orders: OrdersFromOutside,
    /// Digest of the last step.
    pub digest: Option<Digest>,
    /// Files, each with how many rows or messages it holds.
    pub files: Vec<(&'static str, u64, Fingerprint)>,
}

impl RunWriter {
    /// Begins all files.
    pub(crate) fn create(dir: &Path, header: &RunHeader) -> Result<Self, RecordError> {
        let log = header
            .output
            .mcap
            .then(|| {
                MessageLog::create(&dir.join(LOG_FILE), about(header), header.keeps_checkpoints)
            })
            .transpose()?;
        Ok(Self {
            n_agents: header.agent_count as usize,
            coupling: header.coupling,
            dir: dir.to_owned(),
            log,
            scene: header
                .output
                .scene
                .then(|| SceneLog::create(&dir.join(scene::FILE), header, about(header)))
                .transpose()?,
            capture_header_bytes: 0,
            capture: (header.output.pcap && header.records.contains(&NetRecord::Capture))
                .then(|| Capture::create(dir))
                .transpose()?,
            tables: Tables::create(dir, header)?,
            run: None,
            reserve: Reserve::keep(),
        })
    }

    /// Records what came.
    pub(crate) fn handle(&mut self, event: Event) -> Result<(), RecordError> {
        match event {
            Event::Configured(configured) => self.configured(*configured),
            Event::Steps(steps) => steps.into_iter().try_for_each(|step| self.step(step)),
            Event::Capture(part) => match &mut self.capture {
                Some(capture) => capture.copy(&part, self.capture_header_bytes),
                None => Ok(()),
            },
            Event::Checkpoint(states) => self.checkpoint(*states),
        }
    }

    /// Makes all files whole.
    pub(crate) fn finish(mut self) -> Result<Written, RecordError> {
        let mut files = Vec::new();
        let n_steps = self.run.as_ref().map(|run| (run.n_steps, run.n_ordered));
        if let Some(log) = self.log.take() {
            // Four messages about the configuration, three for each step, one more where there were orders.
            let n_messages = n_steps.map_or(0, |(n, n_ordered)| 4 + 3 * n + n_ordered);
            files.push((LOG_FILE, n_messages, log.finish()?));
        }
        if let Some(scene) = self.scene.take() {
            let (n_messages, fingerprint) = scene.finish()?;
            files.push((scene::FILE, n_messages, fingerprint));
        }
        if let Some(capture) = self.capture.take() {
            let (n_frames, fingerprint) = capture.finish()?;
            files.push((pcap::FILE, n_frames, fingerprint));
        }
        files.extend(self.tables.finish()?);
        Ok(match self.run {
            None => Written {
                measures: None,
                net_warnings: Vec::new(),
                orders: OrdersFromOutside::default(),
                digest: None,
                files,
            },
            Some(mut run) => {
                run.measures.end();
                Written {
                    measures: Some(run.measures),
                    net_warnings: run.net_warnings,
                    orders: run.orders,
                    digest: run.digest,
                    files,
                }
            }
        })
    }

    fn configured(&mut self, configured: Configured) -> Result<(), RecordError> {
        if let Some(run) = &self.run {
            return Err(RecordError::Order { got: 0, expected: run.n_steps + 1 });
        }
        if let Some(log) = &mut self.log {
            log.write(0, 0, configuration_messages(&configured))?;
        }
        let Configured { robots_request, robots_start, network_request, network_start } =
            configured;
        let n = self.n_agents;
        let motes = network_start.motes.unwrap_or_else(|| MoteStates::all_working(n));
        let statistics = network_start.statistics;
        let columns = statistics.as_ref().map(|statistics| &statistics.columns[..]);
        self.tables.begin(&robots_start.states, &motes, columns.unwrap_or_default())?;
        if let Some(capture) = &mut self.capture {
            capture.write(&network_start.capture_header)?;
            self.capture_header_bytes = network_start.capture_header.len();
        }
        let network_config = if network_start.effective_toml.is_empty() {
            &network_request.config_toml
        } else {
            &network_start.effective_toml
        };
        let kpis = Kpis::new(network_start.formation, statistics)
            .with_applications(Applications::from_config(network_config));
        let effective = if robots_start.effective_toml.is_empty() {
            &robots_request.config_toml
        } else {
            &robots_start.effective_toml
        };
        // Checked before anything started: of a site that is no site, nothing is drawn.
        let site = config::parse(&network_request.site_toml)
            .map(|site| site::read(&site, "site", &mut Vec::new()).0)
            .unwrap_or_default();
        let states = robots_start.states;
        if let Some(scene) = &mut self.scene {
            scene.begin(&site, &states)?;
        }
        self.run = Some(Run {
            measures: Measures::new(Task::from_config(effective), site, &states, kpis),
            net_warnings: network_start.warnings,
            periods: Periods::new(self.coupling, states),
            n_steps: 0,
            n_ordered: 0,
            orders: OrdersFromOutside::default(),
            digest: None,
        });
        Ok(())
    }

    /// Stores both sides' states with all that is needed to record the run again up to here. Without a log there is nothing to
    /// record it again from.
    fn checkpoint(&mut self, states: States) -> Result<(), RecordError> {
        let (Some(log), Some(run)) = (&mut self.log, &self.run) else { return Ok(()) };
        let latest = log.sync()?;
        let capture_bytes = self.capture.as_mut().map_or(Ok(0), Capture::sync)?;
        let States { robots, network, urls } = states;
        let checkpoint = Checkpoint {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            step: run.n_steps,
            time_ns: run.periods.time_ns(),
            robots,
            network,
            urls,
            capture_bytes,
            latest,
        };
        checkpoint.write(&self.dir, &mut self.reserve)
    }

    fn step(&mut self, record: StepRecord) -> Result<(), RecordError> {
        let StepRecord { step, time_ns, robots, network, commands, digest } = &record;
        let (step, time_ns) = (*step, *time_ns);
        let expected = self.run.as_ref().map_or(0, |run| run.n_steps + 1);
        let Some(run) = self.run.as_mut().filter(|_| step == expected) else {
            return Err(RecordError::Order { got: step, expected });
        };
        if let Some(capture) = &mut self.capture {
            capture.write(&network.capture)?;
        }
        for command in &robots.applied_commands {
            *run.orders.robots.entry(command.source.clone()).or_default() += 1;
        }
        for command in &network.applied_commands {
            *run.orders.network.entry(command.source.clone()).or_default() += 1;
        }
        for command in commands {
            let (what, mote) = event(&command.order);
            run.measures.note_event(run.periods.time_ns(), what, mote);
            if let Some(scene) = &mut self.scene {
                let mote = mote.map(|mote| format!(" mote {mote}")).unwrap_or_default();
                scene.event(step, time_ns, Level::Info, format!("order: {what}{mote}"))?;
            }
        }
        if let Some(log) = &mut self.log {
            // The radio's traffic is in a file of its own.
            log.write(step, time_ns, step_messages(&record, Bytes::new()))?;
            run.n_ordered += u64::from(!commands.is_empty());
        }
        if !robots.held {
            run.measures.task_figures.clone_from(&robots.figures);
        }
        let Self { tables, scene, .. } = self;
        let Run { periods, measures, .. } = run;
        periods.next(&record, |period| {
            measures.add(period);
            tables.add(period, &measures.kpis.account)?;
            scene.as_mut().map_or(Ok(()), |scene| scene.add(period))
        })?;
        run.n_steps = step;
        run.digest = Some(*digest);
        Ok(())
    }
}

/// What the log says about the run, for those who open it without the files beside it.
fn about(header: &RunHeader) -> BTreeMap<String, String> {
    let coupling = v1::Coupling::from(header.coupling).as_str_name();
    let mut about = header.labels.clone();
    about.insert("name".to_owned(), header.name.clone());
    about.insert("seed".to_owned(), header.seed.to_string());
    about.insert("agent_count".to_owned(), header.agent_count.to_string());
    about.insert("step_ns".to_owned(), header.step_ns.to_string());
    about.insert("coupling".to_owned(), coupling.to_owned());
    about
}

/// An order in one word, and the mote that it is for.
fn event(order: &MoteOrder) -> (&'static str, Option<u32>) {
    match order {
        MoteOrder::Kill(mote) => (KILL, Some(*mote)),
        MoteOrder::Revive(mote) => ("revive", Some(*mote)),
        MoteOrder::Add(mote) => ("add", Some(*mote)),
        MoteOrder::Jam { .. } => ("jam", None),
        MoteOrder::Send { mote, .. } => ("send", Some(*mote)),
    }
}

/// The message log.
pub const LOG_FILE: &str = "run.mcap";
