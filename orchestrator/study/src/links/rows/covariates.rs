//! What the error of a link model may depend on: the columns of the file, and what follows from them.

use super::ModelledLinks;
use physics::link::{Link, channel_hz};

/// Numbers of nodes: levels of nodes may differ, and no law follows a number.
pub const OF_NODES: [&str; 2] = ["transmitter", "receiver"];

/// Those that follow from the places of both ends.
pub const OF_PLACES: [&str; 8] = [
    "distance_m",
    "log10_distance",
    "elevation_rad",
    "tx_bearing_rad",
    "rx_bearing_rad",
    "midpoint_x_m",
    "midpoint_y_m",
    "predicted_rssi_dbm",
];

/// Covariates by name, with a value per row; NaN where it is unknown.
#[must_use]
pub fn by_name(rows: &ModelledLinks) -> Vec<(String, Vec<f64>)> {
    let mut all: Vec<(String, Vec<f64>)> = Vec::new();
    let mut add = |name: &str, value: &dyn Fn(usize) -> f64| {
        let values: Vec<f64> = (0..rows.len()).map(value).collect();
        let mut known = values.iter().copied().filter(|value| value.is_finite());
        let first = known.next();
        if first.is_some_and(|first| known.any(|value| value != first)) {
            all.push((name.to_owned(), values));
        }
    };
    let measured = &rows.links.rows;
    add("distance_m", &|row| rows.link(row, |link| link.distance_m));
    add("log10_distance", &|row| rows.link(row, |link| libm::log10(link.distance_m)));
    add("frequency_mhz", &|row| {
        measured[row].channel.map_or(f64::NAN, |channel| channel_hz(channel) / 1e6)
    });
    add("tx_height_m", &|row| measured[row].tx_m[2]);
    add("rx_height_m", &|row| measured[row].rx_m[2]);
    add("elevation_rad", &|row| {
        rows.link(row, |link| {
            let [dx, dy, dz] = way(link);
            libm::atan2(dz, libm::hypot(dx, dy))
        })
    });
    add("tx_bearing_rad", &|row| rows.link(row, |link| seen(link, link.sender.heading_rad, 1.0)));
    add("rx_bearing_rad", &|row| {
        rows.link(row, |link| seen(link, link.receiver.heading_rad, -1.0))
    });
    add("midpoint_x_m", &|row| 0.5 * (measured[row].tx_m[0] + measured[row].rx_m[0]));
    add("midpoint_y_m", &|row| 0.5 * (measured[row].tx_m[1] + measured[row].rx_m[1]));
    add("time_s", &|row| measured[row].time_s);
    add("transmitter", &|row| f64::from(measured[row].tx));
    add("receiver", &|row| f64::from(measured[row].rx));
    let level = if rows.links.readings.is_given { "rssi_dbm" } else { "predicted_rssi_dbm" };
    add(level, &|row| rows.base[row].power_dbm);
    all.extend(rows.links.covariates.iter().cloned());
    all
}

fn way(link: &Link<'_>) -> [f64; 3] {
    std::array::from_fn(|k| link.receiver.position_m[k] - link.sender.position_m[k])
}

/// The bearing at which an end of a row, 0 for the sender and 1 for the receiver, sees the other (rad); none where its heading is unknown.
#[must_use]
pub fn bearing_rad(rows: &ModelledLinks, row: usize, end: usize) -> Option<f64> {
    let bearing_rad = rows.link(row, |link| {
        let ends = [(link.sender.heading_rad, 1.0), (link.receiver.heading_rad, -1.0)];
        let (heading_rad, sign) = ends[end];
        seen(link, heading_rad, sign)
    });
    Some(bearing_rad).filter(|it| it.is_finite())
}

/// The bearing at which an end sees the other, from where its body faces (rad, -pi to pi); NaN where that is unknown.
fn seen(link: &Link<'_>, heading_rad: Option<f64>, sign: f64) -> f64 {
    let [dx, dy, _] = way(link);
    heading_rad.map_or(f64::NAN, |heading| {
        let bearing = libm::atan2(sign * dy, sign * dx) - heading;
        libm::atan2(libm::sin(bearing), libm::cos(bearing))
    })
}
