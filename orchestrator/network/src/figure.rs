//! A figure that is compared.

/// What a figure is, and on which scale `S` its differences are reported.
#[derive(Clone, Copy, Debug)]
pub struct FigureSpec<S> {
    /// Name of the figure, as answers and pages show it.
    pub name: &'static str,
    /// Its unit; empty for a number without.
    pub unit: &'static str,
    /// What the figure is, in a sentence.
    pub doc: &'static str,
    /// The scale on which differences of it are compared.
    pub scale: S,
}

/// A figure, shortly.
pub(super) const fn figure<S>(
    name: &'static str,
    unit: &'static str,
    scale: S,
    doc: &'static str,
) -> FigureSpec<S> {
    FigureSpec { name, unit, doc, scale }
}
