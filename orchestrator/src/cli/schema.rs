//! `murmuration schema`: the JSON Schema of experiment files, and of the answers that `--json` and `summary.json` hold.

use super::Failure;
use super::import::Import;
use ::convert::{Conversion, mapping};
use ::figure::content::Figure;
use bench::BenchAnswer;
use check::{DataCheck, ExperimentCheck, PacketCheck, SweepCheck};
use clap::Args;
use clap::builder::PossibleValuesParser;
use conformance::ConformanceAnswer;
use demo::DemoAnswer;
use diagnose::between::Between;
use diagnose::compare::comparison::Comparison;
use diagnose::diagnosis::Diagnosis;
use diagnose::extend::extension::Extension;
use diagnose::power::answer::Power;
use diagnose::simulate::simulation::Simulation;
use effects::EffectsAnswer;
use network::comparison::NetworkComparison;
use network::diagnosis::NetworkDiagnosis;
use network::extension::NetworkExtension;
use network::task::comparison::TaskComparison;
use picture::scene::Scene;
use record::metric::MetricsAnswer;
use record::run_summary::RunSummary;
use record::verify::VerifyReport;
use run::Reproduction;
use run::dry_run::DryRun;
use run::run_answer::RunAnswer;
use schemars::generate::SchemaSettings;
use schemars::{Schema, SchemaGenerator};
use serde_json::{Value, json};
use sweep::SweepSummary;
use sweep::compare_runs::RunsComparison;
use terminal::say;

/// What has a schema: experiment files, mapping files, and each answer by the command that gives it.
#[derive(Args)]
pub(super) struct SchemaArgs {
    /// Print the schema of this file or answer: experiment, mapping (the file of `convert`), or the command that
    /// writes the answer with --json. `run` and `sweep` also write theirs as summary.json
    #[arg(
        long,
        value_name = "NAME",
        default_value = EXPERIMENT,
        value_parser = PossibleValuesParser::new(names())
    )]
    of: String,
}

/// The name of experiment files.
const EXPERIMENT: &str = "experiment";
/// The name of mapping files.
const MAPPING: &str = "mapping";

/// Adds the schema of a type to a generator, and refers to it.
type OfType = fn(&mut SchemaGenerator) -> Schema;

/// The answers: the command that gives it, and the types that it may have.
const ANSWERS: [(&str, &[OfType]); 20] = [
    ("bench", &[SchemaGenerator::subschema_for::<BenchAnswer>]),
    (
        "check",
        &[
            SchemaGenerator::subschema_for::<ExperimentCheck>,
            SchemaGenerator::subschema_for::<SweepCheck>,
            SchemaGenerator::subschema_for::<DataCheck>,
            SchemaGenerator::subschema_for::<PacketCheck>,
        ],
    ),
    (
        "compare",
        &[
            SchemaGenerator::subschema_for::<Comparison>,
            SchemaGenerator::subschema_for::<NetworkComparison>,
            SchemaGenerator::subschema_for::<TaskComparison>,
        ],
    ),
    ("compare-runs", &[SchemaGenerator::subschema_for::<RunsComparison>]),
    ("conformance", &[SchemaGenerator::subschema_for::<ConformanceAnswer<'static>>]),
    ("convert", &[SchemaGenerator::subschema_for::<Conversion>]),
    ("import", &[SchemaGenerator::subschema_for::<Import>]),
    ("demo", &[SchemaGenerator::subschema_for::<DemoAnswer>]),
    (
        "diagnose",
        &[
            SchemaGenerator::subschema_for::<Diagnosis>,
            SchemaGenerator::subschema_for::<NetworkDiagnosis>,
            SchemaGenerator::subschema_for::<Between>,
        ],
    ),
    ("effects", &[SchemaGenerator::subschema_for::<EffectsAnswer>]),
    (
        "extend",
        &[
            SchemaGenerator::subschema_for::<Extension>,
            SchemaGenerator::subschema_for::<NetworkExtension>,
        ],
    ),
    ("figure", &[SchemaGenerator::subschema_for::<Figure>]),
    ("metrics", &[SchemaGenerator::subschema_for::<MetricsAnswer>]),
    ("power", &[SchemaGenerator::subschema_for::<Power>]),
    ("render", &[SchemaGenerator::subschema_for::<Scene>]),
    ("reproduce", &[SchemaGenerator::subschema_for::<Reproduction>]),
    (
        "run",
        &[
            SchemaGenerator::subschema_for::<RunAnswer>,
            SchemaGenerator::subschema_for::<RunSummary>,
            SchemaGenerator::subschema_for::<DryRun>,
        ],
    ),
    ("simulate", &[SchemaGenerator::subschema_for::<Simulation>]),
    (
        "sweep",
        &[SchemaGenerator::subschema_for::<SweepSummary>, SchemaGenerator::subschema_for::<DryRun>],
    ),
    ("verify", &[SchemaGenerator::subschema_for::<VerifyReport>]),
];

fn names() -> Vec<&'static str> {
    [EXPERIMENT, MAPPING].into_iter().chain(ANSWERS.iter().map(|(name, _)| *name)).collect()
}

/// `murmuration schema`.
pub(super) fn schema(args: &SchemaArgs) -> Result<(), Failure> {
    if args.of == MAPPING {
        say(format!("{:#}", mapping::schema()));
        return Ok(());
    }
    let answer = ANSWERS.iter().find(|(name, _)| *name == args.of);
    let schema = answer.map_or_else(experiment::schema, |(name, types)| of_answer(name, types));
    say(format!("{schema:#}"));
    Ok(())
}

/// The schema of an answer of one of several types.
fn of_answer(name: &str, types: &[OfType]) -> Value {
    let mut generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    let types: Vec<Schema> = types.iter().map(|of_type| of_type(&mut generator)).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": format!("Answer of murmuration {name}"),
        "anyOf": types,
        "$defs": generator.take_definitions(true),
    })
}
