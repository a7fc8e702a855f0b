//! The way into the network: what passes between the join protocol and the rest of a mote.

use super::down::HOP_LIMIT;
use super::{Mote, World};
use crate::join::{Event, Outgoing};
use crate::wire::cojp::CojpRepr;
use crate::wire::datagram::{Datagram, UdpRepr};

impl Mote {
    /// Passes on what the join protocol has to say. Returns whether there was anything.
    pub(super) fn pump_join(&mut self, world: &mut World<'_>) -> bool {
        let mut moved = false;
        while let Some(outgoing) = self.pledge.poll_transmit() {
            moved = true;
            self.send_join(world, &outgoing);
        }
        while let Some(event) = self.pledge.poll_event() {
            moved = true;
            match event {
                Event::Joined => self.admit(world),
                Event::Failed if self.mac.is_synced() => self.desynchronise(world),
                Event::Failed | Event::Left => {}
            }
        }
        moved
    }

    fn send_join(&mut self, world: &mut World<'_>, outgoing: &Outgoing) {
        let datagram = Datagram {
            packet: 0,
            source: outgoing.source,
            destination: outgoing.destination,
            hop_limit: HOP_LIMIT,
            rpi: None,
            route: None,
            upper: outgoing.upper(),
        };
        self.send(world, datagram);
    }

    /// A message of the join protocol has come: as registrar, as proxy, or as the pledge itself. What cannot be served is
    /// ignored: the pledge will ask again.
    pub(super) fn handle_join(
        &mut self,
        world: &mut World<'_>,
        datagram: &Datagram,
        udp: &UdpRepr,
    ) {
        let Ok(message) = CojpRepr::parse(&udp.payload) else { return };
        let answer = match &message {
            CojpRepr::Request { .. } => match &mut self.registrar {
                Some(registrar) => {
                    registrar.handle_request(datagram.source, &message, world.now_ns).ok()
                }
                None if self.joined => {
                    let root = self.rpl.dodag_id();
                    self.proxy.handle_request(datagram.source, &message, root, world.now_ns).ok()
                }
                None => None,
            },
            CojpRepr::Response { proxy_state: Some(_), .. } => {
                self.proxy.handle_response(&message).ok()
            }
            CojpRepr::Response { proxy_state: None, .. } => {
                self.pledge.handle_response(&message);
                None
            }
        };
        if let Some(answer) = answer {
            self.send_join(world, &answer);
        }
    }
}
