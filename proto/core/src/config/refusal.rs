//! A configuration file that is refused: every problem, placed on its line.

use super::{Node, Problem};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Every problem of a file, in the order of its lines.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.render())]
pub struct Refusal {
    path: PathBuf,
    problems: Vec<Placed>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Placed {
    line: Option<(usize, String)>,
    text: String,
}

impl Refusal {
    /// A file that cannot be read at all, and why.
    #[must_use]
    pub fn of_file(path: &Path, reason: String) -> Self {
        Self { path: path.to_owned(), problems: vec![Placed { line: None, text: reason }] }
    }

    /// Places each problem on its line: `text` is the file's content, `tree` what was parsed of it and set over it.
    #[must_use]
    pub fn new(path: &Path, text: &str, tree: &Node, problems: Vec<Problem>) -> Self {
        let mut placed: Vec<Placed> = problems
            .into_iter()
            .map(|problem| {
                if tree.is_set_from_elsewhere(&problem.path) {
                    return Placed {
                        line: None,
                        text: format!("{problem} (set on the command line)"),
                    };
                }
                let span = problem.span.clone().or_else(|| tree.span_of(&problem.path));
                let line = span.map(|span| line_of(text, span.start));
                Placed { line, text: problem.to_string() }
            })
            .collect();
        placed.sort_by_key(|problem| problem.line.as_ref().map_or(0, |(number, _)| *number));
        placed.dedup();
        Self { path: path.to_owned(), problems: placed }
    }

    /// Adds the problems of another reading of the same file, without repetition.
    pub fn merge(&mut self, other: Self) {
        for problem in other.problems {
            if !self.problems.contains(&problem) {
                self.problems.push(problem);
            }
        }
        self.problems.sort_by_key(|problem| problem.line.as_ref().map_or(0, |(n, _)| *n));
    }

    /// Number of problems.
    #[must_use]
    pub fn n_problems(&self) -> usize {
        self.problems.len()
    }

    fn render(&self) -> String {
        let path = self.path.display();
        let mut text = match self.problems.len() {
            1 => String::new(),
            n => format!("{path}: {n} problems\n"),
        };
        for problem in &self.problems {
            match &problem.line {
                Some((number, line)) => {
                    let _ = writeln!(text, "{path}:{number}: {}", problem.text);
                    let _ = writeln!(text, "  {number:>4} | {line}");
                }
                None => {
                    let _ = writeln!(text, "{path}: {}", problem.text);
                }
            }
        }
        text.truncate(text.trim_end().len());
        text
    }
}

/// Number (from 1) and content of the line at a byte.
fn line_of(text: &str, byte: usize) -> (usize, String) {
    let byte = byte.min(text.len());
    let before = &text.as_bytes()[..byte];
    let number = before.iter().filter(|&&b| b == b'\n').count() + 1;
    let start = before.iter().rposition(|&b| b == b'\n').map_or(0, |newline| newline + 1);
    let line = text[start..].lines().next().unwrap_or("").trim_end().to_owned();
    (number, line)
}
