//! The swarm as its host sees it: configured, stepped, saved and restored.

#![expect(
    clippy::disallowed_methods,
    reason = "tests hold results against the platform's own functions"
)]

mod absence;
mod air;
mod bodies;
mod config;
mod contacts;
mod controllers;
mod convergence;
mod effects;
mod exploration;
mod extension;
mod flocking;
mod groups;
mod line_formation;
mod reseeding;
mod rigid;
mod swarm;
