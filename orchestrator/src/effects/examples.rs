//! Keys for an example of each effect, and for its picture.

use super::Listed;
use proto::config::{Default, Field, Kind};
use proto::effect::Fixed;
use std::fmt::Write as _;

/// Where the starts of a fit would make an example that shows nothing, or keys are needed that no fit tries.
const RADIO: &[(&str, &str)] = &[
    ("antenna-pattern", "front_to_back_db = 10.0\nboresight_rad = 0.0\n"),
    ("battery-sag", "db_per_hour = -0.5\nnodes = [0, 3]\n"),
    ("body-blocking", "loss_db = 6.0\nblocker_radius_m = 0.5\n"),
    ("fast-fading", "k_factor_db = 3.0\n"),
    (
        "formula",
        "expression = \"-a * max(temperature_c - onset_c, 0)\"\ntarget = \"mean\"\n\
         parameters.a = { start = 0.1, min = 0.0, max = 1.0 }\n\
         parameters.onset_c = { start = 25.0, min = 0.0, max = 60.0 }\n",
    ),
    ("hidden-obstacle", "loss_db = 8.0\nfrom_m = [10.0, -2.0]\nto_m = [10.0, 2.0]\n"),
    ("interference", "centre_mhz = 2437.0\nduty = 0.3\n"),
    ("motion-fading", "rician_k_db = -5.0\n"),
    ("multipath", "sd_db = 4.0\ncoherence_mhz = 5.0\n"),
    ("node-offset", "tx_sd_db = 1.5\nrx_sd_db = 1.0\n"),
    ("noise-floor", "shift_db = 4.0\n"),
    ("path-loss-exponent", "exponent = 3.0\n"),
    ("receiver-nonlinearity", "saturation_dbm = -55.0\nslope = 0.4\n"),
    ("reception-curve", "p50_dbm = -93.0\nwidth_db = 0.7\n"),
    ("shadowing", "sd_db = 4.0\ndecorrelation_m = 8.3\n"),
    ("system-gain", "gain_db = -3.0\n"),
    ("temperature", "db_per_c = -0.15\n"),
    ("two-ray-ground", "relative_permittivity = 15.0\npolarization = \"vertical\"\n"),
    ("vegetation", "db_per_m = -0.4\n"),
    ("wall-attenuation", "loss_db = 6.0\n"),
];

/// As [`RADIO`], for robots.
const ROBOTS: &[(&str, &str)] = &[
    ("acceleration-limit", "limit_mps2 = 1.5\n"),
    ("actuator-lag", "tau_s = 0.3\n"),
    ("dead-band", "threshold_mps = 0.05\n"),
    ("dead-time", "delay_s = 0.2\n"),
    ("downwash", "gain = 0.3\nrange_m = 0.5\n"),
    (
        "formula",
        "expression = \"-a * max(speed_mps - onset_mps, 0)\"\ntarget = \"ahead\"\n\
         parameters.a = { start = 0.1, min = 0.0, max = 1.0 }\n\
         parameters.onset_mps = { start = 1.0, min = 0.0, max = 10.0 }\n",
    ),
    ("heading-bias", "angle_rad = 0.05\n"),
    ("localization", "sd_m = 0.02\n"),
    ("quadratic-drag", "coefficient_per_m = 0.02\n"),
    ("rough-ground", "centre_m = [10.0, 5.0]\nradius_m = 4.0\nscale = 0.6\n"),
    ("slip", "scale = 0.95\n"),
    ("slope", "gain = 0.5\n"),
    ("speed-limit", "limit_mps = 1.2\n"),
    ("steering-bias", "rate_radps = 0.05\n"),
    ("wind", "velocity_mps = [0.2, -0.1, 0.0]\n"),
    ("yaw-coupling", "gain = 0.1\n"),
];

/// As [`RADIO`], for the network.
const NETWORK: &[(&str, &str)] = &[
    ("ack-loss", "probability = 0.2\n"),
    ("clock-drift", "max_ppm = 100.0\n"),
    ("duty-cycle-limit", "fraction = 0.002\nwindow_s = 60.0\n"),
    ("node-reboots", "mean_interval_s = 3600.0\n"),
    ("processing-delay", "delay_s = 0.5\n"),
    ("queue-limit", "frames = 4\n"),
];

/// Keys for an example: those above, or, for an effect that is not among them, where its fit starts.
pub(super) fn keys(effect: &Listed) -> String {
    let name = effect.variant.name;
    let examples = match effect.of {
        "radio" => RADIO,
        "robots" => ROBOTS,
        _ => NETWORK,
    };
    if let Some((_, keys)) = examples.iter().find(|(known, _)| *known == name) {
        return (*keys).to_owned();
    }
    let mut keys = String::new();
    for (key, value) in effect.fit.variants.first().copied().unwrap_or_default() {
        let _ = match value {
            Fixed::Text(text) => writeln!(keys, "{key} = {text:?}"),
            Fixed::Number(number) => writeln!(keys, "{key} = {number:?}"),
            Fixed::Bool(truth) => writeln!(keys, "{key} = {truth}"),
        };
    }
    for parameter in effect.fit.parameters {
        let start = parameter.starts.first().copied().unwrap_or_default();
        let _ = writeln!(keys, "{} = {start:?}", parameter.key);
    }
    for field in effect.variant.fields {
        if matches!(field.default, Default::Required)
            && !keys.contains(&format!("{} = ", field.key))
        {
            let _ = writeln!(keys, "{} = {}", field.key, some_value(field));
        }
    }
    keys
}

/// A value that a required key may have.
fn some_value(field: &Field) -> String {
    let number = |kind: &Kind| match kind {
        Kind::Number(range) => range.nearest(1.0).unwrap_or(1.0),
        _ => 1.0,
    };
    match &field.kind {
        Kind::Bool => "true".to_owned(),
        Kind::Integer { min, .. } => min.to_string(),
        Kind::List { of, min, .. } => format!("{:?}", vec![number(of); *min]),
        Kind::Choice(choices) => format!("{:?}", choices.first().map_or("", |choice| choice.name)),
        Kind::Text | Kind::File => "\"…\"".to_owned(),
        kind => format!("{:?}", number(kind)),
    }
}
