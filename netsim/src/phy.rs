//! Radio physics: one file per effect, pure functions of a described link.
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
//! | `memo` | values kept for arguments that return |
//!
//! A running simulation and a comparison with measurements call the same [`Model::evaluate_at`]: the one with the levels
//! it draws, the other over the distribution that [`Model::scatters`] describes.

pub mod effect;
pub mod end;
pub mod interference;
pub mod link;
pub(crate) mod memo;
pub mod model;
pub mod nearest;
pub mod propagation;
pub mod reception;
pub mod scatter;
pub mod sight;
pub mod standard;
pub mod timing;

pub use link::{Covariates, End, Link, Scene};
pub use model::{LinkBudget, Model};
