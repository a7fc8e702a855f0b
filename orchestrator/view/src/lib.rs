//! A run as people look at it: frames of what robots do and what the radio does at the same instant, an overview of the whole run, the
//! page that shows both, and the server of that page.
//!
//! [`frame`] and [`overview`] turn periods into messages (`view.proto`). They are fed from a recording ([`recorded`]), or by a run that
//! lasts ([`live`]). [`page`] makes a page that stands by itself, [`server`] serves one.

mod events;
pub mod frame;
pub mod live;
mod messages;
pub mod overview;
pub mod page;
mod place;
pub mod recorded;
mod run;
mod series;
pub mod server;

pub use messages::{has_bit, view};

#[cfg(test)]
mod tests;
