//! What the marks of a picture mean, in rows below its title.

use crate::colours::{SHADES, Theme};
use crate::drawing::{Anchor, Shape, Text, dashed, fill, line, segment};
use crate::font::Font;
use crate::layout::{LOST_WIDTH, LinkColour, Style, dart, ground_range};
use crate::scene::{Knowledge, Obstacle};
use crate::stage::{Stage, TRAIL_NS};
use numbers::format::{number, trimmed};
use proto::types::seconds;
use tiny_skia::{PathBuilder, Rect};
use view::view::Place;

/// Height of a row of a legend (px).
pub(crate) const LEGEND_ROW: u32 = 21;
/// Most groups with an entry.
const MOST_GROUPS: usize = 8;
/// Room between a mark and its words, and after these. Other programs' letters may be wider than ours.
const GAP: f32 = 6.0;
const SPARE: f32 = 1.12;
const AFTER: f32 = 20.0;
const SIZE: f32 = 12.0;
/// Width of a shade, and of a scale of all shades.
const SHADE: f32 = 4.0;
const SCALE: f32 = SHADE * SHADES as f32;

/// Shapes of a legend within a width from `at`, the left upper corner, and how many rows it has.
pub(crate) fn legend(
    stage: &Stage,
    style: &Style,
    theme: &Theme,
    font: &Font,
    at: [f32; 2],
    width: f32,
) -> (Vec<Shape>, u32) {
    let [left, top] = at;
    let mut row =
        Row { theme, font, shapes: Vec::new(), left, right: left + width, x: left, y: top };
    let groups = &stage.run().groups;
    if groups.is_empty() {
        row.robot("robot", 0);
    }
    for (number, group) in groups.iter().enumerate().take(MOST_GROUPS) {
        row.robot(&format!("{} ({})", group.name, group.count), number);
    }
    if stage.is_any_lost() {
        row.entry(18.0, "robot that is lost", |shapes, [x, y]| {
            line(shapes, dart([x + 8.0, y], 0.0, 7.0), theme.lost, LOST_WIDTH);
        });
    }
    if stage.has_trails() {
        let words = format!("path of the last {} s", trimmed(seconds(TRAIL_NS), 3));
        row.stroke(&words, theme.group(0).with_opacity(0.5), 1.5);
    }
    match style.links {
        LinkColour::Rssi => row.scale("link: received signal strength (dBm)", ["−100", "−50"]),
        LinkColour::Delivery => row.scale("link: frames delivered of those sent", ["0 %", "100 %"]),
        LinkColour::None => {}
    }
    if let Some(place) = &stage.run().place {
        row.place(place);
    }
    let rows = ((row.y - top) / LEGEND_ROW as f32).round() as u32 + 1;
    (row.shapes, rows)
}

/// A row that is being filled.
struct Row<'a> {
    theme: &'a Theme,
    font: &'a Font,
    shapes: Vec<Shape>,
    left: f32,
    right: f32,
    x: f32,
    y: f32,
}

impl Row<'_> {
    /// A mark of some width, drawn from the left end of its middle line, and its words.
    fn entry(&mut self, mark: f32, words: &str, draw: impl FnOnce(&mut Vec<Shape>, [f32; 2])) {
        let width = mark + GAP + self.width(words);
        self.make_room(width);
        draw(&mut self.shapes, [self.x, self.y + 6.0]);
        self.words(words, self.x + mark + GAP, Anchor::Start);
        self.x += width + AFTER;
    }

    fn width(&self, words: &str) -> f32 {
        SPARE * SIZE * self.font.width(words)
    }

    fn make_room(&mut self, width: f32) {
        if self.right < self.x + width && self.left < self.x {
            self.x = self.left;
            self.y += LEGEND_ROW as f32;
        }
    }

    fn words(&mut self, words: &str, x: f32, anchor: Anchor) {
        self.shapes.push(Shape::Text(Text {
            at: [x, self.y + 10.0],
            anchor,
            size: SIZE,
            text: words.to_owned(),
            colour: self.theme.faint_text,
            halo: None,
            is_upright: false,
        }));
    }

    fn robot(&mut self, words: &str, group: usize) {
        let colour = self.theme.group(group);
        self.entry(18.0, words, |shapes, [x, y]| {
            fill(shapes, dart([x + 8.0, y], 0.0, 7.0), colour);
        });
    }

    fn stroke(&mut self, words: &str, colour: crate::colours::Colour, thickness: f32) {
        self.entry(22.0, words, |shapes, [x, y]| {
            let mut path = PathBuilder::new();
            segment(&mut path, [x, y], [x + 22.0, y]);
            line(shapes, path, colour, thickness);
        });
    }

    /// The colours of links, with the first and the last value.
    fn scale(&mut self, words: &str, [least, most]: [&str; 2]) {
        let before = self.width(words) + GAP + self.width(least) + GAP;
        let whole = before + SCALE + GAP + self.width(most);
        self.make_room(whole);
        self.words(words, self.x, Anchor::Start);
        let begin = (self.x + before).floor();
        self.words(least, begin - GAP, Anchor::End);
        for (shade, colour) in self.theme.links.iter().enumerate() {
            // Whole pixels, so that there is no gap between two shades.
            let x = begin + shade as f32 * SHADE;
            let rect = Rect::from_xywh(x, self.y + 1.0, SHADE, 10.0);
            self.shapes.extend(rect.map(|rect| Shape::Fill {
                path: PathBuilder::from_rect(rect),
                // One link alone is lighter than this, many over each other are not.
                colour: colour.with_opacity(1.0),
                is_crisp: true,
                robot: None,
            }));
        }
        self.words(most, begin + SCALE + GAP, Anchor::Start);
        self.x += whole + AFTER;
    }

    fn place(&mut self, place: &Place) {
        let theme = self.theme;
        let walls = || place.walls.iter().map(|wall| Knowledge::from(wall.kind()));
        if walls().any(|kind| kind == Knowledge::Site) {
            self.stroke("wall", theme.wall, 3.0);
        }
        let discs: Vec<Knowledge> =
            place.obstacles.iter().map(|obstacle| Obstacle::from(obstacle).kind).collect();
        let has_effect =
            |of: Knowledge| walls().chain(discs.iter().copied()).any(|kind| kind == of);
        let circle = |[x, y]: [f32; 2]| {
            let mut path = PathBuilder::new();
            path.push_circle(x + 7.0, y, 6.0);
            path
        };
        if discs.contains(&Knowledge::Site) {
            self.entry(14.0, "obstacle", |shapes, at| {
                fill(shapes, circle(at), theme.obstacle_fill);
                line(shapes, circle(at), theme.obstacle, 1.0);
            });
        }
        if has_effect(Knowledge::Hidden) {
            self.entry(14.0, "hidden from robots", |shapes, at| {
                dashed(shapes, circle(at), theme.hidden, [4.0, 3.0]);
            });
        }
        if has_effect(Knowledge::Estimated) {
            self.entry(14.0, "estimated", |shapes, at| {
                dashed(shapes, circle(at), theme.estimated, [2.0, 2.0]);
            });
        }
        if !place.foliage.is_empty() {
            self.entry(14.0, "foliage", |shapes, at| fill(shapes, circle(at), theme.foliage));
        }
        if let Some(ground) = &place.ground {
            let [least, most] = ground_range(ground).map(|height| number(f64::from(height)));
            self.entry(14.0, &format!("ground, {least} to {most} m high"), |shapes, at| {
                fill(shapes, circle(at), theme.high_ground);
            });
        }
    }
}
