//! How much memory reading may take.
//!
//! A reader of measurements gets its bytes with an account. One that does not count what it keeps is charged for every byte that it
//! reads; one that counts takes the bytes uncharged, with the account.

use std::fmt;
use std::str::FromStr;

/// The most memory (bytes) that one table may take, and what is read from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MemoryBudget(pub u64);

/// What a reader is charged for each byte of text that it reads and does not count: a number and its separator are two bytes at
/// least, and eight in memory.
pub const UNCOUNTED: u64 = 4;

const UNITS: [(&str, u64); 7] = [
    ("TiB", 1 << 40),
    ("GiB", 1 << 30),
    ("MiB", 1 << 20),
    ("KiB", 1 << 10),
    ("GB", 1_000_000_000),
    ("MB", 1_000_000),
    ("kB", 1000),
];

impl Default for MemoryBudget {
    /// 1 GiB.
    fn default() -> Self {
        Self(1 << 30)
    }
}

impl fmt::Display for MemoryBudget {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let exact = UNITS.iter().filter(|(_, bytes)| 0 < self.0 && self.0.is_multiple_of(*bytes));
        let exact = exact.min_by_key(|(_, bytes)| self.0 / bytes);
        match exact {
            Some((unit, bytes)) => write!(formatter, "{} {unit}", self.0 / bytes),
            None => write!(formatter, "{} bytes", self.0),
        }
    }
}

impl FromStr for MemoryBudget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let split = text.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(text.len());
        let (number, unit) = text.split_at(split);
        let bytes = match unit.trim() {
            "" | "B" => Some(1),
            unit => UNITS.iter().find(|(name, _)| *name == unit).map(|(_, bytes)| *bytes),
        };
        let number = number.parse::<u64>().ok().filter(|number| 0 < *number);
        let budget = number.zip(bytes).and_then(|(number, bytes)| number.checked_mul(bytes));
        budget.map(Self).ok_or_else(|| {
            "must be a whole number with a unit, as in 2GiB or 500MB (kB, MB, GB, KiB, MiB, GiB, TiB)".to_owned()
        })
    }
}

/// How much of a budget is taken.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    budget: MemoryBudget,
    taken: u64,
}

impl Memory {
    /// Nothing is taken.
    #[must_use]
    pub fn new(budget: MemoryBudget) -> Self {
        Self { budget, taken: 0 }
    }

    /// For what is at hand already.
    pub const UNLIMITED: Self = Self { budget: MemoryBudget(u64::MAX), taken: 0 };

    /// The most that may be taken.
    #[must_use]
    pub fn budget(&self) -> MemoryBudget {
        self.budget
    }

    /// What is left, as a budget of its own.
    #[must_use]
    pub fn left(&self) -> MemoryBudget {
        MemoryBudget(self.budget.0.saturating_sub(self.taken))
    }

    /// Counts memory that is about to be taken. `what`: for what.
    ///
    /// # Errors
    ///
    /// The budget does not suffice: the budget, and the option that changes it.
    pub fn take(&mut self, bytes: u64, what: impl fmt::Display) -> Result<(), String> {
        self.taken = self.taken.saturating_add(bytes);
        if self.taken <= self.budget.0 {
            return Ok(());
        }
        Err(format!(
            "needs more than {} of memory for {what}; allow more with --memory-budget",
            self.budget
        ))
    }

    /// Counts memory that was taken and is free again.
    pub fn release(&mut self, bytes: u64) {
        self.taken = self.taken.saturating_sub(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_read_and_written_with_its_unit() {
        for (text, bytes) in [("2GiB", 2 << 30), ("500 MB", 500_000_000), ("1024", 1024)] {
            assert_eq!(text.parse(), Ok(MemoryBudget(bytes)), "{text}");
        }
        for wrong in ["", "0", "-1", "1.5GiB", "2 gigs", "99999999999TiB", "GiB"] {
            assert!(wrong.parse::<MemoryBudget>().is_err(), "{wrong}");
        }
        assert_eq!(MemoryBudget::default().to_string(), "1 GiB");
        assert_eq!(MemoryBudget(500_000_000).to_string(), "500 MB");
        assert_eq!(MemoryBudget(1_200_000_000).to_string(), "1200 MB");
        assert_eq!(MemoryBudget(1025).to_string(), "1025 bytes");
    }

    #[test]
    fn what_exceeds_a_budget_is_refused_with_the_figure_and_the_option() {
        let mut memory = Memory::new(MemoryBudget(1 << 20));
        assert_eq!(memory.take(1 << 20, "all"), Ok(()));
        let refused = memory.take(1, "2 rows").unwrap_err();
        assert_eq!(
            refused,
            "needs more than 1 MiB of memory for 2 rows; allow more with --memory-budget"
        );
        memory.release(1 << 20);
        assert_eq!(memory.take(1, "2 rows"), Ok(()));
    }
}
