//! Which physical effect is missing: the search, and what it says.

pub mod ladder;
