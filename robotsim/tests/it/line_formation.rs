//! Line formation over simple radios, held against an independent measurement of BotNet's.

use crate::air::{Air, median, setup};
use proto::rng::{Draws, Purpose, ordered_link};
use proto::types::AgentStates;

/// Which radio.
#[derive(Clone, Copy, Debug)]
enum Radio {
    Full,
    Disk3m,
    FriisMinus40,
    Randomness,
}

/// Packet delivery ratio by received power, from −97 to −79 dBm: the Dust table that 6TiSCH simulators share.
const PDR: [f64; 19] = [
    0.0, 0.1494, 0.2340, 0.4071, 0.6359, 0.6866, 0.7476, 0.8603, 0.8702, 0.9324, 0.9427, 0.9562,
    0.9611, 0.9739, 0.9745, 0.9844, 0.9854, 0.9903, 1.0,
];

impl Radio {
    /// Whether a frame is heard; `level` and `luck` are uniform in [0, 1).
    fn hears(self, distance_m: f64, level: f64, luck: f64) -> bool {
        let friis_dbm =
            20.0 * (299_792_458.0 / (4.0 * std::f64::consts::PI * distance_m * 2.4e9)).log10();
        let rssi_dbm = match self {
            Self::Full => return true,
            Self::Disk3m => return distance_m <= 3.0,
            Self::FriisMinus40 => friis_dbm - 40.0,
            Self::Randomness => friis_dbm - 40.0 * level,
        };
        let above = (rssi_dbm + 97.0).clamp(0.0, 18.0);
        let index = (above as usize).min(17);
        let pdr = PDR[index] + (PDR[index + 1] - PDR[index]) * (above - index as f64);
        luck < pdr
    }
}

/// Control steps until the robots say they are done, not counting the first, in which nobody has heard anything, and log10
/// of the summed squared vertical residual about the common line (m²).
fn run(law: &str, radio: Radio, density_per_m2: f64, n: usize, seed: u64) -> (f64, f64) {
    let toml = format!(
        "scenario = {{ kind = 'disc', density_per_m2 = {density_per_m2} }}\n\
         controller = {{ kind = 'line-formation', law = '{law}' }}\n"
    );
    let draws = Draws::new(seed, Purpose::Reception);
    let mut air = Air::new(&setup(&toml, n, seed), |step, sender, receiver, distance_m| {
        let [level, luck, ..] = draws
            .words(ordered_link(sender as u32, receiver as u32), step, 0)
            .map(proto::rng::uniform);
        radio.hears(distance_m, level, luck)
    });
    let mut n_steps = 0;
    while !air.step().task_complete {
        n_steps += 1;
        assert!(n_steps < 2000, "{radio:?}, {n} robots, seed {seed}: no end");
    }
    (n_steps as f64, residual_m2(&air.states).log10())
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

#[test]
fn botnets_law_takes_the_rounds_and_leaves_the_residual_of_an_independent_measurement() {
    for (density, n, radio, rounds, residual) in [
        (0.22, 10, Radio::Full, 28.0, -5.7),
        (0.22, 10, Radio::Disk3m, 36.0, -1.9),
        (0.22, 10, Radio::FriisMinus40, 32.0, -5.3),
        (0.22, 10, Radio::Randomness, 28.0, -5.7),
        (0.22, 50, Radio::Full, 79.0, -5.4),
        (0.22, 50, Radio::Disk3m, 176.0, 2.6),
        (0.22, 50, Radio::FriisMinus40, 108.0, -4.0),
        (0.22, 50, Radio::Randomness, 78.0, -5.3),
        (5.0, 10, Radio::Full, 9.0, -5.7),
        (5.0, 10, Radio::Disk3m, 9.0, -5.7),
        (5.0, 10, Radio::FriisMinus40, 9.0, -5.7),
        (5.0, 10, Radio::Randomness, 9.0, -5.7),
        (5.0, 100, Radio::Full, 26.0, -5.1),
        (5.0, 100, Radio::Disk3m, 28.0, -4.4),
        (0.22, 100, Radio::Full, 116.0, -6.2),
        (0.22, 100, Radio::Disk3m, 255.0, 3.3),
    ] {
        let runs: Vec<(f64, f64)> =
            (0..16).map(|seed| run("botnet", radio, density, n, seed)).collect();
        println!(
            "{density} {n} {radio:?}: {} ({rounds}); {:.2} ({residual})",
            median(runs.iter().map(|run| run.0).collect()),
            median(runs.iter().map(|run| run.1).collect()),
        );
    }
}
