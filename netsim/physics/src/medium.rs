//! Who hears which of the frames of a moment: the physics of the physics of this crate, asked for every link that may matter.
//!
//! | module | what |
//! |---|---|
//! | [`air`] | the radios and frames of a moment, and the judgement of one link |
//! | [`filter`] | bounds on a link's fate from its distance alone, so that few links need the whole computation |
//! | [`jam`] | noise on a channel |
//! | [`judge`] | many links at once, by these bounds |
//! | [`links`] | what arrives where, for frames one at a time |
//! | [`reading`] | what each delivery reads |
//! | [`resolve`] | all links: dense in tiles, or sparse by neighbourhoods |
//! | [`slot`] | the frames of a TSCH slot, which meet each other |
//!
//! The judgement of a link is always `u < p`, with p from [`crate::Model::evaluate_at`] and u the keyed draw of that
//! link. Everything else here only spares work: results are those of the plain double loop, bit for bit, for any number
//! of threads.

pub mod air;
pub mod filter;
pub mod jam;
pub mod judge;
pub mod links;
pub mod reading;
pub mod resolve;
pub mod slot;

pub use air::{Air, Frame, Radios};
pub use filter::Filters;
