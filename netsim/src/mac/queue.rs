//! Frames that wait to be sent.

use super::schedule::{Cell, CellKind, Schedule};
use crate::join::ports;
use crate::wire::Eui64;
use crate::wire::coap;
use crate::wire::datagram::{Upper, code_points};
use crate::wire::fragment::LowpanRepr;
use crate::wire::frame::{Content, FrameRepr};
use serde::{Deserialize, Serialize};

/// A frame is sent again while no more than so many newer ones have gone out. A sequence number has eight bits (IEEE Std
/// 802.15.4-2015, 7.2.2), and the nearer half of their range lies behind the newest.
pub(super) const N_NEWER_MOST: u32 = 127;

/// What a frame is for: the most important first. The queue sends more important frames first, and drops less important
/// ones where it is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Priority {
    /// Keep-alive frames: without time a mote can neither send nor receive.
    Time,
    /// 6P messages, whose transactions time out (RFC 8480, § 3.4.4).
    Sixp,
    /// Join requests of pledges and join responses.
    Join,
    /// Join requests that a proxy has forwarded. They are not authenticated, and are dropped before responses, as their
    /// class AF43 has it (RFC 9031, § 6.1; RFC 2597, § 2).
    ForwardedRequest,
    /// RPL messages; and the swarm's payloads, which routing delays no longer than it would in the order of arrival.
    Routing,
    /// Other datagrams.
    Data,
}

impl Priority {
    /// Of a frame with this content. `is_latest_only`: it is a payload of the swarm.
    #[must_use]
    pub fn of(content: &Content, is_latest_only: bool) -> Self {
        match content {
            Content::Beacon(_) | Content::KeepAlive => Self::Time,
            Content::Sixp(_) => Self::Sixp,
            Content::Lowpan(_) if is_latest_only => Self::Routing,
            Content::Lowpan(part) => match &part.datagram().upper {
                Upper::Rpl(_) => Self::Routing,
                Upper::Udp(udp)
                    if udp.destination_port != ports::COAP
                        || coap::is_application(&udp.payload) =>
                {
                    Self::Data
                }
                Upper::Udp(_) if content.dscp() == code_points::AF43 => Self::ForwardedRequest,
                Upper::Udp(_) => Self::Join,
            },
        }
    }

    /// Whether it is of the join protocol or of routing, whose messages mean the same when they come twice.
    #[must_use]
    pub fn is_control(self) -> bool {
        matches!(self, Self::Join | Self::ForwardedRequest | Self::Routing)
    }

    /// The same in a queue of two classes, as the 6TiSCH simulator has it: 6P and keep-alive, and all others.
    #[must_use]
    pub fn of_two(self) -> Self {
        if self <= Self::Sixp { Self::Sixp } else { Self::Data }
    }
}

/// A frame that waits, or is on its way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Queued {
    /// The frame. Its sequence number is given when it is first sent, the same in every attempt.
    pub frame: FrameRepr,
    /// Its place among others.
    pub priority: Priority,
    /// The slotframe whose cells it may use; `None`: any.
    pub slotframe: Option<u8>,
    /// The swarm's payload: a newer one takes its place.
    pub is_latest_only: bool,
    /// Identity of the datagram in the simulation; 0: none.
    pub packet: u64,
    /// Length on the air (bytes, FCS included).
    pub psdu_bytes: u16,
    /// How often it has been sent.
    pub n_attempts: u16,
    /// Which of its sender's frames it is: its sequence number, continued beyond 255. Given when it is first sent.
    pub number: u32,
    /// Whether its destination has received it, though the sender may not know.
    pub has_arrived: bool,
}

impl Queued {
    /// For whom; `None`: everyone.
    #[must_use]
    pub fn destination(&self) -> Option<Eui64> {
        self.frame.destination
    }
}

/// The frames of a mote that wait: by priority, those of the same priority in the order in which they came.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Queue {
    frames: Vec<Queued>,
    /// At most so many; `None`: no limit.
    capacity: Option<u16>,
}

impl Queue {
    /// An empty queue for `capacity` frames; `None`: for any number.
    #[must_use]
    pub fn new(capacity: Option<u16>) -> Self {
        Self { frames: Vec::new(), capacity }
    }

    /// The same queue with room for no more than `frames`.
    #[must_use]
    pub fn at_most(self, frames: u16) -> Self {
        Self { capacity: Some(self.capacity.map_or(frames, |most| most.min(frames))), ..self }
    }

    /// Number of frames that wait.
    #[must_use]
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether no frame waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Whether none waits but payloads for a slotframe of their own: BotNet makes those when their slot has come.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.frames.iter().all(|frame| frame.is_latest_only && frame.slotframe.is_some())
    }

    /// Those that wait, in order.
    pub fn iter(&self) -> impl Iterator<Item = &Queued> {
        self.frames.iter()
    }

    /// Whether a frame for `neighbour` waits.
    #[must_use]
    pub(crate) fn waits_for(&self, neighbour: Eui64) -> bool {
        self.frames.iter().any(|frame| frame.destination() == Some(neighbour))
    }

    /// Whether a frame waits that carries the same message over the same way as one for `destination` with this content.
    #[must_use]
    pub(crate) fn has_same(&self, destination: Option<Eui64>, content: &Content) -> bool {
        let Content::Lowpan(LowpanRepr::Whole(new)) = content else { return false };
        self.frames.iter().any(|frame| match &frame.frame.content {
            Content::Lowpan(LowpanRepr::Whole(waits)) => {
                frame.destination() == destination
                    && (waits.source, waits.destination) == (new.source, new.destination)
                    && waits.route == new.route
                    && waits.upper == new.upper
            }
            _ => false,
        })
    }

    /// Whether a frame for `neighbour` waits that is sent as soon as a keep-alive for it would be: one of the frames that 6P
    /// and time-keeping send, or the first of the others.
    #[must_use]
    pub(crate) fn goes_soon(&self, neighbour: Eui64) -> bool {
        let mut soon = self.frames.iter().take(self.n_before(Priority::Join) + 1);
        soon.any(|frame| frame.destination() == Some(neighbour))
    }

    /// Frames that are more important: they stand before all of this priority.
    fn n_before(&self, priority: Priority) -> usize {
        self.frames.partition_point(|frame| frame.priority < priority)
    }

    /// Adds a frame behind others of its priority; the swarm's payload takes the place of an older one. Where the queue is
    /// full, the newest of the least important frames has to go if it is less important than this one. Frames in flight are
    /// not in the queue and count through `n_in_flight`.
    ///
    /// # Errors
    ///
    /// The queue is full: the frame comes back. Otherwise the frame that had to go, if one had.
    #[expect(clippy::result_large_err, reason = "the refused frame returns to whoever had it")]
    pub fn push(&mut self, frame: Queued, n_in_flight: usize) -> Result<Option<Queued>, Queued> {
        if frame.is_latest_only
            && let Some(place) = self.frames.iter().position(|other| other.is_latest_only)
        {
            let old = std::mem::replace(&mut self.frames[place], frame);
            return Ok(Some(old));
        }
        let is_full = self
            .capacity
            .is_some_and(|capacity| usize::from(capacity) <= self.frames.len() + n_in_flight);
        let mut displaced = None;
        if is_full {
            match self.frames.last() {
                Some(last) if frame.priority < last.priority => displaced = self.frames.pop(),
                _ => return Err(frame),
            }
        }
        let place = self.frames.partition_point(|other| other.priority <= frame.priority);
        self.frames.insert(place, frame);
        Ok(displaced)
    }

    /// Puts a frame that was in flight back, before all others of its priority.
    pub fn put_back(&mut self, frame: Queued) {
        let place = self.n_before(frame.priority);
        self.frames.insert(place, frame);
    }

    /// The first frame that may be sent in a cell, by place.
    #[must_use]
    pub(crate) fn first_for(&self, handle: u8, cell: &Cell, schedule: &Schedule) -> Option<usize> {
        self.frames.iter().position(|frame| may_use(frame, handle, cell, schedule))
    }

    /// A frame by place.
    #[must_use]
    pub fn get(&self, place: usize) -> &Queued {
        &self.frames[place]
    }

    /// Takes a frame out.
    pub fn take(&mut self, place: usize) -> Queued {
        self.frames.remove(place)
    }

    /// Asks again which slotframe each frame shall use. The swarm's payloads stay where they are.
    pub(crate) fn place_anew(&mut self, slotframe_of: impl Fn(&Queued) -> Option<u8>) {
        for queued in self.frames.iter_mut().filter(|queued| !queued.is_latest_only) {
            queued.slotframe = slotframe_of(queued);
        }
    }

    /// Takes all frames out that fulfil a condition.
    pub fn take_where(&mut self, mut which: impl FnMut(&Queued) -> bool) -> Vec<Queued> {
        self.frames.extract_if(.., |frame| which(frame)).collect()
    }
}

/// Handle of the slotframe that is for the swarm's payloads alone: behind all that scheduling functions use.
pub const SWARM_HANDLE: u8 = 200;

/// Whether a frame may be sent in a cell. A cell with a neighbour serves that neighbour; one without serves broadcast
/// frames, and unicast frames whose destination has no cell of its own.
#[must_use]
pub(crate) fn may_use(frame: &Queued, handle: u8, cell: &Cell, schedule: &Schedule) -> bool {
    if !cell.options.tx || cell.kind == CellKind::AdvertisingOnly {
        return false;
    }
    if frame.slotframe.is_some_and(|slotframe| slotframe != handle)
        || (handle == SWARM_HANDLE && frame.slotframe.is_none())
    {
        return false;
    }
    match (cell.neighbour, frame.destination()) {
        (None, None) => true,
        (None, Some(destination)) => frame.slotframe.is_some() || !schedule.has_tx_to(destination),
        (Some(neighbour), destination) => destination == Some(neighbour),
    }
}

#[cfg(test)]
mod tests {
    use super::Priority::{Data, ForwardedRequest, Join, Routing, Sixp, Time};
    use super::*;
    use crate::wire::datagram::{Datagram, UdpRepr};
    use crate::wire::security::FrameSecurity;
    use proto::ids::MoteId;

    fn frame(packet: u64, priority: Priority) -> Queued {
        Queued {
            frame: FrameRepr {
                source: Eui64::of_mote(MoteId(0)),
                destination: Some(Eui64::of_mote(MoteId(1))),
                sequence: 0,
                ack_request: true,
                pending: false,
                security: FrameSecurity::Unsecured,
                slots: None,
                blacklist: None,
                content: Content::KeepAlive,
            },
            priority,
            slotframe: None,
            is_latest_only: false,
            packet,
            psdu_bytes: 23,
            n_attempts: 0,
            number: 0,
            has_arrived: false,
        }
    }

    fn order(queue: &Queue) -> Vec<u64> {
        queue.iter().map(|frame| frame.packet).collect()
    }

    #[test]
    fn t2_a_full_queue_refuses_ordinary_frames() {
        let mut queue = Queue::new(Some(10));
        for packet in 0..10 {
            queue.push(frame(packet, Data), 0).unwrap();
        }
        assert_eq!(queue.push(frame(10, Data), 0).unwrap_err().packet, 10);
        assert_eq!(queue.len(), 10);
    }

    #[test]
    fn t3_priority_goes_first_in_order_and_drives_out_the_last_ordinary_frame() {
        let mut queue = Queue::new(Some(4));
        for (packet, priority) in [(1, Data), (2, Sixp), (3, Data), (4, Sixp)] {
            queue.push(frame(packet, priority), 0).unwrap();
        }
        assert_eq!(order(&queue), [2, 4, 1, 3]);
        let displaced = queue.push(frame(5, Sixp), 0).unwrap();
        assert_eq!(displaced.unwrap().packet, 3);
        assert_eq!(order(&queue), [2, 4, 5, 1]);
        queue.push(frame(6, Sixp), 0).unwrap();
        assert_eq!(queue.push(frame(7, Sixp), 0).unwrap_err().packet, 7);
        assert_eq!(order(&queue), [2, 4, 5, 6]);
    }

    #[test]
    fn time_goes_before_6p_joining_routing_and_data_and_the_least_important_newest_gives_way() {
        let classes = [Time, Sixp, Join, ForwardedRequest, Routing, Data];
        let mut queue = Queue::new(Some(12));
        for (packet, &class) in (1..).zip(classes.iter().rev()) {
            queue.push(frame(packet, class), 0).unwrap();
            queue.push(frame(10 + packet, class), 0).unwrap();
        }
        assert_eq!(order(&queue), [6, 16, 5, 15, 4, 14, 3, 13, 2, 12, 1, 11]);
        for gone in [11, 1, 12, 2] {
            assert_eq!(queue.push(frame(20 + gone, Join), 0).unwrap().unwrap().packet, gone);
        }
        assert_eq!(order(&queue), [6, 16, 5, 15, 4, 14, 31, 21, 32, 22, 3, 13]);
        assert_eq!(queue.push(frame(40, Routing), 0).unwrap_err().packet, 40);
        let sent = queue.take(4);
        queue.put_back(sent);
        assert_eq!(order(&queue), [6, 16, 5, 15, 4, 14, 31, 21, 32, 22, 3, 13]);
    }

    fn datagram(destination_port: u16, dscp: u8, payload: &'static [u8]) -> Datagram {
        let payload = payload.into();
        Datagram {
            packet: 0,
            source: Eui64::of_mote(MoteId(0)).global(),
            destination: Eui64::of_mote(MoteId(1)).global(),
            dscp,
            hop_limit: 64,
            rpi: None,
            route: None,
            upper: Upper::Udp(UdpRepr { source_port: ports::COAP, destination_port, payload }),
        }
    }

    fn whole(datagram: Datagram) -> Content {
        Content::Lowpan(LowpanRepr::Whole(datagram.into()))
    }

    #[test]
    fn rfc9031_6_1_forwarded_requests_come_after_join_responses() {
        let of = |port, dscp| Priority::of(&whole(datagram(port, dscp, &[])), false);
        assert_eq!(of(ports::COAP, code_points::AF42), Join);
        assert_eq!(of(ports::COAP, code_points::AF43), ForwardedRequest);
        assert_eq!(of(ports::COAP, 0), Join);
        assert_eq!(of(0xf0b1, code_points::AF43), Data);
        assert_eq!(Priority::of(&Content::KeepAlive, false), Time);
    }

    #[test]
    fn the_same_message_is_one_that_says_the_same_to_the_same_over_the_same_way() {
        let message = datagram(ports::COAP, 0, &[1]);
        let mut queue = Queue::new(Some(3));
        let mut waits = frame(1, Join);
        waits.frame.content = whole(message.clone());
        queue.push(waits, 0).unwrap();
        let to = Some(Eui64::of_mote(MoteId(1)));
        assert!(queue.has_same(to, &whole(Datagram { packet: 7, ..message.clone() })));
        assert!(!queue.has_same(Some(Eui64::of_mote(MoteId(2))), &whole(message)));
        assert!(!queue.has_same(to, &whole(datagram(ports::COAP, 0, &[2]))));
        assert!(!queue.has_same(to, &Content::KeepAlive));
    }

    #[test]
    fn t13_a_queue_without_limit_takes_a_hundred() {
        let mut queue = Queue::new(None);
        for packet in 0..100 {
            queue.push(frame(packet, Data), 0).unwrap();
        }
        assert_eq!(queue.len(), 100);
    }

    #[test]
    fn a_frame_in_flight_takes_up_room_and_returns_to_the_front() {
        let mut queue = Queue::new(Some(2));
        queue.push(frame(1, Data), 0).unwrap();
        queue.push(frame(2, Data), 0).unwrap();
        let sent = queue.take(0);
        assert!(queue.push(frame(3, Data), 1).is_err());
        queue.put_back(sent);
        assert_eq!(order(&queue), [1, 2]);
    }

    #[test]
    fn a_newer_payload_takes_the_place_of_the_older_one() {
        let mut queue = Queue::new(Some(3));
        queue.push(Queued { is_latest_only: true, ..frame(1, Data) }, 0).unwrap();
        queue.push(frame(2, Data), 0).unwrap();
        let displaced = queue.push(Queued { is_latest_only: true, ..frame(3, Data) }, 0).unwrap();
        assert_eq!(displaced.unwrap().packet, 1);
        assert_eq!(order(&queue), [3, 2]);
    }
}
