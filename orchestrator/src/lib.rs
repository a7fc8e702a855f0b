//! Drives co-simulated experiments and records what happened.
//!
//! In reading order:
//!
//! | module | what |
//! |---|---|
//! | [`cli`] | the command line |
//! | [`mod@check`] | what a file of measurements holds, and which effects it can show |
//! | [`starters`] | the experiments that `new` writes |
//! | [`campaign`] | templates of measurement campaigns |
//! | [`mod@demo`] | the loop from measurements to a better model, on a hidden effect |
//! | [`mod@export`] | a run in the formats of other programs |
//! | [`effects`] | the catalogue of physical effects |
//! | [`conformance`] | does a foreign simulator keep the contract? |
//! | [`mod@bench`] | speed through the real processes |

pub mod bench;
pub mod campaign;
pub mod check;
pub mod cli;
pub mod conformance;
pub mod demo;
pub mod effects;
pub mod export;
pub mod starters;
