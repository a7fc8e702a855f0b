//! Slopes of the log likelihoods of windows, and what effects move their ends by.

use super::density::Residual;
use super::fit_state::Unchanged;
use super::terms::{Starts, Term};
use super::{RobotFit, RobotStudy};
use crate::linear::{
    Column, Dependence, Direction, Group, Linearised, Partition, Signature, SignatureSize, numbered,
};
use crate::thresholds::SHORTEST_CLUSTER_WINDOWS;
use crate::{Study as _, TermId};
use proto::effect::Parameter;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Starts of an effect that are looked at.
const MOST_STARTS: usize = 8;
/// A column moves something if it moves some window by this (m, rad).
const MOVES_M: f64 = 1e-12;

impl RobotStudy {
    pub(super) fn linearised_at(&self, fit: &RobotFit) -> Option<Linearised> {
        let all: Vec<u32> = (0..self.n_rows() as u32).collect();
        let residuals = self.model.residuals(fit, &all)?;
        let derivatives = fit.derivatives.get_or_init(|| self.model.derivatives(fit)).as_ref()?;
        let (n_parts, n_components) = (fit.density.n_parts, fit.density.n_components());
        let of_components = |value: &dyn Fn(usize) -> f64| {
            std::array::from_fn(|part| if part < n_components { value(part) } else { 0.0 })
        };
        let of = |residual: &Residual| {
            let (parts, scales) = fit.density.pulls(residual);
            let slopes = of_components(&|part| scales[part] * parts[part]);
            (slopes, of_components(&|part| scales[part]))
        };
        let (slopes, weights) = residuals.iter().map(of).unzip();
        let minus = |column: &Column| column.iter().map(|moved| moved.map(|part| -part)).collect();
        let error = |residual: &Residual| {
            std::array::from_fn(|k| if k < n_parts { residual.parts_m[k] } else { f64::NAN })
        };
        Some(Linearised {
            slopes,
            weights,
            estimated: derivatives.by.iter().map(minus).collect(),
            errors: residuals.iter().map(error).collect(),
            directions: self.model.directions.clone(),
        })
    }

    pub(super) fn signatures_of(&self, fit: &RobotFit, term: TermId) -> Vec<Signature> {
        let Term::Effect(effect) = &self.model.terms[term] else { return Vec::new() };
        let Starts::At(starts) = &effect.starts else { return Vec::new() };
        let all: Vec<u32> = (0..self.n_rows() as u32).collect();
        let Some(without) = self.model.residuals(fit, &all) else { return Vec::new() };
        let step = starts.len().div_ceil(MOST_STARTS).max(1);
        let terms: Vec<TermId> = fit.terms.iter().copied().chain([term]).collect();
        let moved_by = |start: &[f64]| -> Option<Column> {
            let values = fit.values.iter().chain(start).copied().collect();
            let terms = terms.clone();
            let with = RobotFit { terms, values, derivatives: Arc::default(), ..fit.clone() };
            let with = self.model.residuals(&with, &all)?;
            let moved = |(without, with): (&Residual, &Residual)| without.less(with);
            Some(without.iter().zip(&with).map(moved).collect())
        };
        let moves = |column: &Column| column.iter().flatten().any(|m| MOVES_M < m.abs());
        let nulls =
            || effect.parameters.iter().enumerate().filter_map(|(k, it)| Some((k, it.null?)));
        let starts: Vec<&Vec<f64>> = starts.iter().step_by(step).collect();
        // Starts that differ by sizes only are of one shape; each direction in which one may be displaced is another.
        let shape_of = |start: &Vec<f64>, direction: usize| {
            let rest = |other: &Vec<f64>| -> Vec<u64> {
                let is_size = |k: usize| nulls().any(|(size, _)| size == k);
                (0..other.len()).filter(|&k| !is_size(k)).map(|k| other[k].to_bits()).collect()
            };
            let own = rest(start);
            let first = starts.iter().position(|other| rest(other) == own).unwrap_or_default();
            first * effect.parameters.len() + direction
        };
        let signatures = |start: &&Vec<f64>| -> Vec<Signature> {
            if let Some(column) = moved_by(start).filter(moves) {
                let changed: Vec<(usize, f64)> =
                    nulls().filter(|(k, null)| start[*k] != *null).collect();
                let size = match (changed[..].first(), &effect.parameters[..]) {
                    (Some(&(k, null)), all) if changed.len() == 1 => {
                        SignatureSize::By(all[k], start[k] - null)
                    }
                    (None, [limit]) if limit.null.is_none() => SignatureSize::At(*limit, start[0]),
                    _ => SignatureSize::Unknown,
                };
                let direction = changed.first().map_or(0, |(k, _)| *k);
                return vec![Signature { column, size, shape: shape_of(start, direction) }];
            }
            // Where an effect starts at nothing, a step from there.
            let displaced = |(k, parameter): (usize, &Parameter)| {
                let mut displaced = (*start).clone();
                let up = start[k] + parameter.step;
                displaced[k] = if parameter.max < up { start[k] - parameter.step } else { up };
                let column = moved_by(&displaced).filter(moves)?;
                let size = SignatureSize::By(*parameter, displaced[k] - start[k]);
                Some(Signature { column, size, shape: shape_of(start, k) })
            };
            effect.parameters.iter().enumerate().filter_map(displaced).collect()
        };
        starts.par_iter().flat_map_iter(signatures).collect()
    }

    pub(super) fn curve_columns_of(&self, fit: &RobotFit, term: TermId) -> Vec<Column> {
        if self.model.curve(term).is_none() {
            return Vec::new();
        }
        let all: Vec<u32> = (0..self.n_rows() as u32).collect();
        let terms: Vec<TermId> = fit.terms.iter().copied().chain([term]).collect();
        let n_before = fit.values.len();
        let new = std::iter::repeat_n(0.0, self.model.n_numbers(term));
        let values = fit.values.iter().copied().chain(new).collect();
        let with_curve = RobotFit { terms, values, derivatives: Arc::default(), ..fit.clone() };
        let known = Unchanged::default();
        let columns = || {
            let (residuals, paths) = self.model.residuals_and_paths(&with_curve, &all, known)?;
            self.model.jacobian(&with_curve, (&residuals, &paths), &all, n_before)
        };
        let minus = |column: Column| column.iter().map(|moved| moved.map(|part| -part)).collect();
        columns()
            .map(|derivatives| derivatives.by.into_iter().map(minus).collect())
            .unwrap_or_default()
    }

    pub(super) fn directions_of(&self) -> Vec<Direction> {
        let frames = &self.model.directions;
        let column = |moved: &dyn Fn([f64; 2]) -> [f64; 3]| -> Column {
            frames.iter().map(|&frame| moved(frame)).collect()
        };
        let direction = |name, column| Direction { name, unit: "m", column };
        let mut all = vec![
            direction("robots are off along their motion", column(&|_| [1.0, 0.0, 0.0])),
            direction("robots are off to the left", column(&|_| [0.0, 1.0, 0.0])),
        ];
        if !self.model.tracks.is_relative() {
            all.push(direction(
                "robots are off to the east",
                column(&|[cos, sin]| [cos, -sin, 0.0]),
            ));
            all.push(direction(
                "robots are off to the north",
                column(&|[cos, sin]| [sin, cos, 0.0]),
            ));
        }
        if self.model.tracks.robots.is_spatial {
            all.push(direction("robots are off upwards", column(&|_| [0.0, 0.0, 1.0])));
        }
        all
    }

    pub(super) fn partitions_of(&self) -> Vec<Partition> {
        let tracks = &self.model.tracks;
        let by = |of, key, id: &dyn Fn(usize) -> u32| {
            let mut rows: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
            for row in 0..tracks.windows.len() {
                rows.entry(id(row)).or_default().push(row as u32);
            }
            let groups = rows.into_iter().map(|(id, rows)| Group { id, rows }).collect();
            Partition { of, key: Some(key), groups }
        };
        let start = |row: usize| tracks.start(&tracks.windows[row]);
        let mut partitions = vec![
            by("robot", "agents", &|row| start(row).agent),
            by("campaign", "runs", &|row| start(row).run),
        ];
        partitions.retain(|partition| 1 < partition.groups.len());
        partitions
    }

    pub(super) fn dependence_of(&self) -> Dependence {
        let tracks = &self.model.tracks;
        let windows = || tracks.windows.iter();
        Dependence {
            times_s: windows().map(|window| tracks.start(window).time_s).collect(),
            series: windows().map(|window| window.track).collect(),
            campaigns: numbered(windows().map(|window| tracks.start(window).run)),
            shortest_s: SHORTEST_CLUSTER_WINDOWS * tracks.window_s(0),
            nodes: None,
            replicates: self.in_time.replicates().map(<[u32]>::to_vec),
        }
    }
}
