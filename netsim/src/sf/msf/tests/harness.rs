//! A MAC as small as will do: slots, cells, acknowledgments, retries, losses on demand.

use super::*;
use crate::dice::Dice;
use crate::mac::Schedule;
use crate::sixtop::{self, Sixtop, request};
use crate::wire::sixp::SixpRepr;
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::time::{SimDuration, SimTime};
use std::collections::VecDeque;

const SLOT: SimDuration = SimDuration::from_ms(10);
const MAX_ATTEMPTS: u8 = 6;

pub(in crate::sf) struct Mote<P = Rfc9033> {
    pub(in crate::sf) own: Eui64,
    pub(in crate::sf) msf: Msf<P>,
    pub(in crate::sf) sixtop: Sixtop,
    pub(in crate::sf) schedule: Schedule,
    pub(in crate::sf) unusable: Vec<Eui64>,
    /// Why requests of this mote failed.
    pub(in crate::sf) failures: Vec<Failure>,
    /// How often it was notified that both ends differ.
    pub(in crate::sf) n_inconsistent: u32,
    is_root: bool,
    parent: Option<Eui64>,
    dice: Dice,
    queue: VecDeque<Frame>,
    /// Shared cells to let pass.
    backoff: u64,
}

struct Frame {
    to: Eui64,
    /// `None`: data.
    message: Option<SixpRepr>,
    n_attempts: u8,
}

pub(in crate::sf) struct Network<P = Rfc9033> {
    pub(in crate::sf) motes: Vec<Mote<P>>,
    pub(in crate::sf) asn: Asn,
    /// Requests that were given to the MAC: by whom, what.
    pub(in crate::sf) sent: Vec<(usize, String)>,
    /// A mote that does not listen in a slot.
    pub(in crate::sf) deaf: Option<(usize, u16)>,
    /// A mote that acknowledges 6P messages and does nothing with them.
    pub(in crate::sf) mute: Option<usize>,
    /// A mote that is switched off.
    pub(in crate::sf) gone: Option<usize>,
    /// Probability that a frame is lost, and that an acknowledgment is.
    pub(in crate::sf) loss: (f64, f64),
    dice: Dice,
    codes: Vec<(usize, ReturnCode)>,
}

impl Network {
    /// Motes that are synchronised; mote 0 is the root.
    pub(in crate::sf) fn new(n: u32, config: MsfConfig) -> Self {
        Self::with_seed(n, config, 1)
    }

    pub(in crate::sf) fn with_seed(n: u32, config: MsfConfig, seed: u64) -> Self {
        Self::with_policy(n, config, seed, Rfc9033)
    }
}

impl<P: Policy> Network<P> {
    /// Motes of another policy than RFC 9033's.
    pub(in crate::sf) fn with_policy(n: u32, config: MsfConfig, seed: u64, policy: P) -> Self {
        let slotframe = u64::from(config.slotframe_slots) * SLOT;
        let mote = |number: u32| Mote {
            own: Eui64::of_mote(MoteId(number)),
            msf: Msf::with_policy(&config, policy.clone()),
            sixtop: Sixtop::new(sixtop::Config {
                sfid: SFID,
                slotframe,
                max_retries: 5,
                max_be: 3,
            }),
            schedule: Schedule::new(),
            unusable: vec![],
            failures: vec![],
            n_inconsistent: 0,
            is_root: number == 0,
            parent: None,
            dice: Dice::new(seed, Purpose::Scheduling, MoteId(number)),
            queue: VecDeque::new(),
            backoff: 0,
        };
        let mut network = Self {
            motes: (0..n).map(mote).collect(),
            asn: Asn(1),
            sent: vec![],
            deaf: None,
            mute: None,
            gone: None,
            loss: (0.0, 0.0),
            dice: Dice::new(seed, Purpose::Mac, MoteId(n)),
            codes: vec![],
        };
        for mote in 0..network.motes.len() {
            network.tell(mote, |msf, cx| msf.start(cx));
        }
        network
    }

    pub(in crate::sf) fn address(&self, mote: usize) -> Eui64 {
        self.motes[mote].own
    }

    pub(in crate::sf) fn now(&self) -> SimTime {
        self.asn * SLOT
    }

    pub(in crate::sf) fn queue_len(&self, mote: usize) -> usize {
        self.motes[mote].queue.len()
    }

    pub(in crate::sf) fn set_parent(&mut self, mote: usize, parent: Option<usize>) {
        let old = self.motes[mote].parent;
        self.motes[mote].parent = parent.map(|parent| self.address(parent));
        self.tell(mote, |msf, cx| msf.handle_parent(cx, old));
    }

    pub(in crate::sf) fn is_ready(&mut self, mote: usize) -> bool {
        let mut is_ready = false;
        self.tell(mote, |msf, cx| is_ready = msf.is_ready(cx));
        is_ready
    }

    /// Tells a mote's MSF something, and lets what follows from it happen.
    pub(in crate::sf) fn tell(
        &mut self,
        mote: usize,
        what: impl FnOnce(&mut Msf<P>, &mut Context<'_>),
    ) {
        let (asn, now) = (self.asn, self.now());
        self.motes[mote].tell(asn, now, what);
        self.pump(mote);
    }

    /// Queues a data frame.
    pub(in crate::sf) fn send_data(&mut self, from: usize, to: usize) {
        let to = self.address(to);
        self.motes[from].queue.push_back(Frame { to, message: None, n_attempts: 0 });
        self.update_queue(from, to);
    }

    /// A request of one mote, heard at once by another.
    pub(in crate::sf) fn ask(&mut self, from: usize, to: usize, what: SixpRequest) {
        let seqnum = self.motes[to].sixtop.seqnum(self.address(from));
        let body = SixpBody::Request(what);
        let message = SixpRepr { version: 0, sfid: SFID, seqnum, body };
        let (from, now) = (self.address(from), self.now());
        self.motes[to].sixtop.handle_message(from, &message, now);
        self.pump(to);
    }

    /// What a mote answered last.
    pub(in crate::sf) fn last_code(&self, mote: usize) -> Option<ReturnCode> {
        self.codes.iter().rev().find(|(sender, _)| *sender == mote).map(|&(_, code)| code)
    }

    pub(in crate::sf) fn run(&mut self, n_slots: u64) {
        for _ in 0..n_slots {
            self.slot();
        }
    }

    pub(in crate::sf) fn run_until(&mut self, mut is_done: impl FnMut(&mut Self) -> bool) {
        for _ in 0..20_000 {
            if is_done(self) {
                return;
            }
            self.slot();
        }
        panic!("it never came to that");
    }

    /// Nothing is open, waits, or is wanted.
    pub(in crate::sf) fn is_quiet(&self) -> bool {
        self.motes.iter().all(|mote| {
            let is_open = self.motes.iter().any(|other| mote.sixtop.is_busy(other.own));
            let has_wishes = mote.msf.missing != Cells::default()
                || !mote.msf.clears.is_empty()
                || !mote.msf.former.is_empty();
            !is_open && mote.queue.is_empty() && !has_wishes
        })
    }

    /// Whether each cell has its counterpart.
    pub(in crate::sf) fn agrees(&self) -> bool {
        let cells_of = |mote: &Mote<P>, peer: Eui64, options: CellOptions| -> Vec<SixpCell> {
            let cells = cells::negotiated(&mote.schedule, peer);
            cells.filter(|cell| cell.options == options).map(cells::place).collect()
        };
        self.motes.iter().all(|a| {
            self.motes
                .iter()
                .all(|b| cells_of(a, b.own, CellOptions::TX) == cells_of(b, a.own, CellOptions::RX))
        })
    }

    #[track_caller]
    pub(in crate::sf) fn assert_agreement(&self) {
        assert!(self.agrees());
        for mote in &self.motes {
            assert_eq!(mote.sixtop.locked().count(), 0);
        }
    }

    fn pump(&mut self, mote: usize) {
        let (asn, now) = (self.asn, self.now());
        loop {
            let this = &mut self.motes[mote];
            if let Some(peer) = this.sixtop.poll_purge() {
                this.queue.retain(|frame| frame.to != peer || frame.message.is_none());
                self.update_queue(mote, peer);
            } else if let Some((to, message)) = this.sixtop.poll_transmit() {
                match &message.body {
                    SixpBody::Request(what) => self.sent.push((mote, name(what).into())),
                    SixpBody::Response(answer) | SixpBody::Confirmation(answer) => {
                        self.codes.push((mote, answer.code));
                    }
                }
                let place = this.queue.iter().take_while(|frame| frame.message.is_some()).count();
                this.queue.insert(place, Frame { to, message: Some(message), n_attempts: 0 });
                self.update_queue(mote, to);
            } else if let Some(event) = this.sixtop.poll_event() {
                match &event {
                    Event::Failed { is_initiator: true, why, .. } => this.failures.push(*why),
                    Event::Inconsistent { .. } => this.n_inconsistent += 1,
                    _ => {}
                }
                this.tell(asn, now, |msf, cx| msf.handle_event(cx, event));
            } else {
                return;
            }
        }
    }

    fn update_queue(&mut self, mote: usize, neighbour: Eui64) {
        let (asn, now) = (self.asn, self.now());
        let this = &mut self.motes[mote];
        let waits = this.queue.iter().any(|frame| frame.to == neighbour);
        this.tell(asn, now, |msf, cx| msf.handle_queue(cx, neighbour, waits));
    }

    fn slot(&mut self) {
        let (asn, now) = (self.asn, self.now());
        for mote in 0..self.motes.len() {
            if self.gone == Some(mote) {
                continue;
            }
            let this = &mut self.motes[mote];
            let is_due = |at: Option<SimTime>| at.is_some_and(|at| at <= now);
            if is_due(this.sixtop.poll_timeout()) {
                this.sixtop.handle_timeout(now);
                self.pump(mote);
            }
            let this = &mut self.motes[mote];
            if is_due(this.msf.poll_timeout()) {
                self.tell(mote, |msf, cx| msf.handle_timeout(cx));
                let next = self.motes[mote].msf.poll_timeout();
                assert!(next.is_none_or(|next| now < next), "timeouts pass");
            }
        }
        // Who transmits: the cell, and the place of the frame in the queue.
        let senders: Vec<(usize, CellRef, usize)> =
            (0..self.motes.len()).filter_map(|mote| self.chosen(mote)).collect();
        for (mote, at, place) in &senders {
            let is_alone = senders
                .iter()
                .all(|(other, cell, _)| other == mote || cell.cell.channel != at.cell.channel);
            let is_lost = self.dice.uniform() < self.loss.0;
            let ack_is_lost = self.dice.uniform() < self.loss.1;
            let (from, to) = (self.address(*mote), self.motes[*mote].queue[*place].to);
            let receiver = self.motes.iter().position(|other| other.own == to);
            let receiver = receiver.filter(|&receiver| {
                let sends = senders.iter().any(|(other, ..)| *other == receiver);
                let listens = self.motes[receiver].schedule.listens(asn);
                let fits = listens.is_some_and(|cell| {
                    cell.cell.channel == at.cell.channel
                        && cell.cell.neighbour.is_none_or(|peer| peer == from)
                });
                let is_deaf =
                    self.deaf.is_some_and(|(deaf, slot)| deaf == receiver && at.cell.slot == slot);
                is_alone && !is_lost && !sends && fits && !is_deaf && self.gone != Some(receiver)
            });
            self.finish(*mote, at, *place, receiver, receiver.is_some() && !ack_is_lost);
        }
        self.asn += 1;
    }

    /// The frame that a mote sends now.
    fn chosen(&mut self, mote: usize) -> Option<(usize, CellRef, usize)> {
        if self.gone == Some(mote) {
            return None;
        }
        let asn = self.asn;
        let this = &mut self.motes[mote];
        if this.queue.is_empty() {
            return None;
        }
        let cells: Vec<CellRef> =
            this.schedule.cells_at(asn).filter(|at| at.cell.options.tx).collect();
        for at in cells {
            let fits = |frame: &Frame| Some(frame.to) == at.cell.neighbour;
            let Some(place) = this.queue.iter().position(fits) else { continue };
            if at.cell.options.shared && this.backoff != 0 {
                this.backoff -= 1;
                continue;
            }
            return Some((mote, at, place));
        }
        None
    }

    fn finish(
        &mut self,
        mote: usize,
        at: &CellRef,
        place: usize,
        receiver: Option<usize>,
        acknowledged: bool,
    ) {
        let (asn, now) = (self.asn, self.now());
        let from = self.address(mote);
        let this = &mut self.motes[mote];
        this.queue[place].n_attempts += 1;
        this.schedule.count_tx(at, acknowledged);
        this.tell(asn, now, |msf, cx| msf.handle_transmitted(cx, at, Some(acknowledged), 0));
        if at.cell.options.shared && !acknowledged {
            this.backoff = this.dice.below(8);
        }
        let message = this.queue[place].message.clone();
        let to = this.queue[place].to;
        let done = acknowledged || this.queue[place].n_attempts == MAX_ATTEMPTS;
        if let Some(receiver) = receiver {
            let other = &mut self.motes[receiver];
            if let Some(heard) = other.schedule.listens(asn) {
                other.schedule.count_rx(&heard);
                other.tell(asn, now, |msf, cx| msf.handle_received(cx, &heard, from, 0));
            }
            if let Some(message) = &message
                && self.mute != Some(receiver)
            {
                other.sixtop.handle_message(from, message, now);
                self.pump(receiver);
            }
        }
        if done {
            self.motes[mote].queue.remove(place);
            self.update_queue(mote, to);
            if let Some(message) = &message {
                self.motes[mote].sixtop.handle_sent(to, message, acknowledged, now);
            }
        }
        self.pump(mote);
    }
}

impl<P: Policy> Mote<P> {
    fn tell(&mut self, asn: Asn, now: SimTime, what: impl FnOnce(&mut Msf<P>, &mut Context<'_>)) {
        let mut cx = Context {
            own: self.own,
            is_root: self.is_root,
            asn,
            now,
            slot: SLOT,
            n_channels: 16,
            parent: self.parent,
            schedule: &mut self.schedule,
            sixtop: &mut self.sixtop,
            dice: &mut self.dice,
            unusable: &mut self.unusable,
        };
        what(&mut self.msf, &mut cx);
    }
}

fn name(what: &SixpRequest) -> &'static str {
    assert_eq!(request::fault(what), None, "{what:?}");
    match what {
        SixpRequest::Add(_) => "ADD",
        SixpRequest::Delete(_) => "DELETE",
        SixpRequest::Relocate { .. } => "RELOCATE",
        SixpRequest::Count { .. } => "COUNT",
        SixpRequest::List { .. } => "LIST",
        SixpRequest::Clear { .. } => "CLEAR",
        SixpRequest::Signal { .. } => "SIGNAL",
    }
}
