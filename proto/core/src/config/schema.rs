//! JSON Schema (draft 2020-12) of a description.

use super::{Default, Field, Kind, Lists, Program, Range, TableSpec};
use serde_json::{Map, Value, json};

/// The schema of a table. `lists`: those that its tags name.
///
/// # Panics
///
/// If `lists` lacks one of them.
#[must_use]
pub fn json_schema(spec: &TableSpec, lists: &Lists) -> Value {
    let mut schema = object(spec.doc, spec.fields, None, lists);
    if let Some(tag) = spec.tag {
        let variants = tag.variants(lists);
        let names: Vec<&str> = variants.iter().map(|variant| variant.name).collect();
        let alternatives: Vec<Value> = variants
            .iter()
            .map(|variant| {
                let mut fields = variant.fields.to_vec();
                fields.extend_from_slice(spec.fields);
                object(variant.doc, &fields, Some((tag.key, variant.name, tag.default)), lists)
            })
            .collect();
        schema = json!({ "type": "object", "description": spec.doc, "oneOf": alternatives });
        schema["properties"] = json!({ tag.key: { "description": tag.doc, "enum": names } });
        if let Some(default) = tag.default {
            schema["properties"][tag.key]["default"] = json!(default);
        }
    }
    schema
}

fn object(
    doc: &str,
    fields: &[Field],
    tag: Option<(&str, &str, Option<&str>)>,
    lists: &Lists,
) -> Value {
    let mut properties = Map::new();
    let mut required = Vec::new();
    if let Some((key, name, default)) = tag {
        properties.insert(key.to_owned(), json!({ "const": name }));
        if default != Some(name) {
            required.push(key);
        }
    }
    for field in fields {
        let mut property = kind_schema(&field.kind, lists);
        property["description"] = json!(field.doc);
        match field.default {
            Default::Required | Default::RequiredOrNone => required.push(field.key),
            Default::Absent | Default::Table => {}
            Default::Bool(value) => property["default"] = json!(value),
            Default::Integer(value) => property["default"] = json!(value),
            Default::Number(value) => property["default"] = json!(value),
            Default::Text(value) => property["default"] = json!(value),
        }
        properties.insert(field.key.to_owned(), property);
    }
    json!({
        "type": "object",
        "description": doc,
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    })
}

fn kind_schema(kind: &Kind, lists: &Lists) -> Value {
    match kind {
        Kind::Bool => json!({ "type": "boolean" }),
        Kind::Integer { min, max } => {
            let mut schema = json!({ "type": "integer", "minimum": min });
            if *max != i64::MAX {
                schema["maximum"] = json!(max);
            }
            schema
        }
        Kind::Number(Range { min, max, above_min }) => {
            let mut schema = json!({ "type": "number" });
            if min.is_finite() {
                schema[if *above_min { "exclusiveMinimum" } else { "minimum" }] = json!(min);
            }
            if max.is_finite() {
                schema["maximum"] = json!(max);
            }
            schema
        }
        Kind::Text | Kind::File | Kind::Url | Kind::ClusterLine => {
            json!({ "type": "string", "minLength": 1 })
        }
        Kind::Choice(choices) => {
            let alternatives: Vec<Value> = choices
                .iter()
                .map(|choice| json!({ "const": choice.name, "description": choice.doc }))
                .collect();
            json!({ "oneOf": alternatives })
        }
        Kind::Program => kind_schema(&Program::WORDS, lists),
        Kind::List { of, min, max } => {
            let mut schema =
                json!({ "type": "array", "items": kind_schema(of, lists), "minItems": min });
            if *max != usize::MAX {
                schema["maxItems"] = json!(max);
            }
            schema
        }
        Kind::Table(spec) => json_schema(spec, lists),
        Kind::Tables(spec) => json!({ "type": "array", "items": json_schema(spec, lists) }),
        Kind::Either(kinds) => {
            let schemas = kinds.iter().map(|kind| kind_schema(kind, lists));
            json!({ "anyOf": schemas.collect::<Vec<_>>() })
        }
        Kind::Anything => json!({}),
    }
}
