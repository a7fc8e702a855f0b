//! `murmuration diagnose --between A B`: what changed between two campaigns.

use super::Failure;
use super::inputs::{compared, print_account};
use super::search_log::SearchLog;
use super::stop::Stopper;
use crate::console::say;
use clap::Args;
use diagnose::between::answer::{Campaigns, answer};
use diagnose::between::contrast::Sides;
use diagnose::between::search::{BaseTerm, pairs, search};
use diagnose::between::{Between, SidesOf, Spans, words};
use diagnose::defects::{self, MeasurementDefect};
use diagnose::ladder::Search;
use diagnose::limits;
use diagnose::progress::SearchProgress;
use measure::account::DataAccount;
use measure::config::Compared;
use measure::pooled::{Pooled, pool};
use measure::table::DataTable;
use measure::{packets, time_of_day};
use std::path::{Path, PathBuf};
use study::choices::Choices;
use study::folds::FEWEST_BLOCKS;
use study::links::LinkStudy;
use study::open::{self, OpenError, Subject};
use study::{COMMON, Study};

/// Two campaigns in place of one.
#[derive(Args)]
pub(super) struct BetweenArgs {
    /// Find what changed between two campaigns of the same site or robots: fit the model to A, and list the changes
    /// that are needed to predict B. Links and robots only
    #[arg(
        long,
        num_args = 2,
        value_names = ["A", "B"],
        conflicts_with_all = ["split", "fit_runs", "score_runs", "given_rssi"]
    )]
    between: Option<Vec<PathBuf>>,
}

impl BetweenArgs {
    /// Whether two campaigns are to be compared.
    pub(super) fn is_asked(&self) -> bool {
        self.between.is_some()
    }

    /// Refuses `--data` beside `--between`. Clap's own message names the conflict, but not the choice.
    pub(super) fn refuse_data(&self, data: Option<&Path>) -> Result<(), Failure> {
        match data {
            Some(data) if self.is_asked() => Err(Failure::request(format!(
                "{}: does not apply with --data {}; give either --data FILE to diagnose one file, or --between A B to \
                 compare two",
                self.words(),
                data.display()
            ))),
            _ => Ok(()),
        }
    }

    /// The option, as it would be typed.
    pub(super) fn words(&self) -> String {
        let files = self.between.iter().flatten();
        files.fold("--between".to_owned(), |words, file| format!("{words} {}", file.display()))
    }

    /// Finds what changed and prints it. `config`: the file, and keys that are set.
    pub(super) fn diagnose(
        &self,
        (config, set): (&Path, &[String]),
        choices: Choices,
        stopper: &Stopper,
    ) -> Result<Between, Failure> {
        let files = self.between.as_deref().unwrap_or_default();
        let found = between(&compared(config, set)?, files, &choices, stopper)?;
        say(words::text(&found));
        Ok(found)
    }
}

/// Reads both files and finds what changed.
fn between(
    config: &Compared,
    files: &[PathBuf],
    choices: &Choices,
    stopper: &Stopper,
) -> Result<Between, Failure> {
    let read = |path: &PathBuf| DataTable::read(path).map_err(Failure::request);
    let [a, b] = files else {
        return Err(Failure::request("--between: requires two files, as in --between A.csv B.csv"));
    };
    let tables = [read(a)?, read(b)?];
    let subjects = subjects(&tables)?;
    let pooled = pool(&tables[0], &tables[1])
        .map_err(|why| Failure::request(format!("--between: {why}")))?;
    let opening = Opening { tables: &tables, pooled: &pooled, stopper };
    match subjects {
        Subject::Links => {
            let open = |table: &DataTable| open::links(config, table, choices);
            let [(study_a, account_a), (study_b, account_b)] =
                opening.both(open, |study| study.with_stop_flag(stopper.flag()))?;
            let (study, _) = open(&pooled.table).map_err(Failure::request)?;
            let study = study.with_stop_flag(stopper.flag());
            let is_aggregated = |study: &LinkStudy| study.rows.links.readings.is_aggregated;
            if is_aggregated(&study_a) != is_aggregated(&study_b) {
                return Err(Failure::request(
                    "--between: one file has a row per frame and the other rows of several frames; convert both alike",
                ));
            }
            let defects = opening.defects([&study_a, &study_b]);
            let thinned = |study: LinkStudy| study.thinned().unwrap_or(study);
            let searched = study.thinned().map(|study| study.n_rows());
            let (study_a, study) = (thinned(study_a), thinned(study));
            let accounts = [account_a, account_b];
            let too_little = suffices(&study_b);
            opening.answer(
                (study_a, too_little),
                study,
                (&accounts, &defects),
                (Subject::Links, "dB", searched),
            )
        }
        Subject::Robots => {
            let open = |table: &DataTable| open::robots(config, table, choices);
            let [(study_a, account_a), (study_b, account_b)] =
                opening.both(open, |study| study.with_stop_flag(stopper.flag()))?;
            if study_a.robots().shape != study_b.robots().shape {
                return Err(Failure::request(
                    "--between: the robots of the two files are commanded in different ways; convert both alike",
                ));
            }
            let (study, _) = open(&pooled.table).map_err(Failure::request)?;
            let study = study.with_stop_flag(stopper.flag());
            let accounts = [account_a, account_b];
            let too_little = suffices(&study_b);
            opening.answer(
                (study_a, too_little),
                study,
                (&accounts, &SidesOf::default()),
                (Subject::Robots, "m", None),
            )
        }
    }
}

/// What both files are about.
fn subjects(tables: &[DataTable; 2]) -> Result<Subject, Failure> {
    for table in tables {
        if packets::has_shape(table).is_ok() {
            return Err(Failure::request(format!(
                "--between {}: does not apply to packets, which are compared as one run; diagnose each file with --data",
                table.path.display()
            )));
        }
    }
    let [a, b] = tables.each_ref().map(open::subject);
    let (a, b) = (a.map_err(Failure::request)?, b.map_err(Failure::request)?);
    if a != b {
        let name =
            |subject| if subject == Subject::Links { "link samples" } else { "robot samples" };
        return Err(Failure::request(format!(
            "--between: {} holds {} and {} holds {}; give two files of the same kind",
            tables[0].path.display(),
            name(a),
            tables[1].path.display(),
            name(b)
        )));
    }
    Ok(a)
}

/// Why a campaign alone has too few blocks to find anything in.
fn suffices<S: Study>(study: &S) -> Option<String> {
    let blocks = study.blocks(COMMON);
    (!blocks.suffices()).then(|| {
        format!("{} {}, and at least {FEWEST_BLOCKS} are required", blocks.n_scored(), blocks.unit)
    })
}

/// Both files and the pooled table, to be opened and searched.
struct Opening<'a> {
    tables: &'a [DataTable; 2],
    pooled: &'a Pooled,
    stopper: &'a Stopper,
}

type Opened<S> = (S, DataAccount);

impl Opening<'_> {
    /// Both files as studies of their own, with their accounts, which are printed.
    fn both<S>(
        &self,
        open: impl Fn(&DataTable) -> Result<Opened<S>, OpenError>,
        with_stop_flag: impl Fn(S) -> S,
    ) -> Result<[Opened<S>; 2], Failure> {
        let opened = |table: &DataTable| {
            let (study, account) = open(table).map_err(Failure::request)?;
            print_account(&account);
            Ok((with_stop_flag(study), account))
        };
        Ok([opened(&self.tables[0])?, opened(&self.tables[1])?])
    }

    /// Searches A, then both.
    fn answer<S: Study>(
        &self,
        (mut study_a, too_little_b): (S, Option<String>),
        mut study: S,
        (accounts, defects): (&[DataAccount; 2], &SidesOf<Vec<MeasurementDefect>>),
        (subject, error_unit, searched): (Subject, &'static str, Option<usize>),
    ) -> Result<Between, Failure> {
        let log = SearchLog::new(Some(self.stopper));
        let report = |progress: SearchProgress<'_>| log.log(progress);
        let sides = Sides::of(&study, &self.pooled.second_runs).ok_or_else(|| {
            Failure::request("--between: one of the two files has no row that can be used")
        })?;
        let too_little = [("A", suffices(&study_a)), ("B", too_little_b)]
            .into_iter()
            .find_map(|(name, why)| Some(format!("{name} has only {}", why?)));
        let (ladder, _) = limits::selection(&mut study_a, None, &report);
        let base = BaseTerm::of(&study_a, &ladder.accepted);
        let found = search(&mut study, &base, &sides, &report);
        let pairs = pairs(&mut study, &found, &sides);
        let campaigns = Campaigns {
            subject,
            error_unit,
            searched,
            accounts: [&accounts[0], &accounts[1]],
            too_little: too_little.as_deref(),
            time_of_day_h: self.time_of_day_h(),
            left_out_columns: &self.pooled.left_out,
            defects,
            is_base_complete: ladder.stopped.is_none(),
        };
        let search = Search::new(&study, &report).with_known(found.known.clone());
        let between = answer(&study, &found, &pairs, &sides, &search, campaigns);
        log.clear();
        Ok(between)
    }

    /// Defects of the measured links of both files.
    fn defects(&self, [a, b]: [&LinkStudy; 2]) -> SidesOf<Vec<MeasurementDefect>> {
        let log = SearchLog::new(Some(self.stopper));
        let report = |progress: SearchProgress<'_>| log.log(progress);
        let of = |study| defects::find(study, &report).iter().map(MeasurementDefect::of).collect();
        let found = SidesOf { a: of(a), b: of(b) };
        log.clear();
        found
    }

    /// When both were measured, in hours since midnight (UTC).
    fn time_of_day_h(&self) -> Option<Spans> {
        let hours = |table: &DataTable| -> Option<Vec<f64>> {
            Some(time_of_day::epoch_s(table)?.into_iter().map(time_of_day::hours).collect())
        };
        Spans::of(&hours(&self.tables[0])?, &hours(&self.tables[1])?)
    }
}
