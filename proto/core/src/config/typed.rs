//! From a checked table to a typed struct.

use serde::de::DeserializeOwned;

/// The keys of a checked table as a typed struct.
///
/// The check has filled in defaults, put something valid where the text had something wrong, and allows no key that the
/// description lacks. So `T` states no default of its own: a key with a default, or a required one, is a plain field; one that
/// is absent by default, and a required file or table, is an `Option`. Keys that `T` does not have are left alone.
///
/// # Panics
///
/// If `T` asks for what the description of the table does not promise: a key that it lacks, or a narrower type. That is an
/// error of the program, whatever the configuration.
#[must_use]
pub fn typed<T: DeserializeOwned>(checked: &toml::Table) -> T {
    checked.clone().try_into().unwrap_or_else(|error: toml::de::Error| {
        panic!("{} does not fit the description of its table: {error}", std::any::type_name::<T>())
    })
}
