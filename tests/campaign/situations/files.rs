//! The files that a user would have, and nothing of what is in them.

use std::fmt::Write as _;

/// A frame at a possible receiver.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct LinkRow {
    pub(super) time_s: f64,
    pub(super) tx: usize,
    pub(super) rx: usize,
    pub(super) channel: Option<u8>,
    /// Places of both antennas (m).
    pub(super) places_m: [[f64; 3]; 2],
    /// What was read (dBm), if the frame was received.
    pub(super) rssi_dbm: Option<f64>,
    /// Further columns.
    pub(super) more: Vec<f64>,
}

/// Which rows a logger keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Log {
    All,
    Received,
}

/// A table of link samples. `more`: names of further columns.
pub(super) fn links(rows: &[LinkRow], more: &[&str], log: Log) -> String {
    let mut text =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,received"
            .to_owned();
    for name in more {
        let _ = write!(text, ",{name}");
    }
    text.push('\n');
    for row in rows.iter().filter(|row| log == Log::All || row.rssi_dbm.is_some()) {
        let _ = write!(text, "{:.3},{},{},", row.time_s, row.tx, row.rx);
        if let Some(channel) = row.channel {
            let _ = write!(text, "{channel}");
        }
        for place in row.places_m.iter().flatten() {
            let _ = write!(text, ",{place:.3}");
        }
        match row.rssi_dbm {
            Some(rssi_dbm) => {
                let _ = write!(text, ",{rssi_dbm},1");
            }
            None => text.push_str(",,0"),
        }
        for value in &row.more {
            let _ = write!(text, ",{value:.4}");
        }
        text.push('\n');
    }
    text
}

/// A robot at a moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RobotRow {
    pub(super) run: Option<usize>,
    pub(super) time_s: f64,
    pub(super) agent: usize,
    pub(super) at_m: [f64; 3],
    pub(super) heading_rad: Option<f64>,
    /// Its command from then on, then further columns.
    pub(super) values: Vec<f64>,
}

/// A table of robots. `columns`: names of the values.
pub(super) fn robots(rows: &[RobotRow], columns: &[&str]) -> String {
    let has_run = rows.first().is_some_and(|row| row.run.is_some());
    let has_heading = rows.first().is_some_and(|row| row.heading_rad.is_some());
    let mut text = if has_run { "run," } else { "" }.to_owned();
    text.push_str("time_s,agent,x_m,y_m,z_m");
    text.push_str(if has_heading { ",heading_rad" } else { "" });
    for name in columns {
        let _ = write!(text, ",{name}");
    }
    text.push('\n');
    for row in rows {
        if let Some(run) = row.run {
            let _ = write!(text, "{run},");
        }
        let _ = write!(text, "{:.3},{}", row.time_s, row.agent);
        for place in row.at_m {
            let _ = write!(text, ",{place:.5}");
        }
        if let Some(heading_rad) = row.heading_rad {
            let _ = write!(text, ",{heading_rad:.5}");
        }
        for value in &row.values {
            let _ = write!(text, ",{value:.5}");
        }
        text.push('\n');
    }
    text
}
