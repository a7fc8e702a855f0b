//! Campaigns that a model would have measured: what is put in is found again.

use diagnose::Request;
use diagnose::diagnosis::{Diagnosis, Parameter};
use diagnose::simulate::simulate;
use measure::memory::MemoryBudget;
use measure::table::DataTable;
use study::choices::Choices;
use study::open;
use tests::answers::{
    self, accepted, compared, diagnosed, measurements as table, model as config, standard_error,
};
use tests::campaign::{Campaign, Drive, Fleet, Layout};

/// A number of the first effect that was accepted.
fn number(found: &Diagnosis, key: &str) -> Parameter {
    answers::accepted_candidate(found, 0).parameters[key].clone()
}

#[test]
fn an_effect_of_links_that_is_put_in_is_found_and_the_true_model_knows_what_it_does_not_know() {
    let campaign = Campaign::link(2, &Layout::standard(), &[], 5000);
    let plain = campaign.config_toml.clone();
    let truth = plain.replacen("[netsim.phy]", "[netsim.phy]\nnoise_sd_db = 2.0", 1)
        + "\n[[netsim.phy.effect]]\nkind = \"temperature\"\ndb_per_c = -0.3\nreference_c = 20.0\n";
    let like = table(&campaign.csv);
    let simulated = simulate(&config(&truth), &like, 7, None).unwrap();
    let csv = simulated.to_csv();
    assert_eq!(csv, simulate(&config(&truth), &like, 7, None).unwrap().to_csv());
    assert_ne!(csv, simulate(&config(&truth), &like, 8, None).unwrap().to_csv());
    assert_eq!(csv.lines().next(), campaign.csv.lines().next());
    assert_eq!(csv.lines().count(), campaign.csv.lines().count());
    assert!(!simulated.is_noise_estimated && simulated.noise == 2.0);
    let made = table(&csv);

    let (study, _) = open::links(&config(&truth), &made, &Choices::default()).unwrap();
    assert_eq!(study.rows.links.readings.quantum_db, 1.0, "readings are rounded like the file's");
    let found = compared(&Request::new(&config(&truth), &made));
    let score = |name: &str| found.scores[name];
    // About 4000 readings: four standard errors are 0.019, and rounding to whole dB takes away up to 0.01.
    assert!((score("coverage_90") - 0.9).abs() < 0.03, "{found:?}");
    // The noise is 2 dB; four standard errors of the mean are 0.13 dB.
    assert!(score("bias_db").abs() < 0.13, "{found:?}");

    let found = diagnosed(&Request::new(&config(&plain), &made));
    assert_eq!(accepted(&found), ["temperature"]);
    let slope = number(&found, "db_per_c");
    assert!((slope.value + 0.3).abs() < 4.0 * standard_error(&slope), "{slope:?}");
}

#[test]
fn an_effect_of_robots_that_is_put_in_is_found_and_the_true_model_knows_what_it_does_not_know() {
    let campaign = Campaign::robots(3, &Fleet::standard(Drive::Velocity), &[], 6000);
    let plain = campaign.config_toml.clone();
    let truth = format!(
        "{plain}\n[[robotsim.dynamics.effect]]\nkind = \"slip\"\non = \"speed\"\nscale = 0.97\n\n[robotsim.localization]\nsd_m = \
         0.02\n"
    );
    let like = table(&campaign.csv);
    let simulated = simulate(&config(&truth), &like, 7, None).unwrap();
    let csv = simulated.to_csv();
    assert_eq!(csv, simulate(&config(&truth), &like, 7, None).unwrap().to_csv());
    assert_eq!(csv.lines().next(), campaign.csv.lines().next());
    let made = table(&csv);

    let found = compared(&Request::new(&config(&truth), &made));
    let coverage = found.scores["coverage_90"];
    // Windows overlap: some 1200 independent residuals, four standard errors are 0.035.
    assert!((coverage - 0.9).abs() < 0.035, "{found:?}");

    let found = diagnosed(&Request::new(&config(&plain), &made));
    assert_eq!(accepted(&found), ["slip"]);
    let p_value = answers::accepted_candidate(&found, 0).p_value;
    assert!(p_value < 1e-6, "{p_value}");
    let scale = number(&found, "scale");
    assert!((scale.value - 0.97).abs() < 4.0 * standard_error(&scale) + 1e-4, "{scale:?}");
}

#[test]
fn noise_that_the_configuration_does_not_give_is_estimated_and_said_to_be() {
    let campaign = Campaign::link(2, &Layout::standard(), &[], 2000);
    let simulated =
        simulate(&config(&campaign.config_toml), &table(&campaign.csv), 1, None).unwrap();
    assert!(simulated.is_noise_estimated);
    // The campaign's noise is 2 dB; four standard errors are 0.14 dB.
    assert!((simulated.noise - 2.0).abs() < 0.2, "{}", simulated.noise);
}

#[test]
fn the_command_writes_what_it_was_told_to() {
    let folder = tests::folder();
    let campaign = Campaign::link(2, &Layout::standard(), &[], 1000);
    std::fs::write(folder.path().join("links.csv"), &campaign.csv).unwrap();
    std::fs::write(folder.path().join("model.toml"), &campaign.config_toml).unwrap();
    let run = |output: &str| {
        let args = ["simulate", "model.toml", "--like", "links.csv", "--output", output];
        tests::orchestrator(&args, folder.path())
    };
    let output = run("made.csv.gz");
    assert!(output.status.success(), "{}", tests::said(&output));
    let checked = tests::orchestrator(&["check", "--data", "made.csv.gz"], folder.path());
    assert!(tests::said(&checked).contains("link samples"), "{}", tests::said(&checked));
    let refused = run("made.parquet");
    assert_eq!(refused.status.code(), Some(2));
    assert!(tests::said(&refused).contains("made.csv"), "{}", tests::said(&refused));
}

#[test]
fn what_a_run_has_left_is_a_campaign_of_its_model() {
    let folder = tests::folder();
    let text = "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = -10.0\nnoise_sd_db = 2.0\n\n[[netsim.phy.effect]]\nkind = \
                \"path-loss-exponent\"\nexponent = 2.6\n";
    let run = "\n[experiment]\nname = \"measured\"\nseed = 3\nduration_s = 6.0\nagents = 9\n\n[robotsim.scenario]\nkind = \
               \"line\"\nspacing_m = 4.0\n\n[robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n\n[output]\nlinks = \
               \"all\"\n";
    std::fs::write(folder.path().join("run.toml"), format!("{text}{run}")).unwrap();
    let output = tests::orchestrator(&["run", "run.toml"], folder.path());
    assert!(output.status.success(), "{}", tests::said(&output));

    let made =
        DataTable::read(&folder.path().join("runs/measured"), MemoryBudget::default()).unwrap();
    let score = |text: &str, name: &str| {
        let (study, _) = open::links(&config(text), &made, &Choices::default()).unwrap();
        assert!(study.rows.links.readings.has_losses(), "links that were not heard are there");
        compared(&Request::new(&config(text), &made)).scores[name]
    };
    let coverage = score(text, "coverage_90");
    // Some thousand readings: four standard errors are below 0.03.
    assert!((coverage - 0.9).abs() < 0.03, "{coverage}");
    assert!(score(text, "bias_db").abs() < 0.2);
    let lacking = text.split("\n\n").next().unwrap();
    assert!(1.5 < score(lacking, "bias_db").abs(), "the exponent is missed");

    let refused = DataTable::read(folder.path(), MemoryBudget::default()).unwrap_err().to_string();
    assert!(refused.contains("links.parquet"), "{refused}");
}

#[test]
fn a_link_table_is_simulated_frame_by_frame() {
    let mut csv =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,frames,pdr\n"
            .to_owned();
    for row in 0..60 {
        let distance_m = 5 * (1 + row % 12);
        csv += &format!(
            "{row},0,1,{},0,0,1,{distance_m},0,1,-{},200,0.5\n",
            11 + row % 16,
            70 + row % 9
        );
    }
    let text = "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = -18.0\nnoise_sd_db = 2.0\n";
    let made = simulate(&config(text), &table(&csv), 1, None).unwrap();
    assert_eq!(made.n_rows(), 60);
    let made = made.to_table();
    let [rssi_dbm, pdr, distance_m] =
        ["rssi_dbm", "pdr", "rx_x_m"].map(|name| made.column(name).unwrap().to_vec());
    for row in 0..60 {
        let received = 200.0 * pdr[row];
        assert!((received - received.round()).abs() < 1e-9, "{received}");
        assert_eq!(rssi_dbm[row].is_finite(), 0.0 < pdr[row]);
        if pdr[row] == 1.0 {
            // Free space at 2.4 GHz takes 40.2 dB at 1 m, 0.3 dB more or less by channel; the mean of 200 readings is known to
            // 0.14 dB, four of which are 0.6.
            let expected = -18.0 - 40.2 - 20.0 * distance_m[row].log10();
            assert!((rssi_dbm[row] - expected).abs() < 1.0, "{} {expected}", rssi_dbm[row]);
        }
    }
    assert!(pdr[0] == 1.0 && pdr[11] < 0.95, "{pdr:?}");
}
