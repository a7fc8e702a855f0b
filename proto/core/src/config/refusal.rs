//! A configuration file that is refused: every problem, placed on its line.

use super::{Node, Problem};
use crate::bounds::LISTED_PROBLEMS;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Every problem of a file, in the order of its lines.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.render())]
pub struct Refusal {
    path: PathBuf,
    problems: Vec<Placed>,
    /// Further problems, which are not listed.
    n_more: usize,
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
        Self {
            path: path.to_owned(),
            problems: vec![Placed { line: None, text: reason }],
            n_more: 0,
        }
    }

    /// Places each problem on its line: `text` is the file's content, `tree` what was parsed of it and set over it.
    #[must_use]
    pub fn new(path: &Path, text: &str, tree: &Node, problems: Vec<Problem>) -> Self {
        let lines = Lines::of(text);
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
                let line = span.map(|span| lines.at(span.start));
                Placed { line, text: problem.to_string() }
            })
            .collect();
        placed.sort_by_key(|problem| problem.line.as_ref().map_or(0, |(number, _)| *number));
        placed.dedup();
        let mut refusal = Self { path: path.to_owned(), problems: placed, n_more: 0 };
        refusal.shorten();
        refusal
    }

    /// Keeps the problems that are listed, and counts the others.
    fn shorten(&mut self) {
        let listed = LISTED_PROBLEMS.most as usize;
        self.n_more += self.problems.len().saturating_sub(listed);
        self.problems.truncate(listed);
    }

    /// Adds the problems of another reading of the same file, without repetition.
    pub fn merge(&mut self, other: Self) {
        for problem in other.problems {
            if !self.problems.contains(&problem) {
                self.problems.push(problem);
            }
        }
        self.problems.sort_by_key(|problem| problem.line.as_ref().map_or(0, |(n, _)| *n));
        // Both readings left out much the same.
        self.n_more = self.n_more.max(other.n_more);
        self.shorten();
    }

    /// Number of problems.
    #[must_use]
    pub fn n_problems(&self) -> usize {
        self.problems.len() + self.n_more
    }

    fn render(&self) -> String {
        let path = self.path.display();
        let mut text = match self.n_problems() {
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
        if 0 < self.n_more {
            let n = self.n_more;
            let _ = writeln!(text, "{path}: {n} more problems are not listed");
        }
        text.truncate(text.trim_end().len());
        text
    }
}

/// Lines of a text, found by the bytes in them.
struct Lines<'a> {
    text: &'a str,
    starts: Vec<usize>,
}

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Self {
        let breaks = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let starts = std::iter::once(0).chain(breaks.map(|(at, _)| at + 1)).collect();
        Self { text, starts }
    }

    /// Number (from 1) and content of the line at a byte, shortened.
    fn at(&self, byte: usize) -> (usize, String) {
        let number = self.starts.partition_point(|start| *start <= byte.min(self.text.len()));
        let line = self.text[self.starts[number - 1]..].lines().next().unwrap_or("").trim_end();
        let mut shown: String = line.chars().take(LONGEST_LINE).collect();
        if shown.len() < line.len() {
            shown.push_str(" …");
        }
        (number, shown)
    }
}

/// Characters of a line that are shown.
const LONGEST_LINE: usize = 200;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;

    #[test]
    fn many_problems_are_counted_and_the_first_are_listed() {
        let text: String = (0..40_000).map(|entry| format!("[[e]]\nk{entry} = 1\n")).collect();
        let tree = parse(&text).unwrap();
        let problem = |entry: usize| Problem::new(format!("e[{entry}].k{entry}"), "is unknown");
        let problems = (0..40_000).map(problem).collect();
        let mut refusal = Refusal::new(Path::new("x.toml"), &text, &tree, problems);
        assert_eq!(refusal.n_problems(), 40_000);
        let said = refusal.to_string();
        assert!(
            said.starts_with("x.toml: 40000 problems\nx.toml:2: e[0].k0: is unknown"),
            "{said}"
        );
        assert!(said.ends_with("39900 more problems are not listed"), "{said}");
        refusal.merge(refusal.clone());
        assert_eq!(refusal.n_problems(), 40_000);
    }

    #[test]
    fn a_long_line_is_shown_in_part() {
        let text = format!("a = [{}]", "1,".repeat(10_000));
        let tree = parse(&text).unwrap();
        let refusal =
            Refusal::new(Path::new("x.toml"), &text, &tree, vec![Problem::new("a", "is wrong")]);
        assert!(refusal.to_string().len() < 400);
    }
}
