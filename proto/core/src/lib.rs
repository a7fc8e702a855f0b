//! The co-simulation contract, and what both simulators must read alike.
//!
//! | module | what |
//! |---|---|
//! | [`v1`] | messages and services generated from `cosim/v1/*.proto` |
//! | [`types`] | the same exchange as valid values: a core never sees a generated message |
//! | [`codec`] | how messages become bytes and back |
//! | [`convert`] | from messages to values, refusing what is malformed, and back |
//! | [`digest`] | the barrier's SHA-256 over the exchanged state |
//! | [`effect`] | what a physical effect says about itself, for readers and for the fit |
//! | [`rng`] | keyed random draws, and the one list of purposes |
//! | [`config`] | configuration as data: one description gives checks, defaults, effective values and JSON Schema |
//! | [`site`] | walls, obstacles and ground: the place both simulators share |
//! | [`side`] | what a simulator is to the shell around it: a plain object |
//! | [`host`] | the shell around a simulator: gRPC, lifecycle, TLS, readiness, shutdown |

pub mod codec;
pub mod config;
pub mod convert;
pub mod digest;
pub mod effect;
pub mod formula;
pub mod host;
pub mod rng;
pub mod side;
pub mod site;
pub mod types;

/// The messages and services of `cosim/v1`. Their documentation is in the `.proto` files.
#[allow(missing_docs, clippy::all, unreachable_pub, reason = "generated code")]
pub mod v1 {
    tonic::include_proto!("cosim.v1");
}

/// The compiled `.proto` files, for reflection and for self-describing records.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/cosim.v1.bin"));

/// Version of the contract that `Describe` states.
pub const CONTRACT_VERSION: u32 = 1;
