//! Simulators that lie, and connections to simulators that are disturbed.

use crate::Server;
use crate::fake::{Fault, Faulty};
use crate::fault_campaign::proxy::{Disturbance, Proxy};
use anyhow::{Context as _, bail};
use std::fmt;
use std::str::FromStr;

/// The scenarios that may have such peers: the first ones.
pub(super) const N_SCENARIOS: u64 = 4;

/// What is wrong with a simulator or the connection to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PeerFault {
    /// An index of `NAMES`.
    kind: usize,
    /// It is the network.
    is_network: bool,
    /// After so many bytes from the simulator, of a connection.
    after_bytes: u64,
}

/// Lies of the simulator.
const LIES: [(&str, Fault); 11] = [
    ("wrong-step", Fault::WrongStep),
    ("wrong-digest", Fault::WrongDigest),
    ("wrong-time", Fault::WrongTime),
    ("short-column", Fault::ShortColumn),
    ("not-a-number", Fault::NotANumber),
    ("silent", Fault::Silent),
    ("slow", Fault::Slow),
    ("other-number", Fault::OtherNumber),
    ("other-payload", Fault::OtherPayload),
    ("false-digest", Fault::FalseDigest),
    ("other-version", Fault::OtherVersion),
];

/// What happens to its bytes.
const CONNECTIONS: [(&str, Disturbance); 4] = [
    ("cut", Disturbance::Cut),
    ("late", Disturbance::Delay),
    ("repeated", Disturbance::Duplicate),
    ("corrupt", Disturbance::Corrupt),
];

/// About as many bytes come from a simulator in the longest of the scenarios.
const MOST_BYTES: u64 = 20_000;

/// A simulator that runs, until this is dropped.
pub(super) struct RunningPeer {
    /// What makes a run use it.
    pub(super) arguments: Vec<String>,
    _server: Option<Server>,
}

impl PeerFault {
    /// Every other one is of the connection.
    pub(super) fn draw(a: u64, b: u64) -> Self {
        let is_network = a & 1 == 0;
        let kind = if a & 2 == 0 {
            (b % LIES.len() as u64) as usize
        } else {
            LIES.len() + (b % CONNECTIONS.len() as u64) as usize
        };
        let after_bytes = if kind < LIES.len() { 0 } else { (b >> 8) % MOST_BYTES };
        Self { kind, is_network, after_bytes }
    }

    fn side(&self) -> &'static str {
        if self.is_network { "netsim" } else { "robotsim" }
    }

    /// Starts the simulator.
    pub(super) fn start(&self) -> anyhow::Result<RunningPeer> {
        let (url, server) = match LIES.get(self.kind) {
            Some((_, fault)) if self.is_network => (Faulty::network(*fault).url, None),
            Some((_, fault)) => (Faulty::robots(*fault).url, None),
            None => {
                let (_, what) = CONNECTIONS[self.kind - LIES.len()];
                let server = Server::start(self.side(), &[])?;
                let proxy = Proxy::start(&server.url, Some((what, self.after_bytes)))?;
                (proxy.url, Some(server))
            }
        };
        Ok(RunningPeer { arguments: vec![format!("--{}", self.side()), url], _server: server })
    }
}

impl fmt::Display for PeerFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lies = LIES.iter().map(|(name, _)| name);
        let mut names = lies.chain(CONNECTIONS.iter().map(|(name, _)| name));
        let name = names.nth(self.kind).copied().unwrap_or_default();
        write!(f, "{} {name} {}", self.side(), self.after_bytes)
    }
}

impl FromStr for PeerFault {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let words: Vec<&str> = text.split(' ').collect();
        let [side, name, bytes] = words[..] else { bail!("{text}: has not three words") };
        let lies = LIES.iter().map(|(name, _)| name);
        let mut names = lies.chain(CONNECTIONS.iter().map(|(name, _)| name));
        let kind = names.position(|known| *known == name);
        let kind = kind.with_context(|| format!("{name} is no fault of a simulator"))?;
        Ok(Self { kind, is_network: side == "netsim", after_bytes: bytes.parse()? })
    }
}
