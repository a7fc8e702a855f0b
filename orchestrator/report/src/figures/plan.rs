//! Plans on which motes stand and lines between them are drawn.

use super::equal_scales;
use crate::svg::Chart;

/// Where the motes are; `None` for those that do not exist.
pub(super) type Places = [Option<[f64; 2]>];

/// A plan of all motes, on which lines between them are drawn.
pub(super) fn plan(places: &Places, width: f64) -> Chart {
    let span = |axis: usize| {
        places.iter().flatten().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
            [low.min(place[axis]), high.max(place[axis])]
        })
    };
    let (x, y, height) = equal_scales(span(0), span(1), width);
    Chart::new(x, y, width, height)
}

pub(super) fn between(places: &Places, a: u32, b: u32) -> Option<[[f64; 2]; 2]> {
    let place = |mote: u32| places.get(mote as usize).copied().flatten();
    Some([place(a)?, place(b)?])
}
