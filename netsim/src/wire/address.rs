//! Link-layer addresses, and the IPv6 addresses derived from them.

use proto::ids::MoteId;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::net::Ipv6Addr;

/// A 64-bit extended address. Broadcast is not one of them: where it is meant, an `Option` is `None`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Eui64(pub u64);

/// Prefix of all global addresses: fd00::/64.
pub const GLOBAL_PREFIX: u64 = 0xfd00_0000_0000_0000;
/// fe80::/64.
pub(crate) const LINK_LOCAL_PREFIX: u64 = 0xfe80_0000_0000_0000;
/// The universal/local bit of an EUI-64.
const UNIVERSAL_LOCAL: u64 = 0x0200_0000_0000_0000;
/// All nodes on the link: what swarms broadcast to.
pub const ALL_NODES: Ipv6Addr = Ipv6Addr::new(0xff02, 0, 0, 0, 0, 0, 0, 1);
/// All RPL nodes (RFC 6550, § 6).
pub const ALL_RPL_NODES: Ipv6Addr = Ipv6Addr::new(0xff02, 0, 0, 0, 0, 0, 0, 0x1a);

impl Eui64 {
    /// The default address of a mote: 02-00-00-00-00-00-00-00 plus its number; mote 0 has 02-00-00-00-00-01-00-00.
    #[must_use]
    pub fn of_mote(mote: MoteId) -> Self {
        let low = if mote == MoteId(0) {
            0x1_0000
        } else if mote < MoteId(0x1_0000) {
            u64::from(mote.0)
        } else {
            0x1_0000_0000 | u64::from(mote.0)
        };
        Self(UNIVERSAL_LOCAL | low)
    }

    /// The interface identifier: the EUI-64 with its universal/local bit inverted (RFC 4291, appendix A).
    #[must_use]
    pub(crate) fn interface_id(self) -> u64 {
        self.0 ^ UNIVERSAL_LOCAL
    }

    /// The address under a 64-bit prefix.
    #[must_use]
    pub fn under(self, prefix: u64) -> Ipv6Addr {
        Ipv6Addr::from_bits(u128::from(prefix) << 64 | u128::from(self.interface_id()))
    }

    /// fe80::/64.
    #[must_use]
    pub fn link_local(self) -> Ipv6Addr {
        self.under(LINK_LOCAL_PREFIX)
    }

    /// fd00::/64.
    #[must_use]
    pub fn global(self) -> Ipv6Addr {
        self.under(GLOBAL_PREFIX)
    }

    /// The link-layer address from which a unicast address was derived.
    #[must_use]
    pub(crate) fn of_ip(address: Ipv6Addr) -> Self {
        Self(address.to_bits() as u64 ^ UNIVERSAL_LOCAL)
    }

    /// Octets as they are written, most significant first.
    #[must_use]
    pub fn octets(self) -> [u8; 8] {
        self.0.to_be_bytes()
    }
}

impl fmt::Display for Eui64 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d, e, g, h, i] = self.octets();
        write!(f, "{a:02x}-{b:02x}-{c:02x}-{d:02x}-{e:02x}-{g:02x}-{h:02x}-{i:02x}")
    }
}
