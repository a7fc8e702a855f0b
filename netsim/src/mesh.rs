//! The 6TiSCH network: all motes, slot by slot.
//!
//! | module | what |
//! |---|---|
//! | [`network`] | the network as a whole: what a step brings in, and what it reports |
//! | `slot`, `scratch` | one slot: ask, resolve, tell; and its buffers |
//! | `hush` | in which slots motes listen, cached |
//! | [`calendar`] | in which slot which mote has something to do |
//! | [`config`] | what a network is made of |
//! | `payloads`, [`inbox`] | the swarm's payloads: from robots to queues, and from the air to robots |
//! | `oracle` | one scheduler that decides for all: a bound |
//! | `orders` | faults, jamming and traffic from outside |
//! | [`records`], [`capture`], [`frames`] | what is reported |
//!
//! No slot is looked at in which nobody sends and no timer is due. Who listens is asked only where something is on the
//! air; slots in which a radio listens in vain are counted from the schedule.

pub mod calendar;
pub mod capture;
pub mod config;
pub mod frames;
mod hush;
pub mod inbox;
pub mod network;
mod oracle;
mod orders;
mod payloads;
pub mod records;
mod scratch;
mod slot;
