//! Choices by hand: which rows are used, which are left out together, which campaigns are scored, how far robots are predicted.

use diagnose::Request;
use measure::table::DataTable;
use std::fmt::Write as _;
use study::choices::{Choices, SplitBy};
use study::open;
use study::{COMMON, Study as _, links::LinkStudy, robots::RobotStudy};
use tests::answers::{compared, extended, measurements as table, model as config};

const FRIIS: &str =
    "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\nnoise_sd_db = 2.0\n";
const POINTS: &str = "[robotsim.dynamics]\nkind = \"point-mass\"\n";
const ROWS: u32 = 1200;

/// Eight motes that stand, every frame received 5 dB weaker than free space, in two campaigns; in the second `more_db` weaker
/// still.
fn links(more_db: f64) -> DataTable {
    let mut csv =
        "time_s,run,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,received\n"
            .to_owned();
    for row in 0..ROWS {
        let (tx, step) = (row % 8, 1 + row / 8 % 7);
        let rx = (tx + step) % 8;
        let run = 1 + row / (ROWS / 2);
        let place = |mote: u32| (f64::from(mote * mote % 11), f64::from(mote * 3 % 7));
        let ((x0, y0), (x1, y1)) = (place(tx), place(rx));
        let distance_m = (x1 - x0).hypot(y1 - y0);
        // Noise that repeats itself, with a mean of 0 and a standard deviation of 2 dB.
        let noise_db = if row / 3 % 2 == 0 { 2.0 } else { -2.0 };
        let weaker_db = 5.0 + if run == 2 { more_db } else { 0.0 };
        let rssi_dbm = -40.05 - 20.0 * distance_m.log10() - weaker_db + noise_db;
        writeln!(csv, "{row},{run},{tx},{rx},15,{x0},{y0},1,{x1},{y1},1,{rssi_dbm:.3},1").unwrap();
    }
    table(&csv)
}

/// A robot that goes to and fro along x in each of five campaigns, in the last at 0.8 of what is commanded, in the others at
/// 0.9.
fn robots() -> DataTable {
    let mut csv = "time_s,run,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps\n".to_owned();
    for run in 1..=5 {
        let scale = if run == 5 { 0.8 } else { 0.9 };
        let mut x_m = 0.0;
        for step in 0..200 {
            let speed_mps = if step / 40 % 2 == 0 { 1.0 } else { -1.0 };
            let noise_m = if step % 2 == 0 { 0.001 } else { -0.001 };
            writeln!(csv, "{},{run},0,{},0,{speed_mps},0", f64::from(step) * 0.1, x_m + noise_m)
                .unwrap();
            x_m += 0.1 * scale * speed_mps;
        }
    }
    table(&csv)
}

fn of_links(table: &DataTable, choices: &Choices) -> LinkStudy {
    open::links(&config(FRIIS), table, choices).unwrap().0
}

fn of_robots(choices: &Choices) -> RobotStudy {
    open::robots(&config(POINTS), &robots(), choices).unwrap().0
}

fn condition(text: &str) -> Choices {
    Choices { condition: Some(text.to_owned()), ..Choices::default() }
}

/// A number of the first effect of a side in an extended configuration.
fn number(text: &str, side: &str, section: &str, key: &str) -> f64 {
    let config: toml::Table = text.parse().unwrap();
    config[side][section]["effect"][0][key].as_float().unwrap()
}

#[test]
fn a_condition_leaves_rows_out_and_the_account_says_how_many() {
    let table = links(0.0);
    let (study, account) =
        open::links(&config(FRIIS), &table, &condition("distance_m < 5 and tx != 3")).unwrap();
    assert!(0 < study.n_rows() && study.n_rows() < ROWS as usize / 2);
    for row in &study.rows.links.rows {
        let distance_m = (row.tx_m[0] - row.rx_m[0]).hypot(row.tx_m[1] - row.rx_m[1]);
        assert!(distance_m < 5.0 && row.tx != 3, "{row:?}");
    }
    assert_eq!((account.rows, account.used), (ROWS as usize, study.n_rows()));
    let [left_out] = &account.rejected[..] else { panic!("{:?}", account.rejected) };
    assert_eq!(left_out.rows, ROWS as usize - study.n_rows());
    assert!(left_out.reason.contains("distance_m < 5 and tx != 3"), "{left_out:?}");

    // Of robots windows are left out, their samples stay: what is known when a window begins is the same.
    let [all, some] =
        [Choices::default(), condition("commanded_direction_rad < 1")].map(|c| of_robots(&c));
    assert!(all.n_rows() / 3 < some.n_rows() && some.n_rows() < 2 * all.n_rows() / 3);
    assert_eq!(all.robots().samples.len(), some.robots().samples.len());
    let [left_out] = some.rejected() else { panic!("{:?}", some.rejected()) };
    assert_eq!(left_out.rows, all.n_rows() - some.n_rows());
}

#[test]
fn campaigns_that_are_scored_are_not_seen_by_the_fit() {
    let choices = Choices { fit_runs: vec![1], score_runs: vec![2], ..Choices::default() };
    let (model, table) = (config(FRIIS), links(3.0));
    let request = Request::new(&model, &table).with_choices(choices);
    let gain = extended(&request, &["system-gain"]).unwrap();
    let gain_db = number(&gain.text, "netsim", "phy", "gain_db");
    // 600 readings with a noise of 2 dB: four standard errors are 0.33 dB.
    assert!((gain_db + 5.0).abs() < 0.33, "{}", gain.text);
    // Scored are the rows of the second campaign: 3 dB that the first does not have, and the noise of 2 dB.
    let rmse_db = compared(&request).scores["rmse_db"];
    assert!((rmse_db - 68f64.sqrt()).abs() < 0.2, "as configured, 8 dB off: {rmse_db}");
    assert!((gain.answer.rmse[1] - 13f64.sqrt()).abs() < 0.2, "{:?}", gain.answer);

    let choices = Choices { score_runs: vec![5], ..Choices::default() };
    let (model, table) = (config(POINTS), robots());
    let request = Request::new(&model, &table).with_choices(choices);
    let slip = extended(&request, &["slip"]).unwrap();
    let scale = number(&slip.text, "robotsim", "dynamics", "scale");
    assert!((scale - 0.9).abs() < 0.001, "{}", slip.text);
    // Windows of 1 s, one in four with a turn in it: a tenth of 1 m/s, of those without.
    assert!((0.07..0.1).contains(&slip.answer.rmse[1]), "{:?}", slip.answer);
}

#[test]
fn what_is_left_out_together_is_as_chosen() {
    let table = links(0.0);
    let by = |split| {
        let study = of_links(&table, &Choices { split: Some(split), ..Choices::default() });
        let blocks = study.blocks(COMMON).clone();
        let rows = study.rows.links.rows.clone();
        (blocks, rows)
    };
    let (blocks, rows) = by(SplitBy::Pair);
    for (row, other) in (0..400).zip(1..) {
        let pair = |row: usize| (rows[row].tx.min(rows[row].rx), rows[row].tx.max(rows[row].rx));
        assert_eq!(pair(row) == pair(other), blocks.of_row[row] == blocks.of_row[other]);
    }
    let (blocks, rows) = by(SplitBy::Run);
    assert_eq!(blocks.n_blocks(), 2);
    assert!(rows.iter().zip(&blocks.of_row).all(|(row, &block)| row.run == block + 1));
    // Whoever is scored of a node has not seen that node.
    let (blocks, rows) = by(SplitBy::Node);
    for fold in 0..blocks.n_folds() {
        let (train, test) = blocks.split(fold);
        let out: std::collections::BTreeSet<u32> =
            test.iter().map(|&row| blocks.of_row[row as usize]).collect();
        assert!(!train.is_empty());
        for &row in &train {
            let row = &rows[row as usize];
            assert!(!out.contains(&row.tx) && !out.contains(&row.rx), "{row:?} {out:?}");
        }
    }
    let by = |split| {
        let study = of_robots(&Choices { split: Some(split), ..Choices::default() });
        let blocks = study.blocks(COMMON);
        (blocks.unit, blocks.n_blocks())
    };
    assert_eq!(by(SplitBy::Run), ("campaigns", 5));
    assert_eq!(by(SplitBy::Time).0, "parts of tracks");
}

#[test]
fn windows_are_as_long_as_chosen() {
    let rmse_m = |window_s: f64| {
        let choices = Choices {
            window_s: Some(window_s),
            condition: Some("run < 5 and time_s < 0.05".to_owned()),
            ..Choices::default()
        };
        let (model, table) = (config(POINTS), robots());
        compared(&Request::new(&model, &table).with_choices(choices)).scores["rmse_m"]
    };
    // From the begin of each campaign: a tenth of the way at 1 m/s, and noise of 1 mm.
    assert!((rmse_m(1.0) - 0.1).abs() < 0.01, "{}", rmse_m(1.0));
    assert!((rmse_m(3.0) - 0.3).abs() < 0.01, "{}", rmse_m(3.0));
}

#[test]
fn choices_that_cannot_be_are_refused_with_the_nearest_that_can() {
    let of_links = |choices: Choices| {
        open::links(&config(FRIIS), &links(0.0), &choices).unwrap_err().to_string()
    };
    let of_robots = |choices: Choices| {
        open::robots(&config(POINTS), &robots(), &choices).unwrap_err().to_string()
    };
    let split = |split| Choices { split: Some(split), ..Choices::default() };
    let window = |window_s| Choices { window_s: Some(window_s), ..Choices::default() };
    for (error, parts) in [
        (of_links(condition("distanc_m < 5")), &["--where", "distance_m?", "\n    ^"][..]),
        (of_links(condition("rssi_dbm > 0")), &["no row satisfies", "1200 rows checked"]),
        (of_links(split(SplitBy::Place)), &["no node moves", "--split pair"]),
        (of_links(window(2.0)), &["--window", "link samples"]),
        (
            of_links(Choices { fit_runs: vec![1], score_runs: vec![4], ..Choices::default() }),
            &["--score-runs: the data have no run 4 (nearest valid: 2)"],
        ),
        (
            of_links(Choices { fit_runs: vec![1, 2], ..Choices::default() }),
            &["--fit-runs", "no run is left to be scored"],
        ),
        (of_robots(split(SplitBy::Pair)), &["have no pairs", "--split node"]),
        (
            of_robots(split(SplitBy::Node)),
            &["all windows belong to one of the robots", "--split time"],
        ),
        (of_robots(window(0.01)), &["0.1"]),
        (
            of_robots(window(60.0)),
            &["longer than the longest track of 19.9", "nearest valid: 19.9"],
        ),
        (of_robots(window(f64::NAN)), &["--window NaN", "0.1"]),
        (of_robots(condition("cmd_vx_mps >")), &["expected a number, a name or ( at the end"]),
    ] {
        for part in parts {
            assert!(error.contains(part), "{part:?} is not in: {error}");
        }
    }
}

#[test]
fn the_command_line_takes_them_and_refuses_what_it_does_not_know() {
    let folder = tests::folder();
    std::fs::write(folder.path().join("model.toml"), FRIIS).unwrap();
    let table = links(0.0);
    let names = table.names().join(",");
    let rows = (0..table.n_rows()).map(|row| {
        let fields = table.names().iter().map(|name| table.column(name).unwrap()[row].to_string());
        fields.collect::<Vec<_>>().join(",")
    });
    let csv = [names].into_iter().chain(rows).collect::<Vec<_>>().join("\n");
    std::fs::write(folder.path().join("links.csv"), csv).unwrap();
    let compare = |args: &[&str]| {
        let all = [&["compare", "model.toml", "--data", "links.csv"], args].concat();
        tests::orchestrator(&all, folder.path())
    };
    let good = compare(&[
        "--where",
        "distance_m < 5",
        "--split",
        "pair",
        "--fit-runs",
        "1",
        "--json",
        "found.json",
    ]);
    assert!(good.status.success(), "{}", tests::said(&good));
    let said = tests::said(&good);
    assert!(said.contains("--where \"distance_m < 5\" is not satisfied"), "{said}");
    let json = std::fs::read_to_string(folder.path().join("found.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["unit"], "pairs of nodes");
    let left_out = json["rejected"][0]["rows"].as_u64().unwrap();
    assert_eq!(left_out + json["used"].as_u64().unwrap(), json["rows"].as_u64().unwrap());
    for (args, part) in [
        (&["--split", "pairs"][..], "a similar value exists: 'pair'"),
        (&["--fit-runs", "1,x"], "invalid"),
        (&["--where", "distance_m < 5 &"], "use and"),
        (&["--window", "1"], "leave it out"),
    ] {
        let refused = compare(args);
        let said = tests::said(&refused);
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains(part), "{part:?} is not in: {said}");
    }
}
