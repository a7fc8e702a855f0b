//! Measurements that something is wrong with: refused in words, or used with a warning that says what was seen and what it does
//! to the answer.

use check::{DataCheck, text};
use measure::config::Compared;
use measure::table::DataTable;
use std::path::Path;
use study::choices::Choices;
use study::open::{self, OpenError};
use tests::campaign::{Campaign, Layout};

/// A file as rows of fields.
#[derive(Clone)]
struct Sheet {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Sheet {
    fn from_csv(csv: &str) -> Self {
        let mut lines =
            csv.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        Self { names: lines.next().unwrap(), rows: lines.collect() }
    }

    /// A good campaign of links.
    fn links() -> Self {
        Self::from_csv(&Campaign::link(3, &Layout::standard(), &[], 2000).csv)
    }

    /// A good campaign of robots.
    fn robots() -> Self {
        let mut csv = "time_s,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps\n".to_owned();
        for agent in 0..3 {
            let mut x_m = 0.0;
            for step in 0..400 {
                let speed_mps = if step / 50 % 2 == 0 { 1.0 } else { -1.0 };
                csv += &format!("{},{agent},{x_m},{agent},{speed_mps},0\n", f64::from(step) * 0.1);
                x_m += 0.1 * speed_mps;
            }
        }
        Self::from_csv(&csv)
    }

    fn column(&self, name: &str) -> usize {
        self.names.iter().position(|other| other == name).unwrap()
    }

    /// Changes numbers of a column; empty fields stay empty.
    fn change(mut self, name: &str, change: impl Fn(usize, f64) -> String) -> Self {
        let column = self.column(name);
        for (row, fields) in self.rows.iter_mut().enumerate() {
            if let Ok(number) = fields[column].parse() {
                fields[column] = change(row, number);
            }
        }
        self
    }

    fn exchange(mut self, a: &str, b: &str, which: impl Fn(usize) -> bool) -> Self {
        let (a, b) = (self.column(a), self.column(b));
        for (row, fields) in self.rows.iter_mut().enumerate() {
            if which(row) {
                fields.swap(a, b);
            }
        }
        self
    }

    fn keep(mut self, which: impl Fn(&Self, &[String]) -> bool) -> Self {
        let sheet = self.clone();
        self.rows.retain(|fields| which(&sheet, fields));
        self
    }

    fn table(&self) -> DataTable {
        let lines = [&self.names].into_iter().chain(&self.rows).map(|fields| fields.join(","));
        let csv = lines.collect::<Vec<_>>().join("\n");
        DataTable::of_csv(Path::new("data.csv"), csv.as_bytes()).unwrap()
    }

    fn check(&self) -> Result<DataCheck, OpenError> {
        check::data(None, &self.table(), &Choices::default())
    }

    fn warnings(&self) -> String {
        self.check().unwrap().account.warnings.join("\n")
    }

    fn refusal(&self) -> String {
        self.check().unwrap_err().to_string()
    }
}

#[test]
fn good_measurements_are_described_without_a_warning() {
    let checked = Sheet::links().check().unwrap();
    assert_eq!(checked.account.warnings, [""; 0]);
    let json = serde_json::to_value(&checked).unwrap();
    assert_eq!(json["kind"], "link");
    assert_eq!(json["motes"]["all"].as_array().unwrap().len(), 18);
    assert_eq!(json["motes"]["still"], 12);
    assert_eq!(json["links"]["pairs"], 153);
    assert!(text(&checked).contains("whole dB"), "{}", text(&checked));
    let lacking = json["not_testable"].as_array().unwrap();
    let walls = lacking.iter().find(|entry| entry["effect"] == "wall-attenuation").unwrap();
    assert!(walls["because"].as_str().unwrap().contains("needs walls"));
    assert!(json["testable"].as_array().unwrap().iter().any(|name| name == "temperature"));

    let checked = Sheet::robots().check().unwrap();
    let json = serde_json::to_value(&checked).unwrap();
    assert_eq!(json["kind"], "robot");
    assert_eq!(json["agents"].as_array().unwrap().len(), 3);
    assert!((json["spacing_s"].as_f64().unwrap() - 0.1).abs() < 1e-9);
    assert_eq!(checked.account.warnings, [""; 0]);
}

#[test]
fn odd_links_are_used_with_a_warning_that_says_what_it_does() {
    let good = Sheet::links;
    let numbers = |name: &'static str| {
        move |sheet: &Sheet, fields: &[String]| -> f64 {
            fields[sheet.column(name)].parse().unwrap_or(f64::NAN)
        }
    };
    let (tx, rx, received) = (numbers("tx"), numbers("rx"), numbers("received"));
    let is_heard = good().keep(|sheet, fields| received(sheet, fields) == 1.0);
    let mut twice = good();
    twice.rows.extend_from_within(..30);
    let shrunk = good().change("tx", |_, n| if n == 7.0 { "17".into() } else { n.to_string() });
    let called = |name: &String| name.replace("humidity_pct", "constant");
    let cases: [(&str, Sheet, &[&str]); 15] = [
        (
            "a column with a name that answers use",
            Sheet { names: good().names.iter().map(called).collect(), ..good() },
            &["the column constant is ignored", "rename the column"],
        ),
        (
            "some readings are positive",
            good().change(
                "rssi_dbm",
                |row, n| if row % 50 == 0 { "3".into() } else { n.to_string() },
            ),
            &["rssi_dbm is positive in", "bias means and noise"],
        ),
        (
            "headings in degrees",
            good().change("tx_heading_rad", |_, n| n.to_degrees().to_string()),
            &["tx_heading_rad reaches", "degrees", "cannot be tested"],
        ),
        (
            "times in milliseconds",
            good().change("time_s", |_, n| format!("{:.0}", n * 1000.0)),
            &["milliseconds", "by 1000"],
        ),
        (
            "a short campaign in milliseconds",
            good().change("time_s", |_, n| format!("{:.0}", n * 100.0)),
            &["milliseconds"],
        ),
        (
            "tx and rx exchanged in some rows",
            good().exchange("tx", "rx", |row| row % 10 == 0),
            &["in two places at the same time", "wrong"],
        ),
        (
            "ends exchanged throughout",
            ["x_m", "y_m", "z_m"].iter().fold(
                good().exchange("tx", "rx", |_| true),
                |sheet, part| {
                    sheet.exchange(&format!("tx_{part}"), &format!("rx_{part}"), |_| true)
                },
            ),
            &["several motes send", "attributed to the other"],
        ),
        ("rows twice", twice, &["30 rows are duplicates", "too narrow"]),
        (
            "a constant covariate",
            good().change("temperature_c", |_, _| "20".into()),
            &["temperature_c is 20 in every row"],
        ),
        (
            "one channel",
            good().change("channel", |_, _| "26".into()),
            &["channel is 26 in every row", "cannot be tested"],
        ),
        (
            "time runs backwards",
            Sheet { rows: good().rows.into_iter().rev().collect(), ..good() },
            &["time_s decreases"],
        ),
        ("all received", is_heard, &["every frame was received", "cannot be tested"]),
        (
            "a mote that never appears",
            shrunk.keep(|sheet, fields| {
                rx(sheet, fields) != 7.0 && tx(sheet, fields) != rx(sheet, fields)
            }),
            &["mote 7 without any row"],
        ),
        (
            "a mote that is deaf",
            good().keep(|sheet, fields| rx(sheet, fields) != 4.0 || received(sheet, fields) == 0.0),
            &["mote 4: never receives a frame"],
        ),
        (
            "a handful of pairs",
            good().keep(|sheet, fields| tx(sheet, fields) < 6.0 && rx(sheet, fields) < 6.0),
            &["only 15 pairs of nodes; at least 20", "path-loss-exponent"],
        ),
    ];
    for (name, sheet, parts) in cases {
        let warnings = sheet.warnings();
        for part in parts {
            assert!(warnings.contains(part), "{name}: {part:?} is not in {warnings:?}");
        }
    }
}

#[test]
fn links_that_carry_nothing_are_refused() {
    let good = Sheet::links;
    let cases: [(&str, Sheet, &[&str]); 6] = [
        ("positive", good().change("rssi_dbm", |_, n| (-n).to_string()), &["is positive in"]),
        ("stuck", good().change("rssi_dbm", |_, _| "-70".into()), &["-70 in all", "stuck"]),
        (
            "none received",
            good().change("received", |_, _| "0".into()).change("rssi_dbm", |_, _| String::new()),
            &["no frame was received", "to compare with"],
        ),
        (
            "infinities",
            good().change("rssi_dbm", |_, _| "inf".into()).change("time_s", |_, _| "nan".into()),
            &["time_s is not a finite number"],
        ),
        (
            "columns",
            Sheet {
                names: good().names.iter().map(|n| n.replace("rssi_dbm", "rssi_db")).collect(),
                ..good()
            },
            &["match no kind of measurements", "rssi_dbm (did you mean the column rssi_db?)"],
        ),
        (
            "empty",
            Sheet { rows: Vec::new(), ..good() },
            &["no frame was received in 0 usable rows"],
        ),
    ];
    for (name, sheet, parts) in cases {
        let refusal = sheet.refusal();
        for part in parts {
            assert!(refusal.contains(part), "{name}: {part:?} is not in {refusal:?}");
        }
    }
}

#[test]
fn odd_robots_are_used_with_a_warning_and_useless_ones_refused() {
    let good = Sheet::robots;
    let agent = |sheet: &Sheet, fields: &[String]| fields[sheet.column("agent")].clone();
    let jump = |row: usize, n: f64| if row == 77 { "900".into() } else { n.to_string() };
    let mut twice = good();
    twice.rows.extend_from_within(..30);
    let cases: [(&str, Sheet, &str); 6] = [
        ("jump", good().change("x_m", jump), "positions jump"),
        ("twice", twice, "30 rows are duplicates"),
        ("missing", good().keep(|sheet, row| agent(sheet, row) != "1"), "robots 1 never appear"),
        (
            "still",
            good().change("x_m", |row, n| if row < 400 { "5".into() } else { n.to_string() }),
            "robots 0 never move",
        ),
        ("short", Sheet { rows: good().rows[..60].to_vec(), ..good() }, "so no effect is accepted"),
        ("constant", good().change("cmd_vx_mps", |_, _| "1".into()), "command never changes"),
    ];
    for (name, sheet, part) in cases {
        let warnings = sheet.warnings();
        assert!(warnings.contains(part), "{name}: {part:?} is not in {warnings:?}");
    }
    let late = good().change("time_s", |_, n| format!("{:.0}", n * 1000.0)).refusal();
    assert!(late.contains("milliseconds"), "{late}");
    let still = good().change("x_m", |_, _| "1".into()).refusal();
    assert!(still.contains("no robot ever moves"), "{still}");
}

#[test]
fn the_warnings_stand_beside_every_answer() {
    let sheet = Sheet::links().change("channel", |_, _| "26".into());
    let config = "[netsim.phy]\npropagation = \"friis\"\n".to_owned();
    let config = Compared::of_text(Path::new("model.toml"), config, &[]).unwrap();
    let (_, account) = open::links(&config, &sheet.table(), &Choices::default()).unwrap();
    assert_eq!(account.warnings, sheet.check().unwrap().account.warnings);
    assert!(account.warnings[0].contains("channel is 26"));
}

#[test]
fn motes_that_only_the_configuration_knows_are_named() {
    let text = "[netsim.phy]\npropagation = \"friis\"\n\n[[netsim.phy.effect]]\nkind = \"battery-sag\"\ndb_per_hour = \
                -0.5\nnodes = [3, 99]\n";
    let config = Compared::of_text(Path::new("model.toml"), text.to_owned(), &[]).unwrap();
    let (_, account) = open::links(&config, &Sheet::links().table(), &Choices::default()).unwrap();
    let warnings = account.warnings.join("\n");
    assert!(warnings.contains("never appear in the measurements: 99."), "{warnings}");
}
