//! Numbers of things that must not be mistaken for each other.
//!
//! They are written to messages, snapshots and files as the number itself.

use serde::{Deserialize, Serialize};
use std::fmt;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(
            Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
        )]
        #[serde(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The one at a place of a list that has one entry for each.
            #[must_use]
            pub const fn from_index(index: usize) -> Self {
                Self(index as u32)
            }

            /// Its place in a list that has one entry for each.
            #[must_use]
            pub const fn index(self) -> usize {
                self.0 as usize
            }

            /// The first so many.
            pub fn first(n: usize) -> impl DoubleEndedIterator<Item = Self> + ExactSizeIterator + Clone {
                (0..n as u32).map(Self)
            }
        }

        // In lists, which messages show, a number too.
        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Debug::fmt(&self.0, f)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&self.0, f)
            }
        }
    };
}

id! {
    /// The number of an agent: a robot, or whatever else moves and has a mote. From 0.
    AgentId
}

id! {
    /// The number of a mote, which is that of the agent that carries it. From 0.
    MoteId
}

impl From<AgentId> for MoteId {
    fn from(agent: AgentId) -> Self {
        Self(agent.0)
    }
}

impl From<MoteId> for AgentId {
    fn from(mote: MoteId) -> Self {
        Self(mote.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mote_has_the_number_of_its_agent() {
        assert_eq!(MoteId::from(AgentId(7)), MoteId::from_index(7));
        assert_eq!(AgentId::from(MoteId(7)).index(), 7);
        assert_eq!(MoteId::first(3).last(), Some(MoteId(2)));
        assert_eq!(format!("{:>3}", AgentId(12)), " 12");
        assert_eq!(format!("{:?}", [MoteId(3)]), "[3]");
        assert_eq!(serde_json::to_string(&MoteId(4)).unwrap(), "4");
    }
}
