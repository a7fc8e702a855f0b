//! Robot campaigns are tested on what they write, as link campaigns are.

use super::tests::{described, parameter, rows};
use super::*;
use crate::statistics::{deviation, mean};

fn all_hidden() -> impl Iterator<Item = RobotHidden> {
    RobotHidden::KNOWN.into_iter().chain(RobotHidden::UNKNOWN)
}

/// If it fails, what is generated has changed, and no figure measured with it holds. The table shows what has changed; a digest that
/// changes alone is a difference below the table's digits.
#[test]
fn a_robot_campaign_is_frozen() {
    let all: Vec<Campaign> = all_hidden()
        .map(|hidden| Campaign::robots(1, &Fleet::showing(hidden), &[(hidden, Size::Medium)], 600))
        .collect();
    let columns = ["x_m", "y_m", "heading_rad", "cmd_vx_mps", "cmd_vy_mps", "cmd_speed_mps"];
    insta::assert_snapshot!(described(&all, &columns));
}

#[test]
fn every_robot_effect_has_the_size_asked_for() {
    for hidden in all_hidden() {
        for size in Size::ALL {
            let campaign = Campaign::robots(2, &Fleet::showing(hidden), &[(hidden, size)], 4000);
            let found = campaign.truth[0].size;
            // A dead band takes in one commanded speed after the other.
            let tolerance = if hidden == RobotHidden::DeadBand { 0.15 } else { 0.01 };
            let error = (found / size.of_noise() - 1.0).abs();
            assert!(error < tolerance, "{hidden:?} {size:?}: {found}");
        }
    }
}

/// Per second and robot: how far it came in x and in y, less what its commands say (m).
fn errors(campaign: &Campaign, n_robots: usize) -> Vec<[f64; 2]> {
    let rows = rows(campaign);
    let robot = |agent: usize| rows.iter().skip(agent).step_by(n_robots).collect::<Vec<_>>();
    (0..n_robots)
        .flat_map(|agent| {
            let samples = robot(agent);
            samples
                .windows(21)
                .step_by(20)
                .map(|window| {
                    [("x_m", "cmd_vx_mps"), ("y_m", "cmd_vy_mps")].map(|(place, command)| {
                        let told: f64 = window[..20].iter().map(|row| 0.05 * row[command]).sum();
                        window[20][place] - window[0][place] - told
                    })
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

#[test]
fn robots_do_what_they_are_told_up_to_noise() {
    let campaign = Campaign::robots(3, &Fleet::standard(Drive::Velocity), &[], 20_000);
    let errors = errors(&campaign, 5);
    let all: Vec<f64> = errors.iter().flatten().copied().collect();
    let n = all.len() as f64;
    // Two measured positions, each to 15 mm: four standard errors.
    let sd_m = 0.015 * 2.0_f64.sqrt();
    assert!(mean(&all).abs() < 4.0 * sd_m / n.sqrt(), "{}", mean(&all));
    assert!((deviation(&all) / sd_m - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "{}", deviation(&all));
    // The true model knows where it was: one more measurement.
    let expected = 0.015 * (2.0_f64 * (1.0 + 1.0 / 20.0)).sqrt();
    assert!((campaign.oracle.rmse / expected - 1.0).abs() < 4.0 / (2.0 * n).sqrt());
}

#[test]
fn wind_carries_robots_as_far_as_it_blows() {
    let hidden = [(RobotHidden::Wind, Size::Clear)];
    let campaign = Campaign::robots(5, &Fleet::standard(Drive::Velocity), &hidden, 20_000);
    let errors = errors(&campaign, 5);
    for (axis, name) in ["velocity_mps[0]", "velocity_mps[1]"].into_iter().enumerate() {
        let along: Vec<f64> = errors.iter().map(|error| error[axis]).collect();
        let tolerance = 4.0 * 0.0213 / (along.len() as f64).sqrt();
        assert!((mean(&along) - parameter(&campaign, name)).abs() < tolerance);
    }
    // Clear: as large as the noise.
    assert!((campaign.truth[0].size - 1.0).abs() < 0.01);
}

#[test]
fn noisier_positions_are_noisier() {
    let hidden = [(RobotHidden::Localization, Size::Clear)];
    let campaign = Campaign::robots(7, &Fleet::standard(Drive::Velocity), &hidden, 20_000);
    let all: Vec<f64> = errors(&campaign, 5).iter().flatten().copied().collect();
    let sd_m = parameter(&campaign, "sd_m") * 2.0_f64.sqrt();
    let tolerance = 4.0 / (2.0 * all.len() as f64).sqrt();
    assert!((deviation(&all) / sd_m - 1.0).abs() < tolerance);
    assert!(campaign.config_toml.contains("sd_m = 0.015"));
}

#[test]
fn cars_and_unicycles_stay_where_they_are_sent_to() {
    for drive in [Drive::Unicycle, Drive::Car] {
        let campaign = Campaign::robots(11, &Fleet::standard(drive), &[], 10_000);
        for row in rows(&campaign) {
            assert!((-20.0..140.0).contains(&row["x_m"]) && (-20.0..110.0).contains(&row["y_m"]));
            assert!(row["heading_rad"].abs() <= std::f64::consts::PI + 1e-4);
            assert!(row["cmd_speed_mps"] <= 8.0);
        }
        // The noise of the end, what the last second leaves of that of the start, and a little for the heading.
        let rmse = campaign.oracle.rmse / 0.015;
        assert!((1.38..1.62).contains(&rmse), "{drive:?}: {rmse}");
    }
}

#[test]
fn two_robot_effects_have_their_sizes_together() {
    let hidden = [(RobotHidden::ActuatorLag, Size::Clear), (RobotHidden::Wind, Size::Medium)];
    let campaign = Campaign::robots(6, &Fleet::slow(), &hidden, 4000);
    for (truth, (_, size)) in campaign.truth.iter().zip(hidden) {
        assert!((truth.size / size.of_noise() - 1.0).abs() < 0.01, "{truth:?}");
    }
}
