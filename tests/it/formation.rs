//! Line formation over the real radio, held against a measurement of BotNet's own program.

use proto::types::AgentStates;
use rayon::prelude::*;
use std::fmt::Write as _;
use tests::in_process::InProcess;
use tests::statistics::{Comparison, Measured};

const FULL: &str = "propagation = 'full'";
const DISK: &str = "propagation = 'unit-disk'\nradius_m = 3.0";
const FRIIS_40: &str = "propagation = 'probabilistic-disk'\ncarrier_hz = 2.4e9";
const RANDOMNESS: &str = "propagation = 'experimental-randomness'\ncarrier_hz = 2.4e9";

/// An experiment file: a disc of `n` robots forms a line.
fn experiment(law: &str, radio: &str, density_per_m2: f64, n: usize) -> String {
    format!(
        "[experiment]\nname = 'formation'\nseed = 1\nduration_s = 300.0\nagents = {n}\n\
         control_period = {{ rate_hz = 10.0 }}\nstop_when_complete = true\n\
         [robotsim]\n\
         scenario = {{ kind = 'disc', density_per_m2 = {density_per_m2} }}\n\
         controller = {{ kind = 'line-formation', law = '{law}' }}\n\
         [netsim.phy]\n{radio}\n"
    )
}

/// Rounds that each of some runs takes, and log10 of the summed squared vertical residual (m²) it leaves.
#[derive(Debug)]
struct Runs {
    rounds: Vec<f64>,
    log_residual: Vec<f64>,
}

impl Runs {
    fn of(law: &str, radio: &str, density_per_m2: f64, n: usize) -> Self {
        let toml = experiment(law, radio, density_per_m2, n);
        let (rounds, log_residual) = (0..N_RUNS)
            .into_par_iter()
            .map(|seed| {
                let mut experiment = InProcess::start(&toml, seed);
                // The first step, in which nobody has heard anything yet, is no round; the last, in which nobody moves, is.
                let mut n_rounds = 0;
                while n_rounds < N_ROUNDS_MAX && !experiment.step() {
                    n_rounds += 1;
                }
                (f64::from(n_rounds), residual_m2(&experiment.states).log10())
            })
            .unzip();
        Self { rounds, log_residual }
    }
}

/// Summed squared vertical residual about the least squares line (m²).
fn residual_m2(states: &AgentStates) -> f64 {
    let n = states.len() as f64;
    let mean = |column: &[f64]| column.iter().sum::<f64>() / n;
    let (mx, my) = (mean(&states.x_m), mean(&states.y_m));
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        states.x_m.iter().zip(&states.y_m).map(|(x, y)| f(x - mx, y - my)).sum()
    };
    let slope = sum(&|x, y| x * y) / sum(&|x, _| x * x);
    sum(&|x, y| (y - slope * x).powi(2))
}

/// Seeds 0 to 127.
const N_RUNS: u64 = 128;

/// A run that takes longer counts as this long; no quantile that is compared is near it. Robots at the edge of a disk can
/// lose and find each other for ever.
const N_ROUNDS_MAX: u32 = 2000;

/// Density (1/m²), robots, radio and its name; rounds and log10 residual measured there, medians; of how many runs.
type Row = (f64, usize, &'static str, &'static str, f64, f64, usize);

#[rustfmt::skip]
const MEASURED: [Row; 20] = [
    (0.22, 10, "full", FULL, 28.0, -5.7, 16),
    (0.22, 10, "disk 3 m", DISK, 36.0, -1.9, 16),
    (0.22, 10, "Friis − 40 dB", FRIIS_40, 32.0, -5.3, 16),
    (0.22, 10, "randomness", RANDOMNESS, 28.0, -5.7, 16),
    (0.22, 50, "full", FULL, 79.0, -5.4, 16),
    (0.22, 50, "disk 3 m", DISK, 176.0, 2.6, 16),
    (0.22, 50, "Friis − 40 dB", FRIIS_40, 108.0, -4.0, 16),
    (0.22, 50, "randomness", RANDOMNESS, 78.0, -5.3, 16),
    (0.22, 100, "full", FULL, 116.0, -6.2, 8),
    (0.22, 100, "disk 3 m", DISK, 255.0, 3.3, 8),
    (0.22, 100, "Friis − 40 dB", FRIIS_40, 165.0, -0.8, 8),
    (0.22, 100, "randomness", RANDOMNESS, 116.0, -5.0, 8),
    (5.0, 10, "full", FULL, 9.0, -5.7, 16),
    (5.0, 10, "disk 3 m", DISK, 9.0, -5.7, 16),
    (5.0, 10, "Friis − 40 dB", FRIIS_40, 9.0, -5.7, 16),
    (5.0, 10, "randomness", RANDOMNESS, 9.0, -5.7, 16),
    (5.0, 100, "full", FULL, 26.0, -5.1, 8),
    (5.0, 100, "disk 3 m", DISK, 28.0, -4.4, 8),
    (5.0, 100, "Friis − 40 dB", FRIIS_40, 26.0, -5.0, 8),
    (5.0, 100, "randomness", RANDOMNESS, 26.0, -5.0, 8),
];

/// The median number of rounds that was measured. Of 8 runs of 100 robots over the disk only 5 ended in the time they were
/// given, the 5 fastest: the middle one of those is the third fastest of all 8.
fn measured_rounds(&(density, n, name, _, rounds, _, n_runs): &Row) -> Measured {
    let share = if (density, n, name) == (0.22, 100, "disk 3 m") { 2.5 / 8.0 } else { 0.5 };
    Measured { value: rounds, rounding: 0.5, share, n_runs }
}

fn measured_residual(&(.., log_residual, n_runs): &Row) -> Measured {
    Measured { value: log_residual, rounding: 0.05, share: 0.5, n_runs }
}

/// Where no difference lies outside the interval. Of 40 intervals of 95 %, 2 should miss; the last two are of the same 8
/// runs, half of which seem to have formed more than one line, as one in eight of ours does.
const OUTSIDE: [(f64, usize, &str, &str); 3] = [
    (0.22, 100, "full", "log10"),
    (0.22, 100, "Friis − 40 dB", "rounds"),
    (0.22, 100, "Friis − 40 dB", "log10"),
];

#[test]
fn botnets_law_takes_the_rounds_and_leaves_the_residuals_of_botnets_program() {
    let mut table = String::from(
        "| density | N | radio | what | ours | BotNet | runs | 95 % of the difference | p | within 20 % |\n",
    );
    let mut outside = Vec::new();
    for row in &MEASURED {
        let &(density, n, name, radio, ..) = row;
        let runs = Runs::of("botnet", radio, density, n);
        for (what, values, measured) in [
            ("rounds", &runs.rounds, measured_rounds(row)),
            ("log10", &runs.log_residual, measured_residual(row)),
        ] {
            let compared = Comparison::of(values, measured);
            let Comparison { own, interval: [low, high], probability } = compared;
            let within = what == "rounds" && compared.excludes(0.2 * measured.value);
            writeln!(
                table,
                "| {density} | {n} | {name} | {what} | {own:.1} | {} | {} | {low:.1} to {high:.1} | {probability:.3} | {} |",
                measured.value,
                measured.n_runs,
                if within { "yes" } else { "–" },
            )
            .unwrap();
            if !compared.agrees() {
                outside.push((density, n, name, what));
            }
            // One in a hundred for each of 40: a correct program fails here for one choice of seeds in three.
            assert!(0.01 < probability, "{table}");
            let is_sharp = name == "full" || name == "randomness" || density == 5.0;
            assert_eq!(
                within,
                what == "rounds"
                    && (is_sharp
                        || (name, n) == ("Friis − 40 dB", 10)
                        || (name, n) == ("Friis − 40 dB", 50)),
                "{table}"
            );
        }
    }
    println!("{table}");
    assert_eq!(outside, OUTSIDE, "{table}");
}
