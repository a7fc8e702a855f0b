//! Which channels lose: hops of the packets that arrived, by the channel on which they were received.
//!
//! A log of packets that arrived has no failed transmission and no lost packet. Yet if transmissions are spread evenly over the
//! channels, as by a hopping sequence, the hops received on a channel are proportional to the channel's delivery ratio. So the number
//! of hops on a channel divided by the mean over the channels estimates that ratio divided by its mean.

use crate::frame::Frame;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// How often hops were received on a channel, relative to the mean over the channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ChannelShare {
    /// Number of the run.
    pub run: u32,
    /// IEEE 802.15.4 channel, 11 to 26.
    pub channel: u32,
    /// Hops received on it.
    pub hops: usize,
    /// Hops divided by the mean over the channels that occur: the channel's delivery ratio divided by the mean delivery ratio, if
    /// transmissions are spread evenly over the channels.
    pub relative: f64,
    /// Lower end of the interval of `relative`; the intervals of all channels of a run hold together in 95 % of campaigns.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// Packets are divided into so many blocks of consecutive ones, over which variances are clustered: losses come in bursts.
const N_BLOCKS: usize = 40;
/// Quantile of Student's t with `N_BLOCKS` − 1 degrees of freedom at 1 − 0.05 / (2 × 16): Bonferroni over 16 channels.
const T: f64 = 3.1506;
/// With fewer hops per channel on average there is no answer: counts per block would not be nearly normal.
const FEWEST_HOPS: usize = 100;

/// Hops by channel; empty where the frame has no channels of hops, or too few hops.
///
/// The interval is that of a ratio estimator (Cochran 1977, Sampling Techniques, § 6.4) with blocks of packets as units.
pub(crate) fn shares(frame: &Frame, run: u32) -> Vec<ChannelShare> {
    let columns: Vec<&[f64]> =
        (1..).map_while(|hop| frame.column(&format!("hop{hop}_channel"))).collect();
    let mut order: Vec<usize> = (0..frame.n_rows()).collect();
    if let Some(times_ns) = frame.time_ns() {
        order.sort_by_key(|&row| times_ns[row]);
    }
    let mut counts: BTreeMap<u32, [usize; N_BLOCKS]> = BTreeMap::new();
    for (at, &row) in order.iter().enumerate() {
        for channel in columns.iter().map(|column| column[row]).filter(|c| c.is_finite()) {
            counts.entry(channel as u32).or_insert([0; N_BLOCKS])[at * N_BLOCKS / order.len()] += 1;
        }
    }
    let n_channels = counts.len();
    let of_block = |block: usize| counts.values().map(|of| of[block]).sum::<usize>();
    let totals: Vec<usize> = (0..N_BLOCKS).map(of_block).collect();
    let total: usize = totals.iter().sum();
    if n_channels < 2 || total < FEWEST_HOPS * n_channels {
        return Vec::new();
    }
    let mean = total as f64 / n_channels as f64;
    let share = |(&channel, of): (&u32, &[usize; N_BLOCKS])| {
        let hops: usize = of.iter().sum();
        let ratio = hops as f64 / total as f64;
        let squares: f64 = of
            .iter()
            .zip(&totals)
            .map(|(&n, &total)| n as f64 - ratio * total as f64)
            .map(|deviation| deviation * deviation)
            .sum();
        let blocks = N_BLOCKS as f64;
        let half = T * (squares * blocks / (blocks - 1.0)).sqrt() / mean;
        let relative = hops as f64 / mean;
        ChannelShare {
            run,
            channel,
            hops,
            relative,
            low: (relative - half).max(0.0),
            high: relative + half,
        }
    };
    counts.iter().map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Packets of one hop on channels 11 to 26 in turn, except those that `is_lost`, by number and channel.
    fn found(n: usize, is_lost: impl Fn(usize, usize) -> bool) -> Vec<ChannelShare> {
        let channels: Vec<f64> = (0..n)
            .map(|at| (at, 11 + at * 7 % 16))
            .filter(|&(at, channel)| !is_lost(at, channel))
            .map(|(_, channel)| channel as f64)
            .collect();
        let n = channels.len();
        let mut frame = Frame { lines: (1..=n).collect(), ..Frame::default() };
        frame.times_ns.insert("time_s".to_owned(), (0..n as i64).collect());
        frame.columns = vec![
            ("hop1_channel".to_owned(), channels),
            ("hop2_channel".to_owned(), vec![f64::NAN; n]),
        ];
        shares(&frame, 3)
    }

    #[test]
    fn a_channel_that_loses_half_is_below_the_mean_and_no_other() {
        let found = found(16_000, |at, channel| channel == 12 && at / 16 % 2 == 0);
        assert_eq!(found.len(), 16);
        let below: Vec<u32> =
            found.iter().filter(|share| share.high < 1.0).map(|share| share.channel).collect();
        assert_eq!(below, [12]);
        assert_eq!((found[1].run, found[1].hops), (3, 500));
        assert!((found[1].relative - 500.0 / (15_500.0 / 16.0)).abs() < 1e-12, "{:?}", found[1]);
        assert!(found[1].low < found[1].relative && 0.4 < found[1].low, "{:?}", found[1]);
    }

    #[test]
    fn one_burst_of_losses_is_less_certain_than_as_many_spread_evenly() {
        let burst = found(16_000, |at, channel| channel == 12 && at < 3200);
        let even = found(16_000, |at, channel| channel == 12 && at / 16 % 5 == 0);
        assert_eq!(burst[1].hops, even[1].hops);
        assert!(1.0 <= burst[1].high && even[1].high < 1.0, "{:?} {:?}", burst[1], even[1]);
    }

    #[test]
    fn too_few_hops_give_no_answer() {
        assert_eq!(found(1600, |_, _| false).len(), 16);
        assert!(found(1599, |_, _| false).is_empty());
        assert!(shares(&Frame::default(), 1).is_empty());
    }
}
