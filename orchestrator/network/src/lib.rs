//! The network against measured packets.
//!
//! A question is one call on a [`PacketRequest`]: [`compare()`], [`split()`], [`diagnose()`], [`extend()`]; of a swarm's task,
//! [`mod@task`]. The steps between are private, so that they are put together in one place, `request`.
//!
//! | module | what |
//! |---|---|
//! | [`mod@compare`], [`comparison`] | a comparison, and its answer |
//! | [`mod@split`], [`error_split`] | whether robots, radio or protocol are wrong, and the answer |
//! | [`task`] | whether what robots did wrong is theirs or the network's |
//! | [`diagnosis`] | which effects are missing: the answer |
//! | [`extension`] | an experiment with effects added: the answer |
//! | [`candidates`] | effects that may be missing |
//! | [`tracks`] | where robots were measured |
//! | [`resimulate`] | what a configured network would have done, under a seed |
//! | [`kpis`] | the figures of packets that are compared |
//! | [`spread`] | a measurement against the spread of seeds |
//! | `likelihood` | how probable a measurement is under runs |
//! | `candidate_fits` | one effect fitted: its parameter, the interval, the gain in log likelihood |
//! | `search` | the selection of effects |
//!
//! A measurement is one random run of a network. So the question is not how far it lies from the mean of the simulation, but
//! whether it could be one more run of it.

pub mod candidate_fits;
pub mod candidates;
pub mod compare;
pub mod comparison;
pub mod diagnosis;
pub mod error_split;
mod extend;
pub mod extension;
pub mod figure;
pub mod kpis;
mod likelihood;
mod request;
pub mod resimulate;
mod search;
pub mod split;
pub mod spread;
pub mod task;
pub mod tracks;

pub use extend::NetworkExtendError;
pub use request::{
    ExtendedExperiment, PacketError, PacketFiles, PacketRequest, Worded, compare, diagnose, extend,
    split,
};
pub use search::parameter_text;
