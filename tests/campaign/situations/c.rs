//! Set C. Do not develop on it: it judges once, after set B.

mod field;
mod links;
mod motion;
mod robots;

use super::Situation;

/// The situations, each with its campaign of a seed.
pub(super) const SITUATIONS: [Situation; 30] = [
    ("links: nothing", links::nothing),
    ("links: nothing, tiny", links::nothing_tiny),
    ("links: nothing, bursts", links::nothing_bursts),
    ("links: nothing, summed up", links::nothing_summed_up),
    ("links: exponent and shadows", links::exponent_and_shadows),
    ("links: a grove", links::grove),
    ("links: one battery", links::one_battery),
    ("links: a barometer", links::barometer),
    ("links: a late track", links::late_track),
    ("links: dipoles", links::dipoles),
    ("links: pitching", links::pitching),
    ("links: an update", links::update),
    ("links: a fast drone", links::fast_drone),
    ("links: gain, exponent and drift", links::gain_exponent_drift),
    ("links: people", links::people),
    ("links: heat", links::hot),
    ("links: a strong drone", links::strong_drone),
    ("robots: nothing", robots::nothing),
    ("robots: bias and delay", robots::bias_and_delay),
    ("robots: slide and scrub", robots::slide_and_scrub),
    ("robots: a belt", robots::belt),
    ("robots: coarse speed", robots::coarse_speed),
    ("robots: stiction and slip", robots::stiction_and_slip),
    ("robots: a right angle", robots::right_angle),
    ("robots: one way", robots::one_way),
    ("robots: weak drives", robots::weak_drives),
    ("flyers: nothing", robots::nothing_copters),
    ("flyers: fuel", robots::fuel),
    ("flyers: drag", robots::drag),
    ("flyers: askew", robots::askew),
];
