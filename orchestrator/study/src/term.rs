//! Numbers of terms, and lists with one value for each term.

use std::ops::{Deref, Index};

/// The number of a term among the candidates of a study. It also means the same term in a study of other rows with the same
/// candidates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TermId(usize);

/// One value for each term of a study, in the order of its candidates.
#[derive(Clone, Debug)]
pub struct PerTerm<T>(Vec<T>);

impl<T> PerTerm<T> {
    /// The numbers of all terms, in order.
    pub fn ids(&self) -> impl DoubleEndedIterator<Item = TermId> + use<T> {
        (0..self.0.len()).map(TermId)
    }

    /// The first term whose value is wanted.
    #[must_use]
    pub fn find(&self, is_wanted: impl FnMut(&T) -> bool) -> Option<TermId> {
        self.0.iter().position(is_wanted).map(TermId)
    }

    /// Adds the value of a new term, the last one.
    pub fn push(&mut self, value: T) -> TermId {
        self.0.push(value);
        TermId(self.0.len() - 1)
    }
}

impl<T> Default for PerTerm<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> FromIterator<T> for PerTerm<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

impl<T> Deref for PerTerm<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T> Index<TermId> for PerTerm<T> {
    type Output = T;

    fn index(&self, term: TermId) -> &T {
        &self.0[term.0]
    }
}
