//! Which physical effect is missing: the search, and what it says.
//!
//! | module | what |
//! |---|---|
//! | [`ladder`] | the search |
//! | [`gain`] | how much better one model predicts than another |
//! | [`next`] | the measurement that would break a tie |
//! | [`scan`] | structure that is left over |
//! | [`formula`] | a short formula for it |
//! | [`answer`] | what was found, as JSON and as a table |

pub mod answer;
pub mod formula;
pub mod gain;
pub mod ladder;
pub mod next;
pub mod scan;
