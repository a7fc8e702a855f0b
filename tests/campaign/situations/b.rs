//! Set B. Do not develop on it: it judges once.

mod links;
mod motion;
mod radio;
mod robots;

use super::Situation;

/// The situations, each with its campaign of a seed.
pub(super) const SITUATIONS: [Situation; 30] = [
    ("links: nothing", links::nothing),
    ("links: nothing, a star", links::nothing_star),
    ("links: nothing, lines twice", links::nothing_twice),
    ("links: a floor", links::floor),
    ("links: a pattern", links::pattern),
    ("links: busy channels and gain", links::busy_channels),
    ("links: a deaf receiver", links::deaf),
    ("links: a loose antenna", links::loose),
    ("links: a node that was carried", links::carried),
    ("links: a door", links::door),
    ("links: rain", links::rain),
    ("links: warm or dry", links::warm_or_dry),
    ("links: settings of the power", links::power_settings),
    ("links: a breakpoint", links::breakpoint),
    ("links: reflection and gain", links::reflection),
    ("links: one distance", links::one_distance),
    ("robots: nothing, cars", robots::nothing_cars),
    ("robots: nothing, jumps", robots::nothing_jumps),
    ("robots: another floor", robots::other_floor),
    ("robots: trim and slip", robots::trim_and_slip),
    ("robots: play", robots::play),
    ("robots: late positions", robots::late),
    ("robots: wear", robots::wear),
    ("robots: scale of the camera", robots::camera_scale),
    ("robots: a crowd", robots::crowd),
    ("robots: a tide", robots::tide),
    ("flyers: nothing", robots::nothing_flyers),
    ("flyers: a push", robots::push),
    ("flyers: a dropped load", robots::dropped_load),
    ("flyers: low hover", robots::low_hover),
];
