//! Datagrams and their RPL packet information: RFC 6550, § 11.2.

use super::clauses::{joined, joined_storing, storing_dao};
use super::vectors::dao_of;
use super::*;
use crate::wire::datagram::RpiRepr;
use proto::time::SimDuration;

fn rpi(down: bool, sender_rank: u16) -> RpiRepr {
    let (rank_error, forwarding_error) = (false, false);
    RpiRepr { down, rank_error, forwarding_error, instance: 0, sender_rank }
}

impl Bench {
    fn data(&mut self, rpi: &mut RpiRepr, from: u32, to: u32) -> ForwardingDecision {
        let (now, to) = (self.now, mote(to).global());
        self.rpl.handle_data(rpi, mote(from), to, false, now, &mut self.dice)
    }
}

#[test]
fn rfc6550_11_2_2_2_the_first_rank_error_is_marked_and_the_second_one_drops() {
    for (down, wrong) in [(false, 512), (true, 1024)] {
        let mut bench = joined(Bench::perfect());
        bench.pass(60 * SimDuration::SECOND);
        bench.events();
        let mut info = rpi(down, wrong);
        assert_eq!(bench.data(&mut info, 5, 0), ForwardingDecision::Forward);
        assert!(info.rank_error);
        assert_eq!(info.sender_rank, 768);
        assert_eq!(bench.events(), []);
        info.sender_rank = wrong;
        assert_eq!(bench.data(&mut info, 5, 0), ForwardingDecision::Drop(DropReason::RankError));
        assert_eq!(bench.events(), [Event::TrickleReset]);
    }
}

#[test]
fn rfc6550_11_2_2_2_a_parent_that_sends_up_what_was_sent_up_to_it_is_no_parent() {
    let mut bench = joined(Bench::perfect());
    let mut info = rpi(false, 512);
    assert_eq!(bench.data(&mut info, 1, 0), ForwardingDecision::Forward);
    assert_eq!(bench.rpl.parent(), Some(mote(1)));
    assert_eq!(bench.data(&mut info, 1, 0), ForwardingDecision::Drop(DropReason::RankError));
    assert_eq!(bench.rpl.parent(), None);
    // To it alone the rank of before, then to all and to it that there is no way any more.
    assert_eq!(dio_ranks(&bench.sent()), [768, INFINITE_RANK, INFINITE_RANK]);
}

/// To whom DIOs went alone, and the rank in each.
fn told(bench: &mut Bench) -> Vec<(Eui64, u16)> {
    let rank = |message: &RplMessage| match message {
        RplMessage::Dio(dio) => dio.rank,
        other => panic!("{other:?}"),
    };
    let sent = bench.sent();
    sent.iter().filter_map(|one| Some((one.next_hop?, rank(&one.message)))).collect()
}

#[test]
fn who_sends_up_where_it_does_not_go_up_is_told_so() {
    let mut bench = joined(Config { advertises: false, ..Bench::perfect() });
    bench.sent();
    bench.data(&mut rpi(false, 1024), 5, 0);
    assert_eq!(told(&mut bench), []);
    bench.data(&mut rpi(false, 512), 5, 0);
    assert_eq!(told(&mut bench), [(mote(5), 768)]);
    // It has left, which the other has not heard.
    let now = bench.now;
    bench.rpl.handle_unusable(mote(1), now, &mut bench.dice);
    assert_eq!(bench.rpl.parent(), None);
    bench.sent();
    let decision = bench.data(&mut rpi(false, 1024), 5, 0);
    assert_eq!(decision, ForwardingDecision::Drop(DropReason::NotInDodag));
    assert_eq!(told(&mut bench), [(mote(5), INFINITE_RANK)]);
    // What comes down is for the one above to judge, and another instance none of ours.
    bench.data(&mut rpi(true, 1024), 1, 0);
    bench.data(&mut RpiRepr { instance: 3, ..rpi(false, 1024) }, 5, 0);
    assert_eq!(told(&mut bench), []);
}

#[test]
fn rfc6550_11_2_2_2_consistent_datagrams_pass_and_those_that_go_up_show_children() {
    let mut bench = joined(Bench::perfect());
    let mut up = rpi(false, 1024);
    assert_eq!(bench.data(&mut up, 5, 0), ForwardingDecision::Forward);
    assert_eq!((up.rank_error, up.sender_rank), (false, 768));
    assert_eq!(bench.events(), [Event::ChildAdded(mote(5))]);
    let mut down = rpi(true, 512);
    assert_eq!(bench.data(&mut down, 1, 9), ForwardingDecision::Forward);
    assert!(!down.rank_error);
    // Up from the parent is a loop, whatever it says.
    let mut circle = rpi(false, 0);
    bench.data(&mut circle, 1, 0);
    assert!(circle.rank_error);
    assert_eq!(
        bench.data(&mut RpiRepr { instance: 3, ..up }, 5, 0),
        ForwardingDecision::Drop(DropReason::NotInDodag)
    );
}

#[test]
fn rfc6550_11_2_what_turns_round_at_the_root_is_expected_to_go_down_from_there() {
    let mut root = Bench::new(Config::default(), 0, true);
    root.receive(1, false, &RplMessage::Dao(dao_of(1, 0, 240, 30)));
    root.receive(1, false, &RplMessage::Dao(dao_of(2, 1, 240, 30)));
    for to in [1, 2] {
        let mut info = rpi(false, 512);
        assert_eq!(root.data(&mut info, 1, to), ForwardingDecision::Forward);
        assert_eq!((info.down, info.rank_error, info.sender_rank), (true, false, 256), "{to}");
    }
    let mut info = rpi(false, 512);
    assert_eq!(root.data(&mut info, 1, 0), ForwardingDecision::Forward);
    assert!(!info.down, "it is for the root itself");
}

#[test]
fn rfc6550_11_2_what_turns_round_below_the_root_is_expected_to_go_down_from_there() {
    let mut bench = joined_storing(Config { dao_ack: false, ..Bench::perfect() });
    bench.receive(20, false, &RplMessage::Dao(storing_dao(20, 240, 30)));
    let mut info = rpi(false, 1024);
    assert_eq!(bench.data(&mut info, 5, 20), ForwardingDecision::Forward);
    assert!(info.down);
    let mut info = rpi(false, 1024);
    assert_eq!(bench.data(&mut info, 5, 40), ForwardingDecision::Forward);
    assert!(!info.down);
}

#[test]
fn a_child_that_comes_up_beside_or_is_silent_for_a_lifetime_is_none_any_more() {
    let mut bench = joined(Bench::perfect());
    bench.data(&mut rpi(false, 1024), 5, 0);
    bench.data(&mut rpi(false, 1024), 6, 0);
    bench.events();
    bench.hear(5, &dio_of(0, 768));
    assert_eq!(bench.events(), [Event::ChildRemoved(mote(5))]);
    for _ in 0..210 {
        bench.pass(10 * SimDuration::SECOND);
        bench.rpl.handle_rssi(mote(1), -60.0, bench.now);
    }
    assert!(bench.events().contains(&Event::ChildRemoved(mote(6))));
    assert_eq!(bench.rpl.children().count(), 0);
}

#[test]
fn rfc6550_11_2_2_3_without_a_route_down_a_datagram_goes_back_and_the_route_is_removed() {
    let mut low = joined_storing(Config { dao_ack: false, ..Bench::perfect() });
    let mut info = rpi(true, 512);
    assert_eq!(low.data(&mut info, 1, 40), ForwardingDecision::Return(mote(1)));
    assert!(info.forwarding_error);
    // The router above believed in a route through it.
    let mut high = joined_storing(Config { dao_ack: false, ..Bench::perfect() });
    high.receive(20, false, &RplMessage::Dao(storing_dao(40, 240, 30)));
    high.sent();
    assert_eq!(high.data(&mut info, 20, 40), ForwardingDecision::Return(mote(1)));
    assert_eq!(high.rpl.route(mote(40).global()), Some(Route::Up(mote(1))));
    assert_eq!(daos(&high.sent()).len(), 1, "a No-Path");
    let mut root = Bench::new(Config { mode: Mode::Storing, ..Config::default() }, 0, true);
    root.receive(1, false, &RplMessage::Dao(storing_dao(40, 240, 30)));
    assert_eq!(root.data(&mut info, 1, 40), ForwardingDecision::Drop(DropReason::ForwardingError));
    assert_eq!(root.rpl.route(mote(40).global()), None);
}
