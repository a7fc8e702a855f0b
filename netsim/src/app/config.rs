//! `[[netsim.app]]`: who sends how much to whom, and the one list of kinds.

use super::burst::Burst;
use super::coap::Coap;
use super::download::Download;
use super::event::Event;
use super::periodic::Periodic;
use super::poisson::Poisson;
use super::{Host, Kind, Packet, Reading, Traffic};
use proto::config::{Problem, TableSpec, Tag, Variant, Variants};
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};

/// Makes of the list of kinds the enumeration of their state machines, and what depends on the kind.
macro_rules! kinds {
    ($($kind:ident),+ $(,)?) => {
        /// The state machine of an application, by kind.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub enum Machine {
            $(
                #[doc = concat!("[`", stringify!($kind), "`].")]
                $kind($kind),
            )+
        }

        /// The kinds and their keys.
        const VARIANTS: &[Variant] = &[$(<$kind as Kind>::VARIANT),+];

        impl Machine {
            fn read(kind: &str, reading: &mut Reading<'_>) -> Option<Self> {
                $(
                    if kind == <$kind as Kind>::VARIANT.name {
                        return $kind::read(reading).map(Self::$kind);
                    }
                )+
                None
            }

            /// The same as one mote runs it; `None`: the mote takes no part.
            pub(super) fn assigned(&self, host: &Host) -> Option<Self> {
                match self {
                    $(Self::$kind(kind) => kind.assigned(host).map(Self::$kind),)+
                }
            }

            fn largest(&self) -> Largest {
                match self {
                    $(Self::$kind(kind) => kind.largest(),)+
                }
            }

            /// How it behaves.
            pub(super) fn traffic(&self) -> &dyn Traffic {
                match self {
                    $(Self::$kind(kind) => kind,)+
                }
            }

            /// How it behaves.
            pub(super) fn traffic_mut(&mut self) -> &mut dyn Traffic {
                match self {
                    $(Self::$kind(kind) => kind,)+
                }
            }
        }
    };
}

// The kinds of traffic: each is a file of this folder.
kinds!(Periodic, Burst, Poisson, Event, Coap, Download);

/// Description of `[[netsim.app]]`.
pub const SPEC: TableSpec = TableSpec {
    doc: "An application that generates packets at motes.",
    fields: &[],
    tag: Some(&TAG),
};

const TAG: Tag = Tag {
    key: "kind",
    doc: "The traffic pattern.",
    default: Some(<Periodic as Kind>::VARIANT.name),
    variants: Variants::Fixed(VARIANTS),
};

/// The largest packet of an application, and what makes it so large.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Largest {
    /// The key that sets its length.
    pub key: &'static str,
    /// The value of the key.
    pub value: u32,
    /// The packet; its destination and its time do not matter.
    pub packet: Packet,
}

/// An application as configured.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// Its state machine, not assigned to a mote.
    pub machine: Machine,
}

impl Spec {
    /// Reads one table that [`SPEC`] has checked. `n_motes` bounds the numbers of motes. Appends what is wrong to `problems`.
    pub fn read(
        table: &toml::Table,
        path: &str,
        n_motes: u32,
        problems: &mut Vec<Problem>,
    ) -> Option<Self> {
        let before = problems.len();
        let kind = table.get(TAG.key)?.as_str()?;
        let mut reading = Reading { table, path, n_motes, problems };
        let machine = Machine::read(kind, &mut reading);
        if problems.len() != before {
            return None;
        }
        machine.map(|machine| Self { machine })
    }

    /// The motes with which the first root exchanges messages, if they are named, each with the key that names it.
    #[must_use]
    pub(crate) fn other_ends(&self) -> Vec<(String, MoteId)> {
        match &self.machine {
            Machine::Coap(coap) => {
                coap.one_server().map(|mote| ("servers".to_owned(), mote)).into_iter().collect()
            }
            Machine::Download(download) => {
                let targets = download.targets().iter().enumerate();
                targets.map(|(index, &mote)| (format!("targets[{index}]"), mote)).collect()
            }
            Machine::Periodic(_) | Machine::Burst(_) | Machine::Poisson(_) | Machine::Event(_) => {
                Vec::new()
            }
        }
    }

    /// The largest packet that it sends.
    #[must_use]
    pub fn largest(&self) -> Largest {
        self.machine.largest()
    }

    /// Whether motes exchange CoAP messages.
    #[must_use]
    pub(crate) fn is_coap(&self) -> bool {
        matches!(self.machine, Machine::Coap(_) | Machine::Download(_))
    }
}
