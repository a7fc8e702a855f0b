//! Log-normal shadowing.

use super::{Effect, Entry, UNCHECKED};
use crate::phy::scatter::{Law, Renewal, Scatter};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter, Role};
use proto::rng::Purpose;
use serde::Deserialize;

/// `kind = "shadowing"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "shadowing",
        doc: "Log-normal shadowing: one value per link, the same in both directions, which changes as the ends move.",
        fields: &[
            Field {
                key: "sd_db",
                doc: "Standard deviation (dB).",
                kind: Kind::Number(Range::closed(0.0, 20.0)),
                default: Default::Required,
            },
            Field {
                key: "decorrelation_m",
                doc: "Decorrelation distance (m): total movement of both ends over which the correlation falls to 1/e. \
                      8.3: Gudmundson's 0.3 at 10 m in an urban microcell.",
                kind: Kind::Number(Range::above(0.0, 1e6)),
                default: Default::Number(8.3),
            },
        ],
    },
    about: About {
        mechanism: "Unmapped furniture, plants, cars and people obstruct some links and not others, so links of the same \
                    length differ. After a short movement the obstacles are the same; after a long one they differ.",
        equation: "RSSI' = RSSI + X, X ~ N(0, sd_db^2) per unordered pair; correlation e^(-way / decorrelation_m)",
        source: "M. Gudmundson, Correlation model for shadow fading in mobile radio systems, Electronics Letters 27 (1991) 2145.",
        validity: "Links are independent of each other, although real neighbouring links share obstacles. Clipped at 5 sd.",
        trace: "A bias that is constant within a link or position, random between links, and the same in both directions \
                and on all channels.",
        needs: &[Need::Readings],
        example: "sd_db = 4.0\ndecorrelation_m = 8.3\n",
    },
    fit: Fit {
        parameters: &[
            Parameter { key: "sd_db", unit: "dB", min: 0.0, max: 20.0, starts: &[3.0], step: 0.1 },
            Parameter {
                key: "decorrelation_m",
                unit: "m",
                min: 0.1,
                max: 1e3,
                starts: &[1.0, 2.0, 4.0, 8.0, 16.0],
                step: 0.2,
            },
        ],
        variants: &[],
        level: Level::Random,
        generalises: &[
            "wall-attenuation",
            "hidden-obstacle",
            "vegetation",
            "diffraction",
            "node-offset",
        ],
        role: Role::RandomPerLink,
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table, ordinal| {
        let keys: Keys = typed(table);
        Some(Box::new(Shadowing {
            sd_db: keys.sd_db,
            decorrelation_m: keys.decorrelation_m,
            ordinal,
        }))
    },
};

#[derive(Deserialize)]
struct Keys {
    sd_db: f64,
    decorrelation_m: f64,
}

/// Log-normal shadowing.
///
/// # Model
///
/// A normal number N(0, sd²) in dB per unordered link, with correlation e^(−Δ/d_c) over the sum Δ of the ways of both ends:
/// Gudmundson, "Correlation model for shadow fading in mobile radio systems", Electronics Letters 27 (1991) 2145. There
/// one end stands still.
///
/// # Validity
///
/// Links are independent of each other, although real neighbouring links share obstacles. Values are clipped at ±5 sd.
/// Correlation runs along the way travelled: see [`crate::phy::scatter`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shadowing {
    /// Standard deviation (dB).
    pub sd_db: f64,
    /// Way over which the correlation falls to 1/e (m).
    pub decorrelation_m: f64,
    /// Tells several shadowing effects apart.
    pub ordinal: u32,
}

impl Effect for Shadowing {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn scatter(&self) -> Option<Scatter> {
        Some(Scatter {
            law: Law::Normal { sd_db: self.sd_db },
            renewal: Renewal::Coherence { length_m: self.decorrelation_m },
            purpose: Purpose::Shadowing,
            ordinal: self.ordinal,
            directed: false,
        })
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}
