//! Statistical constants are in one file.

use checks::{repository, rust_files};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The file that lists them, and the crates that it covers.
const LIST: &str = "orchestrator/study/src/thresholds.rs";
const CRATES: [&str; 3] =
    ["orchestrator/study/src", "orchestrator/diagnose/src", "orchestrator/network/src"];

/// Names of numeric constants that may be where they are used, and what they are. No answer should depend on them.
const NUMERIC: &[(&str, &[&str])] = &[
    (
        "limits of iterations and of memory",
        &[
            "CHORD_STEPS",
            "END_STEPS",
            "FINAL_TRIES",
            "FOLD_STEPS",
            "HEADING_ROUNDS",
            "LOOK_STEPS",
            "MOST_LOOKS",
            "MOST_PASSED",
            "MOST_ROUNDS",
            "MOST_SILENT",
            "MOST_STEPS",
            "REFINED",
            "ROUNDS",
            "SAMPLE",
            "SETTLING_TIMES",
            "STEPS",
            "TOP_STEPS",
            "TRIAL_STEPS",
            "WARM_ROUNDS",
        ],
    ),
    (
        "starts of a fit that are followed",
        &["FINALISTS", "MANY_STARTS", "MOST_STARTS", "N_FOLLOWED", "N_TRIED", "ROUGH_SHARE_SD"],
    ),
    (
        "tolerances, and what keeps a computation finite",
        &[
            "AS_WIDE",
            "AT_END",
            "CLOSE",
            "CLOSE_DB",
            "CONVERGED_NATS",
            "CONVERGED_TIMES",
            "DAMPING_FLOOR",
            "LEAST_DAMPED",
            "LEAST_LEFT",
            "LEAST_PART",
            "LEAST_PASSES",
            "LEAST_SCALE_DB",
            "LEAST_SD_DB",
            "LEAST_START_DB",
            "LEAST_VARIANCE",
            "LEAST_WEIGHT",
            "MOST_BENT",
            "MOST_TILT",
            "MOVES_DB",
            "MOVES_M",
            "NEAR_NATS",
            "NOTHING",
            "NO_NOISE_DB",
            "PROMISING",
            "ROUNDING",
            "SAME",
            "SAME_DB",
            "SAME_M",
            "UNHEARD_OF",
        ],
    ),
    (
        "steps and ranges of derivatives, grids, tables and random walks",
        &[
            "BEND_STEPS",
            "BETWEEN",
            "CHANGES_DB",
            "COARSE",
            "CURVE_STEP",
            "DIRECTIONS",
            "FEWEST_SILENT",
            "FINEST_M",
            "FINE_MOMENTS",
            "FINE_PARTS",
            "FINE_S",
            "FORGOTTEN",
            "GRID_M",
            "HALF_STEP_DB",
            "HALVES",
            "KERNEL_REACH_SD",
            "KERNEL_STEP_SD",
            "LENGTHS",
            "LOSSES_DB",
            "MOMENTS",
            "MOST_POINTS",
            "N_LOOKS",
            "PARTS",
            "PLACES",
            "RADII_M",
            "REACH_SD",
            "READING_REACH_SD",
            "READING_STEP_SD",
            "SDS_M",
            "SILENT_POINTS",
            "SILENT_SD",
            "STEP_DB",
            "STEP_M",
            "STEP_S",
            "STEP_SD",
            "TAIL_HALVES",
            "THERE_SD",
            "WIDER",
        ],
    ),
    (
        "ranges of parameters",
        &[
            "FREEDOM",
            "MOST_DB",
            "MOST_LOST",
            "NOISE_DB",
            "POWERS_DBM",
            "READINGS_DBM",
            "SHARE_SD",
            "SMALL_LOSS",
            "WIDEST_M",
        ],
    ),
    (
        "quadrature",
        &[
            "ALIKE_SD",
            "HERMITE",
            "LEGENDRE",
            "NARROW",
            "OFFSETS",
            "OUTERMOST_NATS",
            "POINTS",
            "REACH_NATS",
        ],
    ),
    ("what is printed", &["DECIMALS", "MOST_COVARIATES"]),
    (
        "numbers of figures, and of random draws",
        &["D", "FIRST_SEED", "N", "NOISE", "PACKETS", "ROBOTS"],
    ),
    (
        "physics, standards and mathematics",
        &[
            "CHANNELS",
            "HALF_WAVE_M",
            "LN_LEAST_VARIANCE",
            "LN_TAU",
            "N_EACH",
            "PAYLOAD_BYTES",
            "SIDE",
        ],
    ),
];

/// Names of the constants of numbers that a file declares outside its tests, which are its last module.
fn numeric_constants(text: &str) -> Vec<&str> {
    let end = text.rfind("#[cfg(test)]\nmod tests").unwrap_or(text.len());
    let declared = text[..end].lines().filter_map(|line| {
        let line = line.trim_start();
        let line = if line.starts_with("pub") { line.split_once(' ')?.1 } else { line };
        let (name, rest) = line.strip_prefix("const ")?.split_once(": ")?;
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
    let listed: BTreeSet<&str> =
        NUMERIC.iter().flat_map(|(_, names)| names.iter().copied()).collect();
    let mut declared = BTreeSet::new();
    let mut others = Vec::new();
    for path in CRATES.iter().flat_map(|folder| files(&repository.join(folder))) {
        if path != repository.join(LIST) {
            let text = std::fs::read_to_string(&path).unwrap();
            for name in numeric_constants(&text) {
                declared.insert(name.to_owned());
                if !listed.contains(name) {
                    others.push(format!("{name} in {}", path.display()));
                }
            }
        }
    }
    assert!(others.is_empty(), "move these to {LIST}, or list them as numeric: {others:#?}");
    let stale: Vec<&&str> = listed.iter().filter(|name| !declared.contains(**name)).collect();
    assert!(stale.is_empty(), "no longer declared: {stale:#?}");
}

#[test]
fn every_threshold_says_what_it_is_and_is_used() {
    let repository = repository();
    let list = std::fs::read_to_string(repository.join(LIST)).unwrap();
    let names = numeric_constants(&list);
    assert!(100 <= names.len(), "{}", names.len());
    let lines: Vec<&str> = list.lines().collect();
    let uses: String = ["study", "network", "diagnose"]
        .iter()
        .flat_map(|name| files(&repository.join("orchestrator").join(name).join("src")))
        .filter(|path| *path != repository.join(LIST))
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
