//! How wrong is a model as configured, and where.

pub mod comparison;
mod constant;
pub mod words;

use crate::gain::Scores;
use crate::held_out;
use crate::ladder::Search;
use comparison::{Bin, Comparison, Explained, Place, SCHEMA};
use measure::account::DataAccount;
use numbers::normal::Z_90;
use numbers::power::square;
use numbers::statistics::{self, mean_ignoring_nan, nth_quantile, quantile_nearest};
use study::folds::Blocks;
use study::links::LinkStudy;
use study::links::predict::LinkResiduals;
use study::open::Subject;
use study::robots::RobotStudy;
use study::thresholds::{BOOTSTRAP_RESAMPLES, ERROR_BINS, FEWEST_ERROR_BIN_ROWS, TAIL_90};
use study::view::Viewed as _;
use study::{COMMON, RowScore, Study};

/// Scores by name.
type Named = Vec<(&'static str, f64)>;

/// A score with its 90 % interval.
struct BootstrapInterval {
    name: &'static str,
    value: f64,
    low: f64,
    high: f64,
}

/// Holds a link model against its measurements, nothing refitted but the noise.
pub(crate) fn links(
    study: &LinkStudy,
    search: &Search<'_, LinkStudy>,
    account: &DataAccount,
) -> Comparison {
    let scores = search.held_out_scores(&[], COMMON);
    let fit = search.full_fit(&[], COMMON, None);
    let LinkResiduals { deviation, scaled, surprise } = study.residuals(&fit);
    let constant = constant::found(study, search);
    let inside: Vec<f64> = scaled
        .iter()
        .map(|z| if z.is_nan() { f64::NAN } else { f64::from(u8::from(z.abs() <= Z_90)) })
        .collect();
    let blocks = study.blocks(COMMON);
    // Of rows of several frames, how far the share received lies from what is predicted.
    let links = &study.rows.links;
    let is_given = links.readings.is_given;
    let pdr_errors: Option<Vec<f64>> =
        (links.readings.is_aggregated && links.readings.has_losses() && !is_given).then(|| {
            let passes = held_out::predictions(study, search, &[]).passes;
            let rows = links.rows.iter().zip(passes);
            rows.map(|(row, passes)| square(row.received / row.frames - passes)).collect()
        });
    let summary_of = |rows: &[usize]| -> Named {
        let part: Vec<RowScore> = rows.iter().map(|&row| scores[row]).collect();
        let all = Scores::mean(&part);
        let mean = |values: &[f64]| mean_ignoring_nan(rows.iter().map(|&row| values[row]));
        let brier = |row: &usize| {
            let loss = scores[*row].reception_log_loss;
            let missed = 1.0 - libm::exp(-loss);
            missed * missed
        };
        let mut list = vec![
            ("log_score", all.log_score),
            (if is_given { "rmse_pdr" } else { "rmse_db" }, all.rmse),
            ("rmse_received_db", all.rmse_received_db.unwrap_or(f64::NAN)),
            (if is_given { "bias_pdr" } else { "bias_db" }, mean(&deviation)),
            (if is_given { "crps_pdr" } else { "crps_db" }, all.crps),
            ("coverage_90", mean(&inside)),
        ];
        if is_given {
            list.retain(|(name, _)| *name != "rmse_received_db");
        }
        if study.rows.links.readings.has_losses() {
            list.push(("reception_log_loss", all.reception_log_loss));
            list.push(("reception_brier", statistics::mean(rows.iter().map(brier))));
        }
        if let Some(errors) = &pdr_errors {
            list.push(("rmse_pdr", mean(errors).sqrt()));
        }
        list
    };
    let intervals = bootstrap(&summary_of(&scored(blocks)), blocks, &summary_of);
    let ranked_by = match &constant {
        Some(constant) => Errors {
            deviation: &deviation,
            without_constant: &constant.deviation,
            surprise: &constant.surprise,
            heading: &[],
        },
        None => Errors {
            deviation: &deviation,
            without_constant: &deviation,
            surprise: &surprise,
            heading: &[],
        },
    };
    let places = ranked(&study.covariates(), ranked_by);
    let comparison = finished(Subject::Links, blocks.unit, &intervals, places, account);
    let offset_db = constant.and_then(|constant| constant.offset_db);
    Comparison { offset_db, ..comparison }
}

/// The answer.
fn finished(
    kind: Subject,
    unit: &str,
    intervals: &[BootstrapInterval],
    places: Vec<Place>,
    account: &DataAccount,
) -> Comparison {
    let name = |interval: &BootstrapInterval| interval.name.to_owned();
    Comparison {
        schema: SCHEMA,
        kind,
        unit: unit.to_owned(),
        scores: intervals.iter().map(|it| (name(it), it.value)).collect(),
        intervals: intervals.iter().map(|it| (name(it), [it.low, it.high])).collect(),
        offset_db: None,
        places,
        account: account.clone(),
    }
}

/// Holds a model of robots against their samples, nothing refitted but the noise: scores of windows, held out.
pub(crate) fn robots(
    study: &RobotStudy,
    search: &Search<'_, RobotStudy>,
    account: &DataAccount,
) -> Comparison {
    let scores = search.held_out_scores(&[], COMMON);
    let view = study.view(&search.full_fit(&[], COMMON, None));
    let along = view.residuals();
    let blocks = study.blocks(COMMON);
    let summary_of = |rows: &[usize]| -> Named {
        let part: Vec<RowScore> = rows.iter().map(|&row| scores[row]).collect();
        let all = Scores::mean(&part);
        let n = 2.0 * rows.len() as f64;
        let inside = rows.iter().map(|&row| [view.scaled_at(row), view.scaled_across(row)]);
        let inside = inside.flatten().filter(|z| z.abs() <= Z_90).count() as f64;
        let bias = statistics::mean(rows.iter().map(|&row| along[row]));
        let mut list = vec![
            ("log_score", all.log_score),
            ("rmse_m", all.rmse),
            ("bias_m", bias),
            ("crps_m", all.crps),
            ("coverage_90", inside / n),
        ];
        list.extend(all.rmse_heading_rad.map(|rmse_rad| ("rmse_heading_rad", rmse_rad)));
        list
    };
    let intervals = bootstrap(&summary_of(&scored(blocks)), blocks, &summary_of);
    let nothing = vec![f64::NAN; along.len()];
    let errors = Errors {
        deviation: &along,
        without_constant: &along,
        surprise: &nothing,
        heading: &view.heading_rad,
    };
    let places = ranked(&study.covariates(), errors);
    finished(Subject::Robots, blocks.unit, &intervals, places, account)
}

/// Rows that are scored.
fn scored(blocks: &Blocks) -> Vec<usize> {
    let is_scored = |row: &usize| blocks.scored.as_ref().is_none_or(|scored| scored[*row]);
    (0..blocks.of_row.len()).filter(is_scored).collect()
}

/// 90 % intervals by resampling blocks. The draws are fixed: the same file gives the same interval.
fn bootstrap(
    values: &Named,
    blocks: &Blocks,
    of: &dyn Fn(&[usize]) -> Named,
) -> Vec<BootstrapInterval> {
    let mut rows_of_block: Vec<Vec<usize>> = vec![Vec::new(); blocks.n_blocks()];
    for row in scored(blocks) {
        rows_of_block[blocks.of_row[row] as usize].push(row);
    }
    rows_of_block.retain(|rows| !rows.is_empty());
    let n_blocks = rows_of_block.len();
    let draws = proto::rng::Draws::new(1, proto::rng::Purpose::Resample);
    let mut resampled: Vec<Vec<f64>> = vec![Vec::new(); values.len()];
    for resample in 0..BOOTSTRAP_RESAMPLES {
        let picked: Vec<usize> = (0..n_blocks)
            .map(|k| {
                let [word, ..] = draws.words(resample, k as u64, 0);
                (proto::rng::uniform(word) * n_blocks as f64) as usize
            })
            .collect();
        let rows: Vec<usize> =
            picked.iter().flat_map(|&block| rows_of_block[block].iter().copied()).collect();
        for (list, (_, value)) in resampled.iter_mut().zip(of(&rows)) {
            list.push(value);
        }
    }
    values
        .iter()
        .zip(&mut resampled)
        .map(|(&(name, value), list)| {
            list.sort_by(f64::total_cmp);
            let [low, high] = [TAIL_90, 1.0 - TAIL_90].map(|share| quantile_nearest(list, share));
            BootstrapInterval { name, value, low, high }
        })
        .collect()
}

/// Errors of rows, NaN where there is none.
#[derive(Clone, Copy)]
struct Errors<'a> {
    /// Measured less predicted.
    deviation: &'a [f64],
    /// The same beside a constant that all rows share: by it covariates are ranked.
    without_constant: &'a [f64],
    /// Surprise of reception beside that constant.
    surprise: &'a [f64],
    /// Measured less predicted heading; empty for links.
    heading: &'a [f64],
}

/// Covariates by how much of the error their bins explain, most first.
fn ranked(covariates: &[(String, Vec<f64>)], errors: Errors<'_>) -> Vec<Place> {
    let mut places: Vec<Place> =
        covariates.iter().filter_map(|(name, values)| place(name, values, errors)).collect();
    places.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    places
}

/// What the bins of a covariate explain of the error of readings or positions, of the surprise of reception, and of the error of
/// headings.
fn place(name: &str, values: &[f64], errors: Errors<'_>) -> Option<Place> {
    let edges = edges(values)?;
    let (Explained { explained, p_value }, _) =
        explained_in(&edges, values, errors.without_constant);
    let (_, sums) = explained_in(&edges, values, errors.deviation);
    let beside = |errors: &[f64]| {
        let is_known = errors.iter().any(|value| value.is_finite());
        is_known.then(|| explained_in(&edges, values, errors).0)
    };
    let (reception, heading) = (beside(errors.surprise), beside(errors.heading));
    let bins: Vec<Bin> = sums
        .iter()
        .enumerate()
        .filter(|(_, sum)| 0 < sum.0)
        .map(|(k, sum)| {
            let n = sum.0 as f64;
            let (bias, rmse) = (sum.1 / n, (sum.2 / n).sqrt());
            Bin { from: edges[k], to: edges[k + 1], n: sum.0, bias, rmse }
        })
        .collect();
    Some(Place { covariate: name.to_owned(), explained, p_value, reception, heading, bins })
}

/// How much of the variance of errors a covariate explains: the share that the means of its bins take away, less what the
/// means of as many bins of noise would. An offset that all rows share is not counted: no covariate explains it.
///
/// `None` if too few values are known, or all are equal.
#[must_use]
pub fn explained(values: &[f64], errors: &[f64]) -> Option<Explained> {
    Some(explained_in(&edges(values)?, values, errors).0)
}

/// Edges of bins with about as many values each.
fn edges(values: &[f64]) -> Option<Vec<f64>> {
    let mut known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    if known.len() < FEWEST_ERROR_BIN_ROWS * ERROR_BINS {
        return None;
    }
    let mut edges: Vec<f64> =
        (0..=ERROR_BINS).map(|k| nth_quantile(&known, k, ERROR_BINS)).collect();
    edges.dedup();
    (2 <= edges.len()).then_some(edges)
}

/// Of a bin: how many errors, their sum, the sum of their squares.
type BinSum = (usize, f64, f64);

/// [`explained`] for given edges, and the sums of the bins.
fn explained_in(edges: &[f64], values: &[f64], errors: &[f64]) -> (Explained, Vec<BinSum>) {
    let n_bins = edges.len() - 1;
    let bin = |value: f64| edges[1..n_bins].partition_point(|&edge| edge <= value);
    let mut sums: Vec<BinSum> = vec![(0, 0.0, 0.0); n_bins];
    for (&value, &error) in values.iter().zip(errors) {
        if value.is_finite() && error.is_finite() {
            let sum = &mut sums[bin(value)];
            *sum = (sum.0 + 1, sum.1 + error, sum.2 + error * error);
        }
    }
    let n: f64 = sums.iter().map(|sum| sum.0 as f64).sum();
    let total: f64 = sums.iter().map(|sum| sum.1).sum();
    let offset = total * total / n;
    let squares: f64 = sums.iter().map(|sum| sum.2).sum::<f64>() - offset;
    let filled = || sums.iter().filter(|sum| 0 < sum.0);
    let between: f64 = filled().map(|sum| sum.1 * sum.1 / sum.0 as f64).sum::<f64>() - offset;
    // One mean less than there are bins: that of all rows.
    let free = (filled().count() as f64 - 1.0).max(1.0);
    let left = n - free - 1.0;
    let f = between / free / ((squares - between) / left);
    let p_value = statrs::distribution::FisherSnedecor::new(free, left)
        .map_or(1.0, |f_law| statrs::distribution::ContinuousCDF::sf(&f_law, f));
    let explained = ((between / squares) - free / n).max(0.0);
    (Explained { explained, p_value }, sums)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_of_all_rows_is_not_explained_by_a_covariate() {
        let values: Vec<f64> = (0..800).map(f64::from).collect();
        // Noise that knows nothing of the row, with and without an offset, and a step half way.
        let noise = |row: usize| [1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0][row % 8];
        let errors = |offset: f64, step: f64| -> Vec<f64> {
            (0..800).map(|row| noise(row) + offset + if row < 400 { -step } else { step }).collect()
        };
        let share = |offset, step| explained(&values, &errors(offset, step)).unwrap();
        assert_eq!(share(5.0, 0.0).explained, 0.0);
        assert!(0.9 < share(5.0, 0.0).p_value);
        let [with, without] = [share(5.0, 1.0), share(0.0, 1.0)];
        assert!((with.explained - without.explained).abs() < 1e-9, "{with:?}, {without:?}");
        // The step has the variance of the noise; seven means explain 0.009 by chance, and a bin may have a row of either side.
        assert!((0.48..0.5).contains(&with.explained) && with.p_value < 1e-50, "{with:?}");
        assert_eq!(explained(&values[..79], &errors(0.0, 1.0)[..79]), None);
    }
}
