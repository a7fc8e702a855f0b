//! Commands that the pages show are run, and the numbers that they print are compared with those on the page.
//!
//! A page is run from top to bottom in a folder of its own, which has `configs/`, `robotsim/examples/` and `target/release/`
//! as the repository has them. Three kinds of fenced blocks count:
//!
//! | block | meaning |
//! |---|---|
//! | `console` | lines that begin with `$ ` are commands, what follows each is its output |
//! | `sh run` | a script |
//! | `text output` | the output of the script before it |
//!
//! Of each line of output on the page the program must print a line with the same numbers, in the same order of lines. Words do
//! not count, and lines without numbers only say what is there. `…` at the end of a line stands for its rest, on a line by itself
//! for any lines. What depends on the machine is not compared: how long a run took, and what follows from that.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Pages whose commands take minutes: `tests/external/test_documented.py` runs them.
pub const LONG: [&str; 2] = ["docs/measured-packets.md", "docs/missing-physics.md"];

/// Pages whose commands need measurements that are not in the repository: `tests/external/test_real_flight.py` runs them.
pub const MEASURED: [&str; 1] = ["docs/real-flight.md"];

/// Pages whose commands simulate large swarms: `.ci/release` runs them.
pub const LARGE: [&str; 1] = ["docs/performance.md"];

/// A command of a page, or several that belong together, and what the page says they print.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Line of the page.
    pub line: usize,
    /// Given to a shell.
    pub script: String,
    /// Lines of output.
    pub output: Vec<String>,
}

/// All pages of the guide, from the top folder of the repository.
///
/// # Panics
///
/// If the folder cannot be read.
#[must_use]
pub fn pages() -> Vec<String> {
    let docs = std::fs::read_dir(crate::repository().join("docs")).expect("docs/ is there");
    let names = docs.map(|entry| entry.expect("a name").file_name());
    let mut pages: Vec<String> = names
        .filter_map(|name| name.into_string().ok())
        .filter(|name| name.ends_with(".md"))
        .map(|name| format!("docs/{name}"))
        .collect();
    pages.push("README.md".to_owned());
    pages.sort();
    pages
}

/// The commands of a page.
#[must_use]
pub fn commands(page: &str) -> Vec<Shown> {
    let mut found: Vec<Shown> = Vec::new();
    let mut block: Option<&str> = None;
    for (line, text) in (1..).zip(page.lines()) {
        if let Some(kind) = text.strip_prefix("```") {
            block = block.is_none().then_some(kind);
            if block == Some("sh run") {
                found.push(Shown { line: line + 1, script: String::new(), output: Vec::new() });
            }
            continue;
        }
        match (block, found.last_mut()) {
            (Some("sh run"), Some(shown)) => {
                shown.script.push_str(text);
                shown.script.push('\n');
            }
            (Some("text output"), Some(shown)) => shown.output.push(text.to_owned()),
            (Some("console"), last) => match (text.strip_prefix("$ "), last) {
                (Some(command), _) => {
                    let script = command.to_owned();
                    found.push(Shown { line, script, output: Vec::new() });
                }
                (None, Some(shown)) if shown.script.ends_with('\\') && shown.output.is_empty() => {
                    shown.script.push('\n');
                    shown.script.push_str(text);
                }
                (None, Some(shown)) => shown.output.push(text.to_owned()),
                (None, None) => {}
            },
            _ => {}
        }
    }
    found
}

/// The numbers of a line, as they are written. Digits within words are none.
#[must_use]
pub fn numbers(line: &str) -> Vec<&str> {
    // How long a run took, and steps per second.
    let line = line.find(" simulated in ").map_or(line, |end| &line[..end]);
    let bytes = line.as_bytes();
    let mut numbers = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let is_in_word =
            0 < at && (bytes[at - 1].is_ascii_alphanumeric() || b"_.".contains(&bytes[at - 1]));
        if !bytes[at].is_ascii_digit() || is_in_word {
            at += 1;
            continue;
        }
        let mut end = at;
        let digit = |place: usize| bytes.get(place).is_some_and(u8::is_ascii_digit);
        while digit(end)
            || (bytes.get(end).is_some_and(|byte| b".,".contains(byte)) && digit(end + 1))
        {
            end += 1;
        }
        if bytes.get(end) == Some(&b'e')
            && (digit(end + 1) || (bytes.get(end + 1) == Some(&b'-') && digit(end + 2)))
        {
            end += 2;
            while digit(end) {
                end += 1;
            }
        }
        let is_negative =
            0 < at && bytes[at - 1] == b'-' && !(1 < at && bytes[at - 2].is_ascii_alphanumeric());
        let word = bytes.get(end).is_some_and(|byte| byte.is_ascii_alphabetic() || *byte == b'_');
        if !word {
            numbers.push(&line[at - usize::from(is_negative)..end]);
        }
        at = end;
    }
    numbers
}

/// What the page says and the program does not print: lines, each with what was printed in its place. Empty: all is true.
#[must_use]
pub fn deviations(said: &[String], printed: &str) -> Vec<String> {
    let printed: Vec<&str> = printed.lines().collect();
    let mut next = 0;
    let mut wrong = Vec::new();
    for line in said {
        let wanted = numbers(line);
        if wanted.is_empty() {
            continue;
        }
        let is_cut = line.trim_end().ends_with('…');
        let has =
            |found: &[&str]| if is_cut { found.starts_with(&wanted) } else { found == wanted };
        match (next..printed.len()).find(|&place| has(&numbers(printed[place]))) {
            Some(place) => next = place + 1,
            None => {
                // The line that begins alike is the one that is meant.
                let begin: String = line.trim_start().chars().take(8).collect();
                let meant =
                    printed[next..].iter().find(|printed| printed.contains(begin.trim_end()));
                let mut text = format!("the page:    {line}");
                let _ = write!(text, "\n    the program: {}", meant.unwrap_or(&"nothing alike"));
                wrong.push(text);
            }
        }
    }
    wrong
}

/// Runs a page, such as `docs/network.md`, in an empty folder; returns what is wrong with it.
///
/// # Errors
///
/// Files cannot be read or written, or no shell can be started.
pub fn deviations_of_page(
    page: &str,
    folder: &Path,
    programs: &Path,
) -> std::io::Result<Vec<String>> {
    let repository = crate::repository();
    let text = std::fs::read_to_string(repository.join(page))?;
    copy(&repository.join("configs"), &folder.join("configs"))?;
    copy(&repository.join("robotsim/examples"), &folder.join("robotsim/examples"))?;
    std::fs::create_dir_all(folder.join("target"))?;
    std::os::unix::fs::symlink(programs, folder.join("target/release"))?;
    let mut wrong = Vec::new();
    for shown in commands(&text) {
        let path = std::env::var("PATH").unwrap_or_default();
        let output = Command::new("timeout")
            .args(["600", "bash"])
            .args(["-e", "-c", &format!("{PRELUDE}{} 2>&1", grouped(&shown.script))])
            .env("PATH", format!("{}:{path}", programs.display()))
            .current_dir(folder)
            .stdin(Stdio::null())
            .output()?;
        let printed = String::from_utf8_lossy(&output.stdout);
        let place = format!("{page}:{}", shown.line);
        let fails = shown.output.iter().any(|line| line.starts_with("error: "));
        if output.status.success() == fails {
            wrong.push(format!("{place}: {}\n{printed}", output.status));
        }
        let deviations = deviations(&shown.output, &printed);
        wrong.extend(deviations.into_iter().map(|text| format!("{place}:\n    {text}")));
    }
    Ok(wrong)
}

/// A script whose whole output can be taken.
fn grouped(script: &str) -> String {
    format!("{{\n{script}\n}}")
}

fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let path: PathBuf = entry?.path();
        let copy_to = to.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy(&path, &copy_to)?;
        } else {
            std::fs::copy(&path, copy_to)?;
        }
    }
    Ok(())
}

/// The programs are built already.
const PRELUDE: &str = "cargo() { [ \"$1\" != build ] || return 0; while [ \"$1\" != -- ]; do shift; done; shift; \
                       murmuration \"$@\"; }\n";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_that_are_to_be_run_are_found_with_what_they_print() {
        let page = "```sh\nnot run\n```\n```sh run\na\nb\n```\nwords\n```text output\n1\n```\n\
                    ```console\n$ c \\\n  d\n2\n$ e\n```\n";
        let shown = commands(page);
        let scripts: Vec<(&str, usize)> =
            shown.iter().map(|it| (it.script.as_str(), it.output.len())).collect();
        assert_eq!(scripts, [("a\nb\n", 1), ("c \\\n  d", 1), ("e", 0)]);
    }

    #[test]
    fn numbers_are_found_with_sign_and_exponent_but_not_in_words() {
        let line = "db_per_c = -0.5645 dB (90 %: 1,234 to 4e-5), 6tisch x2 B-3 effect[0] 2026.";
        assert_eq!(numbers(line), ["-0.5645", "90", "1,234", "4e-5", "3", "0", "2026"]);
        assert_eq!(
            numbers("a: 250 steps, 25.0 s simulated in 0.04 s (6981 steps/s)"),
            ["250", "25.0"]
        );
    }

    #[test]
    fn missing_physics_a_number_that_drifted_is_reported() {
        let said = ["power of 80 % from loss_db = 2.9467 dB".to_owned()];
        assert!(deviations(&said, "words\na power of 80 % from loss_db = 2.9467 dB").is_empty());
        let wrong = deviations(&said, "a power of 80 % from loss_db = 0.4150 dB");
        assert!(wrong[0].contains("0.4150"), "{wrong:?}");
        let cut = ["1 and …".to_owned(), "…".to_owned(), "no number".to_owned(), "3".to_owned()];
        assert!(deviations(&cut, "1 and 2\n9\n3").is_empty());
        assert_eq!(deviations(&cut, "3\n1 and 2").len(), 1);
    }
}
