//! What deny.toml allows of dependencies holds: licenses, sources, bans. `cargo deny check` looks further, where it is installed.

use serde_json::Value;
use std::collections::BTreeSet;
use std::process::Command;

fn rules() -> toml::Table {
    let text = std::fs::read_to_string(checks::repository().join("deny.toml")).unwrap();
    text.parse().unwrap()
}

/// Packages of the lock file that are not ours.
fn packages() -> Vec<Value> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(checks::repository())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap().iter();
    packages.filter(|package| !package["source"].is_null()).cloned().collect()
}

/// Whether a license expression (SPDX) can be met with licenses of the list.
fn is_allowed(expression: &str, allowed: &BTreeSet<String>) -> bool {
    // Before there were expressions, a slash stood for OR.
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let mut words: Vec<&str> = spaced.split_whitespace().collect();
    words.reverse();
    let met = any_of(&mut words, allowed);
    assert!(words.is_empty(), "{expression}: {words:?} is left");
    met
}

fn any_of(words: &mut Vec<&str>, allowed: &BTreeSet<String>) -> bool {
    let mut met = all_of(words, allowed);
    while words.last() == Some(&"OR") {
        words.pop();
        met |= all_of(words, allowed);
    }
    met
}

fn all_of(words: &mut Vec<&str>, allowed: &BTreeSet<String>) -> bool {
    let mut met = one(words, allowed);
    while words.last() == Some(&"AND") {
        words.pop();
        met &= one(words, allowed);
    }
    met
}

fn one(words: &mut Vec<&str>, allowed: &BTreeSet<String>) -> bool {
    let mut license = words.pop().expect("a license").to_owned();
    if license == "(" {
        let met = any_of(words, allowed);
        assert_eq!(words.pop(), Some(")"));
        return met;
    }
    if words.last() == Some(&"WITH") {
        words.pop();
        license = format!("{license} WITH {}", words.pop().expect("an exception"));
    }
    allowed.contains(&license)
}

#[test]
fn license_expressions_are_read_as_spdx_means_them() {
    let allowed: BTreeSet<String> = ["MIT", "Zlib"].map(str::to_owned).into();
    for (expression, expected) in [
        ("MIT", true),
        ("MIT/Apache-2.0", true),
        ("GPL-3.0 OR MIT AND Zlib", true),
        ("(GPL-3.0 OR MIT) AND ISC", false),
        ("MIT WITH LLVM-exception", false),
    ] {
        assert_eq!(is_allowed(expression, &allowed), expected, "{expression}");
    }
}

#[test]
fn licenses_sources_and_bans_are_those_of_deny_toml() {
    let rules = rules();
    let texts = |section: &str, key: &str| -> BTreeSet<String> {
        let values = rules[section][key].as_array().unwrap().iter();
        values
            .map(|value| value.get("crate").unwrap_or(value).as_str().unwrap().to_owned())
            .collect()
    };
    let allowed = texts("licenses", "allow");
    let banned = texts("bans", "deny");
    let registries = texts("sources", "allow-registry");
    let packages = packages();
    assert!(100 < packages.len(), "{} packages", packages.len());
    for package in packages {
        let name = package["name"].as_str().unwrap();
        assert!(!banned.contains(name), "{name} is banned by deny.toml");
        let source = package["source"].as_str().unwrap();
        let registry = source.strip_prefix("registry+");
        assert!(registry.is_some_and(|url| registries.contains(url)), "{name} is from {source}");
        let license = package["license"].as_str().unwrap_or("no license");
        assert!(is_allowed(license, &allowed), "{name} has the license {license}");
    }
}
