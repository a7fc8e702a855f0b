//! The network simulator as the shell around it sees it.

use crate::broadcast::{Broadcast, State};
use crate::config::{self, SPEC};
use bytes::Bytes;
use proto::config::{Node, Problem, Value, json_schema};
use proto::side::{NetInput, NetOutput, NetSimulator, NetStart, NotASnapshot, Setup};
use proto::site::Site;
use proto::types::{DeliveryColumn, Experiment};
use proto::v1::MoteCommandKind;
use serde::{Deserialize, Serialize};

/// The network simulator. Does nothing until it is configured.
#[derive(Debug, Default)]
pub struct Network {
    running: Option<Running>,
}

#[derive(Debug)]
struct Running {
    origin: Origin,
    mode: Mode,
}

/// What is simulated: `netsim.mode`.
#[derive(Debug)]
enum Mode {
    /// No protocols.
    PropagationOnly(Box<Broadcast>),
}

/// What an experiment began with: enough to begin it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Origin {
    experiment: Experiment,
    site: Site,
    config_toml: String,
    files: Vec<(String, Bytes)>,
    columns: Vec<DeliveryColumn>,
}

#[derive(Serialize, Deserialize)]
struct Snapshot {
    version: String,
    origin: Origin,
    state: State,
}

impl Origin {
    fn of(setup: &Setup, effective: &toml::Table) -> Self {
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
        })
    }
}

impl Running {
    fn motes(&self) -> proto::types::MoteStates {
        match &self.mode {
            Mode::PropagationOnly(broadcast) => broadcast.motes(),
        }
    }
}

impl NetSimulator for Network {
    const NAME: &'static str = "netsim";

    fn config_schema_json() -> String {
        json_schema(&SPEC).to_string()
    }

    fn commands() -> &'static [MoteCommandKind] {
        &[MoteCommandKind::Kill, MoteCommandKind::Revive, MoteCommandKind::Add]
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
        let (config, effective, warnings) = config::read(setup)?;
        let origin = Origin::of(setup, &effective);
        let Origin { experiment, site, columns, .. } = origin.clone();
        let broadcast = Broadcast::new(experiment, config, site, columns);
        let running = Running { origin, mode: Mode::PropagationOnly(Box::new(broadcast)) };
        let motes = running.motes();
        self.running = Some(running);
        Ok(NetStart { effective, motes, warnings })
    }

    fn step(&mut self, input: &NetInput<'_>) -> NetOutput {
        let running = self.running.as_mut().expect("configured before it is stepped");
        match &mut running.mode {
            Mode::PropagationOnly(broadcast) => broadcast.step(input),
        }
    }

    fn snapshot(&self) -> Vec<u8> {
        let running = self.running.as_ref().expect("configured before a snapshot is taken");
        let Mode::PropagationOnly(broadcast) = &running.mode;
        let snapshot = Snapshot {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            origin: running.origin.clone(),
            state: broadcast.state().clone(),
        };
        postcard::to_stdvec(&snapshot).expect("plain data in memory")
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), NotASnapshot> {
        let wrong = |reason: String| NotASnapshot(reason);
        let (snapshot, rest): (Snapshot, _) =
            postcard::take_from_bytes(state).map_err(|error| wrong(error.to_string()))?;
        let Snapshot { version, origin, state } = snapshot;
        if version != env!("CARGO_PKG_VERSION") {
            return Err(wrong(format!("made by version {version}")));
        }
        let n = origin.experiment.agent_count;
        let lengths =
            [state.present.len(), state.working.len(), state.way_m.len(), state.last_seen_m.len()];
        if !rest.is_empty() || lengths.iter().any(|&length| length != n) {
            return Err(wrong("of another length".to_owned()));
        }
        let (config, ..) = config::read(&origin.setup()?).map_err(|problems| {
            let problems: Vec<String> = problems.iter().map(ToString::to_string).collect();
            wrong(problems.join("; "))
        })?;
        let Origin { experiment, columns, .. } = origin.clone();
        let broadcast = Broadcast::with_state(experiment, config, columns, state);
        self.running = Some(Running { origin, mode: Mode::PropagationOnly(Box::new(broadcast)) });
        Ok(())
    }
}
