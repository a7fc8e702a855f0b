//! Others on the band.

use super::{Effect, Entry};
use crate::link::Link;
use proto::config::{Problem, Range, Section};
use proto::effect::{Catalogued, Fixed, Need};
use std::ops::RangeInclusive;

/// `kind = "interference"`.
pub const ENTRY: Entry = Entry::new::<Keys>(check, |table, _| {
    let keys = Keys::read(table);
    let receivers = keys.receivers.map(|mut receivers| {
        receivers.sort_unstable();
        receivers
    });
    let ns = |time_s: f64| (time_s * 1e9).round() as u64;
    Some(Box::new(Interference {
        centre_hz: keys.centre_mhz * 1e6,
        half_width_hz: 0.5e6 * keys.width_mhz,
        duty: keys.duty,
        from_ns: keys.from_s.map_or(0, ns),
        to_ns: keys.to_s.map_or(u64::MAX, ns),
        receivers,
        passes_from_dbm: keys.power_dbm.zip(keys.sir_threshold_db).map(|(a, b)| a + b),
    }))
});

/// WiFi or other traffic in a band: frames on its channels are lost for a fraction of the time.
///
/// # Mechanism
///
/// While a WiFi station transmits, 100 times as strong and over four channels at once, frames on these channels are lost. The RSSI
/// of received frames does not change.
///
/// # Equation
///
/// ```text
/// P(received)' = P(received) * (1 - duty) where |f - centre_mhz| <= width_mhz / 2, from_s <= t < to_s, and RSSI <
/// power_dbm + sir_threshold_db if these keys are set
/// ```
///
/// # Source
///
/// M. Petrova et al., Performance study of IEEE 802.15.4 using measurements and simulations, WCNC 2006; width: IEEE Std
/// 802.11-2020, § 15 (22 MHz).
///
/// # Validity
///
/// Losses are independent between frames and of the frame length; WiFi bursts are not modelled. Frames without a known channel are
/// unaffected.
///
/// # Trace
///
/// Losses that RSSI does not explain, on adjacent channels, possibly only for a time and at some receivers.
#[derive(Catalogued, Section)]
#[effect(
    name = "interference",
    makes = Interference,
    needs = &[Need::Channels, Need::Losses],
    example = "centre_mhz = 2437.0\nduty = 0.3\n",
    variants = &[&[("centre_mhz", Fixed::Number(2412.0)), ("width_mhz", Fixed::Number(22.0))], &[("centre_mhz", Fixed::Number(2437.0)), ("width_mhz", Fixed::Number(22.0))], &[("centre_mhz", Fixed::Number(2462.0)), ("width_mhz", Fixed::Number(22.0))]],
    in_runs = Some(&[("centre_mhz", Fixed::Number(2440.0)), ("width_mhz", Fixed::Number(80.0))]),
    is_repeatable = true,
)]
struct Keys {
    /// Centre of the band (MHz). WiFi 1, 6, 11: 2412, 2437, 2462.
    #[key(range = 100.0..=10_000.0)]
    centre_mhz: f64,
    /// Full width of the band (MHz). It affects IEEE 802.15.4 channels whose centre lies within it.
    #[key(above = 0.0, most = 1000.0, default = 22.0)]
    width_mhz: f64,
    /// Duty cycle: fraction of the time in which no frame can be received.
    #[key(range = Range::FRACTION)]
    #[fit(unit = "", range = 0.0..=1.0, starts = [0.1], step = 0.002, null = 0.0)]
    duty: f64,
    /// Start (s). Absent: the beginning.
    #[key(range = 0.0..=1e9)]
    from_s: Option<f64>,
    /// End (s). Absent: never.
    #[key(above = 0.0, most = 1e9)]
    to_s: Option<f64>,
    /// Numbers of the affected receivers. Absent: all.
    #[key(range = 0..=u32::MAX, length = 1..=1_000_000)]
    receivers: Option<Vec<u32>>,
    /// Received power of the interference (dBm); set together with sir_threshold_db.
    #[key(range = -200.0..=100.0)]
    power_dbm: Option<f64>,
    /// Signal-to-interference ratio (dB) from which frames are received nevertheless. Absent: none are.
    #[key(range = -100.0..=100.0)]
    sir_threshold_db: Option<f64>,
}

fn check(table: &toml::Table, path: &str, problems: &mut Vec<Problem>) {
    let keys = Keys::read(table);
    if let (Some(from_s), Some(to_s)) = (keys.from_s, keys.to_s)
        && to_s <= from_s
    {
        let message = format!("must be greater than from_s, {from_s}");
        problems.push(Problem::new(format!("{path}.to_s"), message).value(to_s));
    }
    for (key, other) in [("power_dbm", "sir_threshold_db"), ("sir_threshold_db", "power_dbm")] {
        if table.contains_key(key) && !table.contains_key(other) {
            let message = format!("is missing: it must be set together with {key}");
            problems.push(Problem::new(format!("{path}.{other}"), message));
        }
    }
}

/// Traffic of others on a band.
///
/// # Model
///
/// While it lasts, at the receivers it reaches, a frame on a channel whose centre lies within the band is lost with the
/// probability `duty`, whatever else happens; where power and threshold are given, only if it is weaker than both together.
///
/// # Validity
///
/// Frames are hit or not independently of each other and of their length. What is received reads as ever. Frames without a
/// known channel are not hit.
#[derive(Clone, Debug, PartialEq)]
pub struct Interference {
    /// Centre of the band (Hz).
    pub centre_hz: f64,
    /// Half of its width (Hz).
    pub half_width_hz: f64,
    /// Part of the time in which it is there.
    pub duty: f64,
    /// When it begins (ns).
    pub from_ns: u64,
    /// When it is over (ns).
    pub to_ns: u64,
    /// Whom it reaches, ascending; none: everyone.
    pub receivers: Option<Vec<u32>>,
    /// Frames of this power (dBm) and more pass.
    pub passes_from_dbm: Option<f64>,
}

impl Effect for Interference {
    fn band_hz(&self) -> Option<RangeInclusive<f64>> {
        Some(self.centre_hz - self.half_width_hz..=self.centre_hz + self.half_width_hz)
    }

    fn loss(&self, link: &Link<'_>) -> f64 {
        let is_hit = link.channel.is_some()
            && (link.frequency_hz - self.centre_hz).abs() <= self.half_width_hz
            && (self.from_ns..self.to_ns).contains(&link.time_ns)
            && self
                .receivers
                .as_ref()
                .is_none_or(|receivers| receivers.binary_search(&link.receiver.id.0).is_ok());
        if is_hit { self.duty } else { 0.0 }
    }

    fn loss_at(&self, link: &Link<'_>, rssi_dbm: f64) -> f64 {
        match self.passes_from_dbm {
            Some(passes_from_dbm) if passes_from_dbm <= rssi_dbm => 0.0,
            _ => self.loss(link),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::{along_x, made};
    use crate::link::Scene;

    fn hit(keys: &str, channel: Option<u8>) -> f64 {
        let scene = Scene::default();
        made(ENTRY.variant.name, keys).loss(&along_x(10.0, 1.0, channel, &scene))
    }

    #[test]
    fn wifi_1_6_and_11_leave_channels_15_20_25_and_26_free() {
        // The plan of every ZigBee installer's guide.
        let mut free: Vec<u8> = (11..=26).collect();
        for (centre_mhz, hits) in [(2412, 11..=14), (2437, 16..=19), (2462, 21..=24)] {
            let keys = format!("centre_mhz = {centre_mhz}\nduty = 0.25");
            for channel in 11..=26 {
                let expected = if hits.contains(&channel) { 0.25 } else { 0.0 };
                assert_eq!(hit(&keys, Some(channel)), expected, "{channel}");
            }
            free.retain(|channel| !hits.contains(channel));
        }
        assert_eq!(free, [15, 20, 25, 26]);
        assert_eq!(hit("centre_mhz = 2440\nwidth_mhz = 100\nduty = 1", None), 0.0);
    }

    #[test]
    fn it_ends_spares_others_and_lets_strong_frames_pass() {
        let keys = "centre_mhz = 2412\nduty = 0.5\n";
        // The link is from node 0 to node 1, at time 0.
        assert_eq!(hit(&format!("{keys}from_s = 1"), Some(11)), 0.0);
        assert_eq!(hit(&format!("{keys}to_s = 1"), Some(11)), 0.5);
        assert_eq!(hit(&format!("{keys}receivers = [0]"), Some(11)), 0.0);
        assert_eq!(hit(&format!("{keys}receivers = [4, 1]"), Some(11)), 0.5);
        let scene = Scene::default();
        let link = along_x(10.0, 1.0, Some(11), &scene);
        let effect =
            made(ENTRY.variant.name, &format!("{keys}power_dbm = -80\nsir_threshold_db = 10"));
        assert_eq!(effect.loss_at(&link, -70.0), 0.0);
        assert_eq!(effect.loss_at(&link, -70.1), 0.5);
    }
}
