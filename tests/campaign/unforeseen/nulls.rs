//! Null campaigns: no effect of the catalogue is hidden, and the noise is white or not.

use super::air::{Air, frame_times, layout, n_rows, ornstein_uhlenbeck, per_frame, random_walk};
use super::answer::{Answer, Claim};
use super::{Case, Expected, labels, readings, robots};
use crate::campaign::draws::Draws;
use crate::campaign::fleet::Drive;
use crate::campaign::motion::{Physics, SAMPLE_S, advance};
use crate::campaign::robots::{Error, HEADING_SD_RAD, Plan};

/// A kind of noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// Independent and normal.
    White,
    /// Student's t with four degrees of freedom.
    HeavyTailed,
    /// A centred gamma distribution of shape 4, skewed to either side.
    Skewed,
    /// White, with a drift of this correlation time (s).
    Drift(f64),
    /// White, with a random walk.
    RandomWalk,
    /// White, with node offsets and a drift: links only.
    OffsetsAndDrift,
    /// White, with noisy positions of moving nodes: links only.
    NoisyPositions,
    /// White, with about 1 % of gross errors.
    Outliers,
}

impl Noise {
    /// Kinds of links.
    pub const LINKS: [Self; 10] = [
        Self::White,
        Self::HeavyTailed,
        Self::Skewed,
        Self::Drift(30.0),
        Self::Drift(120.0),
        Self::Drift(1000.0),
        Self::RandomWalk,
        Self::OffsetsAndDrift,
        Self::NoisyPositions,
        Self::Outliers,
    ];
    /// Kinds of robots.
    pub const ROBOTS: [Self; 8] = [
        Self::White,
        Self::HeavyTailed,
        Self::Skewed,
        Self::Drift(30.0),
        Self::Drift(120.0),
        Self::Drift(1000.0),
        Self::RandomWalk,
        Self::Outliers,
    ];

    /// Its name.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::White => "white".to_owned(),
            Self::HeavyTailed => "heavy-tailed".to_owned(),
            Self::Skewed => "skewed".to_owned(),
            Self::Drift(tau_s) => format!("drift of {tau_s} s"),
            Self::RandomWalk => "random walk".to_owned(),
            Self::OffsetsAndDrift => "node offsets and drift".to_owned(),
            Self::NoisyPositions => "noisy positions".to_owned(),
            Self::Outliers => "outliers".to_owned(),
        }
    }

    /// One draw of the independent part: mean 0, standard deviation 1. `skew_sign`: 1 or -1.
    fn draw(self, draws: &mut Draws, skew_sign: f64) -> f64 {
        match self {
            Self::HeavyTailed => {
                // A normal over the root of a χ² with four degrees over four has the variance 2.
                let square: f64 = (0..4).map(|_| draws.normal().powi(2)).sum();
                draws.normal() / (square / 4.0).sqrt() / 2.0_f64.sqrt()
            }
            Self::Skewed => {
                let sum: f64 = (0..4).map(|_| -(1.0 - draws.uniform()).ln()).sum();
                skew_sign * (sum - 4.0) / 2.0
            }
            _ => draws.normal(),
        }
    }
}

/// The sign of the skewness: 1 or -1.
fn skew_sign(seed: u64) -> f64 {
    if Draws::new(seed, "side").chance(0.5) { 1.0 } else { -1.0 }
}

/// The drift at ascending times, if this kind of noise has one. `scale`: its standard deviation, of a random walk after ten
/// minutes.
fn drift_course(
    noise: Noise,
    seed: u64,
    purpose: &str,
    times_s: impl Iterator<Item = f64>,
    scale: f64,
) -> Option<Vec<f64>> {
    let mut draws = Draws::new(seed, purpose);
    match noise {
        Noise::Drift(tau_s) => Some(ornstein_uhlenbeck(&mut draws, times_s, tau_s, scale)),
        Noise::OffsetsAndDrift => {
            let tau_s = draws.between(60.0, 300.0);
            Some(ornstein_uhlenbeck(&mut draws, times_s, tau_s, scale))
        }
        Noise::RandomWalk => Some(random_walk(&mut draws, times_s, scale / 600.0_f64.sqrt())),
        _ => None,
    }
}

fn link_air(seed: u64, noise: Noise) -> Air {
    let mut air = Air::new(seed, &layout(seed, 15.0), n_rows(seed, 2000, 5000));
    let mut draws = Draws::new(seed, "noise of this kind");
    let skew_sign = skew_sign(seed);
    for value in &mut air.noise_db {
        *value = air.noise_sd_db * noise.draw(&mut draws, skew_sign);
    }
    let times = frame_times(&air.world);
    let scale_db = air.noise_sd_db * draws.between(0.5, 1.0);
    if let Some(drift) = drift_course(noise, seed, "drift", times.into_iter(), scale_db) {
        let drift_db = per_frame(&air.world, &drift);
        air.add(|index, _| drift_db[index]);
    }
    if noise == Noise::OffsetsAndDrift {
        let offsets: Vec<[f64; 2]> =
            (0..air.world.n_nodes).map(|_| [(); 2].map(|()| 2.0 * draws.normal())).collect();
        air.add(|_, row| offsets[row.tx][0] + offsets[row.rx][1]);
    }
    air
}

/// The honest answer: nothing, or the kind of noise.
fn answer(noise: Noise) -> Answer {
    match noise {
        Noise::White | Noise::HeavyTailed | Noise::Skewed => Answer::nothing(),
        Noise::Drift(_) | Noise::RandomWalk => {
            Answer::nothing().permitting(&["drift"]).with_structure(&["time_s"])
        }
        Noise::OffsetsAndDrift => Answer::of(["node-offset", "drift"].map(Claim::of).to_vec())
            .with_structure(&["time_s", "transmitter", "receiver"]),
        Noise::NoisyPositions => Answer::nothing().permitting(&["measurement:position-noise"]),
        Noise::Outliers => Answer::nothing().permitting(&["measurement:outliers"]),
    }
}

/// A campaign of links.
#[must_use]
pub fn links(seed: u64, noise: Noise) -> Case {
    if noise == Noise::NoisyPositions {
        let (csv, config_toml, error) = labels::with_noisy_places(seed);
        let answer = answer(noise).with_error(error);
        return Case { csv, config_toml, expected: Expected::Answer(answer) };
    }
    let air = link_air(seed, noise);
    let mut sent = air.send();
    if noise == Noise::Outliers {
        readings::add_outliers(&mut sent, seed);
    }
    let answer = answer(noise).with_error(air.error_over_noise(&sent));
    Case { csv: air.csv(&sent), config_toml: air.config(&sent), expected: Expected::Answer(answer) }
}

/// Errors of the measured positions, per sample and robot.
fn errors(
    seed: u64,
    noise: Noise,
    n_samples: usize,
    n_robots: usize,
    sd_m: f64,
) -> Vec<Vec<Error>> {
    let mut draws = Draws::new(seed, "localization of this kind");
    let skew_sign = skew_sign(seed);
    let share = draws.between(0.007, 0.015);
    // The drift is common to all robots (a base station), or independent.
    let is_common = draws.chance(0.5);
    // In a second the drift changes by 0.3 to 1 times the noise.
    let per_root_s = sd_m * draws.between(0.3, 1.0);
    let scale_m = match noise {
        Noise::Drift(tau_s) => per_root_s * (tau_s / 2.0).sqrt(),
        _ => per_root_s * 600.0_f64.sqrt(),
    };
    let drifts: Vec<Option<Vec<f64>>> = (0..2 * n_robots)
        .map(|k| {
            let of = if is_common { k % 2 } else { k };
            let times = (0..n_samples).map(|sample| sample as f64 * SAMPLE_S);
            drift_course(noise, seed, &format!("drift {of}"), times, scale_m)
        })
        .collect();
    let mut one = |sample: usize, agent: usize| {
        let is_gross = noise == Noise::Outliers && draws.chance(share);
        let at_m = [0, 1].map(|axis| {
            let drift = drifts[2 * agent + axis].as_ref().map_or(0.0, |drift| drift[sample]);
            let gross_m = if is_gross { sd_m * draws.between(-60.0, 60.0) } else { 0.0 };
            sd_m * noise.draw(&mut draws, skew_sign) + drift + gross_m
        });
        Error { at_m, heading_rad: HEADING_SD_RAD * draws.normal() }
    };
    (0..n_samples).map(|sample| (0..n_robots).map(|agent| one(sample, agent)).collect()).collect()
}

/// A campaign of robots.
pub(super) fn of_robots(seed: u64, noise: Noise) -> Case {
    let drive = [Drive::Velocity, Drive::Unicycle, Drive::Car][(seed % 3) as usize];
    let fleet = robots::fleet(seed, drive);
    let plan = Plan::new(seed, &fleet, &[], robots::n_samples(seed, &fleet, 4000));
    let ideal = Physics::ideal(drive);
    let tracks = plan.driven_by(|robots, commands, sample| {
        advance(&ideal, robots, commands, &plan.payloads_kg[sample], sample);
    });
    let measured = errors(seed, noise, plan.n_samples, fleet.n_robots, fleet.noise_m);
    let answer = answer(noise).with_error(1.0);
    Case {
        csv: plan.csv(&tracks, &measured),
        config_toml: plan.config(),
        expected: Expected::Answer(answer),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{deviation, mean};

    fn moment(values: &[f64], power: i32) -> f64 {
        mean(&values.iter().map(|value| value.powi(power)).collect::<Vec<_>>())
    }

    #[test]
    fn noises_have_their_moments() {
        let of = |noise: Noise| -> Vec<f64> {
            let mut draws = Draws::new(1, "noise");
            (0..200_000).map(|_| noise.draw(&mut draws, 1.0)).collect()
        };
        for noise in [Noise::White, Noise::HeavyTailed, Noise::Skewed] {
            let values = of(noise);
            assert!(mean(&values).abs() < 0.01, "{noise:?}");
            // The fourth moment of the heavy-tailed one does not exist.
            assert!((deviation(&values) - 1.0).abs() < 0.05, "{noise:?} {}", deviation(&values));
        }
        // Gamma of shape 4: skewness 2/√4; excess 6/4.
        let skewed = of(Noise::Skewed);
        assert!((moment(&skewed, 3) - 1.0).abs() < 0.1);
        assert!((moment(&skewed, 4) - 4.5).abs() < 0.4);
        // Of Student's t with four degrees, 1.61 % lie beyond 3.5355 (2.5 standard deviations): 0.01203 on both sides by
        // F(t) = 1/2 + 3/8 (t/√(1+t²/4)) (1 - t²/(12 (1+t²/4))).
        let t = 2.5 * 2.0_f64.sqrt();
        let scaled = 1.0 + t * t / 4.0;
        let inside = 0.75 * t / scaled.sqrt() * (1.0 - t * t / (12.0 * scaled));
        let heavy = of(Noise::HeavyTailed);
        let beyond = heavy.iter().filter(|value| 2.5 < value.abs()).count() as f64 / 200_000.0;
        let expected = 1.0 - inside;
        assert!((beyond - expected).abs() < 4.0 * (expected / 200_000.0).sqrt(), "{beyond}");
    }

    #[test]
    fn positions_of_robots_err_as_drawn() {
        let sd_m = 0.02;
        let axis = |noise: Noise| -> Vec<f64> {
            errors(2, noise, 1000, 6, sd_m).iter().flatten().map(|error| error.at_m[0]).collect()
        };
        for noise in [Noise::White, Noise::HeavyTailed, Noise::Skewed] {
            let values = axis(noise);
            assert!((deviation(&values) / sd_m - 1.0).abs() < 0.1, "{noise:?}");
        }
        let gross = axis(Noise::Outliers).iter().filter(|value| 5.0 * sd_m < value.abs()).count();
        assert!((30..110).contains(&gross), "{gross}");
        // After a second a drift has changed by 0.3 to 1 of the noise, beside that of two positions.
        for noise in [Noise::Drift(30.0), Noise::Drift(1000.0), Noise::RandomWalk] {
            let ratios: Vec<f64> = (0..20)
                .map(|seed| {
                    let errors = errors(seed, noise, 1000, 5, sd_m);
                    let steps: Vec<f64> = (0..980)
                        .flat_map(|k| (0..5).map(move |agent| (k, agent)))
                        .map(|(k, agent)| errors[k + 20][agent].at_m[1] - errors[k][agent].at_m[1])
                        .collect();
                    moment(&steps, 2) / (sd_m * sd_m) - 2.0
                })
                .collect();
            let change = mean(&ratios);
            assert!((0.2..0.8).contains(&change), "{noise:?}: {change}");
        }
    }

    #[test]
    fn drifts_and_offsets_are_in_the_level_and_white_noise_is_not() {
        let added = |noise: Noise| -> Vec<f64> {
            let air = link_air(3, noise);
            air.level_db.iter().zip(&air.model_db).map(|(truth, model)| truth - model).collect()
        };
        assert!(added(Noise::White).iter().all(|value| *value == 0.0));
        assert!(0.2 < deviation(&added(Noise::Drift(30.0))));
        // Two offsets of 2 dB each.
        assert!(1.6 < deviation(&added(Noise::OffsetsAndDrift)));
    }

    #[test]
    fn every_kind_makes_a_campaign() {
        for noise in Noise::LINKS {
            let case = links(5, noise);
            assert!((1900..=5000).contains(&(case.csv.lines().count() - 1)), "{noise:?}");
        }
        for noise in Noise::ROBOTS {
            let case = of_robots(5, noise);
            assert!((3900..=12_000).contains(&(case.csv.lines().count() - 1)), "{noise:?}");
        }
    }
}
