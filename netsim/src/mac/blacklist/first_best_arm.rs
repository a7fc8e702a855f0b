//! MABO-TSCH with the "first best arm" policy: all channels but the best are blacklisted.

use super::{ChannelSet, Common, Config, Entry, N_CHANNELS, Quality, Rule};
use proto::config::{Problem, Section, join, variant};
use serde::{Deserialize, Serialize};

/// `kind = "mabo-first-best-arm"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("mabo-first-best-arm"),
    build: |table, channels, path, problems| {
        let keys = Keys::read(table);
        let n = channels.count_ones();
        if n <= u32::from(keys.arms) {
            let message =
                format!("must be less than the number of channels of netsim.hopping_sequence, {n}");
            let problem = Problem::new(join(path, "arms"), message).value(keys.arms);
            problems.push(if 1 < n { problem.nearest(n - 1) } else { problem });
        }
        let Common { offsets, spacing, explore } = keys.common;
        let weight = (100.0 * keys.weight).round() as u8;
        Some(Config {
            rule: Rule::FirstBestArm(FirstBestArm { arms: keys.arms, weight }),
            channels,
            offsets,
            spacing,
            explore,
            max_failures: MAX_FAILURES,
        })
    },
};

/// Failures in a row after which the ends are taken to disagree: as in MABO-TSCH's implementation.
const MAX_FAILURES: u8 = 15;

/// MABO-TSCH (Gomes, Watteyne, Krishnamachari, Trans. Emerging Tel. Tech. 29(7), 2018), policy "first best arm": a link uses its
/// best channels only, in the order of the hopping sequence.
#[derive(Section)]
struct Keys {
    /// Number of channels that are not blacklisted, fewer than the hopping sequence has. 6: as in MABO-TSCH's implementation.
    #[key(range = 1..=15, default = 6)]
    arms: u8,
    /// Weight of the latest transmission in the estimate of a channel's packet delivery ratio, an exponentially weighted moving
    /// average. 0.2: as in MABO-TSCH's implementation.
    #[key(range = 0.01..=1.0, default = 0.2)]
    weight: f64,
    #[key(flatten)]
    common: Common,
}

/// All channels but the best are blacklisted.
///
/// # Model
///
/// The estimate of a channel begins at 100 and becomes (100 − w) q / 100 + w after an acknowledged transmission, (100 − w) q / 100
/// after another, in integers. The `arms` channels with the greatest estimates are used; of equal ones those that are in
/// use already, then those with lower numbers. Until a transmission has failed all are.
///
/// # Source
///
/// P. H. Gomes, T. Watteyne, B. Krishnamachari: MABO-TSCH: Multihop and blacklist-based optimized time synchronized channel
/// hopping, Trans. Emerging Tel. Tech. 29(7), e3223, 2018, and the authors' implementation for OpenWSN
/// (github.com/pedrohenriquegomes/openwsn-fw-ez, branch develop_blacklist), from which the constants are.
///
/// # Differences
///
/// There the receiver estimates, counts every dedicated cell in which it hears nothing as a failure, which takes saturated
/// cells, and sends the list in each acknowledgment. Here the sender does, which knows in which cells it has sent; so does the
/// authors' own simulator. There channels are blacklisted before any transmission has failed. There a central scheduler assigns
/// each receiver the channel offsets to choose from, most often three at distances of seven in the schedule of the implementation;
/// here they follow that of the cell at fixed distances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FirstBestArm {
    /// Number of channels that are used.
    pub arms: u8,
    /// Weight of the latest transmission (hundredths).
    pub weight: u8,
}

impl FirstBestArm {
    pub(super) fn learn(self, quality: u8, acknowledged: bool) -> u8 {
        let kept = u16::from(quality) * u16::from(100 - self.weight) / 100;
        kept as u8 + if acknowledged { self.weight } else { 0 }
    }

    pub(super) fn blacklist(
        self,
        quality: &Quality,
        channels: ChannelSet,
        current: ChannelSet,
    ) -> ChannelSet {
        if quality.iter().all(|&estimate| estimate == 100) {
            return 0;
        }
        let mut order: [u8; N_CHANNELS] = std::array::from_fn(|place| place as u8);
        let is_in = |set: ChannelSet, place: u8| set & 1 << place != 0;
        order.sort_by_key(|&place| {
            let estimate = quality[usize::from(place)];
            (!is_in(channels, place), 100 - estimate.min(100), is_in(current, place))
        });
        let used = &order[..usize::from(self.arms)];
        used.iter().fold(channels, |set, &place| set & !(1 << place))
    }
}
