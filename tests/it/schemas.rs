//! Answers satisfy the JSON Schemas that are published for them.

use serde_json::{Map, Value};
use std::collections::BTreeSet;
use std::path::Path;
use tests::campaign::{Campaign, Drive, Fleet, Hidden, Layout, RobotHidden, Size};
use tests::reporting::sensors_of;
use tests::{Server, folder, orchestrator, said};

const FLOCK: &str = r#"
[experiment]
name = "flock"
seed = 4
duration_s = 3.0
agents = 5

[robotsim.scenario]
kind = "line"
spacing_m = 4.0

[robotsim.controller]
kind = "flocking"
flock_radius_m = 20.0

[netsim.phy]
propagation = "log-distance"
exponent = 3.2
"#;

/// Link samples as they are, joined onto themselves in time.
const LINKS: &str = r#"
table = "links"
[[input]]
files = "data.csv"
columns = { time_s = "time_s", tx = "tx", rx = "rx", rssi_dbm = "rssi_dbm", received = "received" }
[[input]]
files = "data.csv"
columns = { time_s = "time_s" }
covariates = { temperature_c = "temperature_c" }
"#;

/// What does not satisfy a schema of the kind that is published: its forms, types, constants, keys and items.
struct Checked<'a> {
    definitions: &'a Map<String, Value>,
    problems: Vec<String>,
}

impl Checked<'_> {
    fn is_valid(&self, schema: &Value, value: &Value) -> bool {
        let mut inner = Checked { definitions: self.definitions, problems: Vec::new() };
        inner.check(schema, value, "");
        inner.problems.is_empty()
    }

    fn check(&mut self, schema: &Value, value: &Value, at: &str) {
        if let Some(name) = schema["$ref"].as_str() {
            let definition = &self.definitions[name.strip_prefix("#/$defs/").unwrap()];
            self.check(definition, value, at);
        }
        let mut problem = |text: String| self.problems.push(format!("{at}: {text}"));
        let is_of = |kind: &Value| match kind.as_str().unwrap() {
            "null" => value.is_null(),
            "boolean" => value.is_boolean(),
            "integer" => value.is_u64() || value.is_i64(),
            "number" => value.is_number(),
            "string" => value.is_string(),
            "array" => value.is_array(),
            "object" => value.is_object(),
            other => panic!("no type of JSON: {other}"),
        };
        match &schema["type"] {
            Value::Array(kinds) if !kinds.iter().any(is_of) => {
                problem(format!("{value} is none of {kinds:?}"));
            }
            kind @ Value::String(_) if !is_of(kind) => problem(format!("{value} is no {kind}")),
            _ => {}
        }
        if let Some(constant) = schema.get("const").filter(|constant| *constant != value) {
            problem(format!("is {value}, not {constant}"));
        }
        if let Some(list) = schema["enum"].as_array().filter(|list| !list.contains(value)) {
            problem(format!("{value} is none of {list:?}"));
        }
        for forms in ["anyOf", "oneOf"].iter().filter_map(|form| schema[form].as_array()) {
            if !forms.iter().any(|form| self.is_valid(form, value)) {
                self.problems.push(format!("{at}: has none of its {} forms", forms.len()));
            }
        }
        if let Some(object) = value.as_object() {
            self.object(schema, object, at);
        }
        let items = value.as_array().into_iter().flatten().enumerate();
        for (k, item) in items.filter(|_| schema.get("items").is_some()) {
            self.check(&schema["items"], item, &format!("{at}[{k}]"));
        }
    }

    fn object(&mut self, schema: &Value, object: &Map<String, Value>, at: &str) {
        let required = schema["required"].as_array().into_iter().flatten();
        for key in required.filter_map(Value::as_str).filter(|key| !object.contains_key(*key)) {
            self.problems.push(format!("{at}: {key} is missing"));
        }
        for (key, value) in object {
            let known = schema["properties"].get(key);
            if let Some(schema) = known.or_else(|| schema.get("additionalProperties")) {
                self.check(schema, value, &format!("{at}.{key}"));
            }
        }
    }
}

fn schema(name: &str) -> Value {
    let output = orchestrator(&["schema", "--of", name], Path::new("."));
    assert!(output.status.success(), "{}", said(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The form of an answer that it satisfies.
fn assert_satisfied(name: &str, answer: &Value) {
    let schema = schema(name);
    let mut checked =
        Checked { definitions: schema["$defs"].as_object().unwrap(), problems: Vec::new() };
    let forms = schema["anyOf"].as_array().unwrap();
    if let Some(form) = forms.iter().find(|form| checked.is_valid(form, answer)) {
        // A key that the schema does not know would be valid, and undocumented.
        let form = form["$ref"].as_str().unwrap().strip_prefix("#/$defs/").unwrap();
        let form = &checked.definitions[form];
        if form.get("oneOf").or_else(|| form.get("anyOf")).is_none() {
            let known: BTreeSet<&String> = form["properties"].as_object().unwrap().keys().collect();
            let keys: BTreeSet<&String> = answer.as_object().unwrap().keys().collect();
            assert!(keys.is_subset(&known), "{name}: {keys:?}, {known:?}");
        }
        return;
    }
    for form in forms {
        checked.check(form, answer, name);
    }
    panic!("{:#?}", checked.problems);
}

/// Runs a command that writes an answer, and checks the answer.
fn answered(folder: &Path, name: &str, args: &[&str]) -> Value {
    let output = orchestrator(&[&[name][..], args, &["--json", "found.json"]].concat(), folder);
    assert!(output.status.success(), "{name}: {}", said(&output));
    let text = std::fs::read_to_string(folder.join("found.json")).unwrap();
    let answer = serde_json::from_str(&text).unwrap();
    assert_satisfied(name, &answer);
    answer
}

#[test]
fn answers_about_links_and_robots_satisfy_their_schemas() {
    let links = Campaign::link(1, &Layout::standard(), &[(Hidden::Temperature, Size::Clear)], 600);
    let fleet = Fleet::standard(Drive::Velocity);
    let robots = Campaign::robots(1, &fleet, &[(RobotHidden::Slip, Size::Clear)], 1500);
    for (campaign, effect) in [(links, "temperature"), (robots, "slip")] {
        let dir = folder();
        std::fs::write(dir.path().join("model.toml"), &campaign.config_toml).unwrap();
        std::fs::write(dir.path().join("data.csv"), &campaign.csv).unwrap();
        let answer = |name: &str, args: &[&str]| answered(dir.path(), name, args);
        answer("check", &["--data", "data.csv"]);
        if effect == "temperature" {
            std::fs::write(dir.path().join("links.toml"), LINKS).unwrap();
            answer("convert", &["links.toml"]);
        }
        answer("compare", &["model.toml", "--data", "data.csv"]);
        let found = answer("diagnose", &["model.toml", "--data", "data.csv"]);
        assert_eq!(found["missing"][0], effect, "{found:#}");
        let effect = ["--effect", effect];
        let added = ["model.toml", "--data", "data.csv", "--output", "better.toml"];
        answer("extend", &[&added[..], &effect].concat());
        answer("simulate", &["model.toml", "--like", "data.csv", "--output", "made.csv"]);
        let sizes = ["model.toml", "--like", "data.csv", "--campaigns", "2"];
        answer("power", &[&sizes[..], &effect].concat());
    }
}

#[test]
fn answers_about_runs_and_networks_satisfy_their_schemas() {
    let dir = folder();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("flock.toml", FLOCK);
    write("sensors.toml", &sensors_of(4, 900.0, 10.0));
    let varied = "[sweep]\nseeds = 2\n[sweep.vary]\nnetsim.phy.exponent = [3.0, 3.4]\n";
    write("sweep.toml", &format!("{FLOCK}\n{varied}"));
    let answer = |name: &str, args: &[&str]| answered(dir.path(), name, args);
    answer("check", &["flock.toml"]);
    answer("check", &["sweep.toml"]);
    answer("run", &["flock.toml"]);
    let summary = answer("run", &["sensors.toml"]);
    assert!(summary["kpis"]["delivery"]["ratio"].is_number(), "{summary:#}");
    answer("verify", &["runs/sensors"]);
    answer("sweep", &["sweep.toml", "--out", "sweeps"]);
    answer("compare-runs", &["runs/flock", "runs/flock"]);
    let packets = ["sensors.toml", "--data", "runs/sensors/packets.parquet", "--seeds", "19"];
    answer("compare", &packets);
    let effect = ["--effect", "processing-delay", "--output", "more.toml"];
    answer("extend", &[&packets[..], &effect].concat());
    let task = ["flock.toml", "--data", "runs/flock", "--heard", "runs/flock", "--seeds", "99"];
    answer("compare", &task);
}

#[test]
fn answers_about_effects_metrics_speed_and_the_contract_satisfy_their_schemas() {
    let dir = folder();
    let answer = |name: &str, args: &[&str]| answered(dir.path(), name, args);
    answer("effects", &[]);
    answer("effects", &["two-ray-ground"]);
    answer("metrics", &["--all"]);
    answer("metrics", &["pdr"]);
    answer("bench", &["--table", "propagation", "--agents", "5", "--steps", "20"]);
    let server = Server::start("netsim", &[]).unwrap();
    std::fs::write(
        dir.path().join("side.toml"),
        "[phy]\npropagation = \"experimental-randomness\"\n",
    )
    .unwrap();
    answer("conformance", &["netsim", &server.url, "--config", "side.toml"]);
}

#[test]
fn an_answer_of_another_form_is_no_answer() {
    // Guards the tests above: a schema that allows everything would pass them.
    let schema = schema("power");
    let checked =
        Checked { definitions: schema["$defs"].as_object().unwrap(), problems: Vec::new() };
    let form = &schema["anyOf"][0];
    assert!(!checked.is_valid(form, &serde_json::json!({ "schema": "power/1" })));
    let output = orchestrator(&["schema", "--of", "diagnosis"], Path::new("."));
    assert_eq!(output.status.code(), Some(2));
    let text = said(&output);
    assert!(text.contains("diagnose") && text.contains("compare-runs"), "{text}");
}
