//! From what varies to settings: one experiment each, but for the seed.

use experiment::sweep::{self as spec, ParameterRange, Sampling, Sweep};
use numbers::format::rounded;
use proto::config::{Node, Value};
use proto::rng::{Draws, Purpose};

/// One setting of everything that varies.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Setting {
    /// Its case, if there are cases.
    pub(crate) case: Option<String>,
    /// Key and value of what varies: those of the case first.
    pub(crate) values: Vec<(String, Node)>,
    /// How many of them are the case's, which its name stands for.
    pub(crate) n_of_case: usize,
}

impl Setting {
    /// The value of a key.
    pub(crate) fn get(&self, key: &str) -> Option<&Node> {
        self.values.iter().find(|(known, _)| known == key).map(|(_, value)| value)
    }

    /// What it is, for people.
    pub(crate) fn describe(&self) -> String {
        let case = self.case.iter().cloned();
        let values = self.values.iter().skip(self.n_of_case).map(|(key, value)| {
            let key = key.rsplit('.').next().unwrap_or(key);
            match (&value.value, kinds(value)) {
                (Value::Text(text), _) => format!("{key} {text}"),
                (_, Some(kinds)) => format!("{key} {kinds}"),
                _ => format!("{key} {}", value.show()),
            }
        });
        let words: Vec<String> = case.chain(values).collect();
        if words.is_empty() { "as the file says".to_owned() } else { words.join(", ") }
    }
}

/// The kinds of the tables that a list holds; `None`: it is no such list.
fn kinds(value: &Node) -> Option<String> {
    let Value::List(tables) = &value.value else { return None };
    let kind = |table: &Node| match &table.get("kind")?.value {
        Value::Text(kind) => Some(kind.clone()),
        _ => None,
    };
    let kinds: Vec<String> = tables.iter().map(kind).collect::<Option<_>>()?;
    (!kinds.is_empty()).then(|| kinds.join(" + "))
}

/// How many settings there are; `None`: more than can be counted.
pub(crate) fn n_settings(sweep: &Sweep) -> Option<u64> {
    let lengths = sweep.lists.iter().map(|(_, values)| values.len());
    lengths
        .chain([sweep.cases.len().max(1), sweep.samples])
        .try_fold(1u64, |product, n| product.checked_mul(n as u64))
}

/// Most points of a Sobol sequence, and most ranges that it has dimensions for.
pub(crate) const SOBOL: (usize, usize) = (1 << 16, sobol_burley::NUM_DIMENSIONS as usize);

/// All settings: cases in order, in each all combinations of the lists, the last list varying fastest, and for each of those
/// all samples. `seed` is that of the experiment.
pub(crate) fn settings(sweep: &Sweep, seed: u64) -> Vec<Setting> {
    let mut settings: Vec<Setting> = if sweep.cases.is_empty() {
        vec![Setting { case: None, values: Vec::new(), n_of_case: 0 }]
    } else {
        let of_case = |case: &spec::Case| Setting {
            case: Some(case.name.clone()),
            values: case.values.clone(),
            n_of_case: case.values.len(),
        };
        sweep.cases.iter().map(of_case).collect()
    };
    for (key, values) in &sweep.lists {
        settings = settings
            .iter()
            .flat_map(|setting| {
                values.iter().map(|value| {
                    let mut setting = setting.clone();
                    setting.values.push((key.clone(), value.clone()));
                    setting
                })
            })
            .collect();
    }
    if sweep.ranges.is_empty() {
        return settings;
    }
    let points = points(sweep.sampling, sweep.samples, sweep.ranges.len(), seed);
    settings
        .iter()
        .flat_map(|setting| {
            points.iter().map(|point| {
                let mut setting = setting.clone();
                for ((key, range), &share) in sweep.ranges.iter().zip(point) {
                    let value = Node { value: value_at(range, share), span: range.span.clone() };
                    setting.values.push((key.clone(), value));
                }
                setting
            })
        })
        .collect()
}

/// Points in the unit cube, one number per range.
pub(crate) fn points(sampling: Sampling, n: usize, n_ranges: usize, seed: u64) -> Vec<Vec<f64>> {
    let draws = Draws::new(seed, Purpose::Sweep);
    match sampling {
        Sampling::Sobol => {
            let scramble = draws.words(0, 0, 0)[0] as u32;
            let point = |sample| {
                let number = |range| f64::from(sobol_burley::sample(sample, range, scramble));
                (0..n_ranges as u32).map(number).collect()
            };
            (0..n as u32).map(point).collect()
        }
        Sampling::LatinHypercube => {
            let slices: Vec<Vec<u64>> = (0..n_ranges as u64)
                .map(|range| {
                    let mut slices: Vec<u64> = (0..n as u64).collect();
                    slices.sort_by_key(|&slice| (draws.words(range, slice, 1)[0], slice));
                    slices
                })
                .collect();
            let point = |sample: usize| {
                let number = |range: usize| {
                    let within = draws.uniform(range as u64, sample as u64, 2);
                    (slices[range][sample] as f64 + within) / n as f64
                };
                (0..n_ranges).map(number).collect()
            };
            (0..n).map(point).collect()
        }
    }
}

/// The value at a share of the range, 0 to 1 excluded; six significant digits, so that it can be written down.
fn value_at(range: &ParameterRange, share: f64) -> Value {
    let max = if range.is_whole { range.max + 1.0 } else { range.max };
    let value = if range.is_log {
        let (low, high) = (libm::log(range.min), libm::log(max));
        libm::exp(low + share * (high - low))
    } else {
        range.min + share * (max - range.min)
    };
    if range.is_whole {
        return Value::Integer(libm::floor(value).clamp(range.min, range.max) as i64);
    }
    Value::Number(rounded(value, 6).clamp(range.min, range.max))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expand(text: &str) -> (Vec<String>, Vec<String>) {
        let mut problems = Vec::new();
        let sweep = spec::read(&proto::config::parse(text).unwrap(), &mut problems);
        let settings = settings(&sweep, 1).iter().map(Setting::describe).collect();
        (settings, problems.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn every_case_meets_every_combination() {
        let (settings, problems) = expand(
            "[[case]]\nname = \"near\"\na.r = 1\n[[case]]\nname = \"far\"\na.r = 9\n[vary]\nb.k = [\"x\", \"y\"]\n\"c.n\" = [1, 2]",
        );
        assert!(problems.is_empty(), "{problems:?}");
        assert_eq!(settings.len(), 8);
        assert_eq!(settings[..3], ["near, k x, n 1", "near, k x, n 2", "near, k y, n 1"]);
        assert_eq!(settings[7], "far, k y, n 2");
        // Lists of tables are identified by what they contain.
        let (settings, _) =
            expand("[vary]\na.effect = [[{ kind = \"x\" }, { kind = \"y\", g = 1 }], []]");
        assert_eq!(settings, ["effect x + y", "effect []"]);
    }

    #[test]
    fn a_latin_hypercube_has_one_sample_in_each_slice() {
        for n in [1, 2, 7, 50] {
            let points = points(Sampling::LatinHypercube, n, 3, 5);
            for range in 0..3 {
                let mut slices: Vec<usize> =
                    points.iter().map(|point| (point[range] * n as f64) as usize).collect();
                slices.sort_unstable();
                assert_eq!(slices, (0..n).collect::<Vec<_>>());
            }
        }
        let of_seed = |seed| points(Sampling::LatinHypercube, 7, 3, seed);
        assert!(of_seed(5) == of_seed(5) && of_seed(5) != of_seed(6));
    }

    #[test]
    fn a_sobol_sequence_is_even_in_each_pair_of_ranges_and_goes_on() {
        // The first two dimensions are a (0, 2)-sequence: of 64 points each of 8 x 8 boxes has one, under any scrambling.
        let points_64 = points(Sampling::Sobol, 64, 2, 3);
        let mut boxes: Vec<(usize, usize)> = points_64
            .iter()
            .map(|point| ((point[0] * 8.0) as usize, (point[1] * 8.0) as usize))
            .collect();
        boxes.sort_unstable();
        boxes.dedup();
        assert_eq!(boxes.len(), 64);
        assert_eq!(points(Sampling::Sobol, 100, 2, 3)[..64], points_64);
        assert_ne!(points(Sampling::Sobol, 64, 2, 4), points_64);
    }

    #[test]
    fn ranges_are_met_from_end_to_end_and_never_left() {
        let number_at = |min, max, is_log, is_whole, share: f64| match value_at(
            &ParameterRange { span: None, min, max, is_log, is_whole },
            share,
        ) {
            Value::Number(value) => value,
            Value::Integer(value) => value as f64,
            other => panic!("{other:?}"),
        };
        let is = |got: f64, wanted: f64| assert!((got - wanted).abs() < 1e-5 * wanted, "{got}");
        let last = 1.0 - f64::EPSILON / 2.0;
        is(number_at(1.0, 100.0, true, false, 0.5), 10.0);
        is(number_at(2.0, 4.0, false, false, 0.25), 2.5);
        // Three whole numbers share the range evenly.
        for (share, wanted) in [(0.0, 5.0), (0.33, 5.0), (0.34, 6.0), (0.67, 7.0), (last, 7.0)] {
            is(number_at(5.0, 7.0, false, true, share), wanted);
        }
        assert!(number_at(0.1, 0.3, true, false, last) <= 0.3);
        assert!(0.1 <= number_at(0.1, 0.3, true, false, 0.0));
    }
}
