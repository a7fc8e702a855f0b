//! Plans on which motes stand and lines between them are drawn.

use super::{equal_scales, map_width};
use crate::svg::Chart;
use numbers::statistics;

/// Where the motes are; `None` for those that do not exist.
pub(super) type Places = [Option<[f64; 2]>];

/// From where to where places are along an axis.
fn span(places: &Places, axis: usize) -> [f64; 2] {
    statistics::range(places.iter().flatten().map(|place| place[axis]))
}

/// The width of a plan of all motes.
pub(super) fn plan_width(places: &Places) -> f64 {
    map_width(span(places, 0), span(places, 1))
}

/// A plan of all motes, on which lines between them are drawn.
pub(super) fn plan(places: &Places, width: f64) -> Chart {
    let (x, y, height) = equal_scales(span(places, 0), span(places, 1), width);
    Chart::new(x, y, width, height).as_map()
}

pub(super) fn between(places: &Places, a: u32, b: u32) -> Option<[[f64; 2]; 2]> {
    let place = |mote: u32| places.get(mote as usize).copied().flatten();
    Some([place(a)?, place(b)?])
}
