//! The network against measured packets. There is no other simulator of the whole protocol here: what is measured is made by
//! the running simulation itself, under other seeds, with an effect that the model lacks.

use experiment::{Overrides, load, read};
use measure::packets::MeasuredPacket;
use measure::table::DataTable;
use network::SeedComparison;
use network::resimulate::{Resimulation, exchanged};
use network::tracks::Tracks;
use proto_messages::v1;
use record::read::RunReader;
use record::result::ResultFolder;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::OnceLock;
use study::thresholds::CONSISTENCY_LEVEL;
use tests::reporting::sensors;
use tests::{folder, orchestrator, run, said};

/// A model over a campaign of half an hour.
pub(crate) fn resimulation(text: &str, tracks: Option<Tracks>) -> Resimulation {
    let plan = read(Path::new("model.toml"), text.to_owned(), &Overrides::default()).unwrap();
    Resimulation::new(plan, tracks, &[]).unwrap().extended_to(1800.0)
}

/// The sensors with further tables.
pub(crate) fn with(tables: &str) -> String {
    format!("{}\n{tables}", sensors())
}

/// Runs of the sensors under seeds 0 to 98, which several tests need.
fn sensor_runs() -> &'static [Vec<MeasuredPacket>] {
    static RUNS: OnceLock<Vec<Vec<MeasuredPacket>>> = OnceLock::new();
    RUNS.get_or_init(|| {
        let model = resimulation(&sensors(), None);
        model.packets(&model.network(), 0..99).unwrap()
    })
}

#[test]
fn a_run_of_the_model_itself_differs_from_it_as_often_as_said() {
    let model = resimulation(&sensors(), None);
    let runs = &sensor_runs()[..39];
    let n = 200;
    let others = model.packets(&model.network(), 1000..1000 + n).unwrap();
    let alarms = others
        .iter()
        .filter(|other| {
            SeedComparison::from_packets(other, runs, 0.0).placed.p_value <= CONSISTENCY_LEVEL
        })
        .count();
    // All are held against the same 39 seeds, so that they are not independent: of the p-values' own scatter (0.05 +- 0.034
    // for 39 seeds) four standard deviations.
    assert!(alarms <= 38, "{alarms} of {n}");
}

#[test]
fn effects_that_the_model_lacks_are_seen_in_the_figures_that_they_concern() {
    // As few runs as p-values of 1 % take.
    let runs = sensor_runs();
    for (effect, figures) in [
        (
            "mac.effect]]\nkind = \"processing-delay\"\ndelay_s = 0.5",
            &["latency_p10_s", "latency_per_hop_s"][..],
        ),
        (
            "mac.effect]]\nkind = \"ack-loss\"\nprobability = 0.5",
            // Joining is a handshake: motes are in the network later, and make fewer packets.
            &["packets", "join_p50_s", "delivery", "latency_p90_s", "latency_per_hop_s"],
        ),
        (
            "phy.effect]]\nkind = \"interference\"\ncentre_mhz = 2440.0\nwidth_mhz = 80.0\nduty = 0.5",
            &["join_p50_s", "delivery", "packets", "latency_p90_s", "latency_per_hop_s"],
        ),
    ] {
        let truth = resimulation(&with(&format!("[[netsim.{effect}")), None);
        let measured = truth.packets(&truth.network(), 1000..1001).unwrap().remove(0);
        let among = SeedComparison::from_packets(&measured, runs, 0.0);
        assert!(among.placed.p_value <= 0.01, "{effect}: {}", among.placed.p_value);
        let kpis = network::kpis::KPIS;
        let furthest = (0..kpis.len())
            .filter_map(|k| Some((among.placed.figures[k]?.z, kpis[k].name)))
            .max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
            .unwrap();
        assert!(figures.contains(&furthest.1), "{effect}: {furthest:?}");
        // Less arrives, and later.
        let falls = ["delivery", "packets"].contains(&furthest.1);
        assert_eq!(falls, furthest.0 < 0.0, "{effect}: {furthest:?}");
    }
}

#[test]
fn measured_places_are_where_motes_stand() {
    let model = resimulation(&sensors(), None);
    let verdict_with = |spacing_m: f64| {
        let mut text = "time_s,agent,x_m,y_m\n".to_owned();
        for agent in 0..8 {
            writeln!(text, "0,{agent},{},0", f64::from(agent) * spacing_m).unwrap();
        }
        let table = DataTable::of_csv(Path::new("p.csv"), text.as_bytes()).unwrap();
        model.with_tracks(Tracks::from_table(&table).unwrap())
    };
    let made = |resimulation: &Resimulation| {
        resimulation.packets(&resimulation.network(), 0..4).unwrap().concat().len()
    };
    assert!(0 < made(&verdict_with(0.5)));
    // Out of each other's reach nobody ever joins, so that there is nothing to send.
    assert_eq!(made(&verdict_with(1e5)), 0);
}

/// Robots that act on what they hear, without protocols, and one whose radio fails.
const FLOCK: &str = r#"
[experiment]
name = "flock"
seed = 5
duration_s = 6.0
agents = 6

[robotsim.scenario]
kind = "line"
spacing_m = 4.0

[robotsim.controller]
kind = "flocking"
flock_radius_m = 20.0

[netsim.phy]
propagation = "log-distance"
exponent = 3.2

[[timeline]]
at_s = 2.0
order = "kill"
motes = [3]
"#;

/// Runs of the processes, and the same experiments simulated again in this process: everything that was exchanged, message by
/// message as bytes, and the digest of each step.
#[test]
fn a_run_and_its_resimulation_under_the_same_seed_are_the_same_bytes() {
    let coupled = |coupling: &str| {
        sensors()
            .replace("duration_s = 1800.0", "duration_s = 90.0")
            .replace("seed = 1\n", &format!("seed = 1\ncoupling = {coupling:?}\n"))
    };
    for (text, is_heard) in
        [(coupled("sequential"), false), (coupled("parallel"), false), (FLOCK.to_owned(), true)]
    {
        let dir = folder();
        let config = dir.path().join("model.toml");
        std::fs::write(&config, &text).unwrap();
        let mut recorded =
            RunReader::of(&ResultFolder::unchecked(&run(&config, dir.path(), &[]))).unwrap();
        let plan = load(&config, &Overrides::default()).unwrap();
        let mut configured = recorded.configured().unwrap().clone();
        // Asked of other processes alone: within one there is nothing to compare.
        assert!(configured.robot_request.full_digest && configured.net_request.full_digest);
        configured.robot_request.full_digest = false;
        configured.net_request.full_digest = false;
        let (mut n_steps, mut n_delivered) = (0, 0);
        exchanged(
            &plan,
            &mut |again| {
                let robots = (
                    v1::RobotSimServiceConfigureRequest::from(&again.robots_request),
                    v1::RobotSimServiceConfigureResponse::from(&again.robots_start),
                );
                let network = (
                    v1::NetSimServiceConfigureRequest::from(&again.network_request),
                    v1::NetSimServiceConfigureResponse::from(&again.network_start),
                );
                let of_run = &configured;
                assert_eq!(bytes(&robots.0), bytes(&of_run.robot_request));
                assert_eq!(bytes(&robots.1), bytes(&of_run.robot_response));
                assert_eq!(bytes(&network.0), bytes(&of_run.net_request));
                assert_eq!(bytes(&network.1), bytes(&of_run.net_response));
            },
            &mut |again| {
                let step = again.outcome.step;
                let of_run = recorded.next_step().unwrap().expect("as many steps");
                let robots = v1::RobotSimServiceStepResponse::from((*again.outcome.robots).clone());
                assert_eq!(bytes(&robots), bytes(&of_run.robots), "step {step}");
                let network = v1::NetSimServiceStepResponse::from((*again.outcome.network).clone());
                assert_eq!(bytes(&network), bytes(&of_run.net), "step {step}");
                let commands: Vec<v1::MoteCommand> =
                    again.commands.iter().cloned().map(Into::into).collect();
                assert_eq!(commands, of_run.commands, "step {step}");
                assert_eq!(again.outcome.digest()[..], of_run.barrier.digest[..], "step {step}");
                n_steps += 1;
                n_delivered += again.outcome.network.deliveries.n_deliveries();
            },
        )
        .unwrap();
        assert_eq!(recorded.next_step().unwrap(), None);
        // It is not that nothing was compared.
        assert!(0 < n_steps && (0 < n_delivered) == is_heard, "{text}");
    }
}

fn bytes(message: &impl prost::Message) -> Vec<u8> {
    message.encode_to_vec()
}

#[test]
fn a_recorded_run_agrees_with_its_resimulations() {
    let dir = folder();
    let config = dir.path().join("model.toml");
    std::fs::write(&config, sensors()).unwrap();
    let out = run(&config, dir.path(), &[]);
    let data = out.join("packets.parquet");
    let (data, config) = (data.to_str().unwrap(), config.to_str().unwrap());
    let args = ["compare", config, "--data", data, "--json", "c.json", "--report", "c.html"];
    let output = orchestrator(&args, dir.path());
    assert!(output.status.success(), "{}", said(&output));
    let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    let found: Value = serde_json::from_str(&read("c.json")).unwrap();
    assert_eq!((&found["schema"], &found["kind"]), (&"compare/1".into(), &"network".into()));
    assert_eq!(found["verdict"], "agrees", "{found:#}");
    assert_eq!(found["rows"], found["used"]);
    assert_eq!(found["motes"].as_array().unwrap().len(), 7);
    for (name, interval) in found["intervals"].as_object().unwrap() {
        let [low, high] = [0, 1].map(|k| interval[k].as_f64().unwrap());
        assert!(low <= high, "{name}");
    }
    let page = read("c.html");
    assert!(page.contains("Delivery by mote") && page.contains("latency_p50_s"));
    assert!(!tests::without_scripts(&page).contains("NaN"));
    // Where the run went, as measured places: the same.
    let places = out.to_str().unwrap();
    let args = ["compare", config, "--data", data, "--positions", places, "--json", "d.json"];
    assert!(orchestrator(&args, dir.path()).status.success());
    let again: Value = serde_json::from_str(&read("d.json")).unwrap();
    assert_eq!(again["kpis"], found["kpis"]);
    // Under another seed the network has other luck, and the measurement stays what it is.
    let other = [&args[..7], &["e.json", "--seed", "2"]].concat();
    assert!(orchestrator(&other, dir.path()).status.success());
    let other: Value = serde_json::from_str(&read("e.json")).unwrap();
    let first_kpi = |answer: &Value, what: &str| answer["kpis"][0][what].clone();
    assert_eq!(first_kpi(&other, "measured"), first_kpi(&again, "measured"));
    assert_ne!(first_kpi(&other, "model"), first_kpi(&again, "model"));
    // With an effect that the run did not have it is another network.
    let wrong = dir.path().join("wrong.toml");
    let effect = "[[netsim.mac.effect]]\nkind = \"processing-delay\"\ndelay_s = 1.0";
    std::fs::write(&wrong, with(effect)).unwrap();
    let output = orchestrator(&["compare", wrong.to_str().unwrap(), "--data", data], dir.path());
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("are inconsistent with the model"), "{text}");
}

#[test]
fn what_cannot_be_simulated_again_is_refused_with_the_reason() {
    let dir = folder();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("model.toml", &sensors());
    write("plain.toml", &sensors().replace("mode = \"6tisch\"", ""));
    let mut rows = "time_s,source,destination,received_s\n".to_owned();
    for k in 0..40 {
        writeln!(rows, "{k},{},0,{k}.5", 1 + k % 7).unwrap();
    }
    write("good.csv", &rows);
    write("far.csv", &rows.replace(",7,0,", ",17,0,"));
    write("some.csv", "time_s,agent,x_m,y_m\n0,0,0,0\n0,1,1,0\n");
    for (args, part) in [
        (&["model.toml", "--data", "far.csv"][..], "mention mote 17"),
        (&["model.toml", "--data", "good.csv", "--positions", "some.csv"], "agents 2, 3, 4"),
        (&["model.toml", "--data", "good.csv", "--split", "time"], "--split time"),
        (&["plain.toml", "--data", "good.csv"], "6tisch"),
    ] {
        let output = orchestrator(&[&["compare"], args].concat(), dir.path());
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", said(&output));
        assert!(said(&output).contains(part), "{args:?}: {}", said(&output));
    }
}
