//! The messages of the co-simulation contract, and the border between them and valid values.
//!
//! | module | what |
//! |---|---|
//! | [`v1`] | messages generated from `cosim/v1/*.proto` |
//! | [`convert`] | from messages to values, refusing what is malformed, and back |
//!
//! The services over these messages are in the crate `proto-host`, so that whoever only reads or writes a recording
//! links no server.

pub mod convert;

/// The messages of `cosim/v1`. Their documentation is in the `.proto` files.
#[allow(missing_docs, clippy::all, unreachable_pub, reason = "generated code")]
pub mod v1 {
    include!("../generated/cosim.v1.rs");
}

/// The compiled `.proto` files, for reflection and for self-describing records.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!("../generated/cosim.v1.bin");

/// Version of the contract that `Describe` states.
pub const CONTRACT_VERSION: u32 = 1;
