//! What every part of the orchestrator does with numbers: summarise samples, maximise functions, and write values for people.
//!
//! Each definition exists once, here, and says what it does with no values, with one, and with NaN.

pub mod format;
pub mod layout;
pub mod normal;
pub mod optimise;
pub mod power;
pub mod quantity;
pub mod statistics;
pub mod ticks;
