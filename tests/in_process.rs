//! An experiment without processes: the two simulators as plain objects, taking turns in this thread.
//!
//! Thousands of runs take seconds this way. That the processes do the same, to the last bit, is itself under test.

use experiment::{Overrides, Plan, SideConfig, read};
use netsim::sim::Network;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use proto::side::{NetInput, NetSimulator as _, RobotInput, RobotSimulator as _, Setup};
use proto::types::{AgentStates, Coupling, Deliveries, Payloads};
use robotsim::sim::Swarm;
use std::path::Path;

/// Both simulators, and what was exchanged last.
#[derive(Debug)]
pub struct InProcess {
    robots: Swarm,
    network: Network,
    step_ns: u64,
    step: u64,
    /// Where the robots are.
    pub states: AgentStates,
    payloads: Payloads,
    deliveries: Option<Deliveries>,
}

impl InProcess {
    /// Begins the experiment that `toml`, the text of an experiment file, describes, with another seed. It must be
    /// coupled sequentially.
    ///
    /// # Panics
    ///
    /// If the text is refused.
    #[must_use]
    pub fn start(toml: &str, seed: u64) -> Self {
        let overrides = Overrides { seed: Some(seed), ..Overrides::default() };
        let plan = read(Path::new("experiment.toml"), toml.to_owned(), &overrides)
            .unwrap_or_else(|refusal| panic!("{refusal:?}"));
        assert_eq!(plan.experiment.coupling, Coupling::Sequential, "{toml}");
        let (mut robots, mut network) = (Swarm::default(), Network::default());
        let start = robots.configure(&setup(&plan, &plan.robotsim)).expect("checked by the plan");
        network.configure(&setup(&plan, &plan.netsim)).expect("checked by the plan");
        Self {
            robots,
            network,
            step_ns: plan.experiment.step_ns,
            step: 0,
            states: start.states,
            payloads: start.payloads,
            deliveries: None,
        }
    }

    /// A step in sequential coupling: the robots act on what was heard during the period before and move; then the
    /// network runs the period over their new places. Returns whether the robots regard their task as done.
    pub fn step(&mut self) -> bool {
        let from_ns = self.step * self.step_ns;
        let until_ns = from_ns + self.step_ns;
        self.step += 1;
        let reply = self.robots.step(&RobotInput {
            step: self.step,
            from_ns,
            until_ns,
            deliveries: self.deliveries.as_ref(),
            motes: None,
            commands: &[],
            hold: false,
        });
        self.states = reply.states;
        self.payloads = reply.payloads;
        let reply_of_network = self.network.step(&NetInput {
            step: self.step,
            from_ns,
            until_ns,
            states: &self.states,
            payloads: &self.payloads,
            moved_obstacles: &reply.moved_obstacles,
            commands: &[],
            stop_at_first_delivery: false,
            records: &[],
        });
        self.deliveries = Some(reply_of_network.deliveries);
        reply.task_complete
    }

    /// Where the robots are (x, y, z in m, as bits).
    #[must_use]
    pub fn places(&self) -> Vec<[u64; 3]> {
        (0..self.states.len()).map(|i| self.states.position_m(i).map(f64::to_bits)).collect()
    }
}

/// What a side is told over the contract.
fn setup(plan: &Plan, side: &SideConfig) -> Setup {
    let mut problems = Vec::new();
    let site = proto::config::parse(&plan.site_toml).expect("effective text is TOML");
    let (site, _) = proto::site::read(&site, "site", &mut problems);
    assert_eq!(problems, [], "checked by the plan");
    Setup {
        experiment: plan.experiment.clone(),
        site,
        config: proto::config::parse(&side.toml).expect("the plan's text is TOML"),
        path: String::new(),
        files: side.files.clone(),
        columns: Vec::new(),
        records: Vec::new(),
    }
}

/// Places of all robots after every step (x, y, z in m, as bits) that a run recorded, step 0 first.
///
/// # Panics
///
/// If the table of steps cannot be read.
#[must_use]
pub fn recorded_places(dir: &Path) -> Vec<[u64; 3]> {
    let file = std::fs::File::open(dir.join("steps.parquet")).expect("a run leaves its steps");
    let reader = SerializedFileReader::new(file).expect("the table can be read");
    let names = ["x_m", "y_m", "z_m"];
    let rows = reader.get_row_iter(None).expect("the table has rows");
    rows.map(|row| {
        let row = row.expect("a row can be read");
        names.map(|name| {
            let mut columns = row.get_column_iter();
            match columns.find(|(column, _)| *column == name) {
                Some((_, Field::Double(value))) => value.to_bits(),
                other => panic!("{name} is {other:?}"),
            }
        })
    })
    .collect()
}
