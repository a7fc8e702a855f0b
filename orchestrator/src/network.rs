//! The network against measured packets.
//!
//! | module | what |
//! |---|---|
//! | [`tracks`] | where robots were measured |
//! | [`replay`] | what a configured network would have done, under a seed |
//! | [`kpis`] | the figures of packets that are compared |
//! | [`spread`] | a measurement against the spread of seeds |
//! | [`compared`] | a comparison |
//!
//! A measurement is one run of a network whose chances fell in one way. So it is not held against the mean of the
//! simulation, but asked whether it could be one more of its runs.

pub mod compared;
pub mod kpis;
pub mod replay;
pub mod spread;
pub mod tracks;
