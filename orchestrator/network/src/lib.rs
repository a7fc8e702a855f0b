//! The network against measured packets.
//!
//! | module | what |
//! |---|---|
//! | [`tracks`] | where robots were measured |
//! | [`resimulate`] | what a configured network would have done, under a seed |
//! | [`kpis`] | the figures of packets that are compared |
//! | [`spread`] | a measurement against the spread of seeds |
//! | [`compare`], [`comparison`] | a comparison, and its answer |
//! | [`split`], [`error_split`] | whether robots, radio or protocol are wrong, and the answer |
//! | [`task`] | whether what robots did wrong is theirs or the network's |
//! | [`candidates`] | effects that may be missing |
//! | [`likelihood`] | how probable a measurement is under runs |
//! | [`candidate_fits`] | one effect fitted: its parameter, the interval, the gain in log likelihood |
//! | [`search`], [`diagnosis`] | which effects are missing, and the answer |
//! | [`extend`], [`extension`] | a configuration with them added, and the answer |
//!
//! A measurement is one random run of a network. So the question is not how far it lies from the mean of the simulation, but
//! whether it could be one more run of it.

pub mod candidate_fits;
pub mod candidates;
pub mod compare;
pub mod comparison;
pub mod diagnosis;
pub mod error_split;
pub mod extend;
pub mod extension;
pub mod figure;
pub mod kpis;
pub mod likelihood;
pub mod resimulate;
pub mod search;
pub mod split;
pub mod spread;
pub mod task;
pub mod tracks;
