//! The page of a demo: measurements in which an effect was hidden, what the model lacks, and what that does to a swarm.

mod pictures;

use super::layout;
use super::measured::STYLE;
use maud::{Markup, html};
use numbers::format::{number, number_within, shortest};
use proto::site::Site;

/// Rules of this page beside those of pages about measurements.
const OWN_STYLE: &str = include_str!("story/style.css");

/// What the page tells.
#[derive(Debug)]
pub struct Story<'a> {
    /// Seed of the demo.
    pub seed: u64,
    /// Name of the file of measurements, within the folder of the page.
    pub data_file: &'a str,
    /// What was measured, in words: `3,000 frames between 17 motes`.
    pub measured: String,
    /// Unit of errors: dB or m.
    pub unit: &'a str,
    /// The error of the true model, which is noise: root mean square, in that unit.
    pub noise: f64,
    /// The site of the model.
    pub site: &'a Site,
    /// The measured rows.
    pub rows: Vec<StoryRow>,
    /// Of links: by how much readings lie above the model as configured, alike on all rows (dB), if that is significant.
    pub offset: Option<f64>,
    /// The covariate that explains most of the error of the model as configured.
    pub symptom: Option<Symptom>,
    /// Held-out error of the model as configured, and with each effect that was accepted.
    pub ladder: Vec<(String, f64)>,
    /// Candidates, in the order of their gains.
    pub candidates: Vec<StoryCandidate>,
    /// The verdict of the diagnosis.
    pub sentence: String,
    /// How the verdict compares with what was hidden.
    pub outcome: String,
    /// Whether the verdict was right.
    pub is_right: bool,
    /// Whether an effect was hidden.
    pub is_hidden: bool,
    /// What was hidden, in words.
    pub hidden: String,
    /// Parameters of what was hidden or found.
    pub parameters: Vec<StoryParameter>,
    /// Held-out error of the model, and of the extended model if there is one.
    pub errors: [Option<f64>; 2],
    /// The swarm under each model.
    pub swarms: Vec<StorySwarm>,
    /// What was typed, or could be, one command a line.
    pub commands: Vec<String>,
    /// What to try next, one command a line.
    pub next: Vec<String>,
    /// Names of the files beside the page, and what they hold.
    pub files: Vec<(String, &'static str)>,
}

/// A measured row.
#[derive(Clone, Copy, Debug)]
pub struct StoryRow {
    /// Where it was measured, from where to where (m).
    pub ends: [[f64; 2]; 2],
    /// The number of what is at each end: of a mote, or twice that of the robot.
    pub numbers: [u32; 2],
    /// Measured less predicted by the model as configured.
    pub error: f64,
    /// The same by the model with what was found, if anything was.
    pub error_with_effects: Option<f64>,
}

/// A covariate on which the error depends.
#[derive(Debug)]
pub struct Symptom {
    /// Its name, with its unit at the end.
    pub name: String,
    /// Its value in each row.
    pub values: Vec<f64>,
    /// The share of the variance of the error that it explains.
    pub explained: f64,
}

/// A candidate of the diagnosis.
#[derive(Debug)]
pub struct StoryCandidate {
    /// Name of the effect.
    pub effect: String,
    /// Gain in held-out log score (nats per row).
    pub gain: f64,
    /// Half the width of the gain's 90 % interval.
    pub half: f64,
    /// Whether it was accepted.
    pub accepted: bool,
}

/// A parameter of an effect.
#[derive(Debug)]
pub struct StoryParameter {
    /// Name of the effect.
    pub effect: String,
    /// Name of the parameter.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The value that was hidden, if it was.
    pub hidden: Option<f64>,
    /// The estimate and the ends of its 90 % interval, if it was found.
    pub found: Option<[f64; 3]>,
}

/// A run of the swarm.
#[derive(Debug)]
pub struct StorySwarm {
    /// Which model it is of.
    pub title: String,
    /// Speed of the swarm's mean velocity along the leader's direction, mean over time (m/s).
    pub along_mps: f64,
    /// Speed of the leader (m/s).
    pub leader_speed_mps: f64,
    /// That speed if no robot follows (m/s).
    pub floor_mps: f64,
    /// The share of frames that were delivered.
    pub delivery_ratio: f64,
    /// The swarm at the end, on light and on dark ground: addresses of pictures.
    pub pictures: [String; 2],
}

impl StoryParameter {
    /// The estimate and its interval, with as many digits as the interval warrants.
    fn estimate(&self) -> [String; 2] {
        let Some([value, low, high]) = self.found else { return ["–", "–"].map(str::to_owned) };
        let shown = |value: f64| number_within(value, (high - low) / 2.0);
        let estimate = format!("{} {}", shown(value), self.unit);
        [estimate.trim_end().to_owned(), format!("{} to {}", shown(low), shown(high))]
    }
}

impl Story<'_> {
    /// A number of errors with its unit.
    fn error(&self, value: f64) -> String {
        format!("{} {}", number(value), self.unit)
    }

    /// What the missing effect does to the swarm, in a sentence.
    fn consequence(&self) -> String {
        let [first, .., last] = self.swarms.as_slice() else { return String::new() };
        let speed = |swarm: &StorySwarm| format!("{} m/s", number(swarm.along_mps));
        let change_mps = (last.along_mps - first.along_mps).abs();
        if change_mps < NO_CHANGE * first.leader_speed_mps {
            return format!(
                "Here the effect hardly changes the swarm: {} without it, {} with it.",
                speed(first),
                speed(last)
            );
        }
        format!(
            "The model predicts that the flock follows at {} along its leader's direction, and in truth it is {}. The leader \
             drives {} m/s; if no robot followed, the flock's speed would be {} m/s.",
            speed(first),
            speed(last),
            number(first.leader_speed_mps),
            number(first.floor_mps)
        )
    }
}

/// A change of the flock's speed below this share of the leader's speed is no change.
const NO_CHANGE: f64 = 0.1;

/// A section of the page.
type Section = fn(&Story<'_>) -> Markup;

/// The page from top to bottom.
const SECTIONS: &[Section] =
    &[heading, measurements, comparison, diagnosis, extension, swarms, reveal, next];

/// The page: one HTML file that needs no other.
#[must_use]
pub fn page(story: &Story<'_>) -> String {
    let style = format!("{STYLE}\n{OWN_STYLE}");
    let body = html! { @for section in SECTIONS { (section(story)) } };
    layout::page("Demo: find the missing physics", &style, &body)
}

fn heading(story: &Story<'_>) -> Markup {
    let [before, after] = story.errors;
    let error = match (before, after) {
        (Some(before), Some(after)) => {
            html! { (number(before)) " → " (layout::with_unit(&number(after), story.unit)) }
        }
        (Some(before), None) => layout::with_unit(&number(before), story.unit),
        _ => html! { "–" },
    };
    let speeds: Vec<String> = story.swarms.iter().map(|swarm| number(swarm.along_mps)).collect();
    let mut tiles = vec![("Error of the model", error)];
    if !speeds.is_empty() {
        let name = match (story.swarms.len(), after) {
            (3, _) => "Speed of the flock: model, extended model, truth",
            (2, Some(_)) => "Speed of the flock: model, extended model",
            (2, None) => "Speed of the flock: model, truth",
            _ => "Speed of the flock",
        };
        tiles.push((name, layout::with_unit(&speeds.join(" → "), "m/s")));
    }
    html! {
        h1 { "Which physics is missing from this model?" }
        p.lead {
            "Seed " (story.seed) " chose an effect, or none, and simulated measurements with it. The diagnosis ran in a process of its own. It read the model and the measurements, and nothing \
             else."
        }
        p.verdict { "The diagnosis: " b { (story.sentence) } ". Section 6 shows what was hidden, and whether that is right." }
        div.story-tiles { (layout::tiles(tiles)) }
    }
}

fn command(story: &Story<'_>, verb: &str) -> Markup {
    let found = story.commands.iter().find(|command| command.split(' ').nth(1) == Some(verb));
    html! { @if let Some(command) = found { (layout::listing(command)) } }
}

fn measurements(story: &Story<'_>) -> Markup {
    html! {
        h2 { "1. The measurements" }
        p {
            code { (story.data_file) } " holds " (story.measured) ". "
            "The true model, which made them, has an error of " (story.error(story.noise)) ", which is noise. "
            "This is the easy case: the catalogue has the true effect, and everything else in the model is right."
        }
    }
}

fn comparison(story: &Story<'_>) -> Markup {
    let [before, _] = story.errors;
    html! {
        h2 { "2. Where the model fails" }
        (command(story, "compare"))
        p {
            @if let Some(before) = before {
                "The error of the model is " b { (story.error(before)) } "; that of the true model is " (story.error(story.noise)) ". "
            }
            @if let Some(offset) = story.offset {
                "Readings lie " (number(offset.abs())) " dB " (if offset < 0.0 { "below" } else { "above" })
                " the model on average, lost frames considered. "
            }
            @if let Some(symptom) = &story.symptom {
                "The error depends most on " code { (symptom.name) } ", which explains "
                (numbers::format::percent(symptom.explained)) " of its variance. That is a symptom, and not yet the cause."
            } @else {
                "No covariate explains a significant part of it."
            }
        }
        div.figures { (pictures::errors(story)) }
    }
}

fn diagnosis(story: &Story<'_>) -> Markup {
    html! {
        h2 { "3. Which effect is missing" }
        (command(story, "diagnose"))
        p { "The verdict: " b { (story.sentence) } "." }
        p.means {
            "The diagnosis fits each effect of the catalogue to part of the rows, and scores it on the rest. It accepts an effect \
             only if the gain is significant with all candidates counted."
        }
        div.figures {
            (pictures::ladder(story))
            @if let Some(picture) = pictures::candidates(story) { (picture) }
        }
    }
}

fn extension(story: &Story<'_>) -> Markup {
    let [before, after] = story.errors;
    html! {
        h2 { "4. The extended model" }
        @match (before, after) {
            (Some(before), Some(after)) => {
                (command(story, "extend"))
                p {
                    code { "better.toml" } " is the model with the effect added and fitted. Its error is "
                    b { (story.error(after)) } " in place of " (story.error(before)) "."
                }
            }
            _ => p { "The diagnosis accepted no effect, so the model stays as it is." },
        }
    }
}

fn swarms(story: &Story<'_>) -> Markup {
    html! {
        h2 { "5. What it does to the swarm" }
        p {
            "A leader drives round the corner of a building, and the other robots follow it if they hear it. Each robot knows only \
             what the radio delivers. The run lasts 25 s. " (story.consequence())
        }
        div.swarms {
            @for swarm in &story.swarms {
                @let [light, dark] = &swarm.pictures;
                figure {
                    figcaption { h3 { (swarm.title) } }
                    picture {
                        source srcset=(dark) media="(prefers-color-scheme: dark)";
                        img src=(light) alt={ "The swarm seen from above after 25 s, " (swarm.title) };
                    }
                    p {
                        "Flock " b { (number(swarm.along_mps)) " m/s" } " along the leader's direction, leader " (number(swarm.leader_speed_mps)) " m/s, "
                        (numbers::format::percent(swarm.delivery_ratio)) " of frames delivered."
                    }
                }
            }
        }
    }
}

fn reveal(story: &Story<'_>) -> Markup {
    let value = |value: Option<f64>, unit: &str| match value {
        Some(value) => format!("{} {unit}", shortest(value)).trim_end().to_owned(),
        None => "–".to_owned(),
    };
    html! {
        h2 { "6. What was hidden" }
        p.verdict.wrong[!story.is_right] { (story.outcome) }
        @if !story.parameters.is_empty() {
            table {
                thead { tr { th { "effect" } th { "parameter" } th.n { "hidden" } th.n { "estimate" } th.n { "90 % interval" } } }
                tbody {
                    @for parameter in &story.parameters {
                        tr {
                            td { (parameter.effect) }
                            td { code { (parameter.name) } }
                            (layout::number_cell(value(parameter.hidden, &parameter.unit)))
                            @let [estimate, interval] = parameter.estimate();
                            (layout::number_cell(estimate))
                            (layout::number_cell(interval))
                        }
                    }
                }
            }
        }
        @if !story.parameters.is_empty() {
            p.means { "A 90 % interval may miss the true value in one case of ten." }
        }
    }
}

fn next(story: &Story<'_>) -> Markup {
    html! {
        h2 { "Try it yourself" }
        p { "These are the commands of this demo. They run in this folder:" }
        (layout::listing(&story.commands.join("\n")))
        p { "What to try next:" }
        (layout::listing(&story.next.join("\n")))
        details {
            summary { "Files in this folder" }
            table.facts {
                @for (name, content) in &story.files { tr { th { code { (name) } } td { (content) } } }
            }
        }
    }
}
