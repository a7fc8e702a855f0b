//! `scene.mcap`: the run as 3-D viewers draw it, in Foxglove's schemas. `docs/viewing.md` shows it.

mod place;

use super::descriptors::descriptors_of;
use super::mcap_file::McapFile;
use super::{RecordError, RunHeader};
use foxglove::line_primitive::Type as LineType;
use foxglove::log::Level;
use input::fingerprint::Fingerprint;
use metrics::period::Period;
use place::{colour, pose};
use prost::Message;
use prost_types::Timestamp;
use proto::site::Site;
use proto::types::{AgentStates, Bitmap, MovedObstacle, NS_PER_S, seconds};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;

/// The messages, as they are generated.
#[expect(unreachable_pub, clippy::all, clippy::pedantic, reason = "generated from vendored files")]
pub(crate) mod foxglove {
    include!("../generated/foxglove.rs");
}

/// Their descriptors.
const DESCRIPTORS: &[u8] = include_bytes!("../generated/foxglove.bin");
/// Its name.
pub(crate) const FILE: &str = "scene.mcap";
/// The frame of all positions: metres, x east, y north, z up.
const WORLD: &str = "world";
/// Links are drawn in one list of lines for each class of signal: from so much (dBm) on, what it is called, and its colour. The colours
/// differ for people who see colours otherwise (Okabe and Ito 2008).
const SIGNALS: [(f32, &str, [f64; 4]); 4] = [
    (-70.0, "from -70 dBm", [0.0, 0.45, 0.7, 0.9]),
    (-85.0, "from -85 dBm", [0.9, 0.62, 0.0, 0.9]),
    (f32::NEG_INFINITY, "weaker", [0.84, 0.37, 0.0, 0.9]),
    (f32::NAN, "of unknown strength", [0.35, 0.35, 0.35, 0.7]),
];

/// A channel of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Topic {
    Transforms,
    Robots,
    Links,
    Site,
    Events,
    Metrics,
}

impl Topic {
    const ALL: [Self; 6] =
        [Self::Transforms, Self::Robots, Self::Links, Self::Site, Self::Events, Self::Metrics];

    /// Name of the topic, and its schema; that of plain numbers is a JSON schema.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Transforms => ("/tf", "foxglove.FrameTransforms"),
            Self::Robots => ("/robots", "foxglove.PosesInFrame"),
            Self::Links => ("/links", "foxglove.SceneUpdate"),
            Self::Site => ("/site", "foxglove.SceneUpdate"),
            Self::Events => ("/events", "foxglove.Log"),
            Self::Metrics => ("/metrics", "murmuration.Metrics"),
        }
    }
}

/// The file being written.
pub(crate) struct SceneLog {
    file: McapFile,
    channels: BTreeMap<Topic, u16>,
    every_ns: Option<u64>,
    buffer: Vec<u8>,
    n_messages: u64,
    site: Site,
    /// Which robots existed when they were last looked at.
    alive: Option<Bitmap>,
    is_complete: bool,
    has_formed: bool,
}

impl SceneLog {
    /// Begins the file.
    pub(crate) fn create(
        path: &Path,
        header: &RunHeader,
        about: BTreeMap<String, String>,
    ) -> Result<Self, RecordError> {
        let mut file = McapFile::create(path, about)?;
        let number = json!({ "type": "number" });
        let names =
            ["time_s", "n_alive", "n_sent", "n_deliveries", "mean_neighbours", "n_isolated"];
        let properties: BTreeMap<&str, _> = names.map(|name| (name, number.clone())).into();
        let metrics =
            json!({ "title": "murmuration.Metrics", "type": "object", "properties": properties });
        let metrics = metrics.to_string();
        let mut channels = BTreeMap::new();
        for topic in Topic::ALL {
            let (name, schema) = topic.names();
            let channel = if topic == Topic::Metrics {
                file.add_channel(name, "json", (schema, "jsonschema", metrics.as_bytes()))?
            } else {
                let descriptors = descriptors_of(DESCRIPTORS, schema);
                file.add_channel(name, "protobuf", (schema, "protobuf", &descriptors))?
            };
            channels.insert(topic, channel);
        }
        Ok(Self {
            file,
            channels,
            every_ns: header.output.scene_every_ns(),
            buffer: Vec::new(),
            n_messages: 0,
            site: Site::default(),
            alive: None,
            is_complete: false,
            has_formed: false,
        })
    }

    /// Draws the place, and robots where they begin.
    pub(crate) fn begin(&mut self, site: &Site, states: &AgentStates) -> Result<(), RecordError> {
        self.site = site.clone();
        let entities = place::entities(site, site.extent_m(states));
        self.write(Topic::Site, 0, 0, &foxglove::SceneUpdate { deletions: Vec::new(), entities })?;
        self.alive = Some(states.alive.clone());
        self.robots(0, 0, states)
    }

    /// Adds a step, if it is one of those asked for; what happened in it is always added.
    pub(crate) fn add(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let Period { step, from_ns, time_ns, .. } = *period;
        self.happened(period)?;
        let is_asked_for = |every_ns| from_ns / every_ns != time_ns / every_ns;
        if !self.every_ns.is_none_or(is_asked_for) {
            return Ok(());
        }
        self.robots(step, time_ns, period.states)?;
        self.links(period)?;
        self.moved(step, time_ns, period.moved_obstacles)?;
        self.metrics(period)
    }

    /// Adds an event.
    pub(crate) fn event(
        &mut self,
        step: u64,
        time_ns: u64,
        level: Level,
        message: String,
    ) -> Result<(), RecordError> {
        let log = foxglove::Log {
            timestamp: Some(timestamp(time_ns)),
            level: level.into(),
            message,
            name: "murmuration".to_owned(),
            file: String::new(),
            line: 0,
        };
        self.write(Topic::Events, step, time_ns, &log)
    }

    /// Ends the file. Returns how many messages it holds.
    pub(crate) fn finish(self) -> Result<(u64, Fingerprint), RecordError> {
        Ok((self.n_messages, self.file.finish()?))
    }

    fn write(
        &mut self,
        topic: Topic,
        step: u64,
        time_ns: u64,
        message: &impl Message,
    ) -> Result<(), RecordError> {
        self.buffer.clear();
        message.encode(&mut self.buffer).expect("a vector grows as needed");
        self.n_messages += 1;
        self.file.write(self.channels[&topic], step, time_ns, &self.buffer)
    }

    fn robots(&mut self, step: u64, time_ns: u64, states: &AgentStates) -> Result<(), RecordError> {
        let at = Some(timestamp(time_ns));
        let alive: Vec<usize> = (0..states.len()).filter(|&i| states.alive.get(i)).collect();
        let poses: Vec<foxglove::Pose> =
            alive.iter().map(|&i| pose(states.position_m(i), states.facing_rad(i))).collect();
        let transforms = alive.iter().zip(&poses).map(|(agent, pose)| foxglove::FrameTransform {
            timestamp: at,
            parent_frame_id: WORLD.to_owned(),
            child_frame_id: format!("robot_{agent}"),
            translation: pose.position,
            rotation: pose.orientation,
        });
        let transforms = foxglove::FrameTransforms { transforms: transforms.collect() };
        self.write(Topic::Transforms, step, time_ns, &transforms)?;
        let robots = foxglove::PosesInFrame { timestamp: at, frame_id: WORLD.to_owned(), poses };
        self.write(Topic::Robots, step, time_ns, &robots)
    }

    /// Who heard whom in the period: a line between two robots, by the stronger of both directions.
    fn links(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let deliveries = period.deliveries;
        let sender = &deliveries.transmissions.sender;
        let mut strongest: BTreeMap<(u32, u32), f32> = BTreeMap::new();
        let mut number = 0;
        for receiver in 0..period.states.len() as u32 {
            for index in deliveries.heard_by(receiver as usize) {
                let rssi_dbm = deliveries.rssi_dbm.get(number).copied().unwrap_or(f32::NAN);
                number += 1;
                let other = sender[index];
                if other == receiver {
                    continue;
                }
                let link = strongest.entry((other.min(receiver), other.max(receiver)));
                let strength = link.or_insert(rssi_dbm);
                *strength = strength.max(rssi_dbm);
            }
        }
        let points: Vec<foxglove::Point3> = (0..period.states_on_air.len())
            .map(|agent| place::point(period.states_on_air.position_m(agent)))
            .collect();
        let mut indices = SIGNALS.map(|_| Vec::new());
        for ((a, b), rssi_dbm) in strongest {
            let class = SIGNALS.iter().position(|(least_dbm, ..)| *least_dbm <= rssi_dbm);
            indices[class.unwrap_or(SIGNALS.len() - 1)].extend([a, b]);
        }
        let lines = SIGNALS.iter().zip(indices).filter(|(_, indices)| !indices.is_empty());
        let lines = lines.map(|((_, _, rgba), indices)| foxglove::LinePrimitive {
            r#type: LineType::LineList.into(),
            pose: Some(pose([0.0; 3], 0.0)),
            thickness: 1.5,
            scale_invariant: true,
            points: points.clone(),
            color: Some(colour(*rgba)),
            colors: Vec::new(),
            indices,
        });
        let entity = foxglove::SceneEntity {
            lines: lines.collect(),
            ..place::entity("links", period.time_ns)
        };
        let update = foxglove::SceneUpdate { deletions: Vec::new(), entities: vec![entity] };
        self.write(Topic::Links, period.step, period.time_ns, &update)
    }

    fn moved(
        &mut self,
        step: u64,
        time_ns: u64,
        moved: &[MovedObstacle],
    ) -> Result<(), RecordError> {
        if moved.is_empty() {
            return Ok(());
        }
        for MovedObstacle { name, centre_m } in moved {
            let named =
                |obstacle: &&mut proto::site::Obstacle| obstacle.name.as_ref() == Some(name);
            if let Some(obstacle) = self.site.obstacle.iter_mut().find(named) {
                obstacle.centre_m = *centre_m;
            }
        }
        let update = foxglove::SceneUpdate {
            deletions: Vec::new(),
            entities: vec![place::obstacles(&self.site, time_ns)],
        };
        self.write(Topic::Site, step, time_ns, &update)
    }

    /// Robots that came or went, the network's formation and the task's end.
    fn happened(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let Period { step, time_ns, states, .. } = *period;
        if let Some(before) = self.alive.replace(states.alive.clone()) {
            for agent in 0..states.len() {
                match (before.get(agent), states.alive.get(agent)) {
                    (true, false) => {
                        self.event(
                            step,
                            time_ns,
                            Level::Warning,
                            format!("robot {agent} is lost"),
                        )?;
                    }
                    (false, true) => {
                        self.event(step, time_ns, Level::Info, format!("robot {agent} is there"))?;
                    }
                    _ => {}
                }
            }
        }
        let has_formed = period.formation.is_some_and(|formation| formation.formed_ns.is_some());
        if has_formed && !self.has_formed {
            self.event(step, time_ns, Level::Info, "the network has formed".to_owned())?;
        }
        if period.task_complete && !self.is_complete {
            self.event(step, time_ns, Level::Info, "the task is complete".to_owned())?;
        }
        (self.has_formed, self.is_complete) = (has_formed, period.task_complete);
        Ok(())
    }

    fn metrics(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let states = period.states;
        let neighbours = || {
            (0..states.len()).filter(|&i| states.alive.get(i)).map(|i| period.counts.neighbours[i])
        };
        let n_alive = neighbours().count();
        let metrics = json!({
            "time_s": seconds(period.time_ns),
            "n_alive": n_alive,
            "n_sent": period.deliveries.transmissions.sender.len(),
            "n_deliveries": period.counts.n_deliveries,
            "mean_neighbours": neighbours().map(f64::from).sum::<f64>() / n_alive.max(1) as f64,
            "n_isolated": neighbours().filter(|n| *n == 0).count(),
        });
        self.n_messages += 1;
        let channel = self.channels[&Topic::Metrics];
        self.file.write(channel, period.step, period.time_ns, metrics.to_string().as_bytes())
    }
}

fn timestamp(time_ns: u64) -> Timestamp {
    Timestamp { seconds: (time_ns / NS_PER_S) as i64, nanos: (time_ns % NS_PER_S) as i32 }
}
