//! Predictions window by window, for pictures.

use super::motion::MeasuredTracks;
use super::{RobotFit, RobotStudy};
use crate::Study;
use crate::thresholds::HORIZONS_S;
use crate::view::{RowPredictions, Viewed};
use measure::robots::RobotSample;
use numbers::power::square;
use robotsim::dynamics::Drive;

impl Viewed for RobotStudy {
    fn view(&self, fit: &RobotFit) -> RowPredictions {
        let all: Vec<u32> = (0..self.n_rows() as u32).collect();
        let mut view = RowPredictions::default();
        for residual in self.model.residuals(fit, &all).unwrap_or_default() {
            let sd_m = fit.density.sd_m(&residual);
            view.predicted.push(residual.way_m);
            view.measured.push(residual.way_m + residual.parts_m[0]);
            view.sd.push(sd_m[0]);
            view.across.push([residual.parts_m[1], sd_m[1]]);
            view.heading_rad.push(residual.heading_rad);
        }
        view
    }
}

impl RobotStudy {
    /// The samples at which each window begins and ends.
    #[must_use]
    pub fn windows(&self) -> Vec<[&RobotSample; 2]> {
        let samples = &self.robots().samples;
        let tracks = &self.model.tracks;
        tracks
            .windows
            .iter()
            .map(|w| [&samples[w.start as usize], &samples[w.end as usize]])
            .collect()
    }

    /// Root of the mean squared error (m) of a fit at each of [`HORIZONS_S`]; none where no window is so long.
    #[must_use]
    pub fn errors_by_horizon(&self, fit: &RobotFit) -> Vec<(f64, f64)> {
        let Some((physics, gains)) = self.model.physics(fit) else { return Vec::new() };
        let spacing_s = self.robots().spacing_s();
        HORIZONS_S
            .into_iter()
            .filter(|horizon_s| 0.9 * spacing_s <= *horizon_s)
            .filter_map(|horizon_s| {
                let terrain = self.model.tracks.terrain().clone();
                let tracks = MeasuredTracks::new(self.robots().clone(), horizon_s, terrain)
                    .with_foreign(self.model.tracks.foreign.clone());
                let residuals = tracks.residuals(&physics, &tracks.paths(&physics), gains);
                let squares: f64 = residuals
                    .iter()
                    .flat_map(|residual| residual.parts_m)
                    .map(|part| part * part)
                    .sum();
                (!residuals.is_empty())
                    .then(|| (horizon_s, (squares / residuals.len() as f64).sqrt()))
            })
            .collect()
    }

    /// What an error may depend on, at the start of each window: the columns of the file, and what follows from them.
    #[must_use]
    pub fn covariates(&self) -> Vec<(String, Vec<f64>)> {
        self.model.tracks.covariates()
    }
}

impl MeasuredTracks {
    /// What an error may depend on, at the start of each window: the columns of the file, and what follows from them.
    pub(super) fn covariates(&self) -> Vec<(String, Vec<f64>)> {
        let robots = &self.robots;
        let (samples, windows) = (&robots.samples, &self.windows);
        let is_turning = robots.shape.is_turning();
        let mut all: Vec<(String, Vec<f64>)> = Vec::new();
        let mut add = |name: &str, value: &dyn Fn(usize) -> f64| {
            let values: Vec<f64> = windows.iter().map(|w| value(w.start as usize)).collect();
            let mut known = values.iter().copied().filter(|value| value.is_finite());
            let first = known.next();
            if first.is_some_and(|first| known.any(|value| value != first)) {
                all.push((name.to_owned(), values));
            }
        };
        let speed = |command: Drive| {
            if is_turning { command[0] } else { command.iter().map(|v| v * v).sum::<f64>().sqrt() }
        };
        let before = |sample: usize| {
            let other = sample.checked_sub(1)?;
            let is_same = robots.tracks.iter().all(|track| track.start != sample);
            is_same.then_some(other)
        };
        let commanded = if robots.commands.is_inertial() {
            "commanded_acceleration_mps2"
        } else {
            "commanded_speed_mps"
        };
        add(commanded, &|s| speed(samples[s].command));
        if is_turning {
            add("commanded_turn", &|s| samples[s].command[1]);
        } else {
            add("commanded_direction_rad", &|s| {
                let [vx, vy, _] = samples[s].command;
                if vx == 0.0 && vy == 0.0 { f64::NAN } else { libm::atan2(vy, vx) }
            });
        }
        add("measured_speed_mps", &|s| {
            before(s).map_or(f64::NAN, |b| {
                let [p, q] = [samples[b].position_m, samples[s].position_m];
                libm::hypot(q[0] - p[0], q[1] - p[1]) / (samples[s].time_s - samples[b].time_s)
            })
        });
        add("change_of_command", &|s| {
            before(s).map_or(0.0, |b| {
                let [p, q] = [samples[b].command, samples[s].command];
                (0..3).map(|k| square(q[k] - p[k])).sum::<f64>().sqrt()
            })
        });
        // How long a command has been in force.
        let mut since = vec![0.0; samples.len()];
        for track in &robots.tracks {
            let mut changed_s = samples[track.start].time_s;
            for s in track.clone() {
                if track.start < s && samples[s].command != samples[s - 1].command {
                    changed_s = samples[s].time_s;
                }
                since[s] = samples[s].time_s - changed_s;
            }
        }
        add("time_since_change_s", &|s| since[s]);
        add("heading_rad", &|s| samples[s].heading_rad);
        add("x_m", &|s| samples[s].position_m[0]);
        add("y_m", &|s| samples[s].position_m[1]);
        add("z_m", &|s| samples[s].position_m[2]);
        add("time_s", &|s| samples[s].time_s);
        add("agent", &|s| f64::from(samples[s].agent));
        for (name, values) in &robots.covariates {
            add(name, &|s| values[s]);
        }
        all
    }
}
