//! What holds for the whole run, and the scenes of its frames.

use crate::scene::{Knowledge, Link, Obstacle, Robot, Scene, Trail};
use crate::span::FrameSpan;
use ::view::recorded::RecordedRun;
use ::view::{has_bit, view};
use proto::types::{MovedObstacle, NS_PER_S, seconds};
use record::read::ReadError;
use std::collections::VecDeque;

/// Trails show where robots were within this time before (ns).
pub const TRAIL_NS: u64 = 5 * NS_PER_S;
/// Swarms up to this size have trails of all robots; of a larger one only the robot that is followed has one.
pub const MOST_TRAILS: usize = 200;
/// Points of a trail are at least so far apart in time (ns).
const POINT_NS: u64 = TRAIL_NS / 60;

/// What a run's pictures have in common.
pub struct Stage {
    run: view::Run,
    /// The group of each robot.
    groups: Vec<usize>,
    /// Of each robot, the first frame in which it exists (ns).
    born_ns: Vec<u64>,
    is_any_lost: bool,
    /// Where robots were in the first frame (m), and whether one was elsewhere later.
    start_m: Vec<[f32; 2]>,
    is_any_moving: bool,
    follow: Option<usize>,
    /// What the pictures show; relative to the robot that is followed, if there is one.
    extent_m: [[f64; 2]; 2],
    moves: Vec<(u64, MovedObstacle)>,
}

impl Stage {
    /// Reads the run at a glance until the end of a span: at most some 2000 of its frames, and where obstacles move.
    ///
    /// * `follow`: the robot that stays in the middle.
    /// * `shown_ns`: begin and end of the span that the pictures show. All that they draw fits into them: robots and their trails
    ///   in this span, walls and obstacles.
    ///
    /// # Errors
    ///
    /// The recording is damaged.
    pub fn new(
        recorded: &RecordedRun,
        follow: Option<usize>,
        [from_ns, until_ns]: [u64; 2],
    ) -> Result<Self, ReadError> {
        let run = recorded.run().clone();
        let n = run.agent_count as usize;
        let mut groups = vec![0; n];
        let counts = run.groups.iter().map(|group| group.count as usize).enumerate();
        let in_order = counts.flat_map(|(group, count)| std::iter::repeat_n(group, count));
        groups.iter_mut().zip(in_order).for_each(|(place, group)| *place = group);
        let mut stage = Self {
            groups,
            born_ns: vec![u64::MAX; n],
            is_any_lost: false,
            start_m: Vec::new(),
            is_any_moving: false,
            follow,
            extent_m: [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]],
            moves: recorded.moved_obstacles(until_ns)?,
            run,
        };
        stage.include_site();
        // Trails begin before the span does.
        let trails_ns = from_ns.saturating_sub(TRAIL_NS);
        let mut before = FrameSpan::overview(recorded, 0, trails_ns);
        while let Some(frame) = before.next_frame()? {
            stage.pass(&frame);
        }
        let mut frames = FrameSpan::overview(recorded, trails_ns, until_ns);
        while let Some(frame) = frames.next_frame()? {
            stage.pass(&frame);
            stage.include(&frame);
        }
        if stage.extent_m[1][0] < stage.extent_m[0][0] {
            stage.extent_m = [[-1.0; 2], [1.0; 2]];
        }
        if follow.is_some() {
            // The robot stays in the middle.
            let [least, most] = stage.extent_m;
            let half = [0, 1].map(|axis| most[axis].max(-least[axis]).max(0.5));
            stage.extent_m = [half.map(|half| -half), half];
        }
        Ok(stage)
    }

    /// The run.
    #[must_use]
    pub fn run(&self) -> &view::Run {
        &self.run
    }

    /// What the pictures show (m): least and greatest x and y.
    pub(crate) fn extent_m(&self) -> [[f64; 2]; 2] {
        self.extent_m
    }

    /// A robot is lost before the pictures end.
    #[must_use]
    pub fn is_any_lost(&self) -> bool {
        self.is_any_lost
    }

    /// Whether robots have trails.
    #[must_use]
    pub fn has_trails(&self) -> bool {
        self.is_any_moving && (self.follow.is_some() || self.groups.len() <= MOST_TRAILS)
    }

    /// Shows this many metres across around the robot that is followed.
    pub fn set_span(&mut self, span_m: f64) {
        self.extent_m = [[-span_m / 2.0; 2], [span_m / 2.0; 2]];
    }

    /// Walls and obstacles, unless a robot is followed: they may be far away from it.
    fn include_site(&mut self) {
        let Some(place) = self.run.place.as_ref().filter(|_| self.follow.is_none()) else { return };
        let walls = place.walls.iter().flat_map(|wall| {
            [[wall.from_x_m, wall.from_y_m], [wall.to_x_m, wall.to_y_m]].map(|point| (point, 0.0))
        });
        let obstacles = place.obstacles.iter();
        let discs = obstacles.map(|obstacle| ([obstacle.x_m, obstacle.y_m], obstacle.radius_m));
        let site: Vec<_> = walls.chain(discs).collect();
        for (point, radius) in site {
            self.extend(point.map(f64::from), f64::from(radius));
        }
        let moved: Vec<_> = self.moves.iter().map(|(_, obstacle)| obstacle.centre_m).collect();
        moved.into_iter().for_each(|centre_m| self.extend(centre_m, 0.0));
    }

    /// Notes which robots exist and move.
    fn pass(&mut self, frame: &view::Frame) {
        if self.start_m.is_empty() {
            self.start_m =
                frame.x_m.iter().zip(&frame.y_m).map(|(x_m, y_m)| [*x_m, *y_m]).collect();
        }
        for robot in 0..self.groups.len().min(frame.x_m.len()) {
            if has_bit(&frame.alive, robot) {
                let start_m = self.start_m.get(robot);
                self.is_any_moving |= start_m != Some(&[frame.x_m[robot], frame.y_m[robot]]);
                self.born_ns[robot] = self.born_ns[robot].min(frame.time_ns);
            } else {
                self.is_any_lost |= self.born_ns[robot] < frame.time_ns;
            }
        }
    }

    /// Makes room for the robots of a frame: those that exist, and those that are drawn where they were lost.
    fn include(&mut self, frame: &view::Frame) {
        let followed = self.follow.and_then(|robot| place(frame, robot));
        let origin = followed.unwrap_or_default().map(f64::from);
        for robot in 0..self.groups.len().min(frame.x_m.len()) {
            if self.born_ns[robot] <= frame.time_ns {
                let place = [frame.x_m[robot], frame.y_m[robot]].map(f64::from);
                self.extend([place[0] - origin[0], place[1] - origin[1]], 0.0);
            }
        }
    }

    fn extend(&mut self, point: [f64; 2], radius: f64) {
        for axis in 0..2 {
            let [least, most] = &mut self.extent_m;
            least[axis] = least[axis].min(point[axis] - radius);
            most[axis] = most[axis].max(point[axis] + radius);
        }
    }
}

/// Makes scenes of frames that follow each other.
pub struct Director<'a> {
    stage: &'a Stage,
    /// Frames of the last seconds, for trails.
    past: VecDeque<view::Frame>,
    obstacles: Vec<Obstacle>,
    n_moves: usize,
}

impl<'a> Director<'a> {
    /// Before any frame.
    #[must_use]
    pub fn new(stage: &'a Stage) -> Self {
        let place = stage.run.place.iter();
        let obstacles = place.flat_map(|place| &place.obstacles).map(Obstacle::from).collect();
        Self { stage, past: VecDeque::new(), obstacles, n_moves: 0 }
    }

    /// Notes where robots were, for the trails of later scenes. Not earlier than the frame before.
    pub fn pass(&mut self, frame: &view::Frame) {
        let is_due = |last: &view::Frame| last.time_ns + POINT_NS <= frame.time_ns;
        if self.stage.has_trails() && self.past.back().is_none_or(is_due) {
            self.past.push_back(view::Frame {
                time_ns: frame.time_ns,
                alive: frame.alive.clone(),
                x_m: frame.x_m.clone(),
                y_m: frame.y_m.clone(),
                ..view::Frame::default()
            });
        }
    }

    /// The scene of a frame, which is not earlier than those before.
    pub fn scene(&mut self, frame: &view::Frame) -> Scene {
        let Stage { run, groups, born_ns, moves, .. } = self.stage;
        for (_, moved) in moves[self.n_moves..].iter().take_while(|(at, _)| *at <= frame.time_ns) {
            self.n_moves += 1;
            let named = self
                .obstacles
                .iter_mut()
                .filter(|obstacle| obstacle.kind == Knowledge::Site && obstacle.name == moved.name);
            named.for_each(|obstacle| obstacle.centre_m = moved.centre_m.map(|m| m as f32));
        }
        let radios = frame.motes.as_ref().map_or(&[][..], |motes| &motes.alive);
        let robots = (0..groups.len().min(frame.x_m.len())).filter_map(|robot| {
            let alive = has_bit(&frame.alive, robot);
            // One that does not exist yet is not lost.
            (alive || born_ns[robot] <= frame.time_ns).then(|| Robot {
                robot: robot as u32,
                x_m: frame.x_m[robot],
                y_m: frame.y_m[robot],
                heading_rad: frame.heading_rad.get(robot).copied().unwrap_or_default(),
                alive,
                radio: has_bit(radios, robot),
                group: groups[robot],
            })
        });
        Scene {
            run: run.name.clone(),
            seed: run.seed,
            step: frame.step,
            time_s: seconds(frame.time_ns),
            robots: robots.collect(),
            links: links(frame),
            trails: self.trails(frame),
            obstacles: self.obstacles.clone(),
            extent_m: self.extent_m(frame),
        }
    }

    fn extent_m(&self, frame: &view::Frame) -> [[f64; 2]; 2] {
        let followed = self.stage.follow.and_then(|robot| place(frame, robot));
        let origin = followed.unwrap_or_default().map(f64::from);
        self.stage.extent_m.map(|corner| [corner[0] + origin[0], corner[1] + origin[1]])
    }

    fn trails(&mut self, frame: &view::Frame) -> Vec<Trail> {
        let since_ns = frame.time_ns.saturating_sub(TRAIL_NS);
        while self.past.front().is_some_and(|past| past.time_ns < since_ns) {
            self.past.pop_front();
        }
        let n = self.stage.groups.len().min(frame.x_m.len());
        let with_trail = if n <= MOST_TRAILS {
            0..n
        } else {
            self.stage.follow.filter(|robot| *robot < n).map_or(0..0, |robot| robot..robot + 1)
        };
        let earlier = self.past.iter().rev().filter(|past| past.time_ns < frame.time_ns);
        let trails = with_trail.filter_map(|robot| {
            let mut trail = Trail {
                robot: robot as u32,
                group: self.stage.groups[robot],
                ago_s: Vec::new(),
                points_m: Vec::new(),
            };
            for past in std::iter::once(frame).chain(earlier.clone()) {
                let Some(point) = place(past, robot).filter(|_| has_bit(&past.alive, robot)) else {
                    break;
                };
                if trail.points_m.last() != Some(&point) {
                    trail.ago_s.push(seconds(frame.time_ns - past.time_ns));
                    trail.points_m.push(point);
                }
            }
            (1 < trail.points_m.len()).then_some(trail)
        });
        trails.collect()
    }
}

fn place(frame: &view::Frame, robot: usize) -> Option<[f32; 2]> {
    Some([*frame.x_m.get(robot)?, *frame.y_m.get(robot)?])
}

fn links(frame: &view::Frame) -> Vec<Link> {
    let Some(links) = &frame.links else { return Vec::new() };
    let pairs = links.sender.iter().zip(&links.receiver).zip(&links.received).enumerate();
    let links = pairs.map(|(number, ((&sender, &receiver), &received))| Link {
        sender,
        receiver,
        received,
        sent: frame.n_sent.get(sender as usize).copied().unwrap_or_default(),
        rssi_dbm: links.rssi_dbm.get(number).copied().filter(|rssi_dbm| !rssi_dbm.is_nan()),
    });
    links.collect()
}
