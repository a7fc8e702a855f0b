//! The registrar (JRC), at the root: it admits.

use super::{Config, Outgoing};
use crate::lowpan::DropReason;
use crate::wire::Eui64;
use crate::wire::cojp::CojpRepr;
use crate::wire::datagram::code_points;
use crate::wire::oscore::Context;
use proto::time::SimTime;
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
    /// Whom it has admitted, and when first.
    admitted: BTreeMap<Eui64, SimTime>,
    /// Sender sequence numbers of protected requests.
    seen: BTreeMap<Eui64, ReplayWindow>,
}

/// Which sender sequence numbers of a pledge are known: the greatest, and which of the 32 up to it (RFC 8613, § 7.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct ReplayWindow {
    greatest: u32,
    /// Bit n: `greatest` − n.
    seen: u32,
}

impl ReplayWindow {
    /// Notes a number; returns whether it is new. Numbers before the window are not.
    fn note(&mut self, sequence: u32) -> bool {
        if self.greatest < sequence {
            self.seen = self.seen.checked_shl(sequence - self.greatest).unwrap_or(0);
            self.greatest = sequence;
        }
        let Some(bit) = 1_u32.checked_shl(self.greatest - sequence) else { return false };
        let is_new = self.seen & bit == 0;
        self.seen |= bit;
        is_new
    }
}

impl Registrar {
    /// A registrar that admits everyone but `denied`.
    #[must_use]
    pub fn new(config: Config, own: Eui64, mut denied: Vec<Eui64>) -> Self {
        denied.sort_unstable();
        Self { config, own, denied, admitted: BTreeMap::new(), seen: BTreeMap::new() }
    }

    /// A request has come, from a pledge on the link or through a proxy: the answer. A request that comes again is answered
    /// again, for the first answer may be lost.
    ///
    /// # Errors
    ///
    /// The pledge is not admitted, and hears nothing; it is no request; or, in a secured network, it is not authentic or
    /// was answered before.
    pub(crate) fn handle_request(
        &mut self,
        source: Ipv6Addr,
        request: &CojpRepr,
        now: SimTime,
    ) -> Result<Outgoing, DropReason> {
        let plain;
        let mut protection = None;
        let request = match (request, self.config.security) {
            (CojpRepr::ProtectedRequest { pledge, sequence, .. }, Some(security)) => {
                let context = Context::of_registrar(&security.join_key, *pledge);
                plain = request.unprotect_request(&context).ok_or(DropReason::JoinDenied)?;
                if !self.seen.entry(*pledge).or_default().note(*sequence) {
                    return Err(DropReason::Duplicate);
                }
                protection = Some((context, *sequence));
                &plain
            }
            (_, Some(_)) => return Err(DropReason::JoinDenied),
            (_, None) => request,
        };
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
        self.admitted.entry(pledge).or_insert(now);
        let mut message = CojpRepr::Response {
            message_id,
            pledge,
            proxy_state,
            key_index: KEY_INDEX,
            keys: self.config.security.map(|security| security.keys),
            join_rate_bytes_s: self.config.join_rate_bytes_s,
        };
        if let Some((context, sequence)) = protection {
            message = message.protect(&context, sequence);
        }
        let (own, dscp) = if is_on_link {
            (self.own.link_local(), 0)
        } else {
            (self.own.global(), code_points::AF42)
        };
        Ok(Outgoing { source: own, destination: source, dscp, message })
    }

    /// When a mote was first admitted.
    #[must_use]
    pub fn admitted(&self, pledge: Eui64) -> Option<SimTime> {
        self.admitted.get(&pledge).copied()
    }

    /// How many motes it has admitted.
    #[must_use]
    pub fn n_admitted(&self) -> usize {
        self.admitted.len()
    }
}
