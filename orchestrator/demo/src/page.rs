//! Puts together what the page of a demo tells.

use super::answers::{ComparisonAnswer, DiagnosisAnswer};
use super::demo_answer::DemoAnswer;
use super::hidden::HiddenEffect;
use super::{DemoError, PAGE_FILE};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use experiment::program_name;
use measure::config::Compared;
use measure::memory::MemoryBudget;
use measure::table::DataTable;
use numbers::normal::Z_90;
use report::story::{Story, StoryCandidate, StoryParameter, StoryRow, StorySwarm, Symptom, page};
use std::path::Path;

/// A covariate that explains less of the error is not shown, nor one whose share has a greater p-value.
const LEAST_EXPLAINED: f64 = 0.02;
const GREATEST_P: f64 = 0.005;
/// The other name of `distance_m`, which is not shown beside it.
const LOG_DISTANCE: &str = "log10_distance";

/// What the page is made of.
pub(super) struct Told<'a> {
    pub(super) answer: &'a DemoAnswer,
    pub(super) comparison: &'a ComparisonAnswer,
    pub(super) diagnosis: &'a DiagnosisAnswer,
    pub(super) hidden: Option<&'a HiddenEffect>,
    /// Name of the file of measurements.
    pub(super) data: &'a str,
    /// What it holds, in words.
    pub(super) measured: String,
    /// Unit of errors.
    pub(super) unit: &'static str,
    /// The error of the true model, if it is known.
    pub(super) noise: Option<f64>,
    pub(super) commands: &'a [String],
    /// The swarm under each model, on light and on dark ground (SVG).
    pub(super) pictures: Vec<[String; 2]>,
}

impl Told<'_> {
    /// The page. `folder`: where the files are; `model`: the text of the model.
    pub(super) fn page(self, folder: &Path, model: &str) -> Result<String, DemoError> {
        let file = "residuals.csv";
        let unreadable = |problem: String| DemoError::Answer { file: file.to_owned(), problem };
        let table = DataTable::read(&folder.join(file), MemoryBudget::default())
            .map_err(|refusal| unreadable(refusal.to_string()))?;
        let column = |name: &str| {
            table.column(name).ok_or_else(|| unreadable(format!("has no column {name}")))
        };
        let keys = if self.unit == "dB" {
            ["tx", "rx", "tx_x_m", "tx_y_m", "rx_x_m", "rx_y_m"]
        } else {
            ["agent", "agent", "start_x_m", "start_y_m", "end_x_m", "end_y_m"]
        };
        let [from, to, from_x, from_y, to_x, to_y] = keys.map(column);
        let (from, to) = (from?, to?);
        let (from_x, from_y, to_x, to_y) = (from_x?, from_y?, to_x?, to_y?);
        let unit = self.unit.to_lowercase();
        let errors = column(&format!("residual_{unit}"))?;
        let with_effects = table.column(&format!("residual_with_effects_{unit}"));
        let rows = (0..table.n_rows())
            .map(|row| StoryRow {
                ends: [[from_x[row], from_y[row]], [to_x[row], to_y[row]]],
                numbers: [from[row] as u32, to[row] as u32],
                error: errors[row],
                error_with_effects: with_effects.map(|errors| errors[row]),
            })
            .collect();
        let config = Compared::of_text(&folder.join("model.toml"), model.to_owned(), &[])
            .map_err(|refusal| unreadable(refusal.to_string()))?;
        let Self { answer, diagnosis, .. } = self;
        let story = Story {
            seed: answer.seed,
            data_file: self.data,
            measured: self.measured.clone(),
            unit: self.unit,
            noise: self.noise.unwrap_or(0.0),
            site: &config.site,
            rows,
            symptom: self.symptom(&table),
            ladder: diagnosis
                .ladder
                .iter()
                .filter_map(|rung| Some((rung.model.clone(), rung.rmse?)))
                .collect(),
            candidates: self.candidates(),
            sentence: diagnosis.sentence.clone(),
            offset: self.comparison.offset_db.as_ref().map(|offset| offset.value),
            outcome: answer.outcome_sentence(),
            is_right: answer.outcome.is_right(),
            is_hidden: answer.hidden.is_some(),
            hidden: answer.hidden.clone().unwrap_or_else(|| "no effect".to_owned()),
            parameters: self.parameters(),
            errors: [answer.error, answer.error_extended],
            swarms: answer
                .swarms
                .iter()
                .zip(&self.pictures)
                .map(|(swarm, pictures)| StorySwarm {
                    title: match swarm.model {
                        "model" => "under the model".to_owned(),
                        "better" => "under the extended model".to_owned(),
                        _ => "under the truth".to_owned(),
                    },
                    along_mps: swarm.speed_along_leader_mps,
                    leader_speed_mps: swarm.leader_speed_mps,
                    floor_mps: swarm.flock_speed_floor_mps,
                    delivery_ratio: swarm.delivery_ratio,
                    pictures: [&pictures[0], &pictures[1]].map(|svg| address(svg)),
                })
                .collect(),
            commands: self.commands.to_vec(),
            next: self.next(),
            files: files(self.data, answer.error_extended.is_some()),
        };
        Ok(page(&story))
    }

    /// The covariate that explains most of the error.
    fn symptom(&self, table: &DataTable) -> Option<Symptom> {
        let places = self.comparison.places.iter().filter(|place| place.covariate != LOG_DISTANCE);
        let strongest = places.max_by(|a, b| {
            let share = |explained: Option<f64>| explained.unwrap_or(f64::NEG_INFINITY);
            share(a.explained).total_cmp(&share(b.explained))
        })?;
        let is_clear = LEAST_EXPLAINED < strongest.explained? && strongest.p_value? < GREATEST_P;
        is_clear.then_some(())?;
        Some(Symptom {
            name: strongest.covariate.clone(),
            values: table.column(&strongest.covariate)?.to_vec(),
            explained: strongest.explained?,
        })
    }

    fn candidates(&self) -> Vec<StoryCandidate> {
        let mut candidates: Vec<StoryCandidate> = self
            .diagnosis
            .candidates
            .iter()
            .filter_map(|candidate| {
                Some(StoryCandidate {
                    effect: candidate.effect.clone(),
                    gain: candidate.gain?,
                    half: Z_90 * candidate.standard_error.unwrap_or(0.0),
                    accepted: candidate.accepted,
                })
            })
            .collect();
        candidates.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        candidates
    }

    /// Parameters of the hidden effect, then of others that were named.
    fn parameters(&self) -> Vec<StoryParameter> {
        let mut list: Vec<StoryParameter> = Vec::new();
        if let Some(hidden) = self.hidden {
            list.extend(hidden.numbers().into_iter().filter_map(|(name, value)| {
                let estimate = self.answer.estimates.iter().find(|estimate| estimate.name == name);
                // A key that the model fixes, such as the exponent of its base, is no unknown.
                let is_estimated = estimate.is_some() || self.answer.estimates.is_empty();
                is_estimated.then(|| StoryParameter {
                    effect: hidden.kind.clone(),
                    unit: estimate.map(|estimate| estimate.unit.clone()).unwrap_or_default(),
                    hidden: Some(value),
                    found: estimate.map(|it| [it.value, it.low, it.high]),
                    name,
                })
            }));
        }
        let hidden = self.hidden.map(|hidden| hidden.kind.as_str());
        for other in self.diagnosis.accepted().filter(|it| Some(it.effect.as_str()) != hidden) {
            list.extend(other.parameters.iter().filter_map(|(name, parameter)| {
                Some(StoryParameter {
                    effect: other.effect.clone(),
                    name: name.clone(),
                    unit: parameter.unit.clone(),
                    hidden: None,
                    found: Some([parameter.value?, parameter.low?, parameter.high?]),
                })
            }));
        }
        list
    }

    /// What to try next.
    fn next(&self) -> Vec<String> {
        let program = program_name();
        let data = self.data;
        let kind = if data == "links.csv" { "measured-links" } else { "measured-robots" };
        let mut next = vec![
            format!("{program} demo --seed {}", self.answer.seed + 1),
            format!("{program} new my-{kind} --kind {kind}"),
        ];
        if let Some(hidden) = &self.answer.hidden {
            next.push(format!("{program} demo --effect none"));
            next.insert(0, format!("{program} effects {hidden}"));
        }
        next
    }
}

/// The address of a picture that the page itself holds.
fn address(svg: &str) -> String {
    format!("data:image/svg+xml;base64,{}", STANDARD.encode(svg))
}

/// Files beside the page, and what they hold.
fn files(data: &str, is_extended: bool) -> Vec<(String, &'static str)> {
    let mut files = vec![
        (data.to_owned(), "the measurements"),
        (
            "model.toml".to_owned(),
            "the model, a complete experiment; model-light.svg and model-dark.svg show its swarm at the end",
        ),
        ("comparison.html, comparison.json".to_owned(), "the model compared with the measurements"),
        ("diagnosis.html, diagnosis.json".to_owned(), "the diagnosis, with all candidates"),
        ("residuals.csv".to_owned(), "the error of each row"),
        (
            "truth.toml".to_owned(),
            "what made the measurements; truth.json is its comparison with them",
        ),
        ("runs/".to_owned(), "the recorded runs of the swarm, each with its report.html"),
        (PAGE_FILE.to_owned(), "this page"),
    ];
    if is_extended {
        files.push((
            "better.toml, better.json".to_owned(),
            "the extended model, and its comparison with the measurements",
        ));
    }
    files
}
