//! The robotsim as a process of its own.
fn main() {}
