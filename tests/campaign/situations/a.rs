//! Set A: radio in a rectangle, with normal noise in whole decibels; robots in the plane, and quadrotors.

mod links;
mod motion;
mod robots;
mod site;

use super::Situation;

/// The situations, each with its campaign of a seed.
pub(super) const SITUATIONS: [Situation; 30] = [
    ("links: nothing", links::nothing),
    ("links: nothing, received frames only", links::nothing_received_only),
    ("links: nothing, two nodes", links::nothing_two_nodes),
    ("links: nothing, skewed noise", links::nothing_skewed),
    ("links: nothing, a second reading", links::nothing_second_reading),
    ("links: exponent, received frames only", links::exponent_received_only),
    ("links: gain", links::gain),
    ("links: a node in the wrong place", links::misplaced),
    ("links: two devices", links::two_devices),
    ("links: temperature beside drift", links::temperature_and_drift),
    ("links: temperature or battery", links::temperature_or_battery),
    ("links: saturation", links::saturation),
    ("links: a forklift", links::forklift),
    ("links: a fast clock", links::fast_clock),
    ("links: scale of the register", links::register_scale),
    ("links: a wall of no map", links::unmapped_wall),
    ("links: walls and exponent", links::walls_and_exponent),
    ("links: a hundred rows", links::few_rows),
    ("links: gain, nodes and temperature", links::three_causes),
    ("robots: nothing", robots::nothing),
    ("robots: nothing, slow errors", robots::nothing_slow_errors),
    ("robots: a drifting gyro", robots::gyro),
    ("robots: wind shear", robots::shear),
    ("robots: lag up and down", robots::lag_up_down),
    ("robots: two old ones", robots::two_old),
    ("robots: no excitation", robots::no_excitation),
    ("robots: mud that dries", robots::mud),
    ("robots: slip and wind", robots::slip_and_wind),
    ("flyers: nothing, a landing", robots::landing),
    ("flyers: load or thrust", robots::load_or_thrust),
];
