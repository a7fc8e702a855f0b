//! docs/conformance.md: every vector has a row, every test that it names exists, every test of a vector is named.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const VERDICTS: [&str; 3] = ["met", "peer's defect", "particular"];

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a folder of the repository").to_owned()
}

fn page() -> String {
    std::fs::read_to_string(repository().join("docs/conformance.md")).expect("the page is there")
}

/// All vectors: numbered ones, and tables of figures.
fn vectors() -> BTreeSet<String> {
    let numbered = [
        ("K", 9),
        ("A", 4),
        ("C", 7),
        ("T", 20),
        ("S", 9),
        ("M", 12),
        ("R", 12),
        ("F", 8),
        ("J", 2),
        ("P", 2),
        ("KPI", 2),
        ("B", 7),
    ];
    let numbered =
        numbered.iter().flat_map(|(letter, n)| (1..=*n).map(move |i| format!("{letter}{i}")));
    let tables = [
        "table",
        "Friis",
        "range",
        "PDR−40",
        "PDR−20",
        "Pister-hack",
        "Q3",
        "SINR",
        "hash",
        "end-to-end",
    ];
    numbered.chain(tables.map(str::to_owned)).collect()
}

/// The cells of a line of a table.
fn cells(line: &str) -> Option<Vec<&str>> {
    let inner = line.strip_prefix('|')?.strip_suffix('|')?;
    Some(inner.split('|').map(str::trim).collect())
}

/// The cells of the rows of all tables of a text, without headings.
fn rows(text: &str) -> Vec<Vec<&str>> {
    // Every table begins with a heading and a rule.
    let lines: Vec<&str> = text.lines().collect();
    (0..lines.len())
        .filter(|&i| {
            let is_rule = |line: Option<&&str>| line.is_some_and(|line| line.starts_with("|---"));
            !is_rule(lines.get(i)) && !is_rule(lines.get(i + 1))
        })
        .filter_map(|i| cells(lines[i]))
        .collect()
}

/// Tests named in a cell: file and name.
fn tests_of(cell: &str) -> Vec<(&str, &str)> {
    let code = cell.split('`').skip(1).step_by(2);
    code.map(|code| code.split_once("::").expect("a file and a name")).collect()
}

/// Names of the tests of a source.
fn tests_in(source: &str) -> BTreeSet<String> {
    let after = source.split("#[test]").skip(1);
    after
        .filter_map(|after| {
            let name = after.split("fn ").nth(1)?.split('(').next()?;
            Some(name.trim().to_owned())
        })
        .collect()
}

/// All sources with the tests in them.
fn sources() -> Vec<(PathBuf, BTreeSet<String>)> {
    let mut folders: Vec<PathBuf> = ["proto", "netsim", "robotsim", "orchestrator", "tests"]
        .map(|name| repository().join(name))
        .to_vec();
    let mut sources = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(&path).expect("text");
                sources.push((path, tests_in(&text)));
            }
        }
    }
    sources
}

#[test]
fn every_vector_has_one_row_with_a_verdict_and_a_test_or_the_reason_why_there_is_none() {
    let page = page();
    let (vectors_part, _) = page.split_once("\n## Clauses").expect("clauses come last");
    let rows: Vec<Vec<&str>> =
        rows(vectors_part).into_iter().filter(|cells| cells.len() == 5).collect();
    let listed: Vec<String> = rows.iter().map(|cells| cells[0].to_owned()).collect();
    assert_eq!(listed.iter().cloned().collect::<BTreeSet<_>>(), vectors());
    assert_eq!(listed.len(), vectors().len(), "one row each");
    for cells in &rows {
        let [vector, asks, verdict, remarks, tests] = cells[..] else { unreachable!("five cells") };
        assert!(VERDICTS.contains(&verdict) && !asks.is_empty(), "{vector}: {verdict:?}");
        let is_shown = !tests_of(tests).is_empty();
        assert!(is_shown || verdict == "particular", "{vector} names no test");
        assert!(!remarks.is_empty() || verdict == "met", "{vector} does not say why");
    }
}

#[test]
fn every_test_that_the_page_names_exists_where_it_says() {
    let page = page();
    let named: Vec<(&str, &str)> = rows(&page)
        .into_iter()
        .filter_map(|cells| cells.last().copied())
        .filter(|cell| cell.contains("::"))
        .flat_map(tests_of)
        .collect();
    assert!(200 < named.len(), "{}", named.len());
    let sources = sources();
    for (file, name) in named {
        let path = repository().join(file);
        let found = sources.iter().find(|(of, _)| *of == path);
        assert!(found.is_some_and(|(_, tests)| tests.contains(name)), "{file} has no test {name}");
    }
}

#[test]
fn every_test_that_bears_a_vectors_name_is_on_the_page() {
    let page = page();
    let prefixes: Vec<String> =
        vectors().iter().map(|vector| format!("{}_", vector.to_lowercase())).collect();
    for (path, tests) in sources() {
        for test in tests {
            if prefixes.iter().any(|prefix| test.starts_with(prefix)) {
                assert!(page.contains(&format!("::{test}`")), "{}: {test}", path.display());
            }
        }
    }
}
