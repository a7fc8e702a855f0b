//! Pictures of a run that is made up of values.

#[path = "../../record/src/tests/made_up.rs"]
mod made_up;

use crate::drawing::{Drawing, Shape};
use crate::layout::{Layout, LinkColour, Style};
use crate::raster::Canvas;
use crate::scene::Scene;
use crate::span::FrameSpan;
use crate::stage::{Director, Stage};
use crate::svg::svg;
use ::view::recorded::RecordedRun;
use made_up::{N, STEP_NS, STEPS, header, record};
use record::result::{ResultFolder, Trust};
use record::{Ending, Recorder, RunHeader, StepRecord};

fn recorded() -> (tempfile::TempDir, RecordedRun) {
    let out = tempfile::tempdir().unwrap();
    let run = record(out.path(), header("run"), STEPS);
    let finished = run.finish(&Ending::complete(), serde_json::Value::Null, |_| String::new());
    let run =
        RecordedRun::open(&ResultFolder::open(&finished.unwrap().dir, Trust::Checked).unwrap())
            .unwrap();
    (out, run)
}

/// Scenes of all steps from `from` on.
fn scenes(run: &RecordedRun, stage: &Stage, from: u64) -> Vec<Scene> {
    let mut frames = FrameSpan::every(run, from * STEP_NS, u64::MAX, STEP_NS);
    let mut director = Director::new(stage);
    let mut scenes = Vec::new();
    while let Some(frame) = frames.next_frame().unwrap() {
        scenes.push(director.scene(&frame));
        director.pass(&frame);
    }
    scenes
}

/// Frames hold positions to 2 mm.
fn near(drawn: f32, exact: f64) -> bool {
    (f64::from(drawn) - exact).abs() < 0.002
}

fn style() -> Style {
    Style { size: Some([640, 400]), is_dark: false, links: LinkColour::Rssi }
}

#[test]
fn a_scene_has_the_numbers_of_the_run() {
    let (_out, run) = recorded();
    let stage = Stage::new(&run, None, [0, u64::MAX]).unwrap();
    let scenes = scenes(&run, &stage, 0);
    assert_eq!(scenes.len() as u64, STEPS + 1);
    for (step, scene) in scenes.iter().enumerate() {
        let states = made_up::states(step as u64);
        assert_eq!((scene.step, scene.seed), (step as u64, 42));
        // Agent 6 never exists.
        assert_eq!(scene.robots.len(), N - 1);
        for robot in &scene.robots {
            let agent = robot.robot as usize;
            assert!(near(robot.x_m, states.x_m[agent]) && near(robot.y_m, states.y_m[agent]));
            assert!(robot.alive && robot.radio);
        }
        let pairs: Vec<_> = scene.links.iter().map(|link| (link.sender, link.receiver)).collect();
        let within = (0..6u32).flat_map(|a| (0..6u32).map(move |b| (a, b)));
        let within: Vec<_> = within.filter(|(a, b)| a != b && a.abs_diff(*b) <= 2).collect();
        assert_eq!(pairs, if step == 0 { Vec::new() } else { within });
        assert!(scene.links.iter().all(|link| link.delivery() == 1.0 && link.sent == 1));
        assert_eq!(scene.trails.len(), if step == 0 { 0 } else { N - 1 });
        for trail in &scene.trails {
            let agent = trail.robot as usize;
            for (point, ago_s) in trail.points_m.iter().zip(&trail.ago_s) {
                let then = step as u64 - (ago_s * 10.0).round() as u64;
                assert!(near(point[0], made_up::states(then).x_m[agent]));
            }
        }
    }
    // The wall of the site, and all that robots do.
    let [least, most] = scenes[0].extent_m;
    assert_eq!((least, most[1]), ([0.0, 0.5], 1.0));
    assert!(near(most[0] as f32, 7.4), "{most:?}");
}

#[test]
fn a_robot_that_is_followed_stays_in_the_middle() {
    let (_out, run) = recorded();
    let mut stage = Stage::new(&run, Some(1), [0, u64::MAX]).unwrap();
    stage.set_span(6.0);
    for scene in scenes(&run, &stage, 3) {
        let [least, most] = scene.extent_m;
        let middle = [0, 1].map(|axis| f64::midpoint(least[axis], most[axis]));
        assert_eq!(middle, [f64::from(scene.robots[1].x_m), f64::from(scene.robots[1].y_m)]);
        assert!((most[0] - least[0] - 6.0).abs() < 1e-9);
    }
}

/// Edges of the robots that are drawn (px): least and greatest x and y.
fn edges(drawing: &Drawing) -> [f32; 4] {
    let mut edges = [f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY, f32::NEG_INFINITY];
    for shape in &drawing.swarm {
        if let Shape::Fill { path, robot: Some(_), .. } = shape {
            let bounds = path.bounds();
            edges[0] = edges[0].min(bounds.left());
            edges[1] = edges[1].max(bounds.right());
            edges[2] = edges[2].min(bounds.top());
            edges[3] = edges[3].max(bounds.bottom());
        }
    }
    edges
}

#[test]
fn what_is_drawn_fills_a_picture_of_free_size() {
    let (_out, run) = recorded();
    for from in [0, 8 * STEP_NS] {
        let stage = Stage::new(&run, None, [from, u64::MAX]).unwrap();
        let scene = scenes(&run, &stage, 0).pop().unwrap();
        let layout = Layout::new(&stage, Style { size: None, ..style() });
        let drawing = layout.drawing(&scene);
        assert_eq!(drawing.size, layout.size());
        let [width, height] = drawing.size;
        assert!(width % 2 == 0 && height % 2 == 0 && height < width, "{width}x{height}");
        // The robots are at the right end of what is shown; the wall and their trails reach to its left end.
        let plane = drawing.plane;
        let [_, right, top, bottom] = edges(&drawing);
        let plane_right = (plane.left + plane.width) as f32;
        assert!((10.0..30.0).contains(&(plane_right - right)), "{right} of {plane_right}");
        assert!(plane.top as f32 <= top && bottom <= (plane.top + plane.height) as f32);
    }
}

#[test]
fn a_picture_shows_what_it_draws_and_not_the_rest_of_the_run() {
    let (_out, run) = recorded();
    let extent = |shown_ns| {
        let stage = Stage::new(&run, None, shown_ns).unwrap();
        scenes(&run, &stage, 0)[0].extent_m
    };
    let [_, whole] = extent([0, u64::MAX]);
    let [_, early] = extent([0, 2 * STEP_NS]);
    // Robot 5 begins at 5 m and moves by 0.2 m a step.
    assert!(near(early[0] as f32, 5.4) && near(whole[0] as f32, 7.4), "{early:?} {whole:?}");
}

#[test]
fn frames_that_are_left_out_are_evenly_spaced() {
    let (_out, run) = recorded();
    let mut frames = FrameSpan::every(&run, 0, 8 * STEP_NS, 8 * STEP_NS);
    let mut last = None;
    while let Some(frame) = frames.next_until(5 * STEP_NS).unwrap() {
        last = Some(frame.step);
    }
    // Four of eight steps.
    assert_eq!(last, Some(4));
    assert_eq!(frames.next_frame().unwrap().map(|frame| frame.step), Some(6));
}

fn drawing(run: &RecordedRun, style: Style) -> Drawing {
    let stage = Stage::new(run, None, [0, u64::MAX]).unwrap();
    let scenes = scenes(run, &stage, 0);
    Layout::new(&stage, style).drawing(scenes.last().unwrap())
}

#[test]
fn robots_are_drawn_at_their_places() {
    let (_out, run) = recorded();
    let drawing = drawing(&run, style());
    let darts = drawing.swarm.iter().filter_map(|shape| match shape {
        Shape::Fill { path, robot: Some(robot), .. } => Some((*robot, path.bounds())),
        _ => None,
    });
    let darts: Vec<_> = darts.collect();
    assert_eq!(darts.iter().map(|(robot, _)| *robot).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
    // A metre apart, in pixels of one scale.
    let distance = darts[1].1.left() - darts[0].1.left();
    for pair in darts.windows(2) {
        assert!((pair[1].1.left() - pair[0].1.left() - distance).abs() < 0.01);
    }
    let room = drawing.plane.width as f32;
    assert!(room / 12.0 < distance && distance < room / 7.0, "{distance}");
}

#[test]
fn an_svg_says_what_it_shows_and_escapes_names() {
    let (_out, run) = recorded();
    let mut drawing = drawing(&run, style());
    drawing.name = "<run> & more".to_owned();
    let text = svg(&drawing);
    assert!(text.starts_with("<svg xmlns=") && text.ends_with("</svg>\n"));
    assert!(text.contains("&lt;run&gt; &amp; more"));
    for part in ["6 robots and", "robot 5</title>", "east (m)", "step 12 of 12", "seed 42"] {
        assert!(text.contains(part), "{part}");
    }
    assert!(!text.contains("NaN"));
}

#[test]
fn a_picture_that_reuses_what_does_not_move_is_the_same_picture() {
    let (_out, run) = recorded();
    let stage = Stage::new(&run, None, [0, u64::MAX]).unwrap();
    let layout = Layout::new(&stage, Style { is_dark: true, ..style() });
    let scenes = scenes(&run, &stage, 0);
    let drawings: Vec<_> = scenes.iter().map(|scene| layout.drawing(scene)).collect();
    let mut canvas = Canvas::new(&drawings[0]).unwrap();
    for (scene, drawing) in scenes.iter().zip(&drawings) {
        assert!(layout.is_fixed_between(&scenes[0], scene));
        let reused = canvas.paint(drawing, true).clone();
        let anew = Canvas::new(drawing).unwrap().paint(drawing, false).clone();
        assert!(reused == anew, "step {}", scene.step);
        let background = drawing.background.rgb;
        let painted = anew.pixels().iter().filter(|pixel| {
            [pixel.red(), pixel.green(), pixel.blue()] != background && pixel.alpha() == 255
        });
        assert!(1000 < painted.count());
    }
}
