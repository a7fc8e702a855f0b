//! A simulator as the driver sees it, wherever it runs.

use super::SideError;
use bytes::Bytes;
use proto::digest::Digest;
use proto::exchange::{ConfigureRequest, NetworkStart, NetworkStep, RobotsStart, RobotsStep};
use proto::side::{NetInput, RobotInput};
use proto::types::MoteCommandKind;
use proto::types::{DeliveryColumn, NetRecord};
use std::future::Future;

/// One of the two sides of the contract: what it is given, and what it replies.
pub trait Side: Send + Sync + 'static {
    /// Name of the side in messages, and of its section of an experiment file.
    const SIDE: &'static str;
    /// What a step is given.
    type Input<'a>;
    /// The reply to a configuration.
    type Start;
    /// The reply to a step.
    type Reply;
}

/// The robots.
pub enum RobotSide {}

/// The network.
pub enum NetworkSide {}

impl Side for RobotSide {
    const SIDE: &'static str = "robotsim";
    type Input<'a> = RobotInput<'a>;
    type Start = RobotsStart;
    type Reply = RobotsStep;
}

impl Side for NetworkSide {
    const SIDE: &'static str = "netsim";
    type Input<'a> = NetInput<'a>;
    type Start = NetworkStart;
    type Reply = NetworkStep;
}

/// A simulator of one side: in another process ([`super::Remote`]), in this one ([`super::InProcess`]), or what was measured in
/// its place.
pub trait Peer<S: Side> {
    /// Its replies are the driver's own values: there are no others that a digest could find, nor any that are malformed.
    const SHARES_VALUES: bool;

    /// What it says of itself.
    fn described(&self) -> &Described;

    /// Begins an experiment, discarding any before it.
    ///
    /// # Errors
    ///
    /// [`SideError::Unacceptable`] if it refuses the configuration, others if it fails.
    fn configure(
        &mut self,
        request: &ConfigureRequest,
    ) -> impl Future<Output = Result<S::Start, SideError>>;

    /// Takes a step.
    ///
    /// # Errors
    ///
    /// It fails, hangs, refuses, or breaks the protocol.
    fn step(&mut self, input: &S::Input<'_>) -> impl Future<Output = Result<S::Reply, SideError>>;

    /// Digest of how the experiment began on this side, if its digests of steps are full ones; `None`: they are of positions and
    /// deliveries alone, or there are none.
    fn start_digest(&self) -> Option<Digest> {
        None
    }

    /// Says where it stands after step `step`, which ended at `time_ns`.
    ///
    /// # Errors
    ///
    /// It fails, hangs, refuses, or breaks the protocol.
    fn barrier(
        &mut self,
        step: u64,
        time_ns: u64,
    ) -> impl Future<Output = Result<Standing, SideError>>;

    /// Its whole state between two steps; `None` if it keeps no snapshots.
    ///
    /// # Errors
    ///
    /// It fails, hangs, refuses, or breaks the protocol.
    fn snapshot(&mut self) -> impl Future<Output = Result<Option<Bytes>, SideError>> {
        std::future::ready(Ok(None))
    }

    /// Ends it. Never fails.
    fn stop(self) -> impl Future<Output = ()>;
}

/// What a side says of itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Described {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// The contract's version.
    pub contract_version: u32,
    /// Sessions are served.
    pub session: bool,
    /// Snapshots are served.
    pub snapshots: bool,
    /// A snapshot can be restored with another seed.
    pub reseed: bool,
    /// Parallel and event coupling are understood.
    pub parallel: bool,
    /// Steps can end at the first delivery. Network only.
    pub stop_at_first_delivery: bool,
    /// Orders to agents are obeyed. Robots only.
    pub commands: bool,
    /// They can stand still while time passes. Robots only.
    pub hold: bool,
    /// Kinds of order to motes that are obeyed; those that this version of the contract does not know are left out. Network
    /// only.
    pub mote_commands: Vec<MoteCommandKind>,
    /// Delivery columns that can be asked for, as far as they are known here. Network only.
    pub columns: Vec<DeliveryColumn>,
    /// Records that can be asked for, as far as they are known here. Network only.
    pub records: Vec<NetRecord>,
    /// Digests of the whole exchange can be asked for.
    pub full_digest: bool,
    /// Motion under recorded commands is predicted. Robots only.
    pub predictions: bool,
    /// The largest capacity; 0: no limit.
    pub max_agents: u32,
}

/// Where a side says that it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Standing {
    /// Its latest step.
    pub step: u64,
    /// Its time (ns).
    pub time_ns: u64,
    /// Its digest of the exchanged state. Empty where [`Peer::SHARES_VALUES`].
    pub digest: Bytes,
}
