//! Measurement campaigns with something hidden in them: what the diagnosis is judged by.
//!
//! From a seed comes what a person would bring to it: a file of measurements and the configuration of a model that lacks
//! something; and what that person would not know: what is missing, and how well the true model predicts the file.
//! The equations here are written from the catalogue's sources. Nothing of the simulators, of the fit or of the
//! diagnosis is used, so that an error there cannot hide in an equal one here.

pub mod blind;
mod draws;
mod effect;
mod field;
mod fleet;
mod geometry;
mod hidden;
mod link;
mod motion;
mod oracle;
mod posterior;
pub mod promise;
mod radio;
pub mod repeated;
#[cfg(test)]
mod robot_tests;
mod robots;
pub mod situations;
pub mod unforeseen;
mod world;

pub use fleet::{Drive, Fleet, RobotHidden};
pub use hidden::{Hidden, Size};
pub use world::{Base, Layout};

/// A campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct Campaign {
    /// The measurements: a file's text.
    pub csv: String,
    /// The model without what is hidden.
    pub config_toml: String,
    /// What is hidden.
    pub truth: Vec<Truth>,
    /// How well the true model predicts the measurements.
    pub oracle: Scores,
    /// Share of frames received (links), 1 for robots.
    pub received: f64,
}

/// Something hidden.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// The effect's name in the catalogue, or one that begins with `unknown-`.
    pub effect: &'static str,
    /// For one in no catalogue: columns in any of which its structure is seen.
    pub covariates: &'static [&'static str],
    /// Its parameters, named and with the units of the catalogue.
    pub parameters: Vec<(&'static str, f64)>,
    /// Its parameters that are no numbers.
    pub choices: Vec<(&'static str, String)>,
    /// Its size: rms over received rows (over windows) divided by the noise, or the share of frames that it takes away. A
    /// shape that cannot be as large as asked has its greatest size.
    pub size: f64,
}

impl Truth {
    /// Its parameters, the ends of a screen named as they were found: either may be called the first.
    #[must_use]
    pub fn named_as(&self, found: &dyn Fn(&str) -> Option<f64>) -> Vec<(&'static str, f64)> {
        const ENDS: [[&str; 2]; 2] = [["from_x_m", "to_x_m"], ["from_y_m", "to_y_m"]];
        let other = |name: &'static str| {
            let ends = ENDS.iter().find(|ends| ends.contains(&name));
            ends.map_or(name, |&[from, to]| if name == from { to } else { from })
        };
        let given = self.parameters.clone();
        let turned: Vec<(&'static str, f64)> =
            given.iter().map(|&(name, value)| (other(name), value)).collect();
        let off = |parameters: &[(&str, f64)]| -> f64 {
            parameters.iter().filter_map(|(name, value)| Some((found(name)? - value).abs())).sum()
        };
        if off(&turned) < off(&given) { turned } else { given }
    }
}

/// How well a predictive model does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scores {
    /// Mean log predictive density per row (nats).
    pub log_score: f64,
    /// Root mean square error of received rows (dB), of positions after a second (m).
    pub rmse: f64,
    /// Continuous ranked probability score of the same (dB, m).
    pub crps: f64,
    /// Mean of minus the logarithm of the probability given to what became of each frame (nats); links only.
    pub reception_log_loss: Option<f64>,
}

#[cfg(test)]
mod tests;
