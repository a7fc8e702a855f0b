//! The description of a section.

use super::{Lists, Program, is_same_text};

/// A table: its own keys, and those that depend on one of them.
#[derive(Clone, Copy, Debug)]
pub struct TableSpec {
    /// What the table is about, one sentence.
    pub doc: &'static str,
    /// Keys that are always there.
    pub fields: &'static [Field],
    /// A key whose value decides which further keys there are.
    pub tag: Option<&'static Tag>,
}

impl TableSpec {
    /// The key of this name, for another table that has it too.
    ///
    /// # Panics
    ///
    /// If the table lacks it: in a constant, the program does not compile.
    #[must_use]
    pub const fn field(&self, key: &str) -> Field {
        let mut place = 0;
        while !is_same_text(self.fields[place].key, key) {
            place += 1;
        }
        self.fields[place]
    }
}

/// A key that selects a variant: `propagation = "friis"`, `kind = "shadowing"`.
#[derive(Clone, Copy, Debug)]
pub struct Tag {
    /// The key.
    pub key: &'static str,
    /// What it selects, one sentence.
    pub doc: &'static str,
    /// What is selected if the key is absent. `None`: the key is required.
    pub default: Option<&'static str>,
    /// What can be selected.
    pub variants: Variants,
}

/// The values of a tag.
#[derive(Clone, Copy, Debug)]
pub enum Variants {
    /// These and no others.
    Fixed(&'static [Variant]),
    /// Those of the list of this name, which is passed beside the description: [`Lists`].
    List(&'static str),
}

impl Tag {
    /// What can be selected.
    ///
    /// # Panics
    ///
    /// If the tag names a list that `lists` lacks: whoever passed `lists` left one out.
    #[must_use]
    pub fn variants<'a>(&self, lists: &'a Lists) -> &'a [Variant] {
        match self.variants {
            Variants::Fixed(variants) => variants,
            Variants::List(name) => lists.get(name),
        }
    }
}

/// One value of a tag, and the keys that go with it.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    /// The tag's value.
    pub name: &'static str,
    /// What it is, one sentence.
    pub doc: &'static str,
    /// Keys that exist with this value only.
    pub fields: &'static [Field],
}

/// A key.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// The key, with its unit as suffix.
    pub key: &'static str,
    /// What it means, one sentence, with the source of the default where there is one.
    pub doc: &'static str,
    /// What it may be.
    pub kind: Kind,
    /// What it is when absent.
    pub default: Default,
}

/// What a key is when absent.
#[derive(Clone, Copy, Debug)]
pub enum Default {
    /// Its absence is a problem, and something valid stands in its place.
    Required,
    /// Its absence is a problem, and it then has no value: whoever reads it gets `None`.
    RequiredOrNone,
    /// It has no value, and the effective configuration does not mention it.
    Absent,
    /// A truth value.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number.
    Number(f64),
    /// A text or a choice.
    Text(&'static str),
    /// A table with all its keys at their defaults.
    Table,
}

/// What a key may be.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// `true` or `false`.
    Bool,
    /// A whole number from `min` to `max`.
    Integer {
        /// Least.
        min: i64,
        /// Greatest.
        max: i64,
    },
    /// A finite number within a range. A whole number will do.
    Number(Range),
    /// Any text but the empty one.
    Text,
    /// The path of a file, relative to the configuration.
    File,
    /// A program and its arguments, as a list of texts.
    Program,
    /// A URL.
    Url,
    /// A line of a job script, or an option of a batch system.
    ClusterLine,
    /// One of several texts.
    Choice(&'static [Choice]),
    /// A list with between `min` and `max` entries.
    List {
        /// What each entry may be.
        of: &'static Kind,
        /// Fewest entries.
        min: usize,
        /// Most entries.
        max: usize,
    },
    /// A table.
    Table(&'static TableSpec),
    /// Any number of tables, `[[...]]`.
    Tables(&'static TableSpec),
    /// The first of several that fits by type.
    Either(&'static [Kind]),
    /// Anything at all, passed on unread.
    Anything,
}

/// A text that may be chosen.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// The text.
    pub name: &'static str,
    /// What it means.
    pub doc: &'static str,
}

/// A range of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// The lower bound itself is excluded.
    pub above_min: bool,
}

impl Range {
    /// Any finite number.
    pub const ANY: Self = Self::closed(f64::NEG_INFINITY, f64::INFINITY);
    /// Greater than 0.
    pub const POSITIVE: Self = Self::above(0.0, f64::INFINITY);
    /// 0 or greater.
    pub const NOT_NEGATIVE: Self = Self::closed(0.0, f64::INFINITY);
    /// A coordinate in space (m).
    pub const PLACE: Self = Self::closed(-1e7, 1e7);
    /// A length or a height in space (m).
    pub const LENGTH: Self = Self::above(0.0, 1e7);
    /// 0 to 1.
    pub const FRACTION: Self = Self::closed(0.0, 1.0);

    /// From `min` to `max`, both included.
    #[must_use]
    pub const fn closed(min: f64, max: f64) -> Self {
        Self { min, max, above_min: false }
    }

    /// From `min`, excluded, to `max`, included.
    #[must_use]
    pub const fn above(min: f64, max: f64) -> Self {
        Self { min, max, above_min: true }
    }

    /// Whether a number lies within.
    #[must_use]
    pub fn contains(&self, number: f64) -> bool {
        number.is_finite()
            && number <= self.max
            && if self.above_min { self.min < number } else { self.min <= number }
    }

    /// The number within that is nearest to one outside, or of the same size with the other sign, if there is one.
    #[must_use]
    pub fn nearest(&self, number: f64) -> Option<f64> {
        if number.is_nan() {
            None
        } else if self.contains(number.clamp(self.min, self.max)) {
            Some(number.clamp(self.min, self.max))
        } else {
            Some(-number).filter(|&mirrored| self.contains(mirrored))
        }
    }

    /// `greater than 0`, `from 1.5 to 6`, …
    #[must_use]
    pub fn describe(&self) -> String {
        let low = if self.above_min { "greater than" } else { "at least" };
        match (self.min.is_finite(), self.max.is_finite()) {
            (false, false) => "a finite number".to_owned(),
            (true, false) => format!("{low} {}", self.min),
            (false, true) => format!("at most {}", self.max),
            (true, true) if self.above_min => {
                format!("greater than {} and at most {}", self.min, self.max)
            }
            (true, true) => format!("from {} to {}", self.min, self.max),
        }
    }
}

impl Kind {
    /// `a whole number`, `a list`, … for messages about a wrong type.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            Self::Bool => "true or false".to_owned(),
            Self::Integer { min, max } => match (*min, *max) {
                (min, i64::MAX) => format!("a whole number, at least {min}"),
                (min, max) => format!("a whole number from {min} to {max}"),
            },
            Self::Number(range) if *range == Range::ANY => "a number".to_owned(),
            Self::Number(range) => format!("a number, {}", range.describe()),
            Self::Text | Self::Url | Self::ClusterLine => "a text in quotes".to_owned(),
            Self::Program => Program::WORDS.describe(),
            Self::File => "the path of a file, in quotes".to_owned(),
            Self::Choice(choices) => {
                let names: Vec<String> = choices.iter().map(|c| format!("{:?}", c.name)).collect();
                format!("one of {}", names.join(", "))
            }
            Self::List { of, min, max } if min == max => {
                format!("a list of {min}, each {}", of.describe())
            }
            Self::List { of, .. } => format!("a list, each entry {}", of.describe()),
            Self::Table(_) => "a table".to_owned(),
            Self::Tables(_) => "an array of tables ([[...]])".to_owned(),
            Self::Either(kinds) => {
                kinds.iter().map(Self::describe).collect::<Vec<_>>().join(", or ")
            }
            Self::Anything => "any value".to_owned(),
        }
    }
}
