//! What motes tell their neighbours of slots, in frames for everyone.

use super::down::Wanted;
use super::{Mote, World};
use crate::mac::CellRef;
use crate::mote::settings::Settings;
use crate::sf::Traffic;
use crate::wire::frame::{Content, FrameRepr, MAX_PSDU};
use physics::asn::Asn;

impl Mote {
    /// Adds to a frame for everyone that is about to be sent in a cell what its scheduling function announces, as far as there
    /// is room. Returns the length (bytes) of the frame on the air, if that has changed.
    pub fn announce(
        &self,
        settings: &Settings,
        at: &CellRef,
        asn: Asn,
        frame: &mut FrameRepr,
    ) -> Option<u16> {
        let mut slots = self.sf.announcement(self.address, at, asn)?;
        let tags = std::mem::take(&mut slots.tags);
        frame.slots = Some(Box::new(slots));
        let Some(room) = MAX_PSDU.checked_sub(frame.buffer_len()) else {
            frame.slots = None;
            return None;
        };
        if let Some(slots) = &mut frame.slots {
            slots.tags = tags;
            slots.tags.truncate(room);
        }
        Some(settings.psdu_bytes(frame))
    }

    /// Sends a frame for everyone with nothing in it but what is announced, if that is wanted and no other frame will carry it.
    pub(super) fn send_announcement(&mut self, world: &mut World<'_>) {
        let Some(handle) = self.sf.poll_announcement() else { return };
        // Unicast frames in the same slots must not wait for it: beacons announce the same, often enough.
        if self.invites && self.sf.slotframe_of(Traffic::Unicast(self.address)).is_none() {
            return;
        }
        let says_something = self
            .mac
            .queue()
            .iter()
            .any(|queued| queued.destination().is_none() && queued.slotframe == Some(handle));
        if !says_something {
            let wanted = Wanted::new(None, Content::KeepAlive);
            self.enqueue(world, Wanted { slotframe: Some(handle), ..wanted });
        }
    }

    /// Learns what a neighbour has announced in a frame for everyone. No timer and no cell changes.
    pub fn handle_announcement(&mut self, world: &mut World<'_>, at: &CellRef, frame: &FrameRepr) {
        if let Some(slots) = &frame.slots {
            self.with_sf(world, |sf, cx| sf.handle_announcement(cx, at, frame.source, slots));
        }
    }
}
