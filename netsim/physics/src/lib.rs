//! Radio physics: one file per effect, pure functions of a described link, and the medium that asks them.
//!
//! | module | what |
//! |---|---|
//! | [`link`], [`end`] | what physics may ask about a link, and about its ends |
//! | [`propagation`] | base models, one file each |
//! | [`effect`] | effects added to them, one file each |
//! | [`scatter`] | what varies at random, and when it is drawn anew |
//! | [`reception`] | from power to the probability of reception, one file per curve |
//! | [`interference`] | what frames that are on the air together do to each other, one file per rule |
//! | [`model`] | all of these together: [`Model::evaluate`] |
//! | [`standard`] | physical layers: bands, channels, bit rates, one file each |
//! | [`timing`] | when things happen within a slot, and how long frames last |
//! | [`sight`] | what stands between two antennas |
//! | [`nearest`] | who is near whom |
//! | [`medium`] | the physics asked for every link that may matter, fast and with the same result |
//! | [`catalogue`] | what can be chosen by name: the lists of models, curves, rules and effects |
//! | [`section`] | the section `[netsim.phy]` |
//! | [`k7`] | traces of link quality |
//! | `memo` | values kept for arguments that return |
//!
//! A running simulation and a comparison with measurements call the same [`Model::evaluate_at`]: the one with the levels
//! it draws, the other over the distribution that [`Model::scatters`] describes. Nothing here
//! knows a protocol: the network simulator is built on this crate, and so are comparisons with measurements.

#![cfg_attr(
    test,
    expect(
        clippy::disallowed_methods,
        reason = "tests hold results against the platform's own functions"
    )
)]

pub mod asn;
pub mod catalogue;
pub mod effect;
pub mod end;
pub mod interference;
pub mod k7;
pub mod link;
pub mod medium;
mod memo;
pub mod model;
pub mod nearest;
pub mod propagation;
pub mod reception;
pub mod scatter;
pub mod section;
pub mod sight;
pub mod standard;
pub mod timing;

pub use link::{Covariates, End, Link, Scene};
pub use model::{LinkBudget, Model};
