//! Keys for an example of each effect, and for its picture.

use super::Listed;
use proto::config::{Default, Field, Kind};
use proto::effect::Fixed;
use std::fmt::Write as _;

/// Keys for an example: the effect's own, or, where it has none, where its fit starts.
pub(super) fn keys(effect: &Listed) -> String {
    if !effect.about.example.is_empty() {
        return effect.about.example.to_owned();
    }
    let mut keys = String::new();
    for (key, value) in effect.fit.variants.first().copied().unwrap_or_default() {
        let _ = match value {
            Fixed::Text(text) => writeln!(keys, "{key} = {text:?}"),
            Fixed::Number(number) => writeln!(keys, "{key} = {number:?}"),
            Fixed::Bool(truth) => writeln!(keys, "{key} = {truth}"),
        };
    }
    for parameter in effect.fit.parameters {
        let start = parameter.starts.first().copied().unwrap_or_default();
        let _ = writeln!(keys, "{} = {start:?}", parameter.key);
    }
    for field in effect.variant.fields {
        if matches!(field.default, Default::Required | Default::RequiredOrNone)
            && !keys.contains(&format!("{} = ", field.key))
        {
            let _ = writeln!(keys, "{} = {}", field.key, some_value(field));
        }
    }
    keys
}

/// A value that a required key may have.
fn some_value(field: &Field) -> String {
    let number = |kind: &Kind| match kind {
        Kind::Number(range) => range.nearest(1.0).unwrap_or(1.0),
        _ => 1.0,
    };
    match &field.kind {
        Kind::Bool => "true".to_owned(),
        Kind::Integer { min, .. } => min.to_string(),
        Kind::List { of, min, .. } => format!("{:?}", vec![number(of); *min]),
        Kind::Choice(choices) => format!("{:?}", choices.first().map_or("", |choice| choice.name)),
        Kind::Text | Kind::File | Kind::Url | Kind::ClusterLine => "\"…\"".to_owned(),
        kind => format!("{:?}", number(kind)),
    }
}
