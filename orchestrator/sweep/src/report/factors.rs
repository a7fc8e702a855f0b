//! What varies in a sweep, and how pictures show it: one factor along the axis, the others as rows and columns of panels.

use super::names::{Catalogue, Name};
use crate::plan::SweepPlan;
use numbers::format::{number, shortest};
use numbers::statistics::{correlation, mean, range};
use proto::config::{Node, Value};

/// Something that varies: the case, or a key.
pub(super) struct Factor {
    /// How people call it.
    pub(super) name: Name,
    /// Its key; `None`: the case.
    pub(super) key: Option<String>,
    /// Its values in words, in the order of the sweep.
    pub(super) levels: Vec<String>,
    /// Which of them each setting has.
    pub(super) level_of: Vec<usize>,
    /// Its value in each setting, if all values are numbers.
    pub(super) numbers: Option<Vec<f64>>,
    /// It is sampled from a range.
    pub(super) is_range: bool,
    /// Its numbers are sampled by their ratios, or reach over more than [`MOST_RATIO`].
    pub(super) is_log: bool,
}

/// Numbers above 0 whose greatest is more than this many times the least are shown by their ratios.
const MOST_RATIO: f64 = 20.0;

/// All that varies, cases first.
pub(super) fn factors(plan: &SweepPlan, catalogue: &Catalogue) -> Vec<Factor> {
    let sweep = &plan.sweep;
    let config: toml::Table = toml::from_str(&plan.written).unwrap_or_default();
    let mut factors = Vec::new();
    if 1 < sweep.cases.len() {
        let name =
            Name { words: "case".to_owned(), unit: None, is_share: false, explanation: None };
        let cases = plan.settings.iter().map(|setting| setting.case.clone().unwrap_or_default());
        factors.push(Factor::new(name, None, cases.collect(), None, false));
    }
    let lists = sweep.lists.iter().filter(|(_, values)| 1 < values.len()).map(|(key, _)| key);
    let ranges = sweep.ranges.iter().map(|(key, _)| key);
    let keys = lists.map(|key| (key, false)).chain(ranges.map(|key| (key, true)));
    for (key, is_range) in keys {
        let values: Vec<Option<&Node>> =
            plan.settings.iter().map(|setting| setting.get(key)).collect();
        let numbers = values.iter().map(|value| as_number(&(*value)?.value)).collect();
        let words = values.into_iter().map(|value| {
            match value.map(|node| (node, as_number(&node.value))) {
                None => String::new(),
                // Samples have more digits than anybody reads.
                Some((_, Some(sample))) if is_range => number(sample),
                Some((node, _)) => in_words(node),
            }
        });
        let name = catalogue.key(key, &config);
        let mut factor = Factor::new(name, Some(key.clone()), words.collect(), numbers, is_range);
        factor.is_log |= sweep.ranges.iter().any(|(own, range)| own == key && range.is_log);
        factors.push(factor);
    }
    tell_apart(&mut factors);
    factors
}

/// Two keys of the same words get those of the table that they are in.
fn tell_apart(factors: &mut [Factor]) {
    let words: Vec<String> = factors.iter().map(|factor| factor.name.words.clone()).collect();
    for factor in factors.iter_mut() {
        let n_alike = words.iter().filter(|other| **other == factor.name.words).count();
        let table = factor.key.as_ref().and_then(|key| key.rsplit('.').nth(1));
        if let Some(table) = table.filter(|_| 1 < n_alike) {
            factor.name.words = format!("{} of {table}", factor.name.words);
        }
    }
}

fn as_number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(n) => Some(*n as f64),
        Value::Number(number) => Some(*number),
        _ => None,
    }
}

/// A value in words: of a list of tables their kinds.
fn in_words(node: &Node) -> String {
    if let Some(number) = as_number(&node.value) {
        return shortest(number);
    }
    let kind = |table: &Node| match &table.get("kind")?.value {
        Value::Text(kind) => Some(kind.clone()),
        _ => None,
    };
    match &node.value {
        Value::Text(text) => text.clone(),
        Value::List(entries) if !entries.is_empty() => {
            let kinds: Option<Vec<String>> = entries.iter().map(kind).collect();
            kinds.map_or_else(|| node.show().into_owned(), |kinds| kinds.join(" + "))
        }
        _ => kind(node).unwrap_or_else(|| node.show().into_owned()),
    }
}

impl Factor {
    /// `words`, `numbers`: its value in each setting.
    fn new(
        name: Name,
        key: Option<String>,
        words: Vec<String>,
        numbers: Option<Vec<f64>>,
        is_range: bool,
    ) -> Self {
        let mut levels: Vec<String> = Vec::new();
        let level_of = words.into_iter().map(|word| {
            levels.iter().position(|level| *level == word).unwrap_or_else(|| {
                levels.push(word);
                levels.len() - 1
            })
        });
        let level_of = level_of.collect();
        let [low, high] = range(numbers.iter().flatten().copied());
        let is_log = !is_range && 0.0 < low && MOST_RATIO * low < high;
        Self { name, key, levels, level_of, numbers, is_range, is_log }
    }

    /// A level in words, with what it is a level of.
    pub(super) fn level(&self, level: usize) -> String {
        let value = &self.levels[level];
        match (&self.key, self.name.unit) {
            (None, _) => value.clone(),
            (Some(_), Some(unit)) => format!("{} {value} {unit}", self.name.words),
            (Some(_), None) if self.numbers.is_some() => format!("{} {value}", self.name.words),
            (Some(_), None) => format!("{}: {value}", self.name.words),
        }
    }

    /// Which share of the variance of a figure over the settings this factor explains by itself, 0 to 1: of a range the squared
    /// rank correlation, else the variance of the means of its levels. `values`: the figure in each setting, where it has one.
    pub(super) fn explains(&self, values: &[Option<f64>]) -> Option<f64> {
        let known: Vec<(usize, f64)> =
            (0..).zip(values).filter_map(|(setting, value)| Some((setting, (*value)?))).collect();
        let all = known.iter().map(|(_, value)| *value);
        let middle = mean(all.clone());
        let total: f64 = all.map(|value| (value - middle) * (value - middle)).sum();
        if total <= 0.0 || known.len() < 3 {
            return None;
        }
        if self.is_range {
            let numbers = self.numbers.as_ref()?;
            let x: Vec<f64> = known.iter().map(|&(setting, _)| numbers[setting]).collect();
            let y: Vec<f64> = known.iter().map(|&(_, value)| value).collect();
            let r = correlation(&ranks(&x), &ranks(&y))?;
            return Some(r * r);
        }
        let between = (0..self.levels.len()).map(|level| {
            let of_level: Vec<f64> = known
                .iter()
                .filter(|&&(setting, _)| self.level_of[setting] == level)
                .map(|&(_, value)| value)
                .collect();
            let off = mean(of_level.iter().copied()) - middle;
            if of_level.is_empty() { 0.0 } else { of_level.len() as f64 * off * off }
        });
        Some(between.sum::<f64>() / total)
    }
}

/// The place of each value among all; equal ones have the mean of their places.
fn ranks(values: &[f64]) -> Vec<f64> {
    let place = |value: &f64| {
        let below = values.iter().filter(|other| *other < value).count();
        let equal = values.iter().filter(|other| *other == value).count();
        below as f64 + (equal as f64 - 1.0) / 2.0
    };
    values.iter().map(place).collect()
}

/// The settings of a panel, and what they have in common.
pub(super) struct Panel {
    /// What they have in common, in words; empty if there is but one panel.
    pub(super) name: String,
    /// Numbers of the settings.
    pub(super) settings: Vec<usize>,
}

/// How the pictures of a figure show what varies: one of them for each such view.
pub(super) struct View {
    /// Number of the factor along the axis; `None`: the settings side by side.
    pub(super) x: Option<usize>,
    /// Row after row.
    pub(super) panels: Vec<Panel>,
    /// Panels in a row; `None`: as many as fit.
    pub(super) n_columns: Option<usize>,
}

/// More panels than this are too small to read.
const MOST_PANELS: usize = 48;
/// Most panels side by side.
const MOST_COLUMNS: usize = 4;

/// One view for each range; without a range, one along the list with most values.
pub(super) fn views(factors: &[Factor], n_settings: usize) -> Vec<View> {
    let ranges: Vec<usize> =
        (0..factors.len()).filter(|&factor| factors[factor].is_range).collect();
    let x = if ranges.is_empty() {
        // Numbers before words, then what has most values; of equals a key, and the first.
        let rank =
            |factor: &Factor| (factor.numbers.is_some(), factor.levels.len(), factor.key.is_some());
        let best = (0..factors.len()).rev().max_by_key(|&factor| rank(&factors[factor]));
        best.into_iter().collect()
    } else {
        ranges
    };
    let views: Vec<View> = x.into_iter().filter_map(|x| view(factors, n_settings, x)).collect();
    if views.is_empty() { vec![side_by_side(n_settings)] } else { views }
}

/// All settings in one panel.
fn side_by_side(n_settings: usize) -> View {
    let settings = (0..n_settings).collect();
    View { x: None, panels: vec![Panel { name: String::new(), settings }], n_columns: None }
}

/// The view along a factor; `None`: it has too many panels.
fn view(factors: &[Factor], n_settings: usize, x: usize) -> Option<View> {
    let mut others: Vec<&Factor> = (0..factors.len())
        .filter(|&factor| factor != x && !factors[factor].is_range)
        .map(|factor| &factors[factor])
        .collect();
    let n_panels = others.iter().try_fold(1, |n: usize, factor| n.checked_mul(factor.levels.len()));
    if n_panels.is_none_or(|n| MOST_PANELS < n) {
        return None;
    }
    // The last of them varies fastest, so that it stands in columns: the one with fewest levels.
    others.sort_by_key(|factor| std::cmp::Reverse(factor.levels.len()));
    let columns = others.last().map_or(1, |factor| factor.levels.len());
    let n_columns = (1 < others.len() && columns <= MOST_COLUMNS).then_some(columns);
    let mut panels = vec![Panel { name: String::new(), settings: (0..n_settings).collect() }];
    for factor in others {
        panels = panels
            .iter()
            .flat_map(|panel| {
                (0..factor.levels.len()).map(move |level| {
                    let separator = if panel.name.is_empty() { "" } else { " · " };
                    let settings = panel.settings.iter().copied();
                    Panel {
                        name: format!("{}{separator}{}", panel.name, factor.level(level)),
                        settings: settings
                            .filter(|&setting| factor.level_of[setting] == level)
                            .collect(),
                    }
                })
            })
            .collect();
    }
    Some(View { x: Some(x), panels, n_columns })
}

/// A setting in words.
pub(super) fn describe(factors: &[Factor], setting: usize) -> String {
    let words: Vec<String> =
        factors.iter().map(|factor| factor.level(factor.level_of[setting])).collect();
    if words.is_empty() { "as the file says".to_owned() } else { words.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor(words: &str, of_setting: &[&str], is_number: bool) -> Factor {
        let name = Name { words: words.to_owned(), unit: None, is_share: false, explanation: None };
        let numbers = of_setting.iter().map(|word| word.parse().ok()).collect();
        let words = of_setting.iter().map(|word| (*word).to_owned()).collect();
        let numbers = if is_number { numbers } else { None };
        Factor::new(name, Some("a.b".to_owned()), words, numbers, false)
    }

    #[test]
    fn one_factor_is_the_axis_and_the_others_are_panels() {
        let radius = factor("radius", &["1", "2", "3", "1", "2", "3"], true);
        let radio = factor("radio", &["good", "good", "good", "bad", "bad", "bad"], false);
        let factors = [radio, radius];
        let view = &views(&factors, 6)[0];
        assert_eq!((view.x, view.n_columns), (Some(1), None));
        let panels: Vec<_> =
            view.panels.iter().map(|panel| (panel.name.as_str(), panel.settings.clone())).collect();
        assert_eq!(panels, [("radio: good", vec![0, 1, 2]), ("radio: bad", vec![3, 4, 5])]);
        assert_eq!(describe(&factors, 4), "radio: bad, radius 2");
    }

    #[test]
    fn a_factor_explains_the_variance_of_the_means_of_its_levels() {
        let a = factor("a", &["1", "1", "2", "2"], true);
        let b = factor("b", &["1", "2", "1", "2"], true);
        // 0, 1, 4, 5: a adds 4, b adds 1. Variances 4 and 0.25 of 4.25.
        let values = [0.0, 1.0, 4.0, 5.0].map(Some);
        assert!((a.explains(&values).unwrap() - 4.0 / 4.25).abs() < 1e-12);
        assert!((b.explains(&values).unwrap() - 0.25 / 4.25).abs() < 1e-12);
        assert_eq!(a.explains(&[Some(1.0); 4]), None);
    }

    #[test]
    fn equal_values_share_their_ranks() {
        assert_eq!(ranks(&[2.0, 1.0, 2.0]), [1.5, 0.0, 1.5]);
        assert_eq!(correlation(&[1.0, 2.0], &[4.0, 2.0]), Some(-1.0));
        assert_eq!(correlation(&[1.0, 1.0], &[4.0, 2.0]), None);
    }
}
