//! docs/configuration.md and docs/mapping.md are made from the descriptions that also check the files, so they cannot be out of date.
//!
//! `UPDATE_REFERENCE=1 cargo test --release -p tests reference` writes it anew.

use serde_json::Value;
use std::fmt::Write as _;

#[test]
fn the_reference_of_keys_is_what_the_descriptions_say() {
    assert_written("configuration.md", &page(&experiment::schema()));
}

#[test]
fn the_reference_of_mapping_files_is_what_the_descriptions_say() {
    let schema = convert::mapping::schema();
    assert_written("mapping.md", &mapping_page(&schema));
}

/// Compares a page with what it should be, or writes it.
fn assert_written(name: &str, page: &str) {
    let path = tests::repository().join("docs").join(name);
    if std::env::var_os("UPDATE_REFERENCE").is_some() {
        std::fs::write(&path, page).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap();
    assert!(
        written == page,
        "docs/{name} is out of date: write it anew as tests/it/reference.rs says"
    );
}

fn page(schema: &Value) -> String {
    let mut page = String::from(
        "# Configuration\n\n\
         Every key of an experiment file, its range and its default.\n\
         This page is made from the descriptions that check the files; `murmuration schema` prints the same as JSON Schema.\n\n\
         One TOML file is one experiment.\n\
         Unknown keys, wrong types and impossible values are refused, all of them at once.\n\
         `--set netsim.phy.propagation=friis` overrides any key on the command line, `--seed N` the seed.\n",
    );
    let mut seen = Vec::new();
    for section in ["experiment", "site", "robotsim", "netsim", "timeline", "output", "sweep"] {
        let mut schema = &schema["properties"][section];
        if let Some(alternatives) = schema["anyOf"].as_array() {
            schema = &alternatives[0];
        }
        let is_list = schema["type"] == "array";
        let schema = if is_list { &schema["items"] } else { schema };
        table(&mut page, &mut seen, section, schema, is_list);
    }
    page
}

fn mapping_page(schema: &Value) -> String {
    let mut page = String::from(
        "# Mapping files\n\n\
         Every key of the mapping files of `murmuration convert`, its range and its default; [importing.md](importing.md) shows how to use \
         them.\n\
         This page is made from the descriptions that check the files; `murmuration schema --of mapping` prints the same as JSON \
         Schema.\n",
    );
    let (mut inner, mut seen) = (Vec::new(), Vec::new());
    let all: Vec<_> = keys(schema).collect();
    rows(&mut page, "", &all, schema, &mut inner);
    for (path, schema, is_list) in inner {
        table(&mut page, &mut seen, &path, &schema, is_list);
    }
    page
}

/// A table, and then those within it. One that has the keys of a table before it, with a tag, is told by that one's name.
fn table(
    page: &mut String,
    seen: &mut Vec<(Value, String)>,
    path: &str,
    schema: &Value,
    is_list: bool,
) {
    let heading = heading_of(path, is_list);
    let _ = write!(page, "\n## `{heading}`\n\n{}\n", text(&schema["description"]));
    if let Some(alternatives) = schema.get("oneOf") {
        if let Some((_, same)) = seen.iter().find(|(keys, _)| keys == alternatives) {
            let _ = write!(page, "\nIts keys are those of `{same}`.\n");
            return;
        }
        seen.push((alternatives.clone(), heading.clone()));
    }
    let mut inner = Vec::new();
    if let Some(variants) = schema["oneOf"].as_array() {
        // The keys of one variant at a time, then those of every variant that have the same values in all.
        let (tag, choice) = schema["properties"].as_object().unwrap().iter().next().unwrap();
        let values = |variant: &Value, key: &String| {
            let mut values = variant["properties"].get(key)?.clone();
            values.as_object_mut()?.remove("description");
            Some(values)
        };
        let common = |key: &String| {
            let first = values(&variants[0], key);
            first.is_some() && variants.iter().all(|variant| values(variant, key) == first)
        };
        let _ = write!(page, "\n{}\n", selection(tag, &text(&choice["description"])));
        let _ = writeln!(page, "\n| `{tag}` | meaning | keys of its own |\n|---|---|---|");
        for variant in variants {
            let keys: Vec<String> = keys(variant)
                .filter(|(key, _)| !common(key))
                .map(|(key, property)| {
                    if collect(&mut inner, path, key, property) {
                        // It has a place of its own on the page.
                        let doc = text(&property["description"]);
                        format!("`{key}`: {doc} (`{}`)", inner_heading(path, key, property))
                    } else {
                        format!("`{key}`: {}", describe(key, property, variant))
                    }
                })
                .collect();
            let name = variant["properties"][tag]["const"].as_str().unwrap();
            let default = if choice["default"] == name { " (default)" } else { "" };
            let _ = writeln!(
                page,
                "| `\"{name}\"`{default} | {} | {} |",
                text(&variant["description"]),
                if keys.is_empty() { "–".to_owned() } else { keys.join("<br>") }
            );
        }
        let shared: Vec<_> =
            keys(&variants[0]).filter(|(key, _)| common(key) && *key != tag).collect();
        rows(page, path, &shared, &variants[0], &mut inner);
    } else {
        let all: Vec<_> = keys(schema).collect();
        rows(page, path, &all, schema, &mut inner);
    }
    let mut done: Vec<String> = Vec::new();
    for (path, schema, is_list) in inner {
        let heading = heading_of(&path, is_list);
        if !done.contains(&heading) {
            table(page, seen, &path, &schema, is_list);
            done.push(heading);
        }
    }
}

/// What a tag selects, from its description: "The effect." or "The format. Further sentences."
fn selection(tag: &str, doc: &str) -> String {
    let (selected, rest) = doc.split_once(". ").unwrap_or((doc.trim_end_matches('.'), ""));
    let selected = selected.strip_prefix("The ").unwrap_or(selected);
    format!("`{tag}` selects the {selected}; each has its own keys. {rest}").trim_end().to_owned()
}

fn rows(
    page: &mut String,
    path: &str,
    keys: &[(&String, &Value)],
    parent: &Value,
    inner: &mut Vec<(String, Value, bool)>,
) {
    let plain: Vec<_> =
        keys.iter().filter(|(key, property)| !collect(inner, path, key, property)).collect();
    if plain.is_empty() {
        return;
    }
    let _ = writeln!(page, "\n| key | value | meaning |\n|---|---|---|");
    for (key, property) in plain {
        let _ = writeln!(
            page,
            "| `{key}` | {} | {} |",
            value(key, property, parent),
            text(&property["description"])
        );
    }
}

/// The heading of a table within a table, or of a list of them.
fn inner_heading(path: &str, key: &str, property: &Value) -> String {
    heading_of(&proto::config::join(path, key), property["type"] == "array")
}

fn heading_of(path: &str, is_list: bool) -> String {
    if is_list { format!("[[{path}]]") } else { format!("[{path}]") }
}

/// Puts a table within a table aside. Returns whether it is one.
fn collect(
    inner: &mut Vec<(String, Value, bool)>,
    path: &str,
    key: &str,
    property: &Value,
) -> bool {
    let is_table = |schema: &Value| schema.get("properties").is_some();
    if let Some(alternatives) = property["anyOf"].as_array() {
        let is_list_of_tables = |schema: &Value| is_table(&schema["items"]);
        if !alternatives.iter().all(|schema| is_table(schema) || is_list_of_tables(schema)) {
            return false;
        }
        return alternatives.iter().all(|schema| collect(inner, path, key, schema));
    }
    if is_table(property) {
        inner.push((proto::config::join(path, key), property.clone(), false));
    } else if is_table(&property["items"]) {
        inner.push((proto::config::join(path, key), property["items"].clone(), true));
    } else {
        return false;
    }
    true
}

fn keys(schema: &Value) -> impl Iterator<Item = (&String, &Value)> {
    schema["properties"]
        .as_object()
        .into_iter()
        .flatten()
        .filter(|(_, property)| property.get("const").is_none())
}

fn describe(key: &str, property: &Value, parent: &Value) -> String {
    format!("{} ({})", text(&property["description"]), value(key, property, parent))
}

/// Type, range and default of a key.
fn value(key: &str, property: &Value, parent: &Value) -> String {
    let is_required = parent["required"]
        .as_array()
        .is_some_and(|required| required.iter().any(|name| name == key));
    let default = match property.get("default") {
        Some(default) => format!(", default `{default}`"),
        None if is_required => ", required".to_owned(),
        None => ", optional".to_owned(),
    };
    format!("{}{default}", kind(property))
}

fn kind(schema: &Value) -> String {
    if let Some(alternatives) = schema["anyOf"].as_array() {
        return alternatives.iter().map(kind).collect::<Vec<_>>().join(" or ");
    }
    if let Some(choices) = schema["oneOf"].as_array() {
        return choices
            .iter()
            .map(|choice| {
                let doc = text(&choice["description"]);
                let name = format!("`{}`", choice["const"]);
                if doc.is_empty() { name } else { format!("{name}: {doc}") }
            })
            .collect::<Vec<_>>()
            .join("<br>");
    }
    let range = |word: &str| {
        let above = schema.get("exclusiveMinimum").map(|bound| format!(" greater than {bound}"));
        let least = schema.get("minimum").map(|bound| format!(" at least {bound}"));
        let most = schema.get("maximum").map(|bound| format!(" at most {bound}"));
        let bounds: Vec<String> = [above, least, most].into_iter().flatten().collect();
        format!("{word}{}", bounds.join(","))
    };
    match schema["type"].as_str() {
        Some("boolean") => "true or false".to_owned(),
        Some("integer") => range("whole number"),
        Some("number") => range("number"),
        Some("string") => "text".to_owned(),
        Some("array") => {
            let n = &schema["minItems"];
            let of = kind(&schema["items"]);
            if schema.get("maxItems") == Some(n) {
                format!("list of {n}: {of}")
            } else {
                format!("list: {of}")
            }
        }
        Some("object") => {
            let names: Vec<String> = keys(schema).map(|(key, _)| format!("`{key}`")).collect();
            format!("table with {}", names.join(" or "))
        }
        _ => "any value".to_owned(),
    }
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or("").replace('|', "\\|").replace('\n', " ")
}
