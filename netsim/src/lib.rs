//! The network simulator: who hears whom.
//!
//! | module | what |
//! |---|---|
//! | [`broadcast`] | propagation only: every payload is broadcast once in every control period |
//! | [`second`] | a broadcast medium beside the main network |
//! | [`sim`] | the simulator as the shell sees it |
//! | [`catalogue`] | what can be chosen by name in it: the lists of scheduling functions, effects, rules and media |
//! | [`config`] | the `[netsim]` section |
//!
//! The radio is the crate `physics`: its models say what arrives where.
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

// Crates with scheduling functions of their own name the physics by it.
pub use physics;

pub mod app;
pub mod broadcast;
pub mod catalogue;
pub mod config;
pub mod dice;
pub mod energy;
pub mod join;
pub mod lowpan;
pub mod mac;
pub mod mesh;
pub mod mote;
pub mod place;
pub mod rpl;
pub mod second;
pub mod sf;
pub mod sim;
pub mod sixtop;
mod timer;
pub mod wire;
