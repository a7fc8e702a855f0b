//! Airtime that is rationed.

use super::{Burden, Duty, Effect, Entry, MOTES, Motes, Node, concerns};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Fixed, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "duty-cycle-limit"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "duty-cycle-limit",
        doc: "A mote may transmit only for a fraction of the time, by regulation or for lack of energy.",
        fields: &[
            Field {
                key: "fraction",
                doc: "Fraction of the time for which a mote may transmit.",
                kind: Kind::Number(Range::closed(1e-6, 1.0)),
                default: Default::Required,
            },
            Field {
                key: "window_s",
                doc: "Averaging window (s): airtime unused over at most this time can be spent in a burst.",
                kind: Kind::Number(Range::closed(0.1, 86_400.0)),
                default: Default::Number(60.0),
            },
            MOTES,
        ],
    },
    about: About {
        mechanism: "A regulation or an energy harvester limits the airtime. A mote without remaining airtime holds its \
                    frames back, beacons and keep-alives included, until it has some again. Motes near the root, which \
                    forward most, are affected first.",
        equation: "ration(t) = min(fraction * window_s, ration + fraction * dt - airtime); a mote sends while ration > 0",
        source: "ETSI EN 300 220-2 (duty cycle below 1 GHz); 802.15.4 at 2.4 GHz has no such regulation (EN 300 328), only \
                 the limits of its power supply.",
        validity: "Acknowledgments do not count. A transmission that has begun is completed, so the limit may be exceeded \
                   by one frame.",
        trace: "Latency that grows with load and towards the root, overflowing queues, and missing beacons, so motes join \
                late or lose synchronisation. No effect at low load.",
        needs: &[Need::Packets],
        example: "fraction = 0.002\nwindow_s = 60.0\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "fraction",
            unit: "",
            min: 1e-6,
            max: 1.0,
            starts: &[0.0005, 0.001, 0.002],
            step: 1e-4,
        }],
        variants: &[&[("window_s", Fixed::Number(60.0))]],
        level: Level::Run,
        generalises: &[],
        ..Fit::PLAIN
    },
    needs_kept_time: false,
    build: |table| Some(Box::new(typed::<DutyCycleLimit>(table))),
};

/// Airtime is rationed.
///
/// # Model
///
/// ```text
/// left(t + Δt) = min(f w, left(t) + f Δt − airtime)        left(0) = f w
/// a mote sends while 0 < left
/// ```
///
/// A token bucket of depth f w that fills at the rate f. Of several effects that concern a mote the one of the least f holds.
/// Below 1 GHz such limits are those of ETSI EN 300 220-2; at 2.4 GHz there is no such rule, and the limit is that of a power supply.
///
/// # Arguments
///
/// * `fraction` f: part of the time in which a mote may send (1), 10⁻⁶ to 1.
/// * `window_s` w: the time over which that is computed (s): so long a silence can be saved up for a burst.
/// * `motes`: the motes that are limited; absent: all.
///
/// # Validity
///
/// Acknowledgments are not counted. A frame that has begun is finished: the ration is overdrawn by one frame at most. Regulators
/// count over fixed or sliding windows, which allow other bursts than a bucket does. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct DutyCycleLimit {
    /// Fraction of the time for which a mote may transmit.
    pub fraction: f64,
    /// Length of the window over which the fraction is computed (s).
    pub window_s: f64,
    /// The motes it applies to; `None`: all.
    pub motes: Motes,
}

impl Effect for DutyCycleLimit {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn weigh(&self, node: Node, burden: &mut Burden) {
        let window_ns = (self.window_s * 1e9).round() as u64;
        let stricter = burden.duty.is_none_or(|duty| self.fraction < duty.fraction);
        if stricter && concerns(&self.motes, node.mote) {
            burden.duty = Some(Duty { fraction: self.fraction, window_ns });
        }
    }
}
