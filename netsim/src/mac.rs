//! Time-slotted channel hopping: IEEE Std 802.15.4-2015, clause 6, as RFC 8180 uses it.
//!
//! | module | what |
//! |---|---|
//! | [`tsch`] | the MAC of one mote |
//! | [`schedule`] | slotframes and cells |
//! | [`queue`] | frames that wait |
//! | [`kind`] | what frames are for |
//! | [`backoff`] | waiting after a failure in a shared cell |
//! | [`blacklist`] | channels that a link skips |
//! | [`neighbours`] | whom a mote has heard; duplicates |
//! | [`clock`] | drift and correction |
//! | [`effect`] | what burdens motes beyond what the protocols expect |
//! | [`ration`] | airtime that is rationed |

pub mod backoff;
pub mod blacklist;
pub mod clock;
pub mod effect;
pub mod kind;
pub mod neighbours;
pub mod queue;
pub mod ration;
pub mod schedule;
pub mod tsch;

pub use schedule::{Cell, CellKind, CellOptions, CellRef, Schedule, Slotframe};
pub use tsch::Tsch;
