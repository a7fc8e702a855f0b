//! Which physical effect is missing: the search, and what it says.
//!
//! | module | what |
//! |---|---|
//! | [`ladder`] | the search |
//! | [`answer`] | what was found, as JSON and as a table |

pub mod answer;
pub mod ladder;
