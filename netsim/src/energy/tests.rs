use super::*;
use proptest::prelude::*;
use proto::time::SimDuration;

const SLOT_NS: u64 = 10_000_000;

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0)
}

#[test]
fn charge_by_time_is_current_times_the_time_of_sending_and_listening() {
    // A frame of 100 bytes at 50 kbit/s lasts 108 · 0.16 ms, its acknowledgment of 19 bytes 27 · 0.16 ms.
    let airtime = Airtime::of_bytes(160_000, 6, 8);
    let model = Model::ByTime { tx_ma: 30.0, rx_ma: 20.0, airtime };
    let (frame_ms, ack_ms) = (108.0 * 0.16, 27.0 * 0.16);
    let charge_uc = |slot| model.charge_uc(slot, SimDuration::from_ns(50_000_000));
    for (slot, expected_uc) in [
        (SlotUse::Sleep, 0.0),
        (SlotUse::IdleListen, 20.0 * 2.2),
        (SlotUse::Scan, 20.0 * 50.0),
        (SlotUse::TxBroadcast { bytes: 100 }, 30.0 * frame_ms),
        (SlotUse::TxUnicast { bytes: 100, acked: true }, 30.0 * frame_ms + 20.0 * (0.2 + ack_ms)),
        (SlotUse::RxBroadcast { bytes: 100 }, 20.0 * (1.1 + frame_ms)),
        (SlotUse::RxUnicast { bytes: 100 }, 20.0 * (1.1 + frame_ms) + 30.0 * ack_ms),
    ] {
        assert!(close(charge_uc(slot), expected_uc), "{slot:?}: {}", charge_uc(slot));
    }
}

#[test]
fn charge_per_slot_is_the_table_of_the_6tisch_simulator() {
    let bytes = 90;
    for (slot, charge_uc) in [
        (SlotUse::IdleListen, 6.4),
        (SlotUse::TxUnicast { bytes, acked: true }, 54.5),
        (SlotUse::TxUnicast { bytes, acked: false }, 54.5),
        (SlotUse::TxBroadcast { bytes }, 49.5),
        (SlotUse::RxUnicast { bytes }, 32.6),
        (SlotUse::RxBroadcast { bytes }, 22.6),
        (SlotUse::Overhear { bytes }, 22.6),
        (SlotUse::Sleep, 0.0),
    ] {
        assert!(
            close(Model::PerSlot.charge_uc(slot, SimDuration::from_ns(SLOT_NS)), charge_uc),
            "{slot:?}"
        );
    }
}

#[test]
fn charge_by_length_is_the_regression_on_the_cc2650() {
    let bytes = 100;
    for (slot, charge_uc) in [
        (SlotUse::IdleListen, 21.816775),
        (SlotUse::Scan, 70.0),
        (SlotUse::TxUnicast { bytes, acked: true }, 34.5406 + 36.546091),
        (SlotUse::TxBroadcast { bytes }, 39.9234 + 13.671529),
        (SlotUse::RxUnicast { bytes }, 24.4439 + 38.344072),
        (SlotUse::RxBroadcast { bytes }, 25.8910 + 21.816775),
        (SlotUse::Sleep, 0.0),
    ] {
        assert!(
            close(Model::ByLength.charge_uc(slot, SimDuration::from_ns(SLOT_NS)), charge_uc),
            "{slot:?}"
        );
    }
}

#[test]
fn scanning_takes_charge_for_the_whole_slot() {
    for model in [Model::PerSlot, Model::ByLength] {
        let one = model.charge_uc(SlotUse::Scan, SimDuration::from_ns(SLOT_NS));
        assert!(3.0 * model.charge_uc(SlotUse::IdleListen, SimDuration::from_ns(SLOT_NS)) < one);
        assert!(close(
            model.charge_uc(SlotUse::Scan, SimDuration::from_ns(2 * SLOT_NS)),
            2.0 * one
        ));
    }
}

/// Q25, Q26: a current is a charge by a time, and the time is that in which the charge was taken.
#[test]
fn a_mote_that_scans_for_an_hour_has_the_same_current_afterwards_as_one_that_did_not() {
    let hour_slots = 360_000;
    let mut usage = Usage { scan: hour_slots, ..Usage::default() };
    let at_sync = usage;
    usage.idle_listen += hour_slots / 10;
    usage.sleep += hour_slots - hour_slots / 10;
    let since_sync = usage.since(&at_sync);
    let elapsed = since_sync.slots() * SLOT_NS;
    let current_ua = mean_current_ua(
        since_sync.charge_uc(Model::PerSlot, SimDuration::from_ns(SLOT_NS)),
        SimDuration::from_ns(elapsed),
    )
    .unwrap();
    // 6.4 µC in every tenth slot of 10 ms: 6.4 µC / 0.1 s.
    assert!(close(current_ua, 64.0));
    let whole = usage.slots() * SLOT_NS;
    let whole_ua = mean_current_ua(
        usage.charge_uc(Model::PerSlot, SimDuration::from_ns(SLOT_NS)),
        SimDuration::from_ns(whole),
    )
    .unwrap();
    // Half the time at 64 µA, half at 6.4 µC / 2.2 ms.
    assert!(close(whole_ua, (64.0 + 6.4e-6 / 2.2e-3 * 1e6) / 2.0));
}

#[test]
fn a_battery_of_2821_5_mah_lasts_a_year_at_322_microampere() {
    // 2821.5 mAh / 8760 h = 322.09 µA.
    let second_uc = 2821.5e3 / 8760.0;
    let years = lifetime_years(BATTERY_AA_MAH, second_uc * 60.0, SimDuration::from_s(60)).unwrap();
    assert!(close(years, 1.0));
    assert_eq!(lifetime_years(BATTERY_AA_MAH, 0.0, SimDuration::SECOND), None);
    assert_eq!(lifetime_years(BATTERY_AA_MAH, 1.0, SimDuration::ZERO), None);
    assert_eq!(duty_cycle(SimDuration::from_ns(1), SimDuration::ZERO), None);
}

#[test]
fn the_radio_is_on_for_the_frame_the_guard_time_and_the_acknowledgment() {
    let on = |slot| {
        let mut usage = Usage::default();
        usage.count(slot);
        usage.radio_on(SimDuration::from_ns(SLOT_NS), 19, &Airtime::O_QPSK_2450)
    };
    let (frame_ns, ack_ns) = ((6 + 127) * 32_000, (6 + 19) * 32_000);
    let bytes = 127;
    assert_eq!(on(SlotUse::Sleep), SimDuration::ZERO);
    assert_eq!(on(SlotUse::IdleListen), SimDuration::from_ns(2_200_000));
    assert_eq!(on(SlotUse::Scan), SimDuration::from_ns(SLOT_NS));
    assert_eq!(on(SlotUse::TxBroadcast { bytes }), SimDuration::from_ns(frame_ns));
    assert_eq!(
        on(SlotUse::TxUnicast { bytes, acked: true }),
        SimDuration::from_ns(frame_ns + 200_000 + ack_ns)
    );
    assert_eq!(
        on(SlotUse::TxUnicast { bytes, acked: false }),
        SimDuration::from_ns(frame_ns + 400_000)
    );
    assert_eq!(on(SlotUse::RxBroadcast { bytes }), SimDuration::from_ns(1_100_000 + frame_ns));
    assert_eq!(on(SlotUse::Overhear { bytes }), SimDuration::from_ns(1_100_000 + frame_ns));
    assert_eq!(
        on(SlotUse::RxUnicast { bytes }),
        SimDuration::from_ns(1_100_000 + frame_ns + ack_ns)
    );
}

fn any_use() -> impl Strategy<Value = SlotUse> {
    (0..8u8, 1u16..=127, any::<bool>()).prop_map(|(kind, bytes, acked)| match kind {
        0 => SlotUse::Sleep,
        1 => SlotUse::IdleListen,
        2 => SlotUse::Scan,
        3 => SlotUse::TxUnicast { bytes, acked },
        4 => SlotUse::TxBroadcast { bytes },
        5 => SlotUse::RxUnicast { bytes },
        6 => SlotUse::RxBroadcast { bytes },
        _ => SlotUse::Overhear { bytes },
    })
}

proptest! {
    #[test]
    fn totals_take_what_the_slots_take_one_by_one(
        slots in prop::collection::vec(any_use(), 0..200),
        split in 0usize..200,
    ) {
        for model in [Model::PerSlot, Model::ByLength] {
            let mut usage = Usage::default();
            let mut earlier = usage;
            let mut one_by_one_uc = 0.0;
            for (index, &slot) in slots.iter().enumerate() {
                if index == split {
                    earlier = usage;
                    one_by_one_uc = 0.0;
                }
                usage.count(slot);
                one_by_one_uc += model.charge_uc(slot, SimDuration::from_ns(SLOT_NS));
            }
            let since = usage.since(&earlier);
            prop_assert!(close(since.charge_uc(model, SimDuration::from_ns(SLOT_NS)), one_by_one_uc));
            prop_assert_eq!(usage.slots(), slots.len() as u64);
            prop_assert!(usage.radio_on(SimDuration::from_ns(SLOT_NS), 19, &Airtime::O_QPSK_2450) <= SimDuration::from_ns(usage.slots() * SLOT_NS));
        }
    }
}
