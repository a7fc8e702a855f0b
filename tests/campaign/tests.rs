//! The generator is tested on what it writes: the text is read again, and physics recomputed from it.

use super::*;
use crate::statistics::{deviation, mean};
use std::collections::BTreeMap;

/// FNV-1a of a campaign's texts.
fn digest(campaigns: &[Campaign]) -> u64 {
    let bytes = campaigns.iter().flat_map(|c| c.csv.bytes().chain(c.config_toml.bytes()));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// What campaigns are like, a line for each: what is hidden, its size, what the true model scores, the mean of each of `columns` over
/// the rows that have it, and parameters. Then a digest of all texts.
pub(super) fn described(campaigns: &[Campaign], columns: &[&str]) -> String {
    let heading =
        format!("effect | size | rmse, crps, log score | means of {} |", columns.join(", "));
    let lines = campaigns.iter().map(|campaign| {
        let rows = rows(campaign);
        let means: Vec<String> = columns
            .iter()
            .map(|column| {
                let values: Vec<f64> =
                    rows.iter().filter_map(|row| row.get(column).copied()).collect();
                if values.is_empty() { "-".to_owned() } else { format!("{:.3}", mean(&values)) }
            })
            .collect();
        let Scores { rmse, crps, log_score, .. } = campaign.oracle;
        let truth = &campaign.truth[0];
        let parameters =
            truth.parameters.iter().map(|(name, value)| format!("{name} = {value:.6}"));
        let choices = truth.choices.iter().map(|(name, choice)| format!("{name} = {choice}"));
        let parameters: Vec<String> = parameters.chain(choices).collect();
        format!(
            "{} | {:.3} | {rmse:.3}, {crps:.3}, {log_score:.3} | {} | {}",
            truth.effect,
            truth.size,
            means.join(", "),
            parameters.join(", ")
        )
    });
    let lines: Vec<String> = [heading].into_iter().chain(lines).collect();
    format!("{}\ndigest {}", lines.join("\n"), digest(campaigns))
}

fn all_hidden() -> impl Iterator<Item = Hidden> {
    Hidden::KNOWN.into_iter().chain(Hidden::UNKNOWN)
}

/// The rows of a file: fields that are not empty, by name.
pub(super) fn rows(campaign: &Campaign) -> Vec<BTreeMap<&str, f64>> {
    let mut lines = campaign.csv.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    lines
        .map(|line| {
            let fields = names.iter().copied().zip(line.split(','));
            fields
                .filter(|(_, field)| !field.is_empty())
                .map(|(name, field)| (name, field.parse().unwrap()))
                .collect()
        })
        .collect()
}

fn tx_power_dbm(campaign: &Campaign) -> f64 {
    let line = campaign.config_toml.lines().find(|line| line.starts_with("tx_power_dbm")).unwrap();
    line.split(" = ").nth(1).unwrap().parse().unwrap()
}

pub(super) fn parameter(campaign: &Campaign, name: &str) -> f64 {
    campaign.truth[0].parameters.iter().find(|(other, _)| *other == name).unwrap().1
}

fn distance_m(row: &BTreeMap<&str, f64>) -> f64 {
    let square = |tx: &str, rx: &str| (row[tx] - row[rx]).powi(2);
    (square("tx_x_m", "rx_x_m") + square("tx_y_m", "rx_y_m") + square("tx_z_m", "rx_z_m")).sqrt()
}

/// If it fails, what is generated has changed, and no figure measured with it holds. The table shows what has changed; a digest that
/// changes alone is a difference below the table's digits.
#[test]
fn a_link_campaign_is_frozen() {
    let all: Vec<Campaign> = all_hidden()
        .map(|hidden| Campaign::link(1, &Layout::drawn(1), &[(hidden, Size::Medium)], 600))
        .collect();
    let columns = ["rssi_dbm", "received", "tx_x_m", "rx_y_m", "temperature_c", "humidity_pct"];
    insta::assert_snapshot!(described(&all, &columns));
}

#[test]
fn every_effect_has_the_size_asked_for() {
    for hidden in all_hidden() {
        for size in Size::ALL {
            let campaign = Campaign::link(2, &Layout::standard(), &[(hidden, size)], 5000);
            let wanted =
                if hidden.is_of_reception() { size.of_delivery() } else { size.of_noise() };
            let found = campaign.truth[0].size;
            // The transmit power is rounded to 0.01 dB after the strength is found.
            assert!((found / wanted - 1.0).abs() < 0.01, "{hidden:?} {size:?}: {found}");
            // Between 61 and 84 % are expected; of 5,000 frames the share has a standard error of 0.7 points, so that a campaign
            // at either end fails for one seed in 500.
            assert!((0.59..0.86).contains(&campaign.received), "{hidden:?}: {}", campaign.received);
        }
    }
}

#[test]
fn two_effects_have_their_sizes_together() {
    let hidden = [(Hidden::TwoRayGround, Size::Medium), (Hidden::Interference, Size::Clear)];
    let campaign = Campaign::link(4, &Layout::standard(), &hidden, 10_000);
    let sizes: Vec<f64> = campaign.truth.iter().map(|truth| truth.size).collect();
    assert!(
        (sizes[0] / 0.4 - 1.0).abs() < 0.01 && (sizes[1] / 0.15 - 1.0).abs() < 0.01,
        "{sizes:?}"
    );
    assert_eq!(campaign.truth[1].effect, "interference");
}

/// What is left of the readings of strong rows, of which nearly all are received, when the base model and what a closed form
/// says of the effect are taken away.
fn left(campaign: &Campaign, added_db: impl Fn(&BTreeMap<&str, f64>) -> f64) -> Vec<f64> {
    let power_dbm = tx_power_dbm(campaign);
    rows(campaign)
        .iter()
        .filter_map(|row| {
            let carrier_hz = 2.405e9 + 5e6 * (row["channel"] - 11.0);
            let wavelength_m = 299_792_458.0 / carrier_hz;
            let path_db =
                20.0 * (4.0 * std::f64::consts::PI * distance_m(row) / wavelength_m).log10();
            let expected_dbm = power_dbm - path_db + added_db(row);
            (-84.0 < expected_dbm && row.contains_key("rssi_dbm"))
                .then(|| row["rssi_dbm"] - expected_dbm)
        })
        .collect()
}

type ClosedForm = fn(&Campaign, &BTreeMap<&str, f64>) -> f64;

#[test]
fn what_closed_forms_explain_leaves_the_noise() {
    let forms: [(&[Hidden], ClosedForm); 7] = [
        (&[], |_, _| 0.0),
        (&[Hidden::SystemGain], |campaign, _| parameter(campaign, "gain_db")),
        (&[Hidden::PathLossExponent], |campaign, row| {
            -10.0 * (parameter(campaign, "exponent") - 2.0) * distance_m(row).log10()
        }),
        (&[Hidden::Temperature], |campaign, row| {
            parameter(campaign, "db_per_c") * (row["temperature_c"] - 25.0)
        }),
        (&[Hidden::HumiditySquared], |campaign, row| {
            -parameter(campaign, "coefficient") * ((row["humidity_pct"] - 60.0) / 10.0).powi(2)
        }),
        (&[Hidden::SenderSpeed], |campaign, row| {
            -parameter(campaign, "coefficient") * row["tx_speed_mps"]
        }),
        // Ideal ground's limit of small angles: amplitudes of both rays differ in phase only.
        (&[Hidden::TwoRayGround], |campaign, row| {
            let is_vertical = campaign.truth[0].choices[0].1 == "vertical";
            let permittivity = parameter(campaign, "relative_permittivity");
            let (low, high) = (row["tx_z_m"], row["rx_z_m"]);
            let direct_m = distance_m(row);
            let reflected_m = (direct_m.powi(2) + 4.0 * low * high).sqrt();
            let sin = (low + high) / reflected_m;
            let refracted = (permittivity - 1.0 + sin * sin).sqrt();
            let weight = if is_vertical { permittivity } else { 1.0 };
            let strength = (weight * sin - refracted) / (weight * sin + refracted);
            let carrier_hz = 2.405e9 + 5e6 * (row["channel"] - 11.0);
            let phase =
                std::f64::consts::TAU * (reflected_m - direct_m) * carrier_hz / 299_792_458.0;
            let share = strength * direct_m / reflected_m;
            10.0 * (1.0 + share * share + 2.0 * share * phase.cos()).log10()
        }),
    ];
    for (hidden, form) in forms {
        let hidden: Vec<(Hidden, Size)> = hidden.iter().map(|&kind| (kind, Size::Clear)).collect();
        let campaign = Campaign::link(6, &Layout::standard(), &hidden, 20_000);
        let left = left(&campaign, |row| form(&campaign, row));
        let n = left.len() as f64;
        assert!(200.0 < n, "{hidden:?}: {n}");
        // Noise of 2 dB and rounding: four standard errors, and 0.06 dB for what is not received at -84 dBm and above.
        assert!(mean(&left).abs() < 0.06 + 4.0 * 2.02 / n.sqrt(), "{hidden:?}: {}", mean(&left));
        let sd_db = (4.0_f64 + 1.0 / 12.0).sqrt();
        let error = (deviation(&left) / sd_db - 1.0).abs();
        assert!(error < 0.03 + 4.0 / (2.0 * n).sqrt(), "{hidden:?}: {}", deviation(&left));
    }
}

#[test]
fn lost_frames_read_nothing_and_follow_the_table() {
    let campaign = Campaign::link(8, &Layout::standard(), &[], 20_000);
    let power_dbm = tx_power_dbm(&campaign);
    let (mut n, mut expected, mut variance) = (0.0, 0.0, 0.0);
    for row in rows(&campaign) {
        assert_eq!(row["received"] == 1.0, row.contains_key("rssi_dbm"));
        assert!(row["tx"] != row["rx"] && 0.0 < row["tx_z_m"] && row["time_s"] <= 7200.0);
        let level_dbm = power_dbm + radio::friis_db(distance_m(&row), row["channel"] as u8);
        // The noise averaged over.
        let tenths = |k: i32| f64::from(k) / 10.0;
        let weights: f64 = (-60..=60).map(|k| (-0.125 * tenths(k).powi(2)).exp()).sum();
        let passed: f64 = (-60..=60)
            .map(|k| (-0.125 * tenths(k).powi(2)).exp() * radio::table(level_dbm + tenths(k)))
            .sum();
        let delivery = passed / weights;
        n += row["received"];
        expected += delivery;
        variance += delivery * (1.0 - delivery);
    }
    assert!((n - expected).abs() < 4.0 * variance.sqrt(), "{n} received, {expected} expected");
}

#[test]
fn the_true_model_scores_best() {
    let layout = Layout::standard();
    for hidden in [vec![], vec![(Hidden::Interference, Size::Clear)]] {
        let made = link::Made::new(9, &layout, &hidden, 10_000);
        let right = made.scores(0.0);
        for wrong in [1.0, -1.0].map(|off_db| made.scores(off_db)) {
            assert!(
                wrong.log_score < right.log_score && right.crps < wrong.crps,
                "{wrong:?} {right:?}"
            );
            assert!(right.rmse < wrong.rmse);
            assert!(right.reception_log_loss < wrong.reception_log_loss);
        }
    }
}

#[test]
fn what_is_random_is_learned_as_far_as_it_can_be() {
    let layout = Layout::standard();
    let rmse = |hidden: &[(Hidden, Size)]| Campaign::link(10, &layout, hidden, 10_000).oracle.rmse;
    let alone = rmse(&[]);
    // 500 rows tell a node's offset: all of it is learned. Selection by reception changes by some hundredths.
    assert!(rmse(&[(Hidden::NodeOffset, Size::Clear)]) < 1.04 * alone);
    // A moving pair is at a new place in every row, where noise and shadowing (2 dB each) cannot be told apart.
    let shadowed = rmse(&[(Hidden::Shadowing, Size::Clear)]);
    assert!(1.1 * alone < shadowed && shadowed < 2.0_f64.sqrt() * alone, "{shadowed} {alone}");
    // Fading is new in every frame.
    let faded = rmse(&[(Hidden::FastFading, Size::Clear)]);
    assert!(1.2 * alone < faded, "{faded} {alone}");
}

#[test]
fn a_campaign_of_another_seed_is_another() {
    let csv_of = |seed| Campaign::link(seed, &Layout::standard(), &[], 1000).csv;
    assert_ne!(csv_of(1), csv_of(2));
    assert_eq!(csv_of(1), csv_of(1));
    assert!(Layout::drawn(1) != Layout::drawn(2));
}
