//! The network simulator from outside: probabilities, independence, time, refusals, saving and restoring.

mod broadcast;
mod delivery;
mod harness;
mod independence;
mod pinned;
mod refusals;
mod snapshot;
