//! The shell around a simulator: gRPC service, lifecycle, TLS, readiness and shutdown.
//!
//! [`RobotHost`] and [`NetHost`] turn a [`proto::side`] object into the service of the contract: they check every request
//! before the simulator sees it, count steps, answer a repeated step from memory and compute the digest.
//! [`serve_robots`] and [`serve_network`] put such a service on a listening socket together with health and reflection.

pub mod codec;
mod cores;
mod lifecycle;
mod network;
mod orders;
mod predict;
mod robots;
mod serve;
mod service;
mod snapshot;

pub use cores::{cores, use_threads};
pub use network::NetHost;
pub use orders::{OrdersFromOutside, bearer};
pub use robots::RobotHost;
pub use serve::{
    LISTEN_VARIABLE, Listen, ServeArgs, ServeError, ServeOptions, ignores_hangup, init_logging,
    init_logging_to, serve_network, serve_robots,
};

/// The services of `cosim/v1`: a client and a server of each. Their documentation is in the `.proto` files.
#[allow(missing_docs, clippy::all, unreachable_pub, reason = "generated code")]
pub mod services {
    include!("../generated/cosim.v1.rs");
}

/// The largest message either side decodes (bytes), announced in `Describe`.
pub const MAX_MESSAGE_BYTES: usize = 256 << 20;

/// HTTP/2 flow-control window of a stream (bytes). Smaller than a step's message, every step would wait for updates.
pub const STREAM_WINDOW_BYTES: u32 = 64 << 20;

/// HTTP/2 flow-control window of a connection (bytes).
pub const CONNECTION_WINDOW_BYTES: u32 = 128 << 20;

/// The most that a client reads of the headers of a reply (bytes), in which the details of an error travel. By default it would be
/// 16 KiB, and a reply with more would look like a broken connection.
pub const HEADER_LIST_BYTES: u32 = 1 << 20;

/// Largest HTTP/2 frame (bytes).
pub const FRAME_BYTES: u32 = 1 << 20;
