//! How a mote finds a better parent than the one through which it has joined.

use super::*;
use proto::time::SimDuration;

/// Rank 1280, through mote 1.
fn below_four(config: Config) -> Bench {
    let mut bench = Bench::mote(Config { dao_ack: false, ..config });
    bench.hear(1, &dio_of(0, 1024));
    for _ in 0..64 {
        bench.link(1, 1, true);
    }
    assert_eq!(bench.rpl.rank(), 1280);
    bench.pass(200 * SimDuration::SECOND);
    bench
}

fn beacon(bench: &mut Bench, from: u32, join_metric: u8) {
    let now = bench.now;
    bench.rpl.handle_beacon(mote(from), join_metric, now, &mut bench.dice);
}

/// To whom a message went alone.
fn alone(sent: &[Outgoing]) -> Vec<(Eui64, &RplMessage)> {
    let routed = |one: &&Outgoing| !matches!(one.message, RplMessage::Dao(_));
    sent.iter().filter(routed).filter_map(|one| Some((one.next_hop?, &one.message))).collect()
}

#[test]
fn a_neighbour_whose_beacon_shows_that_it_is_nearer_to_the_root_is_asked() {
    let mut bench = below_four(Config::default());
    // DAGRanks of 5, 4 and 3 give at best 6, 5 and 4.
    beacon(&mut bench, 2, 4);
    beacon(&mut bench, 3, 3);
    assert_eq!(alone(&bench.pass(200 * SimDuration::SECOND)), []);
    beacon(&mut bench, 4, 2);
    beacon(&mut bench, 5, 0);
    beacon(&mut bench, 6, 1);
    let sent = bench.pass(136 * SimDuration::SECOND);
    let asked = alone(&sent);
    assert_eq!(asked.len(), 1);
    assert!(matches!(asked[0], (to, RplMessage::Dis(_)) if to == mote(5)), "{asked:?}");
}

#[test]
fn a_link_that_might_be_better_is_tried_until_it_is_known_to_be() {
    let mut bench = below_four(Config::default());
    bench.hear(2, &dio_of(0, 768));
    assert_eq!(bench.rpl.parent(), Some(mote(1)));
    let mut n_sent = 0;
    for _ in 0..20 {
        bench.rpl.handle_rssi(mote(1), -60.0, bench.now);
        let sent = bench.pass(90 * SimDuration::SECOND);
        for (to, message) in alone(&sent) {
            assert!(matches!(message, RplMessage::Dio(_)));
            assert_eq!(to, mote(2));
            n_sent += 1;
            bench.link(2, 1, true);
        }
    }
    // Of an assumed ETX of 3, six acknowledgments make one of 9/7; it is then better by a hop.
    assert_eq!(n_sent, 6);
    assert_eq!((bench.rpl.parent(), bench.rpl.rank()), (Some(mote(2)), 1024));
}

#[test]
fn a_gain_of_a_hop_is_taken_after_a_while_and_only_if_it_lasts() {
    let mut bench = below_four(Bench::perfect());
    bench.hear(2, &dio_of(0, 768));
    bench.pass(299 * SimDuration::SECOND);
    bench.hear(2, &dio_of(0, 1024));
    bench.hear(2, &dio_of(0, 768));
    bench.pass(299 * SimDuration::SECOND);
    assert_eq!(bench.rpl.parent(), Some(mote(1)));
    bench.pass(2 * SimDuration::SECOND);
    assert_eq!((bench.rpl.parent(), bench.rpl.rank()), (Some(mote(2)), 1024));
}

#[test]
fn q22_the_peer_neither_asks_nor_tries_nor_takes_a_small_gain() {
    let mut bench = Bench::mote(Config { stale_rank: true, dao_ack: false, ..Bench::perfect() });
    bench.hear(1, &dio_of(0, 1024));
    bench.hear(2, &dio_of(0, 768));
    beacon(&mut bench, 5, 0);
    assert_eq!(alone(&bench.pass(900 * SimDuration::SECOND)), []);
    assert_eq!(bench.rpl.parent(), Some(mote(1)));
}
