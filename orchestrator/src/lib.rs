//! Drives co-simulated experiments and records what happened.
//!
//! In reading order:
//!
//! | module | what |
//! |---|---|
//! | [`cli`] | the command line |
//! | [`starters`] | the experiments that `new` writes |
//! | [`campaign`] | templates of measurement campaigns |
//! | [`mod@demo`] | the loop from measurements to a better model, on a hidden effect |
//! | [`conformance`] | does a foreign simulator keep the contract? |
//! | [`mod@bench`] | speed through the real processes |

pub mod bench;
pub mod campaign;
pub mod cli;
pub mod conformance;
pub mod demo;
pub mod starters;
