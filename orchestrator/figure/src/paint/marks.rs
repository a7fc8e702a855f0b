//! The marks of series: lines, dots, intervals, bars, arrows. Groups differ in shape as well as in colour.

use super::{Frame, Painter, PushRect as _};
use crate::content::{Mark, Panel, Point, Scale, Series};
use picture::drawing::{Shape, fill, segment};
use tiny_skia::{PathBuilder, Rect};

/// Lines with more points than this are many lines, and thin.
const MANY_POINTS: usize = 2_000;
/// The dashes of lines with more points than this are longer: between points that scatter short ones are lost.
const DENSE_POINTS: usize = 100;
const LONGER: f32 = 1.7;
/// Marks along a line, where there are several lines.
const MARKS: usize = 6;
/// More arrows than this are thin.
const MANY_ARROWS: usize = 40;
/// Radius of a dot, and of a faint one.
pub(super) const DOT: f32 = 2.0;
const FAINT: f32 = 1.0;
/// Half the width of the end of an interval.
const CAP: f32 = 2.5;
/// How far trials stand beside their median; those that would cover each other stand so much farther, in so many columns at most.
const BESIDE: f32 = 4.5;
const NEXT: f32 = 2.3;
const MOST_LANES: usize = 10;
/// Dashes of lines, by group.
const DASHES: [Option<[f32; 2]>; 4] = [None, Some([4.0, 2.0]), Some([1.5, 1.5]), Some([7.0, 2.0])];

impl Painter {
    pub(super) fn marks(&mut self, frame: &Frame<'_>) {
        for series in &frame.panel.series {
            match series.mark {
                Mark::Line => self.line(frame, series),
                Mark::Band => self.band(frame, series),
                Mark::Interval => self.intervals(frame, series),
                Mark::Bar => self.bars(frame, series),
                Mark::Dot => self.dots(frame, series, DOT),
                Mark::FaintDot if frame.panel.is_map => self.dots(frame, series, FAINT),
                Mark::FaintDot => self.trials(frame, series),
                Mark::Segment => self.segments(frame, series),
                Mark::Arrow => self.arrows(frame, series),
            }
        }
        // Above all marks.
        self.names(frame);
    }

    /// The mark of a series in a legend, from the left end of its middle line.
    ///
    /// * `has_marker`: lines have marks along them.
    pub(super) fn sample(&mut self, series: &Series, [x, y]: [f32; 2], has_marker: bool) {
        let colour = self.colour(series.group);
        let mut path = PathBuilder::new();
        match series.mark {
            Mark::Line | Mark::Segment | Mark::Arrow => {
                segment(&mut path, [x, y], [x + 14.0, y]);
                self.stroke(path, colour, 1.2, dash(series));
                if has_marker && series.mark == Mark::Line {
                    self.dot(series.group, [x + 7.0, y], DOT, 1.0);
                }
            }
            Mark::Band => {
                path.push_rect_of(Rect::from_xywh(x, y - 3.0, 14.0, 6.0));
                fill(&mut self.shapes, path, colour.with_opacity(0.2));
                let mut path = PathBuilder::new();
                segment(&mut path, [x, y], [x + 14.0, y]);
                self.stroke(path, colour, 1.2, dash(series));
                if has_marker {
                    self.dot(series.group, [x + 7.0, y], DOT, 1.0);
                }
            }
            Mark::Interval => {
                segment(&mut path, [x + 7.0, y - 3.5], [x + 7.0, y + 3.5]);
                self.stroke(path, colour, 0.9, None);
                self.dot(series.group, [x + 7.0, y], DOT, 1.0);
            }
            Mark::Bar => {
                path.push_rect_of(Rect::from_xywh(x + 3.0, y - 3.0, 8.0, 6.0));
                fill(&mut self.shapes, path, colour);
            }
            Mark::Dot => self.dot(series.group, [x + 7.0, y], DOT, 1.0),
            Mark::FaintDot => self.dot(series.group, [x + 7.0, y], FAINT, 0.6),
        }
    }

    fn stroke(
        &mut self,
        path: PathBuilder,
        colour: picture::colours::Colour,
        width: f32,
        dash: Option<[f32; 2]>,
    ) {
        if let Some(path) = path.finish() {
            self.shapes.push(Shape::Line { path, colour, width, dash, robot: None });
        }
    }

    /// A line through points, broken where there is none.
    fn path(frame: &Frame<'_>, points: &[Point]) -> PathBuilder {
        let mut path = PathBuilder::new();
        let mut is_begun = false;
        for point in points {
            let Some(y) = point.y else {
                is_begun = false;
                continue;
            };
            let [x, y] = frame.at(point.x, y);
            if is_begun {
                path.line_to(x, y);
            } else {
                path.move_to(x, y);
            }
            is_begun = true;
        }
        path
    }

    fn line(&mut self, frame: &Frame<'_>, series: &Series) {
        let is_many = MANY_POINTS < series.points.len();
        let colour = self.colour(series.group);
        // A line without a group is a level to compare with, or an edge.
        let (width, opacity) = match () {
            () if is_many => (0.6, 0.6),
            () if series.group.is_none() => (0.7, 1.0),
            () if DENSE_POINTS < series.points.len() => (0.9, 1.0),
            () => (1.2, 1.0),
        };
        self.stroke(
            Self::path(frame, &series.points),
            colour.with_opacity(opacity),
            width,
            dash(series),
        );
        self.marks_along(frame, series);
    }

    /// Marks along a line, so that several lines are told apart without colours.
    fn marks_along(&mut self, frame: &Frame<'_>, series: &Series) {
        let (Some(group), true) = (series.group, has_markers(frame.panel)) else { return };
        let n_lines = frame.panel.series.iter().filter(|series| is_line(series)).count();
        let [left, _, right, _] = frame.edges;
        let points: Vec<[f32; 2]> =
            series.points.iter().filter_map(|point| Some(frame.at(point.x, point.y?))).collect();
        for mark in 0..MARKS {
            // Those of another line stand elsewhere.
            let share = (mark as f32 + (group as f32 + 0.5) / n_lines as f32) / MARKS as f32;
            let x = left + share * (right - left);
            let off = |point: &&[f32; 2]| (point[0] - x).abs();
            let nearest = points.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            if let Some(point) = nearest.filter(|point| off(point) < (right - left) / MARKS as f32)
            {
                self.dot(Some(group), *point, DOT, 1.0);
            }
        }
    }

    fn band(&mut self, frame: &Frame<'_>, series: &Series) {
        let ends = |end: fn(&Point) -> Option<f64>| {
            series.points.iter().filter_map(move |point| Some(frame.at(point.x, end(point)?)))
        };
        let mut area = PathBuilder::new();
        let back: Vec<[f32; 2]> = ends(|point| point.low).collect();
        for (place, [x, y]) in ends(|point| point.high).chain(back.into_iter().rev()).enumerate() {
            if place == 0 {
                area.move_to(x, y);
            } else {
                area.line_to(x, y);
            }
        }
        area.close();
        let colour = self.colour(series.group);
        fill(&mut self.shapes, area, colour.with_opacity(0.2));
        self.stroke(Self::path(frame, &series.points), colour, 1.2, dash(series));
        self.marks_along(frame, series);
    }

    fn whiskers(&mut self, frame: &Frame<'_>, series: &Series) {
        let colour = self.colour(series.group);
        let mut path = PathBuilder::new();
        for point in &series.points {
            let (Some(low), Some(high)) = (point.low, point.high) else { continue };
            let ([x, foot], [_, top]) = (frame.at(point.x, low), frame.at(point.x, high));
            segment(&mut path, [x, top], [x, foot]);
            segment(&mut path, [x - CAP, top], [x + CAP, top]);
            segment(&mut path, [x - CAP, foot], [x + CAP, foot]);
        }
        self.stroke(path, colour, 0.9, None);
    }

    fn intervals(&mut self, frame: &Frame<'_>, series: &Series) {
        if frame.x.scale != Scale::Category {
            let colour = self.colour(series.group).with_opacity(0.8);
            self.stroke(Self::path(frame, &series.points), colour, 0.9, dash(series));
        }
        self.whiskers(frame, series);
        self.dots(frame, series, DOT);
    }

    fn bars(&mut self, frame: &Frame<'_>, series: &Series) {
        let colour = self.colour(series.group);
        let half = 0.3;
        for point in &series.points {
            let Some(y) = point.y else { continue };
            let ([left, foot], [right, top]) =
                (frame.at(point.x - half, 0.0), frame.at(point.x + half, y));
            let mut path = PathBuilder::new();
            path.push_rect_of(Rect::from_ltrb(left, top.min(foot), right, top.max(foot)));
            fill(&mut self.shapes, path, colour);
        }
        self.whiskers(frame, series);
    }

    fn dots(&mut self, frame: &Frame<'_>, series: &Series, radius: f32) {
        let opacity = if series.mark == Mark::FaintDot { 0.45 } else { 1.0 };
        for point in &series.points {
            if let Some(y) = point.y {
                self.dot(series.group, frame.at(point.x, y), radius, opacity);
            }
        }
    }

    /// Trials beside their median: those that would cover each other stand side by side.
    fn trials(&mut self, frame: &Frame<'_>, series: &Series) {
        // On an axis of numbers the medians of groups have the same place, and their trials stand on different sides.
        let is_right = frame.x.scale != Scale::Category && series.group.unwrap_or(0) % 2 == 1;
        let side = if is_right { 1.0 } else { -1.0 };
        let n_lanes = n_lanes(frame);
        let mut points: Vec<[f32; 2]> =
            series.points.iter().filter_map(|point| Some(frame.at(point.x, point.y?))).collect();
        points.sort_by(|a, b| b[1].total_cmp(&a[1]).then(a[0].total_cmp(&b[0])));
        let mut placed: Vec<[f32; 2]> = Vec::new();
        for [x, y] in points {
            let at = |lane: usize| [x + side * (BESIDE + NEXT * lane as f32), y];
            let is_free = |lane: &usize| {
                let [x, y] = at(*lane);
                placed.iter().all(|other| NEXT <= (other[0] - x).hypot(other[1] - y) + 0.01)
            };
            let lane = (0..n_lanes).find(is_free).unwrap_or(0);
            placed.push(at(lane));
            self.dot(series.group, at(lane), FAINT, 0.6);
        }
    }

    /// A dot in the shape of its group.
    fn dot(&mut self, group: Option<usize>, [x, y]: [f32; 2], radius: f32, opacity: f32) {
        let mut path = PathBuilder::new();
        match group.unwrap_or(0) % 4 {
            0 => path.push_circle(x, y, radius),
            1 => path.push_rect_of(Rect::from_xywh(
                x - 0.88 * radius,
                y - 0.88 * radius,
                1.76 * radius,
                1.76 * radius,
            )),
            2 => {
                path.move_to(x, y - 1.2 * radius);
                path.line_to(x + 1.1 * radius, y + 0.8 * radius);
                path.line_to(x - 1.1 * radius, y + 0.8 * radius);
                path.close();
            }
            _ => {
                path.move_to(x, y - 1.3 * radius);
                path.line_to(x + 1.3 * radius, y);
                path.line_to(x, y + 1.3 * radius);
                path.line_to(x - 1.3 * radius, y);
                path.close();
            }
        }
        let colour = self.colour(group).with_opacity(opacity);
        fill(&mut self.shapes, path, colour);
    }

    fn segments(&mut self, frame: &Frame<'_>, series: &Series) {
        let mut path = PathBuilder::new();
        for point in &series.points {
            if let (Some(y), Some(end)) = (point.y, point.end) {
                segment(&mut path, frame.at(point.x, y), frame.at(end[0], end[1]));
            }
        }
        let width = if series.group.is_none() { 1.6 } else { 0.8 };
        self.stroke(path, self.colour(series.group), width, None);
    }

    fn arrows(&mut self, frame: &Frame<'_>, series: &Series) {
        let colours = frame.panel.colour.as_ref().map(|axis| axis.range);
        let size = if MANY_ARROWS < series.points.len() { 0.7 } else { 1.0 };
        // Those that matter most above the others.
        let mut points: Vec<&Point> = series.points.iter().collect();
        points.sort_by(|a, b| a.value.unwrap_or(0.0).total_cmp(&b.value.unwrap_or(0.0)));
        for point in points {
            let (Some(y), Some(end)) = (point.y, point.end) else { continue };
            let (from, to) = (frame.at(point.x, y), frame.at(end[0], end[1]));
            let along = [to[0] - from[0], to[1] - from[1]];
            let length = along[0].hypot(along[1]);
            if length < 2.0 * DOT + 4.0 {
                continue;
            }
            let [ux, uy] = along.map(|part| part / length);
            // On the right, so that both directions are seen, and clear of the dots.
            let beside = |[x, y]: [f32; 2], forward: f32, right: f32| {
                [x + ux * forward - uy * right, y + uy * forward + ux * right]
            };
            let [begin, tip] = [beside(from, DOT + 0.5, 1.3), beside(to, -(DOT + 1.0), 1.3)];
            let foot = beside(tip, -4.0 * size, 0.0);
            let colour = match (point.value, colours) {
                (Some(value), Some(range)) => self.theme.link(value, range).with_opacity(0.85),
                _ => self.colour(series.group).with_opacity(0.6),
            };
            let mut path = PathBuilder::new();
            segment(&mut path, begin, foot);
            self.stroke(path, colour, 0.7 * size, None);
            let mut head = PathBuilder::new();
            let [left, right] = [beside(foot, 0.0, -1.5 * size), beside(foot, 0.0, 1.5 * size)];
            head.move_to(tip[0], tip[1]);
            head.line_to(left[0], left[1]);
            head.line_to(right[0], right[1]);
            head.close();
            fill(&mut self.shapes, head, colour);
        }
    }
}

/// Whether lines have marks along them: there are several.
pub(super) fn has_markers(panel: &Panel) -> bool {
    !panel.is_map && 1 < panel.series.iter().filter(|series| is_line(series)).count()
}

fn is_line(series: &Series) -> bool {
    matches!(series.mark, Mark::Line | Mark::Band) && series.group.is_some()
}

/// How many columns of trials have room between a median and the next.
fn n_lanes(frame: &Frame<'_>) -> usize {
    let trials = frame.panel.series.iter().filter(|series| series.mark == Mark::FaintDot);
    let mut xs: Vec<f32> = trials
        .flat_map(|series| &series.points)
        .map(|point| frame.at(point.x, frame.y.range[0])[0])
        .collect();
    xs.sort_by(f32::total_cmp);
    let gaps = xs.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| 0.1 < *gap);
    let gap = gaps.fold(f32::INFINITY, f32::min);
    (((gap - 2.0 * BESIDE) / NEXT) as usize).clamp(1, MOST_LANES)
}

/// The dashes of a series.
fn dash(series: &Series) -> Option<[f32; 2]> {
    let longer = if DENSE_POINTS < series.points.len() { LONGER } else { 1.0 };
    let dash = series.group.and_then(|group| DASHES[group % DASHES.len()]);
    dash.map(|parts| parts.map(|part| longer * part))
}
