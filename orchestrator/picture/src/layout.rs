//! From a scene in metres to shapes in pixels.

use crate::colours::{Colour, Theme};
use crate::drawing::{Anchor, Drawing, Plane, Shape, Text, dashed, fill, line, segment};
use crate::font::Font;
use crate::legend::{LEGEND_ROW, legend};
use crate::scene::{Knowledge, Obstacle, Robot, Scene};
use crate::stage::{Stage, TRAIL_NS};
use ::view::view;
use numbers::format::{count_of, trimmed};
use numbers::ticks::{round_step, tick_label, ticks};
use proto::types::seconds;
use std::collections::BTreeSet;
use tiny_skia::PathBuilder;

/// How a picture looks.
#[derive(Clone, Debug)]
pub struct Style {
    /// Width and height in pixels. `None`: what is drawn fills the picture.
    pub size: Option<[u32; 2]>,
    /// Light letters on a dark background.
    pub is_dark: bool,
    /// What colours links.
    pub links: LinkColour,
}

/// What colours links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkColour {
    /// Received signal strength of the last frame.
    Rssi,
    /// Share of the sender's frames that were delivered.
    Delivery,
    /// Links are not drawn.
    None,
}

impl LinkColour {
    /// Values of the first and the last colour: dBm, or a share.
    #[must_use]
    pub fn range(self) -> [f64; 2] {
        match self {
            Self::Rssi => [-100.0, -50.0],
            Self::Delivery | Self::None => [0.0, 1.0],
        }
    }
}

/// Room for the numbers at the axes, beside the plane, for the title, and below the plane.
const LEFT: u32 = 64;
const RIGHT: u32 = 16;
const TITLE: u32 = 38;
const BOTTOM: u32 = 46;
/// Room between everything that the picture must show and the edge of the plane.
const MARGIN: f64 = 22.0;
/// Room for what is drawn where the size of the picture is free (px²): about as much as a picture of 1280 × 720 has.
const FREE_AREA: f64 = 680_000.0;
/// Least width and height of that room, and the greatest (px).
const LEAST_FREE: [f64; 2] = [500.0, 200.0];
const MOST_FREE: [f64; 2] = [1500.0, 1000.0];
/// At most so many robots have their number beside them.
const NUMBERED: usize = 80;
/// Trails fade in so many steps.
const FADES: usize = 8;
/// Shades of ground.
const GROUND_SHADES: usize = 24;
/// Width of the outline of a robot that is lost.
pub(crate) const LOST_WIDTH: f32 = 1.3;
/// Corners of a robot that faces +x, in units of its radius: a dart.
pub(crate) const DART: [[f32; 2]; 4] = [[1.15, 0.0], [-0.85, 0.8], [-0.45, 0.0], [-0.85, -0.8]];

/// Lays out pictures of one run in one style.
pub struct Layout<'a> {
    stage: &'a Stage,
    style: Style,
    size: [u32; 2],
    theme: Theme,
    legend: Vec<Shape>,
    plane: Plane,
    font: Font,
}

/// Where metres are in a picture.
#[derive(Clone, Copy)]
struct Camera {
    /// The middle of the plane (m).
    centre_m: [f64; 2],
    /// Pixels per metre.
    scale: f64,
    /// The middle of the plane (px).
    centre: [f64; 2],
}

impl Camera {
    fn at(self, [x_m, y_m]: [f64; 2]) -> [f32; 2] {
        [
            (self.centre[0] + (x_m - self.centre_m[0]) * self.scale) as f32,
            (self.centre[1] - (y_m - self.centre_m[1]) * self.scale) as f32,
        ]
    }

    fn place(self, point_m: [f32; 2]) -> [f32; 2] {
        self.at(point_m.map(f64::from))
    }
}

/// Width and height of a plane that an extent (m) fills, of the same area for all that are not very long: even numbers (px).
fn free_room([least, most]: [[f64; 2]; 2]) -> [u32; 2] {
    let [width_m, height_m] = [0, 1].map(|axis| (most[axis] - least[axis]).max(1.0));
    let per_metre = libm::sqrt(FREE_AREA / width_m / height_m)
        .min(MOST_FREE[0] / width_m)
        .min(MOST_FREE[1] / height_m);
    [0, 1].map(|axis| {
        let pixels = ([width_m, height_m][axis] * per_metre).max(LEAST_FREE[axis]);
        libm::round(pixels / 2.0) as u32 * 2 + 2 * MARGIN as u32
    })
}

impl<'a> Layout<'a> {
    /// For pictures of this run.
    #[must_use]
    pub fn new(stage: &'a Stage, style: Style) -> Self {
        let theme = Theme::new(style.is_dark);
        let font = Font::default();
        let free = free_room(stage.extent_m());
        let width = style.size.map_or(free[0] + LEFT + RIGHT, |[width, _]| width);
        let plane_width = width.saturating_sub(LEFT + RIGHT).max(1);
        let (legend, rows) =
            legend(stage, &style, &theme, &font, [LEFT as f32, TITLE as f32], plane_width as f32);
        let top = TITLE + rows * LEGEND_ROW;
        // Videos need even numbers.
        let height =
            style.size.map_or((top + free[1] + BOTTOM).next_multiple_of(2), |[_, height]| height);
        let plane = Plane {
            left: LEFT,
            top,
            width: plane_width,
            height: height.saturating_sub(top + BOTTOM).max(1),
        };
        Self { stage, style, size: [width, height], theme, legend, plane, font }
    }

    /// Width and height of the pictures (px).
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Whether one picture's site and axes are those of another.
    #[must_use]
    pub fn is_fixed_between(&self, one: &Scene, other: &Scene) -> bool {
        one.extent_m == other.extent_m && one.obstacles == other.obstacles
    }

    /// The colours.
    #[must_use]
    pub fn theme(&self) -> &Theme {
        &self.theme
    }

    /// The picture of a scene.
    #[must_use]
    pub fn drawing(&self, scene: &Scene) -> Drawing {
        let camera = self.camera(scene);
        let mut site = Vec::new();
        let place = self.stage.run().place.as_ref();
        if let Some(place) = place {
            self.draw_place(&mut site, place, camera);
        }
        let mut frame = self.legend.clone();
        self.draw_axes(&mut site, &mut frame, camera);
        self.draw_obstacles(&mut site, &scene.obstacles, camera);
        let mut swarm = Vec::new();
        self.draw_trails(&mut swarm, scene, camera);
        self.draw_links(&mut swarm, scene, camera);
        self.draw_robots(&mut swarm, scene, camera);
        let title = self.title(scene);
        let n_alive = scene.robots.iter().filter(|robot| robot.alive).count();
        Drawing {
            size: self.size,
            background: self.theme.background,
            plane: self.plane,
            site,
            swarm,
            frame,
            name: format!("{} at {} s", scene.run, trimmed(scene.time_s, 6)),
            alternative: format!(
                "{} and {} seen from above, in metres.",
                count_of(n_alive as u64, "robot"),
                count_of(scene.links.len() as u64, "link")
            ),
            title,
        }
    }

    fn camera(&self, scene: &Scene) -> Camera {
        let [least, most] = scene.extent_m;
        let Plane { left, top, width, height } = self.plane;
        let scale = |axis: usize, pixels: u32| {
            let room = (f64::from(pixels) - 2.0 * MARGIN).max(10.0);
            room / (most[axis] - least[axis]).max(1.0)
        };
        Camera {
            centre_m: [0, 1].map(|axis| f64::midpoint(least[axis], most[axis])),
            scale: scale(0, width).min(scale(1, height)),
            centre: [
                f64::from(left) + f64::from(width) / 2.0,
                f64::from(top) + f64::from(height) / 2.0,
            ],
        }
    }

    fn text(&self, text: String, at: [f32; 2], anchor: Anchor) -> Text {
        let colour = self.theme.faint_text;
        Text { at, anchor, size: 12.0, text, colour, halo: None, is_upright: false }
    }

    fn title(&self, scene: &Scene) -> Vec<Shape> {
        let run = self.stage.run();
        let y = 25.0;
        let name = Text {
            size: 16.0,
            colour: self.theme.text,
            ..self.text(scene.run.clone(), [LEFT as f32, y], Anchor::Start)
        };
        // Times of all frames have the decimals of a step, so that the digits stay in place.
        let decimals = trimmed(seconds(run.step_ns), 6).split('.').nth(1).map_or(0, str::len);
        let when = format!(
            "seed {} · step {} of {} · {:.decimals$} s",
            scene.seed, scene.step, run.step_count, scene.time_s
        );
        let right = (LEFT + self.plane.width) as f32;
        let room = right - LEFT as f32 - 13.0 * self.font.width(&when) - 24.0;
        let mut name = name;
        while room < name.size * self.font.width(&name.text) && 1 < name.text.chars().count() {
            // A name that is too long is cut off.
            let kept: String = name.text.chars().take(name.text.chars().count() - 2).collect();
            name.text = kept + "…";
        }
        let when = Text { size: 13.0, ..self.text(when, [right, y], Anchor::End) };
        vec![Shape::Text(name), Shape::Text(when)]
    }

    /// Ground, foliage and walls.
    fn draw_place(&self, shapes: &mut Vec<Shape>, place: &view::Place, camera: Camera) {
        if let Some(ground) = &place.ground {
            self.draw_ground(shapes, ground, camera);
        }
        for polygon in &place.foliage {
            let mut path = PathBuilder::new();
            polygon_of(
                &mut path,
                polygon.x_m.iter().zip(&polygon.y_m).map(|(x, y)| camera.place([*x, *y])),
            );
            fill(shapes, path, self.theme.foliage);
        }
        let mut walls = PathBuilder::new();
        for wall in &place.walls {
            let ends = [[wall.from_x_m, wall.from_y_m], [wall.to_x_m, wall.to_y_m]];
            let [from, to] = ends.map(|end| camera.place(end));
            let knowledge = Knowledge::from(wall.kind());
            let Some((colour, dash, words)) = self.effect(knowledge, &wall.name) else {
                segment(&mut walls, from, to);
                continue;
            };
            let mut path = PathBuilder::new();
            segment(&mut path, from, to);
            dashed(shapes, path, colour, dash);
            // Estimated walls lie over the hidden ones that they estimate: their names must not.
            let along = if knowledge == Knowledge::Estimated { 0.3 } else { 0.5 };
            let at = [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * along);
            self.name(shapes, words, at, colour);
        }
        line(shapes, walls, self.theme.wall, (0.2 * camera.scale).clamp(1.5, 6.0) as f32);
    }

    /// Colour, dashes and name of what does not belong to the site.
    fn effect(&self, knowledge: Knowledge, name: &str) -> Option<(Colour, [f32; 2], String)> {
        match knowledge {
            Knowledge::Site => None,
            Knowledge::Hidden => Some((self.theme.hidden, [6.0, 4.0], format!("{name} hidden"))),
            Knowledge::Estimated => {
                Some((self.theme.estimated, [2.0, 3.0], format!("{name} estimated")))
            }
        }
    }

    /// The name of something, in its middle.
    fn name(&self, shapes: &mut Vec<Shape>, words: String, [x, y]: [f32; 2], colour: Colour) {
        let text = self.text(words.trim().to_owned(), [x, y + 4.0], Anchor::Middle);
        if !text.text.is_empty() {
            let halo = Some(self.theme.background);
            shapes.push(Shape::Text(Text { colour, halo, ..text }));
        }
    }

    /// Low ground like the background, high ground darker, or lighter in the dark theme.
    fn draw_ground(&self, shapes: &mut Vec<Shape>, ground: &view::Ground, camera: Camera) {
        let columns = ground.columns as usize;
        if columns < 2 || ground.height_m.len() < 2 * columns {
            return;
        }
        let [least, most] = ground_range(ground);
        let mut by_shade: Vec<PathBuilder> = vec![PathBuilder::new(); GROUND_SHADES];
        for row in 0..ground.height_m.len() / columns - 1 {
            for column in 0..columns - 1 {
                let corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
                let heights =
                    corners.map(|[x, y]| ground.height_m[(row + y) * columns + column + x]);
                let height = heights.iter().sum::<f32>() / 4.0;
                let share = if least < most { (height - least) / (most - least) } else { 0.0 };
                let shade = (share * (GROUND_SHADES - 1) as f32).round() as usize;
                let corners = corners.map(|[x, y]| {
                    let x_m = ground.x_m + (column + x) as f32 * ground.dx_m;
                    camera.place([x_m, ground.y_m + (row + y) as f32 * ground.dy_m])
                });
                polygon_of(&mut by_shade[shade.min(GROUND_SHADES - 1)], corners.into_iter());
            }
        }
        for (shade, path) in by_shade.into_iter().enumerate() {
            let share = shade as f64 / (GROUND_SHADES - 1) as f64;
            let colour = self.theme.low_ground.mixed(self.theme.high_ground, share);
            if let Some(path) = path.finish() {
                shapes.push(Shape::Fill { path, colour, is_crisp: true, robot: None });
            }
        }
    }

    fn draw_obstacles(&self, shapes: &mut Vec<Shape>, obstacles: &[Obstacle], camera: Camera) {
        for obstacle in obstacles {
            let [x, y] = camera.place(obstacle.centre_m);
            let radius = (f64::from(obstacle.radius_m) * camera.scale).max(1.0) as f32;
            let circle = || {
                let mut path = PathBuilder::new();
                path.push_circle(x, y, radius);
                path
            };
            let Some((colour, dash, words)) = self.effect(obstacle.kind, &obstacle.name) else {
                fill(shapes, circle(), self.theme.obstacle_fill);
                line(shapes, circle(), self.theme.obstacle, 1.0);
                self.name(shapes, obstacle.name.clone(), [x, y], self.theme.obstacle);
                continue;
            };
            dashed(shapes, circle(), colour, dash);
            let above = if obstacle.kind == Knowledge::Estimated { radius / 2.0 } else { 0.0 };
            self.name(shapes, words, [x, y - above], colour);
        }
    }

    /// Lines at round numbers on the plane, and the numbers beside it.
    fn draw_axes(&self, site: &mut Vec<Shape>, frame: &mut Vec<Shape>, camera: Camera) {
        let Plane { left, top, width, height } = self.plane;
        let [left, top, right, bottom] =
            [left, top, left + width, top + height].map(|edge| edge as f32);
        let step = round_step(80.0 / camera.scale);
        let reach = [f64::from(width), f64::from(height)].map(|pixels| pixels / 2.0 / camera.scale);
        let along = |axis: usize| {
            let middle = camera.centre_m[axis];
            ticks(middle - reach[axis], middle + reach[axis], step)
        };
        let mut grid = PathBuilder::new();
        for tick in along(0) {
            // In the middle of a pixel, a line is sharp.
            let x = camera.at([tick, 0.0])[0].floor() + 0.5;
            segment(&mut grid, [x, top], [x, bottom]);
            let label = self.text(tick_label(tick, step), [x, bottom + 17.0], Anchor::Middle);
            frame.push(Shape::Text(label));
        }
        for tick in along(1) {
            let y = camera.at([0.0, tick])[1].floor() + 0.5;
            segment(&mut grid, [left, y], [right, y]);
            let label = self.text(tick_label(tick, step), [left - 7.0, y + 4.0], Anchor::End);
            frame.push(Shape::Text(label));
        }
        line(site, grid, self.theme.grid, 1.0);
        let mut axes = PathBuilder::new();
        axes.move_to(left - 0.5, top);
        axes.line_to(left - 0.5, bottom + 0.5);
        axes.line_to(right, bottom + 0.5);
        line(frame, axes, self.theme.faint_text, 1.0);
        let middle = [f32::midpoint(left, right), f32::midpoint(top, bottom)];
        let east = self.text("east (m)".to_owned(), [middle[0], bottom + 38.0], Anchor::Middle);
        let north = self.text("north (m)".to_owned(), [16.0, middle[1]], Anchor::Middle);
        frame.push(Shape::Text(east));
        frame.push(Shape::Text(Text { is_upright: true, ..north }));
    }

    fn draw_trails(&self, shapes: &mut Vec<Shape>, scene: &Scene, camera: Camera) {
        let n_groups = self.theme.groups.len();
        let mut paths = vec![PathBuilder::new(); n_groups * FADES];
        let fade_of = |ago_s: f64| {
            (ago_s / seconds(TRAIL_NS) * FADES as f64).min((FADES - 1) as f64) as usize
        };
        for trail in &scene.trails {
            let mut fade = None;
            for (points, ago_s) in trail.points_m.windows(2).zip(&trail.ago_s) {
                let now = fade_of(*ago_s);
                let path = &mut paths[now * n_groups + trail.group % n_groups];
                if fade != Some(now) {
                    let [x, y] = camera.place(points[0]);
                    path.move_to(x, y);
                    fade = Some(now);
                }
                let [x, y] = camera.place(points[1]);
                path.line_to(x, y);
            }
        }
        for (number, path) in paths.into_iter().enumerate().rev() {
            let opacity = 0.6 * (1.0 - (number / n_groups) as f32 / FADES as f32);
            line(shapes, path, self.theme.group(number % n_groups).with_opacity(opacity), 1.5);
        }
    }

    fn draw_links(&self, shapes: &mut Vec<Shape>, scene: &Scene, camera: Camera) {
        let colour_by = self.style.links;
        if colour_by == LinkColour::None {
            return;
        }
        let mut places = vec![None; self.stage.run().agent_count as usize];
        for robot in &scene.robots {
            places[robot.robot as usize] = Some(camera.place([robot.x_m, robot.y_m]));
        }
        let mut by_colour: Vec<(Colour, PathBuilder)> = Vec::new();
        // Two directions of one colour are one line: on each other they would be darker than the others.
        let mut drawn = BTreeSet::new();
        for link in &scene.links {
            let value = match colour_by {
                LinkColour::Rssi => link.rssi_dbm.map(f64::from),
                LinkColour::Delivery | LinkColour::None => Some(link.delivery()),
            };
            let lost = self.theme.lost.with_opacity(0.6);
            let colour = value.map_or(lost, |value| self.theme.link(value, colour_by.range()));
            let ends = [link.sender, link.receiver]
                .map(|robot| places.get(robot as usize).copied().flatten());
            let [Some(from), Some(to)] = ends else { continue };
            let place = by_colour.iter().position(|(other, _)| *other == colour);
            let place = place.unwrap_or_else(|| {
                by_colour.push((colour, PathBuilder::new()));
                by_colour.len() - 1
            });
            let pair = [link.sender.min(link.receiver), link.sender.max(link.receiver)];
            if drawn.insert((pair, place)) {
                segment(&mut by_colour[place].1, from, to);
            }
        }
        for (colour, path) in by_colour {
            line(shapes, path, colour, 1.0);
        }
    }

    fn draw_robots(&self, shapes: &mut Vec<Shape>, scene: &Scene, camera: Camera) {
        let area = f64::from(self.plane.width) * f64::from(self.plane.height);
        let spacing = (area / scene.robots.len().max(1) as f64).sqrt();
        let radius = (0.15 * spacing).clamp(3.0, 8.0) as f32;
        let lost = self.theme.lost;
        // Those that exist lie over those that are lost.
        for robot in scene.robots.iter().filter(|robot| !robot.alive) {
            let place = camera.place([robot.x_m, robot.y_m]);
            if let Some(path) = dart(place, robot.heading_rad, radius).finish() {
                let (width, robot) = (LOST_WIDTH, Some(robot.robot));
                shapes.push(Shape::Line { path, colour: lost, width, dash: None, robot });
            }
        }
        let mut crosses = PathBuilder::new();
        for robot in scene.robots.iter().filter(|robot| robot.alive) {
            let place = camera.place([robot.x_m, robot.y_m]);
            if let Some(path) = dart(place, robot.heading_rad, radius).finish() {
                let (colour, robot) = (self.theme.group(robot.group), Some(robot.robot));
                shapes.push(Shape::Fill { path, colour, is_crisp: false, robot });
            }
            if !robot.radio {
                let [x, y] = place;
                segment(&mut crosses, [x - 5.0, y - 5.0], [x + 5.0, y + 5.0]);
                segment(&mut crosses, [x - 5.0, y + 5.0], [x + 5.0, y - 5.0]);
            }
        }
        line(shapes, crosses, self.theme.text, 1.5);
        self.draw_numbers(shapes, &scene.robots, camera, radius);
    }

    /// Numbers beside robots, each where it covers no other, if the robots in the picture are few enough.
    fn draw_numbers(&self, shapes: &mut Vec<Shape>, robots: &[Robot], camera: Camera, radius: f32) {
        let Plane { left, top, width, height } = self.plane;
        let [right, bottom] = [(left + width) as f32, (top + height) as f32];
        let places = robots.iter().map(|robot| (robot, camera.place([robot.x_m, robot.y_m])));
        let is_in_plane = |[x, y]: [f32; 2]| {
            (left as f32..right).contains(&x) && (top as f32..bottom).contains(&y)
        };
        let visible: Vec<_> = places.filter(|(_, place)| is_in_plane(*place)).collect();
        if NUMBERED < visible.len() {
            return;
        }
        let overlaps = |area: &[f32; 4], other: &[f32; 4]| {
            area[0] < other[2] && other[0] < area[2] && area[1] < other[3] && other[1] < area[3]
        };
        // The middle of each robot stays free.
        let free = radius - 2.0;
        let mut taken: Vec<[f32; 4]> =
            visible.iter().map(|(_, [x, y])| [x - free, y - free, x + free, y + free]).collect();
        for (robot, [x, y]) in visible {
            let text = robot.robot.to_string();
            let width = 11.0 * self.font.width(&text);
            // Above, below, at the right and at the left.
            let [after, before] = [x + radius + 1.0, x - radius - 1.0 - width];
            let [above, below] = [y - radius + 2.0, y + radius + 7.0];
            let places =
                [[after, above], [after, below], [before, above], [before, below]].into_iter();
            let mut areas = places.map(|[begin, base]| [begin, base - 9.0, begin + width, base]);
            let area = areas.find(|area| {
                area[2] < right
                    && (left as f32) < area[0]
                    && (top as f32) < area[1]
                    && area[3] < bottom
                    && !taken.iter().any(|other| overlaps(area, other))
            });
            let Some(area) = area else { continue };
            taken.push(area);
            let colour = if robot.alive { self.theme.text } else { self.theme.lost };
            shapes.push(Shape::Text(Text {
                size: 11.0,
                colour,
                halo: Some(self.theme.background),
                ..self.text(text, [area[0], area[3]], Anchor::Start)
            }));
        }
    }
}

/// A robot at a place, facing a heading.
pub(crate) fn dart([x, y]: [f32; 2], heading_rad: f32, radius: f32) -> PathBuilder {
    let (sin, cos) = (libm::sinf(heading_rad) * radius, libm::cosf(heading_rad) * radius);
    let mut path = PathBuilder::new();
    let corners =
        DART.map(|[along, left]| [x + cos * along - sin * left, y - sin * along - cos * left]);
    polygon_of(&mut path, corners.into_iter());
    path
}

fn polygon_of(path: &mut PathBuilder, corners: impl Iterator<Item = [f32; 2]>) {
    for (number, [x, y]) in corners.enumerate() {
        if number == 0 {
            path.move_to(x, y);
        } else {
            path.line_to(x, y);
        }
    }
    path.close();
}

/// Least and greatest height (m).
pub(crate) fn ground_range(ground: &view::Ground) -> [f32; 2] {
    ground.height_m.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[least, most], &height| {
        [least.min(height), most.max(height)]
    })
}
