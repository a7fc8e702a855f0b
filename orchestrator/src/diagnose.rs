//! Which physical effect is missing: the search, and what it says.
//!
//! | module | what |
//! |---|---|
//! | [`held_out`] | predictions of rows by fits that have not seen them |
//! | [`ladder`] | the search |
//! | [`gain`] | how much better one model predicts than another |
//! | [`next`] | the measurement that would break a tie |
//! | [`progress`] | what a search reports while it works |
//! | [`scan`] | structure that is left over |
//! | [`answer`] | what was found, as JSON and as a table |

pub mod answer;
pub mod gain;
pub mod held_out;
pub mod ladder;
pub mod next;
pub mod progress;
pub mod scan;
