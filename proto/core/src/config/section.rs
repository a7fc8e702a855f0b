//! A section of the configuration as a struct, which is its description, too.

use super::{Field, Kind, Node, Range, TableSpec, Variant};
use crate::ids::{AgentId, MoteId};

/// A checked table: what a `Section` is read from.
pub type CheckedTable = toml::Table;

/// A checked value: what a `Key` is read from.
pub type CheckedValue = toml::Value;

/// A table of the configuration whose keys are the fields of a struct. `#[derive(Section)]` makes both methods.
///
/// ```
/// use proto::config::{Choice, Lists, Range, Section, check, parse};
///
/// /// What moves.
/// #[derive(Section)]
/// struct Motion {
///     /// Greatest speed (m/s).
///     #[key(range = Range::POSITIVE, default = 1.5)]
///     speed_cap_mps: f64,
///     /// How it turns.
///     #[key(default = Turn::OnTheSpot)]
///     turn: Turn,
///     /// Those that stand still.
///     still: Vec<u32>,
/// }
///
/// #[derive(Choice, Debug, PartialEq)]
/// enum Turn {
///     /// Without moving.
///     OnTheSpot,
///     /// As a car.
///     Curve,
/// }
///
/// let node = parse("turn = \"curve\"").unwrap();
/// let mut problems = Vec::new();
/// let checked = check(&node, "motion", &Motion::SPEC, &Lists::NONE, &mut problems);
/// let motion = Motion::read(&checked.table);
/// assert_eq!((motion.speed_cap_mps, motion.turn), (1.5, Turn::Curve));
/// assert!(motion.still.is_empty() && problems.is_empty());
/// ```
pub trait Section: Sized {
    /// Its keys, and what they may be.
    const SPEC: TableSpec;

    /// The struct of a table that [`super::check`] has checked against [`Section::SPEC`]: defaults are filled in, and something
    /// valid stands where the text had something wrong. Keys that the struct does not have are left alone.
    ///
    /// # Panics
    ///
    /// If the table was not checked.
    fn read(table: &CheckedTable) -> Self;

    /// The struct of an empty table: all keys at their defaults.
    #[must_use]
    fn defaults() -> Self {
        let empty = Node::empty_table();
        Self::read(
            &super::check(&empty, "", &Self::SPEC, &super::Lists::NONE, &mut Vec::new()).table,
        )
    }
}

/// The variants of a tag, each with its own keys. `#[derive(Section)]` of an enum makes both.
pub trait Alternatives: Sized {
    /// Their names and keys.
    const VARIANTS: &'static [Variant];

    /// The variant that the key `tag` selects; `None`: none that is known, which the check has said.
    fn read(table: &CheckedTable, tag: &str) -> Option<Self>;
}

/// What a field of a [`Section`] may be. `#[derive(Choice)]` makes one of several texts, `#[derive(OneOf)]` a value of one of several
/// kinds.
///
/// ```
/// use proto::config::{Key, OneOf};
///
/// #[derive(OneOf, Debug, PartialEq)]
/// enum Seeds {
///     Count(#[key(range = 1..=9)] u64),
///     These(#[key(length = 1..)] Vec<u64>),
/// }
///
/// assert_eq!(Seeds::from_value(&3.into()), Some(Seeds::Count(3)));
/// assert_eq!(Seeds::from_value(&vec![3].into()), Some(Seeds::These(vec![3])));
/// let expected = "a whole number from 1 to 9, or a list, each entry a whole number, at least 0";
/// assert_eq!(Seeds::KIND.describe(), expected);
/// ```
pub trait Key: Sized {
    /// As a key.
    const KIND: Kind;
    /// As a key with any number of them.
    const LIST: Kind = Kind::List { of: &Self::KIND, min: 0, max: usize::MAX };

    /// The value of a checked key; `None`: it is not of this kind.
    fn from_value(value: &CheckedValue) -> Option<Self>;

    /// Its value where the key is absent; `None`: then it may not be.
    #[must_use]
    fn absent() -> Option<Self> {
        None
    }
}

/// The value of a key of a checked table.
///
/// # Panics
///
/// If the table was not checked against a description that has it.
#[must_use]
pub fn key<T: Key>(table: &CheckedTable, name: &str) -> T {
    table.get(name).map_or_else(T::absent, T::from_value).unwrap_or_else(|| {
        panic!("{name} is not what the description of its table says: was the table checked?")
    })
}

/// What the tag of a checked table selects.
#[must_use]
pub fn tag<'a>(table: &'a CheckedTable, key: &str) -> Option<&'a str> {
    table.get(key)?.as_str()
}

/// The greatest number of an integer type, as far as TOML has it.
#[must_use]
pub const fn greatest(of_type: u128) -> i64 {
    if of_type < i64::MAX as u128 { of_type as i64 } else { i64::MAX }
}

/// Whether two texts are the same, for the compiler.
#[must_use]
pub const fn is_same_text(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut place = 0;
    while place < one.len() && place < other.len() && one[place] == other[place] {
        place += 1;
    }
    place == one.len() && place == other.len()
}

/// Whether one of the variants has this name.
#[must_use]
pub const fn has_variant(variants: &[Variant], name: &str) -> bool {
    let mut place = 0;
    while place < variants.len() {
        if is_same_text(variants[place].name, name) {
            return true;
        }
        place += 1;
    }
    false
}

/// Whether a key of this kind may have a text as its default: an alternative of a choice, or any text.
#[must_use]
pub const fn may_be(kind: &Kind, text: &str) -> bool {
    let Kind::Choice(choices) = kind else { return true };
    let mut place = 0;
    while place < choices.len() {
        if is_same_text(choices[place].name, text) {
            return true;
        }
        place += 1;
    }
    false
}

/// The descriptions of several lists, `N` in all, in one.
#[must_use]
pub const fn joined<const N: usize>(lists: &[&[Field]]) -> [Field; N] {
    const NONE: Field =
        Field { key: "", doc: "", kind: Kind::Anything, default: super::Default::Absent };
    let mut all = [NONE; N];
    let (mut n, mut list) = (0, 0);
    while list < lists.len() {
        let mut place = 0;
        while place < lists[list].len() {
            all[n] = lists[list][place];
            n += 1;
            place += 1;
        }
        list += 1;
    }
    all
}

/// An entry of a list whose keys are a section.
#[must_use]
pub const fn variant<T: Section>(name: &'static str) -> Variant {
    Variant { name, doc: T::SPEC.doc, fields: T::SPEC.fields }
}

impl<T: Section> Key for T {
    const KIND: Kind = Kind::Table(&T::SPEC);
    const LIST: Kind = Kind::Tables(&T::SPEC);

    fn from_value(value: &CheckedValue) -> Option<Self> {
        value.as_table().map(T::read)
    }
}

impl<T: Key> Key for Option<T> {
    const KIND: Kind = T::KIND;

    fn from_value(value: &CheckedValue) -> Option<Self> {
        T::from_value(value).map(Some)
    }

    fn absent() -> Option<Self> {
        Some(None)
    }
}

impl<T: Key> Key for Vec<T> {
    const KIND: Kind = T::LIST;

    fn from_value(value: &CheckedValue) -> Option<Self> {
        value.as_array()?.iter().map(T::from_value).collect()
    }

    fn absent() -> Option<Self> {
        Some(Self::new())
    }
}

impl<T: Key, const N: usize> Key for [T; N] {
    const KIND: Kind = Kind::List { of: &T::KIND, min: N, max: N };

    fn from_value(value: &CheckedValue) -> Option<Self> {
        value.as_array()?.iter().map(T::from_value).collect::<Option<Vec<T>>>()?.try_into().ok()
    }
}

impl Key for bool {
    const KIND: Kind = Kind::Bool;

    fn from_value(value: &CheckedValue) -> Option<Self> {
        value.as_bool()
    }
}

impl Key for f64 {
    const KIND: Kind = Kind::Number(Range::ANY);

    fn from_value(value: &CheckedValue) -> Option<Self> {
        value.as_float()
    }
}

impl Key for String {
    const KIND: Kind = Kind::Text;

    fn from_value(value: &CheckedValue) -> Option<Self> {
        value.as_str().map(str::to_owned)
    }
}

/// A table whose description is elsewhere: `#[key(table = SPEC)]`.
impl Key for toml::Table {
    const KIND: Kind = Kind::Anything;

    fn from_value(value: &CheckedValue) -> Option<Self> {
        value.as_table().cloned()
    }
}

/// A value of several kinds, which whoever reads it tells apart: `#[key(kind = KIND)]`.
impl Key for toml::Value {
    const KIND: Kind = Kind::Anything;

    fn from_value(value: &CheckedValue) -> Option<Self> {
        Some(value.clone())
    }
}

macro_rules! integers {
    ($($integer:ty),*) => {$(
        impl Key for $integer {
            const KIND: Kind = Kind::Integer { min: 0, max: greatest(<$integer>::MAX as u128) };

            fn from_value(value: &CheckedValue) -> Option<Self> {
                value.as_integer()?.try_into().ok()
            }
        }
    )*};
}

integers!(u8, u16, u32, u64, usize);

macro_rules! numbers_of {
    ($($name:ty),*) => {$(
        impl Key for $name {
            const KIND: Kind = u32::KIND;

            fn from_value(value: &CheckedValue) -> Option<Self> {
                u32::from_value(value).map(Self)
            }
        }
    )*};
}

numbers_of!(AgentId, MoteId);

impl Key for i64 {
    const KIND: Kind = Kind::Integer { min: Self::MIN, max: Self::MAX };

    fn from_value(value: &CheckedValue) -> Option<Self> {
        value.as_integer()
    }
}

macro_rules! outside {
    ($($(#[doc = $doc:literal])* $name:ident($inner:ty) = $kind:ident;)*) => {$(
        $(#[doc = $doc])*
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub struct $name(pub $inner);

        impl Key for $name {
            const KIND: Kind = Kind::$kind;

            fn from_value(value: &CheckedValue) -> Option<Self> {
                <$inner>::from_value(value).map(Self)
            }
        }
    )*};
}

outside! {
    /// The path of a file, relative to the configuration.
    FilePath(String) = File;
    /// A program and its arguments: at least one word.
    Program(Vec<String>) = Program;
    /// A URL.
    Url(String) = Url;
    /// A line of a job script, or an option of a batch system.
    ClusterLine(String) = ClusterLine;
}

impl Program {
    /// How it is written.
    pub const WORDS: Kind = Kind::List { of: &Kind::Text, min: 1, max: 1000 };
}
