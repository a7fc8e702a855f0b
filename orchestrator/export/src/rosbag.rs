//! A bag of ROS 2: a folder with an MCAP file and `metadata.yaml`, as `ros2 bag play` and the Python package `rosbags` read it.
//!
//! Each robot has a topic `/robot_N/odom` (`nav_msgs/msg/Odometry`); `/tf` has where all are (`tf2_msgs/msg/TFMessage`). Times are those
//! of the simulation, which begins at 0. Positions are in the frame `world`, velocities in that of the robot.

use super::cdr::Cdr;
use super::{ExportError, Exported};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use proto::types::{AgentStates, NS_PER_S, seconds};
use record::random_access::Recording;
use record::result::ResultFolder;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::BufWriter;
use std::path::Path;
use system::File;

/// A type of messages: its name, and its definition with those of all types in it.
type Definition = (&'static str, &'static str);

const ODOMETRY: Definition = ("nav_msgs/msg/Odometry", include_str!("rosbag/Odometry.msg"));
const TRANSFORMS: Definition = ("tf2_msgs/msg/TFMessage", include_str!("rosbag/TFMessage.msg"));
/// The frame of all positions.
const WORLD: &str = "world";

/// Writes the bag of a run to a folder; files are named after the bag.
pub(super) fn export(
    run: &ResultFolder,
    folder: &Path,
    name: &str,
) -> Result<Vec<Exported>, ExportError> {
    let recording = Recording::of(run)?;
    let start = recording.configured().robots_start.states.clone();
    let file_name = format!("{name}_0.mcap");
    let path = folder.join(&file_name);
    let mut bag = Bag::create(&path, start.len())?;
    bag.add(0, &start, None)?;
    let mut before = (0, start);
    let mut steps = recording.steps(0, u64::MAX)?;
    while let Some(step) = steps.next_step()? {
        bag.add(step.time_ns, &step.robots.states, Some(&before))?;
        before = (step.time_ns, step.robots.states.clone());
    }
    let topics = bag.finish()?;
    let metadata = folder.join("metadata.yaml");
    let text = metadata_yaml(&file_name, before.0, &topics);
    system::write(&metadata, text).map_err(ExportError::write(&metadata))?;
    let n_entries = topics.iter().map(|topic| topic.n_messages).sum();
    Ok(vec![Exported { path, n_entries }])
}

/// The MCAP file being written.
struct Bag<'a> {
    path: &'a Path,
    writer: Writer<BufWriter<File>>,
    topics: Vec<Topic>,
    n_messages: u32,
}

/// A topic, and how many messages it has so far.
struct Topic {
    name: String,
    kind: &'static str,
    channel: u16,
    n_messages: u64,
}

impl<'a> Bag<'a> {
    fn create(path: &'a Path, n_agents: usize) -> Result<Self, ExportError> {
        let file = File::create_new(path).map_err(ExportError::write(path))?;
        let writer = WriteOptions::new()
            .profile("ros2")
            .library("murmuration")
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .create(BufWriter::new(file))
            .map_err(|source| failed(path, source))?;
        let mut bag = Self { path, writer, topics: Vec::new(), n_messages: 0 };
        bag.topic("/tf".to_owned(), TRANSFORMS)?;
        for agent in 0..n_agents {
            bag.topic(format!("/robot_{agent}/odom"), ODOMETRY)?;
        }
        Ok(bag)
    }

    fn topic(&mut self, name: String, (kind, definition): Definition) -> Result<(), ExportError> {
        let failed = |source| failed(self.path, source);
        // The same schema again has the same number.
        let schema =
            self.writer.add_schema(kind, "ros2msg", definition.as_bytes()).map_err(failed)?;
        let about = BTreeMap::from([("offered_qos_profiles".to_owned(), String::new())]);
        let channel = self.writer.add_channel(schema, &name, "cdr", &about).map_err(failed)?;
        self.topics.push(Topic { name, kind, channel, n_messages: 0 });
        Ok(())
    }

    /// Adds where robots are at a time; `before`: where they were at the time before.
    fn add(
        &mut self,
        time_ns: u64,
        states: &AgentStates,
        before: Option<&(u64, AgentStates)>,
    ) -> Result<(), ExportError> {
        let alive: Vec<usize> = states.alive.iter_ones().collect();
        let mut message = Cdr::new();
        message.u32(alive.len() as u32);
        for &agent in &alive {
            header(&mut message, time_ns, WORLD).text(&frame(agent));
            message.f64s(&states.position_m(agent)).f64s(&turn(states.facing_rad(agent)));
        }
        self.write(0, time_ns, message.bytes())?;
        for &agent in &alive {
            let heading_rad = states.facing_rad(agent);
            let mut message = Cdr::new();
            header(&mut message, time_ns, WORLD).text(&frame(agent));
            message.f64s(&states.position_m(agent)).f64s(&turn(heading_rad)).f64s(&UNKNOWN);
            let [linear, angular] = twist(time_ns, states, before, agent);
            message.f64s(&linear).f64s(&angular).f64s(&UNKNOWN);
            self.write(1 + agent, time_ns, message.bytes())?;
        }
        Ok(())
    }

    fn write(&mut self, topic: usize, time_ns: u64, message: &[u8]) -> Result<(), ExportError> {
        let topic = &mut self.topics[topic];
        let header = MessageHeader {
            channel_id: topic.channel,
            sequence: self.n_messages,
            log_time: time_ns,
            publish_time: time_ns,
        };
        // Sequence numbers have 32 bits; later ones start again, which the format allows.
        self.n_messages = self.n_messages.wrapping_add(1);
        topic.n_messages += 1;
        let written = self.writer.write_to_known_channel(&header, message);
        written.map_err(|source| failed(self.path, source))
    }

    fn finish(mut self) -> Result<Vec<Topic>, ExportError> {
        self.writer.finish().map_err(|source| failed(self.path, source))?;
        Ok(self.topics)
    }
}

/// Covariances are not known: all of a matrix of six by six.
const UNKNOWN: [f64; 36] = [0.0; 36];

/// Adds a `std_msgs/msg/Header`.
fn header<'c>(message: &'c mut Cdr, time_ns: u64, frame: &str) -> &'c mut Cdr {
    message.u32((time_ns / NS_PER_S) as u32).u32((time_ns % NS_PER_S) as u32).text(frame)
}

fn frame(agent: usize) -> String {
    format!("robot_{agent}")
}

/// A heading as a quaternion: x, y, z, w.
fn turn(heading_rad: f64) -> [f64; 4] {
    let (sin, cos) = libm::sincos(0.5 * heading_rad);
    [0.0, 0.0, sin, cos]
}

/// Velocity in the axes of the robot (m/s), and yaw rate as an angular velocity (rad/s). Velocities are those that the simulator
/// reports, or differences of positions; yaw rates are differences of headings.
fn twist(
    time_ns: u64,
    states: &AgentStates,
    before: Option<&(u64, AgentStates)>,
    agent: usize,
) -> [[f64; 3]; 2] {
    let before = before.filter(|(_, before)| before.alive.get(agent));
    let since_s = before.map(|(before_ns, _)| seconds(time_ns - before_ns));
    let change = |to: f64, from: f64| since_s.map_or(0.0, |since_s| (to - from) / since_s);
    let reported = [&states.vx_mps, &states.vy_mps, &states.vz_mps];
    let position_m = states.position_m(agent);
    let from_m = before.map_or(position_m, |(_, before)| before.position_m(agent));
    let [vx, vy, vz] = [0, 1, 2].map(|axis| {
        let reported = reported[axis].get(agent).copied();
        reported.unwrap_or_else(|| change(position_m[axis], from_m[axis]))
    });
    let heading_rad = states.facing_rad(agent);
    let from_rad = before.map_or(heading_rad, |(_, before)| before.facing_rad(agent));
    let turned_rad = libm::remainder(heading_rad - from_rad, std::f64::consts::TAU);
    let (sin, cos) = libm::sincos(heading_rad);
    [[cos * vx + sin * vy, cos * vy - sin * vx, vz], [0.0, 0.0, change(turned_rad, 0.0)]]
}

fn metadata_yaml(file: &str, end_ns: u64, topics: &[Topic]) -> String {
    let n_messages: u64 = topics.iter().map(|topic| topic.n_messages).sum();
    let mut text = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: {end_ns}\n  \
         starting_time:\n    nanoseconds_since_epoch: 0\n  message_count: {n_messages}\n  topics_with_message_count:\n"
    );
    for Topic { name, kind, n_messages, .. } in topics {
        let _ = write!(
            text,
            "    - topic_metadata:\n        name: {name}\n        type: {kind}\n        serialization_format: cdr\n        \
             offered_qos_profiles: \"\"\n      message_count: {n_messages}\n"
        );
    }
    let _ = write!(
        text,
        "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {file}\n  files:\n    - path: {file}\n      \
         starting_time:\n        nanoseconds_since_epoch: 0\n      duration:\n        nanoseconds: {end_ns}\n      message_count: \
         {n_messages}\n"
    );
    text
}

fn failed(path: &Path, source: mcap::McapError) -> ExportError {
    let source = match source {
        mcap::McapError::Io(source) => source,
        source => std::io::Error::other(source),
    };
    ExportError::Write { path: path.to_owned(), source }
}
