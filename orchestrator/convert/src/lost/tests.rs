use super::*;
use crate::account::RejectedRows;
use measure::memory::MemoryBudget;
use std::path::Path;

const MS: i64 = 1_000_000;
const S: i64 = 1000 * MS;

/// A row of a log: time (ns), sender, receiver, number.
type Row = (i64, u32, u32, u32);

/// A column's name, and its value in a row.
type Column<'a> = (&'a str, &'a dyn Fn(&Row) -> f64);

fn frame(rows: &[Row], columns: &[Column<'_>]) -> Frame {
    let mut frame = Frame { lines: (2..2 + rows.len()).collect(), ..Frame::default() };
    frame.times_ns.insert("time_s".to_owned(), rows.iter().map(|row| row.0).collect());
    let mut add = |name: &str, value: &dyn Fn(&Row) -> f64| {
        frame.columns.push((name.to_owned(), rows.iter().map(value).collect()));
    };
    add("tx", &|row| f64::from(row.1));
    add("rx", &|row| f64::from(row.2));
    add("sequence", &|row| f64::from(row.3));
    add("received", &|_| 1.0);
    add("rssi_dbm", &|_| -70.0);
    columns.iter().for_each(|(name, value)| add(name, value));
    frame
}

fn add_lost(frame: &mut Frame, modulus: Option<u64>) -> (Added, Vec<RejectedRows>) {
    let mut rejected = Vec::new();
    let mut account = Account { file: Path::new("x"), n_read: 0, rejected: &mut rejected };
    let mut memory = Memory::new(MemoryBudget::default());
    let added = add_lost_frames(frame, 1, modulus, &mut account, &mut memory).unwrap();
    (added, rejected)
}

/// The rows that are added to a log: time (ns), sender, receiver, number; in order.
fn lost(rows: &[Row], modulus: Option<u64>) -> Vec<Row> {
    let mut frame = frame(rows, &[]);
    add_lost(&mut frame, modulus);
    lost_rows(&frame)
}

fn lost_rows(frame: &Frame) -> Vec<Row> {
    let column = |name: &str| frame.column(name).unwrap();
    let is_lost = |row: &usize| column("received")[*row] == 0.0;
    let mut rows: Vec<Row> = (0..frame.n_rows())
        .filter(is_lost)
        .map(|row| {
            let number = |name: &str| column(name)[row] as u32;
            (frame.time_ns().unwrap()[row], number("tx"), number("rx"), number("sequence"))
        })
        .collect();
    rows.sort_unstable();
    rows
}

/// A frame each second from sender 7, whose numbers are the times (s), as receiver 1 logs it.
fn each_second(times_s: impl IntoIterator<Item = u32>) -> Vec<Row> {
    times_s.into_iter().map(|s| (i64::from(s) * S, 7, 1, s)).collect()
}

#[test]
fn a_number_that_is_missing_becomes_a_lost_frame_with_what_is_known_of_it() {
    let mut rows = each_second([0, 1, 2, 5, 6, 7]);
    // Receiver 2 logs number 4, and number 6 not.
    rows.extend([0, 1, 2, 4, 5, 7].map(|s| (i64::from(s) * S + 10 * MS, 7, 2, s)));
    let time_s = |row: &Row| row.0 as f64 / S as f64;
    let mut log = frame(
        &rows,
        &[
            ("channel", &|row| f64::from(11 + row.3)),
            ("tx_x_m", &|row| 2.0 * time_s(row)),
            ("rx_x_m", &|row| f64::from(row.2)),
            ("rx_snr_db", &|_| 9.0),
            ("temperature_c", &|row| 20.0 + 0.5 * time_s(row)),
            ("power_level", &|row| if row.3 < 4 { 3.0 } else { 5.0 }),
        ],
    );
    let (added, rejected) = add_lost(&mut log, None);
    assert!(rejected.is_empty() && added.n_lost == 4, "{added:?}");
    // Receiver 2 logged number 4; its clock is 10 ms ahead.
    let expected = [(3000, 1, 3), (3010, 2, 3), (4000, 1, 4), (6010, 2, 6)];
    assert_eq!(lost_rows(&log), expected.map(|(ms, rx, number)| (ms * MS, 7, rx, number)));
    let at = |name: &str, rx: f64, sequence: f64| {
        let row = (rows.len()..log.n_rows()).find(|&row| {
            log.column("rx").unwrap()[row] == rx && log.column("sequence").unwrap()[row] == sequence
        });
        log.column(name).unwrap()[row.unwrap()]
    };
    // Receiver 2 knows the channel of number 4, and none that of number 3.
    assert_eq!(at("channel", 1.0, 4.0), 15.0);
    assert!(at("channel", 1.0, 3.0).is_nan() && at("rssi_dbm", 1.0, 4.0).is_nan());
    assert!(at("rx_snr_db", 1.0, 4.0).is_nan());
    assert!((at("tx_x_m", 1.0, 4.0) - 8.0).abs() < 1e-9);
    assert_eq!(at("rx_x_m", 1.0, 4.0), 1.0);
    assert!((at("temperature_c", 1.0, 4.0) - 22.0).abs() < 1e-9);
    assert_eq!((at("power_level", 1.0, 3.0), at("power_level", 1.0, 4.0)), (3.0, 5.0));
    let gaps: Vec<_> = added.gaps.iter().map(|g| (g.receiver, g.arrived, g.missing)).collect();
    assert_eq!(gaps, [(Some(1), 6, 2), (Some(2), 6, 2)]);
}

#[test]
fn what_others_logged_before_and_after_was_lost_while_the_receiver_was_logging() {
    let mut rows = each_second(0..20);
    // Receiver 2 logs from 2 s to 17 s, as frames of sender 8 show.
    rows.extend([(2 * S, 8, 2, 1), (17 * S, 8, 2, 2)]);
    rows.extend([8, 9].map(|s| (i64::from(s) * S, 7, 2, s)));
    let found = lost(&rows, None);
    let expected: Vec<Row> =
        (2..18).filter(|s| ![8, 9].contains(s)).map(|s| (i64::from(s) * S, 7, 2, s)).collect();
    assert_eq!(found, expected);
    // A log in order of time stays so.
    let mut log = frame(&each_second([0, 1, 4, 5]), &[]);
    add_lost(&mut log, None);
    assert_eq!(log.time_ns().unwrap(), [0, 1, 2, 3, 4, 5].map(|s| s * S));
    assert_eq!(log.column("received").unwrap(), [1.0, 1.0, 0.0, 0.0, 1.0, 1.0]);
    // A receiver that logged no frame of a sender may not have listened to it.
    assert!(!found.iter().any(|row| row.1 == 8));
}

#[test]
fn a_restart_a_damaged_number_and_a_repeat_add_nothing() {
    // A sender of 16-bit numbers restarts; then a number is damaged.
    let mut numbers: Vec<u32> =
        (64_990..65_010).chain(0..20).chain([30_000]).chain(21..40).collect();
    let rows = |numbers: &[u32]| -> Vec<Row> {
        (0..).zip(numbers).map(|(s, &number)| (s * S, 7, 1, number)).collect()
    };
    let mut log = frame(&rows(&numbers), &[]);
    let (added, rejected) = add_lost(&mut log, None);
    assert!(rejected.is_empty());
    assert_eq!((added.n_lost, added.gaps[0].restarts), (0, 3));
    // With 8 bits, 250 → 3 in one second is a restart or eight lost frames.
    numbers = (200..=250).chain(3..30).collect();
    assert_eq!(lost(&rows(&numbers), Some(256)).len(), 8);
    assert_eq!(lost(&rows(&numbers), Some(1 << 16)).len(), 0);
    // The same number again, soon.
    let mut repeated = each_second(0..10);
    repeated.insert(5, (4 * S + 20 * MS, 7, 1, 4));
    repeated.push((3 * S, 7, 1, 3));
    let mut log = frame(&repeated, &[]);
    let (added, rejected) = add_lost(&mut log, None);
    assert_eq!((added.n_lost, log.n_rows()), (0, 10));
    assert_eq!((&*rejected[0].reason, rejected[0].rows), (LOGGED_BEFORE, 2));
}

#[test]
fn numbers_that_do_not_count_are_rejected() {
    let rows = |number: &dyn Fn(u32) -> u32| -> Vec<Row> {
        (0..200).map(|s| (i64::from(s) * S, 7, 1, number(s))).collect()
    };
    let mixed = |s: u32| (s.wrapping_mul(2_654_435_761) >> 13) % 256;
    for number in [&|_| 5, &mixed] as [&dyn Fn(u32) -> u32; 2] {
        let mut log = frame(&rows(number), &[]);
        let (added, rejected) = add_lost(&mut log, None);
        assert_eq!((added.n_lost, log.n_rows(), rejected[0].rows), (0, 0, 200));
        assert_eq!(rejected[0].reason, NO_COUNT);
    }
    let mut log = frame(&each_second([0, 1, 3]), &[]);
    log.columns[2].1[0] = f64::NAN;
    log.columns[2].1[1] = 300.0;
    let (added, rejected) = add_lost(&mut log, Some(256));
    assert_eq!((added.n_lost, rejected.len()), (0, 2));
    assert_eq!(rejected[0].reason, "sequence is not below sequence_modulus");
}

#[test]
fn frames_for_one_receiver_each_are_noticed() {
    let rows: Vec<Row> = (0..200u32).map(|s| (i64::from(s) * S, 7, 1 + s % 2, s)).collect();
    assert_eq!(add_lost(&mut frame(&rows, &[]), None).0.n_unshared, 1);
    let shared: Vec<Row> = each_second(0..200).into_iter().chain(rows).collect();
    let shared: Vec<Row> = shared.into_iter().filter(|row| row.2 == 2 || row.3 % 3 == 0).collect();
    assert_eq!(add_lost(&mut frame(&shared, &[]), None).0.n_unshared, 0);
}

/// Times (ns) of lost frames by sender, receiver and number.
type LostTimes = BTreeMap<(u32, u32, u32), Vec<i64>>;

/// Three senders with numbers of 8 bits, ten frames a second, evenly or by chance; and four receivers that log a frame with a probability
/// of 0.9 to 0.15, have an outage of a minute each, and clocks that differ by up to `skew_ns`. Returns the log, and the times at which
/// each receiver lost frames of a sender and number.
fn campaign(skew_ns: i64, is_even: bool) -> (Vec<Row>, LostTimes) {
    let mut state = 1u64;
    let mut uniform = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1u32 << 31)
    };
    let (mut log, mut lost) = (Vec::new(), BTreeMap::new());
    for tx in 10..13 {
        let mut sent_ns = 0;
        for number in 0..3000u32 {
            let periods = if is_even { 1.0 } else { -libm::log(1.0 - uniform()) };
            sent_ns += (periods * 100e6) as i64;
            for rx in 0..4u32 {
                let from_ns = 50 * S * i64::from(rx + 1);
                let is_received = uniform() < 0.9 - 0.25 * f64::from(rx)
                    && !(from_ns..from_ns + 60 * S).contains(&sent_ns);
                let time_ns = sent_ns + skew_ns * i64::from(rx) / 3;
                let sequence = (number + 17 * tx) % 256;
                if is_received {
                    log.push((time_ns, tx, rx, sequence));
                } else {
                    lost.entry((tx, rx, sequence)).or_insert_with(Vec::new).push(time_ns);
                }
            }
        }
    }
    (log, lost)
}

#[test]
fn the_lost_frames_of_a_campaign_are_found_and_no_others() {
    for (skew_ns, is_even, step_ns) in
        [(0, true, 1), (5 * S, true, 1), (-5 * S, false, 1), (0, true, S)]
    {
        let (mut log, mut truth) = campaign(skew_ns, is_even);
        log.sort_by_key(|row| row.0);
        log.iter_mut().for_each(|row| row.0 -= row.0 % step_ns);
        let n_lost: usize = truth.values().map(Vec::len).sum();
        let mut frame = frame(&log, &[]);
        let (added, rejected) = add_lost(&mut frame, None);
        assert!(rejected.is_empty(), "{rejected:?}");
        let mut n_found = 0;
        for (time_ns, tx, rx, sequence) in lost_rows(&frame) {
            // Those of a number are 256 frames apart. Where no receiver logged a frame, its time is interpolated.
            let times_ns = truth.get_mut(&(tx, rx, sequence));
            let is_near = |lost_ns: &i64| (time_ns - lost_ns).abs() < 2 * S;
            let at = times_ns.as_ref().and_then(|times| times.iter().position(is_near));
            if let Some((times_ns, at)) = times_ns.zip(at) {
                times_ns.remove(at);
                n_found += 1;
            }
        }
        // What was lost before a receiver's first row and after its last is not known.
        let (share, n_false) =
            (f64::from(n_found) / n_lost as f64, added.n_lost - n_found as usize);
        assert!(0.998 < share && n_false == 0, "{skew_ns}: {share}, {n_false}");
    }
}
