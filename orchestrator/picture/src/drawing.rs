//! Shapes in pixels, from the left upper corner.

use crate::colours::Colour;
use tiny_skia::{Path, PathBuilder, Transform};

/// A picture as shapes.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Width and height.
    pub size: [u32; 2],
    /// Behind everything.
    pub background: Colour,
    /// Where the swarm is drawn.
    pub plane: Plane,
    /// What does not move, cut off at the edge of the plane.
    pub site: Vec<Shape>,
    /// What moves, over it, cut off as well.
    pub swarm: Vec<Shape>,
    /// Axes and legend.
    pub frame: Vec<Shape>,
    /// Title.
    pub title: Vec<Shape>,
    /// What the picture is called.
    pub name: String,
    /// What it shows, for those who cannot see it.
    pub alternative: String,
}

/// A rectangle of whole pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plane {
    /// Left edge.
    pub left: u32,
    /// Upper edge.
    pub top: u32,
    /// Width, at least 1.
    pub width: u32,
    /// Height, at least 1.
    pub height: u32,
}

/// A shape.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A filled path.
    Fill {
        /// The path.
        path: Path,
        /// Its colour.
        colour: Colour,
        /// Edges are not smoothed, so that neighbours leave no gap.
        is_crisp: bool,
        /// The robot that it is.
        robot: Option<u32>,
    },
    /// A line.
    Line {
        /// The path.
        path: Path,
        /// Its colour.
        colour: Colour,
        /// Its width.
        width: f32,
        /// Lengths of dashes and gaps.
        dash: Option<[f32; 2]>,
        /// The robot that it is.
        robot: Option<u32>,
    },
    /// A line of text.
    Text(Text),
}

/// A line of text.
#[derive(Clone, Debug)]
pub struct Text {
    /// Where its baseline begins, or has its middle or end.
    pub at: [f32; 2],
    /// Which of them.
    pub anchor: Anchor,
    /// Size of the letters.
    pub size: f32,
    /// What it says.
    pub text: String,
    /// Its colour.
    pub colour: Colour,
    /// The colour of an edge around the letters, so that they can be read over lines.
    pub halo: Option<Colour>,
    /// It runs from below upwards.
    pub is_upright: bool,
}

/// What of a text lies at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Its beginning.
    Start,
    /// Its middle.
    Middle,
    /// Its end.
    End,
}

/// Adds a filled path, if there is anything of it.
pub fn fill(shapes: &mut Vec<Shape>, path: PathBuilder, colour: Colour) {
    if let Some(path) = path.finish() {
        shapes.push(Shape::Fill { path, colour, is_crisp: false, robot: None });
    }
}

/// Adds lines, if there is anything of them.
pub fn line(shapes: &mut Vec<Shape>, path: PathBuilder, colour: Colour, width: f32) {
    if let Some(path) = path.finish() {
        shapes.push(Shape::Line { path, colour, width, dash: None, robot: None });
    }
}

/// Adds dashed lines, if there is anything of them.
pub(crate) fn dashed(shapes: &mut Vec<Shape>, path: PathBuilder, colour: Colour, dash: [f32; 2]) {
    if let Some(path) = path.finish() {
        shapes.push(Shape::Line { path, colour, width: 1.5, dash: Some(dash), robot: None });
    }
}

/// A straight line between two points.
pub fn segment(path: &mut PathBuilder, [x0, y0]: [f32; 2], [x1, y1]: [f32; 2]) {
    path.move_to(x0, y0);
    path.line_to(x1, y1);
}

impl Drawing {
    /// The same in other units: everything so many times as large, as a picture of pixels needs it.
    #[must_use]
    pub fn scaled(mut self, factor: f32) -> Self {
        let by = Transform::from_scale(factor, factor);
        let length = |length: u32| (factor * length as f32).round().max(1.0) as u32;
        self.size = self.size.map(length);
        let Plane { left, top, width, height } = self.plane;
        let [left, top] = [left, top].map(|edge| (factor * edge as f32).round() as u32);
        let [width, height] = [width, height].map(length);
        self.plane = Plane { left, top, width, height };
        let parts = [&mut self.site, &mut self.swarm, &mut self.frame, &mut self.title];
        for shape in parts.into_iter().flatten() {
            match shape {
                Shape::Fill { path, .. } => scale(path, by),
                Shape::Line { path, width, dash, .. } => {
                    scale(path, by);
                    *width *= factor;
                    *dash = dash.map(|dash| dash.map(|length| factor * length));
                }
                Shape::Text(text) => {
                    text.at = text.at.map(|coordinate| factor * coordinate);
                    text.size *= factor;
                }
            }
        }
        self
    }
}

fn scale(path: &mut Path, by: Transform) {
    if let Some(scaled) = path.clone().transform(by) {
        *path = scaled;
    }
}
