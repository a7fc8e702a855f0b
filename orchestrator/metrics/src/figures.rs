//! Figures by name, as summaries have them.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A figure: a truth value, a count or a number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FigureValue {
    /// A truth value.
    Flag(bool),
    /// A count.
    Count(u64),
    /// A number.
    Number(f64),
}

impl FigureValue {
    /// The number or count, unless it is a truth value.
    #[must_use]
    pub fn number(self) -> Option<f64> {
        match self {
            Self::Flag(_) => None,
            Self::Count(n) => Some(n as f64),
            Self::Number(number) => Some(number),
        }
    }
}

/// Which values of a figure are better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Better {
    /// The higher, the better.
    Higher,
    /// The lower, the better.
    Lower,
    /// It depends on the question.
    Neither,
}

impl Better {
    /// Its name in answers and schemas.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Higher => "higher",
            Self::Lower => "lower",
            Self::Neither => "neither",
        }
    }
}

/// Figures by name, in the order in which they are shown; none of one that is not known.
pub type FiguresByName = IndexMap<String, Option<FigureValue>>;
