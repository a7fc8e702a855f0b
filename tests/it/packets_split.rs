//! Where the error of a network comes from: robots, radio or protocol. What is measured is made by the running simulation under
//! another seed, with a fault in one of the three: places from where the run's robots went, links by `simulate`, packets by
//! the run.

use diagnose::Unobserved;
use diagnose::simulate::simulate;
use experiment::{Overrides, read};
use measure::config::Compared;
use measure::memory::MemoryBudget;
use measure::packets;
use measure::table::DataTable;
use network::error_split::NetworkErrorSplit;
use network::resimulate::Resimulation;
use network::tracks::Tracks;
use network::{ComparisonOptions, PacketRequest, Worded};
use proto::types::AgentStates;
use serde_json::Value;
use std::path::Path;
use tests::reporting::rendezvous;
use tests::{folder, orchestrator, run, said};

/// The network without a fault.
fn model() -> String {
    let network = rendezvous("kind = \"disc\"\ndensity_per_m2 = 0.0004\n", "");
    format!("{network}\n[output]\nlinks = \"none\"\nreport = false\n")
}

/// What a network with a fault left, split by the model without it.
fn parts(fault: &str) -> Worded<NetworkErrorSplit> {
    let dir = folder();
    let text = format!("{}\n{fault}\n", model());
    let truth = dir.path().join("truth.toml");
    std::fs::write(&truth, &text).unwrap();
    // The same robots; the network under another seed.
    let out = run(&truth, dir.path(), &[]);
    let tracks = Tracks::read(&out, MemoryBudget::default()).unwrap();
    let links = links(&tracks, &truth, text);
    let plan = read(Path::new("model.toml"), model(), &Overrides::default()).unwrap();
    let table = DataTable::read(&out.join("packets.parquet"), MemoryBudget::default()).unwrap();
    let measured = packets::read(&table).unwrap().packets;
    let resimulation = Resimulation::new(plan, Some(tracks), &measured).unwrap();
    let config = Compared::of_text(Path::new("model.toml"), model(), &[]).unwrap();
    let asked = ComparisonOptions { seeds: 99, ..ComparisonOptions::default() };
    let request = PacketRequest::new(resimulation, measured, asked);
    network::split(&request, &config, &links, &Unobserved).unwrap()
}

/// Links between all pairs, 20 frames a minute, as the radio of a configuration would have measured them along tracks.
fn links(tracks: &Tracks, path: &Path, text: String) -> DataTable {
    let names = [
        "time_s", "tx", "rx", "tx_x_m", "tx_y_m", "tx_z_m", "rx_x_m", "rx_y_m", "rx_z_m", "frames",
        "pdr", "rssi_dbm",
    ];
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
    for minute in 0..30 {
        let time_s = 60.0 * f64::from(minute);
        let mut at = AgentStates::at_origin(8);
        tracks.place(time_s, &mut at);
        for (tx, rx) in (0..8).flat_map(|tx| (0..8).map(move |rx| (tx, rx))) {
            if tx == rx {
                continue;
            }
            let row = [
                time_s,
                tx as f64,
                rx as f64,
                at.x_m[tx],
                at.y_m[tx],
                1.0,
                at.x_m[rx],
                at.y_m[rx],
                1.0,
                20.0,
                0.5,
                -80.0 - tx as f64,
            ];
            columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        }
    }
    let like = DataTable::of_columns(names.map(str::to_owned).to_vec(), columns);
    let config = Compared::of_text(path, text, &[]).unwrap();
    let simulated = simulate(&config, &like, 77, Some(1e-3)).unwrap();
    DataTable::of_columns(simulated.names, simulated.columns)
}

/// The parts that are more than chance.
fn found(split: &NetworkErrorSplit) -> Vec<&'static str> {
    split.parts.iter().filter(|part| part.is_distinguishable).map(|part| part.part).collect()
}

#[test]
fn each_fault_goes_with_its_part_and_none_with_none() {
    for (fault, expected) in [
        ("", &[][..]),
        (
            "[[robotsim.dynamics.effect]]\nkind = \"quadratic-drag\"\ncoefficient_per_m = 30.0",
            &["robot"],
        ),
        ("[[netsim.phy.effect]]\nkind = \"system-gain\"\ngain_db = -8.0", &["radio"]),
        ("[[netsim.mac.effect]]\nkind = \"processing-delay\"\ndelay_s = 0.3", &["protocol"]),
    ] {
        let Worded { answer, text } = parts(fault);
        assert_eq!(found(&answer), expected, "{fault}\n{text}");
    }
}

#[test]
fn the_command_tells_the_parts_and_refuses_what_it_cannot_split() {
    let dir = folder();
    let config = dir.path().join("model.toml");
    std::fs::write(&config, model()).unwrap();
    let out = run(&config, dir.path(), &[]);
    let table = links(&Tracks::read(&out, MemoryBudget::default()).unwrap(), &config, model());
    let mut rows = table.names().join(",");
    for row in 0..table.n_rows() {
        let cells: Vec<String> = table
            .names()
            .iter()
            .map(|name| table.column(name).unwrap()[row])
            .map(|value| if value.is_nan() { String::new() } else { value.to_string() })
            .collect();
        rows += &format!("\n{}", cells.join(","));
    }
    std::fs::write(dir.path().join("links.csv"), rows).unwrap();
    let data = out.join("packets.parquet");
    let args = ["compare", "model.toml", "--data", data.to_str().unwrap(), "--links", "links.csv"];
    let places = ["--positions", out.to_str().unwrap(), "--seeds", "19", "--json", "s.json"];
    let output = orchestrator(&[&args[..], &places].concat(), dir.path());
    assert!(output.status.success(), "{}", said(&output));
    let json = std::fs::read_to_string(dir.path().join("s.json")).unwrap();
    let json: Value = serde_json::from_str(&json).unwrap();
    let split = &json["error_split"];
    assert_eq!(split["order"].as_array().unwrap(), &["robot", "radio", "protocol"]);
    assert_eq!(split["figures"].as_array().unwrap().len(), 11);
    let output = orchestrator(&args, dir.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("--positions"), "{}", said(&output));
}
