//! The messages of the page, as they are generated.

/// Whether a bitmap of a message has the bit of an agent; an empty one, of what is not known, has all.
#[must_use]
pub fn has_bit(bitmap: &[u8], agent: usize) -> bool {
    bitmap.is_empty() || bitmap.get(agent / 8).is_some_and(|byte| byte >> (agent % 8) & 1 == 1)
}

/// See `view.proto`.
#[expect(clippy::all, clippy::pedantic, reason = "generated from view.proto")]
pub mod view {
    include!("../generated/murmuration.view.v1.rs");
}
