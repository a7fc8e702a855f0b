//! Tables of text that fit a terminal of 80 columns.

use std::fmt::Write as _;

/// Columns of a terminal that tables fit.
pub const WIDTH: usize = 80;
/// A first column that makes a table too wide is broken to this width at least.
const LEAST_FIRST: usize = 18;
/// The last column, where it is text, is broken to this width at least.
const LEAST_LAST: usize = 14;
/// Spaces between columns.
const GAP: usize = 2;

/// To which side the cells of a column go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Text.
    Left,
    /// Numbers.
    Right,
}

/// A table of text. Its lines are at most [`WIDTH`] wide, if its words allow that: headings that are too wide are broken at spaces, then
/// the last column if it is text, then the first one; columns that still do not fit stand below the others, after the first column again.
#[derive(Clone, Debug)]
pub struct TextTable {
    indent: usize,
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
}

impl TextTable {
    /// A table with these headings. The first column is text, the others are numbers.
    #[must_use]
    pub fn new<T: Into<String>>(headings: impl IntoIterator<Item = T>) -> Self {
        let aligned = headings.into_iter().enumerate().map(|(place, heading)| {
            (heading.into(), if place == 0 { Align::Left } else { Align::Right })
        });
        Self { indent: 0, columns: aligned.collect(), rows: Vec::new() }
    }

    /// The same, indented by so many spaces.
    #[must_use]
    pub fn indented(self, indent: usize) -> Self {
        Self { indent, ..self }
    }

    /// The same, with text in a column.
    #[must_use]
    pub fn text_in(mut self, column: usize) -> Self {
        if let Some((_, align)) = self.columns.get_mut(column) {
            *align = Align::Left;
        }
        self
    }

    /// Adds a row, a cell for each column; those that are missing at its end are empty.
    pub fn row<T: Into<String>>(&mut self, cells: impl IntoIterator<Item = T>) {
        let mut row: Vec<String> = cells.into_iter().map(Into::into).collect();
        row.resize(self.columns.len(), String::new());
        self.rows.push(row);
    }

    /// The lines of the table, each with an end of line.
    #[must_use]
    pub fn text(&self) -> String {
        let mut widths: Vec<usize> = (0..self.columns.len()).map(|at| self.natural(at)).collect();
        self.break_headings(&mut widths);
        self.break_ends(&mut widths);
        let mut text = String::new();
        for (number, block) in self.blocks(&widths).iter().enumerate() {
            if 0 < number {
                text.push('\n');
            }
            self.write_block(block, &widths, &mut text);
        }
        text
    }

    /// The columns that stand side by side, the first one in each block.
    fn blocks(&self, widths: &[usize]) -> Vec<Vec<usize>> {
        let Some((first, others)) = widths.split_first() else { return Vec::new() };
        let mut blocks: Vec<Vec<usize>> = vec![vec![0]];
        let mut used = self.indent + first;
        for (place, width) in others.iter().enumerate() {
            if WIDTH < used + GAP + width && 1 < blocks.last().map_or(0, Vec::len) {
                blocks.push(vec![0]);
                used = self.indent + first;
            }
            used += GAP + width;
            blocks.last_mut().into_iter().for_each(|block| block.push(place + 1));
        }
        blocks
    }

    fn natural(&self, column: usize) -> usize {
        let cells = self.rows.iter().map(|row| length(&row[column]));
        cells.max().unwrap_or(0).max(length(&self.columns[column].0))
    }

    /// Width that the cells of a column need, and the longest word of its heading.
    fn least(&self, column: usize) -> usize {
        let cells = self.rows.iter().map(|row| length(&row[column]));
        let words = self.columns[column].0.split(' ').map(length);
        cells.chain(words).max().unwrap_or(0)
    }

    fn total(&self, widths: &[usize]) -> usize {
        self.indent + widths.iter().sum::<usize>() + GAP * widths.len().saturating_sub(1)
    }

    /// Takes from the columns whose headings are widest in comparison with their cells.
    fn break_headings(&self, widths: &mut [usize]) {
        let least: Vec<usize> = (0..widths.len()).map(|at| self.least(at)).collect();
        while WIDTH < self.total(widths) {
            let spare = |&at: &usize| widths[at] - least[at];
            let Some(widest) = (0..widths.len()).max_by_key(spare).filter(|at| 0 < spare(at))
            else {
                return;
            };
            widths[widest] -= 1;
        }
    }

    /// Breaks the last column if it is text, and then the first one.
    fn break_ends(&self, widths: &mut [usize]) {
        let last = widths.len().saturating_sub(1);
        let is_text = self.columns.last().is_some_and(|(_, align)| *align == Align::Left);
        let over = self.total(widths).saturating_sub(WIDTH);
        if 0 < over && 0 < last && is_text {
            widths[last] = widths[last].saturating_sub(over).max(LEAST_LAST.min(widths[last]));
        }
        let over = self.total(widths).saturating_sub(WIDTH);
        if 0 < over && 0 < last {
            let natural = widths[0];
            widths[0] = natural.saturating_sub(over).max(LEAST_FIRST.min(natural));
            // As wide as goes with as many columns side by side.
            let n_blocks = self.blocks(widths).len();
            let is_as_good = |&width: &usize| {
                let wider = [&[width], &widths[1..]].concat();
                self.blocks(&wider).len() == n_blocks && self.is_within(&wider)
            };
            widths[0] = (widths[0]..=natural).rev().find(is_as_good).unwrap_or(widths[0]);
        }
    }

    /// Whether all blocks fit.
    fn is_within(&self, widths: &[usize]) -> bool {
        self.blocks(widths).iter().all(|block| {
            let sum: usize = block.iter().map(|&at| widths[at]).sum();
            self.indent + sum + GAP * (block.len() - 1) <= WIDTH
        })
    }

    fn write_block(&self, block: &[usize], widths: &[usize], text: &mut String) {
        let headings = block.iter().map(|&at| self.columns[at].0.as_str());
        let mut lines: Vec<Vec<String>> =
            block.iter().zip(headings).map(|(&at, cell)| broken(cell, widths[at])).collect();
        // Headings stand directly over the cells.
        let height = lines.iter().map(Vec::len).max().unwrap_or(0);
        for lines in &mut lines {
            while lines.len() < height {
                lines.insert(0, String::new());
            }
        }
        self.write_lines(block, widths, &lines, text);
        for row in &self.rows {
            let lines: Vec<Vec<String>> =
                block.iter().map(|&at| broken(&row[at], widths[at])).collect();
            self.write_lines(block, widths, &lines, text);
        }
    }

    fn write_lines(
        &self,
        block: &[usize],
        widths: &[usize],
        cells: &[Vec<String>],
        text: &mut String,
    ) {
        let height = cells.iter().map(Vec::len).max().unwrap_or(0);
        for number in 0..height {
            let mut line = " ".repeat(self.indent);
            for (place, (&at, cell)) in block.iter().zip(cells).enumerate() {
                if 0 < place {
                    line.push_str(&" ".repeat(GAP));
                }
                let cell = cell.get(number).map_or("", String::as_str);
                let width = widths[at];
                let _ = match self.columns[at].1 {
                    Align::Left => write!(line, "{cell:<width$}"),
                    Align::Right => write!(line, "{cell:>width$}"),
                };
            }
            text.push_str(line.trim_end());
            text.push('\n');
        }
    }
}

fn length(text: &str) -> usize {
    text.chars().count()
}

/// A cell as lines of at most a width: broken at spaces but those before a percent sign, and within a word that is longer after a point
/// or underscore.
fn broken(cell: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    let mut rest = cell;
    while !rest.is_empty() {
        let ends = rest.match_indices(' ').map(|(at, _)| at);
        let end = ends.filter(|&at| !rest[at + 1..].starts_with('%')).find(|&at| 0 < at);
        let (word, after) = rest.split_at(end.unwrap_or(rest.len()));
        rest = after.strip_prefix(' ').unwrap_or(after);
        for piece in pieces(word, width) {
            let line = lines.last_mut().map_or(0, |line| length(line));
            match lines.last_mut() {
                Some(line) if line.is_empty() => line.push_str(piece),
                Some(text) if line + 1 + length(piece) <= width => {
                    text.push(' ');
                    text.push_str(piece);
                }
                _ => lines.push(piece.to_owned()),
            }
        }
    }
    lines
}

/// A word in pieces of at most a width, each but the last with a point or underscore at its end. One that has none stays whole.
fn pieces(word: &str, width: usize) -> Vec<&str> {
    let mut pieces = Vec::new();
    let mut rest = word;
    while width < length(rest) {
        let is_end = |&(_, letter): &(usize, char)| matches!(letter, '.' | '_');
        let Some((at, _)) = rest.char_indices().take(width).filter(is_end).last() else { break };
        let (first, after) = rest.split_at(at + 1);
        pieces.push(first);
        rest = after;
    }
    pieces.push(rest);
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(headings: &[&str], rows: &[&[&str]]) -> TextTable {
        let mut table = TextTable::new(headings.iter().copied());
        rows.iter().for_each(|row| table.row(row.iter().copied()));
        table
    }

    #[test]
    fn a_table_that_fits_is_aligned_by_characters() {
        let table = table(&["figure", "A", "B − A"], &[&["x", "1.25", "−3"]]);
        assert_eq!(table.text(), "figure     A  B − A\nx       1.25     −3\n");
        assert_eq!(table.indented(1).text(), " figure     A  B − A\n x       1.25     −3\n");
    }

    #[test]
    fn headings_are_broken_first() {
        let wide =
            "a heading that is far wider than a terminal, and than the cells that stand below it";
        let text = table(&["effect", wide, "n"], &[&["slip", "1", "2"]]).text();
        let lines: Vec<&str> = text.lines().collect();
        assert!(2 < lines.len() && lines.iter().all(|line| length(line) <= WIDTH), "{text}");
        assert!(lines.last().unwrap().starts_with("slip"), "{text}");
    }

    #[test]
    fn text_at_the_end_is_broken_and_columns_that_do_not_fit_stand_below() {
        let end = "many words ".repeat(9);
        let ended = table(&["effect", "n", "what"], &[&["slip", "1", end.trim()]]).text_in(2);
        let text = ended.text();
        assert!(text.lines().all(|line| length(line) <= WIDTH), "{text}");
        assert_eq!(text.matches("many").count(), 9);

        let names: Vec<String> = (0..9).map(|n| format!("metric_{n}_of_nine")).collect();
        let headings: Vec<&str> =
            std::iter::once("setting").chain(names.iter().map(String::as_str)).collect();
        let rows = ["a 1", "a 2"].map(|setting| {
            std::iter::once(setting).chain(std::iter::repeat_n("0.5", 9)).collect::<Vec<_>>()
        });
        let text = table(&headings, &[&rows[0], &rows[1]]).text();
        assert!(text.lines().all(|line| length(line) <= WIDTH), "{text}");
        assert!(names.iter().all(|name| text.contains(name.as_str())), "{text}");
        assert_eq!(text.matches("0.5").count(), 18);
        assert_eq!(text.matches("setting").count(), text.matches("a 1").count());
    }

    #[test]
    fn the_first_column_is_as_wide_as_goes_with_as_few_blocks() {
        let name = "propagation experimental-randomness, flock_radius_m 20.0";
        let figure = "task.speed_along_leader_mps";
        let text = table(&["setting", figure, figure], &[&[name, "1", "2"]]).text();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        assert!(lines.iter().all(|line| length(line) <= WIDTH), "{text}");
        assert!(lines[1].starts_with("propagation ") && lines[1].ends_with("  2"), "{text}");
    }

    #[test]
    fn long_names_are_broken_after_a_point_or_an_underscore() {
        assert_eq!(broken("task.leader_connected_ratio", 20), ["task.leader_", "connected_ratio"]);
        assert_eq!(broken("a bc def", 4), ["a bc", "def"]);
        assert_eq!(broken("indivisible", 3), ["indivisible"]);
        assert_eq!(broken("", 3), [""]);
        assert_eq!(broken("slip (97.5 %)", 9), ["slip", "(97.5 %)"]);
    }
}
