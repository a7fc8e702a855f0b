//! Another way for datagrams whose way has failed, as packets are salvaged in DSR (RFC 4728, § 3.4.1): for motes that move.

use super::{Mote, World};
use crate::lowpan::{DropReason, Mode};
use crate::mac::queue::Queued;
use crate::rpl::Route;
use crate::wire::Eui64;
use crate::wire::datagram::Datagram;
use crate::wire::fragment::LowpanRepr;
use crate::wire::frame::Content;

/// The datagram of a frame that carries all of it.
fn whole(frame: &Queued) -> Option<&Datagram> {
    match &frame.frame.content {
        Content::Lowpan(LowpanRepr::Whole(datagram)) => Some(datagram),
        _ => None,
    }
}

impl Mote {
    /// The datagram of a frame, where the mote has all of it, and the next hop no part: it came whole, was put together here, or was
    /// made here, and the frame is its first. Parts that had gone on would be given up where they are.
    fn held<'a>(&self, world: &World<'_>, frame: &'a Queued) -> Option<&'a Datagram> {
        let Content::Lowpan(LowpanRepr::First(part)) = &frame.frame.content else {
            return whole(frame);
        };
        let is_put_together = world.settings.lowpan.mode == Mode::PerHopReassembly;
        let is_own = part.datagram.source == self.address.global();
        // Where another part was dropped here, the datagram was given up.
        let is_whole = (is_put_together || is_own) && world.packets.goes_on(frame.packet);
        is_whole.then_some(&*part.datagram)
    }

    /// A new parent: what waits for another neighbour on its way up goes through this one.
    pub(super) fn reroute_upward(&mut self, world: &mut World<'_>, parent: Eui64) {
        if !world.settings.mobility.reroute {
            return;
        }
        let Self { mac, rpl, .. } = self;
        let waiting = mac.take_where(|frame| {
            frame.destination().is_some_and(|to| to != parent)
                && !frame.has_arrived
                && whole(frame).is_some_and(|datagram| {
                    datagram.route.is_none()
                        && matches!(rpl.route(datagram.destination), Some(Route::Up(_)))
                })
        });
        for frame in waiting {
            let left = frame.destination();
            self.tally.drop_frame(DropReason::Withdrawn, false);
            self.send_anew(world, &frame, Some(parent));
            if let Some(neighbour) = left {
                self.left_queue(world, neighbour);
            }
        }
    }

    /// A frame was not acknowledged often enough: sends its datagram on another way, if there is one. Returns whether there is.
    pub(super) fn reroute_failed(&mut self, world: &mut World<'_>, frame: &Queued) -> bool {
        if !world.settings.mobility.reroute || frame.has_arrived {
            return false;
        }
        let Some(datagram) = self.held(world, frame) else { return false };
        if datagram.hop_limit <= 1 || datagram.destination.is_multicast() {
            return false;
        }
        let failed = frame.destination();
        if datagram.route.is_some() {
            // Down: back to the root, which may know a newer way. The root itself sends what has failed once more.
            let up = match self.rpl.route(datagram.destination) {
                Some(Route::Up(parent)) => Some(parent),
                Some(Route::Source { first_hop, .. }) if Some(first_hop) != failed => None,
                _ => return false,
            };
            self.withdraw_parts(frame);
            self.send_anew(world, frame, up);
            return true;
        }
        match self.rpl.route(datagram.destination) {
            Some(Route::Up(parent)) if Some(parent) != failed => {
                self.withdraw_parts(frame);
                self.send_anew(world, frame, Some(parent));
                true
            }
            _ => false,
        }
    }

    /// The other parts of the datagram of a frame do not go where that has failed.
    fn withdraw_parts(&mut self, failed: &Queued) {
        let Content::Lowpan(LowpanRepr::First(part)) = &failed.frame.content else { return };
        let others = self.mac.take_where(|other| match &other.frame.content {
            Content::Lowpan(LowpanRepr::Next(other_part)) => {
                other.destination() == failed.destination() && other_part.tag == part.tag
            }
            _ => false,
        });
        for other in &others {
            self.tally.drop_frame(DropReason::Withdrawn, other.has_arrived);
        }
    }

    /// Sends the datagram of a frame as if it had come just now. It has one hop less to go.
    fn send_anew(&mut self, world: &mut World<'_>, frame: &Queued, next_hop: Option<Eui64>) {
        let Some(datagram) = self.held(world, frame) else { return };
        let mut datagram = datagram.clone();
        datagram.route = None;
        datagram.rpi = None;
        datagram.hop_limit = datagram.hop_limit.saturating_sub(1);
        if datagram.hop_limit == 0 {
            return self.lose(world, datagram.packet, DropReason::TimeExceeded);
        }
        match next_hop {
            Some(next_hop) => {
                datagram.rpi = self.rpl.rpi(false);
                self.send_to(world, datagram, Some(next_hop));
            }
            None => self.send(world, datagram),
        }
    }
}
