//! The swarm: owns the state; each step turns knowledge into commands, commands into motion, motion into payloads.

use crate::catalogue::Catalogue;
use crate::config::{self, Behaviour};
use crate::controller::{Links, View};
use crate::dynamics::{Command, Memory, Step};
use crate::exploration::{self, Moment};
use crate::knowledge::{Knowledge, Remembered, Source};
use crate::{absence, obstacles, payload, predict, scenario};
use proto::config::Problem;
use proto::ids::AgentId;
use proto::prediction::{PredictedWindow, PredictionRequest};
use proto::rng::{Draws, Purpose};
use proto::side::{NotASnapshot, RobotInput, RobotOutput, RobotSimulator, RobotStart, Setup};
use proto::site::Site;
use proto::time::{SimDuration, SimTime};
use proto::types::{AgentOrder, AgentStates, DeliveryColumn};
use serde::{Deserialize, Serialize};

/// The robots of an experiment.
#[derive(Debug, Default)]
pub struct Swarm {
    catalogue: Catalogue,
    running: Option<Running>,
}

#[derive(Debug)]
struct Running {
    behaviour: Behaviour,
    state: State,
}

/// Everything that is saved.
#[derive(Debug, Serialize, Deserialize)]
struct State {
    seed: u64,
    /// The configuration in force, as TOML text.
    effective: String,
    states: AgentStates,
    /// What the agents believe of where they are. `None`: the truth.
    measured: Option<AgentStates>,
    /// What the agents' motion carries over from step to step. Empty: nothing.
    memory: Vec<Memory>,
    /// The place, as it was at the beginning.
    site: Site,
    /// What each agent was ordered to do. `None`: its controller decides.
    orders: Vec<Option<AgentOrder>>,
    /// Transmissions so far whose payload was not one of ours.
    n_foreign: u64,
    /// For how long the robots have been free to move.
    free: SimDuration,
    /// What the agents remember of each other. Empty: they have no memory.
    remembered: Vec<Remembered>,
    /// What agents that explore know. `None`: nobody explores.
    exploration: Option<exploration::State>,
}

impl Swarm {
    /// Robots with these lists to choose from; [`Swarm::default`] has those that are built in.
    #[must_use]
    pub fn with_catalogue(catalogue: Catalogue) -> Self {
        Self { catalogue, running: None }
    }

    /// How many transmissions had a payload that is not one of ours and were not read, since the experiment began.
    #[must_use]
    pub fn n_foreign_payloads(&self) -> u64 {
        self.running.as_ref().map_or(0, |running| running.state.n_foreign)
    }
}

impl RobotSimulator for Swarm {
    const NAME: &'static str = "robotsim";

    fn config_schema_json(&self) -> String {
        proto::config::json_schema(&config::SPEC, &self.catalogue.lists()).to_string()
    }

    fn configure(&mut self, setup: &Setup) -> Result<RobotStart, Vec<Problem>> {
        let (config, effective) = config::read(setup, &self.catalogue)?;
        let wants_rssi = config.behaviour.team.wants_rssi();
        let columns = if wants_rssi { vec![DeliveryColumn::RssiDbm] } else { Vec::new() };
        let (seed, n_agents) = (setup.experiment.seed, setup.experiment.agent_count);
        let mut states = scenario::states(&*config.scenario, n_agents, seed);
        let fleet = &config.behaviour.fleet;
        fleet.complete(&mut states);
        let mut memory = fleet.memory(n_agents);
        let site = setup.site.clone();
        absence::mark(&config.behaviour.absences, SimDuration::ZERO, &mut states);
        fleet.make_room(&site, &mut states);
        let start =
            Step { from: SimTime::START, until: SimTime::START, site: &site, courses: &[], seed };
        let measured = fleet.measured(&start, &states, &mut memory);
        if config.behaviour.knowledge == Source::Truth {
            tracing::info!(
                "knowledge = \"truth\": every robot is told the state of every other; an ideal baseline, no radio"
            );
        }
        let payloads = payload::encode(measured.as_ref().unwrap_or(&states));
        let exploration = match &config.behaviour.exploration {
            Some(settings) => {
                let outside = outside(settings, &states, &setup.path);
                if !outside.is_empty() {
                    return Err(outside);
                }
                let courses = &config.behaviour.courses;
                let moves = |place| courses.iter().any(|course| course.obstacle() == place);
                Some(exploration::State::new(settings, &site, &states, moves))
            }
            None => None,
        };
        let messages = exploration.is_some() && config.behaviour.knowledge == Source::Heard;
        let state = State {
            seed,
            effective: effective.to_string(),
            states: states.clone(),
            measured,
            memory,
            site,
            orders: vec![None; n_agents],
            n_foreign: 0,
            free: SimDuration::ZERO,
            remembered: vec![
                Remembered::default();
                if config.behaviour.memory.is_some() { n_agents } else { 0 }
            ],
            exploration,
        };
        self.running = Some(Running { behaviour: config.behaviour, state });
        Ok(RobotStart { effective, states, payloads, columns, messages })
    }

    fn step(&mut self, input: &RobotInput<'_>) -> RobotOutput {
        let Running { behaviour, state } =
            self.running.as_mut().expect("step is called after configure only");
        for command in input.commands {
            state.orders[command.agent as usize] = match command.order {
                AgentOrder::Release => None,
                order => Some(order),
            };
        }
        let [from, until] = [input.from_ns, input.until_ns].map(SimTime::from_ns);
        let span_s = [from.seconds(), until.seconds()];
        let moved_obstacles = obstacles::moved(&behaviour.courses, &state.site, span_s);
        if input.hold {
            behaviour.fleet.stand_still(&mut state.memory);
            return RobotOutput { moved_obstacles, ..state.stand_still() };
        }
        let knowledge = match behaviour.knowledge {
            Source::Heard => Knowledge::heard(input.deliveries, state.states.len()),
            Source::Truth => Knowledge::truth(&state.states, from),
        };
        state.note_foreign(knowledge.n_foreign(), input.step);
        if let Some(memory) = &behaviour.memory {
            memory.take_up(&knowledge, from, &mut state.remembered);
        }
        let knowledge = match &behaviour.memory {
            Some(memory) => knowledge.with_memory(memory, &state.remembered, from),
            None => knowledge,
        };

        let mut messages = Vec::new();
        if let (Some(settings), Some(exploration)) =
            (&behaviour.exploration, &mut state.exploration)
        {
            let moment = Moment {
                from,
                until,
                states: &state.states,
                believed: state.measured.as_ref().unwrap_or(&state.states),
                deliveries: input.deliveries,
                source: behaviour.knowledge,
            };
            messages = exploration.advance(settings, &moment);
        }
        let dt_s = (until - from).seconds();
        let view = View {
            step: input.step,
            time_s: state.free.seconds(),
            dt_s,
            states: state.believed(),
            knowledge: &knowledge,
            links: Links::new(input.motes),
            exploration: state.exploration.as_ref(),
            draws: Draws::new(state.seed, Purpose::Control),
        };
        let mut commands = behaviour.team.commands(&view);
        let task_complete = behaviour.team.is_done(&view, &commands);
        for (agent, command) in commands.iter_mut().enumerate() {
            match state.orders[agent] {
                Some(AgentOrder::Velocity(velocity_mps)) => {
                    *command = Command::Velocity(velocity_mps);
                }
                Some(AgentOrder::Waypoint(to_m)) => {
                    // Straight there: the cap shortens a step that is too long.
                    let at_m = state.believed().position_m(agent);
                    *command =
                        Command::Velocity(std::array::from_fn(|i| (to_m[i] - at_m[i]) / dt_s));
                }
                Some(AgentOrder::Release) | None => {}
            }
        }
        let step =
            Step { from, until, site: &state.site, courses: &behaviour.courses, seed: state.seed };
        state.free += until - from;
        behaviour.fleet.advance(&step, &commands, &mut state.states, &mut state.memory);
        for gone in absence::mark(&behaviour.absences, state.free, &mut state.states) {
            if let Some(memory) = state.memory.get_mut(gone.index()) {
                behaviour.fleet.stand_still(std::slice::from_mut(memory));
            }
            if let Some(remembered) = state.remembered.get_mut(gone.index()) {
                remembered.clear();
            }
        }
        state.measured = behaviour.fleet.measured(&step, &state.states, &mut state.memory);
        RobotOutput {
            states: state.states.clone(),
            payloads: payload::encode(state.believed()),
            moved_obstacles,
            task_complete,
            messages,
            figures: state.exploration.as_ref().map(|it| it.figures()).unwrap_or_default(),
            ..RobotOutput::default()
        }
    }

    fn predict(&self, request: &PredictionRequest) -> Result<Vec<PredictedWindow>, Vec<Problem>> {
        predict::predict(request, &self.catalogue)
    }

    fn snapshot(&self) -> Vec<u8> {
        let state = self.running.as_ref().map(|running| &running.state);
        postcard::to_stdvec(&(HEADER, state)).expect("a state is plain numbers and text")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), NotASnapshot> {
        let wrong = |error: postcard::Error| NotASnapshot(error.to_string());
        let (header, rest): (&str, _) = postcard::take_from_bytes(bytes).map_err(wrong)?;
        if header != HEADER {
            return Err(NotASnapshot(format!("it is of {header:?}, not of {HEADER:?}")));
        }
        let (state, rest): (Option<State>, _) = postcard::take_from_bytes(rest).map_err(wrong)?;
        if !rest.is_empty() {
            return Err(NotASnapshot(format!("{} bytes too many", rest.len())));
        }
        let resume = |state| Running::resume(state, &self.catalogue);
        self.running = state.map(resume).transpose()?;
        Ok(())
    }

    fn reseed(&mut self, seed: u64) {
        if let Some(running) = &mut self.running {
            running.state.seed = seed;
        }
    }
}

impl Running {
    fn resume(state: State, catalogue: &Catalogue) -> Result<Self, NotASnapshot> {
        state.check_lengths()?;
        let effective: toml::Table =
            state.effective.parse().map_err(|error| NotASnapshot(format!("{error}")))?;
        let n_agents = state.states.len();
        let behaviour = config::read_behaviour(&effective, n_agents, &state.site, catalogue)
            .map_err(|problems| NotASnapshot(format!("{}", Listed(&problems))))?;
        let fits = match (&behaviour.exploration, &state.exploration) {
            (Some(settings), Some(exploration)) => exploration.fits(settings, state.states.len()),
            (settings, exploration) => settings.is_none() && exploration.is_none(),
        };
        if !fits {
            return Err(NotASnapshot("a map of another area".to_owned()));
        }
        Ok(Self { behaviour, state })
    }
}

impl State {
    /// The states as the agents know their own.
    fn believed(&self) -> &AgentStates {
        self.measured.as_ref().unwrap_or(&self.states)
    }

    /// Time passes and nobody moves: what was heard is forgotten, as controllers keep no memory anyway.
    fn stand_still(&mut self) -> RobotOutput {
        for states in std::iter::once(&mut self.states).chain(&mut self.measured) {
            for column in [&mut states.vx_mps, &mut states.vy_mps, &mut states.vz_mps] {
                column.fill(0.0);
            }
        }
        let payloads = payload::encode(self.believed());
        RobotOutput { states: self.states.clone(), payloads, ..RobotOutput::default() }
    }

    /// Warns once, at the first payload that cannot be read, and counts on.
    fn note_foreign(&mut self, n: u64, step: u64) {
        if self.n_foreign == 0 && n != 0 {
            tracing::warn!(
                step,
                n,
                "payloads that are not {} bytes of finite numbers are not read",
                payload::LENGTH_BYTES
            );
        }
        self.n_foreign += n;
    }

    fn check_lengths(&self) -> Result<(), NotASnapshot> {
        let AgentStates { alive, x_m, y_m, z_m, vx_mps, vy_mps, vz_mps, heading_rad, .. } =
            &self.states;
        let n = x_m.len();
        let columns = [y_m, z_m, vx_mps, vy_mps, vz_mps].map(Vec::len);
        let fit = columns == [n; 5]
            && alive.len() == n
            && self.orders.len() == n
            && (self.remembered.is_empty() || self.remembered.len() == n)
            && (self.memory.is_empty() || self.memory.len() == n)
            && (heading_rad.is_empty() || heading_rad.len() == n);
        if fit { Ok(()) } else { Err(NotASnapshot("columns of unequal length".to_owned())) }
    }
}

/// Robots that begin outside the area that they are to explore.
fn outside(settings: &exploration::Settings, states: &AgentStates, path: &str) -> Vec<Problem> {
    let place_m = |agent: AgentId| [states.x_m[agent.index()], states.y_m[agent.index()]];
    let is_outside = |&agent: &AgentId| settings.grid.cell_at(place_m(agent)).is_none();
    let Some(first) = AgentId::first(states.len()).find(is_outside) else { return Vec::new() };
    let n = AgentId::first(states.len()).filter(is_outside).count();
    let message = format!(
        "must place all robots inside the area from controller.from_m to controller.to_m; {n} start outside, the first is \
         robot {first}"
    );
    let at = proto::config::join(path, "scenario");
    vec![Problem::new(at, message).value(format!("{:?}", place_m(first)))]
}

/// Problems in one line.
struct Listed<'a>(&'a [Problem]);

impl std::fmt::Display for Listed<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (index, problem) in self.0.iter().enumerate() {
            write!(f, "{}{problem}", if index == 0 { "" } else { "; " })?;
        }
        Ok(())
    }
}

/// Begins every snapshot.
const HEADER: &str = concat!("robotsim ", env!("CARGO_PKG_VERSION"));
