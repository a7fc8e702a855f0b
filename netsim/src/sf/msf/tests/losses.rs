//! Frames and acknowledgments are lost at random.

use super::*;
use proptest::prelude::*;

fn small() -> MsfConfig {
    MsfConfig {
        slotframe_slots: 23,
        max_num_cells: 10,
        lim_numcellsused_high: 7,
        lim_numcellsused_low: 2,
        wait_min_s: 3,
        wait_max_s: 6,
        ..MsfConfig::default()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn whatever_is_lost_both_ends_agree_or_one_is_told(
        seed: u64,
        frames in 0.0f64..0.6,
        acknowledgments in 0.0f64..0.6,
        loads in prop::collection::vec((0u32..4, 0u32..4, 0usize..3), 1..6),
    ) {
        let mut network = Network::with_seed(3, small(), seed);
        network.loss = (frames, acknowledgments);
        network.set_parent(2, Some(0));
        for (up, down, parent) in loads {
            network.set_parent(1, [Some(0), Some(2), None][parent]);
            for _ in 0..60 {
                if let Some(parent) = [Some(0), Some(2), None][parent] {
                    (0..up).for_each(|_| network.send_data(1, parent));
                    (0..down).for_each(|_| network.send_data(parent, 1));
                }
                network.run(23);
                let n_told: u32 = network.motes.iter().map(|mote| mote.n_inconsistent).sum();
                let n_failed: usize = network.motes.iter().map(|mote| mote.failures.len()).sum();
                if network.is_quiet() && n_told == 0 && n_failed == 0 {
                    prop_assert!(network.agrees(), "nobody was told, nothing failed");
                }
            }
        }
        // Without losses everything is found and mended: each cell is used, each end asks.
        network.loss = (0.0, 0.0);
        network.set_parent(1, Some(0));
        for _ in 0..900 {
            network.send_data(1, 0);
            network.send_data(2, 0);
            network.run(23);
        }
        for _ in 0..2000 {
            network.run(23);
            if network.is_quiet() {
                break;
            }
        }
        prop_assert!(network.is_quiet());
        prop_assert!(network.is_ready(1) && network.is_ready(2));
        for child in [1, 2] {
            let (tx, _) = negotiated(&network, child, 0);
            let (_, rx) = negotiated(&network, 0, child);
            prop_assert_eq!(tx, rx);
        }
        for mote in &network.motes {
            prop_assert_eq!(mote.sixtop.locked().count(), 0);
        }
    }

    #[test]
    fn a_snapshot_at_any_slot_holds_the_whole_state(seed: u64, at in 1u64..3000) {
        let mut network = Network::with_seed(2, small(), seed);
        network.loss = (0.3, 0.3);
        network.set_parent(1, Some(0));
        network.run(at);
        let bytes = postcard::to_allocvec(&network.motes[1].msf).unwrap();
        let restored: Msf = postcard::from_bytes(&bytes).unwrap();
        prop_assert_eq!(&restored, &network.motes[1].msf);
    }
}
