//! A figure that is compared.

/// What a figure is, and on which scale `S` its differences are reported.
#[derive(Clone, Copy, Debug)]
pub struct FigureSpec<S> {
    /// Its name.
    pub name: &'static str,
    /// Its unit; empty for a number without.
    pub unit: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// Its scale.
    pub scale: S,
}

/// A figure, shortly.
pub(super) const fn figure<S>(
    name: &'static str,
    unit: &'static str,
    doc: &'static str,
    scale: S,
) -> FigureSpec<S> {
    FigureSpec { name, unit, doc, scale }
}
