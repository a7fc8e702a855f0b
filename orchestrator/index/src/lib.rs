//! The results of a folder in one table: runs, sweeps and answers, what they came to, and what differs between them.
//!
//! | module | content |
//! |---|---|
//! | `listing` | the folders and files below a folder that may be results |
//! | `row` | what the table has of a result |
//! | `read` | a row of a run, a sweep or an answer |
//! | `unfinished` | a row of a run or a sweep that is being recorded, or was killed |
//! | `settings` | the keys of the configurations that differ between the runs |
//! | `series` | what changed during a run, a point for each of a few hundred steps |
//! | `table` | all rows, kept up to date |
//! | `site` | the page that shows them, its calls, and the pages that it links to |

mod listing;
mod read;
mod row;
mod series;
mod settings;
mod site;
mod table;
mod unfinished;

pub use site::site;
pub use table::ResultsTable;
