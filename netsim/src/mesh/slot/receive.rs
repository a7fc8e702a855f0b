//! A listener and the frame that it has received: who takes it in, and who answers.

use super::{Mesh, moment};
use crate::energy::{ACK_BYTES, SlotUse};
use crate::mac::tsch::{Listening, Outgoing};
use crate::mesh::scratch::Sending;
use crate::mote::up::Arrived;
use physics::asn::Asn;
use physics::medium::slot::{Acknowledgment, OnAir};
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};

/// A frame of the slot, as a listener received it.
pub(super) struct Received<'a> {
    pub(super) mote: MoteId,
    pub(super) listening: &'a Listening,
    /// The frame's place among those on the air.
    pub(super) transmission: u32,
    pub(super) rssi_dbm: f64,
    pub(super) asn: Asn,
}

impl Mesh {
    /// A mote has received a frame.
    pub(super) fn receive(&mut self, received: &Received<'_>, sent: &mut Sending) {
        let Received { mote, listening, rssi_dbm, .. } = *received;
        let bytes = sent.psdu_bytes;
        self.state.motes[mote.index()].tally.n_rx += 1;
        self.note_heard(mote, sent.sender, rssi_dbm);
        let node = &mut self.state.motes[mote.index()];
        let address = node.address;
        let is_for_another = sent.frame().destination.is_some_and(|to| to != address);
        let used = if !node.takes(&self.settings, sent.frame()) {
            node.tally.n_insecure += 1;
            SlotUse::Overhear { bytes }
        } else if let (Some(payload), false) = (sent.payload, listening.scans) {
            self.hear_payload(received, sent, payload);
            SlotUse::RxBroadcast { bytes }
        } else if is_for_another && !listening.scans {
            self.overhear(received, sent);
            SlotUse::Overhear { bytes }
        } else {
            self.take_in(received, sent)
        };
        self.note_use(mote, listening, used);
    }

    /// The swarm's payload for everyone: nothing above the MAC changes but what the robot knows.
    fn hear_payload(&mut self, received: &Received<'_>, sent: &Sending, payload: u32) {
        let Received { mote, listening, rssi_dbm, asn, .. } = *received;
        let source_ns = self.on_air(received).starts_ns;
        let frame = sent.frame();
        let node = &mut self.state.motes[mote.index()];
        let (mac, sequence) = (&self.settings.mac, Some(frame.sequence));
        node.mac.handle_frame(mac, frame.source, None, sequence, asn, source_ns);
        // Its clock may be relied on for less long than before.
        let wakes = node.mac.poll_timeout(mac);
        if wakes.is_some_and(|at| at < self.due[mote.index()]) {
            self.scratch.touched.push(mote);
        }
        if let (Some(at), false) = (&listening.at, listening.is_background) {
            node.schedule.count_rx(at);
        }
        if let (Some(at), true) = (&listening.at, frame.slots.is_some()) {
            let (node, mut world) = self.mote_and_world(mote, asn);
            node.handle_announcement(&mut world, at, frame);
        }
        let end = (asn + 1) * self.config.slot;
        self.inbox.hear(mote, payload, end, rssi_dbm as f32, 1);
    }

    /// A frame for another mote: nobody above the MAC learns of it, and no timer depends on it.
    fn overhear(&mut self, received: &Received<'_>, sent: &Sending) {
        let arrived = self.arrived(received, sent);
        let (node, mut world) = self.mote_and_world(received.mote, received.asn);
        node.handle_frame(&mut world, &arrived);
    }

    /// A frame that concerns all layers of the mote: it takes it in, and acknowledges it if it is asked to.
    fn take_in(&mut self, received: &Received<'_>, sent: &mut Sending) -> SlotUse {
        let Received { mote, rssi_dbm, asn, .. } = *received;
        let arrived = self.arrived(received, sent);
        let arrived_at = self.arrived_at(received);
        // By its clock as it was then: the frame may correct it.
        let expected_ns = self.state.motes[mote.index()].mac.deviation_ns(asn * self.config.slot);
        let (node, mut world) = self.mote_and_world(mote, asn);
        world.effective_asn = asn + 1;
        world.received = arrived_at;
        let n_brought = world.swarm.len();
        let (verdict, has_changed) = node.take_in(&mut world, &arrived);
        for brought in &mut world.swarm[n_brought..] {
            brought.rssi_dbm = rssi_dbm as f32;
        }
        self.synchronise_if_wanted(mote, asn, asn + 1);
        if has_changed {
            self.scratch.touched.push(mote);
        }
        let bytes = sent.psdu_bytes;
        if verdict.acknowledge {
            if let Outgoing::Frame(queued) = &mut sent.transmission.outgoing {
                queued.has_arrived |= verdict.deliver;
            }
            self.answer(received, sent, expected_ns);
            SlotUse::RxUnicast { bytes }
        } else if sent.frame().destination.is_none() {
            SlotUse::RxBroadcast { bytes }
        } else {
            SlotUse::Overhear { bytes }
        }
    }

    /// The mote will acknowledge the frame, which it had expected at this deviation of its clock (ns).
    fn answer(&mut self, received: &Received<'_>, sent: &mut Sending, expected_ns: i64) {
        let Received { mote, transmission, .. } = *received;
        sent.answered_by = Some(mote);
        sent.correction_ns = expected_ns - self.on_air(received).starts_ns;
        let security = sent.frame().security;
        if security.is_secured() {
            self.state.motes[mote.index()].tally.usage.secured_acks_sent += 1;
        }
        self.scratch.answers.push(Acknowledgment {
            transmission,
            receiver: mote,
            psdu_bytes: ACK_BYTES + security.overhead() as u16,
        });
    }

    fn on_air(&self, received: &Received<'_>) -> OnAir {
        self.scratch.on_air[received.transmission as usize]
    }

    /// The frame as the layers of the mote see it.
    fn arrived<'a>(&self, received: &Received<'_>, sent: &'a Sending) -> Arrived<'a> {
        Arrived {
            frame: sent.frame(),
            at: received.listening.at,
            channel: received.listening.channel,
            source_ns: self.on_air(received).starts_ns,
            rssi_dbm: received.rssi_dbm,
        }
    }

    /// When its last symbol arrived: within the slot, however far off a clock is that scanning motes hear all the same.
    fn arrived_at(&self, received: &Received<'_>) -> SimTime {
        let (asn, slot) = (received.asn, self.config.slot);
        let begins = asn * slot;
        let ends_ns = self.on_air(received).ends_ns(&self.settings.mac.airtime);
        moment(asn, slot, ends_ns).clamp(begins, begins + slot - SimDuration::from_ns(1))
    }
}
