//! Log-normal shadowing.

use super::{Effect, Entry, UNCHECKED};
use crate::scatter::{Law, Renewal, Scatter};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need, Role};
use proto::rng::Purpose;

/// `kind = "shadowing"`.
pub const ENTRY: Entry = Entry::new::<Shadowing>(UNCHECKED, |table, ordinal| {
    Some(Box::new(Shadowing { ordinal, ..Shadowing::read(table) }))
});

/// Log-normal shadowing: one value per link, the same in both directions, which changes as the ends move.
///
/// # Mechanism
///
/// Unmapped furniture, plants, cars and people obstruct some links and not others, so links of the same length differ. After a
/// short movement the obstacles are the same; after a long one they differ.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + X, X ~ N(0, sd_db^2) per unordered pair; correlation e^(-way / decorrelation_m)
/// ```
///
/// # Source
///
/// M. Gudmundson, Correlation model for shadow fading in mobile radio systems, Electronics Letters 27 (1991) 2145.
///
/// # Validity
///
/// Links are independent of each other, although real neighbouring links share obstacles. Clipped at 5 sd.
///
/// # Trace
///
/// A bias that is constant within a link or position, random between links, and the same in both directions and on all channels.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "shadowing",
    needs = &[Need::Readings],
    example = "sd_db = 4.0\ndecorrelation_m = 8.3\n",
    level = Level::Random,
    generalises = &["wall-attenuation", "hidden-obstacle", "vegetation", "diffraction", "node-offset"],
    role = Role::RandomPerLink,
)]
pub struct Shadowing {
    /// Standard deviation (dB).
    #[key(range = 0.0..=20.0)]
    #[fit(
        unit = "dB",
        starts = [3.0],
        step = 0.1,
        plausible = 0.0..=18.0,
        source = "Seidel and Rappaport, IEEE Vehicular Technology Conference 1991: 5 to 16.3 dB",
    )]
    pub sd_db: f64,
    /// Decorrelation distance (m): total movement of both ends over which the correlation falls to 1/e. 8.3: Gudmundson's 0.3 at 10
    /// m in an urban microcell.
    #[key(above = 0.0, most = 1e6, default = 8.3)]
    #[fit(unit = "m", range = 0.1..=1e3, starts = [1.0, 2.0, 4.0, 8.0, 16.0], step = 0.2)]
    pub decorrelation_m: f64,
    /// Tells several shadowing effects apart.
    #[key(skip)]
    pub ordinal: u32,
}

impl Effect for Shadowing {
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
