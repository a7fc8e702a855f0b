//! Measures of a swarm of which only the robots' positions are known.

use super::counts::Counts;
use super::kpi::Kpis;
use super::measures::Measures;
use super::period::Period;
use super::task::Task;
use proto::site::Site;
use proto::types::{AgentStates, Deliveries, MoteStates};

/// Measures of places at ascending times (ns). What is made of velocities is made of differences of places.
pub fn measures_of(task: Task, places: &[(u64, AgentStates)]) -> Option<Measures> {
    let (_, begin) = places.first()?;
    let mut measures = Measures::new(task, Site::default(), begin, Kpis::default());
    let (deliveries, motes) = (Deliveries::default(), MoteStates::default());
    let counts = Counts::from_deliveries(&deliveries, begin.len());
    for (step, pair) in (1..).zip(places.windows(2)) {
        let [(from_ns, before), (time_ns, states)] = pair else { continue };
        let places = [(*from_ns, before), (*time_ns, states)];
        measures.add(&Period::of_places(step, places, (&deliveries, &counts), &motes));
    }
    measures.end();
    Some(measures)
}
