//! One slot: ask what everybody sends, resolve what arrives, tell everybody.

mod receive;

use super::hush::Known;
use super::inbox::Sent;
use super::network::Mesh;
use super::scratch::{Scratch, Sending};
use crate::app::ports::SWARM_PORT;
use crate::energy::SlotUse;
use crate::mac::kind::FrameKind;
use crate::mac::tsch::{Listening, Outgoing, channel_of};
use crate::mote::settings::Settings;
use crate::wire::datagram::Upper;
use crate::wire::fragment::LowpanRepr;
use crate::wire::frame::{AckRepr, Content, FrameRepr};
use bytes::Bytes;
use physics::asn::Asn;
use physics::medium::slot::{self, OnAir, Paths as _, Reception, Slot};
use physics::timing::TX_ACK_DELAY_NS;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose, ordered_link};
use proto::time::{SimDuration, SimTime};
use receive::Received;

/// The payload that a frame carries to everyone, if it is the swarm's.
fn swarm_payload(frame: &FrameRepr) -> Option<&Bytes> {
    let Content::Lowpan(LowpanRepr::Whole(datagram)) = &frame.content else { return None };
    match &datagram.upper {
        Upper::Udp(udp) if frame.destination.is_none() && udp.destination_port == SWARM_PORT => {
            Some(&udp.payload)
        }
        Upper::Udp(_) | Upper::Rpl(_) => None,
    }
}

/// Whether an acknowledgment is lost for the burden of the mote that sends it.
fn loses_acknowledgment(
    settings: &Settings,
    seed: u64,
    from: MoteId,
    to: MoteId,
    asn: Asn,
) -> bool {
    let loss = settings.burden(from).ack_loss;
    let draw = || Draws::new(seed, Purpose::AckLoss).uniform(ordered_link(from.0, to.0), asn.0, 0);
    loss != 0.0 && draw() < loss
}

/// True time of what happens `within_ns` after the beginning of a slot.
fn moment(asn: Asn, slot: SimDuration, within_ns: i64) -> SimTime {
    SimTime::from_ns((asn * slot).ns().saturating_add_signed(within_ns))
}

impl Mesh {
    /// Simulates a slot in which somebody acts.
    pub(super) fn slot(&mut self, asn: Asn) {
        let mut awake = std::mem::take(&mut self.scratch.awake);
        self.state.calendar.take(asn, &mut awake);
        for &mote in &awake {
            self.let_time_pass(mote, asn);
        }
        self.ask(&awake, asn);
        if !self.scratch.sending.is_empty() {
            self.find_listeners(asn);
        }
        self.note_followers(&awake, asn);
        if !self.scratch.sending.is_empty() {
            self.resolve(asn);
            self.tell(asn);
        }
        for &mote in &awake {
            self.reschedule(mote, asn + 1);
        }
        self.scratch.awake = awake;
        let mut touched = std::mem::take(&mut self.scratch.touched);
        for mote in touched.drain(..) {
            self.reschedule(mote, asn + 1);
        }
        self.scratch.touched = touched;
        self.look_whether_formed(asn);
    }

    fn let_time_pass(&mut self, mote: MoteId, asn: Asn) {
        self.listening_cache.forget(mote);
        let is_due = self.due[mote.index()] <= asn * self.config.slot;
        let (node, mut world) = self.mote_and_world(mote, asn);
        if is_due && node.poll_timeout(&world.settings.mac).is_some_and(|at| at <= world.now) {
            node.handle_timeout(&mut world);
        }
        self.synchronise_if_wanted(mote, asn, asn);
    }

    /// A mote that has chosen whose time to keep takes it over, if that neighbour still keeps time.
    pub(super) fn synchronise_if_wanted(&mut self, mote: MoteId, asn: Asn, effective_asn: Asn) {
        let Some(source) = self.state.motes[mote.index()].wants_sync.take() else { return };
        let now = asn * self.config.slot;
        let Some(other) = self.addresses.mote(source) else { return };
        let other = &self.state.motes[other.index()].mac;
        if !other.is_synced() {
            return;
        }
        let source_ns = other.deviation_ns(now);
        let (node, mut world) = self.mote_and_world(mote, asn);
        world.effective_asn = effective_asn;
        node.synchronise(&mut world, source, source_ns);
    }

    /// Ask: what does everybody who is awake send?
    fn ask(&mut self, awake: &[MoteId], asn: Asn) {
        self.scratch.sending.clear();
        for &mote in awake {
            let node = &mut self.state.motes[mote.index()];
            let Some(mut transmission) =
                node.mac.poll_slot(&self.settings.mac, &node.schedule, asn)
            else {
                continue;
            };
            let mut payload = None;
            let at = transmission.at;
            let announce = |frame: &mut FrameRepr| {
                at.and_then(|at| node.announce(&self.settings, &at, asn, frame))
            };
            let (beacon, psdu_bytes) = match &mut transmission.outgoing {
                Outgoing::Beacon => {
                    let mut beacon = node.beacon(&self.settings, asn, self.config.announced_ids());
                    let bytes = announce(&mut beacon);
                    let bytes = bytes.unwrap_or_else(|| self.settings.psdu_bytes(&beacon));
                    (Some(beacon), bytes)
                }
                Outgoing::Frame(queued) => {
                    if queued.destination().is_none()
                        && let Some(bytes) = announce(&mut queued.frame)
                    {
                        queued.psdu_bytes = bytes;
                    }
                    if let Some(bytes) = swarm_payload(&queued.frame) {
                        let sent = asn * self.config.slot;
                        payload = Some(self.inbox.send(Sent {
                            sender: mote,
                            sent,
                            end: sent + self.config.slot,
                            payload: bytes.clone(),
                            destination: None,
                        }));
                    }
                    let bytes = match queued.frame.blacklist {
                        Some(_) => self.settings.psdu_bytes(&queued.frame),
                        None => queued.psdu_bytes,
                    };
                    (None, bytes)
                }
            };
            self.scratch.sending.push(Sending {
                sender: mote,
                transmission,
                beacon,
                psdu_bytes,
                payload,
                n_received: 0,
                n_missed: 0,
                answered_by: None,
                correction_ns: 0,
                acknowledged: false,
            });
        }
    }

    /// Who may hear any of it: those in reach who listen on the channel.
    fn find_listeners(&mut self, asn: Asn) {
        let stamp = asn + 1;
        let now = asn * self.config.slot;
        let Self { scratch, state, links, settings, seed, listening_cache, .. } = self;
        let Scratch { sending, on_air, seen, listeners, heard, .. } = scratch;
        on_air.clear();
        listeners.clear();
        heard.clear();
        for sending in sending.iter() {
            seen[sending.sender.index()] = stamp;
            let node = &mut state.motes[sending.sender.index()];
            if node.schedule.listens(asn).is_some() {
                node.tally.n_listening_used += 1;
            }
            on_air.push(OnAir {
                sender: sending.sender,
                channel: sending.transmission.channel,
                starts_ns: node.mac.deviation_ns(now),
                psdu_bytes: sending.psdu_bytes,
            });
        }
        for sending in sending.iter() {
            let channel = sending.transmission.channel;
            let everyone = 0..state.motes.len() as u32;
            let neighbours = links.neighbours(sending.sender);
            let n = neighbours.map_or(everyone.len(), <[MoteId]>::len);
            for place in 0..n {
                let mote = neighbours.map_or(place as u32, |neighbours| neighbours[place].0);
                if seen[mote as usize] == stamp {
                    continue;
                }
                let listening = match listening_cache.known(MoteId(mote), asn) {
                    Known::Silent => continue,
                    Known::Background(at) => {
                        let channel = channel_of(&settings.mac, asn, at.cell.channel);
                        let listening = Listening::synchronised(Some(at), channel);
                        Listening { is_background: true, ..listening }
                    }
                    Known::Listens(offset) if channel_of(&settings.mac, asn, offset) != channel => {
                        // As below, without a look at the mote.
                        continue;
                    }
                    Known::Unknown | Known::Listens(_) => {
                        let node = &state.motes[mote as usize];
                        let mac = &settings.mac;
                        match node.mac.listening(mac, &node.schedule, *seed, asn) {
                            Some(listening) => listening,
                            None => {
                                seen[mote as usize] = stamp;
                                continue;
                            }
                        }
                    }
                };
                if listening.channel != channel {
                    // On another channel: another sender may reach it there.
                    continue;
                }
                seen[mote as usize] = stamp;
                listeners.push((MoteId(mote), listening));
            }
        }
        if 1 < sending.len() {
            listeners.sort_unstable_by_key(|(mote, _)| *mote);
        }
        for (mote, listening) in listeners.iter() {
            let deviation_ns = state.motes[mote.index()].mac.deviation_ns(now);
            heard.push(if listening.scans {
                slot::Listening::scanning(*mote, listening.channel)
            } else {
                slot::Listening::synchronised(*mote, listening.channel, deviation_ns)
            });
        }
    }

    /// Those who listen because of a pending bit, where nobody in reach sends on their channel. The schedule, from which
    /// idle listening is counted otherwise, does not know of it.
    fn note_followers(&mut self, awake: &[MoteId], asn: Asn) {
        for &mote in awake {
            let node = &mut self.state.motes[mote.index()];
            if node.mac.follows_at(asn) != Some(asn) {
                continue;
            }
            node.mac.end_following();
            if node.schedule.listens(asn).is_none() && self.scratch.seen[mote.index()] != asn + 1 {
                node.tally.usage.count(SlotUse::IdleListen);
            }
        }
    }

    /// Resolve: what does every listener receive?
    fn resolve(&mut self, asn: Asn) {
        let slot = Slot { asn, begins_ns: (asn * self.config.slot).ns() };
        let Self { scratch, links, medium, .. } = self;
        let receptions = medium.resolve(links, slot, &scratch.on_air, &scratch.heard);
        scratch.receptions.clear();
        scratch.receptions.extend_from_slice(receptions);
    }

    /// Tell: receivers what has come, senders whether it was acknowledged.
    fn tell(&mut self, asn: Asn) {
        let mut sending = std::mem::take(&mut self.scratch.sending);
        let listeners = std::mem::take(&mut self.scratch.listeners);
        let receptions = std::mem::take(&mut self.scratch.receptions);
        self.scratch.answers.clear();
        self.scratch.touched.clear();
        for (sending, on_air) in sending.iter().zip(&self.scratch.on_air) {
            let begins = moment(asn, self.config.slot, on_air.begins_ns());
            self.capture.frame(asn, begins, sending.transmission.channel, sending.frame());
        }
        for ((mote, listening), reception) in listeners.iter().zip(&receptions) {
            match *reception {
                Reception::Idle => self.note_idle(*mote, listening),
                Reception::Lost { transmission } => {
                    let lost = &mut sending[transmission as usize];
                    lost.n_missed += 1;
                    let bytes = lost.psdu_bytes;
                    self.note_use(*mote, listening, SlotUse::Overhear { bytes });
                }
                Reception::Received { transmission, rssi_dbm } => {
                    let sent = &mut sending[transmission as usize];
                    sent.n_received += 1;
                    let mote = *mote;
                    let received = Received { mote, listening, transmission, rssi_dbm, asn };
                    self.receive(&received, sent);
                }
            }
        }
        self.acknowledge(&mut sending, asn);
        self.capture.end_slot();
        let slot = self.config.slot;
        self.frames.add(asn * slot, &sending, |address| self.addresses.mote(address));
        for sent in sending.drain(..) {
            self.finish(sent, asn);
        }
        self.pass_on_payloads(asn);
        self.scratch.sending = sending;
        self.scratch.listeners = listeners;
        self.scratch.receptions = receptions;
    }

    fn note_idle(&mut self, mote: MoteId, listening: &Listening) {
        if !listening.is_scheduled && !listening.scans {
            self.state.motes[mote.index()].tally.usage.count(SlotUse::IdleListen);
        }
    }

    /// A listener's radio did something else than to find nothing.
    fn note_use(&mut self, mote: MoteId, listening: &Listening, used: SlotUse) {
        let tally = &mut self.state.motes[mote.index()].tally;
        if listening.is_scheduled {
            tally.n_listening_used += 1;
        }
        if !listening.scans {
            tally.usage.count(used);
        }
    }

    /// Which acknowledgments arrive.
    fn acknowledge(&mut self, sending: &mut [Sending], asn: Asn) {
        if self.scratch.answers.is_empty() {
            return;
        }
        let now = asn * self.config.slot;
        for answer in &self.scratch.answers {
            let sent = &sending[answer.transmission as usize];
            let frame = sent.frame();
            let ack = AckRepr {
                destination: frame.source,
                sequence: frame.sequence,
                time_correction_us: (sent.correction_ns / 1000).clamp(-2048, 2047) as i16,
                security: frame.security,
            };
            let on_air = &self.scratch.on_air[answer.transmission as usize];
            let begins = moment(
                asn,
                self.config.slot,
                on_air.ends_ns(&self.settings.mac.airtime) + TX_ACK_DELAY_NS,
            );
            let source = self.addresses.eui64(answer.receiver);
            self.capture.ack(asn, begins, sent.transmission.channel, source, &ack);
        }
        let slot = Slot { asn, begins_ns: now.ns() };
        let Self { scratch, links, medium, settings, seed, .. } = self;
        let verdicts = medium.acknowledge(links, slot, &scratch.on_air, &scratch.answers);
        for (answer, verdict) in scratch.answers.iter().zip(verdicts) {
            let is_heard = matches!(verdict, Reception::Received { .. });
            let sent = &mut sending[answer.transmission as usize];
            sent.acknowledged = is_heard
                && !loses_acknowledgment(settings, *seed, answer.receiver, sent.sender, asn);
        }
    }

    /// What became of a transmission.
    fn finish(&mut self, sent: Sending, asn: Asn) {
        let is_secured = sent.frame().security.is_secured();
        let kind = FrameKind::of(&sent.frame().content);
        let Sending { sender, transmission, psdu_bytes: bytes, answered_by, acknowledged, .. } =
            sent;
        let now = asn * self.config.slot;
        let source_ns = match answered_by {
            Some(mote) if acknowledged => self.state.motes[mote.index()].mac.deviation_ns(now),
            _ => 0,
        };
        let (is_unicast, is_repeated) = match &transmission.outgoing {
            Outgoing::Beacon => (false, false),
            Outgoing::Frame(queued) => (queued.destination().is_some(), 1 < queued.n_attempts),
        };
        let at = transmission.at;
        let airtime = SimDuration::from_ns(self.settings.mac.airtime.of(bytes).unsigned_abs());
        let (node, mut world) = self.mote_and_world(sender, asn);
        world.effective_asn = asn + 1;
        node.mac.spend_airtime(airtime, now);
        node.tally.sent[kind as usize].count(is_unicast.then_some(acknowledged), is_repeated);
        node.tally.usage.secured_acks_received += u64::from(acknowledged && is_secured);
        node.tally.usage.count(if is_unicast {
            SlotUse::TxUnicast { bytes, acked: acknowledged }
        } else {
            SlotUse::TxBroadcast { bytes }
        });
        let done =
            node.mac.handle_done(&world.settings.mac, transmission, acknowledged, source_ns, asn);
        node.handle_done(&mut world, at, done, acknowledged);
        node.pump(&mut world);
    }

    /// Payloads of the swarm that came in frames for one mote alone.
    pub(super) fn pass_on_payloads(&mut self, asn: Asn) {
        let end = (asn + 1) * self.config.slot;
        for brought in self.scratch.swarm.drain(..) {
            let number = self.inbox.send(Sent {
                sender: brought.sender,
                sent: brought.sent,
                end,
                payload: brought.payload,
                destination: Some(brought.receiver),
            });
            self.inbox.hear(brought.receiver, number, end, brought.rssi_dbm, brought.hops);
        }
    }
}
