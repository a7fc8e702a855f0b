//! What the terminal shows: the swarm on the left, figures and events on the right.

use ::view::live::Look;
use ::view::{has_bit, view};
use proto::types::seconds;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Stylize as _};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::canvas::{Canvas, Circle, Context, Line as Stroke, Points};
use ratatui::widgets::{Block, Paragraph};

/// Width of figures and events (characters).
const SIDE_WIDTH: u16 = 42;
/// A braille character has so many dots across and up.
const DOTS: [f64; 2] = [2.0, 4.0];
/// Of more links so many are drawn.
const MOST_LINKS: usize = 2000;
/// Room around the swarm, as a share of its size.
const MARGIN: f64 = 0.08;
/// The least room that is drawn (m).
const LEAST_M: f64 = 2.0;

/// Draws a run.
pub(super) fn draw(frame: &mut Frame<'_>, look: &Look) {
    let [top, keys] =
        Layout::vertical([Constraint::Min(3), Constraint::Length(1)]).areas(frame.area());
    let [swarm, side] =
        Layout::horizontal([Constraint::Min(20), Constraint::Length(SIDE_WIDTH)]).areas(top);
    let [figures, events] =
        Layout::vertical([Constraint::Length(14), Constraint::Min(3)]).areas(side);
    draw_swarm(frame, swarm, look);
    let lines = figure_lines(look);
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title("Run")), figures);
    let lines: Vec<Line<'_>> = look
        .events
        .iter()
        .rev()
        .map(|event| Line::from(format!("{:9.2} s  {}", seconds(event.time_ns), event.text)))
        .collect();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title("Events")), events);
    let words =
        "space: pause or go on   right: one step   q: close this view   Ctrl-C: stop the run";
    frame.render_widget(Line::from(words).dim(), keys);
}

/// The figures of the latest frame, one on a line.
fn figure_lines(look: &Look) -> Vec<Line<'static>> {
    let run = &look.run;
    let mut lines = vec![
        Line::from(format!("{}, seed {}", run.name, run.seed)).bold(),
        Line::from(format!("{:.2} s simulated", seconds(look.status.reached_ns))),
        if look.status.paused {
            Line::from("paused").bold()
        } else {
            Line::from(format!("{:.1} simulated seconds per second", look.status.speed))
        },
    ];
    let Some(shown) = &look.frame else {
        lines.push(Line::from("waiting for the first step"));
        return lines;
    };
    let n_alive = bits(&shown.alive);
    lines.push(Line::from(format!("step {}", shown.step)));
    lines.push(Line::from(format!("{n_alive} of {} robots alive", run.agent_count)));
    if let Some(links) = &shown.links {
        let neighbours = links.receiver.len() as f64 / (n_alive.max(1)) as f64;
        lines.push(Line::from(format!("{neighbours:.1} neighbours heard per robot")));
    } else if !shown.n_sent.is_empty() {
        lines.push(Line::from("nobody heard anybody"));
    }
    if let Some(motes) = shown.motes.as_ref().filter(|motes| !motes.joined.is_empty()) {
        lines.push(Line::from(format!("{} motes joined", bits(&motes.joined))));
        let waiting: u32 = motes.queue_length.iter().sum();
        lines.push(Line::from(format!("{waiting} packets waiting")));
    }
    if let Some(formation) = shown.formation.as_ref().filter(|formation| !formation.formed) {
        lines.push(Line::from(format!("{} motes are missing", formation.missing.len())));
    }
    if shown.held {
        lines.push(Line::from("robots wait for the network to form"));
    }
    for figure in &shown.figures {
        lines.push(Line::from(format!("{}: {:.3}", figure.name, figure.value)));
    }
    lines
}

fn bits(bitmap: &[u8]) -> u32 {
    bitmap.iter().map(|byte| byte.count_ones()).sum()
}

fn draw_swarm(frame: &mut Frame<'_>, area: Rect, look: &Look) {
    let block = Block::bordered().title("Swarm (x east, y north)");
    let Some(shown) = &look.frame else {
        return frame.render_widget(block, area);
    };
    let inner = block.inner(area);
    let place = look.run.place.clone().unwrap_or_default();
    let [x, y] = bounds(shown, &place, inner);
    let width_m = x[1] - x[0];
    let block = block.title_bottom(format!("{width_m:.0} m across"));
    let canvas = Canvas::default()
        .block(block)
        .marker(Marker::Braille)
        .x_bounds(x)
        .y_bounds(y)
        .paint(|context| paint(context, shown, &place));
    frame.render_widget(canvas, area);
}

/// What is drawn, in metres: least and greatest x and y, with equal scales on both axes.
fn bounds(shown: &view::Frame, place: &view::Place, area: Rect) -> [[f64; 2]; 2] {
    let walls = place
        .walls
        .iter()
        .flat_map(|wall| [[wall.from_x_m, wall.from_y_m], [wall.to_x_m, wall.to_y_m]]);
    let obstacles = place.obstacles.iter().map(|obstacle| [obstacle.x_m, obstacle.y_m]);
    let robots = (0..shown.x_m.len())
        .filter(|&agent| has_bit(&shown.alive, agent))
        .map(|agent| [shown.x_m[agent], shown.y_m[agent]]);
    let mut corners = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for point in robots.chain(walls).chain(obstacles) {
        for axis in 0..2 {
            let value = f64::from(point[axis]);
            corners[axis] = [corners[axis][0].min(value), corners[axis][1].max(value)];
        }
    }
    if corners.iter().flatten().any(|value| !value.is_finite()) {
        return [[-1.0, 1.0]; 2];
    }
    let dots = [f64::from(area.width) * DOTS[0], f64::from(area.height) * DOTS[1]];
    let size =
        |axis: usize| (corners[axis][1] - corners[axis][0]).max(LEAST_M) * (1.0 + 2.0 * MARGIN);
    let m_per_dot = (0..2).map(|axis| size(axis) / dots[axis].max(1.0)).fold(0.0, f64::max);
    [0, 1].map(|axis| {
        let middle = 0.5 * (corners[axis][0] + corners[axis][1]);
        let half = 0.5 * m_per_dot * dots[axis].max(1.0);
        [middle - half, middle + half]
    })
}

fn paint(context: &mut Context<'_>, shown: &view::Frame, place: &view::Place) {
    let stroke = |[x1, y1]: [f32; 2], [x2, y2]: [f32; 2], color| Stroke {
        x1: x1.into(),
        y1: y1.into(),
        x2: x2.into(),
        y2: y2.into(),
        color,
    };
    if let Some(links) = &shown.links {
        for (&sender, &receiver) in links.sender.iter().zip(&links.receiver).take(MOST_LINKS) {
            let at = |agent: u32| [shown.x_m[agent as usize], shown.y_m[agent as usize]];
            context.draw(&stroke(at(sender), at(receiver), Color::DarkGray));
        }
    }
    context.layer();
    for wall in &place.walls {
        let (from, to) = ([wall.from_x_m, wall.from_y_m], [wall.to_x_m, wall.to_y_m]);
        context.draw(&stroke(from, to, Color::Gray));
    }
    for obstacle in &place.obstacles {
        let moved = shown.moved_obstacles.iter().find(|moved| moved.name == obstacle.name);
        let (x, y) =
            moved.map_or((obstacle.x_m.into(), obstacle.y_m.into()), |it| (it.x_m, it.y_m));
        let radius = obstacle.radius_m.into();
        context.draw(&Circle { x, y, radius, color: Color::Gray });
    }
    context.layer();
    let robots: Vec<(f64, f64)> = (0..shown.x_m.len())
        .filter(|&agent| has_bit(&shown.alive, agent))
        .map(|agent| (shown.x_m[agent].into(), shown.y_m[agent].into()))
        .collect();
    context.draw(&Points { coords: &robots, color: Color::LightBlue });
    for agent in (0..shown.x_m.len()).filter(|&agent| has_bit(&shown.alive, agent)) {
        let facing_rad = shown.heading_rad.get(agent).copied().unwrap_or_default();
        context.print(
            shown.x_m[agent].into(),
            shown.y_m[agent].into(),
            Line::from(arrow(facing_rad)).light_blue().bold(),
        );
    }
}

/// The arrow that points most nearly where a robot faces.
fn arrow(facing_rad: f32) -> &'static str {
    const ARROWS: [&str; 8] = ["→", "↗", "↑", "↖", "←", "↙", "↓", "↘"];
    let eighths = libm::roundf(facing_rad / std::f32::consts::FRAC_PI_4) as i64;
    ARROWS[eighths.rem_euclid(8) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn look() -> Look {
        Look {
            run: view::Run {
                name: "pair".to_owned(),
                seed: 3,
                agent_count: 3,
                ..view::Run::default()
            },
            frame: Some(view::Frame {
                step: 12,
                time_ns: 1_200_000_000,
                alive: vec![0b011],
                x_m: vec![0.0, 10.0, 99.0],
                y_m: vec![0.0, 0.0, 99.0],
                heading_rad: vec![0.0, 1.6, 0.0],
                links: Some(view::Links {
                    sender: vec![0],
                    receiver: vec![1],
                    received: vec![1],
                    ..view::Links::default()
                }),
                ..view::Frame::default()
            }),
            events: vec![view::Event {
                time_ns: 700_000_000,
                text: "robot 2 is lost".to_owned(),
                ..view::Event::default()
            }],
            status: view::LiveStatus { reached_ns: 1_300_000_000, ..view::LiveStatus::default() },
        }
    }

    fn drawn(look: &Look, size: (u16, u16)) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
        terminal.draw(|frame| draw(frame, look)).unwrap();
        let buffer = terminal.backend().buffer().clone();
        let row = |y| (0..size.0).map(|x| buffer[(x, y)].symbol().to_owned()).collect::<String>();
        (0..size.1).map(row).collect()
    }

    #[test]
    fn robots_stand_where_they_are_and_those_that_are_lost_are_not_there() {
        let rows = drawn(&look(), (100, 30));
        let all = rows.join("\n");
        let find = |arrow: &str| {
            let row = rows.iter().position(|row| row.contains(arrow)).unwrap();
            (row, rows[row].chars().position(|c| c.to_string() == arrow).unwrap())
        };
        let (first, second) = (find("→"), find("↑"));
        // Both in the middle row; 56 columns show 11.6 m.
        assert_eq!(first.0, second.0);
        assert_eq!((first.0, second.1 - first.1), (14, 48), "{all}");
        assert_eq!(all.matches(['→', '↑']).count(), 2, "{all}");
        for words in
            ["pair, seed 3", "step 12", "2 of 3 robots alive", "0.5 neighbours", "robot 2 is lost"]
        {
            assert!(all.contains(words), "{words}: {all}");
        }
    }

    #[test]
    fn a_terminal_of_any_size_is_drawn_on() {
        for size in [(1, 1), (10, 3), (43, 4), (300, 80)] {
            drawn(&look(), size);
            drawn(&Look { frame: None, ..look() }, size);
        }
    }
}
