//! Buffers of a slot, kept from slot to slot so that a slot allocates nothing.

use crate::mac::tsch::{Listening, Outgoing, Transmission};
use crate::mote::Brought;
use crate::wire::frame::FrameRepr;
use physics::asn::Asn;
use physics::medium::slot::{self, Acknowledgment, OnAir, Reception};
use proto::ids::MoteId;

/// What a mote sends in the slot.
#[derive(Debug)]
pub(super) struct Sending {
    pub(super) sender: MoteId,
    pub(super) transmission: Transmission,
    pub(super) beacon: Option<FrameRepr>,
    pub(super) psdu_bytes: u16,
    /// Number in the inbox, if it is a payload of the swarm for everyone.
    pub(super) payload: Option<u32>,
    /// How many received it, and how many listened in reach and did not.
    pub(super) n_received: u32,
    pub(super) n_missed: u32,
    /// Who shall acknowledge it, and has.
    pub(super) answered_by: Option<MoteId>,
    /// How much later than it came the mote that acknowledges it had expected it (ns).
    pub(super) correction_ns: i64,
    pub(super) acknowledged: bool,
}

impl Sending {
    pub(super) fn frame(&self) -> &FrameRepr {
        match (&self.transmission.outgoing, &self.beacon) {
            (Outgoing::Frame(queued), _) => &queued.frame,
            (Outgoing::Beacon, Some(beacon)) => beacon,
            (Outgoing::Beacon, None) => unreachable!("a beacon is made when it is sent"),
        }
    }
}

/// Room for what a slot needs, kept from slot to slot.
#[derive(Debug)]
pub(super) struct Scratch {
    pub(super) awake: Vec<MoteId>,
    pub(super) sending: Vec<Sending>,
    pub(super) on_air: Vec<OnAir>,
    /// By mote: the slot in which it was last looked at as a listener or sender, plus one.
    pub(super) seen: Vec<Asn>,
    pub(super) listeners: Vec<(MoteId, Listening)>,
    pub(super) heard: Vec<slot::Listening>,
    pub(super) receptions: Vec<Reception>,
    pub(super) answers: Vec<Acknowledgment>,
    pub(super) touched: Vec<MoteId>,
    /// Payloads of the swarm that unicast frames brought.
    pub(super) swarm: Vec<Brought>,
}

impl Scratch {
    pub(super) fn new(n: usize) -> Self {
        Self {
            awake: Vec::new(),
            sending: Vec::new(),
            on_air: Vec::new(),
            seen: vec![Asn::FIRST; n],
            listeners: Vec::new(),
            heard: Vec::new(),
            receptions: Vec::new(),
            answers: Vec::new(),
            touched: Vec::new(),
            swarm: Vec::new(),
        }
    }
}
