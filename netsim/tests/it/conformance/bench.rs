//! A network of motes from outside: what was on the air, what became of packets, what each mote knows.

use crate::harness::{payloads, setup, standing_at, text};
use netsim::catalogue::Catalogue;
use netsim::mac::CellRef;
use netsim::mesh::network::Mesh;
use netsim::mote::Mote;
use netsim::mote::settings::Settings;
use netsim::wire::Eui64;
use netsim::wire::datagram::Upper;
use netsim::wire::fragment::{FragmentHeader, LowpanRepr};
use netsim::wire::frame::{AckRepr, Content, Envelope, FrameRepr, unsecure};
use netsim::wire::rpl::RplMessage;
use netsim::wire::security::{FrameSecurity, Keys};
use netsim::wire::sixp::SixpRepr;
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::side::{NetInput, NetOutput, Setup};
use proto::time::SimDuration;
use proto::types::{AgentStates, MoteCommand, MoteOrder, NetRecord};
use std::net::Ipv6Addr;

/// Length of a slot (ns).
pub(super) const SLOT_NS: u64 = 10_000_000;
/// Everybody hears everybody.
pub(super) const FULL: &str = "[phy]\npropagation = \"full\"\n";
/// Motes 10 m apart hear their next neighbours, always; nobody else disturbs.
pub(super) const LINE: &str = "[phy]\npropagation = \"unit-disk\"\nradius_m = 15.0\n";
/// The first beacon is followed, and beacons are twice as frequent as by default: networks form fast.
pub(super) const EAGER: &str =
    "[mac]\nneighbours_to_wait = 1\nbeacon_period_s = 8.0\nbeacon_spacing_s = 0.0\n";

/// Nobody asks for the time; so clocks do not drift, or a mote that misses some frames would be deaf for good.
pub(super) const NO_KEEP_ALIVES: &str = "keep_alive_s = 0.0\nmax_drift_ppm = 0.0\n";

/// Clocks that never differ, so that frames begin when the slot says.
pub(super) const EXACT: &str = "max_drift_ppm = 0.0\ncrystal_hz = 1000000000\n";

/// What a frame carried.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum What {
    /// An enhanced beacon.
    Beacon {
        join_metric: u8,
    },
    KeepAlive,
    Sixp(SixpRepr),
    Rpl(RplMessage),
    /// UDP to a port.
    Udp(u16),
    Fragment(FragmentHeader),
}

/// A frame as it was on the air.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct OnAir {
    pub(super) asn: Asn,
    /// When it began (ns of true time).
    pub(super) begins_ns: u64,
    pub(super) channel: u8,
    pub(super) source: u32,
    /// `None`: everyone.
    pub(super) destination: Option<u32>,
    pub(super) sequence: u8,
    /// Length of the PSDU (bytes).
    pub(super) psdu_bytes: usize,
    pub(super) security: FrameSecurity,
    /// The channels that its link skips, if it says so.
    pub(super) blacklist: Option<u16>,
    pub(super) what: What,
    /// Whether somebody sent an acknowledgment.
    pub(super) answered: bool,
    /// The time correction (µs) in the acknowledgment.
    pub(super) correction_us: Option<i16>,
    /// How the acknowledgment was secured.
    pub(super) ack_security: Option<FrameSecurity>,
}

/// A packet whose way has ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ended {
    pub(super) kind: String,
    pub(super) source: u32,
    pub(super) destination: u32,
    pub(super) created_ns: u64,
    pub(super) ended_ns: u64,
    pub(super) hops: u32,
    /// Why it was lost.
    pub(super) lost: Option<String>,
}

/// A network, driven slot by slot.
pub(super) struct Bench {
    pub(super) mesh: Mesh,
    pub(super) states: AgentStates,
    /// The first slot that has not been simulated.
    pub(super) asn: Asn,
    pub(super) frames: Vec<OnAir>,
    /// Packets but those of the join protocol.
    pub(super) ended: Vec<Ended>,
    /// Its requests and responses.
    pub(super) ended_joins: Vec<Ended>,
    /// All records of the capture.
    pub(super) capture: Vec<u8>,
    orders: Vec<MoteOrder>,
}

/// Motes on a line, 10 m apart.
pub(super) fn line(n: usize) -> Vec<(f64, f64)> {
    (0..n).map(|mote| (10.0 * mote as f64, 0.0)).collect()
}

/// A schedule in which each of `n` motes has a cell to everyone, with beacons, and one in either direction of every link:
/// nothing ever collides.
pub(super) fn own_cells(n: usize, links: &[(usize, usize)]) -> String {
    let slots = n + 2 * links.len();
    let mut text = format!("[sf]\nkind = \"static\"\nslotframe_slots = {slots}\n");
    for mote in 0..n {
        text += &format!(
            "[[sf.cell]]\nslot = {mote}\nfrom = {mote}\nto = \"all\"\nadvertising = true\n"
        );
    }
    for (slot, (one, other)) in (n..).step_by(2).zip(links) {
        text += &format!("[[sf.cell]]\nslot = {slot}\nfrom = {one}\nto = {other}\n");
        text += &format!("[[sf.cell]]\nslot = {}\nfrom = {other}\nto = {one}\n", slot + 1);
    }
    text
}

/// A K7 trace: from when on (s), sender, receiver, delivery ratio on all channels.
pub(super) fn trace(n: usize, rows: &[(u32, u32, u32, f64)]) -> String {
    let channels: Vec<String> = (11..27).map(|channel: u8| channel.to_string()).collect();
    let mut text = format!(
        "{{\"start_date\": \"2018-01-11T00:00:00.0\", \"stop_date\": \"2018-01-11T23:00:00.0\", \"channels\": [{}], \
         \"node_count\": {n}}}\ndatetime,src,dst,channel,mean_rssi,pdr,tx_count\n",
        channels.join(", ")
    );
    for (at_s, src, dst, pdr) in rows {
        let (h, m, s) = (at_s / 3600, at_s / 60 % 60, at_s % 60);
        text += &format!("2018-01-11T{h:02}:{m:02}:{s:02}.0,{src},{dst},,-60,{pdr},100\n");
    }
    text
}

/// The set-up of a network without payloads of a swarm. `config`: `[netsim]`, its keys at top level, tables last.
pub(super) fn set_up(n: usize, config: &str, seed: u64) -> Setup {
    let text = format!("mode = \"6tisch\"\n{config}\n[swarm]\ntransport = \"none\"\n");
    let mut setup = setup(n, &text);
    setup.experiment.seed = seed;
    setup.records = vec![NetRecord::Packets, NetRecord::Capture, NetRecord::HeardLinks];
    setup
}

/// What the protocols are set to.
pub(super) fn settings(config: &str) -> Settings {
    let (config, ..) = netsim::config::read(&set_up(2, config, 1), Catalogue::built_in())
        .expect("a valid configuration");
    config.network.expect("a network").0
}

impl Bench {
    /// A network whose motes stand at `places`.
    pub(super) fn new(places: &[(f64, f64)], config: &str) -> Self {
        Self::seeded(places, config, 1)
    }

    pub(super) fn seeded(places: &[(f64, f64)], config: &str, seed: u64) -> Self {
        Self::with_setup(set_up(places.len(), config, seed), places)
    }

    /// A network over a trace.
    pub(super) fn over_trace(n: usize, trace: String, config: &str) -> Self {
        let text = format!("[phy]\npropagation = \"trace\"\nfile = \"links.k7\"\n{config}");
        let mut setup = set_up(n, &text, 1);
        setup.files.insert("links.k7".to_owned(), trace.into());
        Self::with_setup(setup, &vec![(0.0, 0.0); n])
    }

    fn with_setup(setup: Setup, places: &[(f64, f64)]) -> Self {
        let (mut config, ..) = netsim::config::read(&setup, Catalogue::built_in())
            .unwrap_or_else(|problems| panic!("{}", text(&problems)));
        let (settings, addresses) = *config.network.take().expect("mode 6tisch has a network");
        let Setup { experiment, site, columns, records, .. } = setup;
        Self {
            mesh: Mesh::new(experiment, config, settings, addresses, site, columns, records),
            states: standing_at(places),
            asn: Asn(0),
            frames: Vec::new(),
            ended: Vec::new(),
            ended_joins: Vec::new(),
            capture: Vec::new(),
            orders: Vec::new(),
        }
    }

    /// Runs up to slot `asn`, which is not simulated.
    pub(super) fn run_to(&mut self, asn: Asn) -> NetOutput {
        assert!(self.asn < asn, "{asn} lies in the past");
        let order = |order| MoteCommand { source: "test".to_owned(), order };
        let commands: Vec<MoteCommand> = self.orders.drain(..).map(order).collect();
        let output = self.mesh.step(&NetInput {
            step: 1,
            from_ns: (self.asn * SimDuration::from_ns(SLOT_NS)).ns(),
            until_ns: (asn * SimDuration::from_ns(SLOT_NS)).ns(),
            states: &self.states,
            payloads: &payloads(self.states.len()),
            moved_obstacles: &[],
            commands: &commands,
            stop_at_first_delivery: false,
            records: &[NetRecord::HeardLinks],
        });
        self.asn = asn;
        self.note_frames(&output.capture);
        self.capture.extend_from_slice(&output.capture);
        let packets = output.packets.as_ref().expect("packets are kept");
        for i in 0..packets.len() {
            let kind = packets.kinds[packets.kind[i] as usize].name.clone();
            let ended = if kind == "join" { &mut self.ended_joins } else { &mut self.ended };
            ended.push(Ended {
                kind,
                source: packets.source[i],
                destination: packets.destination[i],
                created_ns: packets.created_ns[i],
                ended_ns: packets.ended_ns[i],
                hops: packets.hops[i],
                lost: packets.drop_reason(i).map(str::to_owned),
            });
        }
        output
    }

    /// Runs that many slots more.
    pub(super) fn run(&mut self, slots: u64) -> NetOutput {
        self.run_to(self.asn + slots)
    }

    /// Runs, looking every `stride` slots, until `holds`; fails if it does not within `most` slots.
    pub(super) fn run_until(
        &mut self,
        stride: u64,
        most: u64,
        mut holds: impl FnMut(&Self) -> bool,
    ) {
        let end = self.asn + most;
        while !holds(self) {
            assert!(self.asn < end, "not within {most} slots; {:?}", self.mesh.formation());
            self.run(stride);
        }
    }

    /// Runs until everybody takes part.
    pub(super) fn form(&mut self) {
        self.run_until(101, 300_000, |bench| bench.mesh.formation().formed_ns.is_some());
    }

    /// With the next slot this happens.
    pub(super) fn order(&mut self, order: MoteOrder) {
        self.orders.push(order);
    }

    /// With the next slot a packet sets out.
    pub(super) fn send(&mut self, mote: u32, destination: u32, bytes: usize) {
        self.order(MoteOrder::Send { mote, destination, payload: vec![7; bytes].into() });
    }

    pub(super) fn mote(&self, mote: usize) -> &Mote {
        &self.mesh.state().motes[mote]
    }

    pub(super) fn rank(&self, mote: usize) -> u16 {
        self.mote(mote).rpl.rank()
    }

    /// The preferred parent.
    pub(super) fn parent(&self, mote: usize) -> Option<u32> {
        self.mote(mote).rpl.parent().map(|parent| self.number(parent))
    }

    /// The number of the mote with an address.
    pub(super) fn number(&self, address: Eui64) -> u32 {
        self.mesh.addresses().mote(address).expect("an address of this network").0
    }

    /// Cells of a slotframe of a mote.
    pub(super) fn cells(&self, mote: usize, handle: u8) -> Vec<CellRef> {
        self.mote(mote).schedule.cells().filter(|at| at.handle == handle).collect()
    }

    /// Frames of a mote that satisfy a condition.
    pub(super) fn sent(&self, source: u32, which: impl Fn(&What) -> bool) -> Vec<OnAir> {
        let of_it = |frame: &&OnAir| frame.source == source && which(&frame.what);
        self.frames.iter().filter(of_it).cloned().collect()
    }

    fn note_frames(&mut self, mut records: &[u8]) {
        let u16_at =
            |bytes: &[u8], at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
        while !records.is_empty() {
            let length = u16_at(records, 8);
            let (record, rest) = records[16..].split_at(length);
            records = rest;
            let (fields, psdu) = record.split_at(u16_at(record, 2));
            // FCS type, channel, start of frame, ASN: nobody's reception, so without strength.
            let channel = fields[16];
            let begins_ns = u64::from_le_bytes(fields[24..32].try_into().expect("eight bytes"));
            let asn = u64::from_le_bytes(fields[36..44].try_into().expect("eight bytes"));
            self.note_frame(Asn(asn), begins_ns, channel, psdu);
        }
    }

    /// No frame is longer than 127 bytes, aMaxPhyPacketSize (IEEE Std 802.15.4-2015, 11.3).
    fn note_frame(&mut self, asn: Asn, begins_ns: u64, channel: u8, psdu: &[u8]) {
        assert!(psdu.len() <= 127, "{} bytes at {asn}", psdu.len());
        let keys = self.mesh.settings().join.security.map(|security| security.keys);
        let in_slot = |frame: &&mut OnAir| frame.asn == asn;
        for frame in self.frames.iter_mut().rev().take_while(in_slot) {
            // An acknowledgment does not name its sender: only whom it answers.
            let answering = frame.destination.map(MoteId).map(Eui64::of_mote);
            let Some((ack, security)) = legible(psdu, keys, asn, answering) else { continue };
            if let Ok(ack) = AckRepr::parse(&ack)
                && ack.destination == Eui64::of_mote(MoteId(frame.source))
                && ack.sequence == frame.sequence
            {
                (frame.answered, frame.correction_us) = (true, Some(ack.time_correction_us));
                frame.ack_security = Some(security);
                return;
            }
        }
        let psdu_bytes = psdu.len();
        let (psdu, security) = legible(psdu, keys, asn, None).expect("a frame of this network");
        let psdu = &psdu[..];
        let envelope = Envelope::parse(psdu).expect("a frame of this network");
        let source = self.number(envelope.source.expect("frames but acknowledgments name it"));
        let destination = envelope.destination.map(|to| self.number(to));
        let what = what(psdu, &envelope);
        let sequence = envelope.sequence;
        let answered = false;
        self.frames.push(OnAir {
            asn,
            begins_ns,
            channel,
            source,
            destination,
            sequence,
            psdu_bytes,
            security,
            blacklist: envelope.blacklist,
            what,
            answered,
            correction_us: None,
            ack_security: None,
        });
    }
}

/// A frame as whoever has the keys reads it, and how it was secured.
fn legible(
    psdu: &[u8],
    keys: Option<Keys>,
    asn: Asn,
    answering: Option<Eui64>,
) -> Option<(Vec<u8>, FrameSecurity)> {
    match keys {
        Some(keys) => unsecure(psdu, &keys, asn, answering).ok(),
        None => Some((psdu.to_vec(), FrameSecurity::Unsecured)),
    }
}

fn what(psdu: &[u8], envelope: &Envelope<'_>) -> What {
    if let Ok(Some((header, _))) = FragmentHeader::parse(envelope.payload) {
        return What::Fragment(header);
    }
    let root: Ipv6Addr = Eui64::of_mote(MoteId(0)).global();
    let frame = FrameRepr::parse(psdu, Some(root)).expect("what is on the air can be read");
    match frame.content {
        Content::Beacon(beacon) => What::Beacon { join_metric: beacon.join_metric },
        Content::KeepAlive => What::KeepAlive,
        Content::Sixp(message) => What::Sixp(message),
        Content::Lowpan(LowpanRepr::Whole(datagram)) => match &datagram.upper {
            Upper::Rpl(message) => What::Rpl(message.clone()),
            Upper::Udp(udp) => What::Udp(udp.destination_port),
        },
        Content::Lowpan(LowpanRepr::First(_) | LowpanRepr::Next(_)) => {
            unreachable!("fragments were recognised by their header")
        }
    }
}
