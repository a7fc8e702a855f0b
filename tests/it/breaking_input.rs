//! Input that once made a reader abort, panic, hang or take all memory is refused in words, or used with a warning.

use experiment::Overrides;
use measure::memory::MemoryBudget;
use measure::table::DataTable;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use study::choices::Choices;
use tests::campaign::{Campaign, Layout};
use tests::fuzz::corpus;
use tests::{folder, orchestrator, repository, said};

/// Verifies the folder of a run with this recording: what is wrong with it.
fn verified(recording: &[u8]) -> Vec<String> {
    let folder = folder();
    for name in ["summary.json", "provenance.json", "config.toml"] {
        let from = repository().join("fuzz/run").join(name);
        std::fs::copy(from, folder.path().join(name)).unwrap();
    }
    std::fs::write(folder.path().join("run.mcap"), recording).unwrap();
    record::verify::verify(folder.path()).unwrap().problems
}

/// Where the records of an MCAP file begin, of one kind. A record is its kind, its length (8 bytes) and its content.
fn records(mcap: &[u8], kind: u8) -> Vec<usize> {
    let mut found = Vec::new();
    let mut at = 8;
    while at + 9 < mcap.len() {
        if mcap[at] == kind {
            found.push(at);
        }
        at += 9 + u64::from_le_bytes(mcap[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    found
}

#[test]
fn a_flipped_bit_in_a_chunk_length_is_named_as_damage() {
    let good = std::fs::read(corpus("verify").join("run")).unwrap();
    assert_eq!(verified(&good), [""; 0]);
    let chunk = records(&good, 6)[0];
    // The length of the record, of its decompressed content, of the compression's name, and of its compressed content.
    let name_length = 4;
    let fields = [(1, 8), (25, 8), (37, 4), (41 + name_length, 8)];
    for (field, length) in fields {
        for bit in (0..8 * length).step_by(5) {
            let mut damaged = good.clone();
            damaged[chunk + field + bit / 8] ^= 1 << (bit % 8);
            let problems = verified(&damaged).join("\n");
            assert!(problems.contains("damaged or truncated"), "{field}, bit {bit}: {problems}");
        }
    }
}

/// A good campaign of links with another value in a column of one row, the header being row 0.
fn links_with(column: &str, row: usize, value: &str) -> DataTable {
    let csv = Campaign::link(3, &Layout::standard(), &[], 2000).csv;
    let mut rows: Vec<Vec<String>> =
        csv.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect();
    let column = rows[0].iter().position(|name| name == column).unwrap();
    rows[row][column] = value.to_owned();
    let text: Vec<String> = rows.into_iter().map(|fields| fields.join(",")).collect();
    DataTable::of_csv(Path::new("data.csv"), text.join("\n").as_bytes()).unwrap()
}

fn warnings(table: &DataTable) -> String {
    check::data(None, table, &Choices::default()).unwrap().account.warnings.join("\n")
}

#[test]
fn a_temperature_of_1e308_and_an_antenna_below_the_ground_are_warned_of() {
    let warned = warnings(&links_with("temperature_c", 7, "1e308"));
    assert!(
        warned.contains(
            "temperature_c is 1e308 on line 8, but must be from -273.15 to 2000; rows that are not used for that: 1"
        ),
        "{warned}"
    );
    let warned = warnings(&links_with("tx_z_m", 7, "-5"));
    assert!(warned.contains("tx_z_m is -5 on line 8, but must be at least 0"), "{warned}");
}

#[test]
fn a_position_of_1e160_is_rejected_with_its_line() {
    let mut csv = "time_s,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps\n".to_owned();
    let mut x_m = 0.0;
    for step in 0..400 {
        let speed_mps = if step / 50 % 2 == 0 { 1.0 } else { -1.0 };
        let shown_m = if step == 17 { 1e160 } else { x_m };
        writeln!(csv, "{:.1},0,{shown_m:e},0,{speed_mps},0", f64::from(step) * 0.1).unwrap();
        x_m += 0.1 * speed_mps;
    }
    let table = DataTable::of_csv(Path::new("data.csv"), csv.as_bytes()).unwrap();
    let account = check::data(None, &table, &Choices::default()).unwrap().account;
    assert_eq!((account.rejected[0].rows, account.rejected[0].first_line), (1, 19));
    assert!(account.rejected[0].reason.contains("x_m is not from -10000000"));
}

#[test]
fn a_gzip_of_zeros_is_refused_before_it_fills_memory() {
    let folder = folder();
    let path = folder.path().join("zeros.csv.gz");
    let mut encoder = flate2::write::GzEncoder::new(
        std::fs::File::create(&path).unwrap(),
        flate2::Compression::fast(),
    );
    for _ in 0..64 {
        encoder.write_all(&vec![0; 1 << 20]).unwrap();
    }
    encoder.finish().unwrap();
    let error = DataTable::read(&path, MemoryBudget::default()).unwrap_err().to_string();
    assert!(error.contains("line 1: the length of a line (bytes) is more than 1048576"), "{error}");
}

fn refusal(text: String) -> String {
    let refused = experiment::read(Path::new("x.toml"), text, &Overrides::default());
    refused.unwrap_err().to_string()
}

#[test]
fn forty_thousand_unknown_keys_are_refused_at_once() {
    let keys: String = (0..40_000).map(|key| format!("key_{key} = 1\n")).collect();
    let said = refusal(format!("[netsim.phy]\n{keys}"));
    assert!(said.contains("the number of keys in one table is 40000; at most 2000"), "{said}");
    let entries: String = (0..40_000).map(|key| format!("[[timeline]]\nkey_{key} = 1\n")).collect();
    let said = refusal(entries);
    assert!(said.contains("more problems are not listed") && said.len() < 100_000, "{said}");
}

#[test]
fn a_terrain_of_3000_by_3000_is_refused_before_it_is_parsed() {
    let row = format!("[{}]", vec!["1.5"; 3000].join(","));
    let heights = vec![row; 3000].join(",");
    let said = refusal(format!(
        "[site.terrain]\norigin_m = [0, 0]\nspacing_m = 1\nheight_m = [{heights}]\n"
    ));
    assert!(said.contains("the number of values in a configuration is 900"), "{said}");
    assert!(said.contains("at most 2000000 is read"), "{said}");
}

#[test]
fn a_formula_that_is_never_finite_and_a_parameter_with_the_name_of_a_column_are_refused() {
    let folder = folder();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("model.toml", "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\n");
    write("data.csv", &Campaign::link(3, &Layout::standard(), &[], 300).csv);
    let extend = |formula: &[&str]| {
        let arguments = ["extend", "model.toml", "--data", "data.csv", "--output", "better.toml"];
        let output = orchestrator(&[&arguments, formula].concat(), folder.path());
        assert!(!output.status.success(), "{}", said(&output));
        assert!(!folder.path().join("better.toml").exists());
        said(&output)
    };
    let never = extend(&["--formula", "1/0"]);
    assert!(never.contains("is not a finite number in any of"), "{never}");
    let shadow = extend(&["--formula", "temperature_c * 2", "--parameter", "temperature_c=1:0:2"]);
    assert!(shadow.contains("the parameter temperature_c has the name of a column"), "{shadow}");
}

#[test]
fn the_documentation_lists_every_bound() {
    let page = std::fs::read_to_string(repository().join("docs/outputs.md")).unwrap();
    for bound in proto::bounds::ALL {
        let row = format!("| {} | {} |", bound.what, bound.most);
        assert!(page.contains(&row), "docs/outputs.md has no row {row}");
    }
}

#[test]
fn figures_that_the_model_leaves_undefined_are_called_so() {
    let folder = tests::folder();
    let root = repository();
    std::fs::copy(root.join("fuzz/corpus/csv/packets"), folder.path().join("packets.csv")).unwrap();
    let config = root.join("configs/sensors-msf.toml");
    let arguments = ["compare", config.to_str().unwrap(), "--data", "packets.csv", "--seeds", "39"];
    let output = orchestrator(&arguments, folder.path());
    let said = said(&output);
    assert!(output.status.success(), "{said}");
    assert!(!said.contains("NaN") && said.contains("undefined"), "{said}");
    assert!(!said.contains("the delivery ratio of motes"), "{said}");
}

#[test]
fn a_network_whose_batteries_are_empty_has_not_formed() {
    let folder = tests::folder();
    let config = repository().join("configs/sensors-msf.toml");
    let sets = [
        "netsim.energy.battery_mah=0.01",
        "netsim.energy.deaths=true",
        "experiment.formation_limit_s=60",
    ];
    let mut arguments = vec!["run", config.to_str().unwrap()];
    arguments.extend(sets.iter().flat_map(|set| ["--set", set]));
    let output = orchestrator(&arguments, folder.path());
    let said = said(&output);
    assert!(!output.status.success(), "{said}");
    assert!(said.contains("the network had not formed after 60 s"), "{said}");
    assert!(said.contains("has an empty battery: 1, 2, 3"), "{said}");
}
