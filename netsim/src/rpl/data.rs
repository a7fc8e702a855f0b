//! Where datagrams go, and whether they go in circles: RFC 6550, § 11.2.

use super::objective::INFINITE_RANK;
use super::routes::Via;
use super::{Mode, Rpl};
use crate::dice::Dice;
use crate::wire::Eui64;
use crate::wire::datagram::{RpiRepr, SourceRoute};
use crate::wire::rpl::RplMessage;
use proto::time::SimTime;
use serde::{Deserialize, Serialize};
use std::net::Ipv6Addr;

/// The way of a datagram.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Route {
    /// The destination is on the link.
    Neighbour(Eui64),
    /// To the parent.
    Up(Eui64),
    /// To a child.
    Down(Eui64),
    /// To a child, with a source route (RFC 6554).
    Source {
        /// The first hop.
        first_hop: Eui64,
        /// All hops, the first one and the destination included.
        route: SourceRoute,
    },
}

/// What to do with a datagram that has come from a neighbour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ForwardingDecision {
    /// It may go on, or is for this mote.
    Forward,
    /// There is no route further down: back to this neighbour, with the F flag (RFC 6550, § 11.2.2.3).
    Return(Eui64),
    /// It goes no further.
    Drop(DropReason),
}

/// Why a datagram goes no further.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum DropReason {
    /// The second time that direction and ranks disagreed: a loop.
    RankError,
    /// It came back, and there is no other way down.
    ForwardingError,
    /// It belongs to another instance, or this mote to no DODAG.
    NotInDodag,
}

impl Rpl {
    /// The RPL packet information of a datagram that begins here (RFC 6550, § 11.2.2.1); `None` outside a DODAG.
    #[must_use]
    pub fn rpi(&self, down: bool) -> Option<RpiRepr> {
        let (rank_error, forwarding_error) = (false, false);
        let (instance, sender_rank) = (self.config.instance, self.sender_rank()?);
        Some(RpiRepr { down, rank_error, forwarding_error, instance, sender_rank })
    }

    /// The way to a destination from here; `None`: there is none.
    #[must_use]
    pub fn route(&self, destination: Ipv6Addr) -> Option<Route> {
        if destination.is_unicast_link_local() {
            return Some(Route::Neighbour(Eui64::of_ip(destination)));
        }
        let dodag = self.dodag.as_ref()?;
        if let Some(parent) = dodag.parent {
            return Some(match self.next_hop_down(destination) {
                Some(child) => Route::Down(child),
                None => Route::Up(parent),
            });
        }
        if dodag.mode() == Some(Mode::Storing) {
            return self.next_hop_down(destination).map(Route::Down);
        }
        let hops = self.routes.source_route(dodag.id, destination)?;
        let first_hop = Eui64::of_ip(*hops.first()?);
        Some(match hops.len() {
            1 => Route::Down(first_hop),
            _ => {
                let route = SourceRoute { root: dodag.id, hops, tunnel_hop_limit: None };
                Route::Source { first_hop, route }
            }
        })
    }

    /// A datagram has come from `from` for `destination`, by a source route or not. Checks its packet information for
    /// loops, and brings it up to date for the next hop.
    pub(crate) fn handle_data(
        &mut self,
        rpi: &mut RpiRepr,
        from: Eui64,
        destination: Ipv6Addr,
        is_source_routed: bool,
        now: SimTime,
        dice: &mut Dice,
    ) -> ForwardingDecision {
        let Some(dodag) = self.dodag.as_ref().filter(|_| rpi.instance == self.config.instance)
        else {
            if !rpi.down && rpi.instance == self.config.instance {
                self.tell(from);
            }
            return ForwardingDecision::Drop(DropReason::NotInDodag);
        };
        let mode = dodag.mode();
        let (sender, own) = (dodag.dag_rank(rpi.sender_rank), dodag.dag_rank(dodag.rank));
        let parent = dodag.parent;
        if rpi.forwarding_error {
            return self.handle_returned(rpi, from, destination, now);
        }
        let is_known = rpi.sender_rank != 0;
        let is_wrong = if rpi.down {
            is_known && own < sender
        } else {
            (is_known && sender < own) || parent == Some(from)
        };
        if is_wrong && rpi.rank_error {
            self.reset_trickle(now, dice);
            if !rpi.down {
                if parent == Some(from) {
                    self.distrust(from, now, dice);
                }
                self.tell(from);
            }
            return ForwardingDecision::Drop(DropReason::RankError);
        }
        if is_wrong {
            rpi.rank_error = true;
            if !rpi.down {
                self.tell(from);
            }
        } else if !rpi.down {
            self.refresh_child(from, now);
        }
        rpi.sender_rank = self.sender_rank().unwrap_or_default();
        if is_source_routed || self.address() == Some(destination) {
            return ForwardingDecision::Forward;
        }
        // Where a datagram turns round, at the common ancestor or the root, the direction that it is expected in changes.
        let is_storing = mode == Some(Mode::Storing);
        let goes_down =
            self.next_hop_down(destination).is_some() || (parent.is_none() && !is_storing);
        if is_storing && rpi.down && !goes_down {
            rpi.forwarding_error = true;
            return ForwardingDecision::Return(from);
        }
        rpi.down |= goes_down;
        ForwardingDecision::Forward
    }

    /// A neighbour routes upwards through this mote although this mote's rank is not lower: it has missed a DIO, or the two are
    /// each other's parents. A unicast DIO gives it the present rank, as in Contiki-NG; a multicast DIO is not acknowledged and
    /// may be lost again.
    fn tell(&mut self, neighbour: Eui64) {
        if self.config.stale_rank {
            return;
        }
        let instance = self.config.instance;
        let left = self.past.last().map(|past| past.dodag.dio(instance, INFINITE_RANK));
        if let Some(dio) = self.current_dio().or(left) {
            self.send_alone(neighbour, RplMessage::Dio(dio));
        }
    }

    /// A datagram that went down comes back (RFC 6550, § 11.2.2.3): the route was wrong. Without another one, it goes back
    /// further, to where it came from.
    fn handle_returned(
        &mut self,
        rpi: &mut RpiRepr,
        from: Eui64,
        destination: Ipv6Addr,
        now: SimTime,
    ) -> ForwardingDecision {
        if self.next_hop_down(destination) == Some(from)
            && let Some(entry) = self.routes.remove(destination)
        {
            self.withdraw(&[(destination, entry.path_sequence)], now);
        }
        rpi.sender_rank = self.sender_rank().unwrap_or_default();
        if self.next_hop_down(destination).is_some() {
            rpi.forwarding_error = false;
            return ForwardingDecision::Forward;
        }
        match self.parent() {
            Some(parent) if parent != from => ForwardingDecision::Return(parent),
            _ => ForwardingDecision::Drop(DropReason::ForwardingError),
        }
    }

    /// The parent sends up what was sent up to it: it routes through this mote. It is no parent before its next DIO.
    fn distrust(&mut self, parent: Eui64, now: SimTime, dice: &mut Dice) {
        if let Some(neighbour) = self.neighbours.get_mut(parent) {
            neighbour.dio.rank = INFINITE_RANK;
            self.select(now, dice);
        }
    }

    fn next_hop_down(&self, destination: Ipv6Addr) -> Option<Eui64> {
        match self.routes.get(destination)?.via {
            Via::Neighbour(neighbour) => Some(neighbour),
            Via::Parent(_) => None,
        }
    }

    /// Own rank in whole hops, as it travels with datagrams (RFC 6550, § 11.2: DAGRank). In a rank's place rather than
    /// as a small number, so that one octet of it is zero and can be left out (RFC 8138, § 6.2).
    fn sender_rank(&self) -> Option<u16> {
        let dodag = self.dodag.as_ref()?;
        let hop = dodag.configuration.min_hop_rank_increase.max(1);
        Some(dodag.rank / hop * hop)
    }
}
