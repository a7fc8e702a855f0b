//! The network simulator from outside: probabilities, independence, time, refusals, saving and restoring.

#![expect(
    clippy::disallowed_methods,
    reason = "tests hold results against the platform's own functions, and read files and the environment"
)]

mod batteries;
mod blacklist;
mod broadcast;
mod conformance;
mod crowds;
mod delivery;
mod extension;
mod frames;
mod harness;
mod independence;
mod invariants;
mod mesh_snapshot;
mod model;
mod oracle;
mod payloads;
mod pinned;
mod pinned_mesh;
mod refusals;
mod reseeding;
mod second_medium;
mod snapshot;
mod sotdma;
mod standards;
