//! Files that are read: the memory that they may take, and whether those of a result are what the run wrote.
//!
//! | module | content |
//! |---|---|
//! | [`memory`] | how much memory reading may take |
//! | [`fingerprint`] | the SHA-256 of a file, and of each mebibyte of it |
//! | [`result`] | the folder of a result, whose files are checked before they are used |
//! | [`checked`] | a file each mebibyte of which is checked before it is read |
//! | [`table`] | a Parquet table of a result, read within a memory budget |
//! | [`pages`] | the memory that a column of a Parquet file takes |

pub mod checked;
pub mod fingerprint;
pub mod memory;
pub mod pages;
pub mod result;
pub mod table;

use memory::MemoryBudget;
use result::Trust;

/// How files of others are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// How much memory each file may take.
    pub budget: MemoryBudget,
    /// Whether files of results are believed as they are found.
    pub trust: Trust,
}

impl From<MemoryBudget> for Reading {
    /// Files of results are checked.
    fn from(budget: MemoryBudget) -> Self {
        Self { budget, trust: Trust::Checked }
    }
}

impl From<Trust> for Reading {
    /// With the default budget.
    fn from(trust: Trust) -> Self {
        Self { budget: MemoryBudget::default(), trust }
    }
}
