//! A network that looks at every mote in every slot, and at every pair of a sender and a listener. It has the motes' layers in
//! common with the network under test; who is awake when, who listens where, what arrives, and what each radio did are its own.

use super::air::{self, Ear, Emission, Heard};
use super::scenario::Scenario;
use crate::harness::STEP_NS;
use netsim::app::packets::Packets;
use netsim::app::ports::SWARM_PORT;
use netsim::catalogue::Catalogue;
use netsim::energy::ACK_BYTES;
use netsim::energy::{SlotUse, Usage};
use netsim::lowpan::DropReason;
use netsim::mac::tsch::{Outgoing, Transmission, channel_of};
use netsim::mac::{CellRef, Schedule};
use netsim::mesh::config::Config;
use netsim::mote::addresses::Addresses;
use netsim::mote::settings::{Settings, Transport};
use netsim::mote::up::Arrived;
use netsim::mote::{Mote, World};
use netsim::place::{self, Place};
use netsim::wire::address::ALL_NODES;
use netsim::wire::datagram::Upper;
use netsim::wire::fragment::LowpanRepr;
use netsim::wire::frame::{Content, FrameRepr};
use physics::asn::Asn;
use physics::interference::Rule;
use physics::link::End;
use physics::medium::jam::{Jam, Jams};
use physics::timing::{
    ACK_WAIT_NS, RX_ACK_DELAY_NS, RX_OFFSET_NS, RX_WAIT_NS, TX_ACK_DELAY_NS, TX_OFFSET_NS,
};
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::types::PacketPurpose;
use proto::types::{AgentStates, MoteOrder};

/// The plain network.
pub(crate) struct Plain {
    pub(crate) motes: Vec<Mote>,
    /// What each radio did, slot by slot.
    pub(crate) usages: Vec<Usage>,
    /// Frames sent, of them for one neighbour, of them acknowledged; received.
    pub(crate) counts: Vec<[u64; 4]>,
    pub(crate) packets: Packets<DropReason>,
    /// Payloads of the swarm heard: receiver, sender, slot.
    pub(crate) heard: Vec<(u32, u32, u64)>,
    seed: u64,
    config: Config,
    rule: Box<dyn Rule>,
    floor_dbm: f64,
    settings: Settings,
    addresses: Addresses,
    place: Place,
    jams: Jams,
    ends: Vec<End>,
    way_m: Vec<f64>,
}

/// What a mote sends in a slot.
struct Sending {
    sender: u32,
    transmission: Transmission,
    frame: FrameRepr,
    bytes: u16,
    answered_by: Option<u32>,
    acknowledged: bool,
}

/// How a mote listens in a slot.
struct Listening {
    mote: u32,
    at: Option<CellRef>,
    channel: u8,
    scans: bool,
}

impl Plain {
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let setup = scenario.setup();
        let (mut config, ..) =
            netsim::config::read(&setup, Catalogue::built_in()).expect("it was read before");
        let (settings, addresses) = *config.network.take().expect("the full network");
        let interference = config.interference.take().expect("there is a rule");
        let curve_dbm = config.model.curve.floor_dbm();
        let n = scenario.n;
        let place = Place::new(n, &config.absent, setup.site);
        let motes = (0..n as u32)
            .map(|mote| Mote::new(&settings, &addresses, MoteId(mote), n as u32, scenario.seed))
            .collect();
        let mut plain = Self {
            motes,
            usages: vec![Usage::default(); n],
            counts: vec![[0; 4]; n],
            packets: Packets::default(),
            heard: Vec::new(),
            seed: scenario.seed,
            floor_dbm: interference.horizon_dbm.map_or(curve_dbm, |dbm| dbm.min(curve_dbm)),
            rule: interference.rule,
            config,
            settings,
            addresses,
            place,
            jams: Jams::default(),
            ends: Vec::new(),
            way_m: Vec::new(),
        };
        for mote in 0..n {
            if plain.place.is_alive(mote) {
                plain
                    .with(mote as u32, Asn::FIRST, Asn::FIRST, |mote, world| mote.switch_on(world));
            }
        }
        plain
    }

    /// Lets something happen to a mote.
    fn with<T>(
        &mut self,
        mote: u32,
        asn: Asn,
        effective_asn: Asn,
        act: impl FnOnce(&mut Mote, &mut World<'_>) -> T,
    ) -> T {
        let (mut readiness_changed, mut swarm) = (false, Vec::new());
        let mut world = World {
            settings: &self.settings,
            addresses: &self.addresses,
            packets: &mut self.packets,
            seed: self.seed,
            asn,
            effective_asn,
            now: asn * self.config.slot,
            received: asn * self.config.slot,
            readiness_changed: &mut readiness_changed,
            swarm: &mut swarm,
        };
        let result = act(&mut self.motes[mote as usize], &mut world);
        for brought in swarm {
            self.heard.push((brought.receiver.0, brought.sender.0, asn.0));
        }
        result
    }

    /// A control period.
    pub(crate) fn period(&mut self, scenario: &Scenario, period: u64) {
        let slot_ns = self.config.slot;
        let period_ns = period * STEP_NS;
        let asn = period_ns / slot_ns.ns();
        let states = scenario.states(period);
        self.place.travel(&states);
        self.obey(scenario, period, Asn(asn));
        self.follow_bodies(&states, Asn(asn));
        let lift_m = place::lift_m(self.config.antenna_height_m, &states);
        self.ends.clear();
        self.way_m.clear();
        for mote in 0..self.motes.len() {
            if states.alive.get(mote) && self.place.is_alive(mote) {
                self.ends.push(place::end_of(&states, mote as u32, lift_m));
                self.way_m.push(self.place.way_m[mote]);
            }
        }
        self.hand_over(scenario, &states, period, Asn(asn));
        for asn in asn..(period_ns + STEP_NS) / slot_ns.ns() {
            self.slot(Asn(asn), period_ns);
        }
    }

    fn obey(&mut self, scenario: &Scenario, period: u64, asn: Asn) {
        let commands = scenario.commands(period);
        self.place.obey(&commands);
        for command in commands {
            match command.order {
                MoteOrder::Kill(mote) => self.switch_off(mote, asn),
                MoteOrder::Revive(mote) | MoteOrder::Add(mote) => {
                    if self.place.is_alive(mote as usize) {
                        self.switch_on(mote, asn);
                    }
                }
                MoteOrder::Jam { channel, from_ns, until_ns, centre_m, radius_m } => {
                    let channel = channel as u8;
                    self.jams.add(Jam { channel, from_ns, until_ns, centre_m, radius_m });
                }
                MoteOrder::Send { mote, destination, payload } => {
                    let to = self.addresses.eui64(MoteId(destination)).global();
                    let now_ns = asn * self.config.slot;
                    let bytes = payload.len() as u32;
                    let kind = PacketPurpose::Ordered;
                    let packet =
                        self.packets.begin(kind, MoteId(mote), MoteId(destination), now_ns, bytes);
                    self.with(mote, asn, asn, |mote, world| {
                        mote.say(world, to, payload, packet);
                        mote.pump(world);
                    });
                }
            }
        }
    }

    fn switch_on(&mut self, mote: u32, asn: Asn) {
        if self.motes[mote as usize].tally.on_since_asn.is_none() {
            self.with(mote, asn, asn, |mote, world| mote.switch_on(world));
        }
    }

    fn switch_off(&mut self, mote: u32, asn: Asn) {
        if self.motes[mote as usize].tally.on_since_asn.is_some() {
            self.with(mote, asn, asn, |mote, world| mote.switch_off(world));
        }
    }

    fn follow_bodies(&mut self, states: &AgentStates, asn: Asn) {
        for mote in 0..self.motes.len() {
            if states.alive.get(mote) && self.place.is_alive(mote) {
                self.switch_on(mote as u32, asn);
            } else {
                self.switch_off(mote as u32, asn);
            }
        }
    }

    fn hand_over(&mut self, scenario: &Scenario, states: &AgentStates, period: u64, asn: Asn) {
        let now_ns = asn * self.config.slot;
        let transport = self.settings.transport;
        for (mote, payload) in (0..).zip(scenario.payloads(period).iter()) {
            let node = &self.motes[mote as usize];
            if payload.is_empty() || !node.ready || !states.alive.get(mote as usize) {
                continue;
            }
            let payload = bytes::Bytes::copy_from_slice(payload);
            let neighbours: Vec<_> = node.mac.neighbours().addresses().collect();
            match transport {
                Transport::None => continue,
                Transport::UnicastNeighbours => {
                    for neighbour in neighbours {
                        let to = self.addresses.mote(neighbour).expect("it was heard");
                        let bytes = payload.len() as u32;
                        let packet = self.packets.begin(
                            PacketPurpose::Swarm,
                            MoteId(mote),
                            to,
                            now_ns,
                            bytes,
                        );
                        let payload = payload.clone();
                        self.with(mote, asn, asn, |mote, world| {
                            mote.say(world, neighbour.link_local(), payload, packet);
                        });
                    }
                }
                _ => self.with(mote, asn, asn, |mote, world| {
                    // Whoever still waits with the payload before this one never gets to send it.
                    if mote.mac.queue().iter().any(|queued| queued.is_latest_only) {
                        mote.tally.n_superseded += 1;
                    }
                    mote.say(world, ALL_NODES, payload, 0);
                }),
            }
            self.with(mote, asn, asn, |mote, world| mote.pump(world));
        }
    }

    fn slot(&mut self, asn: Asn, period_ns: u64) {
        for mote in 0..self.motes.len() as u32 {
            self.with(mote, asn, asn, |mote, world| {
                let due = mote.poll_timeout(&world.settings.mac);
                if due.is_some_and(|due_ns| due_ns <= world.now) {
                    mote.handle_timeout(world);
                }
            });
            self.synchronise(mote, asn, asn);
        }
        let mut sending = self.ask(asn);
        let listening = self.listen(asn, &sending);
        for node in &mut self.motes {
            if node.mac.follows_at(asn) == Some(asn) {
                node.mac.end_following();
            }
        }
        let (emissions, outcomes) = self.resolve(asn, period_ns, &sending, &listening);
        let mut answers = Vec::new();
        for (listening, outcome) in listening.iter().zip(outcomes) {
            let used = match outcome {
                Heard::Nothing => SlotUse::IdleListen,
                Heard::Lost(which) => SlotUse::Overhear { bytes: sending[which].bytes },
                Heard::Received(which, rssi_dbm) => {
                    let sent = &mut sending[which];
                    self.receive(asn, listening, sent, (which, rssi_dbm), &mut answers)
                }
            };
            let usage = &mut self.usages[listening.mote as usize];
            usage.count(if listening.scans { SlotUse::Scan } else { used });
        }
        self.acknowledge(asn, period_ns, &emissions, &mut sending, &answers);
        let is_busy: Vec<u32> = sending
            .iter()
            .map(|sending| sending.sender)
            .chain(listening.iter().map(|listening| listening.mote))
            .collect();
        for sent in sending {
            self.finish(asn, sent);
        }
        for (mote, node) in self.motes.iter().enumerate() {
            if node.tally.on_since_asn.is_some() && !is_busy.contains(&(mote as u32)) {
                self.usages[mote].count(SlotUse::Sleep);
            }
        }
    }

    fn synchronise(&mut self, mote: u32, asn: Asn, effective_asn: Asn) {
        let Some(source) = self.motes[mote as usize].wants_sync.take() else { return };
        let other = self.addresses.mote(source).expect("it was heard");
        let other = &self.motes[other.index()].mac;
        if other.is_synced() {
            let source_ns = other.deviation_ns(asn * self.config.slot);
            self.with(mote, asn, effective_asn, |mote, world| {
                mote.synchronise(world, source, source_ns);
            });
        }
    }

    /// Everybody is asked, whether or not it is awake.
    fn ask(&mut self, asn: Asn) -> Vec<Sending> {
        let mut sending = Vec::new();
        for (mote, node) in (0..).zip(&mut self.motes) {
            let transmission = node.mac.poll_slot(&self.settings.mac, &node.schedule, asn);
            let Some(transmission) = transmission else { continue };
            let mut frame = match &transmission.outgoing {
                Outgoing::Beacon => node.beacon(&self.settings, asn, [0, 0]),
                Outgoing::Frame(queued) => queued.frame.clone(),
            };
            if let (Some(at), None) = (&transmission.at, frame.destination) {
                node.announce(&self.settings, at, asn, &mut frame);
            }
            sending.push(Sending {
                sender: mote,
                bytes: self.settings.psdu_bytes(&frame),
                frame,
                transmission,
                answered_by: None,
                acknowledged: false,
            });
        }
        sending
    }

    fn listen(&self, asn: Asn, sending: &[Sending]) -> Vec<Listening> {
        let mac = &self.settings.mac;
        let mut listening = Vec::new();
        for (mote, node) in (0..).zip(&self.motes) {
            if sending.iter().any(|sending| sending.sender == mote) {
                continue;
            }
            let ours = if node.mac.is_scanning() {
                let channel = node.mac.scans_on(mac, self.seed, asn);
                Some(Listening { mote, at: None, channel, scans: true })
            } else if node.mac.is_synced() {
                let follows = node.mac.follows_at(asn) == Some(asn);
                let mut cells = node.schedule.slotframes().iter().flat_map(|one| one.cells_at(asn));
                let is_idle = cells.all(|cell| cell.options.shared);
                match first_to_receive(&node.schedule, asn) {
                    Some(at) if !(follows && is_idle && mac.bursts_beside_everyone) => {
                        let channel = channel_of(mac, asn, at.cell.channel);
                        Some(Listening { mote, at: Some(at), channel, scans: false })
                    }
                    // After a pending bit: what only the MAC knows.
                    _ => node.mac.listening(mac, &node.schedule, self.seed, asn).map(|after| {
                        Listening { mote, at: None, channel: after.channel, scans: false }
                    }),
                }
            } else {
                None
            };
            listening.extend(ours);
        }
        listening
    }

    fn air(&self, asn: Asn, period_ns: u64) -> air::World<'_> {
        air::World {
            model: &self.config.model,
            rule: &*self.rule,
            floor_dbm: self.floor_dbm,
            seed: self.seed,
            site: &self.place.site,
            ends: &self.ends,
            way_m: &self.way_m,
            jams: &self.jams,
            period_ns,
            asn,
            slot_ns: self.config.slot.ns(),
        }
    }

    fn resolve(
        &self,
        asn: Asn,
        period_ns: u64,
        sending: &[Sending],
        listening: &[Listening],
    ) -> (Vec<Emission>, Vec<Heard>) {
        let now_ns = asn * self.config.slot;
        let deviation_ns = |mote: u32| self.motes[mote as usize].mac.deviation_ns(now_ns);
        let emissions: Vec<Emission> = sending
            .iter()
            .map(|sending| Emission {
                sender: sending.sender,
                channel: sending.transmission.channel,
                begins_ns: TX_OFFSET_NS + deviation_ns(sending.sender),
                bytes: sending.bytes,
                purpose: Purpose::SlotReception,
            })
            .collect();
        let air = self.air(asn, period_ns);
        let outcomes = listening
            .iter()
            .map(|listening| {
                let opens_ns = RX_OFFSET_NS + deviation_ns(listening.mote);
                let (opens_ns, closes_ns) = match listening.scans {
                    true => (i64::MIN, i64::MAX),
                    false => (opens_ns, opens_ns + RX_WAIT_NS),
                };
                let (receiver, channel) = (listening.mote, listening.channel);
                air.outcome(&emissions, &Ear { receiver, channel, opens_ns, closes_ns })
            })
            .collect();
        (emissions, outcomes)
    }

    fn receive(
        &mut self,
        asn: Asn,
        listening: &Listening,
        sent: &mut Sending,
        (which, rssi_dbm): (usize, f64),
        answers: &mut Vec<(usize, u32)>,
    ) -> SlotUse {
        let mote = listening.mote;
        let bytes = sent.bytes;
        self.counts[mote as usize][3] += 1;
        let now_ns = asn * self.config.slot;
        let source_ns = self.motes[sent.sender as usize].mac.deviation_ns(now_ns);
        if is_swarms(&sent.frame) && !listening.scans {
            let node = &mut self.motes[mote as usize];
            let FrameRepr { source, sequence, .. } = sent.frame;
            node.mac.handle_frame(&self.settings.mac, source, None, Some(sequence), asn, source_ns);
            if let Some(at) = &listening.at {
                node.schedule.count_rx(at);
                self.with(mote, asn, asn + 1, |mote, world| {
                    mote.handle_announcement(world, at, &sent.frame);
                });
            }
            self.heard.push((mote, sent.sender, asn.0));
            return SlotUse::RxBroadcast { bytes };
        }
        let (at, channel) = (listening.at, listening.channel);
        let arrived = Arrived { frame: &sent.frame, at, channel, source_ns, rssi_dbm };
        let verdict = self.with(mote, asn, asn + 1, |mote, world| {
            let verdict = mote.handle_frame(world, &arrived);
            mote.pump(world);
            verdict
        });
        self.synchronise(mote, asn, asn + 1);
        if !verdict.acknowledge {
            return match sent.frame.destination {
                None => SlotUse::RxBroadcast { bytes },
                Some(_) => SlotUse::Overhear { bytes },
            };
        }
        if let Outgoing::Frame(queued) = &mut sent.transmission.outgoing {
            queued.has_arrived |= verdict.deliver;
        }
        sent.answered_by = Some(mote);
        answers.push((which, mote));
        SlotUse::RxUnicast { bytes }
    }

    fn acknowledge(
        &self,
        asn: Asn,
        period_ns: u64,
        frames: &[Emission],
        sending: &mut [Sending],
        answers: &[(usize, u32)],
    ) {
        let mut emissions: Vec<Emission> = answers
            .iter()
            .map(|&(which, receiver)| Emission {
                sender: receiver,
                channel: frames[which].channel,
                begins_ns: frames[which].ends_ns() + TX_ACK_DELAY_NS,
                bytes: ACK_BYTES,
                purpose: Purpose::SlotAcknowledgment,
            })
            .collect();
        emissions.extend_from_slice(frames);
        let air = self.air(asn, period_ns);
        for (number, &(which, _)) in answers.iter().enumerate() {
            let opens_ns = frames[which].ends_ns() + RX_ACK_DELAY_NS;
            let ear = Ear {
                receiver: frames[which].sender,
                channel: frames[which].channel,
                opens_ns,
                closes_ns: opens_ns + ACK_WAIT_NS,
            };
            sending[which].acknowledged = self.settings.compat.perfect_acks
                || matches!(air.outcome(&emissions, &ear), Heard::Received(which, _) if which == number);
        }
    }

    fn finish(&mut self, asn: Asn, sent: Sending) {
        let Sending { sender, transmission, frame, bytes, answered_by, acknowledged } = sent;
        let now_ns = asn * self.config.slot;
        let source_ns = answered_by
            .filter(|_| acknowledged)
            .map_or(0, |mote| self.motes[mote as usize].mac.deviation_ns(now_ns));
        let counts = &mut self.counts[sender as usize];
        counts[0] += 1;
        let used = match frame.destination {
            None => SlotUse::TxBroadcast { bytes },
            Some(_) => {
                counts[1] += 1;
                counts[2] += u64::from(acknowledged);
                SlotUse::TxUnicast { bytes, acked: acknowledged }
            }
        };
        self.usages[sender as usize].count(used);
        self.with(sender, asn, asn + 1, |mote, world| {
            let at = transmission.at;
            let mac = &world.settings.mac;
            let done = mote.mac.handle_done(mac, transmission, acknowledged, source_ns, asn);
            mote.handle_done(world, at, done, acknowledged);
            mote.pump(world);
        });
    }
}

/// The first cell of the lowest handle that receives (IEEE Std 802.15.4-2015, 6.2.6.4), read cell by cell.
fn first_to_receive(schedule: &Schedule, asn: Asn) -> Option<CellRef> {
    for frame in schedule.slotframes() {
        let slot = (asn % u64::from(frame.slots())) as u16;
        let mut here = frame.cells().iter().filter(|cell| cell.slot == slot).peekable();
        let background = if here.peek().is_none() { frame.background_at(slot) } else { None };
        let cell = here.find(|cell| cell.options.rx).copied().or(background);
        if let Some(cell) = cell {
            return Some(CellRef { handle: frame.handle, cell });
        }
    }
    None
}

/// Whether a frame is a payload of the swarm for everyone.
fn is_swarms(frame: &FrameRepr) -> bool {
    let Content::Lowpan(LowpanRepr::Whole(datagram)) = &frame.content else { return false };
    let Upper::Udp(udp) = &datagram.upper else { return false };
    frame.destination.is_none() && udp.destination_port == SWARM_PORT
}
