//! What passes between a mote and its applications.

use super::down::hops_of;
use super::{Mote, World};
use crate::app::{App, Context, Counters, Heard};
use crate::lowpan::DropReason;
use crate::wire::Eui64;
use crate::wire::coap::CoapRepr;
use crate::wire::datagram::{Datagram, UdpRepr};
use proto::ids::MoteId;

impl Mote {
    /// Does something with one application.
    fn with_app<R>(
        &mut self,
        world: &mut World<'_>,
        place: usize,
        act: impl FnOnce(&mut App, &mut Context<'_>) -> R,
    ) -> R {
        let Self { apps, dice, rpl, .. } = self;
        let addresses = world.addresses;
        let reaches = |mote: MoteId| rpl.route(addresses.eui64(mote).global()).is_some();
        let mut context = Context {
            now: world.now,
            received: world.received,
            dice: &mut dice.application,
            packets: world.packets,
            reaches: &reaches,
        };
        act(&mut apps[place], &mut context)
    }

    /// Applications may send from now on, or no longer.
    pub(super) fn set_apps_ready(&mut self, world: &mut World<'_>, is_ready: bool) {
        for place in 0..self.apps.len() {
            self.with_app(world, place, |app, cx| app.set_ready(is_ready, cx));
        }
    }

    /// Applications lose what they kept in memory.
    pub(super) fn reset_apps(&mut self, world: &mut World<'_>) {
        for place in 0..self.apps.len() {
            self.with_app(world, place, |app, cx| app.machine().reset(cx));
        }
    }

    /// Sends what applications have due.
    pub(super) fn run_apps(&mut self, world: &mut World<'_>) {
        let now = world.now;
        for place in 0..self.apps.len() {
            while self.apps[place].poll_timeout().is_some_and(|due| due <= now) {
                let packet = self.with_app(world, place, |app, cx| app.handle_timeout(cx));
                if let Some(packet) = packet {
                    self.send_application(world, &packet);
                }
            }
        }
    }

    /// A CoAP message for an application arrived. One that no application waits for, such as the answer to a request that was
    /// answered before, is ignored.
    pub(super) fn handle_coap(
        &mut self,
        world: &mut World<'_>,
        datagram: &Datagram,
        udp: &UdpRepr,
    ) {
        let from = world.addresses.mote(Eui64::of_ip(datagram.source));
        let (Ok(message), Some(from)) = (CoapRepr::parse(&udp.payload), from) else {
            return self.lose(world, datagram.packet, DropReason::Malformed);
        };
        let hops = hops_of(datagram);
        world.packets.deliver(datagram.packet, world.received, hops);
        for place in 0..self.apps.len() {
            let heard = self.with_app(world, place, |app, cx| {
                app.machine().handle_message(from, hops, &message, cx)
            });
            match heard {
                Heard::NotMine => {}
                Heard::Taken(None) => return,
                Heard::Taken(Some(packet)) => return self.send_application(world, &packet),
            }
        }
    }

    /// CoAP messages of its applications.
    pub(crate) fn coap_counters(&self) -> Counters {
        self.apps.iter().map(App::counters).fold(Counters::default(), |sum, one| Counters {
            requests: sum.requests + one.requests,
            retransmissions: sum.retransmissions + one.retransmissions,
            duplicates: sum.duplicates + one.duplicates,
            blocks: sum.blocks + one.blocks,
            block_retransmissions: sum.block_retransmissions + one.block_retransmissions,
            block_duplicates: sum.block_duplicates + one.block_duplicates,
        })
    }
}
