//! Statistical constants are in one file, and one beside it.

use checks::{repository, rust_files};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The files that list them, and the crates that they cover.
const LISTS: [&str; 2] =
    ["orchestrator/study/src/thresholds.rs", "orchestrator/study/src/thresholds/two_campaigns.rs"];
const CRATES: [&str; 3] =
    ["orchestrator/study/src", "orchestrator/diagnose/src", "orchestrator/network/src"];

/// A file, and names of constants in it.
type FileNames = (&'static str, &'static [&'static str]);

/// Numeric constants that may be where they are used: what they are, and by file under `orchestrator/` their names. No answer
/// should depend on them.
const NUMERIC: &[(&str, &[FileNames])] = &[
    (
        "limits of iterations and of memory",
        &[
            ("diagnose/src/identifiability/detection.rs", &["MOST_STEPS"]),
            ("diagnose/src/ladder.rs", &["MOST_ROUNDS"]),
            ("diagnose/src/rivals.rs", &["MOST_RIVALS"]),
            ("diagnose/src/score_test.rs", &["MOST_PROJECTIONS"]),
            ("network/src/candidate_fits.rs", &["FINAL_TRIES", "ROUNDS"]),
            ("network/src/task/figures.rs", &["MOST_LOOKS"]),
            ("study/src/defects/clock_rate.rs", &["MOST_LOOKS", "MOST_ROWS"]),
            ("study/src/defects/evidence.rs", &["STEPS"]),
            ("study/src/defects/node_place.rs", &["MOST_ROWS", "ROWS_OF_LINK"]),
            (
                "study/src/links/fit/run.rs",
                &["MOST_ROUNDS", "MOST_STEPS", "TRIAL_STEPS", "WARM_ROUNDS"],
            ),
            ("study/src/links/fit/search/headings.rs", &["STEPS"]),
            ("study/src/links/fit/search/places.rs", &["MOST_LOOKS", "STEPS"]),
            ("study/src/links/fit/starts.rs", &["HEADING_ROUNDS"]),
            ("study/src/links/likelihood/aggregated.rs", &["TOP_STEPS"]),
            ("study/src/links/likelihood/register.rs", &["MOST_STEPS"]),
            ("study/src/links/predict/estimates.rs", &["END_STEPS"]),
            ("study/src/links/random_effects/covariance.rs", &["REFINED"]),
            ("study/src/links/rows.rs", &["MOST_SILENT"]),
            ("study/src/links/terms/basis.rs", &["SAMPLE"]),
            ("study/src/robots/command_thresholds.rs", &["MOST_PASSED"]),
            (
                "study/src/robots/fit.rs",
                &["CHORD_STEPS", "FOLD_STEPS", "LOOK_STEPS", "MOST_STEPS", "SETTLING_TIMES"],
            ),
            ("study/src/robots/screen.rs", &["STEPS"]),
        ],
    ),
    (
        "starts of a fit that are followed",
        &[
            ("study/src/links/fit.rs", &["ROUGH_SHARE_SD"]),
            ("study/src/links/fit/search.rs", &["FINALISTS"]),
            ("study/src/links/fit/starts.rs", &["FINALISTS", "MANY_STARTS"]),
            ("study/src/robots/discs.rs", &["N_TRIED"]),
            ("study/src/robots/fit.rs", &["N_FOLLOWED", "TRIED_GAINS"]),
            ("study/src/robots/linear.rs", &["MOST_STARTS"]),
        ],
    ),
    (
        "tolerances, and what keeps a computation finite",
        &[
            ("diagnose/src/between/recordings.rs", &["LEAST_SHARE"]),
            ("diagnose/src/ladder/contradiction.rs", &["TURNED_RAD"]),
            ("diagnose/src/measured.rs", &["SAME_M"]),
            ("diagnose/src/score_test.rs", &["LEAST_LEFT"]),
            ("network/src/candidate_fits.rs", &["SAME"]),
            ("network/src/likelihood.rs", &["LEAST_LEFT", "UNHEARD_OF"]),
            ("network/src/split.rs", &["NO_NOISE_DB"]),
            ("study/src/defects/evidence.rs", &["CLOSE", "LEAST_SD_DB"]),
            ("study/src/defects/outliers.rs", &["LEAST_SCALE_DB"]),
            ("study/src/defects/position_noise.rs", &["LEAST_VARIANCE"]),
            ("study/src/links/fit.rs", &["CONVERGED_NATS"]),
            ("study/src/links/fit/linear.rs", &["MOVES_DB", "SAME_SHAPE"]),
            ("study/src/links/fit/run.rs", &["LEAST_START_DB"]),
            ("study/src/links/fit/search/headings.rs", &["CONVERGED_NATS"]),
            ("study/src/links/likelihood.rs", &["LEAST_WEIGHT", "MOST_TILT"]),
            ("study/src/links/likelihood/aggregated.rs", &["LEAST_PART"]),
            ("study/src/links/likelihood/density.rs", &["LEAST_WEIGHT"]),
            ("study/src/links/likelihood/reception_share.rs", &["LEAST_PASSES"]),
            ("study/src/links/likelihood/register.rs", &["AS_WIDE", "CLOSE_DB"]),
            ("study/src/links/predict.rs", &["SAME_DB"]),
            ("study/src/links/random_effects/covariance.rs", &["AT_END"]),
            ("study/src/links/terms/basis.rs", &["ROUNDING"]),
            (
                "study/src/robots/contradiction.rs",
                &["CORRELATED_NOISE", "MEDIAN_ABSOLUTE", "NOISE_OF_BOUND", "NOISE_SDS"],
            ),
            ("study/src/robots/derivatives.rs", &["MOST_BENT"]),
            (
                "study/src/robots/fit.rs",
                &["CONVERGED_NATS", "CONVERGED_TIMES", "NEAR_NATS", "PROMISING"],
            ),
            ("study/src/robots/fit_state.rs", &["DAMPING_FLOOR", "LEAST_DAMPED"]),
            ("study/src/robots/ground.rs", &["FEWEST_LANDED", "OFF_SHARE", "RESTS_M", "RESTS_S"]),
            ("study/src/robots/headings.rs", &["MOST_CONCENTRATED", "N_POINTS", "SERIES_FROM"]),
            ("study/src/robots/linear.rs", &["MOVES_M"]),
            ("study/src/robots/motion.rs", &["SAME_M"]),
            ("study/src/robots/odd_commands.rs", &["HALF_S"]),
            ("study/src/symbolic.rs", &["NOTHING"]),
        ],
    ),
    (
        "steps and ranges of derivatives, grids, tables and random walks",
        &[
            ("diagnose/src/identifiability/detection.rs", &["STEP"]),
            ("diagnose/src/ladder/limits/column.rs", &["FINE_MOMENTS", "MOMENTS"]),
            ("diagnose/src/pure_error.rs", &["MEDIAN_ABSOLUTE", "REPEAT_CLUSTERS", "Z_95"]),
            ("network/src/candidate_fits.rs", &["PLACES"]),
            ("network/src/candidates.rs", &["BETWEEN", "STEPS"]),
            ("study/src/defects/clock_rate.rs", &["CURVATURE_SHARE", "N_STEPS", "STEP_M"]),
            ("study/src/defects/clock_skew.rs", &["FINE_S", "STEP_S"]),
            ("study/src/defects/evidence.rs", &["REACH_SD", "STEP_SD"]),
            ("study/src/defects/node_place.rs", &["N_DIRECTIONS", "RINGS", "SQUARES", "STEP_M"]),
            ("study/src/defects/position_noise.rs", &["SDS_M", "STEP_M"]),
            ("study/src/defects/register_limits.rs", &["STEP_DB"]),
            ("study/src/links/fit.rs", &["CURVE_STEP"]),
            (
                "study/src/links/fit/search.rs",
                &["FINEST_M", "GRID_M", "LOSSES_DB", "MOST_POINTS", "RADII_M"],
            ),
            ("study/src/links/fit/search/headings.rs", &["DIRECTIONS"]),
            ("study/src/links/fit/search/places.rs", &["CHANGES_DB", "FORGOTTEN", "MOVES_M"]),
            ("study/src/links/fit/search/windows.rs", &["FINE_PARTS", "PARTS"]),
            (
                "study/src/links/likelihood.rs",
                &["REACH_SD", "READING_REACH_SD", "READING_STEP_SD", "THERE_SD"],
            ),
            ("study/src/links/likelihood/aggregated.rs", &["SILENT_POINTS", "SILENT_SD", "WIDER"]),
            ("study/src/links/likelihood/density.rs", &["REACH_SD", "STEP_SD"]),
            (
                "study/src/links/likelihood/reception.rs",
                &["KERNEL_REACH_SD", "KERNEL_STEP_SD", "REACH_SD", "STEP_DB"],
            ),
            ("study/src/links/likelihood/reception_share.rs", &["HALF_STEP_DB"]),
            ("study/src/links/random_effects/cells.rs", &["FINEST_M"]),
            ("study/src/links/random_effects/covariance.rs", &["LENGTHS"]),
            ("study/src/links/rows.rs", &["FEWEST_SILENT"]),
            (
                "study/src/robots/command_thresholds.rs",
                &["COARSE", "N_TIMES", "PARTS", "TAIL_HALVES"],
            ),
            ("study/src/robots/density.rs", &["BROAD_WEIGHT"]),
            ("study/src/robots/derivatives.rs", &["BEND_STEPS"]),
            ("study/src/robots/discs.rs", &["N_LOOKS"]),
            ("study/src/robots/headings.rs", &["FAR_NOISES", "PART_WINDOWS", "TURN_RAD"]),
            ("study/src/robots/inertial.rs", &["GRAVITY_RANGE_MPS2", "LEAST_S"]),
            ("study/src/symbolic.rs", &["HALVES"]),
        ],
    ),
    (
        "ranges of parameters",
        &[
            ("study/src/defects/outliers.rs", &["FREEDOM"]),
            ("study/src/defects/register_limits.rs", &["READINGS_DBM"]),
            ("study/src/links/fit.rs", &["NOISE_DB", "SHARE_SD"]),
            ("study/src/links/fit/search/places.rs", &["MOST_DB", "WIDEST_M"]),
            ("study/src/links/likelihood/register.rs", &["POWERS_DBM"]),
            ("study/src/links/terms.rs", &["MOST_LOST", "SMALL_LOSS"]),
        ],
    ),
    (
        "quadrature",
        &[
            ("study/src/links/likelihood.rs", &["LEGENDRE", "OFFSETS"]),
            (
                "study/src/links/likelihood/aggregated.rs",
                &["ALIKE_SD", "HERMITE", "NARROW", "OUTERMOST_NATS", "POINTS", "REACH_NATS"],
            ),
        ],
    ),
    (
        "what is printed",
        &[
            ("diagnose/src/compare/words.rs", &["MOST_COVARIATES"]),
            ("diagnose/src/identifiability/words.rs", &["MOST_LISTED"]),
            ("diagnose/src/next.rs", &["DECIMALS"]),
        ],
    ),
    (
        "numbers of figures, and of random draws",
        &[
            ("network/src/candidate_fits.rs", &["FIRST_SEED"]),
            ("network/src/likelihood.rs", &["D", "PACKETS"]),
            ("network/src/task.rs", &["NOISE", "ROBOTS"]),
            ("network/src/task/figures.rs", &["N"]),
        ],
    ),
    (
        "physics, standards and mathematics",
        &[
            ("network/src/resimulate.rs", &["PAYLOAD_BYTES"]),
            ("study/src/defects/channel_shift.rs", &["CHANNELS"]),
            ("study/src/links/likelihood/aggregated.rs", &["LN_LEAST_VARIANCE", "LN_TAU"]),
            ("study/src/links/likelihood/reception_share.rs", &["LN_TAU"]),
            ("study/src/links/random_effects/cells.rs", &["HALF_WAVE_M", "SIDE"]),
            ("study/src/robots/curve.rs", &["N_EACH"]),
        ],
    ),
];

/// Names of the constants of numbers that a file declares outside its tests, which are its last module.
fn numeric_constants(text: &str) -> Vec<&str> {
    let end = text.rfind("#[cfg(test)]\nmod tests").unwrap_or(text.len());
    let declared = text[..end].lines().filter_map(|line| {
        let (visibility, declared) = line.trim_start().split_once("const ")?;
        let is_restricted = visibility.starts_with("pub(") && visibility.ends_with(") ");
        if !is_restricted && !["", "pub "].contains(&visibility) {
            return None;
        }
        let (name, rest) = declared.split_once(": ")?;
        let kind = rest.split('=').next()?;
        let is_number = |word: &str| {
            ["f64", "f32", "usize", "u8", "u16", "u32", "u64", "i8", "i16", "i32", "i64"]
                .contains(&word)
        };
        let is_constant = name.chars().all(|letter| !letter.is_ascii_lowercase());
        let mut words = kind.split(|letter: char| !letter.is_ascii_alphanumeric());
        (is_constant && words.any(is_number)).then_some(name)
    });
    declared.collect()
}

/// The sources of a folder without the files that hold tests only.
fn files(folder: &Path) -> Vec<PathBuf> {
    let is_test = |path: &PathBuf| {
        path.iter().any(|part| ["tests", "tests.rs"].iter().any(|name| part == *name))
    };
    rust_files(folder).into_iter().filter(|path| !is_test(&folder_of(folder, path))).collect()
}

/// A path from a folder on.
fn folder_of(folder: &Path, path: &Path) -> PathBuf {
    path.strip_prefix(folder).unwrap().to_owned()
}

#[test]
fn constants_that_decide_an_answer_are_in_the_list_of_thresholds() {
    let repository = repository();
    let listed: BTreeSet<(PathBuf, &str)> = NUMERIC
        .iter()
        .flat_map(|(_, files)| files.iter())
        .flat_map(|(file, names)| names.iter().map(move |&name| (PathBuf::from(file), name)))
        .collect();
    let mut declared = BTreeSet::new();
    let mut others = Vec::new();
    for path in CRATES.iter().flat_map(|folder| files(&repository.join(folder))) {
        if !LISTS.iter().any(|list| path == repository.join(list)) {
            let text = std::fs::read_to_string(&path).unwrap();
            let file = folder_of(&repository.join("orchestrator"), &path);
            for name in numeric_constants(&text) {
                let is_listed =
                    listed.iter().any(|(other, listed)| *other == file && *listed == name);
                if !is_listed {
                    others.push(format!("{name} in {}", file.display()));
                }
                declared.insert((file.clone(), name.to_owned()));
            }
        }
    }
    assert!(
        others.is_empty(),
        "move these to one of {LISTS:?}, or list them as numeric: {others:#?}"
    );
    let is_declared =
        |(file, name): &&(PathBuf, &str)| declared.contains(&(file.clone(), (*name).to_owned()));
    let stale: Vec<&(PathBuf, &str)> = listed.iter().filter(|it| !is_declared(it)).collect();
    assert!(stale.is_empty(), "no longer declared: {stale:#?}");
}

#[test]
fn every_threshold_says_what_it_is_and_is_used() {
    let repository = repository();
    let list: String =
        LISTS.iter().map(|list| std::fs::read_to_string(repository.join(list)).unwrap()).collect();
    let names = numeric_constants(&list);
    assert!(100 <= names.len(), "{}", names.len());
    let lines: Vec<&str> = list.lines().collect();
    let uses: String = ["study", "network", "diagnose"]
        .iter()
        .flat_map(|name| files(&repository.join("orchestrator").join(name).join("src")))
        .filter(|path| !LISTS.iter().any(|list| *path == repository.join(list)))
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect();
    let words: BTreeSet<&str> =
        uses.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_').collect();
    for name in names {
        let place = lines.iter().position(|line| line.contains(&format!("const {name}:"))).unwrap();
        assert!(lines[place - 1].starts_with("///"), "{name} has no comment");
        assert!(words.contains(name), "{name} decides nothing");
    }
}
