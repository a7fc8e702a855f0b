//! What a run amounts to: task metrics of the swarm and key figures of the network, computed step by step from what was exchanged.
//!
//! | module | what |
//! |---|---|
//! | [`arrangement`] | where robots are at one moment: shapes, spread, coverage |
//! | [`headline`] | the figures that a run leads with, for each goal of its robots |
//! | [`period`] | one control period, as metrics see it |
//! | [`contacts`] | which robots collide with each other |
//! | [`counts`] | who heard whom in a period |
//! | [`measures`] | everything that is measured of a run, over time |
//! | [`task`] | what the swarm was to do, and when that counts as done |
//! | [`swarm`] | order, cohesion, distances and other figures of the swarm |
//! | [`figures`] | figures by name, as summaries have them |
//! | [`task_figures`] | the figures of a task: meaning, when they are null, which direction is better |
//! | [`lines`] | how straight a line formation is |
//! | [`solids`] | collisions with walls and obstacles |
//! | [`kpi`] | delivery, latency, hops and energy of the network |
//! | [`distances`] | delivery over distance |
//! | [`hearing`] | who heard whom when, thinned for pictures |
//! | [`trajectories`] | the ways of the robots, thinned for pictures |
//! | [`places`] | measures of a swarm of which only positions are known |

pub mod arrangement;
pub mod contacts;
pub mod counts;
pub mod distances;
pub mod figures;
pub mod headline;
pub mod hearing;
pub mod kpi;
pub mod lines;
pub mod measures;
pub mod period;
pub mod places;
pub mod solids;
pub mod swarm;
pub mod task;
pub mod task_figures;
pub mod trajectories;

pub use distances::DistanceBin;
pub use kpi::{Applications, BATTERY_MAH, Kpis};
pub use measures::{Measures, Sample};
pub use task::{Passage, Task};
pub use trajectories::Trajectories;
