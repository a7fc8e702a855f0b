//! The network against measured packets.
//!
//! A question is one call on a [`PacketRequest`]: [`compare()`], [`split()`], [`diagnose()`], [`extend()`]; or [`task()`] on a
//! [`TaskRequest`]. An [`Observer`](::diagnose::Observer) sees the progress, and may stop the work.
//!
//! | public module | content |
//! |---|---|
//! | [`comparison`] | the answer of [`compare()`] |
//! | [`error_split`] | the answer of [`split()`]: whether robots, radio or protocol cause the error |
//! | [`mod@task`] | the answer of [`task()`]: whether the robots or the network cause the error of a swarm's task |
//! | [`diagnosis`] | the answer of [`diagnose()`]: which effects are missing |
//! | [`extension`] | the answer of [`extend()`]: an experiment with effects added |
//! | [`candidates`] | effects that may be missing |
//! | [`tracks`] | measured positions of robots |
//! | [`resimulate`] | an experiment simulated again under other seeds |
//! | [`kpis`] | the figures of packets that are compared |
//!
//! The steps of an answer are private; `request` puts them together, and `task::request` those about a task:
//!
//! | private module | content |
//! |---|---|
//! | `compare` | packets compared with runs under many seeds |
//! | `spread` | p-values of a measurement among seeds |
//! | `split` | parts of the error |
//! | `likelihood` | density of a measurement under the runs of a model |
//! | `candidate_fits` | one effect fitted: its parameter, the interval, the gain in log likelihood |
//! | `search` | the stepwise selection of effects |
//! | `extend` | the text of the extended experiment |
//!
//! A measurement is one random run of a network. So the question is not how far it lies from the mean of the simulation, but
//! whether it could be one more run of it.

mod candidate_fits;
pub mod candidates;
mod compare;
pub mod comparison;
pub mod diagnosis;
pub mod error_split;
mod extend;
pub mod extension;
mod figure;
pub mod kpis;
mod likelihood;
mod request;
pub mod resimulate;
mod search;
mod split;
mod spread;
pub mod task;
pub mod tracks;

pub use candidate_fits::FittedEffect;
pub use compare::{ComparisonOptions, SeedComparison};
pub use extend::NetworkExtendError;
pub use figure::FigureSpec;
pub use request::{
    ExtendedExperiment, PacketError, PacketFiles, PacketRequest, Worded, compare, diagnose, extend,
    split,
};
pub use search::parameter_text;
pub use split::SplitError;
pub use spread::{FigurePlacement, Placement};
pub use task::request::{TaskError, TaskFiles, TaskRequest, task};
