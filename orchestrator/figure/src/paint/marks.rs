//! The marks of series: lines, dots, intervals, bars, arrows. Groups differ in shape as well as in colour.

use super::{Frame, Painter, PushRect as _, SMALL};
use crate::content::{Mark, Point, Scale, Series};
use picture::drawing::{Anchor, Shape, Text, fill, segment};
use tiny_skia::{PathBuilder, Rect};

/// Lines with more points than this are many lines, and thin.
const MANY_POINTS: usize = 2_000;
/// Dots with names beside them, at most.
const MOST_NAMES: usize = 60;
/// Radius of a dot, and of a faint one.
const DOT: f32 = 2.0;
const FAINT: f32 = 1.1;
/// Half the width of the end of an interval.
const CAP: f32 = 2.5;
/// How far trials stand beside their median.
const BESIDE: f32 = 3.5;
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
                Mark::FaintDot => self.dots(frame, series, FAINT),
                Mark::Segment => self.segments(frame, series),
                Mark::Arrow => self.arrows(frame, series),
            }
        }
        // Above all marks.
        for series in frame.panel.series.iter().filter(|series| series.mark == Mark::Dot) {
            self.names(frame, &series.points);
        }
    }

    /// The mark of a series in a legend, from the left end of its middle line.
    pub(super) fn sample(&mut self, series: &Series, [x, y]: [f32; 2]) {
        let colour = self.colour(series.group);
        let mut path = PathBuilder::new();
        match series.mark {
            Mark::Line | Mark::Segment | Mark::Arrow => {
                segment(&mut path, [x, y], [x + 14.0, y]);
                self.stroke(path, colour, 1.2, dash(series));
            }
            Mark::Band => {
                path.push_rect_of(Rect::from_xywh(x, y - 3.0, 14.0, 6.0));
                fill(&mut self.shapes, path, colour.with_opacity(0.2));
                let mut path = PathBuilder::new();
                segment(&mut path, [x, y], [x + 14.0, y]);
                self.stroke(path, colour, 1.2, None);
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
        let (width, opacity) = if is_many { (0.6, 0.6) } else { (1.2, 1.0) };
        self.stroke(
            Self::path(frame, &series.points),
            colour.with_opacity(opacity),
            width,
            dash(series),
        );
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
        self.stroke(Self::path(frame, &series.points), colour, 1.2, None);
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
        let is_faint = series.mark == Mark::FaintDot;
        let shift = if is_faint && !frame.panel.is_map { -BESIDE } else { 0.0 };
        for point in &series.points {
            if let Some(y) = point.y {
                let [x, y] = frame.at(point.x, y);
                self.dot(series.group, [x + shift, y], radius, if is_faint { 0.45 } else { 1.0 });
            }
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
            let foot = beside(tip, -4.0, 0.0);
            let colour = match (point.value, colours) {
                (Some(value), Some(range)) => self.theme.link(value, range).with_opacity(0.85),
                _ => self.colour(series.group).with_opacity(0.6),
            };
            let mut path = PathBuilder::new();
            segment(&mut path, begin, foot);
            self.stroke(path, colour, 0.7, None);
            let mut head = PathBuilder::new();
            let [left, right] = [beside(foot, 0.0, -1.5), beside(foot, 0.0, 1.5)];
            head.move_to(tip[0], tip[1]);
            head.line_to(left[0], left[1]);
            head.line_to(right[0], right[1]);
            head.close();
            fill(&mut self.shapes, head, colour);
        }
    }

    /// Names beside dots, if they are few; of those that would cover each other the first is there.
    fn names(&mut self, frame: &Frame<'_>, points: &[Point]) {
        if MOST_NAMES < points.len() {
            return;
        }
        let mut taken: Vec<[f32; 4]> = Vec::new();
        for point in points.iter().filter(|point| !point.name.is_empty()) {
            let Some(y) = point.y else { continue };
            let [x, y] = frame.at(point.x, y);
            let width = self.width(&point.name, SMALL - 1.0);
            let area = [x + DOT + 1.0, y - DOT - SMALL, x + DOT + 1.0 + width, y - DOT];
            let covers = |other: &[f32; 4]| {
                area[0] < other[2] && other[0] < area[2] && area[1] < other[3] && other[1] < area[3]
            };
            if taken.iter().any(covers) {
                continue;
            }
            taken.push(area);
            self.shapes.push(Shape::Text(Text {
                at: [x + DOT + 1.0, y - DOT],
                anchor: Anchor::Start,
                size: SMALL - 1.0,
                text: point.name.clone(),
                colour: self.theme.text,
                halo: Some(self.theme.background),
                is_upright: false,
            }));
        }
    }
}

/// The dashes of a series.
fn dash(series: &Series) -> Option<[f32; 2]> {
    series.group.and_then(|group| DASHES[group % DASHES.len()])
}
