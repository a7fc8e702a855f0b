//! The robots of an experiment, moved along measured tracks.

use super::built_in_robots;
use crate::tracks::Tracks;
use bytes::Bytes;
use drive::peer::{Described, InProcess, Peer, RobotSide, Side, SideError, Standing};
use proto::exchange::{ConfigureRequest, RobotsStart, RobotsStep};
use proto::types::{AgentStates, NS_PER_S, Payloads};
use robotsim::sim::Swarm;

/// Robots that are where they were measured. What they say, and what they want to know, is what the experiment's have to say
/// and want to know where they begin.
pub(super) struct Tracked<'a> {
    begun: InProcess<Swarm>,
    tracks: &'a Tracks,
    counts_from_start: bool,
    /// When they started (ns).
    started_ns: Option<u64>,
    states: AgentStates,
    payloads: Payloads,
}

impl<'a> Tracked<'a> {
    pub(super) fn new(tracks: &'a Tracks, counts_from_start: bool) -> Self {
        Self {
            begun: built_in_robots(),
            tracks,
            counts_from_start,
            started_ns: None,
            states: AgentStates::default(),
            payloads: Payloads::default(),
        }
    }
}

impl Peer<RobotSide> for Tracked<'_> {
    const SHARES_VALUES: bool = true;

    fn described(&self) -> &Described {
        Peer::<RobotSide>::described(&self.begun)
    }

    async fn configure(&mut self, request: &ConfigureRequest) -> Result<RobotsStart, SideError> {
        let start = Peer::<RobotSide>::configure(&mut self.begun, request).await?;
        self.states = start.states.clone();
        self.payloads = start
            .payloads
            .clone()
            .unwrap_or_else(|| Payloads::silence(request.experiment.agent_count));
        Ok(RobotsStart { messages: false, ..start })
    }

    async fn step(
        &mut self,
        input: &<RobotSide as Side>::Input<'_>,
    ) -> Result<RobotsStep, SideError> {
        if !input.hold {
            self.started_ns.get_or_insert(input.from_ns);
        }
        let since_ns = if self.counts_from_start { self.started_ns } else { Some(0) };
        let at_ns = since_ns.map_or(0, |since_ns| input.until_ns - since_ns);
        self.tracks.place(at_ns as f64 / NS_PER_S as f64, &mut self.states);
        Ok(RobotsStep {
            step: input.step,
            time_ns: input.until_ns,
            states: self.states.clone(),
            payloads: self.payloads.clone(),
            held: input.hold,
            ..RobotsStep::default()
        })
    }

    async fn barrier(&mut self, step: u64, time_ns: u64) -> Result<Standing, SideError> {
        Ok(Standing { step, time_ns, digest: Bytes::new() })
    }

    async fn stop(self) {}
}
