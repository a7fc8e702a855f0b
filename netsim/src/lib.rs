//! The network simulator: who hears whom.
//!
//! | module | what |
//! |---|---|
//! | [`phy`] | radio physics: one file per effect, pure functions of a described link |
//! | [`medium`] | that physics asked for every link that may matter, fast and with the same result |
//! | [`broadcast`] | propagation only: every payload is broadcast once in every control period |
//! | [`second`] | a broadcast medium beside the main network |
//! | [`sim`] | the simulator as the shell sees it |
//! | [`catalogue`] | what can be chosen by name in it: the lists of effects, models and scheduling functions |
//! | [`config`] | the `[netsim]` section |
//! | [`k7`] | traces of link quality |
//!
//! Nothing here knows what a robot is, reads a clock or a file, or opens a socket. The crate `proto-host` serves
//! [`sim::Network`] over gRPC; `netsim/process` is the program that does so.

#![cfg_attr(
    test,
    expect(
        clippy::disallowed_methods,
        reason = "tests hold results against the platform's own functions"
    )
)]

pub mod app;
pub mod broadcast;
pub mod catalogue;
pub mod config;
pub mod dice;
pub mod energy;
pub mod join;
pub mod k7;
pub mod lowpan;
pub mod mac;
pub mod medium;
pub mod mesh;
pub mod mote;
pub mod phy;
pub mod place;
pub mod rpl;
pub mod second;
pub mod sf;
pub mod sim;
pub mod sixtop;
mod timer;
pub mod wire;
