//! Turns replies into files, step by step, in the order they come.

use super::log::{MessageLog, Topic};
use super::pcap::{self, Capture};
use super::tables::Tables;
use super::whole::Fingerprint;
use super::{Configured, RecordError, RunHeader};
use metrics::counts::Counts;
use metrics::kpi::Kpis;
use metrics::measures::Measures;
use metrics::period::Period;
use metrics::task::Task;
use proto::config;
use proto::digest::Digest;
use proto::site;
use proto::types::{AgentStates, Coupling, MoteCommand, MoteOrder, NetRecord};
use proto_messages::convert;
use proto_messages::v1;
use std::collections::BTreeMap;
use std::path::Path;

/// What comes to be recorded.
pub(crate) enum Event {
    /// Both sides are configured.
    Configured(Box<Configured>),
    /// Both sides have answered these steps and agree on their digests.
    Steps(Vec<Step>),
}

/// A step.
#[derive(Debug)]
pub(crate) struct Step {
    pub step: u64,
    pub time_ns: u64,
    pub robots: v1::RobotSimServiceStepResponse,
    pub net: v1::NetSimServiceStepResponse,
    pub commands: Vec<MoteCommand>,
    pub digest: Digest,
}

/// The files being written, and the measures of the run so far.
pub(crate) struct RunWriter {
    n_agents: usize,
    coupling: Coupling,
    log: Option<MessageLog>,
    capture: Option<Capture>,
    tables: Tables,
    run: Option<Run>,
}

/// What a configured run has come to.
struct Run {
    measures: Measures,
    net_warnings: Vec<String>,
    states: AgentStates,
    time_ns: u64,
    n_steps: u64,
    /// Steps with orders, each with a message of its own.
    n_ordered: u64,
    digest: Option<Digest>,
}

/// What is left when all files are whole.
pub(crate) struct Written {
    /// Measures; `None` of a run that was never configured.
    pub measures: Option<Measures>,
    /// What the network warned of.
    pub net_warnings: Vec<String>,
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
            .then(|| MessageLog::create(&dir.join(LOG_FILE), about(header)))
            .transpose()?;
        Ok(Self {
            n_agents: header.agent_count as usize,
            coupling: header.coupling,
            log,
            capture: (header.output.pcap && header.records.contains(&NetRecord::Capture))
                .then(|| Capture::create(dir))
                .transpose()?,
            tables: Tables::create(dir, header)?,
            run: None,
        })
    }

    /// Records what came.
    pub(crate) fn handle(&mut self, event: Event) -> Result<(), RecordError> {
        match event {
            Event::Configured(configured) => self.configured(*configured),
            Event::Steps(steps) => steps.into_iter().try_for_each(|step| self.step(step)),
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
        if let Some(capture) = self.capture.take() {
            let (n_frames, fingerprint) = capture.finish()?;
            files.push((pcap::FILE, n_frames, fingerprint));
        }
        files.extend(self.tables.finish()?);
        Ok(match self.run {
            None => Written { measures: None, net_warnings: Vec::new(), digest: None, files },
            Some(mut run) => {
                run.measures.end();
                Written {
                    measures: Some(run.measures),
                    net_warnings: run.net_warnings,
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
        let Configured { robot_request, robot_response, net_request, net_response } = configured;
        if let Some(log) = &mut self.log {
            log.write(Topic::RobotConfigureRequest, 0, 0, &robot_request)?;
            log.write(Topic::RobotConfigureResponse, 0, 0, &robot_response)?;
            log.write(Topic::NetConfigureRequest, 0, 0, &net_request)?;
            log.write(Topic::NetConfigureResponse, 0, 0, &net_response)?;
        }
        let n = self.n_agents;
        let states = convert::states(robot_response.states, n).map_err(of_robots(0))?;
        let motes = convert::motes(net_response.motes, n).map_err(of_network(0))?;
        let statistics = convert::statistics(net_response.statistics, n).map_err(of_network(0))?;
        let formation = convert::formation(net_response.formation, n).map_err(of_network(0))?;
        let columns = statistics.as_ref().map(|statistics| &statistics.columns[..]);
        self.tables.begin(&states, &motes, columns.unwrap_or_default())?;
        if let Some(capture) = &mut self.capture {
            capture.write(&net_response.capture_header)?;
        }
        let kpis = Kpis::new(formation, statistics);
        let effective = if robot_response.effective_config_toml.is_empty() {
            &robot_request.config_toml
        } else {
            &robot_response.effective_config_toml
        };
        // Checked before anything started: of a site that is no site, nothing is drawn.
        let site = config::parse(&net_request.site_toml)
            .map(|site| site::read(&site, "site", &mut Vec::new()).0)
            .unwrap_or_default();
        self.run = Some(Run {
            measures: Measures::new(Task::of(effective), site, &states, kpis),
            net_warnings: net_response.warnings,
            states,
            time_ns: 0,
            n_steps: 0,
            n_ordered: 0,
            digest: None,
        });
        Ok(())
    }

    fn step(&mut self, step: Step) -> Result<(), RecordError> {
        let Step { step, time_ns, mut robots, mut net, commands, digest } = step;
        let expected = self.run.as_ref().map_or(0, |run| run.n_steps + 1);
        let Some(run) = self.run.as_mut().filter(|_| step == expected) else {
            return Err(RecordError::Order { got: step, expected });
        };
        // Only a stream carries them; the record is the same without.
        robots.digest.clear();
        net.digest.clear();
        // In a file of its own.
        let captured = std::mem::take(&mut net.capture);
        if let Some(capture) = &mut self.capture {
            capture.write(&captured)?;
        }
        for command in &commands {
            run.measures.note_event(run.time_ns, word(&command.order));
        }
        if let Some(log) = &mut self.log {
            if !commands.is_empty() {
                let commands = commands.into_iter().map(Into::into).collect();
                let request = v1::NetSimServiceCommandRequest { commands };
                log.write(Topic::NetCommand, step, time_ns, &request)?;
                run.n_ordered += 1;
            }
            log.write(Topic::RobotStep, step, time_ns, &robots)?;
            log.write(Topic::NetStep, step, time_ns, &net)?;
            let barrier = v1::RobotSimServiceBarrierResponse {
                step,
                time_ns,
                digest: digest.to_vec().into(),
            };
            log.write(Topic::Barrier, step, time_ns, &barrier)?;
        }
        let n = self.n_agents;
        let figures = convert::task_figures(robots.figures).map_err(of_robots(step))?;
        if !robots.held {
            run.measures.task_figures = figures;
        }
        let moved_obstacles =
            convert::moved_obstacles(robots.moved_obstacles).map_err(of_robots(step))?;
        let states = convert::states(robots.states, n).map_err(of_robots(step))?;
        let deliveries =
            convert::deliveries(net.deliveries, n).map_err(of_network(step))?.unwrap_or_default();
        let motes = convert::motes(net.motes, n).map_err(of_network(step))?;
        let formation = convert::formation(net.formation, n).map_err(of_network(step))?;
        let packets = convert::packets(net.packets, n).map_err(of_network(step))?;
        let statistics = convert::statistics(net.statistics, n).map_err(of_network(step))?;
        let schedule = convert::schedule(net.schedule, n).map_err(of_network(step))?;
        let heard_links = convert::heard_links(net.heard_links, n).map_err(of_network(step))?;
        let counts = Counts::of(&deliveries, n);
        let period = Period {
            step,
            from_ns: run.time_ns,
            time_ns,
            states: &states,
            states_before: &run.states,
            states_on_air: match self.coupling {
                Coupling::Sequential => &states,
                Coupling::Parallel | Coupling::Event => &run.states,
            },
            moved_obstacles: &moved_obstacles,
            deliveries: &deliveries,
            counts: &counts,
            motes: &motes,
            task_complete: robots.task_complete,
            held: robots.held,
            formation: formation.as_ref(),
            packets: packets.as_ref(),
            statistics: statistics.as_ref(),
            schedule: schedule.as_ref(),
            heard_links: heard_links.as_ref(),
        };
        run.measures.add(&period);
        self.tables.add(&period, &run.measures.kpis.account)?;
        run.states = states;
        run.time_ns = time_ns;
        run.n_steps = step;
        run.digest = Some(digest);
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

/// An order in one word.
fn word(order: &MoteOrder) -> &'static str {
    match order {
        MoteOrder::Kill(_) => "kill",
        MoteOrder::Revive(_) => "revive",
        MoteOrder::Add(_) => "add",
        MoteOrder::Jam { .. } => "jam",
        MoteOrder::Send { .. } => "send",
    }
}

fn of_robots(step: u64) -> impl Fn(convert::InvalidField) -> RecordError {
    move |source| RecordError::Message { step, side: "robot simulator", source }
}

fn of_network(step: u64) -> impl Fn(convert::InvalidField) -> RecordError {
    move |source| RecordError::Message { step, side: "network simulator", source }
}

/// The message log.
pub(crate) const LOG_FILE: &str = "run.mcap";
