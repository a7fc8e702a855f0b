//! Rules for pages, sources and dependencies.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

mod dependencies;
mod prose;
mod thresholds;
mod tidy;
