//! Names of nodes and robots, and the numbers that they get.

use crate::files::natural_order;
use std::collections::BTreeMap;

/// Names that were read. Until all are known, a name is the number of its first occurrence.
#[derive(Clone, Debug, Default)]
pub(crate) struct Labels {
    numbers: BTreeMap<String, u32>,
    names: Vec<String>,
    n_bytes: u64,
}

/// What a name takes in a list beside its text (bytes).
const BYTES_OF_NAME: u64 = 64;
/// Greatest number that may stay as it is.
const MOST_NUMBER: f64 = u32::MAX as f64 - 1.0;

impl Labels {
    /// How much memory they take (bytes).
    pub(crate) fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// The number of the occurrence of a name. `3` and `3.0` are one name.
    pub(crate) fn occurrence(&mut self, name: &str) -> u32 {
        let name = name.trim();
        if let Some(&number) = self.numbers.get(name) {
            return number;
        }
        let whole = whole(name).map(|number| number.to_string());
        let name = whole.unwrap_or_else(|| name.to_owned());
        if let Some(&number) = self.numbers.get(&name) {
            return number;
        }
        let number = self.names.len() as u32;
        self.n_bytes += 2 * (BYTES_OF_NAME + name.len() as u64);
        self.names.push(name.clone());
        self.numbers.insert(name, number);
        number
    }

    /// The number that each name gets, in the order of occurrence.
    ///
    /// Whole numbers stay as they are, unless names are stated or one of the names is no number. Then stated names get their number,
    /// and the others those that follow the greatest stated one, in natural order.
    pub(crate) fn numbers(&self, stated: &BTreeMap<String, u32>) -> Vec<u32> {
        let whole: Option<Vec<u32>> = self.names.iter().map(|name| whole(name)).collect();
        if let Some(whole) = whole.filter(|_| stated.is_empty()) {
            return whole;
        }
        let mut others: Vec<&str> = self.names.iter().map(String::as_str).collect();
        others.retain(|name| !stated.contains_key(*name));
        others.sort_by(|a, b| natural_order(a, b));
        let first = stated.values().max().map_or(0, |greatest| greatest + 1);
        let others: BTreeMap<&str, u32> = others.into_iter().zip(first..).collect();
        self.names
            .iter()
            .map(|name| stated.get(name).or_else(|| others.get(&**name)).copied().unwrap_or(0))
            .collect()
    }

    /// The names with their numbers, by number; empty where all names are the numbers themselves.
    pub(crate) fn named(&self, numbers: &[u32]) -> Vec<(String, u32)> {
        let mut named: Vec<(String, u32)> =
            self.names.iter().cloned().zip(numbers.iter().copied()).collect();
        named.sort_by_key(|(_, number)| *number);
        if named.iter().all(|(name, number)| *name == number.to_string()) {
            named.clear();
        }
        named
    }
}

/// The number that a name is.
fn whole(name: &str) -> Option<u32> {
    let number = name.parse::<f64>().ok()?;
    (number.fract() == 0.0 && (0.0..=MOST_NUMBER).contains(&number)).then_some(number as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(names: &[&str], stated: &[(&str, u32)]) -> Vec<u32> {
        let mut labels = Labels::default();
        names.iter().for_each(|name| {
            labels.occurrence(name);
        });
        labels.numbers(&stated.iter().map(|(name, number)| ((*name).to_owned(), *number)).collect())
    }

    #[test]
    fn whole_numbers_stay_and_names_are_numbered_in_natural_order() {
        assert_eq!(numbers(&["7", "3.0", "3"], &[]), [7, 3]);
        assert_eq!(numbers(&["node10", "node2", "gateway"], &[]), [2, 1, 0]);
        assert_eq!(numbers(&["7", "gateway", "3"], &[]), [1, 2, 0]);
        assert_eq!(numbers(&["node2", "gateway", "node1"], &[("gateway", 4)]), [6, 4, 5]);
        assert_eq!(numbers(&["1", "2", "3"], &[("1", 0)]), [0, 1, 2]);
    }
}
