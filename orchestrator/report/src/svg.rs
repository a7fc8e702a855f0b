//! Charts as inline SVG: axes, lines, bands and marks. Colours come from classes, so that a style sheet can make the same
//! picture light or dark.
//!
//! The drawing is our own because a page needs three things that plotting libraries do not offer together: pictures without a
//! script, colours from the page's style sheet in place of fixed ones, and each picture's words as its accessible name. What
//! is left to do for a chart is two linear scales and a dozen kinds of marks. Elements and escaping come from maud; only the
//! data of paths are written here.

mod axis;
pub(crate) mod data;

pub use axis::Axis;
use axis::{fitted, n_ticks_y, text_width};
use data::{ChartData, Kind};
use maud::{Markup, PreEscaped, Render, html};
use std::fmt::Write as _;

/// A coordinate in pixels, written with one decimal.
#[derive(Clone, Copy)]
pub(crate) struct Px(pub(crate) f64);

impl Render for Px {
    fn render_to(&self, buffer: &mut String) {
        let _ = write!(buffer, "{:.1}", self.0);
    }
}

/// A chart being drawn.
pub struct Chart {
    x: Axis,
    y: Axis,
    width: f64,
    height: f64,
    /// Room left of the plane, for the labels of the ticks.
    left: f64,
    /// Room below the plane, for ticks and the label.
    bottom: f64,
    /// Class of the whole picture.
    class: Option<&'static str>,
    /// Areas that words beside points cover: left, top, right, bottom.
    taken: Vec<[f64; 4]>,
    axes: Markup,
    body: Markup,
    /// What lies above everything else.
    over: Markup,
    /// What has been drawn, as numbers.
    data: ChartData,
}

impl Chart {
    /// An empty chart of this size, in pixels at its natural size. It is higher if names along its axis take several lines, and
    /// its plane is narrower if the labels at its left are long.
    pub fn new(x: Axis, y: Axis, width: f64, height: f64) -> Self {
        let (body, over) = (Markup::default(), Markup::default());
        let labels = y.labelled_ticks(n_ticks_y(height - TOP - BOTTOM));
        let longest = labels.iter().map(|(_, label)| label.chars().count()).max().unwrap_or(0);
        let left = LEFT.max(DIGIT * longest as f64 + GAP + 2.0);
        let lines = x.wrapped_names((width - left - RIGHT) / (x.max - x.min));
        let n_lines = lines.iter().map(Vec::len).max().unwrap_or(1);
        let bottom = BOTTOM + LINE * (n_lines.max(1) - 1) as f64;
        let height = height + bottom - BOTTOM;
        let (class, taken, data) = (None, Vec::new(), ChartData::default());
        let axes = Markup::default();
        let mut chart =
            Self { x, y, width, height, left, bottom, class, taken, axes, body, over, data };
        chart.axes = chart.axes();
        chart
    }

    /// The same whose axes have one scale, as those of a map.
    pub fn as_map(mut self) -> Self {
        self.data.is_map = true;
        self
    }

    /// Says whose the following marks are, such as `agent 7`, where several have one class; nobody's if it is empty.
    pub fn item(&mut self, item: impl Into<String>) {
        self.data.item = item.into();
    }

    /// Says what each point of the next marks is.
    pub fn names(&mut self, names: impl IntoIterator<Item = String>) {
        self.data.names = names.into_iter().collect();
    }

    /// Draws the following marks so many pixels to the right of their place.
    pub fn shift(&mut self, pixels: f64) {
        self.data.shift = pixels;
    }

    /// Says what marks of a class are, if the key of the figure does not.
    pub fn words(&mut self, class: &str, words: impl Into<String>) {
        self.data.words.push((class.to_owned(), words.into()));
    }

    /// What a reader of the data has to know, in a sentence.
    pub fn note(&mut self, note: impl Into<String>) {
        self.data.note = note.into();
    }

    /// The same with a class for the whole picture.
    pub fn with_class(mut self, class: &'static str) -> Self {
        self.class = Some(class);
        self
    }

    /// Height of the plane for a chart of that width whose axes have the same scale.
    pub fn plane_width(width: f64) -> f64 {
        width - LEFT - RIGHT
    }

    /// Height of the chart with a plane of that height.
    pub fn with_plane_height(height: f64) -> f64 {
        height + TOP + BOTTOM
    }

    /// A line through points; a gap where there is none.
    pub fn line(&mut self, class: &str, points: impl IntoIterator<Item = Option<[f64; 2]>>) {
        let points: Vec<Option<[f64; 2]>> = points.into_iter().collect();
        let path = self.path(points.iter().copied());
        self.draw_path(class, &path);
        if !path.is_empty() {
            let rows = points.into_iter().map(|point| point.unwrap_or([f64::NAN; 2]));
            self.data.add(class, Kind::Line, rows);
        }
    }

    /// A line that guides the eye through data.
    pub fn guide_line(&mut self, class: &str, points: impl IntoIterator<Item = Option<[f64; 2]>>) {
        let path = self.path(points);
        self.draw_path(class, &path);
    }

    /// The area between two lines over the same x.
    pub fn band(&mut self, class: &str, low_high: &[(f64, f64, f64)]) {
        let there = low_high.iter().map(|&(x, _, high)| Some([x, high]));
        let back = low_high.iter().rev().map(|&(x, low, _)| Some([x, low]));
        let mut path = self.path(there.chain(back));
        if !path.is_empty() {
            path.push('Z');
        }
        self.draw_path(class, &path);
        self.data.add(class, Kind::Band, low_high.iter().map(|&(x, low, high)| [x, low, high]));
    }

    /// Straight lines between two points each, all alike.
    pub fn segments(&mut self, class: &str, lines: impl IntoIterator<Item = [[f64; 2]; 2]>) {
        let lines: Vec<_> = lines.into_iter().collect();
        self.guides(class, lines.iter().copied());
        self.data.add(
            class,
            Kind::Segments,
            lines.into_iter().map(|[[a, b], [c, d]]| [a, b, c, d]),
        );
    }

    /// Straight lines that guide the eye, and are no data.
    pub fn guides(&mut self, class: &str, lines: impl IntoIterator<Item = [[f64; 2]; 2]>) {
        let mut path = String::new();
        for [from, to] in lines {
            let ([x0, y0], [x1, y1]) = (self.place(from), self.place(to));
            let _ = write!(path, "M{x0:.1},{y0:.1}L{x1:.1},{y1:.1}");
        }
        self.draw_path(class, &path);
    }

    /// Rectangles between two corners each, all alike.
    pub fn rectangles(&mut self, class: &str, corners: impl IntoIterator<Item = [[f64; 2]; 2]>) {
        let mut path = String::new();
        let corners: Vec<_> = corners.into_iter().collect();
        for &[from, to] in &corners {
            let ([x0, y0], [x1, y1]) = (self.place(from), self.place(to));
            let _ = write!(path, "M{x0:.1},{y0:.1}H{x1:.1}V{y1:.1}H{x0:.1}Z");
        }
        self.draw_path(class, &path);
        let rows = corners.into_iter().map(|[[a, b], [c, d]]| [a, b, c, d]);
        self.data.add(class, Kind::Rectangles, rows);
    }

    /// Dots, all alike.
    pub fn dots(&mut self, class: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        let points: Vec<[f64; 2]> = points.into_iter().collect();
        self.knots(class, points.iter().copied());
        self.data.add(class, Kind::Dots, points);
    }

    /// Dots on a line, which is the data.
    pub fn knots(&mut self, class: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        let mut path = String::new();
        for point in points {
            let [x, y] = self.place(point);
            let _ = write!(path, "M{x:.1},{y:.1}h0");
        }
        self.draw_path(class, &path);
    }

    /// A line through means, each with a whisker for its interval, both cut off at the ends of the axis.
    ///
    /// * `means`: place, mean, low and high end of the interval, and number of values of each.
    pub fn means(&mut self, class: &str, means: &[([f64; 4], f64)]) {
        let [least, most] = [self.y.min, self.y.max];
        let inside = |y: f64| y.clamp(least, most);
        let known =
            means.iter().filter(|([_, _, low, high], _)| low.is_finite() && high.is_finite());
        let whiskers: Vec<_> =
            known.map(|&([x, _, low, high], _)| [[x, inside(low)], [x, inside(high)]]).collect();
        self.guide_line(class, means.iter().map(|&([x, mean, ..], _)| Some([x, inside(mean)])));
        self.guides(&format!("{class} whisker"), whiskers);
        self.names(means.iter().map(|(_, n)| format!("n = {n}")));
        self.data.add(class, Kind::Intervals, means.iter().map(|&(row, _)| row));
    }

    /// All that `draw` draws, as a group of this class.
    pub fn group(&mut self, class: &str, draw: impl FnOnce(&mut Self)) {
        let before = std::mem::take(&mut self.body);
        draw(self);
        let inside = std::mem::replace(&mut self.body, before);
        self.draw(&html! { g class=(class) { (inside) } });
    }

    /// A ring around a point, its radius in pixels.
    pub fn ring(&mut self, class: &str, point: [f64; 2], radius: f64) {
        let [x, y] = self.place(point);
        self.draw(&html! { circle class=(class) cx=(Px(x)) cy=(Px(y)) r=(radius) {} });
    }

    /// A circle of a radius in the units of the axes, which have the same scale.
    pub fn circle(&mut self, class: &str, centre: [f64; 2], radius: f64) {
        let ([x, y], [edge, _]) = (self.place(centre), self.place([centre[0] + radius, centre[1]]));
        self.draw(
            &html! { circle class=(class) data-scaled cx=(Px(x)) cy=(Px(y)) r=(Px(edge - x)) {} },
        );
    }

    /// A dot with an interval, which says more when pointed at.
    pub fn interval(&mut self, x: f64, y: f64, [low, high]: [f64; 2], title: &str) {
        let ([px, py], [_, top], [_, foot]) =
            (self.place([x, y]), self.place([x, high]), self.place([x, low]));
        let whisker = format!("M{px:.1},{top:.1}V{foot:.1}m-3,0h6M{px:.1},{top:.1}m-3,0h6");
        self.draw(&html! {
            g.interval {
                title { (title) }
                path d=(whisker) {}
                circle cx=(Px(px)) cy=(Px(py)) r="3.5" {}
            }
        });
        self.names([title.to_owned()]);
        self.data.add("interval", Kind::Intervals, [[x, y, low, high]]);
    }

    /// Walls and discs, cut off at the edge of the plane. For axes of the same scale. `clip`: the identifier of the plane, which
    /// no other picture of the page has.
    pub fn site(&mut self, clip: &str, walls: &[[[f64; 2]; 2]], discs: &[([f64; 2], f64)]) {
        if walls.is_empty() && discs.is_empty() {
            return;
        }
        let [left, top] = self.place([self.x.min, self.y.max]);
        let [right, bottom] = self.place([self.x.max, self.y.min]);
        let pixels = (right - left) / (self.x.max - self.x.min);
        self.draw(&html! {
            clipPath id=(clip) {
                rect x=(Px(left)) y=(Px(top)) width=(Px(right - left)) height=(Px(bottom - top)) {}
            }
            g clip-path={ "url(#" (clip) ")" } {
                @for &[from, to] in walls {
                    @let ([x0, y0], [x1, y1]) = (self.place(from), self.place(to));
                    path.wall d=(format_args!("M{x0:.1},{y0:.1}L{x1:.1},{y1:.1}")) {}
                }
                @for &(centre, radius) in discs {
                    @let [x, y] = self.place(centre);
                    circle.wall.disc data-scaled cx=(Px(x)) cy=(Px(y)) r=(Px(radius * pixels)) {}
                }
            }
        });
    }

    /// A level drawn across, with a few words above its right end.
    pub fn level(&mut self, y: f64, label: &str) {
        let [left, py] = self.place([self.x.min, y]);
        let [right, _] = self.place([self.x.max, y]);
        // Above the line; below where there is no room above.
        let text_y = if py < TOP + 16.0 { py + 13.0 } else { py - 5.0 };
        self.draw_path("level", &format!("M{left:.1},{py:.1}H{right:.1}"));
        self.draw_over(&html! {
            text.note data-of="level" x=(Px(right)) y=(Px(text_y)) text-anchor="end" { (label) }
        });
        self.names([label.to_owned()]);
        self.data.add("level", Kind::Levels, [[y]]);
    }

    /// Moments, as lines from top to bottom, each with a word; of those that stand too close only the first has its word.
    pub fn moments(&mut self, moments: &[(f64, &str)]) {
        let mut free_x = f64::NEG_INFINITY;
        for &(moment, word) in moments {
            if !(self.x.min..=self.x.max).contains(&moment) {
                continue;
            }
            let [x, bottom] = self.place([moment, self.y.min]);
            let [_, top] = self.place([moment, self.y.max]);
            self.draw_path("moment", &format!("M{x:.1},{top:.1}V{bottom:.1}"));
            self.names([word.to_owned()]);
            self.data.add("moment", Kind::Moments, [[moment]]);
            if free_x <= x {
                self.draw_over(
                    &html! { text.note data-of="moment" x=(Px(x + 3.0)) y=(Px(bottom - 6.0)) { (word) } },
                );
                free_x = x + 8.0 + 7.0 * word.chars().count() as f64;
            }
        }
    }

    /// A few words beside a point.
    pub fn label(&mut self, class: &str, point: [f64; 2], text: &str) {
        let [x, y] = self.place(point);
        let to_the_left = self.width - RIGHT - 60.0 < x;
        let (x, anchor) = if to_the_left { (x - 8.0, "end") } else { (x + 8.0, "start") };
        let y = (y - 7.0).max(TOP + 10.0);
        let length = DIGIT * 1.2 * text.chars().count() as f64;
        let left = if to_the_left { x - length } else { x };
        self.taken.push([left, y - 11.0, left + length, y + 3.0]);
        self.draw(&html! {
            text class=(class) x=(Px(x)) y=(Px(y)) text-anchor=(anchor) { (text) }
        });
    }

    /// Numbers beside points, each where it covers no other; those for which there is no room are left out.
    pub fn numbers(&mut self, points: impl IntoIterator<Item = (usize, [f64; 2])>) {
        let mut taken = self.taken.clone();
        let most = MAX_NUMBERS + taken.len();
        let mut texts = Markup::default();
        for (number, point) in points {
            let text = number.to_string();
            let [x, y] = self.place(point);
            let width = DIGIT * text.len() as f64;
            let to_the_left = self.width - RIGHT < x + 5.0 + width;
            let left = if to_the_left { x - 5.0 - width } else { x + 5.0 };
            let area = [left, y - 5.0, left + width, y + 5.0];
            let overlaps = |other: &[f64; 4]| {
                area[0] < other[2] && other[0] < area[2] && area[1] < other[3] && other[1] < area[3]
            };
            if taken.len() < most && !taken.iter().any(overlaps) {
                taken.push(area);
                html! { text x=(Px(left)) y=(Px(y + 4.0)) { (text) } }.render_to(&mut texts.0);
            }
        }
        self.draw_over(&html! { g.numbers { (texts) } });
    }

    /// A span of time from top to bottom, with a few words along its middle.
    pub fn span(&mut self, [from, to]: [f64; 2], label: &str) {
        let ([left, top], [right, bottom]) =
            (self.place([from, self.y.max]), self.place([to, self.y.min]));
        let path = format!("M{left:.1},{top:.1}H{right:.1}V{bottom:.1}H{left:.1}Z");
        self.draw_path("span", &path);
        let (x, y) = ((left + right) / 2.0 + 4.0, (top + bottom) / 2.0);
        self.draw_over(&html! {
            text.note data-of="span" transform={ "translate(" (Px(x)) "," (Px(y)) ")rotate(-90)" } text-anchor="middle" {
                (label)
            }
        });
        self.names([label.to_owned()]);
        self.data.add("span", Kind::Spans, [[from, to]]);
    }

    /// The picture as part of a page, with a name and a text that says the same, and with its data after it. `id`: the
    /// identifier that its name and text begin with, which no other picture of the page has.
    pub fn finish(self, id: &str, title: &str, alternative: &str) -> Markup {
        let [left, top] = [self.left, TOP];
        let plane = [left, top, self.width - RIGHT, self.height - self.bottom];
        let data = self.data.markup(plane, &self.x, &self.y);
        html! { (self.svg(id, title, alternative, None)) (data) }
    }

    /// The picture as a file of its own, which brings its style.
    pub fn finish_file(self, id: &str, title: &str, alternative: &str, style: &str) -> String {
        self.svg(id, title, alternative, Some(style)).into_string() + "\n"
    }

    fn svg(self, id: &str, title: &str, alternative: &str, style: Option<&str>) -> Markup {
        let namespace = style.map(|_| "http://www.w3.org/2000/svg");
        html! {
            svg class=[self.class] xmlns=[namespace] viewBox={ "0 0 " (self.width) " " (self.height) }
                role="img" aria-labelledby={ (id) "-title " (id) "-text" }
            {
                @if let Some(style) = style { style { (PreEscaped(style)) } }
                title id={ (id) "-title" } { (title) }
                desc id={ (id) "-text" } { (alternative) }
                g.axes { (self.axes) }
                g.marks { (self.body) (self.over) }
            }
        }
    }

    fn draw(&mut self, markup: &Markup) {
        markup.render_to(&mut self.body.0);
    }

    fn draw_over(&mut self, markup: &Markup) {
        markup.render_to(&mut self.over.0);
    }

    /// Draws a path, if there is anything on it.
    fn draw_path(&mut self, class: &str, path: &str) {
        if !path.is_empty() {
            self.draw(&html! { path class=(class) d=(path) {} });
        }
    }

    /// Where a point lies in the picture.
    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (width, height) = (self.width - self.left - RIGHT, self.height - TOP - self.bottom);
        [
            self.left + self.x.share(x) * width + self.data.shift,
            self.height - self.bottom - self.y.share(y) * height,
        ]
    }

    /// A path through points, without those that would not be seen to move.
    fn path(&self, points: impl IntoIterator<Item = Option<[f64; 2]>>) -> String {
        let mut path = String::new();
        let mut last: Option<[f64; 2]> = None;
        let mut skipped: Option<[f64; 2]> = None;
        let add = |path: &mut String, command: char, [x, y]: [f64; 2]| {
            let _ = write!(path, "{command}{x:.1},{y:.1}");
        };
        for point in points {
            let Some(point) = point.map(|point| self.place(point)) else {
                if let Some(skipped) = skipped.take() {
                    add(&mut path, 'L', skipped);
                }
                last = None;
                continue;
            };
            match last {
                Some([x, y]) if (point[0] - x).abs() + (point[1] - y).abs() < 0.7 => {
                    skipped = Some(point);
                }
                Some(_) => {
                    add(&mut path, 'L', point);
                    (last, skipped) = (Some(point), None);
                }
                None => {
                    add(&mut path, 'M', point);
                    last = Some(point);
                }
            }
        }
        if let Some(skipped) = skipped {
            add(&mut path, 'L', skipped);
        }
        path
    }

    fn axes(&self) -> Markup {
        let n_x = (self.width - self.left - RIGHT) / 80.0;
        let n_x = n_x.max(3.0);
        let n_y = n_ticks_y(self.height - TOP - self.bottom);
        let [left, bottom] = self.place([self.x.min, self.y.min]);
        let [right, top] = self.place([self.x.max, self.y.max]);
        let slot = (right - left) / (self.x.max - self.x.min);
        let names = self.x.wrapped_names(slot);
        let mut free_x = f64::NEG_INFINITY;
        let mut x_ticks: Vec<(f64, Vec<String>)> = Vec::new();
        for (place, (tick, label)) in self.x.labelled_ticks(n_x).into_iter().enumerate() {
            let [x, _] = self.place([tick, self.y.min]);
            let half = text_width(&label) / 2.0;
            let named = names.get(place).cloned();
            // Of numbers that stand too close the first has its label.
            if named.is_some() || free_x <= x - half {
                free_x = x + half + 6.0;
                x_ticks.push((tick, named.unwrap_or_else(|| vec![label])));
            }
        }
        let middle = |label: &str| {
            // Above the room of the plane only if it needs that of the whole picture.
            if text_width(label) <= right - left { (left + right) / 2.0 } else { self.width / 2.0 }
        };
        html! {
            @for (tick, lines) in &x_ticks {
                @let [x, _] = self.place([*tick, self.y.min]);
                path.grid d=(format_args!("M{x:.1},{top:.1}V{bottom:.1}")) {}
                @for (number, line) in lines.iter().enumerate() {
                    text.tick x=(Px(x)) y=(Px(bottom + 17.0 + LINE * number as f64)) text-anchor="middle" { (line) }
                }
            }
            @for (tick, label) in self.y.labelled_ticks(n_y) {
                @let [_, y] = self.place([self.x.min, tick]);
                path.grid d=(format_args!("M{left:.1},{y:.1}H{right:.1}")) {}
                text.tick x=(Px(left - GAP)) y=(Px(y + 4.0)) text-anchor="end" { (label) }
            }
            path.axis d=(format_args!("M{left:.1},{top:.1}V{bottom:.1}H{right:.1}")) {}
            text.axis-label x=(Px(middle(&self.x.label))) y=(Px(self.height - 6.0)) text-anchor="middle"
                textLength=[fitted(&self.x.label, self.width)] { (self.x.label) }
            text.axis-label x="2" y="15"
                textLength=[fitted(&self.y.label, self.width)] { (self.y.label) }
        }
    }
}

/// Width of a digit of a number beside a point, and most such numbers in a picture.
const DIGIT: f64 = 6.5;
const MAX_NUMBERS: usize = 250;
/// Height of a line of ticks or of a label.
const LINE: f64 = 14.0;
/// Least room left of the plane, and the gap between it and the labels there.
const LEFT: f64 = 56.0;
const GAP: f64 = 7.0;
const RIGHT: f64 = 24.0;
/// Room above the plane: the label of the axis at its left stands there, where it can be read without turning the head.
const TOP: f64 = 28.0;
const BOTTOM: f64 = 44.0;

#[cfg(test)]
mod tests;
