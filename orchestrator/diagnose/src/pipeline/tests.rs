//! Each step between the measurements and the answer is needed by one of these campaigns, which are written out here.

use super::{Campaign, Extending, diagnose, extend};
use crate::diagnosis::{Diagnosis, Verdict};
use crate::measured::opened;
use crate::{DiagnoseError, Request, Unobserved};
use measure::config::Compared;
use measure::table::DataTable;
use proto::rng::{Draws, Purpose};
use std::fmt::Write as _;
use std::path::Path;
use study::Study as _;
use study::open::OpenError;
use study::robots::RobotStudy;

const FRIIS: &str = "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\n";
const MOTES: u32 = 8;
const ROWS: u32 = 2800;

/// Frames between eight motes that stand, a second apart, received as by free space with a noise of 1 dB. `change_db`: what is added to
/// a reading (dB), by the row's time (s), sender and receiver; NaN: the reading is always −70 dBm.
fn links(change_db: impl Fn(f64, u32, u32) -> f64) -> DataTable {
    let draws = Draws::new(5, Purpose::Resample);
    let place = |mote: u32| (f64::from(mote * mote % 11), f64::from(mote * 3 % 7));
    let mut csv =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,received\n"
            .to_owned();
    for row in 0..ROWS {
        let (tx, step) = (row % MOTES, 1 + row / MOTES % (MOTES - 1));
        let rx = (tx + step) % MOTES;
        let ((x0, y0), (x1, y1)) = (place(tx), place(rx));
        let distance_m = libm::hypot(x1 - x0, y1 - y0);
        let noise_db = draws.normal(0, u64::from(row), 0);
        let change_db = change_db(f64::from(row), tx, rx);
        let rssi_dbm = if change_db.is_nan() {
            -70.0
        } else {
            (-40.05 - 20.0 * libm::log10(distance_m) + noise_db + change_db).round()
        };
        let _ = writeln!(csv, "{row},{tx},{rx},15,{x0},{y0},1,{x1},{y1},1,{rssi_dbm},1");
    }
    DataTable::of_csv(Path::new("links.csv"), csv.as_bytes()).unwrap()
}

fn friis() -> Compared {
    Compared::of_text(Path::new("model.toml"), FRIIS.to_owned(), &[]).unwrap()
}

fn diagnosed(table: &DataTable) -> Diagnosis {
    diagnose(&Request::new(&friis(), table), &Unobserved).unwrap().answer
}

#[test]
fn nothing_is_missing_from_free_space() {
    let found = diagnosed(&links(|_, _, _| 0.0));
    assert_eq!(found.verdict, Verdict::NothingMissing, "{}", found.sentence);
}

/// Eight robots that turn every second and a half; positions have a noise of 5 mm. `moved`: what a robot goes under a command (m/s).
fn robots(n_steps: u32, mut moved: impl FnMut(u32, [f64; 2]) -> [f64; 2]) -> DataTable {
    let draws = Draws::new(6, Purpose::Resample);
    let mut csv = "time_s,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps\n".to_owned();
    for agent in 0..8_u32 {
        let (mut x_m, mut y_m) = (0.0, 10.0 * f64::from(agent));
        for step in 0..n_steps {
            let turn_rad = 0.3 * f64::from((step / 15 + 5 * agent) * 7 % 20);
            // At one speed a drag that grows with its square would be a slip.
            let speed_mps = 0.6 + 0.1 * f64::from((step / 15 + 3 * agent) * 5 % 9);
            let [vx_mps, vy_mps] =
                [libm::cos(turn_rad), libm::sin(turn_rad)].map(|it| speed_mps * it);
            let noise_m = |axis| 0.005 * draws.normal(u64::from(agent), u64::from(step), axis);
            let _ = writeln!(
                csv,
                "{:.1},{agent},{:.5},{:.5},{vx_mps},{vy_mps}",
                0.1 * f64::from(step),
                x_m + noise_m(0),
                y_m + noise_m(1)
            );
            let [x_mps, y_mps] = moved(agent, [vx_mps, vy_mps]);
            x_m += 0.1 * x_mps;
            y_m += 0.1 * y_mps;
        }
    }
    DataTable::of_csv(Path::new("robots.csv"), csv.as_bytes()).unwrap()
}

fn point_mass() -> Compared {
    let text = "[robotsim.dynamics]\nkind = \"point-mass\"\n".to_owned();
    Compared::of_text(Path::new("model.toml"), text, &[]).unwrap()
}

/// Robot 3 slips.
fn slip_of_one(agent: u32, velocity_mps: [f64; 2]) -> [f64; 2] {
    velocity_mps.map(|part| if agent == 3 { 0.8 * part } else { part })
}

/// What is selected in a table of robots, all windows or a subset of about so many being searched.
fn selected(table: &DataTable, most: Option<usize>) -> Vec<String> {
    let config = point_mass();
    let opened = opened::<RobotStudy>(&Request::new(&config, table), &Unobserved).unwrap();
    let mut campaign = Campaign::of(opened);
    campaign.thin = most.map(|most| campaign.study.thinned_to(most).unwrap());
    let (ladder, _) = campaign.select(&|_| ());
    let candidates = campaign.study.candidates();
    ladder.accepted.into_iter().map(|term| candidates[term].name.clone()).collect()
}

#[test]
fn a_subset_of_the_windows_names_what_all_windows_name() {
    let wind = |_, [x, y]: [f64; 2]| [x + 0.03, y];
    let slip_and_wind = |_, [x, y]: [f64; 2]| [0.9 * x + 0.03, 0.9 * y];
    for (table, names) in [
        (robots(900, |_, it| it), &[][..]),
        (robots(900, slip_of_one), &["slip (only agents = [3])"]),
        (robots(900, wind), &["wind"]),
        (robots(900, slip_and_wind), &["slip", "wind"]),
    ] {
        let mut of_all = selected(&table, None);
        let mut of_subset = selected(&table, Some(800));
        of_all.sort_unstable();
        of_subset.sort_unstable();
        assert_eq!(
            (of_all.as_slice(), &of_subset),
            (&names.iter().map(ToString::to_string).collect::<Vec<_>>()[..], &of_all)
        );
    }
}

#[test]
fn an_effect_of_one_robot_is_limited_to_it() {
    let config = point_mass();
    let table = robots(300, slip_of_one);
    let found = diagnose(&Request::new(&config, &table), &Unobserved).unwrap().answer;
    let accepted = found.candidates.iter().find(|candidate| candidate.accepted);
    let only = accepted.and_then(|candidate| candidate.only.as_ref()).expect(&found.sentence);
    assert_eq!(only["agents"], toml::Value::Array(vec![3.into()]), "{}", found.sentence);
}

#[test]
fn a_defect_of_the_measurement_is_named_and_corrected_before_the_search() {
    let found = diagnosed(&links(|_, _, rx| if rx == 5 { f64::NAN } else { 0.0 }));
    assert_eq!(found.missing, ["measurement:stuck-node"], "{}", found.sentence);
    assert_eq!(found.measurement_defects[0].nodes, [5]);
    assert_eq!(found.account.used + found.measurement_defects[0].left_out, ROWS as usize);
}

#[test]
fn an_effect_is_added_by_name_and_one_that_does_not_exist_is_refused() {
    let (config, table) = (friis(), links(|_, _, _| -4.0));
    let request = Request::new(&config, &table);
    let extended = extend(&request, &Extending::named(&["system-gain"]), &Unobserved).unwrap();
    let [before, after] = extended.config.unwrap().answer.rmse;
    assert!(3.9 < before && after < 1.2, "{before} {after}");
    let refused = extend(&request, &Extending::named(&["system-gian"]), &Unobserved).unwrap_err();
    assert!(refused.to_string().contains("did you mean system-gain?"), "{refused}");
}

#[test]
fn a_table_of_nothing_known_is_refused_with_the_columns_it_lacks() {
    let table = DataTable::of_csv(Path::new("data.csv"), &b"a,b\n1,2\n"[..]).unwrap();
    let refused = diagnose(&Request::new(&friis(), &table), &Unobserved).unwrap_err();
    assert!(matches!(refused, DiagnoseError::Open(OpenError::Useless { .. })), "{refused:?}");
    assert!(refused.to_string().contains("link samples lack"), "{refused}");
}
