//! The network simulator: who hears whom.
//!
//! | module | what |
//! |---|---|
//! | [`phy`] | radio physics: one file per effect, pure functions of a described link |
//! | [`medium`] | that physics asked for every link that may matter, fast and with the same result |
//! | [`broadcast`] | propagation only: every payload is broadcast once in every control period |
//! | [`sim`] | the simulator as the shell sees it |
//! | [`config`] | the `[netsim]` section |
//! | [`k7`] | traces of link quality |
//!
//! Nothing here knows what a robot is, reads a clock or a file, or opens a socket: the shell around [`sim::Network`] is
//! `proto::host`.

pub mod broadcast;
pub mod config;
pub mod k7;
pub mod medium;
pub mod phy;
pub mod sim;
