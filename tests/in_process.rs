//! An experiment without processes: the two simulators as plain objects, driven as processes are.
//!
//! Thousands of runs take seconds this way. That the processes do the same, to the last bit, is itself under test.

use drive::coupling::{Coupled, StepPlan};
use drive::peer::{InProcess as Direct, NetworkSide, Peer, RobotSide, ready};
use drive::{ConfigureRequests, Wanted, configure};
use experiment::{Overrides, read};
use netsim::sim::Network as BuiltInNetwork;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use proto::types::{AgentStates, Coupling};
use robotsim::sim::Swarm;
use std::path::Path;

/// Both simulators in step.
pub struct InProcess {
    coupled: Coupled<Direct<Swarm>, Direct<BuiltInNetwork>>,
    step_ns: u64,
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
        let mut robots = Direct::robots(Swarm::default());
        let mut network = Direct::network(BuiltInNetwork::default());
        let asked = ConfigureRequests::from_plan(
            &plan,
            Peer::<RobotSide>::described(&robots),
            Peer::<NetworkSide>::described(&network),
            Wanted::Nothing,
        );
        let made = ready(configure(asked, &mut robots, &mut network)).expect("checked by the plan");
        let step_ns = plan.experiment.step_ns;
        let (start, network_start) = (&made.robots_start, &made.network_start);
        let coupled = Coupled::new(robots, network, plan.experiment, start, network_start);
        Self { coupled, step_ns }
    }

    /// A step. Returns whether the robots regard their task as done.
    ///
    /// # Panics
    ///
    /// If a simulator fails.
    pub fn step(&mut self) -> bool {
        let until_ns = self.coupled.time_ns() + self.step_ns;
        let plan = StepPlan { until_ns, ..StepPlan::default() };
        let outcome = ready(self.coupled.advance(plan)).expect("checked input is obeyed");
        outcome.task_complete()
    }

    /// Where the robots are.
    #[must_use]
    pub fn states(&self) -> &AgentStates {
        self.coupled.states()
    }

    /// Where the robots are (x, y, z in m, as bits).
    #[must_use]
    pub fn places(&self) -> Vec<[u64; 3]> {
        let states = self.states();
        (0..states.len()).map(|i| states.position_m(i).map(f64::to_bits)).collect()
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
