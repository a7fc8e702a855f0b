//! What can be chosen by name in `[netsim]`: the simulator's lists, as one value that is passed to it.

use crate::mac::blacklist;
use crate::mac::effect as mac_effect;
use crate::second;
use crate::sf;
use proto::config::{Lists, Registry};
use std::sync::LazyLock;

/// The lists of the network simulator. [`Registry::add`] adds to one of them.
///
/// # Examples
///
/// ```
/// use netsim::catalogue::Catalogue;
/// use netsim::sim::Network;
///
/// let catalogue = Catalogue::default();
/// assert!(catalogue.physics.effects.find("two-ray-ground").is_some());
/// // catalogue.physics.effects.add(&my_effect::ENTRY);
/// let network = Network::with_catalogue(catalogue);
/// # drop(network);
/// ```
#[derive(Clone, Debug)]
pub struct Catalogue {
    /// `[netsim.phy]`: the radio.
    pub physics: physics::catalogue::Catalogue,
    /// `[[netsim.mac.effect]]`: effects on what motes do.
    pub mac_effects: Registry<mac_effect::Entry>,
    /// `netsim.mac.blacklist`: rules by which links blacklist channels.
    pub blacklists: Registry<blacklist::Entry>,
    /// `netsim.sf`: scheduling functions.
    pub scheduling_functions: Registry<sf::Entry>,
    /// `netsim.second_medium`: broadcast media beside the main network.
    pub second_media: Registry<second::Entry>,
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
        self.physics
            .lists()
            .with(mac_effect::LIST, &self.mac_effects)
            .with(blacklist::LIST, &self.blacklists)
            .with(sf::LIST, &self.scheduling_functions)
            .with(second::LIST, &self.second_media)
    }
}

impl Default for Catalogue {
    fn default() -> Self {
        Self {
            physics: physics::catalogue::Catalogue::default(),
            mac_effects: Registry::new(mac_effect::BUILT_IN),
            blacklists: Registry::new(blacklist::BUILT_IN),
            scheduling_functions: Registry::new(sf::BUILT_IN),
            second_media: Registry::new(second::BUILT_IN),
        }
    }
}
