//! Names beside dots: each stands where it covers least, and a thin line leads to it where that is not beside its dot.

use super::marks::DOT;
use super::{Frame, Painter, SMALL};
use crate::content::Mark;
use picture::drawing::{Anchor, Shape, Text, line, segment};
use tiny_skia::PathBuilder;

/// Dots with names beside them, at most.
const MOST_NAMES: usize = 60;
/// Size of the letters, and the height of capitals and digits in it.
const SIZE: f32 = SMALL - 1.0;
const HEIGHT: f32 = 0.72 * SIZE;
/// How far from the edge of its dot a name may stand.
const DISTANCES: [f32; 5] = [1.0, 3.5, 7.0, 12.0, 18.0];
/// From this distance on a line leads to it.
const LED: f32 = 3.0;
/// Dots that are nearer than this to each other stand in a crowd.
const CROWD: f32 = 8.0;
/// Directions in which a name may stand, in the order in which people look for it.
const DIRECTIONS: [[f32; 2]; 8] = [
    [0.7, -0.7],
    [1.0, 0.0],
    [0.7, 0.7],
    [0.0, -1.0],
    [-0.7, -0.7],
    [-1.0, 0.0],
    [-0.7, 0.7],
    [0.0, 1.0],
];
/// What it costs to cover something, in points of distance.
const OUTSIDE: f32 = 1000.0;
const NAME: f32 = 300.0;
const A_DOT: f32 = 100.0;
const A_LINE: f32 = 6.0;

/// A rectangle: left, upper, right and lower edge.
type Area = [f32; 4];

impl Painter {
    /// Names of the dots of a panel, if they are few.
    pub(super) fn names(&mut self, frame: &Frame<'_>) {
        let dots = frame.panel.series.iter().filter(|series| series.mark == Mark::Dot);
        let dots: Vec<(&str, [f32; 2])> = dots
            .flat_map(|series| &series.points)
            .filter_map(|point| Some((point.name.as_str(), frame.at(point.x, point.y?))))
            .collect();
        let mut named: Vec<&(&str, [f32; 2])> =
            dots.iter().filter(|(name, _)| !name.is_empty()).collect();
        if MOST_NAMES < named.len() {
            return;
        }
        // Names of dots that stand alone come first: those in a crowd need a line in any case.
        named.sort_by_key(|(_, at)| {
            dots.iter().filter(|(_, dot)| (dot[0] - at[0]).hypot(dot[1] - at[1]) < CROWD).count()
        });
        let lines = lines(frame);
        let mut taken: Vec<Area> = Vec::new();
        for (name, at) in named {
            let size = [self.width(name, SIZE), HEIGHT];
            let cost = |area: &Area| {
                let [left, top, right, bottom] = frame.edges;
                let is_outside =
                    area[0] < left || area[1] < top || right < area[2] || bottom < area[3];
                let n_names = taken.iter().filter(|other| overlap(area, other)).count();
                let is_covered = |dot: &[f32; 2]| {
                    overlap(area, &[dot[0] - DOT, dot[1] - DOT, dot[0] + DOT, dot[1] + DOT])
                };
                let n_dots = dots.iter().filter(|(_, dot)| is_covered(dot)).count();
                let n_lines = lines.iter().filter(|[a, b]| crosses(area, *a, *b)).count();
                f32::from(u8::from(is_outside)) * OUTSIDE
                    + n_names as f32 * NAME
                    + n_dots as f32 * A_DOT
                    + n_lines as f32 * A_LINE
            };
            let places = DISTANCES.iter().flat_map(|distance| {
                DIRECTIONS
                    .iter()
                    .map(move |direction| (*distance, beside(*at, *direction, *distance, size)))
            });
            let costs = places.map(|(distance, area)| (distance + cost(&area), distance, area));
            let Some((_, distance, area)) = costs.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                continue;
            };
            if LED < distance {
                let mut path = PathBuilder::new();
                let near = [at[0].clamp(area[0], area[2]), at[1].clamp(area[1], area[3])];
                segment(&mut path, *at, near);
                line(&mut self.shapes, path, self.theme.text.with_opacity(0.6), 0.35);
            }
            taken.push(area);
            self.shapes.push(Shape::Text(Text {
                at: [area[0], area[3]],
                anchor: Anchor::Start,
                size: SIZE,
                text: (*name).to_owned(),
                colour: self.theme.text,
                halo: Some(self.theme.background),
                is_upright: false,
            }));
        }
    }
}

/// Where a name of a size stands in a direction from its dot.
fn beside(at: [f32; 2], direction: [f32; 2], distance: f32, size: [f32; 2]) -> Area {
    let reach = DOT + distance;
    let centre: [f32; 2] = std::array::from_fn(|i| {
        at[i] + direction[i] * reach + direction[i].signum() * half(direction[i], size[i])
    });
    [
        centre[0] - size[0] / 2.0,
        centre[1] - size[1] / 2.0,
        centre[0] + size[0] / 2.0,
        centre[1] + size[1] / 2.0,
    ]
}

/// Half the extent of a name along an axis in which it stands off its dot.
fn half(direction: f32, extent: f32) -> f32 {
    if direction == 0.0 { 0.0 } else { extent / 2.0 }
}

fn overlap(a: &Area, b: &Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// The straight lines of a panel, from end to end.
fn lines(frame: &Frame<'_>) -> Vec<[[f32; 2]; 2]> {
    let mut lines = Vec::new();
    for series in &frame.panel.series {
        match series.mark {
            Mark::Segment | Mark::Arrow => lines.extend(series.points.iter().filter_map(|point| {
                let end = point.end?;
                Some([frame.at(point.x, point.y?), frame.at(end[0], end[1])])
            })),
            Mark::Line => lines.extend(series.points.windows(2).filter_map(|pair| {
                Some([frame.at(pair[0].x, pair[0].y?), frame.at(pair[1].x, pair[1].y?)])
            })),
            _ => {}
        }
    }
    lines
}

/// Whether a straight line crosses a rectangle (Liang and Barsky 1984).
fn crosses(area: &Area, a: [f32; 2], b: [f32; 2]) -> bool {
    let (mut from, mut to) = (0.0_f32, 1.0_f32);
    for axis in 0..2 {
        let (low, high) = (area[axis], area[axis + 2]);
        let along = b[axis] - a[axis];
        if along.abs() < 1e-6 {
            if a[axis] < low || high < a[axis] {
                return false;
            }
            continue;
        }
        let ends = [(low - a[axis]) / along, (high - a[axis]) / along];
        from = from.max(ends[0].min(ends[1]));
        to = to.min(ends[0].max(ends[1]));
    }
    from <= to
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_crosses_a_rectangle_if_a_part_of_it_lies_inside() {
        let area = [1.0, 1.0, 3.0, 2.0];
        assert!(crosses(&area, [0.0, 1.5], [4.0, 1.5]) && crosses(&area, [2.0, 1.5], [2.0, 9.0]));
        assert!(!crosses(&area, [0.0, 0.0], [4.0, 0.5]) && !crosses(&area, [4.0, 1.5], [5.0, 1.5]));
        assert!(!crosses(&area, [0.0, 2.0], [1.0, 3.1]), "past a corner");
    }

    #[test]
    fn a_name_stands_clear_of_its_dot() {
        let dot = [-DOT, -DOT, DOT, DOT];
        for direction in DIRECTIONS {
            let area = beside([0.0, 0.0], direction, DISTANCES[1], [8.0, HEIGHT]);
            assert!(!overlap(&area, &dot), "{direction:?}: {area:?}");
        }
    }
}
