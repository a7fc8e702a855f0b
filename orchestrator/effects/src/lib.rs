//! The catalogue of physical effects: what there is, and what each one says of itself.
//!
//! Nothing is written down here: both simulators' lists are read out, so that an effect is complete where it is defined.
//!
//! | module | content |
//! |---|---|
//! | here | the list, and an effect as text and as JSON |
//! | `examples` | its example, ready to be pasted |
//! | `picture` | its plot |
//! | [`page()`] | the page of all effects in the user guide |

mod examples;
mod page;
mod picture;

use numbers::format::{trimmed, wrapped};
use numbers::layout::WIDTH;
use numbers::quantity;
pub use page::page;
pub use picture::Picture;

use experiment::program_name;
use proto::config::{Default, Field, Kind, Program, Tag, Variant, most_similar};
use proto::effect::{About, CONSTANT, Fit, Level, Parameter, Plausible};
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write as _;

/// An effect of the catalogue.
#[derive(Clone, Copy, Debug)]
pub struct Listed {
    /// What it is about: `radio`, `robots` or `network`.
    pub of: &'static str,
    /// Where it is configured: `netsim.phy.effect`.
    pub section: &'static str,
    /// Its name and keys.
    pub variant: Variant,
    /// Keys that every effect of the section has.
    pub common: &'static [Field],
    /// What people should know of it.
    pub about: &'static About,
    /// How it is fitted to measurements.
    pub fit: &'static Fit,
}

/// All effects: radio, robots, then the network.
#[must_use]
pub fn all() -> Vec<Listed> {
    let radio = physics::catalogue::Catalogue::built_in().effects.iter().map(|entry| Listed {
        of: "radio",
        section: "netsim.phy.effect",
        variant: entry.variant,
        common: physics::effect::SPEC.fields,
        about: &entry.about,
        fit: &entry.fit,
    });
    let robots = robotsim::catalogue::Catalogue::built_in().effects.iter().map(|entry| Listed {
        of: "robots",
        section: "robotsim.dynamics.effect",
        variant: entry.variant,
        common: robotsim::dynamics::effect::SPEC.fields,
        about: &entry.about,
        fit: &entry.fit,
    });
    let network = netsim::catalogue::Catalogue::built_in().mac_effects.iter().map(|entry| Listed {
        of: "network",
        section: "netsim.mac.effect",
        variant: entry.variant,
        common: netsim::mac::effect::SPEC.fields,
        about: &entry.about,
        fit: &entry.fit,
    });
    radio.chain(robots).chain(network).collect()
}

/// Effects of this name: `formula` is the name of two.
///
/// # Errors
///
/// That there is none, and which one may be meant.
pub fn find(name: &str) -> Result<Vec<Listed>, String> {
    let all = all();
    let found: Vec<Listed> =
        all.iter().filter(|effect| effect.variant.name == name).copied().collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let nearest = most_similar(name, all.iter().map(|effect| effect.variant.name));
    let nearest = nearest.map(|known| format!("; did you mean {known}?")).unwrap_or_default();
    Err(format!("unknown effect {name:?}{nearest}\n`{} effects` lists all effects", program_name()))
}

/// The table of all effects, for people.
#[must_use]
pub fn table() -> String {
    let all = all();
    let width = all.iter().map(|effect| effect.variant.name.len()).max().unwrap_or_default();
    let mut text = String::new();
    let mut before = "";
    for effect in &all {
        if effect.of != before {
            let gap = if before.is_empty() { "" } else { "\n" };
            let _ = writeln!(text, "{gap}{}: [[{}]]", effect.of, effect.section);
            before = effect.of;
        }
        let indent = " ".repeat(width + 4);
        let _ = writeln!(
            text,
            "  {:width$}  {}",
            effect.variant.name,
            wrapped(effect.variant.doc, &indent, WIDTH).trim_start()
        );
        let needs = format!("needs {}", effect.needs().join("; "));
        let _ = writeln!(text, "{}", wrapped(&needs, &indent, WIDTH));
    }
    let _ = write!(text, "\n`{} effects NAME` explains an effect.", program_name());
    text
}

/// Most decimals of numbers for people.
const DECIMALS: usize = 3;

impl Listed {
    /// What measurements must have for it to be tested.
    fn needs(&self) -> Vec<String> {
        if self.about.needs.is_empty() {
            return vec!["no further columns".to_owned()];
        }
        self.about.needs.iter().map(|need| need.describe()).collect()
    }

    /// Its keys: its own, then those that all effects of its section have.
    fn fields(&self) -> impl Iterator<Item = &'static Field> {
        self.variant.fields.iter().chain(self.common)
    }

    /// How it is configured: a table, ready to be pasted.
    fn example(&self) -> String {
        format!("[[{}]]\n{}", self.section, self.keys())
    }

    /// The keys of the example.
    fn keys(&self) -> String {
        format!("kind = {:?}\n{}", self.variant.name, examples::keys(self))
    }

    /// The covariate over which it is a straight line.
    fn straight_over(&self) -> Option<&'static str> {
        self.fit.linear_in.filter(|&covariate| covariate != CONSTANT)
    }

    /// All that it says of itself, for people.
    #[must_use]
    pub fn explained(&self) -> String {
        let mut text = format!("{} ({})\n", self.variant.name, self.of);
        let mut part = |title: &str, body: &str| {
            let _ = write!(text, "\n{title}\n{}\n", wrapped(body, "  ", WIDTH));
        };
        part("Summary", self.variant.doc);
        part("Mechanism", self.about.mechanism);
        part("Equation", self.about.equation);
        part("Source", self.about.source);
        part("Validity", self.about.validity);
        part("Signature in the residuals of a model without it", self.about.trace);
        part("Required in the measurements", &self.needs().join("; "));
        part("Evaluation", judged(self.fit.level));
        if !self.fit.generalises.is_empty() {
            part(
                "Special cases, preferred if they explain as much",
                &self.fit.generalises.join(", "),
            );
        }
        if let Some(covariate) = self.straight_over() {
            part(
                "Covariate over which a curve is preferred if a straight line does not suffice",
                covariate,
            );
        }
        let _ = writeln!(text, "\nParameters");
        for field in self.fields() {
            let _ = writeln!(text, "  {}: {}", field.key, self.range(field));
            let _ = writeln!(text, "{}", wrapped(field.doc, "      ", WIDTH));
            if let Some(fitted) = self.fitted(field.key) {
                let _ = writeln!(text, "{}", wrapped(&fitted, "      ", WIDTH));
            }
        }
        let _ = write!(text, "\nConfiguration\n");
        for line in self.example().lines() {
            let _ = writeln!(text, "  {line}");
        }
        if let Some(picture) = self.picture() {
            let _ = write!(text, "\n{}\n", picture.caption());
            let _ = writeln!(text, "  {}", picture.sparkline(72));
        }
        text.trim_end().to_owned()
    }

    /// What it looks like, with the parameters of the example. For the radio only.
    #[must_use]
    pub fn picture(&self) -> Option<Picture> {
        Picture::from_effect(self)
    }

    /// A parameter's unit, range and default.
    fn range(&self, field: &Field) -> String {
        let kind = kind(&field.kind);
        let unit = self.unit(field.key).map(|unit| format!(" ({unit})")).unwrap_or_default();
        let default = match field.default {
            Default::Required | Default::RequiredOrNone => "required".to_owned(),
            Default::Absent | Default::Table => "optional".to_owned(),
            Default::Bool(value) => format!("default {value}"),
            Default::Integer(value) => format!("default {value}"),
            Default::Number(value) => format!("default {value}"),
            Default::Text(value) => format!("default {value:?}"),
        };
        format!("{kind}{unit}, {default}")
    }

    /// A parameter's unit: as the fit names it, or as its key ends.
    fn unit(&self, key: &str) -> Option<&'static str> {
        match self.parameter(key) {
            Some(parameter) => Some(parameter.unit).filter(|unit| !["", "1"].contains(unit)),
            None => quantity::unit(key),
        }
    }

    /// The fitted parameter of a key: of a list, that of its first entry.
    fn parameter(&self, key: &str) -> Option<&'static Parameter> {
        let entry_of = |parameter: &Parameter| parameter.key.split('[').next();
        self.fit.parameters.iter().find(|parameter| entry_of(parameter) == Some(key))
    }

    fn fitted(&self, key: &str) -> Option<String> {
        let is_of_model = self.fit.from_model.iter().any(|(of, _)| *of == key);
        let Some(parameter) = self.parameter(key) else {
            return is_of_model.then(|| "taken from the configured model".to_owned());
        };
        let starts = if is_of_model {
            "that of the configured model".to_owned()
        } else {
            let starts = parameter.starts.iter().map(|&start| trimmed(start, DECIMALS));
            starts.collect::<Vec<_>>().join(", ")
        };
        let ends = |min, max| format!("{} to {}", trimmed(min, DECIMALS), trimmed(max, DECIMALS));
        let range = ends(parameter.min, parameter.max);
        let plausible = parameter.plausible.map(|Plausible { min, max, source }| {
            format!("; plausible from {} ({source})", ends(min, max))
        });
        let plausible = plausible.unwrap_or_default();
        Some(format!("fitted from {range}, starting at {starts}{plausible}"))
    }

    fn answer(&self) -> EffectAnswer {
        let parameter = |field: &Field| ParameterAnswer {
            key: field.key,
            doc: field.doc,
            unit: self.unit(field.key),
            range: self.range(field),
            fit: self.parameter(field.key).map(|parameter| FitAnswer {
                min: parameter.min,
                max: parameter.max,
                starts: parameter.starts,
                null: parameter.null,
                plausible: parameter.plausible.map(|it| PlausibleAnswer {
                    min: it.min,
                    max: it.max,
                    source: it.source,
                }),
            }),
        };
        EffectAnswer {
            name: self.variant.name,
            of: self.of,
            section: self.section,
            doc: self.variant.doc,
            mechanism: self.about.mechanism,
            equation: self.about.equation,
            source: self.about.source,
            validity: self.about.validity,
            trace: self.about.trace,
            needs: self.needs(),
            judged: judged(self.fit.level),
            generalises: self.fit.generalises,
            linear_in: self.fit.linear_in,
            parameters: self.fields().map(parameter).collect(),
            example: self.example(),
            picture: self.picture(),
        }
    }
}

/// The JSON of effects.
#[derive(Debug, Serialize, JsonSchema)]
pub struct EffectsAnswer {
    /// The format of this answer.
    #[schemars(extend("const" = "effects/1"))]
    schema: &'static str,
    /// The effects, in the order of the catalogue.
    effects: Vec<EffectAnswer>,
}

/// An effect of the catalogue.
#[derive(Debug, Serialize, JsonSchema)]
struct EffectAnswer {
    /// Its name: the `kind` in a configuration.
    name: &'static str,
    /// What it acts on: `radio`, `robots` or `network`.
    of: &'static str,
    /// The section of the configuration that it stands in.
    section: &'static str,
    /// What it is, in a sentence.
    doc: &'static str,
    /// What happens physically.
    mechanism: &'static str,
    /// What it computes.
    equation: &'static str,
    /// Where the equation is from.
    source: &'static str,
    /// Where it holds, and what it leaves out.
    validity: &'static str,
    /// How it is seen in measurements.
    trace: &'static str,
    /// What measurements must have so that it can be fitted.
    needs: Vec<String>,
    /// On which data, left out of the fit, its gain is judged.
    judged: &'static str,
    /// Names of effects that are special cases of it.
    generalises: &'static [&'static str],
    /// The covariate that it is a straight line over; null if it is none.
    linear_in: Option<&'static str>,
    /// Its keys.
    parameters: Vec<ParameterAnswer>,
    /// A section of a configuration with it (TOML).
    example: String,
    /// A curve of it with the keys of the example; null if there is none.
    picture: Option<Picture>,
}

/// A key of an effect.
#[derive(Debug, Serialize, JsonSchema)]
struct ParameterAnswer {
    /// The key in the configuration.
    key: &'static str,
    /// What it means.
    doc: &'static str,
    /// Its unit; null if it has none.
    unit: Option<&'static str>,
    /// Which values are allowed, in words.
    range: String,
    /// How it is fitted to measurements; null if it is not.
    fit: Option<FitAnswer>,
}

/// How a key is fitted to measurements.
#[derive(Debug, Serialize, JsonSchema)]
struct FitAnswer {
    /// Least value of the fit.
    min: f64,
    /// Greatest value of the fit.
    max: f64,
    /// Values at which the fit starts.
    starts: &'static [f64],
    /// The value at which the effect does nothing; null if the key is not the size of the effect.
    null: Option<f64>,
    /// Which values are physically plausible; null if no range is known.
    plausible: Option<PlausibleAnswer>,
}

/// Physically plausible values of a key.
#[derive(Debug, Serialize, JsonSchema)]
struct PlausibleAnswer {
    /// Least value.
    min: f64,
    /// Greatest value.
    max: f64,
    /// Who reports such values, or what they follow from.
    source: &'static str,
}

/// On what the gain of an effect is judged.
fn judged(level: Level) -> &'static str {
    match level {
        Level::Time => "on held-out blocks of time",
        Level::Place => "on held-out pairs of nodes, or places",
        Level::Run => "by simulation under many seeds",
        Level::Random => "on held-out blocks of time, as a random effect",
    }
}

/// What a key may be.
fn kind(kind: &Kind) -> String {
    match kind {
        Kind::Bool => "true or false".to_owned(),
        Kind::Integer { min, max } => format!("whole number from {min} to {max}"),
        Kind::Number(range) => match range.describe().as_str() {
            "a finite number" => "number".to_owned(),
            described => format!("number {described}"),
        },
        Kind::Text | Kind::ClusterLine => "text".to_owned(),
        Kind::Url => "URL".to_owned(),
        Kind::Program => self::kind(&Program::WORDS),
        Kind::File => "path of a file".to_owned(),
        Kind::Choice(choices) => {
            let names: Vec<String> =
                choices.iter().map(|choice| format!("{:?}", choice.name)).collect();
            names.join(" or ")
        }
        Kind::List { of, min, max } if min == max => format!("list of {min}: {}", self::kind(of)),
        Kind::List { of, .. } => format!("list: {}", self::kind(of)),
        Kind::Table(spec) => keys(spec.fields, spec.tag),
        Kind::Tables(spec) => format!("list: {}", keys(spec.fields, spec.tag)),
        Kind::Either(kinds) => kinds.iter().map(self::kind).collect::<Vec<_>>().join(" or "),
        Kind::Anything => "table".to_owned(),
    }
}

fn keys(fields: &[Field], tag: Option<&Tag>) -> String {
    let tag = tag.map(|tag| tag.key);
    let names: Vec<&str> = tag.into_iter().chain(fields.iter().map(|field| field.key)).collect();
    format!("table with {}", names.join(", "))
}

/// The answer for programs about some effects.
#[must_use]
pub fn answer(effects: &[Listed]) -> EffectsAnswer {
    EffectsAnswer { schema: "effects/1", effects: effects.iter().map(Listed::answer).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_example_on_robots_and_the_network_is_accepted() {
        for effect in all().iter().filter(|effect| effect.of != "radio") {
            let (name, mut problems) = (effect.variant.name, Vec::new());
            let node = proto::config::parse(&effect.keys()).unwrap();
            let (spec, lists) = match effect.of {
                "robots" => {
                    let lists = robotsim::catalogue::Catalogue::built_in().lists();
                    (&robotsim::dynamics::effect::SPEC, lists)
                }
                _ => (&netsim::mac::effect::SPEC, netsim::catalogue::Catalogue::built_in().lists()),
            };
            proto::config::check(&node, "", spec, &lists, &mut problems);
            assert!(problems.is_empty(), "{name}: {problems:?}");
        }
    }

    #[test]
    fn every_plausible_range_has_a_source_and_contains_starts_and_the_example() {
        let mut n_ranges = 0;
        for effect in all() {
            let name = effect.variant.name;
            let example: toml::Table = effect.keys().parse().unwrap();
            for parameter in effect.fit.parameters {
                let key = parameter.key;
                let within = |null: f64| parameter.min <= null && null <= parameter.max;
                assert!(parameter.null.is_none_or(within), "{name}: {key}");
                let Some(Plausible { min, max, source }) = parameter.plausible else { continue };
                n_ranges += 1;
                assert!(min < max && !source.is_empty(), "{name}: {key}");
                let written = match key.strip_suffix(']').and_then(|key| key.split_once('[')) {
                    Some((list, index)) => example[list].get(index.parse::<usize>().unwrap()),
                    None => example.get(key),
                };
                let written = written.map(|value| value.as_float().unwrap());
                for value in parameter.starts.iter().copied().chain(written) {
                    assert!(min <= value && value <= max, "{name}: {key} = {value}");
                }
            }
        }
        assert!(12 <= n_ranges, "{n_ranges}");
        for name in ["system-gain", "node-offset"] {
            let parameters = find(name).unwrap()[0].fit.parameters;
            assert!(parameters.iter().all(|parameter| parameter.plausible.is_none()), "{name}");
        }
    }

    #[test]
    fn every_effect_has_an_example_that_is_accepted_and_a_picture_that_shows_something() {
        for effect in all().iter().filter(|effect| effect.of == "radio") {
            let name = effect.variant.name;
            let picture = effect.picture();
            let picture = picture.unwrap_or_else(|| panic!("{name}: no picture"));
            let values: Vec<f64> = picture.points.iter().map(|point| point[1]).collect();
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert!(most.is_finite() && least.is_finite(), "{name}");
            assert!(least < most || name == "system-gain", "{name}: {least} everywhere");
            assert_eq!(picture.sparkline(40).chars().count(), 40, "{name}");
        }
    }

    #[test]
    fn an_explanation_says_all_and_a_wrong_name_gets_a_hint() {
        let found = find("two-ray-ground").unwrap();
        let text = found[0].explained();
        for part in [
            "Fresnel",
            "relative_permittivity: number from 1 to 80, required",
            "polarization: \"vertical\" or \"horizontal\", default \"vertical\"",
            "positive antenna heights",
            "kind = \"two-ray-ground\"",
            "fitted from 1 to 80",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
        let text = find("wind").unwrap()[0].explained();
        assert!(text.contains("plausible from -60 to 60 (Beaufort"), "{text}");
        let error = find("two-ray").unwrap_err();
        assert!(error.contains("did you mean"), "{error}");
        assert!(table().lines().all(|line| line.chars().count() <= WIDTH), "{}", table());
    }
}
