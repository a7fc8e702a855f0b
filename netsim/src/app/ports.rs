//! UDP ports of what motes carry for others: packets of applications and payloads of robots.

/// UDP port of applications (the first one that RFC 6282 compresses to four bits).
pub(crate) const APPLICATION_PORT: u16 = 0xf0b0;
/// UDP port of the swarm's payloads.
pub const SWARM_PORT: u16 = 0xf0b1;
