//! The registrar (JRC), at the root: it admits.

use super::{Config, Outgoing};
use crate::lowpan::DropReason;
use crate::wire::Eui64;
use crate::wire::cojp::CojpRepr;
use crate::wire::datagram::code_points;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::net::Ipv6Addr;

/// Index of the key that all motes use.
const KEY_INDEX: u8 = 1;

/// The side of the join protocol that admits.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Registrar {
    config: Config,
    own: Eui64,
    /// Whom it does not admit, ascending.
    denied: Vec<Eui64>,
    /// Whom it has admitted, and when first (ns).
    admitted: BTreeMap<Eui64, u64>,
}

impl Registrar {
    /// A registrar that admits everyone but `denied`.
    #[must_use]
    pub fn new(config: Config, own: Eui64, mut denied: Vec<Eui64>) -> Self {
        denied.sort_unstable();
        Self { config, own, denied, admitted: BTreeMap::new() }
    }

    /// A request has come, from a pledge on the link or through a proxy: the answer. A request that comes again is answered
    /// again, for the first answer may be lost.
    ///
    /// # Errors
    ///
    /// The pledge is not admitted, and hears nothing; or it is no request.
    pub fn handle_request(
        &mut self,
        source: Ipv6Addr,
        request: &CojpRepr,
        now_ns: u64,
    ) -> Result<Outgoing, DropReason> {
        let CojpRepr::Request { message_id, pledge, proxy_state, network_id } = *request else {
            return Err(DropReason::Malformed);
        };
        let is_on_link = source.is_unicast_link_local();
        if proxy_state.is_some() == is_on_link {
            return Err(DropReason::Malformed);
        }
        if network_id != self.config.network_id || self.denied.binary_search(&pledge).is_ok() {
            return Err(DropReason::JoinDenied);
        }
        self.admitted.entry(pledge).or_insert(now_ns);
        let message = CojpRepr::Response {
            message_id,
            pledge,
            proxy_state,
            key_index: KEY_INDEX,
            join_rate_bytes_s: self.config.join_rate_bytes_s,
        };
        let (own, dscp) = if is_on_link {
            (self.own.link_local(), 0)
        } else {
            (self.own.global(), code_points::AF42)
        };
        Ok(Outgoing { source: own, destination: source, dscp, message })
    }

    /// When a mote was first admitted (ns).
    #[must_use]
    pub fn admitted_ns(&self, pledge: Eui64) -> Option<u64> {
        self.admitted.get(&pledge).copied()
    }

    /// How many motes it has admitted.
    #[must_use]
    pub fn n_admitted(&self) -> usize {
        self.admitted.len()
    }
}
