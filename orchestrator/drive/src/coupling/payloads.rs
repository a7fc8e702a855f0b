//! What is delivered is what was sent: the payloads that the network was given, for as long as they may still arrive.

use bytes::Bytes;
use proto::exchange::{NetworkStep, RobotsStep};
use proto::types::{Deliveries, MoteCommand, MoteOrder, Payloads};
use std::collections::VecDeque;
use std::sync::Arc;

/// What all payloads that are remembered may take (bytes).
const MAX_BYTES: usize = 32 << 20;
/// Periods whose payloads are remembered, at most.
const MAX_PERIODS: usize = 256;
/// Packets of orders that are remembered, at most.
const MAX_PACKETS: usize = 65_536;

/// The payloads that the network was given. A packet may arrive many periods after it was sent: older payloads are remembered
/// within limits of memory. Beyond them one that is not found is not held against the network.
#[derive(Debug, Default)]
pub(super) struct SentPayloads {
    /// What the robots broadcast, the latest last.
    periods: VecDeque<Period>,
    n_bytes: usize,
    /// Packets that were ordered, with their senders, the latest last.
    packets: VecDeque<(u32, Bytes)>,
    /// Something was forgotten.
    is_incomplete: bool,
}

/// What the robots broadcast in a period.
#[derive(Debug)]
struct Period {
    robots: Arc<RobotsStep>,
    /// Where the payload of each robot begins, and the last ends.
    begins: Vec<usize>,
}

impl Period {
    fn new(robots: Arc<RobotsStep>) -> Self {
        let mut begins = Vec::with_capacity(robots.payloads.len() + 1);
        let mut end = 0;
        begins.push(end);
        for &length in robots.payloads.length_bytes() {
            end += length as usize;
            begins.push(end);
        }
        Self { robots, begins }
    }

    fn payloads(&self) -> &Payloads {
        &self.robots.payloads
    }

    fn payload(&self, robot: u32) -> &[u8] {
        let robot = robot as usize;
        match self.begins.get(robot..robot + 2) {
            Some(&[begin, end]) => &self.payloads().data()[begin..end],
            _ => &[],
        }
    }

    fn n_bytes(&self) -> usize {
        self.payloads().data().len() + 12 * self.begins.len()
    }
}

impl SentPayloads {
    /// The network was given what is not known here: the steps before were taken by others.
    pub(super) fn forget(&mut self) {
        self.is_incomplete = true;
    }

    /// The network is given what the robots of `robots` say.
    pub(super) fn broadcast(&mut self, robots: &Arc<RobotsStep>) {
        if self.periods.back().is_some_and(|last| *last.payloads() == robots.payloads) {
            return;
        }
        let period = Period::new(Arc::clone(robots));
        self.n_bytes += period.n_bytes();
        self.periods.push_back(period);
        while MAX_PERIODS < self.periods.len() || MAX_BYTES < self.n_bytes && 1 < self.periods.len()
        {
            if let Some(oldest) = self.periods.pop_front() {
                self.n_bytes -= oldest.n_bytes();
                self.is_incomplete = true;
            }
        }
    }

    /// The network is given orders, or has taken some from elsewhere.
    pub(super) fn ordered(&mut self, commands: &[MoteCommand]) {
        for command in commands {
            if let MoteOrder::Send { mote, payload, .. } = &command.order {
                self.packets.push_back((*mote, payload.clone()));
            }
        }
        while MAX_PACKETS < self.packets.len() {
            self.packets.pop_front();
            self.is_incomplete = true;
        }
    }

    /// The first transmission whose payload its sender has not given. Networks that carry no payloads deliver empty ones.
    pub(super) fn first_unknown(&self, deliveries: &Deliveries) -> Option<usize> {
        let sent = &deliveries.transmissions;
        let mut payloads = sent.payloads.iter().enumerate();
        let unknown = payloads.find(|&(index, payload)| {
            !payload.is_empty() && !self.is_known(sent.sender[index], payload)
        });
        unknown.map(|(index, _)| index).filter(|_| !self.is_incomplete)
    }

    fn is_known(&self, sender: u32, payload: &[u8]) -> bool {
        let was_broadcast = |period: &Period| period.payload(sender) == payload;
        let was_ordered = |(mote, ordered): &(u32, Bytes)| *mote == sender && ordered == payload;
        self.periods.iter().rev().any(was_broadcast) || self.packets.iter().rev().any(was_ordered)
    }

    /// Checks the network's reply.
    ///
    /// # Errors
    ///
    /// What is wrong with it.
    pub(super) fn check(&mut self, reply: &NetworkStep) -> Result<(), String> {
        self.ordered(&reply.applied_commands);
        match self.first_unknown(&reply.deliveries) {
            None => Ok(()),
            Some(index) => Err(format!(
                "deliveries.transmissions.payloads: entry {index} is not a payload that robot {} sent",
                reply.deliveries.transmissions.sender[index]
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::types::Transmissions;

    fn said(payloads: &[&'static str]) -> Arc<RobotsStep> {
        let lengths = payloads.iter().map(|payload| payload.len() as u32).collect();
        let payloads = Payloads::new(lengths, payloads.concat().into()).unwrap();
        Arc::new(RobotsStep { payloads, ..RobotsStep::default() })
    }

    fn delivered(sender: u32, payload: &'static str) -> NetworkStep {
        let payloads =
            Payloads::new(vec![payload.len() as u32], Bytes::from_static(payload.as_bytes()));
        let transmissions = Transmissions {
            sender: vec![sender],
            sent_ns: vec![0],
            end_ns: vec![0],
            payloads: payloads.unwrap(),
            destination: Vec::new(),
        };
        let deliveries = Deliveries { transmissions, ..Deliveries::default() };
        NetworkStep { deliveries, ..NetworkStep::default() }
    }

    #[test]
    fn what_a_robot_never_said_is_found_and_what_it_said_before_is_not() {
        let mut sent = SentPayloads::default();
        sent.broadcast(&said(&["a0", "b0"]));
        sent.broadcast(&said(&["a1", "b1"]));
        for (sender, payload) in [(0, "a1"), (1, "b0"), (0, "")] {
            assert_eq!(sent.check(&delivered(sender, payload)), Ok(()), "{sender} {payload}");
        }
        let problem = sent.check(&delivered(0, "b1")).unwrap_err();
        assert_eq!(
            problem,
            "deliveries.transmissions.payloads: entry 0 is not a payload that robot 0 sent"
        );
        let order =
            MoteOrder::Send { mote: 0, destination: 1, payload: Bytes::from_static(b"hello") };
        sent.ordered(&[MoteCommand { source: "robots".to_owned(), order }]);
        assert_eq!(sent.check(&delivered(0, "hello")), Ok(()));
        assert!(sent.check(&delivered(1, "hello")).is_err());
    }

    #[test]
    fn what_may_have_been_forgotten_is_not_held_against_the_network() {
        let mut sent = SentPayloads::default();
        for _ in 0..MAX_PERIODS {
            sent.broadcast(&said(&["a0"]));
            sent.broadcast(&said(&["a1"]));
        }
        assert_eq!(sent.periods.len(), MAX_PERIODS);
        assert_eq!(sent.check(&delivered(0, "other")), Ok(()));
    }
}
