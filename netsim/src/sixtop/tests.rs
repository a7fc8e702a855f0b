//! Two ends of 6P, messages carried by hand: the vectors S1 to S9.

mod clauses;

use super::receive::error;
use super::*;
use crate::wire::sixp::{CellOptions, CellRequest};
use proto::time::{SimDuration, SimTime};

const A: Eui64 = Eui64(0x0a);
const B: Eui64 = Eui64(0x0b);
fn cell(slot: u16) -> SixpCell {
    SixpCell { slot, channel: 3 }
}

fn body(num_cells: u8, slots: &[u16]) -> CellRequest {
    let cells = slots.iter().map(|&slot| cell(slot)).collect();
    CellRequest { metadata: 0, options: CellOptions(1), num_cells, cells }
}

fn add(slots: &[u16]) -> SixpRequest {
    SixpRequest::Add(body(1, slots))
}

fn delete(slots: &[u16]) -> SixpRequest {
    SixpRequest::Delete(body(1, slots))
}

fn relocate(candidates: &[u16]) -> SixpRequest {
    SixpRequest::Relocate {
        metadata: 0,
        options: CellOptions(1),
        num_cells: 1,
        relocation: vec![cell(90)],
        candidates: candidates.iter().map(|&slot| cell(slot)).collect(),
    }
}

const CLEAR: SixpRequest = SixpRequest::Clear { metadata: 0 };

fn success(slots: &[u16]) -> SixpAnswer {
    let cells = slots.iter().map(|&slot| cell(slot)).collect();
    SixpAnswer { code: ReturnCode::Success, content: AnswerContent::Cells(cells) }
}

/// Both ends, and what each has reported.
struct Pair {
    a: Sixtop,
    b: Sixtop,
    now: SimTime,
}

impl Pair {
    fn new() -> Self {
        Self {
            a: Sixtop::new(Config::default()),
            b: Sixtop::new(Config::default()),
            now: SimTime::START,
        }
    }

    fn with_seqnum(seqnum_a: u8, seqnum_b: u8) -> Self {
        let mut pair = Self::new();
        pair.a.peers.entry(B).or_default().seqnum = seqnum_a;
        pair.b.peers.entry(A).or_default().seqnum = seqnum_b;
        pair
    }

    fn seqnums(&self) -> (u8, u8) {
        (self.a.seqnum(B), self.b.seqnum(A))
    }

    fn end(&mut self, address: Eui64) -> &mut Sixtop {
        if address == A { &mut self.a } else { &mut self.b }
    }

    /// Takes the next message of an end, as the MAC does.
    fn take(&mut self, from: Eui64) -> SixpRepr {
        self.end(from).poll_transmit().expect("a message waits").1
    }

    fn ack(&mut self, from: Eui64, message: &SixpRepr, acknowledged: bool) {
        let now = self.now;
        let to = other(from);
        self.end(from).handle_sent(to, message, acknowledged, now);
    }

    fn hear(&mut self, at: Eui64, message: &SixpRepr) {
        let now = self.now;
        let from = other(at);
        self.end(at).handle_message(from, message, now);
    }

    /// Carries the next message of an end across, acknowledged.
    fn carry(&mut self, from: Eui64) -> SixpRepr {
        let message = self.take(from);
        self.hear(other(from), &message);
        self.ack(from, &message, true);
        message
    }

    fn request(&mut self, from: Eui64, request: SixpRequest) {
        let now = self.now;
        let to = other(from);
        self.end(from).request(to, request, Some(2 * SimDuration::SECOND), now).unwrap();
    }

    fn respond(&mut self, at: Eui64, answer: SixpAnswer) {
        let now = self.now;
        let to = other(at);
        self.end(at).respond(to, answer, now);
    }

    fn events(&mut self, at: Eui64) -> Vec<Event> {
        let end = self.end(at);
        std::iter::from_fn(|| end.poll_event()).collect()
    }

    /// Two steps from A to B, nothing lost. Returns the events at both ends.
    fn two_steps(&mut self, request: SixpRequest, answer: SixpAnswer) -> (Vec<Event>, Vec<Event>) {
        self.request(A, request);
        self.carry(A);
        assert!(matches!(self.events(B)[..], [Event::Request { peer: A, .. }]));
        self.respond(B, answer);
        self.carry(B);
        (self.events(A), self.events(B))
    }

    fn pass(&mut self, duration: SimDuration) {
        self.now += duration;
        let now = self.now;
        self.a.handle_timeout(now);
        self.b.handle_timeout(now);
    }

    fn assert_idle(&mut self) {
        for (address, peer) in [(A, B), (B, A)] {
            let end = self.end(address);
            assert!(!end.is_busy(peer));
            assert_eq!(end.locked().count(), 0);
            assert_eq!(end.poll_transmit(), None);
            assert_eq!(end.poll_timeout(), None);
        }
    }
}

fn other(address: Eui64) -> Eui64 {
    if address == A { B } else { A }
}

fn code_of(message: &SixpRepr) -> ReturnCode {
    match &message.body {
        SixpBody::Response(answer) | SixpBody::Confirmation(answer) => answer.code,
        SixpBody::Request(_) => panic!("a request: {message:?}"),
    }
}

fn failed(peer: Eui64, request: SixpRequest, is_initiator: bool, why: Failure) -> Event {
    Event::Failed { peer, request, is_initiator, why }
}

#[test]
fn s1_numbers_grow_by_one_at_both_ends_and_skip_zero() {
    for (before, after) in [(0, 1), (1, 2), (2, 3), (100, 101), (200, 201), (254, 255), (255, 1)] {
        let mut pair = Pair::with_seqnum(before, before);
        pair.two_steps(add(&[7, 8]), success(&[8]));
        assert_eq!(pair.seqnums(), (after, after));
        pair.assert_idle();
    }
}

#[test]
fn s2_a_number_that_is_not_expected_is_answered_with_rc_err_seqnum_and_reported() {
    // The simulator compares zero with not zero; RFC 8480, § 3.4.6.2, every number. The answer's number is the one its
    // sender keeps, 0 to a neighbour that has lost its state (figures 31 and 32).
    for (own, theirs, answered) in [(0, 1, 1), (88, 0, 0), (0, 98, 0), (7, 9, 9), (9, 7, 7)] {
        let mut pair = Pair::with_seqnum(own, theirs);
        pair.request(A, add(&[7]));
        pair.carry(A);
        assert_eq!(pair.events(B), [Event::Inconsistent { peer: A }]);
        let answer = pair.carry(B);
        assert_eq!(code_of(&answer), ReturnCode::ErrorSeqnum);
        assert_eq!(answer.seqnum, if own == 0 { 0 } else { answered });
        let [Event::Answered { answer, awaits_confirmation: false, .. }] = &pair.events(A)[..]
        else {
            panic!("not told");
        };
        assert_eq!(answer.code, ReturnCode::ErrorSeqnum);
        assert_eq!(pair.seqnums(), (own, theirs), "CLEAR alone reconciles them");
        pair.assert_idle();
        pair.two_steps(CLEAR, error(ReturnCode::Success));
        assert_eq!(pair.seqnums(), (0, 0));
    }
}

#[test]
fn s3_a_new_request_while_three_steps_await_their_confirmation_is_refused_as_busy() {
    let mut pair = Pair::new();
    pair.request(A, add(&[]));
    pair.carry(A);
    pair.respond(B, success(&[7, 8]));
    let lost = pair.take(B);
    pair.pass(2 * SimDuration::SECOND);
    assert_eq!(pair.events(A), [failed(B, add(&[]), true, Failure::Timeout)]);
    pair.request(A, delete(&[9]));
    pair.carry(A);
    let answer = pair.carry(B);
    assert_eq!((code_of(&answer), answer.seqnum), (ReturnCode::ErrorBusy, 1));
    assert!(
        matches!(&pair.events(A)[..], [Event::Answered { answer, .. }] if answer.code == ReturnCode::ErrorBusy)
    );
    // The response comes late: § 3.4.5 has A say that it is over. Both have counted both transactions.
    pair.hear(A, &lost);
    assert_eq!(code_of(&pair.carry(A)), ReturnCode::Reset);
    assert_eq!(pair.events(B)[1..], [failed(A, add(&[]), false, Failure::Refused)]);
    assert_eq!(pair.seqnums(), (2, 2));
    pair.assert_idle();
}

#[test]
fn s4_unanswered_requests_time_out_at_the_initiator_and_lost_responses_at_the_responder() {
    let count = SixpRequest::Count { metadata: 0, options: CellOptions(0) };
    let mut pair = Pair::new();
    pair.request(A, count.clone());
    pair.carry(A);
    pair.pass(SimDuration::SECOND);
    assert_eq!(pair.events(A), []);
    pair.pass(SimDuration::SECOND);
    assert_eq!(pair.events(A), [failed(B, count.clone(), true, Failure::Timeout)]);
    assert_eq!(pair.a.poll_purge(), Some(B));

    pair.events(B);
    let counted = SixpAnswer { code: ReturnCode::Success, content: AnswerContent::Count(0) };
    pair.respond(B, counted);
    let removed_from_the_queue = pair.take(B);
    drop(removed_from_the_queue);
    pair.pass(75 * SimDuration::SECOND);
    assert_eq!(pair.events(B), []);
    pair.pass(SimDuration::SECOND);
    assert_eq!(pair.events(B), [failed(A, count, false, Failure::Timeout)]);
    assert_eq!(pair.b.poll_purge(), Some(A));
    pair.assert_idle();
}

#[test]
fn s5_a_request_that_crosses_a_clear_is_refused_once_as_busy_with_number_zero() {
    let mut pair = Pair::new();
    pair.request(A, add(&[7]));
    let stale = pair.take(A);
    pair.request(B, CLEAR);
    let clear = pair.take(B);
    pair.hear(B, &stale);
    let busy = pair.take(B);
    assert_eq!((code_of(&busy), busy.seqnum), (ReturnCode::ErrorBusy, 0));
    pair.hear(B, &stale);
    assert_eq!(pair.b.poll_transmit(), None, "once");
    // CLEAR ends what A had begun; the refusal that comes after it means nothing any more.
    pair.hear(A, &clear);
    assert_eq!(pair.events(A)[0], failed(B, add(&[7]), true, Failure::Aborted));
    pair.ack(B, &clear, true);
    pair.hear(A, &busy);
    pair.ack(B, &busy, true);
    pair.respond(A, error(ReturnCode::Success));
    pair.carry(A);
    assert!(matches!(&pair.events(B)[..], [Event::Answered { request: CLEAR, .. }]));
    assert_eq!(pair.seqnums(), (0, 0));
    pair.assert_idle();
}

#[test]
fn s6_abort_empties_table_and_queue_at_either_end() {
    // Request pending.
    let mut pair = Pair::new();
    pair.request(A, add(&[7]));
    pair.a.abort(B);
    assert_eq!(pair.events(A), [failed(B, add(&[7]), true, Failure::Aborted)]);
    assert_eq!(pair.seqnums(), (0, 0), "a request that never arrived does not count");
    pair.assert_idle();
    // Confirmation pending.
    pair.request(A, add(&[]));
    pair.carry(A);
    pair.respond(B, success(&[7, 8]));
    pair.carry(B);
    pair.a.confirm(B, success(&[7]), SimTime::START);
    pair.events(A);
    pair.a.abort(B);
    assert_eq!(
        pair.events(A),
        [failed(B, add(&[]), true, Failure::Aborted), Event::Inconsistent { peer: B }],
        "the confirmation may be in the air"
    );
    assert_eq!(pair.a.poll_transmit(), None);
    // Responder.
    pair.events(B);
    pair.b.abort(A);
    assert_eq!(pair.events(B), [failed(A, add(&[]), false, Failure::Aborted)]);
    assert_eq!((pair.a.poll_purge(), pair.b.poll_purge()), (Some(B), Some(A)));
    pair.assert_idle();
}

#[test]
fn s7_a_message_that_finds_no_place_in_the_queue_fails_the_transaction() {
    let mut pair = Pair::new();
    pair.request(A, add(&[7]));
    let request = pair.take(A);
    pair.ack(A, &request, false);
    assert_eq!(pair.events(A), [failed(B, add(&[7]), true, Failure::NotSent)]);
    assert_eq!(pair.seqnums(), (0, 0));
    pair.assert_idle();

    pair.request(A, add(&[7]));
    pair.carry(A);
    pair.events(B);
    pair.respond(B, success(&[7]));
    let response = pair.take(B);
    pair.ack(B, &response, false);
    // Figure 33: it may have arrived all the same.
    assert_eq!(
        pair.events(B),
        [failed(A, add(&[7]), false, Failure::NotSent), Event::Inconsistent { peer: A }]
    );
}

#[test]
fn s8_add_delete_and_relocate_complete_in_two_steps_and_in_three() {
    for (two, three) in [
        (add(&[7, 8]), add(&[])),
        (delete(&[7, 8]), delete(&[])),
        (relocate(&[7, 8]), relocate(&[])),
    ] {
        let mut pair = Pair::new();
        let (at_a, at_b) = pair.two_steps(two.clone(), success(&[8]));
        let answer = success(&[8]);
        assert_eq!(
            at_a,
            [Event::Answered {
                peer: B,
                request: two.clone(),
                answer: answer.clone(),
                awaits_confirmation: false
            }]
        );
        assert_eq!(
            at_b,
            [Event::Completed { peer: A, request: two, response: answer, confirmation: None }]
        );

        let (offer, choice) = (success(&[7, 8]), success(&[7]));
        let (at_a, at_b) = pair.two_steps(three.clone(), offer.clone());
        let answered = Event::Answered {
            peer: B,
            request: three.clone(),
            answer: offer.clone(),
            awaits_confirmation: true,
        };
        assert_eq!((at_a, at_b), (vec![answered], vec![]));
        pair.a.confirm(B, choice.clone(), SimTime::START);
        let confirmation = Some(choice.clone());
        pair.carry(A);
        assert_eq!(
            pair.events(A),
            [Event::Confirmed { peer: B, request: three.clone(), confirmation: choice }]
        );
        assert_eq!(
            pair.events(B),
            [Event::Completed { peer: A, request: three, response: offer, confirmation }]
        );
        assert_eq!(pair.seqnums(), (2, 2));
        pair.assert_idle();
    }
}

#[test]
fn s9_default_timeouts_grow_with_the_messages_still_to_come() {
    let config = Config::default();
    let ms = |config: &Config, role, is_three_step| {
        timeout::default_for(config, role, is_three_step) / 1_000_000
    };
    assert_eq!(ms(&config, Role::Responder, false), SimDuration::from_ns(75_750));
    assert_eq!(ms(&config, Role::Initiator, false), SimDuration::from_ns(151_500));
    assert_eq!(ms(&config, Role::Responder, true), SimDuration::from_ns(151_500));
    assert_eq!(ms(&config, Role::Initiator, true), SimDuration::from_ns(227_250));
    let ten = Config { slotframe: SimDuration::from_ns(100_000_000), ..config };
    assert_eq!(ms(&ten, Role::Responder, false), SimDuration::from_ns(7_500));
}
