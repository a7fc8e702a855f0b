//! The commands that hold a model against measurements.

use super::between::BetweenArgs;
use super::corrected::corrected;
use super::formula::FormulaArgs;
use super::inputs::print_account;
use super::measured_args::{AnswerArgs, DataArgs};
use super::packets::{Adding, ResimulationArgs};
use super::pictures::Pictures;
use super::search_log::SearchLog;
use super::stop::{BudgetArgs, Stopper};
use super::task::{self, Files};
use super::{Failure, inputs, write_json, write_whole};
use crate::console::say;
use clap::Args;
use diagnose::answer::{self, Measurements};
use diagnose::compare;
use diagnose::defects;
use diagnose::extend::{self, ExtendError, extension};
use diagnose::ladder::Search;
use diagnose::progress::SearchProgress;
use diagnose::{limits, scan};
use measure::config::Compared;
use measure::packets;
use measure::table::DataTable;
use report::measured::MeasuredAnswer;
use report::packets::NetworkAnswer;
use std::path::PathBuf;
use std::sync::Arc;
use study::formula::FORMULA;
use study::open::{self, DataAccount, Subject};
use study::robots::RobotStudy;
use study::{COMMON, Study};

/// The same, and how long the search may take; or two files in place of one.
#[derive(Args)]
#[command(mut_arg("data", |data| data.required(false).required_unless_present("between")))]
pub(super) struct DiagnoseArgs {
    #[command(flatten)]
    answer: AnswerArgs,
    #[command(flatten)]
    budget: BudgetArgs,
    #[command(flatten)]
    between: BetweenArgs,
}

/// The same, and what tells where an error comes from.
#[derive(Args)]
pub(super) struct CompareArgs {
    #[command(flatten)]
    answer: AnswerArgs,
    /// Packets only: links measured during the same campaign (link samples or an aggregated table). Together with
    /// --positions, attributes the error to robots, radio and protocol
    #[arg(long, value_name = "FILE")]
    links: Option<PathBuf>,
    /// Robots only: receptions during the same campaign (packets, link samples, or the folder of a run). Attributes the
    /// error of the swarm's task to network and robots; the configuration must be a complete experiment
    #[arg(long, value_name = "FILE", conflicts_with_all = ["links", "positions"])]
    heard: Option<PathBuf>,
}

#[derive(Args)]
pub(super) struct ExtendArgs {
    #[command(flatten)]
    data: DataArgs,
    /// Name of the effect to add; the command `effects` lists them. Repeatable
    #[arg(long, value_name = "NAME", required_unless_present_any = ["all", "formula"])]
    effect: Vec<String>,
    /// Run diagnose and add every effect that it accepts
    #[arg(long, conflicts_with = "effect")]
    pub(super) all: bool,
    #[command(flatten)]
    formula: FormulaArgs,
    /// Write the extended configuration to this file (TOML); - for standard output
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
    /// If Ctrl-C or --budget stops the search of --all early: add the effects that it has accepted so far
    #[arg(long, requires = "all")]
    partial: bool,
    #[command(flatten)]
    budget: BudgetArgs,
    /// Links only: look for defects of the measurement, fit to the corrected measurements, and write these to this file (CSV);
    /// - for standard output
    #[arg(long, value_name = "FILE")]
    pub(super) corrected_data: Option<PathBuf>,
    #[command(flatten)]
    resimulation: ResimulationArgs,
}

/// `murmuration compare`.
pub(super) fn compare(args: &CompareArgs) -> Result<(), Failure> {
    let CompareArgs { answer: args, links, heard } = args;
    args.check_places()?;
    let data = &args.data;
    if let Some(heard) = heard {
        data.foreign.refuse("tracks with --heard")?;
        data.refuse_choices("tracks with --heard")?;
        args.refuse_residuals("tracks with --heard")?;
        let files = Files { config: &data.config, set: &data.set(), data: data.data(), heard };
        let found = task::split(&files, args.resimulation.asked())?;
        let found = NetworkAnswer::Task(&found);
        return args.write_network(found, &format!(" --heard {}", heard.display()));
    }
    let (config, table) = inputs::files(&data.config, &data.set(), data.data())?;
    if packets::has_shape(&table).is_ok() {
        args.refuse_residuals("packets")?;
        let opened = data.open_packets(&args.resimulation, &table)?;
        let links = match links {
            Some(path) => {
                args.resimulation.needs_positions()?;
                Some((DataTable::read(path).map_err(Failure::request)?, path))
            }
            None => None,
        };
        let mut found = super::packets::compare(&opened)?;
        let mut further = String::new();
        if let Some((links, path)) = links {
            found.error_split = Some(super::packets::split(&opened, &config, &links)?);
            further = format!(" --links {}", path.display());
        }
        return args.write_network(NetworkAnswer::Comparison(&found), &further);
    }
    if let Some(links) = links {
        return Err(Failure::request(format!(
            "--links {}: applies only if --data holds packets; to compare link measurements themselves, give them as --data",
            links.display()
        )));
    }
    match open::subject(&table).map_err(Failure::request)? {
        Subject::Links => {
            data.foreign.refuse("link samples")?;
            let (study, account) =
                open::links(&config, &table, &data.choices()).map_err(Failure::request)?;
            let log = SearchLog::new(None);
            let report = |progress: SearchProgress<'_>| log.log(progress);
            let search = Search::new(&study, &report);
            print_account(&account);
            let found = compare::links(&study, &search, &account);
            say(compare::words::text(&found));
            let answer = MeasuredAnswer::Comparison(&found);
            args.write(&config, answer, || Pictures::of_links(&study, &search, &[]))
        }
        Subject::Robots => {
            let (study, account) =
                data.foreign.open_robots(&config, &table, &data.choices(), None)?;
            let log = SearchLog::new(None);
            let report = |progress: SearchProgress<'_>| log.log(progress);
            let search = Search::new(&study, &report);
            print_account(&account);
            let found = compare::robots(&study, &search, &account);
            say(compare::words::text(&found));
            let answer = MeasuredAnswer::Comparison(&found);
            args.write(&config, answer, || Pictures::of_robots(&study, &search, &[]))
        }
    }
}

/// Packets have no rows to fit an expression to.
const NO_FORMULA: &str = "--formula applies to measured links and robots only: the network has no effect of kind \
                          \"formula\". Use --effect NAME for packets";

/// `murmuration extend`.
pub(super) fn extend(args: &ExtendArgs) -> Result<(), Failure> {
    let data = &args.data;
    let stopper = Stopper::listen(args.budget)?;
    let stop = stopper.flag();
    let (config, table) = inputs::files(&data.config, &data.set(), data.data())?;
    let subject = open::subject(&table);
    if let (Some(path), Ok(Subject::Robots) | Err(_)) = (&args.corrected_data, &subject) {
        return Err(Failure::request(format!(
            "--corrected-data {}: defects are looked for in link samples only, and {} holds none; leave the option out",
            path.display(),
            data.data().display()
        )));
    }
    if packets::has_shape(&table).is_ok() {
        if args.formula.wanted().is_some() {
            return Err(Failure::request(NO_FORMULA));
        }
        let opened = data.open_packets(&args.resimulation, &table)?.with_stop_flag(stop);
        let adding = Adding {
            config: &data.config,
            text: &config.text,
            effects: &args.effect,
            all: args.all,
            output: &args.output,
            json: data.json.as_deref(),
            is_partial_wanted: args.partial,
        };
        return super::packets::extend(&opened, &adding, &stopper);
    }
    match subject.map_err(Failure::request)? {
        Subject::Links => {
            data.foreign.refuse("link samples")?;
            let (study, account) =
                open::links(&config, &table, &data.choices()).map_err(Failure::request)?;
            let study = study.with_stop_flag(stop);
            let (mut study, account) = corrected(args, &table, study, account, &stopper)?;
            if let Some(wanted) = args.formula.wanted() {
                study.add_formula(&wanted).map_err(Failure::request)?;
            }
            let mut thin = if args.all { study.thinned() } else { None };
            let (searched, whole) = match &mut thin {
                Some(thin) => (thin, Some(&mut study)),
                None => (&mut study, None),
            };
            extend_with(
                args,
                (&config, &account),
                searched,
                whole,
                ("netsim.phy.effect", data.unit()),
                &stopper,
                |_, _, _| Ok(()),
            )
        }
        Subject::Robots => {
            let (mut study, account) =
                data.foreign.open_robots(&config, &table, &data.choices(), Some(&stopper))?;
            if let Some(wanted) = args.formula.wanted() {
                study.add_formula(&wanted).map_err(Failure::request)?;
            }
            let mut study = study.with_stop_flag(stop);
            let section = ("robotsim.dynamics.effect", "m");
            let is_applied = |search: &Search<'_, RobotStudy>,
                              study: &RobotStudy,
                              added: Added<'_>| {
                let fit = search.full_fit(added.terms, COMMON, None);
                let extended = Compared::of_text(&config.path, added.text.to_owned(), &data.set());
                let extended = extended.map_err(Failure::work)?;
                let names = added.names.join(", ");
                data.foreign.require_applied((study, &fit), &extended, &table, &names, &stopper)
            };
            let (searched, read) = (&mut study, (&config, &account));
            extend_with(args, read, searched, None, section, &stopper, is_applied)
        }
    }
}

/// Effects that a configuration is extended by.
struct Added<'a> {
    terms: &'a [usize],
    names: &'a [String],
    /// The extended configuration.
    text: &'a str,
}

/// `is_applied`: refuses an extension that a run would not apply.
fn extend_with<S: Study>(
    args: &ExtendArgs,
    (config, account): (&Compared, &DataAccount),
    study: &mut S,
    mut whole: Option<&mut S>,
    (section, unit): (&str, &str),
    stopper: &Stopper,
    is_applied: impl Fn(&Search<'_, S>, &S, Added<'_>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    print_account(account);
    let log = SearchLog::new(Some(stopper));
    let report = |progress: SearchProgress<'_>| log.log(progress);
    let mut known = Arc::default();
    let terms = if args.all {
        let ladder;
        (ladder, known) = limits::selection(study, whole.as_deref_mut(), &report);
        if ladder.stopped.is_some() && !args.partial {
            log.clear();
            return Err(stopper.refuse_partial(
                "Give it more time, or add the effects that were accepted until then with --partial",
            ));
        }
        if ladder.stopped.is_some() && ladder.accepted.is_empty() {
            log.clear();
            return Err(
                stopper.refuse_partial("No effect was accepted until then; give it more time")
            );
        }
        ladder.accepted
    } else {
        let formula = args.formula.wanted().map(|_| FORMULA);
        let found: Result<Vec<usize>, _> = args
            .effect
            .iter()
            .map(String::as_str)
            .chain(formula)
            .map(|name| extend::candidate(&*study, name))
            .collect();
        found.map_err(Failure::request)?
    };
    let search = Search::new(&*study, &report).with_known(known);
    let extended =
        extend::extend(config, account, study, &search, &terms, section, whole.as_deref());
    log.clear();
    if search.is_stopped() && !args.partial {
        // The fit to these effects has not converged.
        return Err(stopper.refuse_partial("Give it more time"));
    }
    if matches!(extended, Err(ExtendError::Nothing)) && args.corrected_data.is_some() {
        // What was asked for is written.
        say("no effect is missing in the corrected measurements: --output is not written");
        return Ok(());
    }
    let extended = extended.map_err(Failure::work)?;
    let added = Added { terms: &terms, names: &extended.answer.added, text: &extended.text };
    is_applied(&search, study, added)?;
    write_whole("--output", &args.output, &extended.text)?;
    let answer = &extended.answer;
    say(format!("{}: {}", args.output.display(), extension::text(answer, unit)));
    write_json(args.data.json.as_deref(), answer)?;
    stopper.require_complete(answer.complete)
}

/// `murmuration diagnose`.
pub(super) fn diagnose(args: &DiagnoseArgs) -> Result<(), Failure> {
    let DiagnoseArgs { answer: args, budget, between } = args;
    between.refuse_data(args.data.data.as_deref())?;
    args.check_places()?;
    let stopper = Stopper::listen(*budget)?;
    let stop = stopper.flag();
    let data = &args.data;
    if between.is_asked() {
        args.refuse_residuals("what changed between two files")?;
        let found = between.diagnose((&data.config, &data.set()), data.choices(), &stopper)?;
        args.write_between(&found, &between.words())?;
        return stopper.require_complete(found.complete);
    }
    let (config, table) = inputs::files(&data.config, &data.set(), data.data())?;
    if packets::has_shape(&table).is_ok() {
        args.refuse_residuals("packets")?;
        let opened = data.open_packets(&args.resimulation, &table)?.with_stop_flag(stop);
        let found = super::packets::diagnose(&opened, &stopper)?;
        args.write_network(NetworkAnswer::Diagnosis(&found), "")?;
        return stopper.require_complete(found.complete);
    }
    let log = SearchLog::new(Some(&stopper));
    let report = |progress: SearchProgress<'_>| log.log(progress);
    match open::subject(&table).map_err(Failure::request)? {
        Subject::Links => {
            data.foreign.refuse("link samples")?;
            let (study, account) =
                open::links(&config, &table, &data.choices()).map_err(Failure::request)?;
            let study = study.with_stop_flag(stop);
            print_account(&account);
            let log = SearchLog::new(Some(&stopper));
            let report = |progress: SearchProgress<'_>| log.log(progress);
            let found_defects = defects::find(&study, &report);
            let account = defects::corrected_account(&account, &found_defects);
            let corrected = defects::corrected(&study, &found_defects).map_err(Failure::request)?;
            let mut study = corrected.unwrap_or(study);
            let mut thin = study.thinned();
            let (ladder, known) = match &mut thin {
                Some(thin) => limits::selection(thin, Some(&mut study), &report),
                None => limits::selection(&mut study, None, &report),
            };
            let (searched, whole) =
                thin.as_ref().map_or((&study, None), |thin| (thin, Some(&study)));
            let search = Search::new(searched, &report).with_known(known);
            let left = scan::scan_residuals(searched, &search, &ladder);
            let measurements = Measurements {
                subject: Subject::Links,
                error_unit: data.unit(),
                searched: Some(searched.n_rows()),
                account: &account,
            };
            let found = answer::answer(searched, &search, &ladder, measurements, &left, whole);
            log.clear();
            let found = defects::with_defects(found, &found_defects);
            if whole.is_some() {
                say(format!(
                    "searched in a subset of {} rows, spread evenly over all rows; parameters fitted to all rows",
                    searched.n_rows()
                ));
            }
            say(diagnose::words::text(&found));
            args.write(&config, MeasuredAnswer::Diagnosis(&found), || {
                Pictures::of_links(searched, &search, &ladder.accepted)
            })?;
            stopper.require_complete(found.complete)
        }
        Subject::Robots => {
            let (study, account) =
                data.foreign.open_robots(&config, &table, &data.choices(), Some(&stopper))?;
            let mut study = study.with_stop_flag(stop);
            print_account(&account);
            let (ladder, known) = limits::selection(&mut study, None, &report);
            let search = Search::new(&study, &report).with_known(known);
            let left = scan::scan_residuals(&study, &search, &ladder);
            let measurements = Measurements {
                subject: Subject::Robots,
                error_unit: "m",
                searched: None,
                account: &account,
            };
            let found = answer::answer(&study, &search, &ladder, measurements, &left, None);
            log.clear();
            say(diagnose::words::text(&found));
            args.write(&config, MeasuredAnswer::Diagnosis(&found), || {
                Pictures::of_robots(&study, &search, &ladder.accepted)
            })?;
            stopper.require_complete(found.complete)
        }
    }
}
