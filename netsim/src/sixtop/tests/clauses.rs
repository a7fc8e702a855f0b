//! Clauses of RFC 8480 beyond the vectors.

use super::*;
use proto::time::{SimDuration, SimTime};

#[test]
fn rfc8480_3_4_1_and_3_4_2_other_versions_and_functions_are_told_so() {
    let mut pair = Pair::new();
    pair.request(A, add(&[7]));
    let mut message = pair.take(A);
    message.version = 1;
    pair.hear(B, &message);
    let answer = pair.take(B);
    assert_eq!((code_of(&answer), answer.version), (ReturnCode::ErrorVersion, 0));
    message.version = 0;
    message.sfid = 77;
    pair.hear(B, &message);
    let answer = pair.take(B);
    assert_eq!((code_of(&answer), answer.sfid), (ReturnCode::ErrorSfid, 77));
    pair.hear(A, &SixpRepr { version: 3, ..answer });
    assert_eq!(pair.a.poll_transmit(), None, "answers are not answered");
    assert_eq!(pair.events(B), []);
}

#[test]
fn rfc8480_3_4_3_a_second_request_before_the_response_is_reset_as_if_it_had_never_been() {
    let mut pair = Pair::with_seqnum(5, 5);
    pair.request(A, add(&[7]));
    pair.carry(A);
    pair.a.abort(B);
    pair.request(A, delete(&[9]));
    pair.carry(A);
    let reset = pair.carry(B);
    assert_eq!((code_of(&reset), reset.seqnum), (ReturnCode::Reset, 6));
    assert_eq!(pair.seqnums(), (6, 5), "the first one has counted at A, the second one nowhere");
    pair.respond(B, success(&[7]));
    pair.carry(B);
    assert_eq!(pair.seqnums(), (6, 6));
    // A had given the first one up; B has completed it.
    assert!(pair.events(A).contains(&Event::Inconsistent { peer: B }));
}

#[test]
fn rfc8480_3_4_3_crossing_requests_are_both_refused_and_numbers_stay_equal() {
    for a_first in [true, false] {
        let mut pair = Pair::with_seqnum(5, 5);
        pair.request(A, add(&[7]));
        pair.request(B, add(&[8]));
        let (first, second) = if a_first { (A, B) } else { (B, A) };
        pair.carry(first);
        // The refusal overtakes the request that crossed.
        let crossing = pair.take(second);
        assert_eq!(code_of(&pair.carry(second)), ReturnCode::ErrorBusy);
        pair.hear(first, &crossing);
        pair.ack(second, &crossing, true);
        assert_eq!(code_of(&pair.carry(first)), ReturnCode::ErrorBusy);
        assert_eq!(pair.seqnums(), (6, 6));
        assert!(!pair.events(A).contains(&Event::Inconsistent { peer: B }));
        assert!(!pair.events(B).contains(&Event::Inconsistent { peer: A }));
        pair.assert_idle();
        pair.two_steps(add(&[7]), success(&[7]));
        assert_eq!(pair.seqnums(), (7, 7));
    }
}

#[test]
fn rfc8480_3_4_6_1_duplicates_are_ignored_at_every_step() {
    let mut pair = Pair::new();
    pair.request(A, add(&[]));
    let request = pair.carry(A);
    pair.hear(B, &request);
    assert_eq!(pair.events(B).len(), 1);
    pair.respond(B, success(&[7]));
    let response = pair.carry(B);
    pair.hear(A, &response);
    assert_eq!(pair.events(A).len(), 1);
    pair.a.confirm(B, success(&[7]), SimTime::START);
    pair.hear(A, &response);
    let confirmation = pair.carry(A);
    for message in [&request, &confirmation] {
        pair.hear(B, message);
    }
    pair.hear(A, &response);
    assert_eq!((pair.events(A).len(), pair.events(B).len()), (1, 1));
    assert_eq!(pair.seqnums(), (1, 1));
    pair.assert_idle();
}

#[test]
fn rfc8480_3_4_6_2_figure_33_a_response_that_is_never_acknowledged_is_an_inconsistency() {
    let mut pair = Pair::with_seqnum(87, 87);
    pair.request(A, add(&[7]));
    pair.carry(A);
    pair.events(B);
    pair.respond(B, success(&[7]));
    let response = pair.take(B);
    for _ in 0..3 {
        pair.hear(A, &response);
    }
    pair.ack(B, &response, false);
    assert_eq!(pair.events(A).len(), 1);
    assert_eq!(pair.events(B)[1], Event::Inconsistent { peer: A });
    assert_eq!(pair.seqnums(), (88, 87));
    // Should B do nothing about it, the next request tells both.
    pair.request(A, add(&[9]));
    pair.carry(A);
    let answer = pair.carry(B);
    assert_eq!((code_of(&answer), answer.seqnum), (ReturnCode::ErrorSeqnum, 87));
}

#[test]
fn rfc8480_3_4_6_a_response_that_comes_too_late_tells_that_the_ends_differ() {
    let mut pair = Pair::new();
    pair.request(A, add(&[7]));
    pair.carry(A);
    pair.respond(B, success(&[7]));
    let response = pair.take(B);
    pair.pass(2 * SimDuration::SECOND);
    pair.events(A);
    pair.hear(A, &response);
    pair.ack(B, &response, true);
    assert!(matches!(pair.events(B).last(), Some(Event::Completed { .. })));
    assert_eq!(pair.events(A), [Event::Inconsistent { peer: B }]);
    assert_eq!(pair.seqnums(), (1, 1), "numbers alone would not show it");
    pair.hear(A, &response);
    assert_eq!(pair.events(A), [], "once");
}

#[test]
fn rfc8480_3_4_6_a_confirmation_that_comes_too_late_tells_that_the_ends_differ() {
    let mut pair = Pair::new();
    pair.request(A, add(&[]));
    pair.carry(A);
    pair.respond(B, success(&[7]));
    pair.carry(B);
    pair.events(B);
    pair.pass(200 * SimDuration::SECOND);
    assert_eq!(pair.events(B), [failed(A, add(&[]), false, Failure::Timeout)]);
    let confirmation =
        SixpRepr { version: 0, sfid: 0, seqnum: 0, body: SixpBody::Confirmation(success(&[7])) };
    pair.hear(B, &confirmation);
    assert_eq!(pair.events(B), [Event::Inconsistent { peer: A }]);
}

#[test]
fn rfc8480_3_3_6_clear_is_taken_whatever_its_number_and_both_count_from_zero() {
    let mut pair = Pair::with_seqnum(17, 44);
    pair.two_steps(CLEAR, error(ReturnCode::Success));
    assert_eq!(pair.seqnums(), (0, 0));
    // Even if nothing came through: who did not hear it will find 0 where it expects something else.
    let mut pair = Pair::with_seqnum(17, 17);
    pair.request(A, CLEAR);
    let lost = pair.take(A);
    pair.ack(A, &lost, false);
    assert_eq!(pair.seqnums(), (0, 17));
}

#[test]
fn rfc8480_3_3_6_clears_that_cross_settle_both() {
    let mut pair = Pair::with_seqnum(3, 9);
    pair.request(A, CLEAR);
    pair.request(B, CLEAR);
    let (from_a, from_b) = (pair.take(A), pair.take(B));
    pair.hear(B, &from_a);
    pair.hear(A, &from_b);
    for at in [A, B] {
        let events = pair.events(at);
        assert!(
            matches!(&events[..], [Event::Answered { .. }, Event::Request { .. }]),
            "{events:?}"
        );
        pair.respond(at, error(ReturnCode::Success));
    }
    pair.carry(A);
    pair.carry(B);
    assert_eq!(pair.seqnums(), (0, 0));
    pair.assert_idle();
}

#[test]
fn rfc8480_3_3_6_the_next_request_may_overtake_the_acknowledgment_of_clears_response() {
    let mut pair = Pair::with_seqnum(3, 3);
    pair.request(A, CLEAR);
    pair.carry(A);
    pair.respond(B, error(ReturnCode::Success));
    let response = pair.take(B);
    pair.hear(A, &response);
    pair.request(A, add(&[7]));
    pair.carry(A);
    pair.ack(B, &response, true);
    assert!(matches!(pair.events(B).last(), Some(Event::Request { .. })));
    pair.respond(B, success(&[7]));
    pair.carry(B);
    assert_eq!(pair.seqnums(), (1, 1));
    pair.assert_idle();
}

#[test]
fn rfc8480_3_3_1_to_3_3_3_lists_that_are_too_short_and_options_without_meaning_are_refused() {
    let short = SixpRequest::Add(body(3, &[1, 2]));
    let short_delete = SixpRequest::Delete(body(2, &[1]));
    let mut no_cells = relocate(&[1]);
    if let SixpRequest::Relocate { num_cells, .. } = &mut no_cells {
        *num_cells = 0;
    }
    let neither = SixpRequest::Add(CellRequest { options: CellOptions(4), ..body(1, &[1]) });
    for (request, code) in [
        (short, ReturnCode::ErrorCellList),
        (short_delete, ReturnCode::ErrorCellList),
        (no_cells, ReturnCode::ErrorCellList),
        (neither, ReturnCode::Error),
    ] {
        let mut pair = Pair::new();
        pair.request(A, request);
        pair.carry(A);
        assert_eq!(pair.events(B), []);
        assert_eq!(code_of(&pair.carry(B)), code);
        assert_eq!(pair.seqnums(), (1, 1), "a refusal ends a transaction as any answer");
        assert_eq!(pair.events(B), []);
        pair.assert_idle();
    }
}

#[test]
fn cells_are_locked_as_long_as_a_transaction_may_use_them_and_no_longer() {
    // The simulator forgets locks when a BUSY takes the transaction's place; here they are read off the transactions.
    let mut pair = Pair::new();
    pair.request(A, relocate(&[7, 8]));
    let slots = |end: &Sixtop| (0..101).filter(|&slot| end.is_locked(slot)).collect::<Vec<_>>();
    assert_eq!(slots(&pair.a), [7, 8, 90]);
    pair.carry(A);
    assert_eq!(slots(&pair.b), [90]);
    pair.respond(B, success(&[8]));
    assert_eq!(slots(&pair.b), [8, 90]);
    pair.carry(B);
    pair.assert_idle();
}

#[test]
fn one_transaction_with_a_neighbour_at_a_time() {
    let mut sixtop = Sixtop::new(Config::default());
    assert_eq!(sixtop.request(B, add(&[7]), None, SimTime::START), Ok(()));
    assert_eq!(sixtop.request(B, add(&[8]), None, SimTime::START), Err(Busy(B)));
    assert_eq!(sixtop.request(A, add(&[8]), None, SimTime::START), Ok(()));
    assert_eq!(sixtop.poll_timeout(), Some(SimTime::from_ns(151_500_000_000)));
    assert_eq!(sixtop.open_request(B), Some(&add(&[7])));
    sixtop.reset();
    assert!(!sixtop.is_busy(B));
    assert_eq!(sixtop, Sixtop::new(Config::default()));
}

#[test]
fn a_snapshot_holds_open_transactions() {
    let mut pair = Pair::new();
    pair.request(A, add(&[7]));
    pair.carry(A);
    let bytes = postcard::to_allocvec(&pair.a).unwrap();
    let restored: Sixtop = postcard::from_bytes(&bytes).unwrap();
    assert_eq!(restored, pair.a);
}

#[test]
fn rfc8480_3_4_6_1_repeated_clears_and_responses_do_no_harm_to_the_transaction_after_them() {
    let mut pair = Pair::new();
    pair.request(A, CLEAR);
    let clear = pair.carry(A);
    pair.respond(B, error(ReturnCode::Success));
    let cleared = pair.carry(B);
    pair.request(A, add(&[7]));
    let request = pair.take(A);
    for message in [&clear, &request, &request] {
        pair.hear(B, message);
    }
    pair.hear(A, &cleared);
    pair.respond(B, success(&[7]));
    pair.carry(B);
    assert!(matches!(
        pair.events(A).last(),
        Some(Event::Answered { request: SixpRequest::Add(_), .. })
    ));
    assert!(matches!(
        &pair.events(B)[..],
        [
            Event::Request { .. },
            Event::Completed { .. },
            Event::Request { .. },
            Event::Completed { .. }
        ]
    ));
    assert_eq!(pair.seqnums(), (1, 1));
}

#[test]
fn rfc8480_3_4_6_1_a_second_clear_with_nothing_agreed_on_between_is_no_duplicate() {
    let mut pair = Pair::new();
    for _ in 0..3 {
        pair.two_steps(CLEAR, error(ReturnCode::Success));
        // It does not arrive, and is given up.
        pair.request(A, add(&[7]));
        pair.take(A);
        pair.a.abort(B);
        assert_eq!(pair.seqnums(), (0, 0));
    }
}

#[test]
fn rfc8480_3_3_6_what_waits_when_clear_is_done_carries_old_numbers_and_is_purged() {
    let mut pair = Pair::with_seqnum(4, 4);
    pair.two_steps(CLEAR, error(ReturnCode::Success));
    assert_eq!((pair.a.poll_purge(), pair.b.poll_purge()), (Some(B), Some(A)));
}

#[test]
fn rfc8480_3_4_6_2_an_agreement_after_a_refusal_of_the_same_number_is_an_inconsistency() {
    let mut pair = Pair::new();
    pair.request(A, add(&[7]));
    pair.carry(A);
    // A refusal that had waited since before the last CLEAR.
    let body = SixpBody::Response(error(ReturnCode::ErrorBusy));
    let stale = SixpRepr { version: VERSION, sfid: 0, seqnum: 0, body };
    pair.hear(A, &stale);
    pair.respond(B, success(&[7]));
    pair.carry(B);
    assert!(matches!(pair.events(B).last(), Some(Event::Completed { .. })));
    assert_eq!(pair.events(A).last(), Some(&Event::Inconsistent { peer: B }));
}
