//! Which physical effect is missing: the search, and what it says.
//!
//! | module | what |
//! |---|---|
//! | [`held_out`] | predictions of rows by fits that have not seen them |
//! | [`ladder`] | the search |
//! | [`acceptance`] | which terms are significant, and worth having |
//! | [`gain`] | how much better one model predicts than another |
//! | [`score_test`] | what the slopes of one fit tell, without another fit |
//! | [`limits`] | effects on one robot, one node or from a time on |
//! | [`gate`] | whether the model is visibly wrong, whatever the cause |
//! | [`next`] | the measurement that would break a tie |
//! | [`progress`] | what a search reports while it works |
//! | [`scan`] | structure of the residuals |
//! | [`answer`] | from what was found to an answer |
//! | [`diagnosis`] | the answer, as programs read it |
//! | [`words`] | the answer, as people read it |
//! | [`mod@between`] | what changed between two campaigns |
//! | [`corrected_data`] | a file of measurements with its defects corrected |
//! | [`defects`] | defects of the measurement, which are corrected before the search |
//! | [`mod@compare`] | how large the model's error is as configured, and under which conditions |
//! | [`mod@extend`] | a configuration with a missing effect added, fitted |
//! | [`mod@simulate`] | the campaign that a model would have measured |
//! | [`mod@power`] | how large an effect a campaign would show |
//! | [`json_number`] | numbers of answers that JSON cannot hold |

pub mod acceptance;
pub mod answer;
pub mod between;
pub mod compare;
pub mod corrected_data;
pub mod defects;
pub mod diagnosis;
pub mod extend;
pub mod gain;
pub mod gate;
pub mod held_out;
pub mod json_number;
pub mod ladder;
pub mod limits;
pub mod next;
pub mod power;
pub mod progress;
pub mod scan;
pub mod score_test;
pub mod simulate;
#[cfg(test)]
mod structure_tests;
pub mod words;
