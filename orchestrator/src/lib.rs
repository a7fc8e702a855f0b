//! The command line of a program that drives co-simulated experiments and records what happened.

pub mod cli;
