//! Configurations of networks whose motes report to a root over 6TiSCH. Several tests take such a network as the model, and a
//! run of it with a further effect as the measurement.

/// Eight sensors that report every 20 s for half an hour.
#[must_use]
pub fn sensors() -> String {
    sensors_of(8, 1800.0, 20.0)
}

/// Sensors on a disc that stay where they are, each reporting once per `period_s`.
#[must_use]
pub fn sensors_of(agents: u32, duration_s: f64, period_s: f64) -> String {
    let experiment = experiment("sensors", 1, agents, duration_s);
    let network = network("", period_s);
    format!(
        r#"
{experiment}
[robotsim.scenario]
kind = "disc"
density_per_m2 = 0.003

[robotsim.controller]
kind = "hold"

{network}"#
    )
}

/// Eight robots that come together within some minutes of half an hour, each reporting every 10 s. `scenario` holds the keys of
/// `[robotsim.scenario]`, `phy` further keys of `[netsim.phy]`: one a line.
#[must_use]
pub fn rendezvous(scenario: &str, phy: &str) -> String {
    let experiment = experiment("rendezvous", 3, 8, 1800.0);
    let network = network(phy, 10.0);
    format!(
        r#"
{experiment}
[robotsim]
knowledge = "truth"

[robotsim.scenario]
{scenario}
[robotsim.controller]
kind = "consensus"
gain_per_s = 0.001

{network}"#
    )
}

fn experiment(name: &str, seed: u64, agents: u32, duration_s: f64) -> String {
    format!(
        r#"[experiment]
name = "{name}"
seed = {seed}
duration_s = {duration_s:?}
agents = {agents}
start = "at-once"
control_period = {{ rate_hz = 1.0 }}
"#
    )
}

fn network(phy: &str, period_s: f64) -> String {
    format!(
        r#"[netsim]
mode = "6tisch"

[netsim.phy]
propagation = "log-distance"
exponent = 3.2
{phy}
[netsim.sf]
kind = "minimal"
slotframe_slots = 11

[netsim.swarm]
transport = "none"

[[netsim.app]]
kind = "periodic"
period_s = {period_s:?}
payload_bytes = 40
"#
    )
}
