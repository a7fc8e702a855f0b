//! End-to-end.
#[test]
fn placeholder() {}
