//! Who moves how: robots, controllers and scenarios, in simulated time.
//!
//! The crate is a pure core: [`sim::Swarm`] is a plain object that is configured, stepped, saved and restored. It opens
//! no file and no socket, reads no clock, and draws only keyed random numbers, so that the same seed and configuration
//! give the same motion for any number of threads. The crate `proto-host` serves it over gRPC; `robotsim/process` is the
//! program that does so.
//!
//! In reading order:
//!
//! | module | what |
//! |---|---|
//! | [`sim`] | the swarm: owns the state; knowledge in, commands out, motion, payloads |
//! | [`payload`] | what the built-in robots say: position and velocity, 48 bytes |
//! | [`knowledge`] | what each robot knows of the others: what it heard, or the truth |
//! | [`controller`] | who wants to go where: one file per controller, one list |
//! | [`exploration`] | what robots that explore rooms and their base know, and say to each other |
//! | `predict` | where robots get to that start in a recorded state and execute recorded commands |
//! | [`line_fit`] | the straight line nearest to some points, by two rules |
//! | [`dynamics`] | from command to motion: bodies, and one file per effect of real robots |
//! | [`group`] | different robots in one swarm: how many of which kind |
//! | [`absence`] | robots that come late and robots that are lost |
//! | [`obstacles`] | how obstacles of the place move |
//! | [`scenario`] | where everyone begins: one file per scenario, one list |
//! | [`catalogue`] | what can be chosen by name: the lists of effects, controllers and scenarios |
//! | [`config`] | the `[robotsim]` section: its description and its checks |
//! | [`idle`] | keys of the section that are written and have no influence |
//! | [`context`] | what the parts of that section are checked against |

#![cfg_attr(
    test,
    expect(
        clippy::disallowed_methods,
        reason = "tests hold results against the platform's own functions"
    )
)]

pub mod absence;
pub mod catalogue;
pub mod config;
pub mod context;
pub mod controller;
pub mod dynamics;
pub mod exploration;
pub mod group;
pub mod idle;
pub mod knowledge;
pub mod line_fit;
pub mod obstacles;
mod path;
pub mod payload;
mod predict;
pub mod scenario;
pub mod sim;
