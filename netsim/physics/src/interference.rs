//! Interference model: how simultaneous frames affect each other.
//!
//! One file per rule, one list: `BUILT_IN`. A rule says by which factor interference lowers the probability that a frame is
//! received. What noise alone does is not its business: that is the probability which the reception curve, or the
//! connectivity model, has given already. So the factor compares reception under noise and interference with reception
//! under noise, is 1 where nobody interferes, and noise is counted once.

pub mod fsk;
pub mod o_qpsk;
pub mod table;

use proto::config::{Registered, Registry, Section, TableSpec, Tag, Variant, Variants};

/// How interference decides. Stateless.
pub trait Rule: Send + Sync + std::fmt::Debug {
    /// What a frame that is received with this power (dBm) adds to the interference with another (mW). Contributions add
    /// up.
    fn disturbance_mw(&self, rssi_dbm: f64) -> f64;

    /// The factor, 0 to 1, by which interference lowers the probability that a frame is received. Factors of successive
    /// stretches are multiplied.
    ///
    /// * `signal_dbm`: power of the frame (dBm).
    /// * `interference_mw`: sum of all disturbances (mW), constant over the stretch.
    /// * `stretch_ns`: how much of the frame it concerns (ns).
    /// * `frame_ns`: the whole frame (ns).
    fn survival(
        &self,
        signal_dbm: f64,
        interference_mw: f64,
        stretch_ns: i64,
        frame_ns: i64,
    ) -> f64;

    /// By how much (dB) a frame must be stronger than one that a receiver has just locked on to, for the receiver to turn to
    /// it within the other's synchronisation header. Infinite: it never does.
    fn capture_db(&self) -> f64;

    /// Whether interference keeps receivers from noticing a frame at all. Otherwise only noise does.
    fn hides_preambles(&self) -> bool;
}

/// Interference as configured.
#[derive(Debug)]
pub struct Interference {
    /// The rule by which simultaneous frames affect each other.
    pub rule: Box<dyn Rule>,
    /// Frames received with less power (dBm) do not disturb others; `None`: those too weak to be received do not.
    pub horizon_dbm: Option<f64>,
}

/// Description of `[netsim.phy.interference]`.
pub const SPEC: TableSpec = Keys::SPEC;

/// Interference model: how simultaneous frames affect each other.
#[derive(Section)]
#[section(tag = TAG)]
struct Keys {
    /// Frames that arrive with less than this power (dBm) cause no interference. Absent: frames too weak to be received cause none.
    /// Lower values extend the interference range of every mote, and the run time.
    #[key(range = -200.0..=0.0)]
    horizon_dbm: Option<f64>,
}

/// The key that selects a rule.
pub const TAG: Tag = Tag {
    key: "kind",
    doc: "The rule.",
    default: Some(o_qpsk::ENTRY.variant.name),
    variants: Variants::List(LIST),
};

/// The noise against which a rule weighs disturbances.
#[derive(Section)]
struct Noise {
    /// Noise power in the receiver's channel (dBm). -105: the 6TiSCH simulator's.
    #[key(range = -200.0..=0.0, default = -105.0)]
    noise_floor_dbm: f64,
}

/// A rule that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// Makes it of its checked table.
    pub build: fn(&toml::Table) -> Option<Box<dyn Rule>>,
}

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// What descriptions call the list of rules.
pub(crate) const LIST: &str = "netsim.phy.interference";

/// The rules that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[o_qpsk::ENTRY, table::ENTRY, fsk::ENTRY];

/// Makes interference of a checked table. `None`: the rule is none that is known, which the check has reported.
#[must_use]
pub fn build(table: &toml::Table, known: &Registry<Entry>) -> Option<Interference> {
    let rule = (known.selected(table, &TAG)?.build)(table)?;
    let Keys { horizon_dbm } = Keys::read(table);
    Some(Interference { rule, horizon_dbm })
}

/// Power (mW) of a level (dBm).
#[inline]
#[must_use]
pub fn milliwatts(level_dbm: f64) -> f64 {
    libm::pow(10.0, level_dbm / 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::config::{Lists, check, parse};

    fn parse_and_build(text: &str) -> Interference {
        let known = Registry::new(BUILT_IN);
        let lists = Lists::default().with(LIST, &known);
        let checked = check(&parse(text).unwrap(), "", &SPEC, &lists, &mut Vec::new());
        build(&checked.table, &known).unwrap()
    }

    #[test]
    fn o_qpsk_is_the_default() {
        let interference = parse_and_build("");
        assert!(format!("{:?}", interference.rule).starts_with("OQpsk"));
        assert_eq!(interference.horizon_dbm, None);
    }

    #[test]
    fn rules_are_selected_by_kind() {
        let interference =
            parse_and_build("kind = \"table\"\nnoise_floor_dbm = -100.0\nhorizon_dbm = -110.0");
        assert!(format!("{:?}", interference.rule).starts_with("ByTable"));
        assert_eq!(interference.horizon_dbm, Some(-110.0));
        // 10 dB above -100 dBm: a disturbance that loses the noise within it.
        let expected = milliwatts(-90.0) - milliwatts(-100.0);
        assert!((interference.rule.disturbance_mw(-90.0) / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn without_interference_nothing_is_lost_to_it() {
        for (text, is_table) in [("", false), ("kind = \"table\"", true)] {
            let rule = parse_and_build(text).rule;
            for signal_dbm in [-120.0, -104.0, -95.0, -80.0, -10.0] {
                let factor = rule.survival(signal_dbm, 0.0, 4_256_000, 4_256_000);
                // Where the table has 0 even without interference, there is nothing to lose.
                assert!(factor == 1.0 || factor == 0.0 && is_table, "{signal_dbm}");
            }
        }
    }

    #[test]
    fn more_interference_and_longer_overlap_never_help() {
        for text in ["", "kind = \"table\""] {
            let rule = parse_and_build(text).rule;
            for signal_dbm in [-95.0, -80.0, -60.0] {
                let mut before = 1.0;
                for step in 0..600 {
                    let disturbance =
                        rule.disturbance_mw(signal_dbm - 40.0 + f64::from(step) / 10.0);
                    let whole = rule.survival(signal_dbm, disturbance, 4_256_000, 4_256_000);
                    let half = rule.survival(signal_dbm, disturbance, 2_128_000, 4_256_000);
                    assert!((0.0..=1.0).contains(&whole) && whole <= half + 1e-12);
                    // Rounding of an alternating sum of terms up to 10^4.
                    assert!(whole <= before + 1e-9, "{text} {signal_dbm} {step}");
                    assert!((half * half - whole).abs() < 1e-9, "stretches multiply");
                    before = whole;
                }
                assert!(before < 1e-12, "20 dB stronger interference leaves nothing");
            }
        }
    }

    /// Rows of the guide's table: one other frame over the whole of a frame that arrives with -60 dBm.
    #[test]
    fn the_guide_has_these_figures() {
        let guide = include_str!("../../../docs/radio.md");
        let (o_qpsk, table) = (parse_and_build("").rule, parse_and_build("kind = \"table\"").rule);
        let figure = |rule: &dyn Rule, other_dbm: f64, bytes: i64| {
            let frame_ns = 32_000 * (6 + bytes);
            let factor = rule.survival(-60.0, rule.disturbance_mw(other_dbm), frame_ns, frame_ns);
            let text = format!("{factor:.3}");
            text.strip_suffix(".000").map(str::to_owned).unwrap_or(text)
        };
        for other in [60, 61, 62, 63, 64, 65, 67, 68, 70, 72, 75, 80, 85, 86, 90] {
            let other_dbm = -f64::from(other);
            let row = format!(
                "| −{other} | {} | {} | {} | {} |",
                other - 60,
                figure(&*table, other_dbm, 127),
                figure(&*o_qpsk, other_dbm, 127),
                figure(&*o_qpsk, other_dbm, 20),
            );
            assert!(guide.contains(&row), "{row}");
        }
    }
}
