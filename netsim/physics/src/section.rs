//! The section `[netsim.phy]`: its keys, and the model that they describe.

use crate::catalogue::Catalogue;
use crate::model::Model;
use crate::propagation::{self, BuildContext, Family, Radio};
use crate::standard::{self, CHOICES, Entry};
use crate::{effect, interference, reception};
use bytes::Bytes;
use proto::config::{Kind, Lists, Node, Problem, Section, TableSpec, check, join, parse};
use std::collections::BTreeMap;

/// Description of `[netsim.phy]`.
pub const SPEC: TableSpec = Keys::SPEC;

/// The radio.
#[derive(Section)]
#[section(tag = propagation::TAG)]
pub struct Keys {
    /// The physical layer of IEEE 802.15.4: channels, bit rate, noise. Absent: o-qpsk-2450.
    #[key(kind = Kind::Choice(&CHOICES))]
    pub standard: Option<String>,
    /// Power, antennas and frequency.
    #[key(flatten)]
    pub radio: Radio,
    /// Height of antennas above positions (m), if all positions are planar (z = 0).
    #[key(range = 0.0..=1000.0)]
    pub antenna_height_m: Option<f64>,
    /// Minimum distance (m): smaller distances count as this, because the Friis equation is invalid at short range.
    #[key(range = 1e-3..=1e3, default = 0.1)]
    pub min_distance_m: f64,
    /// Standard deviation (dB) of normal noise on the RSSI of every frame, clipped at 5 sd. Absent: 0 in a run; estimated when the
    /// model is compared with measurements.
    #[key(range = 0.0..=30.0)]
    pub noise_sd_db: Option<f64>,
    /// Reception model: how the RSSI of a frame determines whether it is received.
    #[key(table = reception::SPEC, default)]
    pub reception: toml::Table,
    /// Interference model: how simultaneous frames affect each other. Used by mode = "6tisch" only.
    #[key(table = interference::SPEC, default)]
    pub interference: toml::Table,
    /// Physical effects added to the base model; `murmuration effects` lists them.
    #[key(tables = effect::SPEC)]
    pub effect: Vec<toml::Table>,
}

/// How long the trace lasts that a radio replays (ns), its checked table and files given; `None`: it replays none, or one
/// beyond whose end links are held.
#[must_use]
pub fn replay_ns(
    phy: &toml::Table,
    files: &BTreeMap<String, Bytes>,
    catalogue: &Catalogue,
) -> Option<u64> {
    (catalogue.propagation.selected(phy, &propagation::TAG)?.replay)(phy, files)
}

/// Reads `[netsim.phy]` by itself, as a comparison with measurements needs it: the radio without a network.
///
/// * `agent_count`: one more than the highest number of a mote.
/// * `path`: of the section, for problems.
///
/// # Errors
///
/// Everything that is wrong with it.
pub fn read(
    node: &Node,
    path: &str,
    agent_count: usize,
    files: &BTreeMap<String, Bytes>,
    catalogue: &Catalogue,
) -> Result<(Model, toml::Table), Vec<Problem>> {
    let mut problems = Vec::new();
    let mut table = check(node, path, &SPEC, &catalogue.lists(), &mut problems).table;
    apply(&mut table, Some(node), path, catalogue, &mut problems);
    let keys = Keys::read(&table);
    let mut context = BuildContext {
        path,
        radio: keys.radio,
        agent_count,
        slot_ns: 1,
        // Without a network nothing hops: a trace need not cover any channel.
        channels: &[],
        files,
        problems: Vec::new(),
        warnings: Vec::new(),
    };
    let model = model_of(&table, &keys, catalogue, &mut context, &mut problems);
    problems.extend(context.problems);
    match model.filter(|_| problems.is_empty()) {
        Some(model) => Ok((model, table)),
        None => Err(problems),
    }
}

/// The model that a checked table of `[netsim.phy]` describes, unless there are problems.
pub fn model_of(
    table: &toml::Table,
    keys: &Keys,
    catalogue: &Catalogue,
    context: &mut BuildContext<'_>,
    problems: &mut Vec<Problem>,
) -> Option<Model> {
    let base = catalogue.propagation.selected(table, &propagation::TAG);
    let propagation = base.and_then(|base| (base.build)(table, context));
    let path = join(context.path, "reception");
    let curve = reception::build(&keys.reception, &path, &catalogue.reception, problems);
    effect::check(&keys.effect, &join(context.path, "effect"), &catalogue.effects, problems);
    let effects = effect::build(&keys.effect, &catalogue.effects);
    let model = Model::new(
        propagation?,
        effects,
        curve?,
        context.radio,
        keys.min_distance_m,
        keys.noise_sd_db,
    );
    Some(model.with_channels(physical_layer(table).standard.channels))
}

/// The physical layer of a checked table of `[netsim.phy]`.
#[must_use]
pub fn physical_layer(phy: &toml::Table) -> &'static Entry {
    standard::find(phy.get("standard").and_then(toml::Value::as_str))
}

/// Fills in what follows from the physical layer of a checked table of `[netsim.phy]` and is not written. Reports what does not go
/// with it.
pub fn apply(
    phy: &mut toml::Table,
    written: Option<&Node>,
    path: &str,
    catalogue: &Catalogue,
    problems: &mut Vec<Problem>,
) {
    let entry = physical_layer(phy);
    let base = catalogue.propagation.selected(phy, &propagation::TAG);
    let family = base.map(|base| base.family);
    let tables = [
        ("reception", &reception::SPEC, entry.standard.reception_toml()),
        ("interference", &interference::SPEC, entry.standard.interference_toml()),
    ];
    let is_written = |key: &str| written.and_then(|phy| phy.get(key)).is_some();
    for (key, spec, text) in tables {
        let Some(text) = text else { continue };
        let own = filled_in(&text, spec, &catalogue.lists());
        if !is_written(key) {
            phy.insert(key.to_owned(), own.into());
            continue;
        }
        let decides = key != "reception" || family == Some(Family::Signal);
        let kind = phy.get(key).and_then(|table| table.get("kind"));
        let is_own = kind == own.get("kind");
        let is_measured = phy.get(key).and_then(|table| table.get("points")).is_some();
        if decides && kind.is_some() && !is_own && !is_measured {
            let message = format!(
                "does not apply with standard = {:?}, because it describes receivers of another physical layer",
                entry.name
            );
            let text = |value: Option<&toml::Value>| {
                value.map_or_else(String::new, toml::Value::to_string)
            };
            let path = join(path, &format!("{key}.kind"));
            let problem = Problem::new(path, message).value(text(kind));
            problems.push(problem.nearest(text(own.get("kind"))));
        }
    }
    if entry.name == standard::find(None).name {
        return;
    }
    if !is_written("carrier_hz") {
        phy.insert("carrier_hz".to_owned(), entry.standard.channels.middle_hz().into());
    }
    if family == Some(Family::Recording) {
        let message = "must be the physical layer of the recording, which is of 2.4 GHz";
        let first = standard::find(None).name;
        let path = join(path, "standard");
        let problem = Problem::new(path, message).value(format!("{:?}", entry.name));
        problems.push(problem.nearest(format!("{first:?}")));
    }
}

/// A table of this text with all its defaults.
fn filled_in(text: &str, spec: &TableSpec, lists: &Lists) -> toml::Table {
    let node = parse(text).expect("the physical layer states TOML");
    check(&node, "", spec, lists, &mut Vec::new()).table
}
