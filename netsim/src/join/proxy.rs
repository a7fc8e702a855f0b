//! A mote that passes requests and responses on, and remembers nothing: what it needs for the way back travels with the
//! request (RFC 9031, § 7; RFC 8974).

use super::{Config, Outgoing};
use crate::lowpan::DropReason;
use crate::wire::Eui64;
use crate::wire::cojp::CojpRepr;
use crate::wire::datagram::code_points;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::net::Ipv6Addr;

/// The side of the join protocol in between.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Proxy {
    config: Config,
    own: Eui64,
    /// The join rate from the registrar.
    join_rate_bytes_s: Option<u32>,
    /// When all that was forwarded would have been sent at the mean rate.
    spent_until: SimTime,
}

impl Proxy {
    /// A proxy that has forwarded nothing.
    #[must_use]
    pub fn new(config: Config, own: Eui64) -> Self {
        Self { config, own, join_rate_bytes_s: None, spent_until: SimTime::START }
    }

    /// The registrar has sent the mean rate to forward (bytes per second); `None`: it has sent none.
    pub(crate) fn set_join_rate(&mut self, bytes_s: Option<u32>) {
        self.join_rate_bytes_s = bytes_s;
    }

    /// A pledge on the link asks: what to send to the registrar at `root`; `None`: this mote is in no DODAG.
    ///
    /// # Errors
    ///
    /// There is no way to the registrar, more than the join rate allows was forwarded, or it is no request of a pledge.
    pub(crate) fn handle_request(
        &mut self,
        source: Ipv6Addr,
        request: &CojpRepr,
        root: Option<Ipv6Addr>,
        now: SimTime,
    ) -> Result<Outgoing, DropReason> {
        if !source.is_unicast_link_local() {
            return Err(DropReason::Malformed);
        }
        let mut message = request.clone();
        let proxy_state = match &mut message {
            // Only the registrar reads for which network a protected one is.
            CojpRepr::ProtectedRequest { proxy_state, .. } => proxy_state,
            CojpRepr::Request { network_id, .. } if *network_id != self.config.network_id => {
                return Err(DropReason::JoinDenied);
            }
            CojpRepr::Request { proxy_state, .. } => proxy_state,
            CojpRepr::Response { .. } | CojpRepr::ProtectedResponse { .. } => {
                return Err(DropReason::Malformed);
            }
        };
        if proxy_state.is_some() {
            return Err(DropReason::Malformed);
        }
        *proxy_state = Some(Eui64::of_ip(source));
        let destination = root.ok_or(DropReason::NoRoute)?;
        self.spend(message.buffer_len(), now)?;
        Ok(Outgoing { source: self.own.global(), destination, dscp: code_points::AF43, message })
    }

    /// The registrar answers: what to send to the pledge.
    ///
    /// # Errors
    ///
    /// It is no response for a pledge on the link.
    pub(crate) fn handle_response(&self, response: &CojpRepr) -> Result<Outgoing, DropReason> {
        let mut message = response.clone();
        let (CojpRepr::Response { proxy_state, .. }
        | CojpRepr::ProtectedResponse { proxy_state, .. }) = &mut message
        else {
            return Err(DropReason::Malformed);
        };
        let to = proxy_state.take().ok_or(DropReason::Malformed)?;
        let (source, destination) = (self.own.link_local(), to.link_local());
        Ok(Outgoing { source, destination, dscp: 0, message })
    }

    /// A token bucket, kept as the time at which it is full again.
    fn spend(&mut self, bytes: usize, now: SimTime) -> Result<(), DropReason> {
        let (takes, most) = match self.join_rate_bytes_s.map(u64::from) {
            None => (REQUEST_PERIOD, REQUEST_PERIOD),
            Some(0) => return Err(DropReason::JoinRateExceeded),
            Some(rate) => {
                let takes = SimDuration::SECOND * bytes as u64 / rate;
                let most = match self.config.join_burst_bytes {
                    Some(most) => SimDuration::SECOND * u64::from(most) / rate,
                    None => MEASURED.max(takes),
                };
                (takes, most)
            }
        };
        let spent_until = self.spent_until.max(now) + takes;
        if now + most < spent_until {
            return Err(DropReason::JoinRateExceeded);
        }
        self.spent_until = spent_until;
        Ok(())
    }
}

/// Without a join rate, time between requests that are forwarded: RFC 9031, § 6.1.
const REQUEST_PERIOD: SimDuration = SimDuration::from_s(3);
/// Over how long a join rate is a mean: RFC 9031, § 7.2, ACK_TIMEOUT.
const MEASURED: SimDuration = SimDuration::from_s(10);
