//! Documentation comments as text.

use syn::{Attribute, Expr, Lit, Meta};

/// The first paragraph of a documentation, on one line.
pub(crate) fn first_paragraph(attributes: &[Attribute]) -> String {
    let text = text(attributes);
    plain(text.trim().split("\n\n").next().unwrap_or_default())
}

/// What stands under a heading, on one line.
pub(crate) fn under(heading: &str, attributes: &[Attribute]) -> Option<String> {
    let text = text(attributes);
    let (_, after) = text.split_once(&format!("# {heading}\n"))?;
    Some(plain(after.split("\n# ").next().unwrap_or_default()))
}

fn text(attributes: &[Attribute]) -> String {
    attributes.iter().filter_map(line).collect::<Vec<_>>().join("\n")
}

/// On one line, without what only rustdoc needs: fences, and the backslash of a bracket that begins no link.
fn plain(text: &str) -> String {
    let lines = text.lines().filter(|line| !line.starts_with("```"));
    let words = lines.flat_map(str::split_whitespace).collect::<Vec<_>>().join(" ");
    words.replace("\\[", "[").replace("\\]", "]").replace("\\<", "<")
}

/// One line of a documentation.
fn line(attribute: &Attribute) -> Option<String> {
    let Meta::NameValue(meta) = &attribute.meta else { return None };
    if !meta.path.is_ident("doc") {
        return None;
    }
    match &meta.value {
        Expr::Lit(literal) => match &literal.lit {
            Lit::Str(text) => Some(text.value().trim().to_owned()),
            _ => None,
        },
        _ => None,
    }
}

/// `broadcast-slotframe` of `BroadcastSlotframe`.
pub(crate) fn kebab_case(name: &str) -> String {
    let mut kebab = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !kebab.is_empty() {
            kebab.push('-');
        }
        kebab.extend(letter.to_lowercase());
    }
    kebab
}
