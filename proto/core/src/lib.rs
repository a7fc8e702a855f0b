//! What both simulators must read alike. Nothing here knows a message, a socket, a thread or a clock.
//!
//! | module | what |
//! |---|---|
//! | [`types`] | what crosses between the simulators, as valid values: a core never sees a generated message |
//! | [`exchange`] | calls and replies, whole, as valid values |
//! | [`digest`] | the barrier's SHA-256 over the exchanged state |
//! | [`effect`] | what a physical effect says about itself, for readers and for the fit |
//! | [`formula`] | expressions that users write in place of a number |
//! | [`prediction`] | recorded commands and initial states, and where a robot simulator says that they lead |
//! | [`rng`] | keyed random draws, and the one list of purposes |
//! | [`bounds`] | bounds on what is read, each once |
//! | [`config`] | configuration as data: one description gives checks, defaults, effective values and JSON Schema |
//! | [`site`] | walls, obstacles and ground: the place both simulators share |
//! | [`ids`], [`time`] | numbers of agents and motes, moments and durations: types that cannot be mixed up |
//! | [`side`] | what a simulator is to the shell around it: a plain object |
//!
//! The messages of the contract are in the crate `proto-messages`, the shell that serves a simulator in `proto-host`.

#![cfg_attr(
    test,
    expect(
        clippy::disallowed_methods,
        reason = "tests hold results against the platform's own functions"
    )
)]

extern crate self as proto;

pub mod bounds;
pub mod config;
pub mod digest;
pub mod effect;
pub mod exchange;
pub mod formula;
pub mod ids;
pub mod prediction;
pub mod rng;
pub mod side;
pub mod site;
pub mod time;
pub mod types;
