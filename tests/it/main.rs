//! End-to-end tests of the real processes, one binary.

mod configs;
mod contract;
mod determinism;
mod faults;
mod interrupts;
mod refusals;
mod tidy;
mod tls;
