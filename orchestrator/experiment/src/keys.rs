//! The keys of `[experiment]`.

use super::control::Period;
use super::{Start, Transport};
use proto::config::{Choice, FilePath, Section};

/// Keys of `[experiment]` on which no result depends.
pub const WITHOUT_EFFECT: [&str; 7] = [
    "transport",
    "tls",
    "step_deadline_s",
    "checkpoint_every_s",
    "restarts",
    "reconnect_limit_s",
    // What the file holds has an effect: warm_start_sha256.
    "warm_start",
];

/// The experiment: its name, seed, duration and number of robots, and how the two simulators are coupled.
#[derive(Section)]
pub struct ExperimentKeys {
    /// Name of the experiment and of the folder with its results: letters, digits, '-', '_' and '.'.
    #[key(required)]
    pub(super) name: Option<String>,
    /// Seed of all random draws. The same seed and configuration give the same recording.
    pub(super) seed: u64,
    /// Simulated time (s), from when the robots start. Rounded up to whole control periods.
    #[key(required, above = 0.0, most = 1e9)]
    pub(super) duration_s: Option<f64>,
    /// Number of robots, each with a radio.
    #[key(required, range = 1..=proto::side::MAX_AGENTS)]
    pub(super) agents: Option<usize>,
    /// How the two simulators are coupled.
    #[key(default = CouplingMode::Sequential)]
    pub(super) coupling: CouplingMode,
    /// The control period, in which robots act once: a slotframe, up to each delivered packet, { slots = n } or { rate_hz = r }.
    #[key(default = "slotframe")]
    pub(super) control_period: Period,
    /// When the robots start. Absent: when the network has formed, or at once if there is no network formation.
    pub(super) start: Option<Start>,
    /// Timeout of network formation (s of simulated time). If the network has not formed by then, the run fails and lists the missing
    /// motes with the reason.
    #[key(above = 0.0, most = 1e9, default = 3600.0)]
    pub(super) formation_limit_s: f64,
    /// Path of a formed network that murmuration run --save-formed wrote, relative to this file. The run starts from it instead of
    /// forming the network: positions, shadowing and clock rates are those of the file, all later random draws come from seed.
    pub(super) warm_start: Option<FilePath>,
    /// SHA-256 of the file of warm_start, in hexadecimal: the program refuses another file. A run from a formed network writes this key
    /// to its config.toml.
    pub(super) warm_start_sha256: Option<String>,
    /// Whether to end the run when the robots report their task complete.
    #[key(default = true)]
    pub(super) stop_when_complete: bool,
    /// Transport of the step requests. Results do not depend on it.
    #[key(default = Transport::Auto)]
    pub(super) transport: Transport,
    /// Timeout of one step (s of real time) for a simulator that is alive. A simulator that shows no sign of life is abandoned after
    /// about five seconds.
    #[key(range = 1.0..=86_400.0, default = 60.0)]
    pub(super) step_deadline_s: f64,
    /// Whether other programs may give orders to the simulators that the run starts; it prints where, and a token.
    pub(super) accept_commands: Option<bool>,
    /// Interval of checkpoints (s of real time); 0: none. After a failure the run continues from the latest one. Requires output.mcap.
    /// Results do not depend on it.
    #[key(range = 0.0..=1e6, default = 60.0)]
    pub(super) checkpoint_every_s: f64,
    /// How often a run continues from its latest checkpoint when a simulator died or was lost; 0: it fails instead.
    #[key(range = 0..=1000, default = 3)]
    pub(super) restarts: u64,
    /// How long to wait for a lost simulator on another host before the run fails (s of real time).
    #[key(range = 0.0..=86_400.0, default = 60.0)]
    pub(super) reconnect_limit_s: f64,
    /// Certificates for simulators on other hosts.
    pub(super) tls: Option<TlsKeys>,
}

/// How the two simulators take turns.
#[derive(Choice, Clone, Copy, PartialEq, Eq)]
pub(super) enum CouplingMode {
    /// Robots act on the messages received and move, then the network runs with their new positions.
    Sequential,
    /// Both simulators run at the same time, and robots receive messages one control period later.
    Parallel,
}

/// Certificates, as paths of PEM files.
#[derive(Section)]
pub(super) struct TlsKeys {
    /// Certificate authority that signed the simulators' certificates.
    #[key(required)]
    pub(super) ca: Option<FilePath>,
    /// Client certificate, for simulators that require one.
    pub(super) cert: Option<FilePath>,
    /// Private key of the client certificate.
    pub(super) key: Option<FilePath>,
}
