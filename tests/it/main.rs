//! End-to-end tests of the real processes, one binary.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

mod absence;
mod anchors;
mod bad_measurements;
mod bench;
mod breaking_input;
mod catalogue;
mod choices;
mod configs;
mod conformance;
mod contract;
mod corruption;
mod dependencies;
mod determinism;
mod diagnosis;
mod documented;
mod exploration;
mod extension;
mod faults;
mod flocking;
mod formation;
mod formula;
mod fuzz_corpora;
mod given_rssi;
mod interrupts;
mod links;
mod only;
mod orders;
mod packets;
mod packets_missing;
mod packets_split;
mod power;
mod reference;
mod refusals;
mod reports;
mod results;
mod resuming;
mod schemas;
mod simulate;
mod solids;
mod sweeps;
mod task_split;
mod tidy;
mod tls;
mod waiting;
