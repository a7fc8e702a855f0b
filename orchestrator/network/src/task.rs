//! Where the error of a swarm's task comes from: the network, or the robots.
//!
//! The model's robots are resimulated with the measured receptions: who heard whom, and when, is as measured; the content of the
//! messages is the simulation's. If the robots' model is right, they move as the measured robots did. Any remaining difference is
//! the robots' error.
//!
//! To isolate the network, the model's network runs over the measured tracks, and the same robots receive its deliveries. The two
//! resimulations differ only in the network, so their difference is the network's error.
//!
//! The model's network delivers other messages along the model's own tracks than along the measured ones, because robots
//! elsewhere hear others. That difference belongs to neither part.

pub mod comparison;
mod figures;
mod reception_network;
mod receptions;
pub(crate) mod request;
mod words;

use super::compare::ComparisonOptions;
use super::request::simulating;
use super::resimulate::{self, Resimulation, ResimulationError, ResimulationSettings};
use super::spread::{FigurePlacement, place};
use super::tracks::Tracks;
use bytes::Bytes;
use diagnose::Observer;
pub use figures::{FIGURES, TaskScale};
use figures::{N, Sheet, TaskFigures};
use metrics::Task;
use numbers::normal::Z_90;
use numbers::statistics;
use proto::rng::{Draws, Purpose};
use proto::types::seconds;
use rayon::prelude::*;
use reception_network::ReceptionNetwork;
use receptions::Receptions;
use study::thresholds::{LEAST_FIGURE_DIFFERENCE, PACKETS_LEVEL, TAIL_90};

/// A measured swarm, and the experiment that it is compared with.
#[derive(Debug)]
pub struct MeasuredSwarm<'a> {
    /// The experiment over the measured tracks: [`Resimulation::of_task`].
    pub resimulation: &'a Resimulation,
    /// Where robots were, from when the task began.
    pub tracks: &'a Tracks,
    /// Who heard whom, from then on.
    pub heard: &'a Receptions,
    /// Standard deviation of the noise of measured places, per component (m).
    pub sd_m: f64,
}

/// Figures of runs, and the distance of their robots from the measured ones.
#[derive(Clone, Debug)]
pub struct TaskRuns {
    /// Figures of each run.
    pub figures: Vec<TaskFigures>,
    /// Root mean square distance of robots from where they were measured, mean of the runs (m).
    pub off_m: f64,
}

impl TaskRuns {
    /// Mean of a figure over the runs.
    #[must_use]
    pub fn mean(&self, k: usize) -> f64 {
        statistics::mean(self.values(k))
    }

    /// Variance of a figure over the runs.
    fn variance(&self, k: usize) -> f64 {
        statistics::variance(self.values(k))
    }

    /// Where the middle 90 % of the runs lie in a figure; NaN where it is not known.
    #[must_use]
    pub fn middle(&self, k: usize) -> [f64; 2] {
        let mut values: Vec<f64> = self.values(k).collect();
        values.sort_by(f64::total_cmp);
        [TAIL_90, 1.0 - TAIL_90].map(|share| statistics::quantile(&values, share))
    }

    fn values(&self, k: usize) -> impl Iterator<Item = f64> + Clone {
        self.figures.iter().map(move |run| run.values[k])
    }

    fn scaled(&self) -> Vec<Vec<f64>> {
        self.figures.iter().map(|run| run.scaled().to_vec()).collect()
    }

    /// Chance that a run is as far out as this, and the figure in which it is furthest. What differs by less than
    /// [`LEAST_FIGURE_DIFFERENCE`] in all figures does not differ.
    fn place_of(&self, scaled: &[f64]) -> RunPlacement {
        let runs = self.scaled();
        let placed = place(scaled, &runs);
        let mean = |k: usize| statistics::mean(runs.iter().map(|run| run[k]));
        let known = (0..N).filter_map(|k| Some((k, placed.figures[k]?)));
        let apart: Vec<(usize, f64)> = known
            .filter(|(k, _)| LEAST_FIGURE_DIFFERENCE < (scaled[*k] - mean(*k)).abs())
            .map(|(k, standing)| (k, standing.z.abs()))
            .collect();
        let furthest = apart.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| *k);
        let p_value = if apart.is_empty() { 1.0 } else { placed.p_value };
        RunPlacement { p_value, furthest }
    }
}

/// P-value of a measurement or run among runs of a model.
#[derive(Clone, Copy, Debug)]
pub struct RunPlacement {
    /// P-value over all figures together.
    pub p_value: f64,
    /// The figure in which it is furthest; none where it does not differ.
    pub furthest: Option<usize>,
}

impl RunPlacement {
    /// Whether the difference is significant.
    #[must_use]
    pub fn is_found(&self) -> bool {
        self.p_value <= PACKETS_LEVEL
    }
}

/// The error of a task split.
#[derive(Clone, Debug)]
pub struct TaskSplit {
    /// Figures of the measurement.
    pub measured: TaskFigures,
    /// Runs of the model as configured, nothing replaced by measurements.
    pub whole: TaskRuns,
    /// The model's robots, who hear what the model's network delivers along the measured tracks.
    pub own: TaskRuns,
    /// The model's robots, who hear what was heard.
    pub heard: TaskRuns,
    /// The measurement among runs of the whole model; the same figure by figure.
    pub model: RunPlacement,
    /// None where a figure is not known.
    pub standings: Vec<Option<FigurePlacement>>,
    /// What was heard among what the model's network delivers along the same tracks.
    pub network: RunPlacement,
    /// What robots did among what the model's do with what was heard.
    pub robot: RunPlacement,
}

/// The part of a figure's error that goes with one source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaskPart {
    /// Estimated part of the error (in the figure's unit).
    pub value: f64,
    /// 90 % interval.
    pub interval: [f64; 2],
}

impl TaskSplit {
    /// The parts of the error in a figure: network, robot, and what goes with neither. They add up to the whole error.
    #[must_use]
    pub fn parts(&self, k: usize) -> [Option<TaskPart>; 3] {
        let n = self.whole.figures.len() as f64;
        let task_part = |value: f64, variance: f64| {
            let half = Z_90 * libm::sqrt(variance);
            let interval = [value - half, value + half];
            value.is_finite().then_some(TaskPart { value, interval })
        };
        let [whole, own, heard] = [&self.whole, &self.own, &self.heard];
        let of_mean = |runs: &TaskRuns| runs.variance(k) / n;
        [
            // What was heard is one of the things that might have been heard.
            task_part(heard.mean(k) - own.mean(k), own.variance(k) + of_mean(own)),
            task_part(self.measured.values[k] - heard.mean(k), heard.variance(k) + of_mean(heard)),
            task_part(own.mean(k) - whole.mean(k), of_mean(own) + of_mean(whole)),
        ]
    }
}

/// What has chances of its own: see [`Resimulation::seed`].
const ROBOTS: u64 = 1;
const NOISE: u64 = 2;

impl MeasuredSwarm<'_> {
    /// Splits the error. `asked.from_s` is done with: tracks and what was heard begin with the task.
    ///
    /// # Errors
    ///
    /// A side refuses its configuration, or robots need a column that the file does not have.
    pub fn split(
        &self,
        asked: ComparisonOptions,
        observer: &dyn Observer,
    ) -> Result<TaskSplit, ResimulationError> {
        let plan = self.resimulation.plan();
        let toml = plan.robotsim.effective_toml.as_ref().unwrap_or(&plan.robotsim.toml);
        let experiment = &plan.experiment;
        let sheet = Sheet::new(
            Task::from_config(toml),
            experiment.agent_count,
            self.resimulation.duration_s(),
            self.tracks.spacing_s(),
            seconds(experiment.step_ns),
        );
        let numbers: Vec<u64> = (0..asked.seeds).collect();
        simulating(observer, "simulating the whole model");
        let whole = self.runs(&sheet, &numbers, &|number| self.together(number))?;
        simulating(observer, "simulating the model's network along the measured tracks");
        let own = self
            .runs(&sheet, &numbers, &|number| self.hearing(number, &self.along_tracks(number)?))?;
        simulating(observer, "simulating with the measured receptions");
        let heard = self.runs(&sheet, &numbers, &|number| self.hearing(number, self.heard))?;
        let measured = sheet.figures(self.tracks);
        let scaled = measured.scaled();
        let of_heard: Vec<f64> = {
            let runs = heard.scaled();
            let n = runs.len() as f64;
            (0..N).map(|k| runs.iter().map(|run| run[k]).sum::<f64>() / n).collect()
        };
        Ok(TaskSplit {
            model: whole.place_of(&scaled),
            standings: place(&scaled, &whole.scaled()).figures,
            network: own.place_of(&of_heard),
            robot: heard.place_of(&scaled),
            measured,
            whole,
            own,
            heard,
        })
    }

    /// Figures of runs that go their ways, measured as the measured ones were.
    fn runs(
        &self,
        sheet: &Sheet,
        numbers: &[u64],
        run: &(dyn Fn(u64) -> Result<Tracks, ResimulationError> + Sync),
    ) -> Result<TaskRuns, ResimulationError> {
        let one = |&number: &u64| {
            let noise = Draws::new(self.resimulation.seed(number, NOISE), Purpose::Localization);
            let error_m = |agent, k, axis| self.error_m(noise, agent, k, axis);
            let seen = self.tracks.measured_of(&run(number)?, &error_m);
            Ok((sheet.figures(&seen), sheet.apart_m(&seen, self.tracks)))
        };
        let all: Result<Vec<(TaskFigures, f64)>, ResimulationError> =
            numbers.par_iter().map(one).collect();
        let all = all?;
        let off_m = all.iter().map(|(_, off_m)| off_m).sum::<f64>() / all.len() as f64;
        Ok(TaskRuns { figures: all.into_iter().map(|(figures, _)| figures).collect(), off_m })
    }

    /// An error of a measured place (m).
    fn error_m(&self, noise: Draws, agent: u64, k: u64, axis: u64) -> f64 {
        if self.sd_m == 0.0 { 0.0 } else { self.sd_m * noise.normal(agent, k, axis) }
    }

    /// Where robots begin: where they were measured, within the noise of that.
    fn begin(&self, number: u64) -> (Tracks, Bytes) {
        let noise = Draws::new(self.resimulation.seed(number, NOISE), Purpose::Scenario);
        let begin = self.tracks.begin(&|agent, axis| self.error_m(noise, agent, 0, axis));
        let csv = Bytes::from(begin.begin_csv());
        (begin, csv)
    }

    /// The whole model.
    fn together(&self, number: u64) -> Result<Tracks, ResimulationError> {
        let (mut ways, begin) = self.begin(number);
        self.resimulation.with_its_robots()?.drive(
            &ResimulationSettings {
                begin: Some(&begin),
                ..self.course(number, &self.resimulation.network())
            },
            &mut |step| ways.push(seconds(step.until_ns - step.since_ns), step.states),
        )?;
        Ok(ways)
    }

    /// What the model's network delivers along the measured tracks.
    fn along_tracks(&self, number: u64) -> Result<Receptions, ResimulationError> {
        let n = self.resimulation.plan().experiment.agent_count;
        let mut all = Vec::new();
        self.resimulation.drive(
            &self.course(number, &self.resimulation.network()),
            &mut |step| {
                receptions::collect(&step.reply.deliveries, n, step.since_ns, &mut all);
            },
        )?;
        Ok(Receptions::from_unsorted(all))
    }

    fn course<'b>(&self, number: u64, network: &'b toml::Table) -> ResimulationSettings<'b> {
        ResimulationSettings {
            network,
            number,
            trace: None,
            robots_seed: self.resimulation.seed(number, ROBOTS),
            begin: None,
            counts_from_start: true,
        }
    }

    /// The model's robots, who hear what is given.
    fn hearing(&self, number: u64, heard: &Receptions) -> Result<Tracks, ResimulationError> {
        let (mut ways, begin) = self.begin(number);
        let section = toml::Table::new();
        self.resimulation.drive_over(
            &ResimulationSettings { begin: Some(&begin), ..self.course(number, &section) },
            resimulate::built_in_robots(),
            ReceptionNetwork::new(heard, self.resimulation.plan().experiment.step_ns),
            &mut |step| ways.push(seconds(step.until_ns), step.states),
        )?;
        Ok(ways)
    }
}
