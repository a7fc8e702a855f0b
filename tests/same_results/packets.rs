//! Networks, swarms and tables whose measurements the executables make themselves, by running a model with something added.

use super::Files;
use crate::reporting;
use std::fmt::Write as _;

/// Eight robots follow a leader over a radio that loses one frame in three or so.
const FLOCK: &str = r#"
[experiment]
name = "flock"
seed = 4
duration_s = 20.0
agents = 8

[robotsim.scenario]
kind = "line"
spacing_m = 4.0

[robotsim.controller]
kind = "flocking"
flock_radius_m = 20.0

[netsim.phy]
propagation = "log-distance"
exponent = 3.6
tx_power_dbm = -5.0
"#;

/// A model, and the truth, which is the model with a further table.
fn pair(model: &str, table: &str) -> Files {
    vec![("model.toml", model.to_owned()), ("truth.toml", format!("{model}\n{table}\n"))]
}

pub(super) fn sensors() -> Files {
    pair(&reporting::sensors(), "")
}

pub(super) fn sensors_slow() -> Files {
    pair(&reporting::sensors(), "[[netsim.mac.effect]]\nkind = \"processing-delay\"\ndelay_s = 0.6")
}

pub(super) fn sensors_unacknowledged() -> Files {
    pair(&reporting::sensors(), "[[netsim.mac.effect]]\nkind = \"ack-loss\"\nprobability = 0.4")
}

pub(super) fn flock() -> Files {
    pair(FLOCK, "")
}

pub(super) fn flock_slipping() -> Files {
    pair(FLOCK, "[[robotsim.dynamics.effect]]\nkind = \"slip\"\nscale = 0.8")
}

pub(super) fn flock_weak() -> Files {
    pair(FLOCK, "[[netsim.phy.effect]]\nkind = \"system-gain\"\ngain_db = -12.0")
}

pub(super) fn rendezvous() -> Files {
    with_links("")
}

pub(super) fn rendezvous_weak() -> Files {
    with_links("[[netsim.phy.effect]]\nkind = \"system-gain\"\ngain_db = -8.0")
}

pub(super) fn rendezvous_slow() -> Files {
    with_links("[[netsim.mac.effect]]\nkind = \"processing-delay\"\ndelay_s = 0.3")
}

/// Where robots of the rendezvous begin (m).
fn place(robot: u32) -> [f64; 2] {
    [f64::from(robot * robot % 11) * 6.0, f64::from(robot * 3 % 7) * 9.0]
}

/// The rendezvous with its places, and the rows of links between all pairs once a minute, 20 frames each, as robots stand at
/// the begin.
fn with_links(table: &str) -> Files {
    let mut places = "agent,x_m,y_m\n".to_owned();
    for robot in 0..8 {
        let [x_m, y_m] = place(robot);
        let _ = writeln!(places, "{robot},{x_m},{y_m}");
    }
    let mut links =
        "time_s,tx,rx,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,frames,pdr,rssi_dbm\n".to_owned();
    for (minute, tx, rx) in all_of(30, 8) {
        let ([x0, y0], [x1, y1]) = (place(tx), place(rx));
        let rssi_dbm = -80 - i64::from(tx);
        let _ =
            writeln!(links, "{},{tx},{rx},{x0},{y0},1,{x1},{y1},1,20,0.5,{rssi_dbm}", 60 * minute);
    }
    let scenario = "kind = \"csv\"\nfile = \"places.csv\"\n";
    let model = reporting::rendezvous(scenario, "noise_sd_db = 2.0\n");
    let mut files = pair(&model, table);
    files.extend([("places.csv", places), ("like.csv", links)]);
    files
}

/// Rows that sum up 50 frames each, on three channels, between eight motes that stand.
pub(super) fn summed_up() -> Files {
    let model = "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = -28.0\nnoise_sd_db = 2.0\n";
    let hidden = "\n[[netsim.phy.effect]]\nkind = \"interference\"\ncentre_mhz = 2440.0\nwidth_mhz = 20.0\nduty = 0.3\n";
    let mut like =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,frames,pdr\n"
            .to_owned();
    for (round, tx, rx) in all_of(12, 8) {
        let ([x0, y0], [x1, y1]) = (place(tx), place(rx));
        let (time_s, channel) = (60 * round + tx, 11 + 5 * (round % 3));
        let rssi_dbm = -70 - i64::from((tx + 3 * rx + round) % 9);
        let _ = writeln!(
            like,
            "{time_s},{tx},{rx},{channel},{x0},{y0},1,{x1},{y1},1,{rssi_dbm},50,0.5"
        );
    }
    vec![
        ("model.toml", model.to_owned()),
        ("truth.toml", format!("{model}{hidden}")),
        ("like.csv", like),
    ]
}

/// Every pair of two of `n_motes`, in each of some rounds.
fn all_of(n_rounds: u32, n_motes: u32) -> impl Iterator<Item = (u32, u32, u32)> {
    let pairs = move || (0..n_motes).flat_map(move |tx| (0..n_motes).map(move |rx| (tx, rx)));
    (0..n_rounds).flat_map(move |round| {
        pairs().filter(|(tx, rx)| tx != rx).map(move |(tx, rx)| (round, tx, rx))
    })
}
