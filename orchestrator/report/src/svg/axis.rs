//! An axis of a chart: its scale, its ticks and their labels.

use super::Px;
use numbers::format::shortest;
use numbers::ticks;

/// An axis: what it shows, from where to where.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    /// What it shows, with the unit.
    pub label: String,
    /// Value at the lower end of the axis, in its unit.
    pub min: f64,
    /// Upper end, greater than `min`.
    pub max: f64,
    /// Ticks are in per cent.
    pub(super) is_percent: bool,
    /// Equal distances are equal ratios.
    pub(super) is_log: bool,
    /// Least distance of ticks.
    least_step: f64,
    /// Words at 0, 1, 2, … in place of numbers.
    pub(super) names: Vec<String>,
    /// Numbers that have ticks in place of round ones.
    marked: Vec<f64>,
}

impl Axis {
    /// An axis from `min` to `max`, or further where these are too close to be told apart.
    pub fn new(label: &str, min: f64, max: f64) -> Self {
        // Ends that no label could tell apart.
        let least = 1e-9 * min.abs().max(max.abs());
        let max = if least < max - min { max } else { min + min.abs().max(1.0) };
        Self { label: label.to_owned(), min, max, ..Self::default() }
    }

    /// The same with ticks in per cent.
    pub fn percent(mut self) -> Self {
        self.is_percent = true;
        self
    }

    /// The same with ticks at whole numbers only.
    pub fn integer_ticks(mut self) -> Self {
        self.least_step = 1.0;
        self
    }

    /// The same with equal distances for equal ratios, if both ends are greater than 0.
    pub fn log(mut self) -> Self {
        self.is_log = 0.0 < self.min;
        self
    }

    /// The same with words at 0, 1, 2, … in place of numbers.
    pub fn named(mut self, names: &[String]) -> Self {
        self.names = names.to_vec();
        self
    }

    /// The same with ticks at these numbers, as far as there is room for them.
    pub fn ticks_at(mut self, numbers: &[f64]) -> Self {
        self.marked = numbers.to_vec();
        self.marked.sort_by(f64::total_cmp);
        self.marked.dedup();
        self
    }

    /// Distance between ticks if there are to be about `n`.
    fn step(&self, n: f64) -> f64 {
        ticks::round_step(((self.max - self.min) / n).max(self.least_step))
    }

    /// Round numbers along the axis, about `n` of them.
    pub(super) fn ticks(&self, n: f64) -> Vec<f64> {
        if !self.names.is_empty() {
            return (0..self.names.len()).map(|name| name as f64).collect();
        }
        if !self.marked.is_empty() {
            return self.marked.clone();
        }
        if self.is_log {
            let digits: [&[f64]; 2] = [&[1.0, 2.0, 5.0], &[1.0]];
            let decades = digits.map(|digits| ticks::decades(self.min, self.max, digits));
            let fits = |ticks: &&Vec<f64>| 2 <= ticks.len() && ticks.len() as f64 <= 1.5 * n;
            if let Some(ticks) = decades.iter().find(fits) {
                return ticks.clone();
            }
            let every = (decades[1].len() as f64 / n).ceil().max(1.0) as usize;
            if 1 < decades[1].len() {
                return decades[1].iter().copied().step_by(every).collect();
            }
        }
        ticks::ticks(self.min, self.max, self.step(n))
    }

    /// Which share of the axis lies below a value.
    pub(super) fn share(&self, value: f64) -> f64 {
        if self.is_log {
            return libm::log(value / self.min) / libm::log(self.max / self.min);
        }
        (value - self.min) / (self.max - self.min)
    }

    /// The words at whole numbers in lines, where each number has so many pixels.
    pub(super) fn wrapped_names(&self, slot: f64) -> Vec<Vec<String>> {
        let most = ((slot - 6.0) / LETTER).max(3.0) as usize;
        self.names.iter().map(|name| wrapped(name, most)).collect()
    }

    pub(super) fn tick_label(&self, tick: f64, step: f64) -> String {
        if let Some(name) = self.names.get(tick.max(0.0) as usize) {
            return name.clone();
        }
        if self.is_percent {
            return format!("{} %", ticks::tick_label(100.0 * tick, 100.0 * step));
        }
        if !self.marked.is_empty() || self.is_log {
            return shortest(tick);
        }
        ticks::tick_label(tick, step)
    }

    /// About `n` ticks, each with a label that differs from those of its neighbours.
    pub(super) fn labelled_ticks(&self, n: f64) -> Vec<(f64, String)> {
        let (ticks, mut step) = (self.ticks(n), self.step(n));
        let mut labels: Vec<String> = Vec::new();
        for _ in 0..MOST_DIGITS {
            labels = ticks.iter().map(|&tick| self.tick_label(tick, step)).collect();
            if labels.windows(2).all(|pair| pair[0] != pair[1]) {
                break;
            }
            step /= 10.0;
        }
        if !self.marked.is_empty() && labels.windows(2).any(|pair| pair[0] == pair[1]) {
            labels = ticks.iter().map(f64::to_string).collect();
        }
        ticks.into_iter().zip(labels).collect()
    }
}

/// How many ticks an axis of this height (pixels) has room for.
pub(super) fn n_ticks_y(height: f64) -> f64 {
    (height / 45.0).max(2.0)
}

/// About how long a text of the size of ticks and labels is.
pub(super) fn text_width(text: &str) -> f64 {
    LETTER * text.chars().count() as f64
}

/// The length that a label is drawn with, if it is else longer than the picture is wide.
pub(super) fn fitted(label: &str, width: f64) -> Option<Px> {
    (width - 4.0 < text_width(label)).then_some(Px(width - 4.0))
}

/// A name in lines of at most `most` letters, broken at spaces and hyphens, and within words only where nothing else helps.
pub(super) fn wrapped(name: &str, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    for word in name.split_inclusive([' ', '-']) {
        let letters: Vec<char> = word.chars().collect();
        for piece in letters.chunks(most) {
            let piece: String = piece.iter().collect();
            match lines.last_mut() {
                Some(line) if line.chars().count() + piece.trim_end().chars().count() <= most => {
                    line.push_str(&piece);
                }
                _ => lines.push(piece),
            }
        }
    }
    lines.retain(|line| !line.trim().is_empty());
    lines.iter().map(|line| line.trim_end().to_owned()).collect()
}

/// About the width of a letter of a tick or a label (pixels).
const LETTER: f64 = 7.0;
/// Most digits by which labels are told apart: those of a number.
const MOST_DIGITS: usize = 17;
