//! Channel blacklisting in whole networks: what a link learns, whether its ends agree, and what is on the air.

use super::bench::{Bench, EAGER, FULL, LINE, NO_KEEP_ALIVES, OnAir, What, line};
use netsim::wire::Eui64;
use netsim::wire::security::FrameSecurity::K2;
use proto::ids::MoteId;

/// Slots of a slotframe, coprime with the 16 channels: a cell visits all of them.
const SLOTS: u64 = 11;

/// One mote sends to the root in a cell of its own, as often as it can; everything else is in slot 0.
const ONE_CELL: &str = "[rpl]\nroutes_down = false\n[join]\nsecure = false\n[sf]\nkind = \"static\"\nslotframe_slots = 11\n\
    [[sf.cell]]\nslot = 0\nfrom = \"any\"\nto = \"all\"\nadvertising = true\n[[sf.cell]]\nslot = 5\nchannel = 3\nfrom = 1\nto = 0\n\
    [[app]]\nkind = \"periodic\"\nperiod_s = 0.11\npayload_bytes = 10\n";

/// WiFi 1 and WiFi 11, which lie over channels 11 to 14 and 21 to 24.
fn wifi(duty: f64) -> String {
    [2412.0, 2462.0]
        .map(|centre| {
            format!(
                "[[phy.effect]]\nkind = \"interference\"\ncentre_mhz = {centre}\nduty = {duty}\n"
            )
        })
        .concat()
}

fn is_under_wifi(channel: u8) -> bool {
    (11..15).contains(&channel) || (21..25).contains(&channel)
}

fn blacklist(keys: &str) -> String {
    format!("blacklist = {{ kind = \"mabo-first-best-arm\", {keys} }}\n")
}

/// Mean of the estimate (hundredths) of a channel on which a fraction `p` of transmissions is acknowledged: the stationary
/// distribution of the Markov chain that the estimate is, with the rounding down of each step.
fn stationary_mean(p: f64, weight: usize) -> f64 {
    let mut distribution = [0.0; 101];
    distribution[100] = 1.0;
    for _ in 0..1000 {
        let mut next = [0.0; 101];
        for (quality, share) in distribution.iter().enumerate() {
            let kept = quality * (100 - weight) / 100;
            next[kept] += (1.0 - p) * share;
            next[kept + weight] += p * share;
        }
        distribution = next;
    }
    distribution.iter().enumerate().map(|(quality, share)| quality as f64 * share).sum()
}

#[test]
fn what_a_link_learns_of_a_channel_is_its_analytic_delivery_ratio() {
    // In every cell the link explores: all channels are used as often as each other.
    let mac = format!("{EAGER}{NO_KEEP_ALIVES}{}", blacklist("explore = 1.0"));
    let duty = 0.4;
    let mut bench = Bench::new(&line(2), &format!("{FULL}{}{mac}{ONE_CELL}", wifi(duty)));
    bench.form();
    bench.run(SLOTS * 500);
    let root = Eui64::of_mote(MoteId(0));
    let n = 9600;
    // Sum of the estimates, and how often they were read, of channels under WiFi and of others.
    let mut sums = [(0.0, 0.0); 2];
    let mut n_noisy = 0;
    for _ in 0..n {
        bench.run(SLOTS);
        let sent = bench.frames.drain(..).filter(|frame| frame.destination == Some(0));
        n_noisy += sent.filter(|frame| is_under_wifi(frame.channel)).count();
        for channel in 11..=26 {
            let quality = bench.mote(1).mac.blacklists().quality(root, channel).unwrap();
            let sum = &mut sums[usize::from(is_under_wifi(channel))];
            *sum = (sum.0 + f64::from(quality), sum.1 + 1.0);
        }
    }
    let [clean, noisy] = sums.map(|(sum, n)| sum / n);
    // Nothing is lost elsewhere. The estimate rounds down: of 100 it stays there.
    assert_eq!((clean, stationary_mean(1.0, 20)), (100.0, 100.0));
    // Under WiFi both the frame and its acknowledgment must arrive.
    let p = (1.0 - duty) * (1.0 - duty);
    let expected = stationary_mean(p, 20);
    // The mean of a moving average is that of what it averages: independent transmissions.
    assert!(3 * n < 8 * n_noisy, "{n_noisy} of {n}");
    let error = 100.0 * (p * (1.0 - p) / n_noisy as f64).sqrt();
    assert!((noisy - expected).abs() < 4.0 * error, "{noisy}, not {expected} ± {error}");
    // Rounding down takes two hundredths at most in the mean.
    assert!((expected - 100.0 * p).abs() < 2.5, "{expected}");
}

/// Slotframes after formation in which the ends of the link from mote 1 to mote 0 do not agree, in a row: how many there are, and
/// the longest.
fn disagreements(bench: &mut Bench, n: u64) -> (u64, u64) {
    let [root, sender] = [0, 1].map(MoteId).map(Eui64::of_mote);
    let (mut n_disagreements, mut longest, mut length) = (0, 0, 0);
    for _ in 0..n {
        bench.run(SLOTS);
        let sends = bench.mote(1).mac.blacklists();
        let agree = sends.of_sender(root) == bench.mote(0).mac.blacklists().of_receiver(sender);
        n_disagreements += u64::from(!agree && length == 0);
        length = if agree { 0 } else { length + 1 };
        longest = longest.max(length);
    }
    (n_disagreements, longest)
}

#[test]
fn ends_that_lose_acknowledgments_disagree_for_a_few_frames_only() {
    let mac = format!("{EAGER}{NO_KEEP_ALIVES}{}", blacklist("arms = 8, offsets = 16"));
    let noise = "[[phy.effect]]\nkind = \"interference\"\ncentre_mhz = 2440.0\nwidth_mhz = 80.0\nduty = 0.2\n";
    let network = format!("{FULL}{noise}{}{mac}{ONE_CELL}", wifi(0.7));
    let mut bench = Bench::new(&line(2), &network);
    bench.form();
    let n = 4000;
    let (n_disagreements, longest) = disagreements(&mut bench, n);
    // Of the frames with a new list that arrive one in five is not acknowledged in vain.
    assert!(10 < n_disagreements, "{n_disagreements}");
    // A frame meets the receiver at the latest where the link explores or the sender has begun anew.
    assert!(longest < 100, "{longest}");
    // With exact clocks and the same seed, the same happens.
    let mut twin = Bench::new(&line(2), &network);
    twin.form();
    assert_eq!(disagreements(&mut twin, n), (n_disagreements, longest));
    assert!(bench.capture == twin.capture && bench.frames == twin.frames);
    // Mostly the clean half of the channels is used.
    let late: Vec<OnAir> = bench.sent(1, |what| *what != What::KeepAlive);
    let late: Vec<&OnAir> =
        late[late.len() / 4..].iter().filter(|frame| frame.destination == Some(0)).collect();
    let noisy = late.iter().filter(|frame| is_under_wifi(frame.channel)).count();
    assert!(500 < late.len() && 8 * noisy < late.len(), "{noisy} of {}", late.len());
}

#[test]
fn in_a_secured_network_lists_go_legibly_in_authenticated_headers() {
    let mac = format!("{EAGER}{}", blacklist("arms = 8, offsets = 16"));
    let cells = ONE_CELL.replace("[join]\nsecure = false\n", "");
    let config = format!("{LINE}{}{mac}{cells}[security]\n", wifi(0.8));
    let mut bench = Bench::new(&line(2), &config);
    bench.form();
    bench.frames.clear();
    bench.run(SLOTS * 2000);
    let frames = bench.sent(1, |what| matches!(what, What::Udp(_)));
    assert!(frames.iter().all(|frame| frame.security == K2));
    let (with, without): (Vec<&OnAir>, Vec<&OnAir>) =
        frames.iter().partition(|frame| frame.blacklist.is_some());
    assert!(20 < with.len() && 500 < without.len(), "{} {}", with.len(), without.len());
    // Vendor-specific element of seven bytes, and the end of the header elements.
    let lengths = |frames: &[&OnAir]| {
        let mut lengths: Vec<usize> = frames.iter().map(|frame| frame.psdu_bytes).collect();
        lengths.sort_unstable();
        (lengths[0], lengths[lengths.len() - 1])
    };
    let ((least, most), (least_with, most_with)) = (lengths(&without), lengths(&with));
    assert_eq!((least_with, most_with), (least + 9, most + 9));
    let [root, sender] = [0, 1].map(MoteId).map(Eui64::of_mote);
    let in_force = bench.mote(0).mac.blacklists().of_receiver(sender);
    // Eight of 16 channels stay, all of them clean: the others have lost 24 frames of 25 or their acknowledgments.
    assert_eq!(in_force, 0b0011_1100_0000_1111, "{in_force:#018b}");
    assert_eq!(bench.mote(1).mac.blacklists().of_sender(root), in_force);
    let late = &frames[frames.len() / 2..];
    let noisy = late.iter().filter(|frame| is_under_wifi(frame.channel)).count();
    // Half of the cells that explore are under WiFi: 2.5 % of all.
    assert!(16 * noisy < late.len(), "{noisy} of {}", late.len());
}

#[test]
fn negotiated_cells_of_msf_leave_noisy_channels_and_cells_of_its_own_do_not() {
    let keys = blacklist("arms = 8, offsets = 16");
    let config = format!(
        "{FULL}{}{EAGER}{keys}[sf]\nkind = \"msf\"\n[[app]]\nkind = \"periodic\"\nperiod_s = 0.5\npayload_bytes = 10\n",
        wifi(0.7)
    );
    let mut bench = Bench::new(&line(3), &config);
    bench.form();
    bench.run(40_000);
    bench.frames.clear();
    bench.run(60_000);
    let share = |frames: &[&OnAir]| {
        let noisy = frames.iter().filter(|frame| is_under_wifi(frame.channel)).count();
        noisy as f64 / frames.len() as f64
    };
    let data: Vec<&OnAir> = bench
        .frames
        .iter()
        .filter(|frame| frame.source != 0 && matches!(frame.what, What::Udp(_)))
        .collect();
    let said: Vec<&OnAir> =
        bench.frames.iter().filter(|frame| frame.destination.is_none()).collect();
    assert!(1000 < data.len() && 100 < said.len(), "{} {}", data.len(), said.len());
    assert!(share(&data) < 0.15, "{}", share(&data));
    // Five standard errors around a half.
    let tolerance = 2.5 / (said.len() as f64).sqrt();
    assert!((share(&said) - 0.5).abs() < tolerance, "{}", share(&said));
}
