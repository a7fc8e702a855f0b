//! Derives with which a struct is the description of a section of the configuration: see `proto::config::Section`.

mod catalogued;
mod choice;
mod docs;
mod key;
mod one_of;
mod section;

use proc_macro::TokenStream;

/// Makes a struct the description of a table, each field a key, and reads the struct from a checked table.
///
/// The documentation of the struct says what the table is about (its first paragraph counts), that of a field what the key means.
/// A description has `` ` `` where the documentation has two of them.
/// A type says what a key may be, and whether it may be absent:
///
/// | field | key |
/// |---|---|
/// | `bool`, `f64`, an integer type, `String` | required |
/// | a `Section`, or an enum that derives `Choice` | required |
/// | `Option<T>` | absent by default |
/// | `Vec<T>` | a list, or `[[...]]` of a section; absent by default, and then empty |
/// | `[T; N]` | a list of `N` |
///
/// `#[key(...)]` says the rest:
///
/// * `default = 10`, `default = "text"`, `default = Mode::Slow`: what the key is when absent;
/// * `default`: a table with all its defaults;
/// * `required`: of a `Vec`, which may then not be absent, or of an `Option`, which is `None` only where the key was refused;
/// * `absent`: absent by default, and whoever reads the section puts a value there first;
/// * `range = 0.0..=1.0`, `range = Range::POSITIVE`: of a number, or of the numbers of a list;
/// * `above = 0.0, most = 1.0`: greater than the one, at most the other;
/// * `length = 1..=9`: of a list;
/// * `name = "type"`: the key, where it is not the field's name;
/// * `table = SPEC`, `tables = SPEC`: of a `toml::Table` or a `Vec` of such, whose description is elsewhere;
/// * `kind = KIND`: any other `Kind`;
/// * `doc = TEXT`: what the key means, where the documentation of the field does not say it;
/// * `field = FIELD`: a description that several sections share; the field has its key's name;
/// * `flatten`: of a section, whose keys are then keys of this one;
/// * `inherited`: of a variant, a key of the table around it, which describes it;
/// * `skip`: the field is no key; it gets its type's default value;
/// * `tag`: the key selects a variant of an enum that derives `Section`, which holds the keys of that variant.
///
/// `#[section(tag = TAG)]` adds a tag whose variants are in a list that is open.
///
/// On an enum, each variant is one that a tag selects: without keys, with keys as named fields, or with a section as its one field.
#[proc_macro_derive(Section, attributes(section, key))]
pub fn section(input: TokenStream) -> TokenStream {
    derive(input, section::section)
}

/// Makes an enum without fields a key with one of several texts: the names of its variants in kebab case, or
/// `#[choice(name = "...")]`. The documentation of a variant says what it means.
#[proc_macro_derive(Choice, attributes(choice))]
pub fn choice(input: TokenStream) -> TokenStream {
    derive(input, choice::choice)
}

/// Makes an enum a key with a value of one of several kinds: each variant has one field, to which `#[key(...)]` applies as to the
/// field of a `Section`. The first variant that fits by its type counts.
#[proc_macro_derive(OneOf, attributes(key))]
pub fn one_of(input: TokenStream) -> TokenStream {
    derive(input, one_of::one_of)
}

/// Makes the struct of an effect say its name, what people should know of it, and how it is fitted: `proto::effect::Named` and
/// `proto::effect::Catalogued`.
///
/// The documentation of the struct has, after its first paragraph, the sections `# Mechanism`, `# Equation`, `# Source`,
/// `# Validity` and `# Trace`; what follows further headings is for readers of the code.
///
/// `#[effect(name = "...", needs = &[...], example = "...")]` says the rest of it. Where the struct holds only the keys of the effect,
/// `makes = Type` is the effect itself, which has the name. All other words are fields of `Fit`, those that are not said being those of
/// `Fit::PLAIN`. `#[fit(unit = "dB", starts = [3.0], step = 0.1)]` marks a key that is fitted, from the least to
/// the greatest value of the key or of `range = 0.0..=9.0`; `key = "velocity_mps[0]"` names an entry of a list.
/// `null = 0.0` is the value at which the effect does nothing, of a key that is its size. `plausible = 0.5..=20.0` is the physically
/// plausible range, and `source = "..."` says who reports it: both or neither.
#[proc_macro_derive(Catalogued, attributes(effect, fit))]
pub fn catalogued(input: TokenStream) -> TokenStream {
    derive(input, catalogued::catalogued)
}

fn derive(
    input: TokenStream,
    with: fn(&syn::DeriveInput) -> syn::Result<proc_macro2::TokenStream>,
) -> TokenStream {
    let input = syn::parse_macro_input!(input as syn::DeriveInput);
    with(&input).unwrap_or_else(|error| error.to_compile_error()).into()
}
