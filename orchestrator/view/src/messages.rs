//! The messages of the page, as they are generated.

/// See `view.proto`.
#[expect(clippy::all, clippy::pedantic, reason = "generated from view.proto")]
pub mod view {
    include!(concat!(env!("OUT_DIR"), "/murmuration.view.v1.rs"));
}
