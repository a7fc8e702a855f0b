//! The figures of packets that are compared.

use super::figure::{FigureSpec, figure};
use measure::packets::MeasuredPacket;
use numbers::statistics::{mean, quantile};
use std::collections::BTreeMap;
use study::thresholds::FEWEST_MOTE_PACKETS;

/// How a figure is spread about its middle: on which scale differences are reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// A share: log odds.
    Share,
    /// A time, or a number above 0: logarithm.
    Ratio,
}

use Scale::{Ratio, Share};

/// All figures, in the order of [`NetworkFigures::values`].
pub const KPIS: [FigureSpec<Scale>; 11] = [
    figure("delivery", "", Share, "share of packets that arrived"),
    figure("delivery_worst", "", Share, "share of packets that arrived, of the worst mote"),
    figure("latency_p10_s", "s", Ratio, "10 % quantile of the latency"),
    figure("latency_p50_s", "s", Ratio, "median of the latency"),
    figure("latency_p90_s", "s", Ratio, "90 % quantile of the latency"),
    figure("latency_per_hop_s", "s", Ratio, "median of the latency per hop"),
    figure("hops_mean", "hops", Ratio, "mean number of hops"),
    figure("join_p50_s", "s", Ratio, "arrival time of a mote's first packet: median over motes"),
    figure("join_last_s", "s", Ratio, "arrival time of a mote's first packet: the last mote"),
    figure("silence_s", "s", Ratio, "longest time between two arrived packets of a mote"),
    figure("packets", "packets", Ratio, "number of packets created"),
];

/// Packets of one mote, sent and delivered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MoteCounts {
    /// Packets that the mote created.
    pub sent: u32,
    /// Packets of those that were delivered.
    pub arrived: u32,
}

impl MoteCounts {
    /// Delivery ratio; NaN if nothing was sent.
    #[must_use]
    pub fn share(self) -> f64 {
        f64::from(self.arrived) / f64::from(self.sent)
    }
}

/// The figures of one campaign, or of one seed.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkFigures {
    /// Those of [`KPIS`]; NaN where a figure is undefined.
    pub values: [f64; KPIS.len()],
    /// Counts of each mote that sent packets.
    pub of_mote: BTreeMap<u32, MoteCounts>,
}

impl NetworkFigures {
    /// Figures of packets created from `from_s` (s) on.
    #[must_use]
    pub fn from_packets(packets: &[MeasuredPacket], from_s: f64) -> Self {
        let packets = || packets.iter().filter(|packet| from_s <= packet.time_s);
        let mut of_mote: BTreeMap<u32, MoteCounts> = BTreeMap::new();
        let mut arrivals: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
        let (mut latencies, mut per_hop, mut hops) = (Vec::new(), Vec::new(), Vec::new());
        for packet in packets() {
            let counts = of_mote.entry(packet.source).or_default();
            counts.sent += 1;
            let Some(received_s) = packet.received_s else { continue };
            counts.arrived += 1;
            arrivals.entry(packet.source).or_default().push(received_s);
            latencies.push(received_s - packet.time_s);
            if let Some(n) = packet.hops {
                hops.push(f64::from(n));
                per_hop.push((received_s - packet.time_s) / f64::from(n));
            }
        }
        let joins: Vec<f64> = arrivals
            .values()
            .map(|times| times.iter().copied().fold(f64::INFINITY, f64::min))
            .collect();
        let silence = arrivals.values_mut().flat_map(|times| {
            times.sort_by(f64::total_cmp);
            times.windows(2).map(|pair| pair[1] - pair[0])
        });
        let silence_s = silence.fold(f64::NAN, f64::max);
        let (sent, arrived) =
            of_mote.values().fold((0, 0), |(a, b), of| (a + of.sent, b + of.arrived));
        let judged = of_mote.values().filter(|of| FEWEST_MOTE_PACKETS <= of.sent);
        let worst = judged.map(|of| of.share()).fold(f64::NAN, f64::min);
        let quantile_of = |values: &mut Vec<f64>, share: f64| {
            values.sort_by(f64::total_cmp);
            quantile(values, share)
        };
        let mean_hops = mean(hops);
        let mut joins = joins;
        let values = [
            f64::from(arrived) / f64::from(sent),
            worst,
            quantile_of(&mut latencies, 0.1),
            quantile_of(&mut latencies, 0.5),
            quantile_of(&mut latencies, 0.9),
            quantile_of(&mut per_hop, 0.5),
            mean_hops,
            quantile_of(&mut joins, 0.5),
            quantile_of(&mut joins, 1.0),
            silence_s,
            f64::from(sent),
        ];
        Self { values, of_mote }
    }

    /// The figures on their scales: for differences. `n`: packets, so that a share of all or none stays finite.
    #[must_use]
    pub fn scaled(&self) -> [f64; KPIS.len()] {
        let n = f64::from(self.of_mote.values().map(|of| of.sent).sum::<u32>().max(1));
        let mut scaled = self.values;
        for (value, kpi) in scaled.iter_mut().zip(&KPIS) {
            *value = match kpi.scale {
                Scale::Share => {
                    let share = (*value * n + 0.5) / (n + 1.0);
                    libm::log(share / (1.0 - share))
                }
                // A slot lasts a hundredth of a second: smaller differences mean nothing.
                Scale::Ratio => libm::log(*value + 0.01),
            };
        }
        scaled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(time_s: f64, source: u32, received_s: Option<f64>, hops: u32) -> MeasuredPacket {
        let hops = received_s.map(|_| hops);
        let destination = 0;
        MeasuredPacket {
            line: 0,
            time_s,
            source,
            destination,
            received_s,
            hops,
            payload_bytes: None,
        }
    }

    #[test]
    fn figures_are_those_of_the_packets() {
        let mut packets = Vec::new();
        for k in 0..10 {
            let time_s = 10.0 * f64::from(k);
            packets.push(packet(time_s, 1, Some(time_s + 1.0), 1));
            // Every second one of mote 2 is lost.
            packets.push(packet(time_s, 2, (k % 2 == 0).then_some(time_s + 4.0), 2));
        }
        let figures = NetworkFigures::from_packets(&packets, 0.0);
        let named =
            |name: &str| figures.values[KPIS.iter().position(|kpi| kpi.name == name).unwrap()];
        assert_eq!((named("delivery"), named("delivery_worst")), (0.75, 0.5));
        assert_eq!((named("latency_p10_s"), named("latency_p90_s")), (1.0, 4.0));
        assert_eq!(named("latency_per_hop_s"), 1.0);
        assert!((named("hops_mean") - 4.0 / 3.0).abs() < 1e-12);
        assert_eq!((named("join_p50_s"), named("join_last_s")), (2.5, 4.0));
        assert_eq!(named("silence_s"), 20.0);
        // Without the first half.
        let later = NetworkFigures::from_packets(&packets, 50.0);
        assert_eq!(later.values[0], 0.7);
        assert_eq!(later.of_mote[&2], MoteCounts { sent: 5, arrived: 2 });
        assert!(figures.scaled().iter().all(|value| value.is_finite()));
    }
}
