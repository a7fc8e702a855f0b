//! Robots that are driven here, with noise. Included by the tests of more than one crate.

use super::scramble;
use measure::table::DataTable;
use proto::rng::normal;

pub(super) const STEP_S: f64 = 0.05;
pub(super) const NOISE_M: f64 = 0.01;

/// Two robots, far from each other, whose command of a velocity changes every 0.4 to 1.6 s. As columns of a table of robot
/// samples, and one more. `moved`: moves place and velocity by a step under a command, and says what that column holds.
pub(super) fn driven(
    n_steps: usize,
    column: &str,
    moved: impl Fn(usize, [f64; 2], &mut [f64; 2], &mut [f64; 2]) -> f64,
) -> DataTable {
    let names = ["time_s", "agent", "x_m", "y_m", "cmd_vx_mps", "cmd_vy_mps", column];
    let mut columns = vec![Vec::new(); names.len()];
    let mut draws = 0u64;
    let mut draw = || {
        draws += 2;
        normal(scramble(draws), scramble(draws + 1))
    };
    for agent in 0..2 {
        let (mut at, mut velocity, mut command) =
            ([1e4 * f64::from(agent), 0.0], [0.0; 2], [0.0; 2]);
        let mut until = 0;
        for step in 0..n_steps {
            if step == until {
                command = [draw(), draw()];
                until = step + 8 + (scramble(step as u64) % 24) as usize;
            }
            let measured = at.map(|place| place + NOISE_M * draw());
            let value = moved(step, command, &mut at, &mut velocity);
            let row = [
                step as f64 * STEP_S,
                f64::from(agent),
                measured[0],
                measured[1],
                command[0],
                command[1],
                value,
            ];
            for (column, value) in columns.iter_mut().zip(row) {
                column.push(value);
            }
        }
    }
    DataTable::of_columns(names.map(str::to_owned).to_vec(), columns)
}
