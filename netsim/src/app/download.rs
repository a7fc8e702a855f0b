//! `download`: a large representation, such as firmware, from the root to motes, block by block (RFC 7959).
//!
//! The first root has the representation. It triggers one mote at a time with a confirmable POST. The mote then requests one block
//! after another with a confirmable GET that has a Block2 option, each once it has the one before (stop-and-wait). The root answers
//! each with the block, piggybacked; it keeps no state of the transfer but which mote is at it.
//!
//! A download of S bytes in blocks of b takes N = ⌈S/b⌉ exchanges. If each takes a round trip R, it takes N R, and its goodput is
//! at most b/R. It begins when the mote has been triggered, ends with the last block, and fails if a block's request is given up.
//!
//! A mote downloads once, however often it is triggered; reboots of either end do not change that. If the root gives up a trigger
//! and the mote has not begun, the download fails: it is counted from the first transmission of the trigger. A mote that gets the
//! trigger later downloads all the same, but the download has failed, like a packet that arrives after it was taken for lost.
//!
//! The root goes on to the next mote after it has sent the last block, or after it has heard nothing for MAX_TRANSMIT_WAIT (RFC 7252,
//! § 4.8.2), within which the mote has given up too.

use super::config::Largest;
use super::exchange::{Answered, Endpoint, Exchange, Timeout, TimerKeys, Timers, coap_packet};
use super::{Context, Counters, Heard, Host, Packet, Reading, Traffic};
use crate::lowpan::DropReason;
use crate::wire::coap::{Block, CoapRepr, Code, Token, Type};
use bytes::Bytes;
use proto::config::{Choice, OneOf, Problem, Section, Variant, join, variant};
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// First letters of the paths of the representation and of the trigger; the number of the application follows.
const FILE: char = 'f';
const TRIGGER: char = 'u';
/// How often the root looks for a mote that it has a route to.
const LOOK: SimDuration = SimDuration::SECOND;
/// Greatest SZX: blocks of 1024 bytes (RFC 7959, § 2.2).
const MAX_SZX: u8 = 6;

/// What is the same for all motes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// The first download begins so long after the root has become ready.
    pub after: SimDuration,
    /// Size of the representation (bytes), at least 1.
    pub size_bytes: u32,
    /// SZX of its blocks.
    pub szx: u8,
    /// Parameters of retransmission.
    pub timers: Timers,
}

impl Settings {
    fn block_bytes(&self) -> u32 {
        16 << self.szx
    }

    /// Blocks of the representation: ⌈S/b⌉.
    #[must_use]
    pub fn n_blocks(&self) -> u32 {
        self.size_bytes.div_ceil(self.block_bytes())
    }
}

/// What the root does.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Root {
    /// Nothing yet, or nothing more.
    Idle,
    /// Looks for a mote to trigger.
    Looks(SimTime),
    /// Has triggered a mote, for the first time then; it has not answered.
    Triggers(Exchange, SimTime),
    /// A mote downloads; unless something is heard of it before that time, it has given up.
    Serves(MoteId, SimTime),
}

/// A download at the mote.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Fetch {
    block: u32,
    exchange: Option<Exchange>,
    /// Its number in the account of packets.
    number: u64,
    /// The root.
    server: MoteId,
}

/// Block-wise downloads: the server at the first root, a client at all other motes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Download {
    settings: Settings,
    /// Before it is assigned to a mote: who downloads; `None`: all motes but the root.
    targets: Option<Vec<MoteId>>,
    host: Option<Host>,
    endpoint: Endpoint,
    is_ready: bool,
    root: Root,
    /// Motes that the root has not triggered yet.
    remaining: VecDeque<MoteId>,
    fetch: Option<Fetch>,
    /// Whether the mote has been triggered: it outlasts a reboot.
    has_begun: bool,
    /// When the mote requests its first block.
    begins: Option<SimTime>,
    /// Requests that the mote has answered.
    answered: Answered,
    counters: Counters,
}

/// Download of a large representation, such as firmware: the first root triggers a mote, which requests block after block (RFC
/// 7959), each after it has received the one before.
#[derive(Section)]
struct Keys {
    /// Who downloads.
    #[key(default = All::All)]
    targets: TargetsKey,
    /// The first download begins so long after the root is ready to send (s).
    #[key(range = 0.0..=1e6, default = 0.0)]
    after_s: f64,
    /// Size of the representation (bytes).
    #[key(range = 1..=1_000_000, default = 10_000)]
    size_bytes: u32,
    /// Size of a block (bytes): 16, 32, 64, 128, 256, 512 or 1024 (RFC 7959, section 2.2).
    #[key(range = 16..=1024, default = 64)]
    block_bytes: u32,
    #[key(flatten)]
    timers: TimerKeys,
}

#[derive(OneOf)]
enum TargetsKey {
    All(All),
    Listed(#[key(length = 1..)] Vec<u32>),
}

#[derive(Choice)]
enum All {
    /// All motes but the root, one after another, as soon as the root has a route to them.
    All,
}

impl Download {
    /// A download by these motes in turn (`None`: by all but the root), not assigned to a mote.
    #[must_use]
    pub fn new(settings: Settings, targets: Option<Vec<MoteId>>) -> Self {
        Self {
            settings,
            targets,
            host: None,
            endpoint: Endpoint::default(),
            is_ready: false,
            root: Root::Idle,
            remaining: VecDeque::new(),
            fetch: None,
            has_begun: false,
            begins: None,
            answered: Answered::default(),
            counters: Counters::default(),
        }
    }

    /// The motes that download, if they are listed.
    pub(super) fn targets(&self) -> &[MoteId] {
        self.targets.as_deref().unwrap_or_default()
    }

    fn is_root(&self) -> bool {
        self.host.is_some_and(|host| host.mote == host.first_root)
    }

    /// The root triggers the first mote that it has a route to.
    fn trigger_next(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let Some(place) = self.remaining.iter().position(|&mote| (cx.reaches)(mote)) else {
            let is_over = self.remaining.is_empty();
            self.root = if is_over { Root::Idle } else { Root::Looks(cx.now + LOOK) };
            return None;
        };
        let mote = self.remaining.remove(place)?;
        let post = CoapRepr::request(Code::POST, &self.endpoint.path(TRIGGER));
        let timers = &self.settings.timers;
        let (exchange, packet) = Exchange::begin(mote, post, timers, &mut self.endpoint, cx.now);
        self.root = Root::Triggers(exchange, cx.now);
        Some(packet)
    }

    /// The mote requests the block that it lacks.
    fn request_block(&mut self, now: SimTime) -> Option<Packet> {
        let path = self.endpoint.path(FILE);
        let fetch = self.fetch.as_mut()?;
        let block2 = Some(Block { number: fetch.block, more: false, szx: self.settings.szx });
        let get = CoapRepr { block2, ..CoapRepr::request(Code::GET, &path) };
        let timers = &self.settings.timers;
        let (exchange, packet) =
            Exchange::begin(fetch.server, get, timers, &mut self.endpoint, now);
        fetch.exchange = Some(exchange);
        self.counters.blocks += 1;
        Some(packet)
    }

    /// The root's answer to a request for a block; `None`: there is no such block.
    fn block(&self, request: &CoapRepr) -> Option<CoapRepr> {
        let Block { number, szx, .. } = request.block2?;
        let first = u64::from(number) * u64::from(self.settings.block_bytes());
        let size = u64::from(self.settings.size_bytes);
        if szx != self.settings.szx || size <= first {
            return None;
        }
        let end = size.min(first + u64::from(self.settings.block_bytes()));
        let payload: Bytes = (first..end).map(octet).collect();
        let block2 = Some(Block { number, more: end < size, szx });
        let size2 = (number == 0).then_some(self.settings.size_bytes);
        Some(CoapRepr { block2, size2, payload, ..request.response(Code::CONTENT) })
    }

    fn handle_request(&mut self, from: MoteId, message: &CoapRepr, cx: &mut Context<'_>) -> Heard {
        let resource = if self.is_root() { FILE } else { TRIGGER };
        if message.path.as_deref() != Some(&*self.endpoint.path(resource)) {
            return Heard::NotMine;
        }
        if !self.is_ready {
            return Heard::Taken(None);
        }
        let timers = &self.settings.timers;
        let is_again = self.answered.is_duplicate(from, message, timers, cx.now);
        self.counters.block_duplicates += u64::from(is_again);
        let response = if self.is_root() {
            self.serve(from, message, cx.now)
        } else {
            if !is_again {
                self.begin(from, cx);
            }
            Some(message.response(Code::CHANGED))
        };
        Heard::Taken(response.map(|response| coap_packet(from, response.to_vec().into(), cx.now)))
    }

    /// The root answers a request for a block.
    fn serve(&mut self, from: MoteId, request: &CoapRepr, now: SimTime) -> Option<CoapRepr> {
        let response = self.block(request)?;
        if self.serves(from) {
            let is_last = response.block2.is_some_and(|block| !block.more);
            self.root = if is_last {
                Root::Looks(now)
            } else {
                Root::Serves(from, now + self.settings.timers.max_transmit_wait())
            };
        }
        Some(response)
    }

    /// The mote has been triggered by `server`.
    fn begin(&mut self, server: MoteId, cx: &mut Context<'_>) {
        if std::mem::replace(&mut self.has_begun, true) {
            return;
        }
        let own = self.host.map_or_else(MoteId::default, |host| host.mote);
        let (app, bytes) = (self.endpoint.app, self.settings.size_bytes);
        let (number, _) = cx.packets.begin_download(app, server, own, cx.now, bytes);
        self.fetch = Some(Fetch { block: 0, exchange: None, number, server });
        self.begins = Some(cx.now);
    }

    /// Whether the root has triggered this mote: a request of its may outrun the answer to that.
    fn serves(&self, mote: MoteId) -> bool {
        match &self.root {
            Root::Serves(served, _) => *served == mote,
            Root::Triggers(exchange, _) => exchange.peer == mote,
            Root::Idle | Root::Looks(_) => false,
        }
    }

    fn handle_response(
        &mut self,
        from: MoteId,
        hops: u32,
        message: &CoapRepr,
        cx: &mut Context<'_>,
    ) -> Heard {
        if let Root::Triggers(exchange, _) = &self.root
            && exchange.is_answered_by(from, message)
        {
            let until = cx.now + self.settings.timers.max_transmit_wait();
            self.root = Root::Serves(from, until);
            return Heard::Taken(None);
        }
        let Some(fetch) = &mut self.fetch else { return Heard::NotMine };
        let is_answered =
            fetch.exchange.as_ref().is_some_and(|open| open.is_answered_by(from, message));
        let Some(block) = message.block2.filter(|block| is_answered && block.number == fetch.block)
        else {
            return Heard::NotMine;
        };
        if block.more {
            fetch.block += 1;
            return Heard::Taken(self.request_block(cx.now));
        }
        cx.packets.deliver(fetch.number, cx.received, hops);
        self.fetch = None;
        Heard::Taken(None)
    }
}

/// What stands at a place of the representation.
fn octet(place: u64) -> u8 {
    (place ^ place >> 8) as u8
}

impl super::Kind for Download {
    const VARIANT: Variant = variant::<Keys>("download");

    fn read(reading: &mut Reading<'_>) -> Option<Self> {
        let keys = Keys::read(reading.table);
        let szx = (0..=MAX_SZX).find(|szx| 16 << szx == keys.block_bytes);
        if szx.is_none() {
            let sizes = (0..=MAX_SZX).map(|szx| 16_u32 << szx);
            let nearest = sizes.min_by_key(|size| size.abs_diff(keys.block_bytes)).unwrap_or(64);
            let message = "must be a power of two from 16 to 1024";
            let problem = Problem::new(join(reading.path, "block_bytes"), message);
            reading.problems.push(problem.value(keys.block_bytes).nearest(nearest));
        }
        let targets = match keys.targets {
            TargetsKey::Listed(list) => Some(reading.motes("targets", list)),
            TargetsKey::All(All::All) => None,
        };
        let settings = Settings {
            after: SimDuration::from_seconds(keys.after_s),
            size_bytes: keys.size_bytes,
            szx: szx?,
            timers: keys.timers.into(),
        };
        Some(Self::new(settings, targets))
    }

    fn assigned(&self, host: &Host) -> Option<Self> {
        let is_target =
            |mote: MoteId| self.targets.as_ref().is_none_or(|list| list.contains(&mote));
        if host.mote != host.first_root && !is_target(host.mote) {
            return None;
        }
        let mut one = Self {
            host: Some(*host),
            endpoint: Endpoint::new(host),
            ..Self::new(self.settings, None)
        };
        if one.is_root() {
            let others = (0..host.n_motes).map(MoteId).filter(|&mote| mote != host.mote);
            one.remaining =
                self.targets.as_ref().map_or_else(|| others.collect(), |list| list.clone().into());
        }
        Some(one)
    }

    /// The first block, which states the size of the whole; or the last full one, whose number is greater.
    fn largest(&self) -> Largest {
        let Settings { size_bytes, szx, .. } = self.settings;
        let n_full = size_bytes / self.settings.block_bytes();
        let blocks = [0, n_full.saturating_sub(1)].into_iter().filter_map(|number| {
            let block2 = Some(Block { number, more: false, szx });
            let token = Token::from(0);
            let get = CoapRepr { block2, token, ..CoapRepr::request(Code::GET, "") };
            self.block(&get).map(|block| block.to_vec())
        });
        let longest = blocks.max_by_key(Vec::len).unwrap_or_default();
        let packet = coap_packet(MoteId(0), longest.into(), SimTime::START);
        let (key, value) = ("block_bytes", self.settings.block_bytes());
        Largest { key, value, packet }
    }
}

impl Traffic for Download {
    /// While the mote is not ready, its timers stand still.
    fn set_ready(&mut self, is_ready: bool, cx: &mut Context<'_>) {
        self.is_ready = is_ready;
        if is_ready && self.root == Root::Idle && !self.remaining.is_empty() {
            self.root = Root::Looks(cx.now + self.settings.after);
        }
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        if !self.is_ready {
            return None;
        }
        let of_root = match &self.root {
            Root::Idle => None,
            Root::Looks(at) | Root::Serves(_, at) => Some(*at),
            Root::Triggers(exchange, _) => Some(exchange.due()),
        };
        let open = self.fetch.as_ref().and_then(|fetch| fetch.exchange.as_ref());
        let of_mote = open.map(Exchange::due);
        [of_root, of_mote, self.begins].into_iter().flatten().min()
    }

    fn handle_timeout(&mut self, cx: &mut Context<'_>) -> Option<Packet> {
        let now = cx.now;
        let timers = self.settings.timers;
        if self.begins.take_if(|at| *at <= now).is_some() {
            return self.request_block(now);
        }
        if let Some(fetch) = &mut self.fetch
            && let Some(exchange) = &mut fetch.exchange
            && exchange.due() <= now
        {
            return match exchange.handle_timeout(&timers, now) {
                Timeout::Again(packet) => {
                    self.counters.block_retransmissions += 1;
                    Some(packet)
                }
                Timeout::GivenUp => {
                    cx.packets.lose(fetch.number, now, DropReason::MaxRetries);
                    self.fetch = None;
                    None
                }
            };
        }
        match &mut self.root {
            Root::Idle => None,
            Root::Looks(_) | Root::Serves(..) => self.trigger_next(cx),
            Root::Triggers(exchange, first) => match exchange.handle_timeout(&timers, now) {
                Timeout::Again(packet) => Some(packet),
                Timeout::GivenUp => {
                    let (own, mote) =
                        (self.host.map_or_else(MoteId::default, |host| host.mote), exchange.peer);
                    let (app, bytes) = (self.endpoint.app, self.settings.size_bytes);
                    let (number, is_new) = cx.packets.begin_download(app, own, mote, *first, bytes);
                    // One that the mote has begun is the mote's to end.
                    if is_new {
                        cx.packets.lose(number, now, DropReason::MaxRetries);
                    }
                    self.root = Root::Looks(now);
                    None
                }
            },
        }
    }

    fn handle_message(
        &mut self,
        from: MoteId,
        hops: u32,
        message: &CoapRepr,
        cx: &mut Context<'_>,
    ) -> Heard {
        match message.kind {
            Type::Confirmable => self.handle_request(from, message, cx),
            Type::Acknowledgment => self.handle_response(from, hops, message, cx),
        }
    }

    fn reset(&mut self, cx: &mut Context<'_>) {
        self.begins = None;
        self.answered = Answered::default();
        if let Some(fetch) = self.fetch.take() {
            cx.packets.lose(fetch.number, cx.now, DropReason::Killed);
        }
        // Who has been triggered outlasts a reboot, an exchange does not.
        match &self.root {
            Root::Serves(..) => return,
            Root::Triggers(exchange, _) => self.remaining.push_front(exchange.peer),
            Root::Idle | Root::Looks(_) => {}
        }
        self.root = Root::Idle;
    }

    fn reseed(&mut self, seed: u64) {
        self.endpoint.stream.reseed(seed);
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}
