//! Pictures as SVG files that stand by themselves.

use crate::colours::Colour;
use crate::drawing::{Anchor, Drawing, Plane, Shape, Text};
use maud::{Markup, PreEscaped, Render, html};
use std::fmt::{Display, Formatter, Write as _};
use tiny_skia::{Path, PathSegment};

/// A picture as the text of a file.
#[must_use]
pub fn svg(drawing: &Drawing) -> String {
    let [width, height] = drawing.size;
    let Plane { left, top, width: plane_width, height: plane_height } = drawing.plane;
    let markup = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(width) height=(height)
            viewBox={ "0 0 " (width) " " (height) } font-family="system-ui, sans-serif"
            role="img" aria-labelledby="name alternative"
        {
            title id="name" { (drawing.name) }
            desc id="alternative" { (drawing.alternative) }
            clipPath id="plane" {
                rect x=(left) y=(top) width=(plane_width) height=(plane_height) {}
            }
            rect width=(width) height=(height) fill=(Hex(drawing.background)) {}
            g clip-path="url(#plane)" {
                @for shape in drawing.site.iter().chain(&drawing.swarm) { (shape) }
            }
            @for shape in drawing.frame.iter().chain(&drawing.title) { (shape) }
        }
    };
    markup.into_string() + "\n"
}

impl Render for Shape {
    fn render(&self) -> Markup {
        match self {
            Self::Fill { path, colour, is_crisp, robot } => html! {
                path d=(Data(path)) fill=(Hex(*colour)) fill-opacity=[opacity(*colour)]
                    shape-rendering=[is_crisp.then_some("crispEdges")]
                { (title(*robot)) }
            },
            Self::Line { path, colour, width, dash, robot } => html! {
                path d=(Data(path)) fill="none" stroke=(Hex(*colour)) stroke-opacity=[opacity(*colour)]
                    stroke-width=(width) stroke-linejoin="round"
                    stroke-dasharray=[dash.map(|[on, off]| format!("{on} {off}"))]
                { (title(*robot)) }
            },
            Self::Text(text) => text.render(),
        }
    }
}

fn title(robot: Option<u32>) -> Markup {
    html! { @if let Some(robot) = robot { title { "robot " (robot) } } }
}

impl Render for Text {
    fn render(&self) -> Markup {
        let [x, y] = self.at.map(Decimal);
        let anchor = match self.anchor {
            Anchor::Start => None,
            Anchor::Middle => Some("middle"),
            Anchor::End => Some("end"),
        };
        let upright = self.is_upright.then(|| format!("rotate(-90 {x} {y})"));
        html! {
            text x=(x) y=(y) font-size=(self.size) fill=(Hex(self.colour)) text-anchor=[anchor]
                transform=[upright] stroke=[self.halo.map(Hex)] stroke-width=[self.halo.map(|_| 3)]
                stroke-linejoin=[self.halo.map(|_| "round")] paint-order=[self.halo.map(|_| "stroke")]
            { (self.text) }
        }
    }
}

/// A colour without its opacity.
#[derive(Clone, Copy)]
struct Hex(Colour);

impl Render for Hex {
    fn render(&self) -> Markup {
        let [red, green, blue] = self.0.rgb;
        PreEscaped(format!("#{red:02x}{green:02x}{blue:02x}"))
    }
}

fn opacity(colour: Colour) -> Option<f32> {
    (colour.opacity < 1.0).then(|| (colour.opacity * 1000.0).round() / 1000.0)
}

/// A coordinate with at most two decimals.
#[derive(Clone, Copy)]
struct Decimal(f32);

impl Display for Decimal {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}", f64::from((self.0 * 100.0).round()) / 100.0)
    }
}

impl Render for Decimal {
    fn render(&self) -> Markup {
        PreEscaped(self.to_string())
    }
}

/// The data of a path.
struct Data<'a>(&'a Path);

impl Render for Data<'_> {
    fn render(&self) -> Markup {
        let mut data = String::new();
        for segment in self.0.segments() {
            let (command, points) = match segment {
                PathSegment::MoveTo(to) => ('M', vec![to]),
                PathSegment::LineTo(to) => ('L', vec![to]),
                PathSegment::QuadTo(by, to) => ('Q', vec![by, to]),
                PathSegment::CubicTo(by, then_by, to) => ('C', vec![by, then_by, to]),
                PathSegment::Close => ('Z', Vec::new()),
            };
            data.push(command);
            for (number, point) in points.iter().enumerate() {
                let space = if number == 0 { "" } else { " " };
                let _ = write!(data, "{space}{},{}", Decimal(point.x), Decimal(point.y));
            }
        }
        PreEscaped(data)
    }
}
