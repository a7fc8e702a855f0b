//! Clauses of RFC 6719 that need a whole machine.

use super::*;
use crate::wire::rpl::DodagConfiguration;
use proto::ids::MoteId;
use proto::time::SimDuration;

/// A DIO of a DODAG that uses MRHOF.
fn mrhof_dio(rank: u16) -> DioRepr {
    let dio = dio_of(0, rank);
    let configuration = dio.configuration.map(|c| DodagConfiguration { objective: 1, ..c });
    DioRepr { configuration, ..dio }
}

#[test]
fn rfc6719_5_the_parent_set_has_three_members() {
    let mut bench = Bench::mote(Bench::perfect());
    for from in 1..8 {
        bench.hear(from, &mrhof_dio(500 + from as u16));
    }
    assert_eq!(bench.rpl.parent_set(bench.now), [mote(1), mote(2), mote(3)]);
}

#[test]
fn rfc6719_3_3_rank_is_the_largest_of_the_three_that_the_parent_set_gives() {
    let mut dice = Dice::new(7, Purpose::Routing, MoteId(0));
    let mut n_sets = [0; 4];
    for max_rank_increase in [0, 100, 300, 7168] {
        for hop in [64, 256] {
            let mut bench = Bench::mote(Config { parent_set_size: 8, ..Bench::perfect() });
            for _ in 0..500 {
                let mut dio = mrhof_dio(256 + dice.below(2000) as u16);
                let configuration = dio.configuration.as_mut().unwrap();
                configuration.min_hop_rank_increase = hop;
                configuration.max_rank_increase = max_rank_increase;
                let from = 1 + dice.below(6) as u32;
                bench.hear(from, &dio);
                bench.link(from, 1 + dice.below(3) as u16, true);
                bench.pass(SimDuration::SECOND);
                let parents = bench.rpl.parent_set(bench.now);
                n_sets[parents.len().min(3)] += 1;
                let Some(preferred) = bench.rpl.parent() else { continue };
                let heard = |parent| bench.rpl.neighbours.get(parent).unwrap();
                let via = |parent| {
                    let one = heard(parent);
                    Objective::mrhof().rank_via(one.dio.rank, &one.etx, hop).unwrap()
                };
                let advertised = parents.iter().map(|&one| heard(one).dio.rank).max().unwrap();
                let largest = parents.iter().map(|&one| via(one)).max().unwrap();
                let bound = if max_rank_increase == 0 { u16::MAX } else { max_rank_increase };
                let three =
                    [via(preferred), hop * (1 + advertised / hop), largest.saturating_sub(bound)];
                assert_eq!(bench.rpl.rank(), three.into_iter().max().unwrap(), "{three:?}");
            }
        }
    }
    // Sets of every size occur, or nothing was compared.
    assert!(n_sets[1..].iter().all(|&n| 100 < n), "{n_sets:?}");
}

#[test]
fn rfc6719_3_2_2_mrhof_switches_beyond_192() {
    for (rank, parent) in [(1024 - 192, 1), (1024 - 193, 2)] {
        let mut bench = Bench::mote(Bench::perfect());
        bench.hear(1, &mrhof_dio(1024));
        bench.hear(2, &mrhof_dio(rank));
        assert_eq!(bench.rpl.parent(), Some(mote(parent)));
    }
}
