//! The texts of refusals.
