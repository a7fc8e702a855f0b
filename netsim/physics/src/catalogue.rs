//! What can be chosen by name in `[netsim.phy]`, as one value that is passed to whoever reads that section.

use crate::{effect, interference, propagation, reception};
use proto::config::{Lists, Registry};
use std::sync::LazyLock;

/// The lists of the physics. [`Registry::add`] adds to one of them.
///
/// # Examples
///
/// ```
/// use physics::catalogue::Catalogue;
///
/// let catalogue = Catalogue::default();
/// assert!(catalogue.effects.find("two-ray-ground").is_some());
/// // catalogue.effects.add(&my_effect::ENTRY);
/// ```
#[derive(Clone, Debug)]
pub struct Catalogue {
    /// `netsim.phy.propagation`: base models.
    pub propagation: Registry<propagation::Entry>,
    /// `netsim.phy.reception`: curves from power to the probability of reception.
    pub reception: Registry<reception::Entry>,
    /// `netsim.phy.interference`: what frames that are on the air together do to each other.
    pub interference: Registry<interference::Entry>,
    /// `[[netsim.phy.effect]]`: physical effects on the radio.
    pub effects: Registry<effect::Entry>,
}

static BUILT_IN: LazyLock<Catalogue> = LazyLock::new(Catalogue::default);

impl Catalogue {
    /// What this simulator has by itself.
    #[must_use]
    pub fn built_in() -> &'static Self {
        &BUILT_IN
    }

    /// The lists by name, as the check of a configuration and its JSON Schema need them.
    #[must_use]
    pub fn lists(&self) -> Lists {
        Lists::default()
            .with(propagation::LIST, &self.propagation)
            .with(reception::LIST, &self.reception)
            .with(interference::LIST, &self.interference)
            .with(effect::LIST, &self.effects)
    }
}

impl Default for Catalogue {
    fn default() -> Self {
        Self {
            propagation: Registry::new(propagation::BUILT_IN),
            reception: Registry::new(reception::BUILT_IN),
            interference: Registry::new(interference::BUILT_IN),
            effects: Registry::new(effect::BUILT_IN),
        }
    }
}
