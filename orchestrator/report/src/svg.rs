//! Charts as inline SVG: axes, lines, bands and marks. Colours come from classes, so that a style sheet can make the same
//! picture light or dark.
//!
//! The drawing is our own because a page needs three things that plotting libraries do not offer together: pictures without a
//! script, colours from the page's style sheet in place of fixed ones, and each picture's words as its accessible name. What
//! is left to do for a chart is two linear scales and a dozen kinds of marks. Elements and escaping come from maud; only the
//! data of paths are written here.

use maud::{Markup, PreEscaped, Render, html};
use numbers::format::shortest;
use numbers::ticks;
use std::fmt::Write as _;

/// A coordinate in pixels, written with one decimal.
#[derive(Clone, Copy)]
pub(crate) struct Px(pub(crate) f64);

impl Render for Px {
    fn render_to(&self, buffer: &mut String) {
        let _ = write!(buffer, "{:.1}", self.0);
    }
}

/// An axis: what it shows, from where to where.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    /// What it shows, with the unit.
    pub label: String,
    /// Value at the lower end of the axis, in its unit.
    pub min: f64,
    /// Upper end, greater than `min`.
    pub max: f64,
    /// Ticks are in per cent.
    is_percent: bool,
    /// Least distance of ticks.
    least_step: f64,
    /// Words at 0, 1, 2, … in place of numbers.
    names: Vec<String>,
    /// Numbers that have ticks in place of round ones.
    marked: Vec<f64>,
}

impl Axis {
    /// An axis from `min` to `max`, or further where these are too close to be told apart.
    pub fn new(label: &str, min: f64, max: f64) -> Self {
        // Ends that no label could tell apart.
        let least = 1e-9 * min.abs().max(max.abs());
        let max = if least < max - min { max } else { min + min.abs().max(1.0) };
        Self { label: label.to_owned(), min, max, ..Self::default() }
    }

    /// The same with ticks in per cent.
    pub fn percent(mut self) -> Self {
        self.is_percent = true;
        self
    }

    /// The same with ticks at whole numbers only.
    pub fn integer_ticks(mut self) -> Self {
        self.least_step = 1.0;
        self
    }

    /// The same with words at 0, 1, 2, … in place of numbers.
    pub fn named(mut self, names: &[String]) -> Self {
        self.names = names.to_vec();
        self
    }

    /// The same with ticks at these numbers, as far as there is room for them.
    pub fn ticks_at(mut self, numbers: &[f64]) -> Self {
        self.marked = numbers.to_vec();
        self.marked.sort_by(f64::total_cmp);
        self.marked.dedup();
        self
    }

    /// Distance between ticks if there are to be about `n`.
    fn step(&self, n: f64) -> f64 {
        ticks::round_step(((self.max - self.min) / n).max(self.least_step))
    }

    /// Round numbers along the axis, about `n` of them.
    fn ticks(&self, n: f64) -> Vec<f64> {
        if !self.names.is_empty() {
            return (0..self.names.len()).map(|name| name as f64).collect();
        }
        if !self.marked.is_empty() {
            return self.marked.clone();
        }
        ticks::ticks(self.min, self.max, self.step(n))
    }

    /// The words at whole numbers in lines, where each number has so many pixels.
    fn wrapped_names(&self, slot: f64) -> Vec<Vec<String>> {
        let most = ((slot - 6.0) / LETTER).max(3.0) as usize;
        self.names.iter().map(|name| wrapped(name, most)).collect()
    }

    fn tick_label(&self, tick: f64, step: f64) -> String {
        if let Some(name) = self.names.get(tick.max(0.0) as usize) {
            return name.clone();
        }
        if self.is_percent {
            return format!("{} %", ticks::tick_label(100.0 * tick, 100.0 * step));
        }
        if !self.marked.is_empty() {
            return shortest(tick);
        }
        ticks::tick_label(tick, step)
    }

    /// About `n` ticks, each with a label that differs from those of its neighbours.
    fn labelled_ticks(&self, n: f64) -> Vec<(f64, String)> {
        let step = self.step(n);
        self.ticks(n).into_iter().map(|tick| (tick, self.tick_label(tick, step))).collect()
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
    body: Markup,
    /// What lies above everything else.
    over: Markup,
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
        let (class, taken) = (None, Vec::new());
        let mut chart = Self { x, y, width, height, left, bottom, class, taken, body, over };
        chart.axes();
        chart
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
    }

    /// Straight lines between two points each, all alike.
    pub fn segments(&mut self, class: &str, lines: impl IntoIterator<Item = [[f64; 2]; 2]>) {
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
        for [from, to] in corners {
            let ([x0, y0], [x1, y1]) = (self.place(from), self.place(to));
            let _ = write!(path, "M{x0:.1},{y0:.1}H{x1:.1}V{y1:.1}H{x0:.1}Z");
        }
        self.draw_path(class, &path);
    }

    /// Dots, all alike.
    pub fn dots(&mut self, class: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        let mut path = String::new();
        for point in points {
            let [x, y] = self.place(point);
            let _ = write!(path, "M{x:.1},{y:.1}h0");
        }
        self.draw_path(class, &path);
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
        self.draw(&html! { circle class=(class) cx=(Px(x)) cy=(Px(y)) r=(Px(edge - x)) {} });
    }

    /// A dot with an interval, which says more when pointed at.
    pub fn interval(&mut self, x: f64, y: f64, [low, high]: [f64; 2], title: &str) {
        let ([px, py], [_, top], [_, foot]) =
            (self.place([x, y]), self.place([x, high]), self.place([x, low]));
        let left = px - 3.0;
        let whisker =
            format!("M{px:.1},{top:.1}V{foot:.1}M{left:.1},{top:.1}h6M{left:.1},{foot:.1}h6");
        self.draw(&html! {
            g.interval {
                title { (title) }
                path d=(whisker) {}
                circle cx=(Px(px)) cy=(Px(py)) r="3.5" {}
            }
        });
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
                    circle.wall.disc cx=(Px(x)) cy=(Px(y)) r=(Px(radius * pixels)) {}
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
            text.note x=(Px(right)) y=(Px(text_y)) text-anchor="end" { (label) }
        });
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
            if free_x <= x {
                self.draw_over(
                    &html! { text.note x=(Px(x + 3.0)) y=(Px(bottom - 6.0)) { (word) } },
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
            text.note transform={ "translate(" (Px(x)) "," (Px(y)) ")rotate(-90)" } text-anchor="middle" {
                (label)
            }
        });
    }

    /// The picture as part of a page, with a name and a text that says the same. `id`: the identifier that its name and text
    /// begin with, which no other picture of the page has.
    pub fn finish(self, id: &str, title: &str, alternative: &str) -> Markup {
        self.svg(id, title, alternative, None)
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
                (self.body)
                (self.over)
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
        let share = |axis: &Axis, value: f64| (value - axis.min) / (axis.max - axis.min);
        [
            self.left + share(&self.x, x) * (self.width - self.left - RIGHT),
            self.height - self.bottom - share(&self.y, y) * (self.height - TOP - self.bottom),
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

    fn axes(&mut self) {
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
        self.draw(&html! {
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
        });
    }
}

/// How many ticks an axis of this height (pixels) has room for.
fn n_ticks_y(height: f64) -> f64 {
    (height / 45.0).max(2.0)
}

/// About how long a text of the size of ticks and labels is.
fn text_width(text: &str) -> f64 {
    LETTER * text.chars().count() as f64
}

/// The length that a label is drawn with, if it is else longer than the picture is wide.
fn fitted(label: &str, width: f64) -> Option<Px> {
    (width - 4.0 < text_width(label)).then_some(Px(width - 4.0))
}

/// A name in lines of at most `most` letters, broken at spaces and hyphens, and within words only where nothing else helps.
fn wrapped(name: &str, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    for word in name.split_inclusive([' ', '-']) {
        let letters: Vec<char> = word.chars().collect();
        for piece in letters.chunks(most) {
            let piece: String = piece.iter().collect();
            match lines.last_mut() {
                Some(line) if line.chars().count() + piece.trim_end().chars().count() <= most => {
                    line.push_str(&piece);
                }
                _ => lines.push(piece),
            }
        }
    }
    lines.retain(|line| !line.trim().is_empty());
    lines.iter().map(|line| line.trim_end().to_owned()).collect()
}

/// Width of a digit of a number beside a point, and most such numbers in a picture.
const DIGIT: f64 = 6.5;
const MAX_NUMBERS: usize = 250;
/// About the width of a letter of a tick or a label, and the height of a line of them.
const LETTER: f64 = 7.0;
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
