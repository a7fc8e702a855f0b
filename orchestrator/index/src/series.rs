//! What changed during a run: a point for each of a few hundred steps, from `steps.parquet`.

use input::result::{ResultError, ResultFolder};
use numbers::format::{count, rounded};
use parquet::record::{Field, Row};
use serde::Serialize;
use std::collections::BTreeMap;

/// A series that runs have.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct SeriesKind {
    /// Its name in calls.
    pub(crate) name: &'static str,
    /// What it is.
    pub(crate) label: &'static str,
    /// Its unit; `%` of a share from 0 to 1, empty of a number without a unit.
    pub(crate) unit: &'static str,
}

const N_SERIES: usize = 5;

/// All of them.
pub(crate) const SERIES: [SeriesKind; N_SERIES] = [
    SeriesKind { name: "flock_speed", label: "speed of the flock", unit: "m/s" },
    SeriesKind { name: "speed", label: "mean speed of the robots", unit: "m/s" },
    SeriesKind { name: "spread", label: "r.m.s. distance from the centre", unit: "m" },
    SeriesKind { name: "neighbours", label: "neighbours heard, mean", unit: "" },
    SeriesKind { name: "isolation", label: "robots that hear nobody", unit: "%" },
];

/// Most points of a series.
pub(crate) const MOST_POINTS: u64 = 600;
/// A table with more rows is not read for them.
const MOST_ROWS: u64 = 4_000_000;
/// Digits that are kept of a value.
const DIGITS: usize = 5;

const COLUMNS: [&str; 9] =
    ["step", "time_ns", "alive", "x_m", "y_m", "vx_mps", "vy_mps", "vz_mps", "n_heard"];

/// The series of a run, at the same times.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct RunSeries {
    /// Simulated time (s).
    pub(crate) time_s: Vec<f64>,
    /// Values by the name of the series; null where there is none.
    pub(crate) values: BTreeMap<&'static str, Vec<Option<f64>>>,
}

impl RunSeries {
    /// At most so many points: each is the mean of as many that follow each other, at the time of the first of them.
    pub(crate) fn thinned(&self, n_points: usize) -> Self {
        let every = self.time_s.len().div_ceil(n_points.max(1)).max(1);
        let mean = |values: &[Option<f64>]| {
            let known: Vec<f64> = values.iter().copied().flatten().collect();
            let n = known.len() as f64;
            (0.0 < n).then(|| rounded(known.iter().sum::<f64>() / n, DIGITS))
        };
        let thinned = |values: &[Option<f64>]| values.chunks(every).map(mean).collect();
        Self {
            time_s: self.time_s.iter().copied().step_by(every).collect(),
            values: self.values.iter().map(|(name, values)| (*name, thinned(values))).collect(),
        }
    }
}

/// Sums over the robots that are alive at a step.
#[derive(Default)]
struct Sums {
    time_ns: f64,
    n: f64,
    velocity_mps: [f64; 2],
    speed_mps: f64,
    /// Where the first robot is (m): sums of places are from there on, so that a swarm that is far away loses no digits.
    origin_m: [f64; 2],
    place_m: [f64; 2],
    place_m2: f64,
    heard: f64,
    n_heard: f64,
    isolated: f64,
}

impl Sums {
    fn add(&mut self, [x, y, vx, vy, vz, heard]: [f64; 6]) {
        if self.n == 0.0 {
            self.origin_m = [x, y];
        }
        let [vx, vy, vz] = [vx, vy, vz].map(|speed| if speed.is_finite() { speed } else { 0.0 });
        let [x, y] = [x - self.origin_m[0], y - self.origin_m[1]];
        self.n += 1.0;
        self.velocity_mps = [self.velocity_mps[0] + vx, self.velocity_mps[1] + vy];
        self.speed_mps += libm::sqrt(vx * vx + vy * vy + vz * vz);
        self.place_m = [self.place_m[0] + x, self.place_m[1] + y];
        self.place_m2 += x * x + y * y;
        if heard.is_finite() {
            self.heard += heard;
            self.n_heard += 1.0;
            self.isolated += f64::from(u8::from(heard == 0.0));
        }
    }

    /// The values in the order of [`SERIES`].
    fn values(&self) -> [Option<f64>; N_SERIES] {
        let mean = |sum: f64| sum / self.n;
        let [x, y] = self.place_m.map(mean);
        let spread_m2 = (mean(self.place_m2) - x * x - y * y).max(0.0);
        let of_heard = |sum: f64| (0.0 < self.n_heard).then(|| sum / self.n_heard);
        [
            Some(libm::hypot(self.velocity_mps[0], self.velocity_mps[1]) / self.n),
            Some(mean(self.speed_mps)),
            Some(libm::sqrt(spread_m2)),
            of_heard(self.heard),
            of_heard(self.isolated),
        ]
        .map(|value| value.filter(|value| value.is_finite()).map(|value| rounded(value, DIGITS)))
    }
}

/// Why a table is not read to its end.
enum Stop {
    Result(ResultError),
    TooLong,
}

impl From<ResultError> for Stop {
    fn from(error: ResultError) -> Self {
        Self::Result(error)
    }
}

/// The series of a run with so many steps.
///
/// # Errors
///
/// In words: its table was changed, is damaged or too long, or no robot is in it.
pub(crate) fn series(folder: &ResultFolder, n_steps: u64) -> Result<RunSeries, String> {
    let every = n_steps.div_ceil(MOST_POINTS).max(1);
    let mut series = RunSeries::default();
    let mut add = |sums: &Sums| {
        if sums.n == 0.0 {
            return;
        }
        series.time_s.push(rounded(sums.time_ns / 1e9, 9));
        for (kind, value) in SERIES.iter().zip(sums.values()) {
            series.values.entry(kind.name).or_default().push(value);
        }
    };
    let mut n_rows = 0;
    let mut step = 0;
    let mut sums = Sums::default();
    let table = folder.table("steps.parquet").map_err(|error| error.to_string())?;
    let read = table.each_row_with(&COLUMNS, |row| {
        n_rows += 1;
        if MOST_ROWS < n_rows {
            return Err(Stop::TooLong);
        }
        let [row_step, time_ns, alive, rest @ ..] = numbers_of(row);
        let row_step = row_step as u64;
        // Of several steps the first that is recorded stands for all. Step 0 is before anything was sent.
        if row_step == 0 || step != 0 && row_step != step && row_step / every == step / every {
            return Ok(());
        }
        if row_step != step {
            add(&sums);
            sums = Sums { time_ns, ..Sums::default() };
            step = row_step;
        }
        if alive == 1.0 {
            sums.add(rest);
        }
        Ok(())
    });
    add(&sums);
    match read {
        Err(Stop::Result(error)) => Err(error.to_string()),
        Err(Stop::TooLong) => Err(format!(
            "steps.parquet has more than {} rows; `murmuration figure` draws its series",
            count(MOST_ROWS)
        )),
        Ok(()) if series.time_s.is_empty() => {
            Err("steps.parquet has no step with a robot".to_owned())
        }
        Ok(()) => Ok(series),
    }
}

/// The numbers of a row in the order of [`COLUMNS`]; of a null NaN.
fn numbers_of(row: &Row) -> [f64; COLUMNS.len()] {
    let mut numbers = [f64::NAN; COLUMNS.len()];
    for (name, field) in row.get_column_iter() {
        let Some(at) = COLUMNS.iter().position(|column| column == name) else { continue };
        numbers[at] = match field {
            Field::Bool(is) => f64::from(u8::from(*is)),
            Field::UInt(number) => f64::from(*number),
            Field::ULong(number) => *number as f64,
            Field::Int(number) => f64::from(*number),
            Field::Long(number) => *number as f64,
            Field::Float(number) => f64::from(*number),
            Field::Double(number) => *number,
            _ => f64::NAN,
        };
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_values_of_a_step_are_those_of_its_robots() {
        let mut sums = Sums::default();
        // Two robots 6 m apart, far from the origin: one stands still and hears nobody.
        sums.add([1e6, 5.0, 3.0, 4.0, 0.0, 1.0]);
        sums.add([1e6 + 6.0, 5.0, 0.0, 0.0, f64::NAN, 0.0]);
        let expected = [Some(2.5), Some(2.5), Some(3.0), Some(0.5), Some(0.5)];
        assert_eq!(sums.values(), expected);
    }

    #[test]
    fn a_point_of_a_thinned_series_is_a_mean() {
        let time_s: Vec<f64> = (0..10).map(f64::from).collect();
        let values = time_s.iter().map(|&time_s| (time_s != 9.0).then_some(time_s % 2.0));
        let values = BTreeMap::from([("speed", values.collect())]);
        let series = RunSeries { time_s, values };
        assert_eq!(series.thinned(10), series);
        let thinned = series.thinned(3);
        assert_eq!(thinned.time_s, [0.0, 4.0, 8.0]);
        assert_eq!(thinned.values["speed"], [Some(0.5), Some(0.5), Some(0.0)]);
    }
}
