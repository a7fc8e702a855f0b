//! Effects that users write themselves.

use super::{Effect, Entry};
use crate::link::{End, Link, Side};
use crate::sight::Path;
use proto::config::{Choice, Problem, Section};
use proto::effect::{Catalogued, Need};
use proto::formula::{Bound, Keys as FormulaKeys, Written};

/// `kind = "formula"`.
pub const ENTRY: Entry = Entry::new::<Keys>(
    |table, path, problems| {
        written(table, path, problems);
    },
    |table, _| {
        let expression = written(table, "", &mut Vec::new())?.bound(&NAMES);
        let Keys { target, limit_db, .. } = Keys::read(table);
        Some(Box::new(Formula { expression, target, limit_db }))
    },
);

fn written(table: &toml::Table, path: &str, problems: &mut Vec<Problem>) -> Option<Written> {
    Written::read(&Keys::read(table).formula, path, &NAMES.map(|(name, _)| name), problems)
}

/// A user-defined expression of covariates and named parameters.
///
/// # Mechanism
///
/// For effects outside the catalogue: an expression of distance, frequency, positions, time, headings and any column of the
/// measurements, with named parameters.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + expression (mean), curve(RSSI - expression) (noise), P(received)' = P(received) (1 - expression) (loss)
/// ```
///
/// # Source
///
/// User-defined. diagnose writes formulas for unexplained structure in this form.
///
/// # Validity
///
/// As valid as the expression. It adds nothing if a name has no value or the result is not a number. Results are clipped to limit_db,
/// and loss probabilities to 0 to 1.
///
/// # Trace
///
/// An error that depends on the covariates of the expression.
#[derive(Catalogued, Section)]
#[effect(
    name = "formula",
    makes = Formula,
    needs = &[Need::Readings],
    example = "expression = \"-a * max(temperature_c - onset_c, 0)\"\ntarget = \"mean\"\n\
               parameters.a = { start = 0.1, min = 0.0, max = 1.0 }\n\
               parameters.onset_c = { start = 25.0, min = 0.0, max = 60.0 }\n",
)]
struct Keys {
    #[key(flatten)]
    formula: FormulaKeys,
    /// The quantity that the expression is added to.
    #[key(default = Target::Mean)]
    target: Target,
    /// Limit of the expression's absolute value (dB); larger values are clipped. It also bounds the range of links, so a small limit
    /// makes runs faster.
    #[key(range = 0.0..=200.0, default = 40.0)]
    limit_db: f64,
}

/// Reads a number off a link.
pub type Read = fn(&Link<'_>) -> Option<f64>;

/// Names that every expression may use. Every other one is a covariate: a column of measurements (`humidity_pct`,
/// `tx_temperature_c`), or a number that each agent brings, at the sender (`tx_…`), at the receiver (`rx_…`) or, without a
/// prefix, the mean of both.
pub const NAMES: [(&str, Read); 20] = [
    ("distance_m", |link| Some(link.distance_m)),
    ("log10_distance", |link| Some(libm::log10(link.distance_m))),
    ("frequency_mhz", |link| Some(link.frequency_hz / 1e6)),
    ("channel", |link| link.channel.map(f64::from)),
    ("time_s", |link| Some(link.time_ns as f64 / 1e9)),
    ("tx", |link| Some(f64::from(link.sender.id.0))),
    ("rx", |link| Some(f64::from(link.receiver.id.0))),
    ("tx_x_m", |link| Some(link.sender.position_m[0])),
    ("tx_y_m", |link| Some(link.sender.position_m[1])),
    ("tx_z_m", |link| Some(link.sender.position_m[2])),
    ("rx_x_m", |link| Some(link.receiver.position_m[0])),
    ("rx_y_m", |link| Some(link.receiver.position_m[1])),
    ("rx_z_m", |link| Some(link.receiver.position_m[2])),
    ("midpoint_x_m", |link| Some(middle(link, 0))),
    ("midpoint_y_m", |link| Some(middle(link, 1))),
    ("elevation_rad", |link| Some(elevation_rad(link))),
    ("tx_heading_rad", |link| link.sender.heading_rad),
    ("rx_heading_rad", |link| link.receiver.heading_rad),
    ("tx_bearing_rad", |link| bearing_rad(&link.sender, &link.receiver)),
    ("walls_crossed", |link| Some(walls_crossed(link))),
];

fn middle(link: &Link<'_>, axis: usize) -> f64 {
    0.5 * (link.sender.position_m[axis] + link.receiver.position_m[axis])
}

/// Angle of the path above the horizon, seen from the sender (rad).
fn elevation_rad(link: &Link<'_>) -> f64 {
    let step = [0, 1, 2].map(|axis| link.receiver.position_m[axis] - link.sender.position_m[axis]);
    libm::atan2(step[2], libm::hypot(step[0], step[1]))
}

/// Direction of the other end seen from the body (rad, −π to π).
fn bearing_rad(here: &End, there: &End) -> Option<f64> {
    let step = [0, 1].map(|axis| there.position_m[axis] - here.position_m[axis]);
    let bearing_rad = libm::atan2(step[1], step[0]) - here.heading_rad?;
    Some(libm::remainder(bearing_rad, std::f64::consts::TAU))
}

fn walls_crossed(link: &Link<'_>) -> f64 {
    let path = Path::direct(link);
    let walls = link.scene.site.map_or(&[][..], |site| &site.wall);
    walls.iter().filter(|wall| path.is_cut_by_wall(wall)).count() as f64
}

/// What an expression is added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Target {
    /// The received power (dB). Attenuation is negative.
    Mean,
    /// The receiver's noise (dB): frames must be stronger by this to be received as well.
    Noise,
    /// The probability (0 to 1) that a frame is lost, independently of its strength.
    Loss,
}

/// An expression of the user's.
///
/// # Model
///
/// Whatever is written: the expression's value is added to the mean power or to the receiver's noise (dB), or is the
/// probability that a frame is lost.
///
/// # Validity
///
/// Where a name has no value, or the result is not a number, it adds nothing. Results are kept within ± `limit_db`, losses
/// within 0 to 1.
#[derive(Clone, Debug)]
pub struct Formula {
    expression: Bound<Read>,
    target: Target,
    limit_db: f64,
}

impl Formula {
    /// Its value on a link, if it has one.
    fn value(&self, link: &Link<'_>) -> Option<f64> {
        self.expression.value(|read| read(link), |name| covariate(link, name))
    }

    fn value_db(&self, target: Target, link: &Link<'_>) -> f64 {
        if self.target != target {
            return 0.0;
        }
        self.value(link).unwrap_or(0.0).clamp(-self.limit_db, self.limit_db)
    }
}

/// A covariate by the name that a formula uses.
pub(super) fn covariate(link: &Link<'_>, name: &str) -> Option<f64> {
    if let Some(value) = link.scene.covariates.column(&|column| column == name) {
        return Some(value);
    }
    if let Some(name) = name.strip_prefix("tx_") {
        return link.covariate(name, Side::Sender);
    }
    if let Some(name) = name.strip_prefix("rx_") {
        return link.covariate(name, Side::Receiver);
    }
    let value_of = |side| link.covariate(name, side);
    match (value_of(Side::Sender), value_of(Side::Receiver)) {
        (Some(sender), Some(receiver)) => Some(0.5 * (sender + receiver)),
        (one, other) => one.or(other),
    }
}

impl Effect for Formula {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        self.value_db(Target::Mean, link)
    }

    fn max_gain_db(&self) -> f64 {
        match self.target {
            Target::Mean | Target::Noise => self.limit_db,
            Target::Loss => 0.0,
        }
    }

    fn curve_shift_db(&self, link: &Link<'_>) -> f64 {
        self.value_db(Target::Noise, link)
    }

    fn loss(&self, link: &Link<'_>) -> f64 {
        match self.target {
            Target::Loss => self.value(link).unwrap_or(0.0).clamp(0.0, 1.0),
            Target::Mean | Target::Noise => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::testing::{along_x, made, problems};
    use crate::link::{Covariates, Scene};
    use proto::types::Covariate;

    #[test]
    fn a_formula_can_say_what_the_catalogue_says() {
        let scene = Scene::default();
        let formula = made(
            "formula",
            "expression = \"-10 * (n - 2) * log10_distance\"\nparameters = { n = { value = 3.5 } }",
        );
        let entry = made("path-loss-exponent", "exponent = 3.5");
        for distance_m in [1.0, 2.5, 70.0] {
            let link = along_x(distance_m, 1.0, Some(15), &scene);
            let (got, expected) = (formula.contribution_db(&link), entry.contribution_db(&link));
            assert!((got - expected).abs() < 1e-12, "{distance_m}: {got}, {expected}");
        }
    }

    #[test]
    fn it_goes_where_its_target_says_and_within_its_limits() {
        let scene = Scene::default();
        let link = along_x(30.0, 1.0, Some(15), &scene);
        let parts = |keys: &str| {
            let effect = made("formula", &format!("expression = \"distance_m / 10\"\n{keys}"));
            (effect.contribution_db(&link), effect.curve_shift_db(&link), effect.loss(&link))
        };
        assert_eq!(parts(""), (3.0, 0.0, 0.0));
        assert_eq!(parts("target = \"noise\""), (0.0, 3.0, 0.0));
        assert_eq!(parts("target = \"loss\""), (0.0, 0.0, 1.0));
        assert_eq!(parts("limit_db = 2"), (2.0, 0.0, 0.0));
        assert_eq!(made("formula", "expression = \"sqrt(-1)\"").contribution_db(&link), 0.0);
        assert_eq!(made("formula", "expression = \"-1 / 0\"").contribution_db(&link), -40.0);
        let problem = problems("formula", "expression = \"distanc_m\"");
        assert!(problem.contains("did you mean distance_m?\n    distanc_m\n    ^"), "{problem}");
    }

    #[test]
    fn names_are_those_of_the_link_its_row_and_its_agents() {
        let value = |text: &str, covariates| {
            let scene = Scene { covariates, ..Scene::default() };
            let mut link = along_x(10.0, 2.0, Some(15), &scene);
            link.time_ns = 3_500_000_000;
            link.receiver.position_m[1] = 10.0;
            link.sender.heading_rad = Some(0.25);
            made("formula", &format!("expression = \"{text}\"\nlimit_db = 200"))
                .contribution_db(&link)
        };
        for (text, expected) in [
            ("frequency_mhz - 2400", 25.0),
            ("channel", 15.0),
            ("time_s", 3.5),
            ("10 * tx + rx", 1.0),
            ("tx_x_m + tx_y_m + 100 * tx_z_m - 200", 0.0),
            ("rx_x_m + rx_y_m + rx_z_m", 22.0),
            ("midpoint_x_m + midpoint_y_m", 10.0),
            ("tx_heading_rad + tx_bearing_rad - pi / 4", 0.0),
            ("1 + rx_heading_rad", 0.0), // not known
            ("elevation_rad + walls_crossed", 0.0),
            ("humidity_pct", 0.0),
        ] {
            let got = value(text, Covariates::None);
            assert!((got - expected).abs() < 1e-12, "{text}: {got}");
        }
        let row = [("humidity_pct".to_owned(), 40.0), ("tx_speed_mps".to_owned(), 2.0)];
        assert_eq!(value("humidity_pct", Covariates::Row(&row)), 40.0);
        assert_eq!(value("tx_speed_mps", Covariates::Row(&row)), 2.0);
        let agents = [Covariate { name: "humidity_pct".to_owned(), values: vec![30.0, 50.0] }];
        assert_eq!(value("humidity_pct", Covariates::Agents(&agents)), 40.0);
        assert_eq!(value("rx_humidity_pct", Covariates::Agents(&agents)), 50.0);
    }
}
