//! A small network for tests: everyone broadcasts once in a period, and a rule says who hears.

use proto::config;
use proto::side::{RobotInput, RobotOutput, RobotSimulator, Setup};
use proto::types::{
    AgentCommand, AgentStates, Coupling, Deliveries, Experiment, Heard, MoteStates, Payloads,
    Transmissions,
};
use robotsim::sim::Swarm;
use std::collections::BTreeMap;

/// An experiment of `n` agents.
pub(crate) fn setup(toml: &str, n: usize, seed: u64) -> Setup {
    Setup {
        experiment: Experiment {
            seed,
            agent_count: n,
            step_ns: 100_000_000,
            coupling: Coupling::Sequential,
        },
        site: proto::site::Site::default(),
        config: config::parse(toml).expect("the text is TOML"),
        path: "robotsim".to_owned(),
        files: BTreeMap::new(),
        columns: Vec::new(),
        records: Vec::new(),
    }
}

/// A swarm and the air between its robots, in sequential coupling: the robots act on what was heard during the period
/// before and move; then everyone broadcasts, and `hears(step, sender, receiver, distance_m)` decides.
pub(crate) struct Air<F> {
    pub(crate) swarm: Swarm,
    pub(crate) states: AgentStates,
    pub(crate) step: u64,
    pub(crate) deliveries: Option<Deliveries>,
    /// How strong frames are at a distance (m). `None`: that is not reported.
    pub(crate) rssi_dbm: Option<fn(f64) -> f32>,
    /// How the motes stand in the network. `None`: that is not reported.
    pub(crate) motes: Option<MoteStates>,
    period_ns: u64,
    hears: F,
}

impl<F: FnMut(u64, usize, usize, f64) -> bool> Air<F> {
    pub(crate) fn new(setup: &Setup, hears: F) -> Self {
        let mut swarm = Swarm::default();
        let start = swarm.configure(setup).expect("the configuration is valid");
        let period_ns = setup.experiment.step_ns;
        let (rssi_dbm, motes) = (None, None);
        let states = start.states;
        Self { swarm, states, step: 0, deliveries: None, rssi_dbm, motes, period_ns, hears }
    }

    pub(crate) fn step(&mut self) -> RobotOutput {
        self.step_with(&[])
    }

    pub(crate) fn step_with(&mut self, commands: &[AgentCommand]) -> RobotOutput {
        self.step_held(commands, false)
    }

    pub(crate) fn step_held(&mut self, commands: &[AgentCommand], hold: bool) -> RobotOutput {
        self.step += 1;
        let output = self.swarm.step(&RobotInput {
            step: self.step,
            from_ns: (self.step - 1) * self.period_ns,
            until_ns: self.step * self.period_ns,
            deliveries: self.deliveries.as_ref(),
            motes: self.motes.as_ref(),
            commands,
            hold,
        });
        self.states = output.states.clone();
        self.deliveries = Some(self.broadcast(output.payloads.clone()));
        output
    }

    fn broadcast(&mut self, payloads: Payloads) -> Deliveries {
        let n = self.states.len();
        let position_m = |agent: usize| self.states.position_m(agent);
        let (mut ends, mut indices, mut rssi_dbm) = (Vec::new(), Vec::new(), Vec::new());
        for receiver in 0..n {
            for sender in (0..n).filter(|&sender| sender != receiver) {
                let (a, b) = (position_m(sender), position_m(receiver));
                let distance_m = ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt();
                if (self.hears)(self.step, sender, receiver, distance_m) {
                    indices.push(sender as u32);
                    rssi_dbm.extend(self.rssi_dbm.map(|at| at(distance_m)));
                }
            }
            ends.push(indices.len() as u32);
        }
        let sent_ns = (self.step - 1) * self.period_ns;
        Deliveries {
            transmissions: Transmissions {
                sender: (0..n as u32).collect(),
                sent_ns: vec![sent_ns; n],
                end_ns: vec![sent_ns + 1; n],
                payloads,
                ..Transmissions::default()
            },
            heard: Heard::Lists { ends, indices },
            rssi_dbm,
            ..Deliveries::default()
        }
    }
}

/// The middle one, or the mean of the two middle ones.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    f64::midpoint(values[(n - 1) / 2], values[n / 2])
}
