//! The network simulator as the shell around it sees it.

use crate::broadcast::Broadcast;
use crate::catalogue::Catalogue;
use crate::config::{self, SPEC};
use crate::mesh::config::Config;
use crate::mesh::network::Mesh;
use crate::place::Place;
use crate::second::{self, Second};
use crate::wire::tap;
use bytes::Bytes;
use proto::config::{Node, Problem, Value, json_schema};
use proto::side::{NetInput, NetOutput, NetSimulator, NetStart, NotASnapshot, Setup};
use proto::site::Site;
use proto::time::SimTime;
use proto::types::{DeliveryColumn, Experiment, MoteCommandKind, NetRecord};
use serde::{Deserialize, Serialize};

/// The network simulator. Does nothing until it is configured.
#[derive(Debug, Default)]
pub struct Network {
    catalogue: Catalogue,
    running: Option<Running>,
}

impl Network {
    /// A network simulator with these lists to choose from; [`Network::default`] has those that are built in.
    #[must_use]
    pub fn with_catalogue(catalogue: Catalogue) -> Self {
        Self { catalogue, running: None }
    }
}

#[derive(Debug)]
struct Running {
    origin: Origin,
    /// Seed of the draws to come: the experiment's, unless there is another one since.
    seed: u64,
    mode: Mode,
    /// The broadcast medium beside the main network, if there is one.
    second: Option<Box<Second>>,
}

/// What is simulated: `netsim.mode`.
#[derive(Debug)]
enum Mode {
    /// No protocols.
    PropagationOnly(Box<Broadcast>),
    /// The full network.
    Mesh(Box<Mesh>),
}

/// What an experiment began with: enough to begin it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Origin {
    experiment: Experiment,
    site: Site,
    config_toml: String,
    files: Vec<(String, Bytes)>,
    columns: Vec<DeliveryColumn>,
    records: Vec<NetRecord>,
}

#[derive(Serialize, Deserialize)]
struct Snapshot {
    version: String,
    origin: Origin,
    seed: u64,
    state: State,
    second: Option<second::State>,
}

/// What changes as time goes on.
#[derive(Serialize, Deserialize)]
enum State {
    PropagationOnly(Box<Place>),
    Mesh(Box<crate::mesh::network::State>),
}

impl Origin {
    fn new(setup: &Setup, effective: &toml::Table) -> Self {
        Self {
            experiment: setup.experiment.clone(),
            site: setup.site.clone(),
            config_toml: effective.to_string(),
            files: setup
                .files
                .iter()
                .map(|(path, content)| (path.clone(), content.clone()))
                .collect(),
            columns: setup.columns.clone(),
            records: setup.records.clone(),
        }
    }

    fn setup(&self) -> Result<Setup, NotASnapshot> {
        let table: toml::Table = self
            .config_toml
            .parse()
            .map_err(|error: toml::de::Error| NotASnapshot(error.to_string()))?;
        let value = Value::from(&toml::Value::Table(table));
        Ok(Setup {
            experiment: self.experiment.clone(),
            site: self.site.clone(),
            config: Node { value, span: None },
            path: String::new(),
            files: self.files.iter().cloned().collect(),
            columns: self.columns.clone(),
            records: self.records.clone(),
        })
    }
}

impl Origin {
    /// The second medium at time 0, if there is one; then the main network fills in what it takes to join both.
    fn take_second(&mut self, config: &mut Config) -> Option<Box<Second>> {
        let second = config.second.take()?;
        let columns = self.columns.clone();
        self.columns = Second::main_columns(&columns);
        let place = (&config.absent[..], self.site.clone());
        let height_m = config.antenna_height_m;
        Some(Box::new(Second::new(&self.experiment, second, columns, height_m, place)))
    }
}

impl Mode {
    /// At time 0.
    fn begin(mut config: Config, origin: Origin) -> Self {
        let Origin { experiment, site, columns, records, .. } = origin;
        match config.network.take() {
            None => {
                Self::PropagationOnly(Box::new(Broadcast::new(experiment, config, site, columns)))
            }
            Some(network) => {
                let (settings, addresses) = *network;
                let mesh =
                    Mesh::new(experiment, config, settings, addresses, site, columns, records);
                Self::Mesh(Box::new(mesh))
            }
        }
    }

    /// In a state that was reached before; `None`: it is that of another mode or scheduling function, or of
    /// another number of agents.
    fn resume(mut config: Config, origin: Origin, state: State) -> Option<Self> {
        let Origin { experiment, columns, records, .. } = origin;
        let n = experiment.agent_count;
        match (config.network.take(), state) {
            (None, State::PropagationOnly(place)) if place.is_of(n) => Some(Self::PropagationOnly(
                Box::new(Broadcast::with_place(experiment, config, columns, *place)),
            )),
            (Some(network), State::Mesh(mut state))
                if state.place.is_of(n)
                    && state.motes.len() == n
                    && state.waiting.is_of(n)
                    && state.events.is_of(&network.0.apps) =>
            {
                let (settings, addresses) = *network;
                if !state.motes.iter_mut().all(|mote| mote.sf.resume(&settings.sf)) {
                    return None;
                }
                let mesh = Mesh::with_state(
                    experiment, config, settings, addresses, columns, records, *state,
                );
                Some(Self::Mesh(Box::new(mesh)))
            }
            _ => None,
        }
    }

    fn reseed(&mut self, seed: u64) {
        match self {
            Self::PropagationOnly(broadcast) => broadcast.reseed(seed),
            Self::Mesh(mesh) => mesh.reseed(seed),
        }
    }

    fn state(&self) -> State {
        match self {
            Self::PropagationOnly(broadcast) => {
                State::PropagationOnly(Box::new(broadcast.place().clone()))
            }
            Self::Mesh(mesh) => State::Mesh(Box::new(mesh.state().clone())),
        }
    }
}

impl Running {
    fn start(&mut self, effective: toml::Table, warnings: Vec<String>) -> NetStart {
        let start = NetStart { effective, motes: self.motes(), warnings, ..NetStart::default() };
        let is_asked = self.second.as_ref().is_none_or(|second| !second.carries_all());
        match &mut self.mode {
            Mode::PropagationOnly(_) => start,
            Mode::Mesh(mesh) => {
                let records = self.origin.records.clone();
                let has = |record| records.contains(&record);
                NetStart {
                    formation: Some(mesh.formation()),
                    max_payload_bytes: mesh.max_payload_bytes().filter(|_| is_asked),
                    statistics: has(NetRecord::Statistics).then(|| mesh.statistics(SimTime::START)),
                    capture_header: if has(NetRecord::Capture) {
                        Bytes::copy_from_slice(&tap::file_header())
                    } else {
                        Bytes::new()
                    },
                    records,
                    ..start
                }
            }
        }
    }

    fn motes(&self) -> proto::types::MoteStates {
        match &self.mode {
            Mode::PropagationOnly(broadcast) => broadcast.motes(),
            Mode::Mesh(mesh) => mesh.motes(),
        }
    }
}

impl NetSimulator for Network {
    const NAME: &'static str = "netsim";

    fn config_schema_json(&self) -> String {
        json_schema(&SPEC, &self.catalogue.lists()).to_string()
    }

    fn commands() -> &'static [MoteCommandKind] {
        &config::COMMANDS
    }

    fn obeys(&self, kind: MoteCommandKind) -> bool {
        match self.running.as_ref().map(|running| &running.mode) {
            Some(Mode::PropagationOnly(_)) => config::WITHOUT_PROTOCOLS.contains(&kind),
            Some(Mode::Mesh(_)) | None => config::COMMANDS.contains(&kind),
        }
    }

    fn records() -> &'static [NetRecord] {
        &[
            NetRecord::Packets,
            NetRecord::Capture,
            NetRecord::Statistics,
            NetRecord::Schedule,
            NetRecord::HeardLinks,
            NetRecord::Frames,
        ]
    }

    fn columns() -> &'static [DeliveryColumn] {
        &[
            DeliveryColumn::ReceivedNs,
            DeliveryColumn::RssiDbm,
            DeliveryColumn::Hops,
            DeliveryColumn::Medium,
        ]
    }

    fn configure(&mut self, setup: &Setup) -> Result<NetStart, Vec<Problem>> {
        let (mut config, effective, warnings) = config::read(setup, &self.catalogue)?;
        let origin = Origin::new(setup, &effective);
        let mut of_main = origin.clone();
        let second = of_main.take_second(&mut config);
        let mode = Mode::begin(config, of_main);
        let mut running = Running { origin, seed: setup.experiment.seed, mode, second };
        let start = running.start(effective, warnings);
        self.running = Some(running);
        Ok(start)
    }

    fn step(&mut self, input: &NetInput<'_>) -> NetOutput {
        let running = self.running.as_mut().expect("configured before it is stepped");
        let mode = &mut running.mode;
        let mut main = |input: &NetInput<'_>| match mode {
            Mode::PropagationOnly(broadcast) => broadcast.step(input),
            Mode::Mesh(mesh) => mesh.step(input),
        };
        match &mut running.second {
            None => main(input),
            Some(second) => second.step(input, main),
        }
    }

    fn snapshot(&self) -> Vec<u8> {
        let running = self.running.as_ref().expect("configured before a snapshot is taken");
        let snapshot = Snapshot {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            origin: running.origin.clone(),
            seed: running.seed,
            state: running.mode.state(),
            second: running.second.as_ref().map(|second| second.state()),
        };
        postcard::to_stdvec(&snapshot).expect("plain data in memory")
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), NotASnapshot> {
        let wrong = |reason: String| NotASnapshot(reason);
        let (snapshot, rest): (Snapshot, _) =
            postcard::take_from_bytes(state).map_err(|error| wrong(error.to_string()))?;
        let Snapshot { version, origin, seed, state, second: second_state } = snapshot;
        if version != env!("CARGO_PKG_VERSION") {
            return Err(wrong(format!("made by version {version}")));
        }
        if !rest.is_empty() {
            return Err(wrong("longer than a snapshot".to_owned()));
        }
        let (mut config, ..) =
            config::read(&origin.setup()?, &self.catalogue).map_err(|problems| {
                let problems: Vec<String> = problems.iter().map(ToString::to_string).collect();
                wrong(problems.join("; "))
            })?;
        let mut of_main = origin.clone();
        let second = match (of_main.take_second(&mut config), second_state) {
            (None, None) => None,
            (Some(second), Some(state)) => {
                let resumed = second.resumed(state);
                let another = || wrong("of another second medium".to_owned());
                Some(Box::new(resumed.ok_or_else(another)?))
            }
            _ => return Err(wrong("of another second medium".to_owned())),
        };
        let mode = Mode::resume(config, of_main, state)
            .ok_or_else(|| wrong("of another number of agents".to_owned()))?;
        self.running = Some(Running { origin, seed, mode, second });
        self.reseed(seed);
        Ok(())
    }

    fn reseed(&mut self, seed: u64) {
        let running = self.running.as_mut().expect("configured or restored before it is reseeded");
        running.seed = seed;
        running.mode.reseed(seed);
        if let Some(second) = &mut running.second {
            second.reseed(seed);
        }
    }
}
