//! Clocks worse than the guard time allows for.

use super::{Burden, Effect, Entry, MOTES, Motes, Node, concerns};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "clock-drift"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "clock-drift",
        doc: "Clocks drift more than specified, so motes leave the guard time before they are resynchronised.",
        fields: &[
            Field {
                key: "max_ppm",
                doc: "Maximum additional clock drift (ppm), uniform in both directions, on top of netsim.mac.max_drift_ppm.",
                kind: Kind::Number(Range::closed(0.0, 1e4)),
                default: Default::Required,
            },
            MOTES,
        ],
    },
    about: About {
        mechanism: "A cold, aged or cheap crystal exceeds its rated drift. Between two corrections the mote drifts beyond \
                    half of the guard time. It then misses frames and corrections, and finally has to rejoin the network.",
        equation: "offset(t) = -(rate + extra) * (t - t_corrected), extra uniform in +-max_ppm * 1e-6; a frame is heard where \
                   |offset of sender - offset of receiver| <= macTsRxWait / 2",
        source: "IEEE Std 802.15.4-2015, 8.4.3.3 (macTsRxWait); D. Stanislowski et al., Adaptive synchronization in IEEE802.15.4e \
                 networks, IEEE Trans. Ind. Inf. 10(1), 2014.",
        validity: "The drift is constant and independent of temperature, so motes that hear their time source often enough \
                   estimate and compensate it (netsim.mac.adaptive_synchronization). A root's clock is the reference. \
                   Requires keep_alive_s other than 0.",
        trace: "Losses some seconds after the last frame between two motes, motes that lose synchronisation and rejoin, \
                and join times with a long tail.",
        needs: &[Need::Packets],
        example: "max_ppm = 100.0\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "max_ppm",
            unit: "ppm",
            min: 0.0,
            max: 1e4,
            starts: &[60.0, 120.0, 250.0],
            step: 1.0,
        }],
        variants: &[],
        level: Level::Run,
        generalises: &[],
        ..Fit::PLAIN
    },
    needs_kept_time: true,
    build: |table| Some(Box::new(typed::<ClockDrift>(table))),
};

/// Clocks whose rates are further off.
///
/// # Model
///
/// ```text
/// offset(t) = −(r + e) (t − t_c)        e ~ U(−d, d)
/// a frame is heard where |offset of sender − offset of receiver| ≤ macTsRxWait / 2
/// ```
///
/// r is the rate error that `netsim.mac.max_drift_ppm` allows, e the further one, drawn once for each mote, and t_c the last
/// correction. Of several effects that concern a mote the bounds d are added before e is drawn. macTsRxWait: IEEE Std
/// 802.15.4-2015, § 8.4.3.3; clocks that drift between corrections: Stanislowski et al., "Adaptive synchronization in IEEE802.15.4e
/// networks", IEEE Trans. Ind. Inf. 10(1), 2014.
///
/// # Arguments
///
/// * `max_ppm` d: greatest further error of a clock's rate (10⁻⁶), not negative.
/// * `motes`: the motes whose clocks are off; absent: all. Roots are the time, and never off.
///
/// # Validity
///
/// The rate is constant: it does not follow the temperature, so that clocks neither get better at night nor worse at noon. A mote
/// that hears its time source often enough learns and compensates it, unless `adaptive_synchronization` is off. Needs clocks that
/// are kept (`keep_alive_s` other than 0). Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct ClockDrift {
    /// By how much at most (ppm).
    pub max_ppm: f64,
    /// Whose; none: everybody's.
    pub motes: Motes,
}

impl Effect for ClockDrift {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn weigh(&self, node: Node, burden: &mut Burden) {
        if !node.is_root && concerns(&self.motes, node.mote) {
            burden.max_drift_ppm += self.max_ppm;
        }
    }
}
