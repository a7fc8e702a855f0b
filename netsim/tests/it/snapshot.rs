//! Saving and restoring.

use super::harness::{STEP_NS, period, setup, site, standing_at, started, step_with};
use netsim::sim::Network;
use proto::side::NetSimulator as _;
use proto::types::{DeliveryColumn, MoteCommand, MoteOrder};

#[test]
fn restored_and_continued_equals_never_having_stopped() {
    let mut setup = setup(
        20,
        "absent = [3]\n[phy]\npropagation = \"experimental-randomness\"\nredraw = \"coherence\"\ntx_power_dbm = -20\n\
         noise_sd_db = 1.0\n[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 3",
    );
    setup.site = site("[[obstacle]]\nname = \"cart\"\ncentre_m = [5, 5]\nradius_m = 1");
    setup.columns = vec![DeliveryColumn::RssiDbm];
    let (mut network, _) = started(&setup);
    // Everyone moves, so that coherence and shadowing depend on the way so far.
    let states = |k: u64| {
        let places: Vec<(f64, f64)> =
            (0..20).map(|i| (2.0 * f64::from(i), 0.03 * k as f64 * f64::from(i))).collect();
        standing_at(&places)
    };
    let kill = MoteCommand { source: "test".to_owned(), order: MoteOrder::Kill(7) };
    step_with(&mut network, &states(0), 0, STEP_NS, &[kill], false);
    for k in 1..6 {
        period(&mut network, &states(k), k);
    }
    let saved = network.snapshot();
    let mut restored = Network::default();
    restored.restore(&saved).unwrap();
    assert_eq!(restored.snapshot(), saved);
    let mut n_deliveries = 0;
    for k in 6..12 {
        let (a, b) = (period(&mut network, &states(k), k), period(&mut restored, &states(k), k));
        n_deliveries += a.deliveries.n_deliveries();
        assert_eq!(a.deliveries, b.deliveries, "{k}");
        assert_eq!(a.motes, b.motes);
    }
    assert!(500 < n_deliveries, "{n_deliveries}");
    assert_eq!(network.snapshot(), restored.snapshot());
}

#[test]
fn a_snapshot_carries_the_files_of_its_configuration() {
    let text = "{\"start_date\": \"2018-01-11T16:32:22.0\", \"stop_date\": \"2018-01-11T16:42:22.0\", \
        \"channels\": [11,12,13,14,15,16,17,18,19,20,21,22,23,24,25,26], \"node_count\": 2}\n\
        datetime,src,dst,channel,mean_rssi,pdr,tx_count\n2018-01-11T16:32:22.0,0,1,,-70,0.5,100\n";
    let mut setup = setup(2, "[phy]\npropagation = \"trace\"\nfile = \"a.k7\"");
    setup.files.insert("a.k7".to_owned(), text.into());
    let (mut network, _) = started(&setup);
    let mut restored = Network::default();
    restored.restore(&network.snapshot()).unwrap();
    let states = standing_at(&[(0.0, 0.0); 2]);
    for k in 0..20 {
        let (a, b) = (period(&mut network, &states, k), period(&mut restored, &states, k));
        assert_eq!(a.deliveries, b.deliveries);
    }
}

#[test]
fn what_is_no_snapshot_is_refused_and_changes_nothing() {
    let (mut network, _) = started(&setup(3, ""));
    let before = network.snapshot();
    for wrong in [&b""[..], b"nonsense", &before[..before.len() - 1], &[&before[..], b"x"].concat()]
    {
        assert!(network.restore(wrong).is_err());
    }
    let mut other_version = before.clone();
    other_version[1] ^= 1;
    assert!(network.restore(&other_version).is_err());
    assert_eq!(network.snapshot(), before);
}
