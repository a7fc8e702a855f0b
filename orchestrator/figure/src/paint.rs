//! A figure in shapes, at the size at which a journal prints it. Units are points, 1/72 inch.

mod labels;
mod marks;

use crate::content::{Axis, Figure, Panel, Scale};
use crate::scale::{place, ticks};
use picture::colours::{Colour, SHADES, Theme};
use picture::drawing::{Anchor, Drawing, Plane, Shape, Text, fill, line, segment};
use picture::font::Font;
use tiny_skia::{PathBuilder, Rect};

/// Points in a millimetre.
const POINTS_PER_MM: f32 = 72.0 / 25.4;
/// Width of a column of a journal with two (mm).
pub const COLUMN_MM: f32 = 88.0;
/// Width of its page (mm).
pub const PAGE_MM: f32 = 180.0;
/// A figure wider than this (mm) has its panels beside each other.
const WIDE_MM: f32 = 120.0;
/// Most panels in a row.
const MOST_COLUMNS: usize = 3;

/// Size of letters.
const SIZE: f32 = 8.0;
/// Size of ticks and legends.
const SMALL: f32 = 7.0;
/// Height of a line of small letters.
const LINE: f32 = 9.0;
/// Room between panels, and around all.
const GAP: f32 = 10.0;
const EDGE: f32 = 3.0;
/// Height of a plane that is no map, of the width of its panel: of one that is alone, of several below each other, and of several
/// beside each other.
const ALONE_ASPECT: f32 = 0.5;
const BELOW_ASPECT: f32 = 0.3;
const BESIDE_ASPECT: f32 = 0.6;
/// Height of a plane for each of its ticks, and fewest ticks.
const PER_TICK: f32 = 20.0;
const FEWEST_TICKS: f64 = 5.0;
/// Between a legend and the plane, on whose upper edge a value may stand.
const HEAD: f32 = 7.0;
/// Between an axis and what stands beside it.
const SPACE: f32 = 4.0;
/// Other programs' letters may be wider than ours.
const SPARE: f32 = 1.08;
/// Most lines of the name of a category.
const MOST_LINES: usize = 3;

/// A figure, `width_mm` wide.
#[must_use]
pub fn drawing(figure: &Figure, width_mm: f32) -> Drawing {
    let width = POINTS_PER_MM * width_mm;
    let n_columns =
        if width_mm <= WIDE_MM { 1 } else { figure.panels.len().clamp(1, MOST_COLUMNS) };
    let column = (width - 2.0 * EDGE - GAP * (n_columns - 1) as f32) / n_columns as f32;
    let mut painter =
        Painter { theme: Theme::new(false), font: Font::default(), shapes: Vec::new() };
    let panels = &figure.panels;
    let aspect = match (panels.len(), n_columns) {
        (0 | 1, _) => ALONE_ASPECT,
        (_, 1) => BELOW_ASPECT,
        _ => BESIDE_ASPECT,
    };
    let indent = if 1 < panels.len() { INDENT } else { 0.0 };
    let is_one_x = panels.iter().all(|panel| !panel.is_map && is_same_x(&panel.x, &panels[0].x));
    // Of panels beside each other, one label stands below all.
    let has_wide_label = (2..=n_columns).contains(&panels.len()) && is_one_x;
    let mut top = EDGE;
    // One legend above all, if all are the same.
    let has_one_legend =
        1 < panels.len() && panels.iter().all(|panel| has_legend_of(panel, &panels[0]));
    if has_one_legend {
        top += painter.legend(&panels[0], [EDGE, top, width - 2.0 * EDGE]) + SPACE;
    }
    let columns: Vec<Column> = (0..n_columns)
        .map(|place| painter.column(panels.iter().skip(place).step_by(n_columns), aspect * column))
        .collect();
    for (row, in_row) in panels.chunks(n_columns).enumerate() {
        let heads = in_row.iter().map(|panel| match has_one_legend {
            true => 0.0,
            false => painter.legend_height(panel, column - indent),
        });
        let letters = if 1 < panels.len() { SIZE + 1.0 } else { 0.0 };
        let head = heads.fold(letters, f32::max);
        let mut height = 0.0_f32;
        for (place, panel) in in_row.iter().enumerate() {
            let number = row * n_columns + place;
            let spot = Spot {
                left: EDGE + place as f32 * (column + GAP),
                top,
                width: column,
                head,
                plane_height: aspect * column,
                letter: (1 < panels.len())
                    .then(|| char::from(b'a' + u8::try_from(number).unwrap_or(0) % 26)),
                has_legend: !has_one_legend,
                has_label: !has_wide_label,
                has_x: !columns[place].has_one_x || panels.len() <= number + n_columns,
                column: &columns[place],
            };
            height = height.max(painter.panel(panel, &spot));
        }
        top += height + GAP;
    }
    if has_wide_label {
        let centre = [width / 2.0, top - GAP + SIZE];
        painter.fitted(centre, &panels[0].x.label, width, false);
        top += SIZE + 3.0;
    }
    top += painter.note(&figure.note, [EDGE, top - GAP + SPACE, width - 2.0 * EDGE]);
    let size = [width, top - GAP + EDGE].map(|length| length.ceil().max(1.0) as u32);
    Drawing {
        size,
        background: painter.theme.background,
        plane: Plane { left: 0, top: 0, width: size[0], height: size[1] },
        site: Vec::new(),
        swarm: Vec::new(),
        frame: Vec::new(),
        // Above the plane, which is all of the picture.
        title: painter.shapes,
        name: figure.title.clone(),
        alternative: figure.caption.clone(),
    }
}

/// What is being drawn.
struct Painter {
    theme: Theme,
    font: Font,
    shapes: Vec<Shape>,
}

/// Room for the mark of a series in a legend, and for the letter of a panel.
const SAMPLE: f32 = 18.0;
const INDENT: f32 = 16.0;

/// What the panels of a column have in common.
struct Column {
    /// Width of the widest value on their vertical axes.
    label_room: f32,
    /// Lines of the label of a vertical axis.
    n_lines: usize,
    /// All have the same horizontal axis, which stands below the last of them.
    has_one_x: bool,
}

/// Where a panel is drawn, and what of it.
struct Spot<'a> {
    left: f32,
    top: f32,
    width: f32,
    /// Height of letter and legend above the plane.
    head: f32,
    /// Height of the plane, unless it is a map.
    plane_height: f32,
    letter: Option<char>,
    has_legend: bool,
    /// Values stand below the plane, and not below another one; and so does the label of the axis.
    has_x: bool,
    has_label: bool,
    column: &'a Column,
}

/// The plane of a panel, and how values are placed on it.
struct Frame<'a> {
    panel: &'a Panel,
    x: Axis,
    y: Axis,
    /// Left, upper, right and lower edge.
    edges: [f32; 4],
}

impl Frame<'_> {
    fn at(&self, x: f64, y: f64) -> [f32; 2] {
        let [left, top, right, bottom] = self.edges;
        [
            left + place(&self.x, x) as f32 * (right - left),
            bottom - place(&self.y, y) as f32 * (bottom - top),
        ]
    }
}

impl Painter {
    fn width(&self, text: &str, size: f32) -> f32 {
        SPARE * size * self.font.width(text)
    }

    fn text(&mut self, at: [f32; 2], anchor: Anchor, size: f32, text: &str, is_upright: bool) {
        let colour = self.theme.text;
        let text = text.to_owned();
        self.shapes.push(Shape::Text(Text {
            at,
            anchor,
            size,
            text,
            colour,
            halo: None,
            is_upright,
        }));
    }

    /// What the panels of a column have in common, so that their planes begin at the same place.
    fn column<'a>(
        &self,
        panels: impl Iterator<Item = &'a Panel> + Clone,
        plane_height: f32,
    ) -> Column {
        let labels = panels.clone().flat_map(|panel| y_ticks(&panel.y, plane_height));
        let label_room = labels.map(|(_, label)| self.width(&label, SMALL)).fold(0.0, f32::max);
        let n_lines = panels
            .clone()
            .map(|panel| self.two_lines(&panel.y.label, plane_height).len())
            .max()
            .unwrap_or(1);
        let first = panels.clone().next();
        let is_like_first =
            |panel: &Panel| first.is_some_and(|first| is_same_x(&panel.x, &first.x));
        Column {
            label_room,
            n_lines,
            has_one_x: panels.clone().all(|panel| !panel.is_map && is_like_first(panel)),
        }
    }

    /// Draws a panel; returns its height.
    fn panel(&mut self, panel: &Panel, spot: &Spot<'_>) -> f32 {
        let Spot { left, top, width, .. } = *spot;
        if let Some(letter) = spot.letter {
            self.text([left, top + SIZE], Anchor::Start, SIZE, &format!("({letter})"), false);
        }
        if spot.has_legend {
            let indent = if spot.letter.is_some() { INDENT } else { 0.0 };
            self.legend(panel, [left + indent, top, width - indent]);
        }
        let y = top + spot.head + HEAD;
        let n_lines = spot.column.n_lines as f32;
        let plane_left = left + n_lines * SIZE + 5.0 + spot.column.label_room + SPACE;
        let right = left + width - 8.0;
        let plane_width = right - plane_left;
        let (x_axis, y_axis, plane_height) = if panel.is_map {
            map(panel, plane_width)
        } else {
            (panel.x.clone(), panel.y.clone(), spot.plane_height)
        };
        let bottom = y + plane_height;
        let frame = Frame { panel, x: x_axis, y: y_axis, edges: [plane_left, y, right, bottom] };
        let below = self.axes(&frame, spot);
        self.marks(&frame);
        bottom + below - top
    }

    /// The line below all panels; returns its height.
    fn note(&mut self, note: &str, [left, top, width]: [f32; 3]) -> f32 {
        if note.is_empty() {
            return 0.0;
        }
        let lines = self.lines(note, width);
        for (place, text) in (1..).zip(&lines) {
            self.text([left, top + LINE * place as f32], Anchor::Start, SMALL, text, false);
        }
        SPACE + LINE * lines.len() as f32
    }

    /// Small letters in lines that are no wider than `room`, unless a word is.
    fn lines(&self, text: &str, room: f32) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split(' ') {
            match lines.last_mut() {
                Some(last) if self.width(&format!("{last} {word}"), SMALL) <= room => {
                    last.push(' ');
                    last.push_str(word);
                }
                _ => lines.push(word.to_owned()),
            }
        }
        lines
    }

    /// The label of an axis: in two lines where one is longer than its room, if it has a place to break.
    fn two_lines(&self, label: &str, room: f32) -> Vec<String> {
        if self.width(label, SIZE) <= room {
            return vec![label.to_owned()];
        }
        let longer = |at: usize| {
            let (first, second) = label.split_at(at);
            self.width(first, SIZE).max(self.width(second.trim_start(), SIZE))
        };
        let places = label.match_indices(' ').map(|(at, _)| at);
        match places.min_by(|a, b| longer(*a).total_cmp(&longer(*b))) {
            Some(at) => vec![label[..at].to_owned(), label[at + 1..].to_owned()],
            None => vec![label.to_owned()],
        }
    }

    /// Draws both axes; returns the room that they take below the plane.
    fn axes(&mut self, frame: &Frame<'_>, spot: &Spot<'_>) -> f32 {
        let Spot { left, has_x, .. } = *spot;
        let [plane_left, top, right, bottom] = frame.edges;
        let grid = self.theme.grid.with_opacity(0.12);
        let mut lines = PathBuilder::new();
        for (tick, label) in y_ticks(&frame.y, bottom - top) {
            let [_, y] = frame.at(frame.x.range[0], tick);
            segment(&mut lines, [plane_left, y], [right, y]);
            self.text([plane_left - SPACE, y + 0.35 * SMALL], Anchor::End, SMALL, &label, false);
        }
        let middle = (top + bottom) / 2.0;
        for (place, text) in (1..).zip(self.two_lines(&frame.y.label, bottom - top)) {
            self.fitted([left + place as f32 * SIZE, middle], &text, bottom - top + 8.0, true);
        }
        let below = if frame.x.scale == Scale::Category {
            if has_x { self.categories(frame) } else { 0.0 }
        } else {
            let mut free = f32::NEG_INFINITY;
            for (tick, label) in ticks(&frame.x, f64::from((right - plane_left) / 42.0).max(2.0)) {
                let [x, _] = frame.at(tick, frame.y.range[0]);
                segment(&mut lines, [x, top], [x, bottom]);
                let half = self.width(&label, SMALL) / 2.0;
                // Of labels that stand too close the first is there.
                if has_x && free <= x - half {
                    self.text([x, bottom + LINE], Anchor::Middle, SMALL, &label, false);
                    free = x + half + 4.0;
                }
            }
            LINE
        };
        line(&mut self.shapes, lines, grid, 0.5);
        let mut axes = PathBuilder::new();
        segment(&mut axes, [plane_left, top], [plane_left, bottom]);
        segment(&mut axes, [plane_left, bottom], [right, bottom]);
        line(&mut self.shapes, axes, self.theme.text, 0.7);
        if !has_x {
            return 0.0;
        }
        if frame.x.label.is_empty() || !spot.has_label {
            return below + 3.0;
        }
        let centre = [(plane_left + right) / 2.0, bottom + below + SIZE + 3.0];
        self.fitted(centre, &frame.x.label, right - left, false);
        below + SIZE + 6.0
    }

    /// The label of an axis, in smaller letters if it is longer than its room.
    fn fitted(&mut self, at: [f32; 2], label: &str, room: f32, is_upright: bool) {
        let size = SIZE * (room / self.width(label, SIZE)).clamp(0.5, 1.0);
        self.text(at, Anchor::Middle, size, label, is_upright);
    }

    /// Names of categories below the plane: in lines, or upright where these are too narrow. Returns their height.
    fn categories(&mut self, frame: &Frame<'_>) -> f32 {
        let [plane_left, _, right, bottom] = frame.edges;
        let names = &frame.x.categories;
        let slot = (right - plane_left) / names.len().max(1) as f32 - 4.0;
        let wrapped: Vec<Option<Vec<String>>> =
            names.iter().map(|name| self.wrapped(name, slot)).collect();
        let mut height = 0.0_f32;
        for (at, name) in names.iter().enumerate() {
            let [x, _] = frame.at(at as f64, frame.y.range[0]);
            if wrapped.iter().all(Option::is_some) {
                for (number, text) in wrapped[at].iter().flatten().enumerate() {
                    let y = bottom + LINE * (number + 1) as f32;
                    self.text([x, y], Anchor::Middle, SMALL, text, false);
                    height = height.max(LINE * (number + 1) as f32);
                }
            } else {
                self.text([x + 0.35 * SMALL, bottom + 4.0], Anchor::End, SMALL, name, true);
                height = height.max(self.width(name, SMALL) + 4.0);
            }
        }
        height
    }

    /// A name in lines that are no wider than `room`, if a few suffice.
    fn wrapped(&self, name: &str, room: f32) -> Option<Vec<String>> {
        let mut lines: Vec<String> = Vec::new();
        for word in name.split_inclusive([' ', '-', '_']) {
            match lines.last_mut() {
                Some(last) if self.width(&format!("{last}{}", word.trim_end()), SMALL) <= room => {
                    last.push_str(word);
                }
                _ => lines.push(word.to_owned()),
            }
        }
        let fits = |text: &String| self.width(text.trim_end(), SMALL) <= room;
        (lines.len() <= MOST_LINES && lines.iter().all(fits)).then_some(lines)
    }

    /// The height of a legend.
    fn legend_height(&mut self, panel: &Panel, width: f32) -> f32 {
        let n_shapes = self.shapes.len();
        let height = self.legend(panel, [0.0, 0.0, width]);
        self.shapes.truncate(n_shapes);
        height
    }

    /// What the series are, and what colours stand for, in rows; returns their height.
    fn legend(&mut self, panel: &Panel, [left, top, width]: [f32; 3]) -> f32 {
        let [mut x, mut y] = [left, top];
        let mut n_entries = 0;
        let has_markers = marks::has_markers(panel);
        for series in panel.series.iter().filter(|series| !series.name.is_empty()) {
            let mut room = SAMPLE + self.width(&series.name, SMALL) + 8.0;
            if left + width < x + room && left < x {
                (x, y) = (left, y + LINE);
            }
            self.sample(series, [x, y + 0.5 * LINE], has_markers);
            for (place, text) in self.lines(&series.name, width - SAMPLE).iter().enumerate() {
                if 0 < place {
                    y += LINE;
                    room = width;
                }
                let baseline = y + 0.5 * LINE + 0.35 * SMALL;
                self.text([x + SAMPLE, baseline], Anchor::Start, SMALL, text, false);
            }
            x += room;
            n_entries += 1;
        }
        if let Some(colour) = &panel.colour {
            let [low, high] = colour.range;
            let label = |value: f64| match colour.is_share {
                true => format!("{} %", numbers::format::shortest(100.0 * value)),
                false => numbers::format::shortest(value),
            };
            let (low, high) = (label(low), format!("{} {}", label(high), colour.label));
            const SHADE: f32 = 2.0;
            let scale = SHADE * SHADES as f32;
            let room = self.width(&low, SMALL) + 6.0 + scale + self.width(&high, SMALL);
            if left + width < x + room && left < x {
                (x, y) = (left, y + LINE);
            }
            let baseline = y + 0.5 * LINE + 0.35 * SMALL;
            self.text([x, baseline], Anchor::Start, SMALL, &low, false);
            x += self.width(&low, SMALL) + 3.0;
            for shade in self.theme.links {
                let mut path = PathBuilder::new();
                path.push_rect_of(Rect::from_xywh(x, y + 1.5, SHADE + 0.2, LINE - 3.0));
                fill(&mut self.shapes, path, shade.with_opacity(1.0));
                x += SHADE;
            }
            self.text([x + 3.0, baseline], Anchor::Start, SMALL, &high, false);
            n_entries += 1;
        }
        if n_entries == 0 { 0.0 } else { y + LINE - top }
    }

    fn colour(&self, group: Option<usize>) -> Colour {
        group.map_or(self.theme.text, |group| self.theme.group(group))
    }
}

/// Ticks of a vertical axis of this height.
fn y_ticks(axis: &Axis, height: f32) -> Vec<(f64, String)> {
    ticks(axis, f64::from(height / PER_TICK).max(FEWEST_TICKS))
}

fn is_same_x(a: &Axis, b: &Axis) -> bool {
    (&a.label, a.scale, a.range, &a.categories, &a.ticks)
        == (&b.label, b.scale, b.range, &b.categories, &b.ticks)
}

/// Whether a panel has the legend of another, and nothing else to explain.
fn has_legend_of(panel: &Panel, other: &Panel) -> bool {
    let entries = |panel: &Panel| {
        let named = panel.series.iter().filter(|series| !series.name.is_empty());
        named.map(|series| (series.name.clone(), series.mark, series.group)).collect::<Vec<_>>()
    };
    panel.colour.is_none() && !panel.is_map && entries(panel) == entries(other)
}

/// A rectangle that may be empty.
trait PushRect {
    fn push_rect_of(&mut self, rect: Option<Rect>);
}

impl PushRect for PathBuilder {
    fn push_rect_of(&mut self, rect: Option<Rect>) {
        if let Some(rect) = rect {
            self.push_rect(rect);
        }
    }
}

/// The axes of a map in a plane of this width with the same scale, and the height of the plane.
fn map(panel: &Panel, width: f32) -> (Axis, Axis, f32) {
    let length = |axis: &Axis| axis.range[1] - axis.range[0];
    let aspect = (length(&panel.y) / length(&panel.x)).clamp(0.3, 1.2);
    let height = f64::from(width) * aspect;
    let metres = (length(&panel.x) / f64::from(width)).max(length(&panel.y) / height);
    let around = |axis: &Axis, pixels: f64| {
        let (middle, half) = ((axis.range[0] + axis.range[1]) / 2.0, metres * pixels / 2.0);
        Axis { range: [middle - half, middle + half], ..axis.clone() }
    };
    (around(&panel.x, f64::from(width)), around(&panel.y, height), height as f32)
}
