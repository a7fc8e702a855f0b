//! Drives co-simulated experiments and records what happened.
//!
//! In reading order:
//!
//! | module | what |
//! |---|---|
//! | [`cli`] | the command line |
//! | [`run`] | one experiment from file to results |
//! | [`mod@sweep`] | many experiments that differ in what a sweep says |
//! | [`mod@compare_runs`] | what changed from one run, or one sweep, to another |
//! | [`mod@check`] | what a file of measurements holds, and which effects it can show |
//! | [`starters`] | the experiments that `new` writes |
//! | [`campaign`] | templates of measurement campaigns |
//! | [`mod@demo`] | the loop from measurements to a better model, on a hidden effect |
//! | [`mod@export`] | a run in the formats of other programs |
//! | [`effects`] | the catalogue of physical effects |
//! | [`conformance`] | does a foreign simulator keep the contract? |
//! | [`mod@bench`] | speed through the real processes |
//! | [`console`] | what a person reads while it works |

pub mod bench;
pub mod campaign;
pub mod check;
pub mod cli;
pub mod compare_runs;
pub mod conformance;
pub mod console;
pub mod demo;
pub mod effects;
pub mod export;
pub mod starters;
pub mod sweep;

pub use run;
