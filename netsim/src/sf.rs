//! Scheduling functions: who uses which cells. `netsim.sf.kind`.
//!
//! One file per function, one list: `BUILT_IN`.
//!
//! | module | what | source |
//! |---|---|---|
//! | [`minimal`] | one cell for everything | RFC 8180 |
//! | [`msf`] | cells negotiated with the parent | RFC 9033 |
//! | [`llsf`] | the same, placed one after the other along a way | Chang et al., DCOSS 2016 |
//! | [`emsf`] | the same, as many as a Poisson process needs | after Hamza and Kaddoum, WCNC 2019 |
//! | [`rrsf`] | one slot for every mote | BotNet |
//! | [`sotdma`] | slots taken where nobody within two hops has them | this simulator |
//! | [`orchestra`] | cells that follow from addresses | Duquennoy et al., SenSys 2015; Contiki-NG |
//! | [`alice`] | cells of links, elsewhere in every slotframe | Kim et al., IPSN 2019 |
//! | [`static_schedule`] | cells as they are configured | |
//! | [`oracle`] | whom to send to is decided in one place: a bound | this simulator |
//!
//! How a mote drives one: when it has become synchronised, or is a root that starts, it puts the minimal cell into the schedule if
//! [`SchedulingFunction::minimal_cell`] says so ([`minimal::install`]), then calls [`SchedulingFunction::start`], then
//! [`SchedulingFunction::handle_time_source`] with the neighbour whose beacon it has followed, then
//! [`SchedulingFunction::handle_beacon`] with that beacon. With that it can join: nothing else is learned from beacons.

pub mod alice;
pub mod emsf;
pub mod llsf;
pub mod minimal;
pub mod msf;
pub mod oracle;
pub mod orchestra;
pub mod rrsf;
pub mod sotdma;
pub mod static_schedule;
pub mod testing;

use crate::dice::Dice;
use crate::mac::{CellRef, Schedule};
use crate::sixtop::{Event, Sixtop};
use crate::wire::Eui64;
use crate::wire::slots::SlotsRepr;
use physics::asn::Asn;
use proto::config::{Problem, Registered, TableSpec, Tag, Variant, Variants};
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::any::Any;
use std::fmt::Debug;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// What a scheduling function may see and change when something happens.
#[derive(Debug)]
pub struct Context<'a> {
    /// The mote's own address.
    pub own: Eui64,
    /// Whether it is a root.
    pub is_root: bool,
    /// Absolute number of the current slot.
    pub asn: Asn,
    /// When that begins.
    pub now: SimTime,
    /// Length of a slot.
    pub slot: SimDuration,
    /// How many channels are hopped over.
    pub n_channels: u16,
    /// The preferred parent, if there is one.
    pub parent: Option<Eui64>,
    /// The mote's slotframes and cells, which the scheduling function changes.
    pub schedule: &'a mut Schedule,
    /// 6P, through which cells are negotiated with neighbours.
    pub sixtop: &'a mut Sixtop,
    /// Random draws of the scheduling function.
    pub dice: &'a mut Dice,
    /// Neighbours with whom negotiation has failed for good: routing shall look for others. Appended to.
    pub unusable: &'a mut Vec<Eui64>,
}

/// What a frame is, for the choice of its cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traffic {
    /// An enhanced beacon.
    Beacon,
    /// A frame for everyone.
    Broadcast,
    /// What a robot says to everyone.
    Payload,
    /// A frame for one neighbour.
    Unicast(Eui64),
}

/// What a mote that is cloned, compared or saved asks of its scheduling function. Every type has it that can be.
pub trait Stored: Any + Debug + Send + Sync {
    /// A copy of it.
    fn boxed(&self) -> Box<dyn SchedulingFunction>;

    /// Whether the other one is of the same kind, and in the same state.
    fn equals(&self, other: &dyn SchedulingFunction) -> bool;

    /// Its state, as [`AnySf::resume`] reads it.
    fn saved(&self) -> Vec<u8>;
}

impl<T> Stored for T
where
    T: SchedulingFunction + Clone + PartialEq + Debug + Serialize + Send + Sync + 'static,
{
    fn boxed(&self) -> Box<dyn SchedulingFunction> {
        Box::new(self.clone())
    }

    fn equals(&self, other: &dyn SchedulingFunction) -> bool {
        (other as &dyn Any).downcast_ref::<T>().is_some_and(|other| self == other)
    }

    fn saved(&self) -> Vec<u8> {
        postcard::to_stdvec(self).expect("plain data in memory")
    }
}

/// Decides on cells. Called by the mote's layers; draws, time and the schedule come in with the [`Context`].
pub trait SchedulingFunction: Stored {
    /// The mote has become synchronised, or is a root that starts: install what is there from the beginning.
    fn start(&mut self, cx: &mut Context<'_>);

    /// The mote is no longer synchronised: forget everything. The schedule has been emptied, 6P reset.
    fn stop(&mut self);

    /// Length (slots) of the slotframe that is meant where a control period is one slotframe.
    fn slotframe_slots(&self) -> u16;

    /// Length (slots) of slotframe 0, if there shall be one with the minimal cell in it (RFC 8180, § 4.1). Beacons then announce
    /// just that (§ 4.5); otherwise they announce no slotframes, for everybody has the same configuration.
    fn minimal_cell(&self) -> Option<u16>;

    /// Whose clock is followed has changed: at first the neighbour whose beacon was followed, later as the MAC decides. A root
    /// follows nobody.
    fn handle_time_source(&mut self, _cx: &mut Context<'_>, _source: Option<Eui64>) {}

    /// A beacon was received. A join metric of 0 says that it came from a root (RFC 8180, § 6.1).
    fn handle_beacon(&mut self, _cx: &mut Context<'_>, _from: Eui64, _join_metric: u8) {}

    /// Whether a beacon may lead to a message, to another timer or to other cells: [`SchedulingFunction::handle_beacon`] does
    /// something. Where it cannot, most beacons are done with once they are counted.
    fn heeds_beacons(&self) -> bool {
        false
    }

    /// The preferred parent has changed; `cx.parent` is the new one.
    fn handle_parent(&mut self, _cx: &mut Context<'_>, _old: Option<Eui64>) {}

    /// The preferred parent knows that it is: it has acknowledged a DAO in storing mode (RFC 6550, § 9.8).
    fn handle_known_to_parent(&mut self, _cx: &mut Context<'_>) {}

    /// A neighbour has become a child (it routes through us), or is none any more.
    fn handle_child(&mut self, _cx: &mut Context<'_>, _child: Eui64, _is_child: bool) {}

    /// The first frame for a neighbour waits in the queue, or the last one has left it.
    fn handle_queue(&mut self, _cx: &mut Context<'_>, _neighbour: Eui64, _waits: bool) {}

    /// 6P reports.
    fn handle_event(&mut self, _cx: &mut Context<'_>, _event: Event) {}

    /// A frame was sent in a cell. `acknowledged`: `None` for broadcast frames. `dscp`: its class.
    fn handle_transmitted(
        &mut self,
        _cx: &mut Context<'_>,
        _at: &CellRef,
        _acknowledged: Option<bool>,
        _dscp: u8,
    ) {
    }

    /// A frame from a neighbour was received in a cell. `dscp`: its class.
    fn handle_received(&mut self, _cx: &mut Context<'_>, _at: &CellRef, _from: Eui64, _dscp: u8) {}

    /// What a frame for everyone that is sent in a cell shall announce of slots.
    fn announcement(&self, _own: Eui64, _at: &CellRef, _asn: Asn) -> Option<SlotsRepr> {
        None
    }

    /// The handle of a slotframe in which a frame for everyone shall go out for the sake of what it announces, whether or not
    /// there is anything else to say. Asked once.
    fn poll_announcement(&mut self) -> Option<u8> {
        None
    }

    /// A neighbour has announced what it knows of slots. Nothing that is scheduled may change, nor when
    /// [`SchedulingFunction::handle_timeout`] is called.
    fn handle_announcement(
        &mut self,
        _cx: &mut Context<'_>,
        _at: &CellRef,
        _from: Eui64,
        _announced: &SlotsRepr,
    ) {
    }

    /// When [`SchedulingFunction::handle_timeout`] wants to be called.
    fn poll_timeout(&self) -> Option<SimTime> {
        None
    }

    /// The time has come.
    fn handle_timeout(&mut self, _cx: &mut Context<'_>) {}

    /// Whether there are cells enough to send data to the parent. Until then applications wait. The answer changes only when
    /// the schedule or the parent does.
    fn is_ready(&self, _cx: &Context<'_>) -> bool {
        true
    }

    /// Until when a neighbour is to be left alone, its frames dropped unread (RFC 9033, § 12); `None`: it is not.
    fn quarantine_ends(&self, _neighbour: Eui64) -> Option<SimTime> {
        None
    }

    /// The slotframe whose cells a frame may use; `None`: any. The answer for a frame that waits may change whenever parents,
    /// children or roots do, and the cells that it had waited for are then gone: ask again for what is queued.
    fn slotframe_of(&self, _traffic: Traffic) -> Option<u8> {
        None
    }

    /// Whether a frame for `neighbour` that waits for a cell of `slotframe` is dropped. Asked for all waiting frames when
    /// parents or children have changed; frames that stay are then given their slotframe anew.
    fn abandons(&self, _slotframe: u8, _neighbour: Eui64) -> bool {
        false
    }
}

/// What a scheduling function may need to be configured.
#[derive(Debug)]
pub struct BuildContext<'a> {
    /// Path of `[netsim.sf]`, for problems.
    pub path: &'a str,
    /// Capacity of the experiment: motes are numbered from 0.
    pub agent_count: usize,
    /// How many channels are hopped over.
    pub n_channels: u16,
    /// Motes that are roots.
    pub roots: &'a [MoteId],
    /// Whether slot 0 of the round robin is everybody's, as in BotNet: `netsim.compat.shared_slot_0`.
    pub shared_slot_0: bool,
    /// Whether motes store routes and so know their children: `netsim.rpl.mode = "storing"`.
    pub stores_routes: bool,
    /// Link-layer addresses of motes.
    pub address: fn(MoteId) -> Eui64,
    /// What is found wrong.
    pub problems: Vec<Problem>,
    /// What should be checked before the results are trusted.
    pub warnings: Vec<String>,
}

/// A scheduling function that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// In which of its cells a mote can broadcast a robot's payload.
    pub payload_cells: PayloadCells,
    /// Makes its configuration of the checked table of `[netsim.sf]`, or adds problems.
    pub build: fn(&toml::Table, &mut BuildContext<'_>) -> Option<Config>,
}

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// In which cells of a scheduling function a mote can broadcast a robot's payload: `netsim.swarm.transport`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PayloadCells {
    /// Every mote has a cell for itself, and no other for broadcast frames.
    Own,
    /// All motes share the cells for broadcast frames.
    Shared,
    /// Either kind, as the schedule is configured. The cell for itself is preferred.
    Either,
    /// None at all.
    None,
}

impl PayloadCells {
    /// Whether a mote can have a cell for itself.
    #[must_use]
    pub fn has_own(self) -> bool {
        matches!(self, Self::Own | Self::Either)
    }

    /// Whether motes can share cells.
    #[must_use]
    pub(crate) fn has_shared(self) -> bool {
        matches!(self, Self::Shared | Self::Either)
    }
}

/// What `[netsim.sf]` says for one kind of scheduling function, the same for all motes.
pub trait Configured: Debug + Send + Sync + 'static {
    /// The scheduling function of one mote.
    type OfMote: SchedulingFunction + DeserializeOwned;

    /// The scheduling function of a mote, before it starts.
    fn create(&self, mote: MoteId) -> Self::OfMote;

    /// Whether there are cells from one mote alone to one other that name the neighbour at both ends: `netsim.mac.blacklist`.
    fn has_dedicated_cells(&self) -> bool {
        false
    }

    /// What should be checked before the results of a network of this configuration are trusted, if anything.
    fn advice(&self, _network: &Formation<'_>) -> Option<String> {
        None
    }
}

/// What a scheduling function may ask of the network that is to form.
#[derive(Clone, Copy, Debug)]
pub struct Formation<'a> {
    /// Path of `[netsim.sf]`, for messages.
    pub path: &'a str,
    /// Motes, roots among them.
    pub n_motes: usize,
    /// Number of roots in the network.
    pub n_roots: usize,
    /// Frames that a root sends for each mote that joins: the answer of the registrar, the acknowledgment of its routes.
    pub frames_per_mote: u32,
    /// Length of a slot.
    pub slot: SimDuration,
}

/// A configured scheduling function of any kind, shared by all motes.
#[derive(Clone, Debug)]
pub struct Config(Arc<dyn AnyConfigured>);

/// [`Configured`] without the type of its motes' scheduling functions.
trait AnyConfigured: Any + Debug + Send + Sync {
    fn create(&self, mote: MoteId) -> Box<dyn SchedulingFunction>;
    fn read(&self, saved: &[u8]) -> Option<Box<dyn SchedulingFunction>>;
    fn has_dedicated_cells(&self) -> bool;
    fn advice(&self, network: &Formation<'_>) -> Option<String>;
}

impl<C: Configured> AnyConfigured for C {
    fn create(&self, mote: MoteId) -> Box<dyn SchedulingFunction> {
        Box::new(Configured::create(self, mote))
    }

    fn read(&self, saved: &[u8]) -> Option<Box<dyn SchedulingFunction>> {
        let (sf, rest): (C::OfMote, _) = postcard::take_from_bytes(saved).ok()?;
        rest.is_empty().then(|| Box::new(sf) as Box<dyn SchedulingFunction>)
    }

    fn has_dedicated_cells(&self) -> bool {
        Configured::has_dedicated_cells(self)
    }

    fn advice(&self, network: &Formation<'_>) -> Option<String> {
        Configured::advice(self, network)
    }
}

impl Config {
    /// A scheduling function that is configured like this.
    #[must_use]
    pub fn new(configured: impl Configured) -> Self {
        Self(Arc::new(configured))
    }

    /// The configuration, if it is of this kind.
    #[must_use]
    pub fn as_kind<C: Configured>(&self) -> Option<&C> {
        (&*self.0 as &dyn Any).downcast_ref()
    }

    /// The scheduling function of a mote, before it starts.
    #[must_use]
    pub fn create(&self, mote: MoteId) -> AnySf {
        AnySf(Held::Running(self.0.create(mote)))
    }

    /// Length (slots) of the slotframe that is meant where a control period is one slotframe.
    #[must_use]
    pub fn slotframe_slots(&self) -> u16 {
        self.0.create(MoteId(0)).slotframe_slots()
    }

    /// Whether motes have dedicated cells that both ends know.
    #[must_use]
    pub fn has_dedicated_cells(&self) -> bool {
        self.0.has_dedicated_cells()
    }

    /// What should be checked before the results of a network are trusted, if anything.
    #[must_use]
    pub(crate) fn advice(&self, network: &Formation<'_>) -> Option<String> {
        self.0.advice(network)
    }
}

/// The scheduling function of one mote, of any kind.
///
/// It is saved as bytes, which only its configuration can read: whoever reads a saved mote calls [`AnySf::resume`] next.
#[derive(Debug)]
pub struct AnySf(Held);

#[derive(Debug)]
enum Held {
    Running(Box<dyn SchedulingFunction>),
    Saved(Vec<u8>),
}

impl AnySf {
    /// Goes on from what was saved. `false`: that is not of a scheduling function that is configured like this.
    #[must_use]
    pub fn resume(&mut self, config: &Config) -> bool {
        if let Held::Saved(bytes) = &self.0 {
            let Some(sf) = config.0.read(bytes) else { return false };
            self.0 = Held::Running(sf);
        }
        true
    }

    /// It, if it is of this kind.
    #[must_use]
    pub fn as_kind<T: SchedulingFunction>(&self) -> Option<&T> {
        (&**self as &dyn Any).downcast_ref()
    }

    fn bytes(&self) -> Vec<u8> {
        match &self.0 {
            Held::Running(sf) => sf.saved(),
            Held::Saved(bytes) => bytes.clone(),
        }
    }
}

impl Deref for AnySf {
    type Target = dyn SchedulingFunction;

    fn deref(&self) -> &Self::Target {
        match &self.0 {
            Held::Running(sf) => &**sf,
            Held::Saved(_) => {
                unreachable!("a saved scheduling function is resumed before it is used")
            }
        }
    }
}

impl DerefMut for AnySf {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match &mut self.0 {
            Held::Running(sf) => &mut **sf,
            Held::Saved(_) => {
                unreachable!("a saved scheduling function is resumed before it is used")
            }
        }
    }
}

impl Clone for AnySf {
    fn clone(&self) -> Self {
        Self(match &self.0 {
            Held::Running(sf) => Held::Running(sf.boxed()),
            Held::Saved(bytes) => Held::Saved(bytes.clone()),
        })
    }
}

impl PartialEq for AnySf {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Held::Running(one), Held::Running(other)) => one.equals(&**other),
            _ => self.bytes() == other.bytes(),
        }
    }
}

impl Serialize for AnySf {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.bytes().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for AnySf {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Vec::deserialize(deserializer).map(|bytes| Self(Held::Saved(bytes)))
    }
}

/// What descriptions call the list of scheduling functions.
pub(crate) const LIST: &str = "netsim.sf";

/// The scheduling functions that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[
    minimal::ENTRY,
    msf::ENTRY,
    llsf::ENTRY,
    emsf::ENTRY,
    rrsf::ENTRY,
    sotdma::ENTRY,
    orchestra::ENTRY,
    alice::ENTRY,
    static_schedule::ENTRY,
    oracle::ENTRY,
];

/// Description of `[netsim.sf]`.
pub const SPEC: TableSpec = TableSpec {
    doc: "The scheduling function, which assigns cells to motes.",
    fields: &[],
    tag: Some(&TAG),
};

/// The key that selects a scheduling function.
pub(crate) const TAG: Tag = Tag {
    key: "kind",
    doc: "The scheduling function.",
    default: Some(minimal::ENTRY.variant.name),
    variants: Variants::List(LIST),
};

/// Longest slotframe (slots): places of cells are counted in 16 bits, of which one value is taken.
const MAX_SLOTS: u16 = u16::MAX - 1;

#[cfg(test)]
mod tests;
