//! Slopes of the log likelihoods of link rows, and what effects move their levels by.

use super::LinkFit;
use crate::linear::{
    Column, Dependence, Direction, Group, Linearised, Partition, Signature, SignatureSize, numbered,
};
use crate::links::LinkStudy;
use crate::links::terms::{TermSpec, TermState};
use crate::thresholds::{NODE_SQUARES_ACROSS, SHORTEST_CLUSTER_SHARE};
use crate::{Study as _, TermId};
use physics::link::End;
use proto::effect::Search;
use proto::ids::MoteId;
use std::collections::BTreeMap;

/// A column moves something if it moves some row by this (dB).
const MOVES_DB: f64 = 1e-9;

/// A column is a multiple of another if it differs by less than this share of its square.
const SAME_SHAPE: f64 = 1e-6;

/// Both ends of a row.
fn both((sender, receiver): &(End, End)) -> [&End; 2] {
    [sender, receiver]
}

fn moved(values: impl Iterator<Item = f64>) -> Column {
    values.map(|value_db| [value_db, 0.0, 0.0]).collect()
}

/// How many times as large a column is as the derivatives over a parameter, if it is a multiple of them.
fn multiple(column: &Column, derivatives: &[f64]) -> Option<f64> {
    let (mut square, mut product, mut unit) = (0.0, 0.0, 0.0);
    for ([moved_db, ..], derivative) in column.iter().zip(derivatives) {
        square += moved_db * moved_db;
        product += moved_db * derivative;
        unit += derivative * derivative;
    }
    let is_multiple = (1.0 - SAME_SHAPE) * square * unit < product * product;
    is_multiple.then(|| (square / unit).sqrt())
}

impl LinkStudy {
    pub(in crate::links) fn linearised_at(&self, fit: &LinkFit) -> Option<Linearised> {
        if self.rows.links.readings.is_given {
            return None;
        }
        let all: Vec<u32> = (0..self.n_rows() as u32).collect();
        let rows = self.row_likelihoods(fit, &all);
        let mut estimated = Vec::new();
        for ((&term, spec), state) in
            fit.terms.iter().zip(self.specs_of(&fit.terms)).zip(&fit.states)
        {
            match spec {
                TermSpec::Curve(_) => estimated.extend(self.curve_columns_of(term)),
                _ => {
                    if let Some(basis) = self.bases.tangent(&self.rows, term, spec, state) {
                        let columns = (0..state.values.len()).map(|k| basis.column(k));
                        estimated.extend(columns.map(|column| moved(column.iter().copied())));
                    }
                }
            }
        }
        Some(Linearised {
            slopes: moved(rows.iter().map(|row| row.over_level)),
            weights: moved(rows.iter().map(|row| row.weight.max(0.0))),
            estimated,
            errors: self
                .residuals(fit)
                .deviation
                .into_iter()
                .map(|db| [db, f64::NAN, f64::NAN])
                .collect(),
            directions: Vec::new(),
        })
    }

    pub(in crate::links) fn signatures_of(&self, term: TermId) -> Vec<Signature> {
        let spec = &self.specs[term];
        let is_plain_search = matches!(spec.search(), Search::Starts);
        let (TermSpec::Effect(entry) | TermSpec::Limited(entry, _)) = spec else {
            return Vec::new();
        };
        if !is_plain_search {
            return Vec::new();
        }
        let n_rows = self.n_rows();
        let signature = |(shape, state): (usize, &TermState)| {
            let basis = self.bases.tangent(&self.rows, term, spec, state)?;
            let column = moved((0..n_rows).map(|row| basis.contribution(&state.values, row)));
            let first = entry.fit.parameters.first().filter(|_| !state.values.is_empty());
            let by =
                |change| first.map_or(SignatureSize::Unknown, |it| SignatureSize::By(*it, change));
            if column.iter().any(|parts| MOVES_DB < parts[0].abs()) {
                let times = first.and_then(|_| multiple(&column, basis.column(0)));
                let size = times.map_or(SignatureSize::Unknown, by);
                return Some(Signature { column, size, shape });
            }
            // An amplitude that starts at nothing.
            let column = first.map(|_| moved(basis.column(0).iter().copied()))?;
            Some(Signature { column, size: by(1.0), shape })
        };
        TermState::starts(spec).iter().enumerate().filter_map(signature).collect()
    }

    pub(in crate::links) fn curve_columns_of(&self, term: TermId) -> Vec<Column> {
        let TermSpec::Curve(curve) = &self.specs[term] else { return Vec::new() };
        if curve.is_loss {
            return Vec::new();
        }
        let column = |knot: usize| {
            let share = |row: usize| {
                let shares = curve.shares(row).into_iter();
                shares.filter(|(k, _)| *k == knot).map(|(_, share)| share).sum()
            };
            moved((0..self.n_rows()).map(share))
        };
        (0..curve.knots.len()).map(column).collect()
    }

    pub(in crate::links) fn directions_of(&self) -> Vec<Direction> {
        if self.rows.links.readings.is_given {
            return Vec::new();
        }
        let column = moved(std::iter::repeat_n(1.0, self.n_rows()));
        vec![Direction { name: "readings are off", unit: "dB", column }]
    }

    pub(in crate::links) fn partitions_of(&self) -> Vec<Partition> {
        let measured = &self.rows.links.rows;
        let by = |of, key, members: &dyn Fn(usize) -> Vec<u32>| {
            let mut rows: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
            for row in 0..measured.len() {
                for id in members(row) {
                    rows.entry(id).or_default().push(row as u32);
                }
            }
            let groups = rows.into_iter().map(|(id, rows)| Group { id, rows }).collect();
            Partition { of, key, groups }
        };
        let mut partitions = vec![
            by("sender", None, &|row| vec![measured[row].tx]),
            by("receiver", None, &|row| vec![measured[row].rx]),
            by("node", Some("nodes"), &|row| vec![measured[row].tx, measured[row].rx]),
            by("campaign", Some("runs"), &|row| vec![measured[row].run]),
        ];
        partitions.retain(|partition| 1 < partition.groups.len());
        partitions
    }

    pub(in crate::links) fn dependence_of(&self) -> Dependence {
        let measured = &self.rows.links.rows;
        let times_s: Vec<f64> = measured.iter().map(|row| row.time_s).collect();
        let known = || times_s.iter().copied().filter(|time_s| time_s.is_finite());
        let length_s =
            known().fold(f64::NEG_INFINITY, f64::max) - known().fold(f64::INFINITY, f64::min);
        Dependence {
            shortest_s: if 0.0 < length_s { SHORTEST_CLUSTER_SHARE * length_s } else { f64::NAN },
            times_s,
            series: numbered(measured.iter().map(|row| row.run)),
            campaigns: numbered(measured.iter().map(|row| row.run)),
            nodes: Some(self.ends_of()),
            replicates: self.time.replicates().map(<[u32]>::to_vec),
        }
    }

    /// The nodes of each row, by number. A node that moves is another one in every square of the plane.
    fn ends_of(&self) -> Vec<[u32; 2]> {
        let is_still = |id: u32| self.rows.still().get(&id).copied().unwrap_or(true);
        let ends = || (0..self.n_rows()).flat_map(|row| both(self.rows.ends(row)));
        let places_m = || ends().filter(|end| !is_still(end.id.0)).map(|end| end.position_m);
        let span_m = (0..2)
            .map(|axis| {
                let along = || places_m().map(|place_m| place_m[axis]);
                along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
            })
            .fold(0.0, f64::max);
        let side_m = (span_m / NODE_SQUARES_ACROSS).max(1e-3);
        let key = |end: &End| {
            let is_still = is_still(end.id.0);
            let square = || self.rows.square_numbers(end.position_m, side_m);
            (end.id, if is_still { [0; 3] } else { square() })
        };
        let mut all: Vec<(MoteId, [i64; 3])> = ends().map(key).collect();
        all.sort_unstable();
        all.dedup();
        let number = |end: &End| all.binary_search(&key(end)).unwrap_or_default() as u32;
        let of_row = |row: usize| both(self.rows.ends(row)).map(number);
        (0..self.n_rows()).map(of_row).collect()
    }
}
