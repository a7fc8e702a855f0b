//! What can be chosen by name in `[robotsim]`: the simulator's lists, as one value that is passed to it.

use crate::dynamics::effect;
use crate::{controller, scenario};
use proto::config::{Lists, Registry};
use std::sync::LazyLock;

/// The lists of the robot simulator. [`Registry::add`] adds to one of them.
///
/// # Examples
///
/// ```
/// use robotsim::catalogue::Catalogue;
/// use robotsim::sim::Swarm;
///
/// let catalogue = Catalogue::default();
/// assert!(catalogue.controllers.find("flocking").is_some());
/// // catalogue.controllers.add(&my_controller::ENTRY);
/// let swarm = Swarm::with_catalogue(catalogue);
/// # drop(swarm);
/// ```
#[derive(Clone, Debug)]
pub struct Catalogue {
    /// `[[robotsim.dynamics.effect]]`: physical effects between command and motion.
    pub effects: Registry<effect::Entry>,
    /// `[robotsim.controller]`: what robots want.
    pub controllers: Registry<controller::Entry>,
    /// `[robotsim.scenario]`: where robots begin.
    pub scenarios: Registry<scenario::Entry>,
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
            .with(effect::LIST, &self.effects)
            .with(controller::LIST, &self.controllers)
            .with(scenario::LIST, &self.scenarios)
    }
}

impl Default for Catalogue {
    fn default() -> Self {
        Self {
            effects: Registry::new(effect::BUILT_IN),
            controllers: Registry::new(controller::BUILT_IN),
            scenarios: Registry::new(scenario::BUILT_IN),
        }
    }
}
