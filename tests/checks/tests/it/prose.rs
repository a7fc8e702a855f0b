//! How the pages read: the length of their sentences, and the terms of the field in place of paraphrases.

use std::path::{Path, PathBuf};

/// The longest sentence allowed, in words.
const LONGEST: usize = 35;
/// The mean length of sentences over all pages must stay below this, in words.
const MEAN: f64 = 20.0;

/// Phrases that a reader from the field has to translate, and the term to write instead.
const PARAPHRASES: &[(&str, &str)] = &[
    ("level per link", "random effect per link, per-link intercept"),
    ("levels per link", "random effects per link, per-link intercepts"),
    ("levels of nodes", "random effects per node, per-node intercepts"),
    ("levels of links", "random effects per link, per-link intercepts"),
    ("what is random", "random effects"),
    ("rows left out", "held-out rows"),
    ("rows that were left out", "held-out rows"),
    ("chance over blocks", "standard error clustered over blocks"),
    ("beyond chance", "significant, with the level and the correction"),
    ("what the likelihood allows", "profile-likelihood interval"),
    ("the likelihood allows", "profile-likelihood interval"),
    ("cannot be told apart", "not identifiable, aliased, collinear"),
    ("be told apart", "be distinguished; not identifiable, aliased, collinear"),
    ("tried without", "backward elimination"),
    ("left over", "residual, unexplained variance"),
    ("measured beside", "covariate"),
    ("scatters more", "heteroscedastic, overdispersed"),
    ("scatter more", "heteroscedastic, overdispersed"),
    ("creeps along", "stalls at a bound"),
    ("creep along", "stall at a bound"),
    ("waited for awake", "busy-wait, spin"),
    ("befall", "event, happen to"),
    ("reckon", "compute, estimate"),
    ("is told", "receives, reads; or say who reports"),
    ("are told", "receive, read; or say who reports"),
    ("such as do", "name them"),
    ("hangs on", "depends on"),
    ("hang on", "depend on"),
    ("whoever", "you, a user, anyone who"),
];

/// Every page that users and contributors read.
fn pages() -> Vec<PathBuf> {
    let root = checks::repository();
    let mut pages = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                // Neither what builds and runs leave, nor hidden folders, nor packages of others.
                if !name.starts_with('.') && !["target", "runs", "node_modules"].contains(&&*name) {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|extension| extension == "md") {
                pages.push(path);
            }
        }
    }
    pages.sort();
    pages
}

/// A paragraph or an item of a list, and the line on which it begins.
struct Paragraph {
    line: usize,
    text: String,
}

/// Running text of a page: no headings, tables, formulas, code or HTML.
fn paragraphs(page: &str) -> Vec<Paragraph> {
    let mut paragraphs: Vec<Paragraph> = Vec::new();
    let mut open = false;
    let mut fence: Option<&str> = None;
    for (index, line) in page.lines().enumerate() {
        let line = line.trim();
        if let Some(end) = fence {
            if line == end {
                fence = None;
            }
            continue;
        }
        if line.starts_with("```") || line == "$$" {
            fence = Some(if line == "$$" { "$$" } else { "```" });
            open = false;
            continue;
        }
        if line.is_empty() || line.starts_with(['#', '|', '<']) {
            open = false;
            continue;
        }
        let item = line.strip_prefix("- ").or_else(|| line.strip_prefix("* ")).or_else(|| {
            let (number, rest) = line.split_once(". ")?;
            number.chars().all(|c| c.is_ascii_digit()).then_some(rest)
        });
        let text = item.unwrap_or(line).trim_start_matches("> ");
        if item.is_some() {
            open = false;
        }
        match paragraphs.last_mut().filter(|_| open) {
            Some(paragraph) => {
                paragraph.text.push(' ');
                paragraph.text.push_str(text);
            }
            None => paragraphs.push(Paragraph { line: index + 1, text: text.to_owned() }),
        }
        open = true;
    }
    paragraphs
}

/// Text with `code` as one word and links as their text.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    for (index, part) in text.split('`').enumerate() {
        plain.push_str(if index % 2 == 0 { part } else { "code" });
    }
    let mut text = String::new();
    let mut rest = &*plain;
    while let Some((before, link)) = rest.split_once("](") {
        text.push_str(before);
        text.push(' ');
        rest = link.split_once(')').map_or("", |(_, rest)| rest);
    }
    text.push_str(rest);
    text.replace(['[', ']', '*', '_'], "")
}

/// The sentences of a paragraph. A semicolon or a colon ends none.
fn sentences(text: &str) -> Vec<String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let mut sentences = Vec::new();
    let mut sentence: Vec<&str> = Vec::new();
    for (index, word) in words.iter().enumerate() {
        sentence.push(word);
        let ends = word.trim_end_matches(['"', ')', '”']).ends_with(['.', '!', '?']);
        let goes_on = ["al.", "e.g.", "i.e.", "cf.", "vs.", "Fig.", "Eq.", "Sec.", "No."]
            .iter()
            .any(|abbreviation| word.trim_start_matches('(') == *abbreviation)
            || words.get(index + 1).is_some_and(|next| {
                next.starts_with(char::is_lowercase)
                    && next.trim_end_matches(|c: char| !c.is_alphanumeric()) != "code"
            });
        if ends && !goes_on {
            sentences.push(std::mem::take(&mut sentence).join(" "));
        }
    }
    if !sentence.is_empty() {
        sentences.push(sentence.join(" "));
    }
    sentences
}

fn n_words(sentence: &str) -> usize {
    sentence.split_whitespace().filter(|word| word.contains(char::is_alphanumeric)).count()
}

/// Every sentence of the pages with the place of its paragraph.
fn all_sentences() -> Vec<(String, String)> {
    let mut all = Vec::new();
    for page in pages() {
        let text = std::fs::read_to_string(&page).unwrap();
        for paragraph in paragraphs(&text) {
            let place = format!("{}:{}", named(&page), paragraph.line);
            all.extend(
                sentences(&plain(&paragraph.text)).into_iter().map(|text| (place.clone(), text)),
            );
        }
    }
    all
}

fn named(page: &Path) -> String {
    page.strip_prefix(checks::repository()).unwrap().display().to_string()
}

#[test]
fn no_sentence_is_longer_than_35_words() {
    let long: Vec<String> = all_sentences()
        .into_iter()
        .filter(|(_, text)| LONGEST < n_words(text))
        .map(|(place, text)| format!("{place}: {} words: {text}", n_words(&text)))
        .collect();
    assert!(long.is_empty(), "split these sentences:\n{}", long.join("\n"));
}

#[test]
fn sentences_have_fewer_than_20_words_on_average() {
    let lengths: Vec<usize> = all_sentences().iter().map(|(_, text)| n_words(text)).collect();
    let mean = lengths.iter().sum::<usize>() as f64 / lengths.len() as f64;
    assert!(1_000 < lengths.len(), "{} sentences", lengths.len());
    assert!(mean < MEAN, "{mean:.1} words");
}

#[test]
fn pages_use_the_terms_of_the_field() {
    let mut found = Vec::new();
    for page in pages() {
        let text = std::fs::read_to_string(&page).unwrap();
        for (index, line) in text.lines().enumerate() {
            // Names in the code are not prose.
            let lower = plain(line).to_lowercase();
            for (paraphrase, term) in PARAPHRASES {
                let at = lower
                    .match_indices(paraphrase)
                    .any(|(at, _)| !lower[..at].ends_with(char::is_alphanumeric));
                if at {
                    found.push(format!(
                        "{}:{}: {paraphrase:?}: write {term}",
                        named(&page),
                        index + 1
                    ));
                }
            }
        }
    }
    assert!(found.is_empty(), "{} paraphrases:\n{}", found.len(), found.join("\n"));
}

#[test]
fn pages_name_one_wheel_of_this_version() {
    let manifest = std::fs::read_to_string(checks::repository().join("Cargo.toml")).unwrap();
    let version = manifest.lines().find_map(|line| line.strip_prefix("version = ")).unwrap();
    let version = version.trim_matches('"');
    let ours = format!("dist/{version}/murmuration_sim-{version}-*.whl");
    // What a release of any version is like.
    let any = "dist/VERSION/murmuration_sim-VERSION-*.whl";
    let mut n_named = 0;
    for page in pages() {
        let text = std::fs::read_to_string(&page).unwrap();
        let words = text.split([' ', '(', ')', '"', '`', '\n']);
        for word in words.filter(|word| word.contains("dist/") && word.ends_with(".whl")) {
            assert!([&ours, any].contains(&word), "{}: {word}, not {ours}", named(&page));
            n_named += 1;
        }
    }
    assert!(3 < n_named, "{n_named}");
}

#[test]
fn sentences_are_found_in_paragraphs_and_lists() {
    let page = "# Title of a page\n\nOne two. Three; four:\nfive `six seven` [eight](nine ten).\n\n- a b\n- c et al. D\n\n| a | b |\n\n```\ncode. Code\n```\n";
    let texts: Vec<String> =
        paragraphs(page).iter().flat_map(|paragraph| sentences(&plain(&paragraph.text))).collect();
    let counts: Vec<usize> = texts.iter().map(|text| n_words(text)).collect();
    assert_eq!(counts, [2, 5, 2, 4], "{texts:?}");
}
