//! Whether links change together in time.
//!
//! Links that drift by themselves have a mean that drifts, too. What they share shows in that they agree: the sum of all is greater than
//! if each had its course at another time. So the courses of links are moved against each other in time, at random and round the end of
//! the campaign, which leaves each as it is (B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap, 1993, chapter 15: permutation
//! tests).

mod nodes;
mod rows;

use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::thresholds::{COURSE_SPANS, MOST_COURSES, PERMUTATIONS};
use proto::rng::{Draws, Purpose};
use std::collections::BTreeMap;

impl LinkStudy {
    /// Probability that links which change by themselves agree as much in what a fit leaves of their readings. 1 where there are fewer
    /// than two links.
    pub(in crate::links) fn p_value_of_agreement(&self, fit: &LinkFit) -> f64 {
        let mut links: BTreeMap<[u32; 3], Vec<(f64, f64)>> = BTreeMap::new();
        let mut ends: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
        for (row, residual_db) in self.residuals_db(fit) {
            let measured = &self.rows.links.rows[row];
            let [low, high] = [measured.tx.min(measured.rx), measured.tx.max(measured.rx)];
            links
                .entry([measured.run, low, high])
                .or_default()
                .push((measured.time_s, residual_db));
            let end = ends.entry(measured.run).or_insert((f64::INFINITY, f64::NEG_INFINITY));
            *end = (end.0.min(measured.time_s), end.1.max(measured.time_s));
        }
        let mut courses: BTreeMap<u32, Vec<[f64; COURSE_SPANS]>> = BTreeMap::new();
        for ([run, ..], rows) in &links {
            let (first_s, last_s) = ends[run];
            let courses = courses.entry(*run).or_default();
            courses.push(course(rows, first_s, last_s - first_s));
        }
        p_value(&courses.into_values().map(grouped).collect::<Vec<_>>())
    }
}

/// Sums of the residuals of a link, less their mean, by spans of time.
fn course(rows: &[(f64, f64)], first_s: f64, length_s: f64) -> [f64; COURSE_SPANS] {
    let mean = rows.iter().map(|(_, residual_db)| residual_db).sum::<f64>() / rows.len() as f64;
    let mut sums = [0.0; COURSE_SPANS];
    for (time_s, residual_db) in rows {
        let span = ((time_s - first_s) / length_s * COURSE_SPANS as f64) as usize;
        sums[span.min(COURSE_SPANS - 1)] += residual_db - mean;
    }
    sums
}

/// Courses of groups of links, where there are many.
fn grouped(courses: Vec<[f64; COURSE_SPANS]>) -> Vec<[f64; COURSE_SPANS]> {
    let mut groups = vec![[0.0; COURSE_SPANS]; courses.len().min(MOST_COURSES)];
    let n = groups.len();
    for (index, course) in courses.into_iter().enumerate() {
        for (sum, value) in groups[index % n].iter_mut().zip(course) {
            *sum += value;
        }
    }
    groups
}

/// Probability of as much agreement of the courses of each campaign by chance.
fn p_value(campaigns: &[Vec<[f64; COURSE_SPANS]>]) -> f64 {
    if campaigns.iter().all(|courses| courses.len() < 2) {
        return 1.0;
    }
    let draws = Draws::new(4, Purpose::Resample);
    let agreement = |moved_by: &dyn Fn(u64, u64) -> usize| -> f64 {
        let mut squares = 0.0;
        for (campaign, courses) in campaigns.iter().enumerate() {
            let mut sums = [0.0; COURSE_SPANS];
            for (link, course) in courses.iter().enumerate() {
                let by = moved_by(campaign as u64, link as u64);
                let moved = course[by..].iter().chain(&course[..by]);
                sums.iter_mut().zip(moved).for_each(|(sum, value)| *sum += value);
            }
            squares += sums.iter().map(|sum| sum * sum).sum::<f64>();
        }
        squares
    };
    let observed = agreement(&|_, _| 0);
    let at_random = |number: u64| {
        agreement(&|campaign, link| {
            let [word, ..] = draws.words(number, link, campaign);
            (word % COURSE_SPANS as u64) as usize
        })
    };
    let as_great = (0..PERMUTATIONS).filter(|&number| observed <= at_random(number)).count();
    (1 + as_great) as f64 / (1 + PERMUTATIONS) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Courses of links that forget themselves over 20 spans, and share this part of the variance.
    fn courses(shared: f64, seed: u64) -> Vec<[f64; COURSE_SPANS]> {
        let draws = Draws::new(seed, Purpose::Resample);
        let keeps = libm::exp(-1.0 / 20.0);
        let walk = |link: u64| {
            let mut value = draws.normal(link, 0, 0);
            let mut all = [0.0; COURSE_SPANS];
            for (span, slot) in all.iter_mut().enumerate() {
                *slot = value;
                let fresh = draws.normal(link, 1 + span as u64, 0);
                value = keeps * value + (1.0 - keeps * keeps).sqrt() * fresh;
            }
            all
        };
        let common = walk(1000);
        let link = |number: u64| {
            let own = walk(number);
            std::array::from_fn(|span| {
                shared.sqrt() * common[span] + (1.0 - shared).sqrt() * own[span]
            })
        };
        (0..15).map(link).collect()
    }

    #[test]
    fn links_that_drift_by_themselves_agree_no_more_than_by_chance() {
        let p_values: Vec<f64> = (0..100).map(|seed| p_value(&[courses(0.0, seed)])).collect();
        // 5 of 100 expected below 0.05; more than 12 in one case of 500.
        let few = p_values.iter().filter(|p_value| **p_value < 0.05).count();
        assert!(few <= 12, "{few}");
    }

    #[test]
    fn links_that_share_half_of_their_drift_agree() {
        let found = (0..20).filter(|&seed| p_value(&[courses(0.5, seed)]) < 0.005).count();
        assert!(18 <= found, "{found}");
    }

    #[test]
    fn a_single_link_agrees_with_none() {
        assert_eq!(p_value(&[courses(0.5, 1)[..1].to_vec()]), 1.0);
    }
}
