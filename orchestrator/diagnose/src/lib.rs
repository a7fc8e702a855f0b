//! Which physical effect is missing: a model of links or of robots compared with measurements.
//!
//! A question is one call: [`compare()`], [`diagnose()`], [`extend()`], [`power()`], [`between()`]. Request and answer are values; an
//! [`Observer`] sees the progress, and may stop the work. The measurements tell by their columns whether they are of links or of robots.
//!
//! ```no_run
#![doc = include_str!("../examples/answer.rs")]
//! ```
//!
//! | public module | what |
//! |---|---|
//! | [`mod@compare`] | how large the model's error is as configured, and under which conditions |
//! | [`diagnosis`] | which effects are missing, as programs read it |
//! | [`words`] | the same, as people read it |
//! | [`mod@extend`] | a configuration with effects added, fitted |
//! | [`mod@between`] | what changed between two campaigns |
//! | [`identifiability`] | what the design of measurements can tell, before any search |
//! | [`mod@power`] | how large an effect a campaign would show |
//! | [`mod@simulate`] | the campaign that a model would have measured |
//! | [`defects`] | defects of the measurement, which are corrected before the search |
//! | [`corrected_data`] | a file of measurements with its defects corrected |
//! | [`rows`] | the measured rows with both models' predictions, for plots |
//! | [`progress`] | what a search reports while it works |
//! | [`gain`], [`gate`] | scores of a model, and by how much rows are off it: parts of answers |
//! | [`stepwise`] | the loop of a stepwise selection, which all searches share |
//! | [`json_number`] | numbers of answers that JSON cannot hold |
//!
//! The steps between reading the measurements and the answer are private, so that they are put together in one place, `pipeline`:
//!
//! | private module | what |
//! |---|---|
//! | `measured` | where links and robots differ |
//! | `ladder` | the selection of effects, those on one robot, one node or from a time on among them |
//! | `acceptance` | which terms are significant, and worth having |
//! | `score_test` | what the slopes of one fit tell, without another fit |
//! | `held_out` | predictions of rows by fits that have not seen them |
//! | `scan` | structure of the residuals |
//! | `next` | the measurement that would break a tie |
//! | `bounds` | how large effects may be that were not found |
//! | `certainty` | what of all that was accepted is certain |
//! | `cautions` | what to mind of an accepted effect |
//! | `rivals` | the numbers of effects that are tied with accepted ones |
//! | `pure_error` | whether the model leaves more than repeats differ by |
//! | `losses` | the answer where nobody knows whether lost frames were logged |
//! | `answer` | from what was found to an answer |
//!
//! A step of a public module is private to this crate too:
//!
//! ```compile_fail,E0603
//! use diagnose::gate::gate;
//! ```

mod acceptance;
mod answer;
pub mod between;
mod bounds;
mod cautions;
mod certainty;
pub mod compare;
pub mod corrected_data;
pub mod defects;
pub mod diagnosis;
pub mod extend;
pub mod gain;
pub mod gate;
mod held_out;
pub mod identifiability;
pub mod json_number;
mod ladder;
mod losses;
mod measured;
mod next;
mod pipeline;
pub mod power;
pub mod progress;
mod pure_error;
mod request;
mod rivals;
pub mod rows;
mod scan;
mod score_test;
pub mod simulate;
pub mod stepwise;
#[cfg(test)]
mod structure_tests;
pub mod words;

pub use between::between;
pub use pipeline::{Answered, Effects, Extended, Extending, compare, diagnose, extend, screen};
pub use power::power;
pub use request::{
    DiagnoseError, NotExecuted, Observer, Request, RobotSimulator, SimulatorError, Stopped,
    Unobserved,
};
