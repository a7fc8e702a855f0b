//! Numbers of answers in JSON, which has no NaN and no infinities: these are written as null.
//!
//! ```text
//! #[serde(serialize_with = "json_number::serialize")]
//! #[schemars(with = "Option<f64>")]
//! value: f64,
//! ```

use indexmap::IndexMap;
use serde::{Serialize, Serializer};

/// A number, or numbers in a container, that JSON may not be able to hold.
pub trait JsonNumber {
    /// The same with nothing in place of NaN and infinities.
    type Json: Serialize;

    /// Replaces what is not finite by nothing.
    fn to_json(&self) -> Self::Json;
}

impl JsonNumber for f64 {
    type Json = Option<Self>;

    fn to_json(&self) -> Option<Self> {
        self.is_finite().then_some(*self)
    }
}

impl<T: JsonNumber> JsonNumber for Option<T> {
    type Json = Option<T::Json>;

    fn to_json(&self) -> Option<T::Json> {
        self.as_ref().map(T::to_json)
    }
}

impl<T: JsonNumber> JsonNumber for [T; 2] {
    type Json = [T::Json; 2];

    fn to_json(&self) -> [T::Json; 2] {
        self.each_ref().map(T::to_json)
    }
}

impl<T: JsonNumber> JsonNumber for Vec<T> {
    type Json = Vec<T::Json>;

    fn to_json(&self) -> Vec<T::Json> {
        self.iter().map(T::to_json).collect()
    }
}

impl<T: JsonNumber> JsonNumber for IndexMap<String, T> {
    type Json = IndexMap<String, T::Json>;

    fn to_json(&self) -> IndexMap<String, T::Json> {
        self.iter().map(|(name, value)| (name.clone(), value.to_json())).collect()
    }
}

/// Writes numbers, null for each that is not finite.
///
/// # Errors
///
/// Those of the serializer.
pub fn serialize<T: JsonNumber, S: Serializer>(
    value: &T,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    value.to_json().serialize(serializer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Answer {
        #[serde(serialize_with = "serialize")]
        ends: IndexMap<String, [f64; 2]>,
        #[serde(serialize_with = "serialize")]
        seeds: Vec<Option<f64>>,
    }

    #[test]
    fn what_is_not_finite_is_null() {
        let ends = IndexMap::from([
            ("b".to_owned(), [0.1 + 0.2, f64::INFINITY]),
            ("a".to_owned(), [f64::NAN, -0.0]),
        ]);
        let answer = Answer { ends, seeds: vec![None, Some(1e300), Some(f64::NEG_INFINITY)] };
        assert_eq!(
            serde_json::to_string(&answer).unwrap(),
            r#"{"ends":{"b":[0.30000000000000004,null],"a":[null,-0.0]},"seeds":[null,1e+300,null]}"#
        );
    }
}
