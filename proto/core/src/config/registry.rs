//! Lists that are open: what can be chosen by name, built in or added by whoever runs the simulator.

use super::{Tag, Variant};
use std::collections::BTreeMap;

/// An entry of a [`Registry`].
pub trait Registered: 'static {
    /// Its name in configurations, and its keys.
    fn variant(&self) -> &Variant;
}

/// Entries of one sort, such as all radio effects, each found by its name.
#[derive(Debug)]
pub struct Registry<E: 'static> {
    entries: Vec<&'static E>,
}

impl<E> Clone for Registry<E> {
    fn clone(&self) -> Self {
        Self { entries: self.entries.clone() }
    }
}

impl<E: Registered> Registry<E> {
    /// The entries of a list, in its order.
    ///
    /// # Panics
    ///
    /// If two of them have the same name.
    #[must_use]
    pub fn new(entries: &'static [E]) -> Self {
        let mut registry = Self { entries: Vec::with_capacity(entries.len()) };
        entries.iter().for_each(|entry| registry.add(entry));
        registry
    }

    /// Adds an entry, which is then configured, checked and described as those that are built in.
    ///
    /// # Panics
    ///
    /// If there is one of this name already: configurations could not tell them apart.
    pub fn add(&mut self, entry: &'static E) {
        let name = entry.variant().name;
        assert!(self.find(name).is_none(), "{name:?} is in the list already");
        self.entries.push(entry);
    }

    /// The entry of this name, if there is one.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<&'static E> {
        self.iter().find(|entry| entry.variant().name == name)
    }

    /// The entry that a checked table selects. `None`: none that is known, which the check has reported.
    #[must_use]
    pub fn selected(&self, checked: &toml::Table, tag: &Tag) -> Option<&'static E> {
        self.find(checked.get(tag.key)?.as_str()?)
    }

    /// All entries: those that are built in, then those that were added.
    pub fn iter(&self) -> impl Iterator<Item = &'static E> {
        self.entries.iter().copied()
    }

    fn variants(&self) -> Vec<Variant> {
        self.iter().map(|entry| *entry.variant()).collect()
    }
}

/// What tags can select, by the name of the list: see [`super::Variants::List`].
#[derive(Clone, Debug, Default)]
pub struct Lists(BTreeMap<&'static str, Vec<Variant>>);

impl Lists {
    /// No lists, for descriptions that name none.
    pub const NONE: Self = Self(BTreeMap::new());

    /// Adds what a registry has, as the list of this name.
    #[must_use]
    pub fn with<E: Registered>(mut self, name: &'static str, registry: &Registry<E>) -> Self {
        self.0.insert(name, registry.variants());
        self
    }

    /// What the list of this name has.
    ///
    /// # Panics
    ///
    /// If there is no such list: whoever made these left it out.
    #[must_use]
    pub(super) fn get(&self, name: &str) -> &[Variant] {
        self.0.get(name).unwrap_or_else(|| panic!("the list {name} was not passed to the check"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{TableSpec, Variants, check, json_schema, parse};
    use super::*;

    const TAG: Tag =
        Tag { key: "kind", doc: "Which.", default: None, variants: Variants::List("animals") };
    const SPEC: TableSpec = TableSpec { doc: "An animal.", fields: &[], tag: Some(&TAG) };

    #[derive(Debug)]
    struct Animal(Variant);

    impl Registered for Animal {
        fn variant(&self) -> &Variant {
            &self.0
        }
    }

    const fn animal(name: &'static str) -> Animal {
        Animal(Variant { name, doc: "", fields: &[] })
    }

    const BUILT_IN: &[Animal] = &[animal("ant"), animal("bee")];
    static WASP: Animal = animal("wasp");

    #[test]
    fn what_is_added_is_accepted_listed_and_found_as_what_is_built_in() {
        let mut animals = Registry::new(BUILT_IN);
        let node = parse("kind = \"wasp\"").unwrap();
        let problems = |animals: &Registry<Animal>| {
            let (lists, mut problems) = (Lists::default().with("animals", animals), Vec::new());
            check(&node, "x", &SPEC, &lists, &mut problems);
            problems.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(problems(&animals), ["x.kind: must be one of \"ant\", \"bee\", got \"wasp\""]);
        animals.add(&WASP);
        assert_eq!(problems(&animals), [""; 0]);
        let schema = json_schema(&SPEC, &Lists::default().with("animals", &animals));
        assert_eq!(schema["properties"]["kind"]["enum"], serde_json::json!(["ant", "bee", "wasp"]));
        let table = node.to_toml();
        let found = animals.selected(table.as_table().unwrap(), &TAG).unwrap();
        assert_eq!(found.variant().name, "wasp");
    }
}
