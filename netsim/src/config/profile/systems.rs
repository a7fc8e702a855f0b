//! Settings of other systems, as far as they are keys here.

/// Contiki-NG: tsch-conf.h, orchestra-conf.h, rpl-lite/rpl-conf.h, queuebuf.h and link-stats.c of release/v5.0. A mote leaves the network
/// 120 s after it last heard its time source: here after 24 s, until it has estimated its clock's drift, and then after 120 s.
pub(super) const CONTIKI_NG: &str = r#"
hopping_sequence = [15, 25, 26, 20]
[mac]
queue_frames = 8
max_retries = 7
min_backoff_exponent = 1
max_backoff_exponent = 5
beacon_period_s = 16.0
beacon_spacing_s = 0.0
beacon_wait_s = 0.0
rejoin_wait_s = 0.0
neighbours_to_wait = 1
scan_dwell_s = 1.0
keep_alive_s = 12.0
desynchronise_s = 24.0
max_keep_alive_s = 60.0
[sf]
kind = "orchestra"
rules = ["eb-per-time-source", "unicast-non-storing", "default-common"]
eb_slots = 397
common_slots = 31
unicast_slots = 17
eb_channel = 1
common_channel = 0
unicast_channel_min = 2
unicast_channel_max = 3
hash = "last-octet"
[rpl]
mode = "non-storing"
objective = "mrhof"
dio_interval_min = 12
dio_interval_doublings = 8
dio_redundancy = 0
max_rank_increase = 1024
solicitation = "multicast"
dis_period_s = 30.0
route_lifetime_s = 1800.0
dao_delay_s = 4.0
dao_ack = true
initial_etx = 2.0
"#;

/// OpenWSN: IEEE802154E.h, schedule.h, openqueue.h, msf.h, icmpv6rpl.c and neighbors.h. Periods are in its slots of 20 ms; beacons and DIOs,
/// which it sends with a chance in each slotframe, are as far apart as there on average.
pub(super) const OPENWSN: &str = r#"
slot_duration_s = 0.02
[mac]
queue_frames = 20
max_retries = 15
min_backoff_exponent = 2
max_backoff_exponent = 5
beacon_period_s = 20.2
beacon_wait_s = 0.0
rejoin_wait_s = 0.0
neighbours_to_wait = 1
keep_alive_s = 20.0
desynchronise_s = 35.0
max_keep_alive_s = 20.0
[sf]
kind = "msf"
slotframe_slots = 101
max_num_cells = 32
lim_numcellsused_high = 24
lim_numcellsused_low = 8
housekeeping_s = 30
quarantine_s = 300
wait_min_s = 30
wait_max_s = 60
[rpl]
mode = "non-storing"
objective = "of0"
dio_interval_min = 14
dio_interval_doublings = 0
dio_redundancy = 0
dao_period_s = 121.2
dao_ack = false
"#;

/// BotNet: the settings of its program, and where it departs from the standards.
pub(super) const BOTNET: &str = r#"
[phy]
propagation = "full"
rssi_dbm = -10.0
interference = { kind = "table" }
[sf]
kind = "rrsf"
[mac]
beacon_wait_s = 0.1
rejoin_wait_s = 0.1
neighbours_to_wait = 2
scan_dwell_s = 0.01
[rpl]
dao_period_s = 60.0
dao_ack = false
dao_delay_s = 0.0
[compat]
shared_slot_0 = true
eb_rule = true
no_frame_overhead = true
no_trickle_suppression = true
perfect_acks = true
stale_rank = true
"#;
