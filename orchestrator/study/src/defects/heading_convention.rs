//! Headings by another convention than counter-clockwise from east.
//!
//! Where the model depends on headings, the likelihood under each convention is compared with that of the headings as they stand. A
//! constant offset alone would be an antenna mounted otherwise, so that only conventions that count clockwise are told by the radio.
//! Where nodes move, headings are compared with their directions of motion: if those agree as the headings stand, no convention is
//! wrong, whatever the radio.

use super::evidence::{Evidence, p_value_by_blocks};
use super::{Correction, Defect};
use crate::thresholds::{FEWEST_HEADING_MOMENTS, HEADING_AGREES, HEADING_TESTS, LEAST_HEADING_MPS};
use measure::links::LinkRow;
use physics::link::End;
use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The name of this kind.
pub const NAME: &str = "heading-convention";

/// A convention: in words, the heading counter-clockwise from east for one as it stands (rad), and whether it counts clockwise.
#[derive(Clone, Copy)]
struct Convention {
    words: &'static str,
    standard_rad: fn(f64) -> f64,
    is_clockwise: bool,
}

const CONVENTIONS: [Convention; 3] = [
    Convention {
        words: "clockwise from north",
        standard_rad: |heading| FRAC_PI_2 - heading,
        is_clockwise: true,
    },
    Convention {
        words: "clockwise from east",
        standard_rad: |heading| -heading,
        is_clockwise: true,
    },
    Convention {
        words: "counter-clockwise from north",
        standard_rad: |heading| heading + FRAC_PI_2,
        is_clockwise: false,
    },
];

/// The same direction from -π to π (rad).
fn wrapped(heading_rad: f64) -> f64 {
    heading_rad - TAU * ((heading_rad + PI) / TAU).floor()
}

fn converted(row: &LinkRow, convention: &Convention) -> LinkRow {
    let convert = |heading_rad: f64| wrapped((convention.standard_rad)(heading_rad));
    LinkRow {
        tx_heading_rad: convert(row.tx_heading_rad),
        rx_heading_rad: convert(row.rx_heading_rad),
        ..*row
    }
}

/// A heading and a direction of motion (rad), in a block.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moment {
    block: u32,
    heading_rad: f64,
    motion_rad: f64,
}

impl Moment {
    fn cosine(&self, convention: Option<&Convention>) -> f64 {
        let heading = convention.map_or(self.heading_rad, |it| (it.standard_rad)(self.heading_rad));
        libm::cos(heading - self.motion_rad)
    }
}

/// Moments at which a node moves whose heading is known, each once.
fn moments(evidence: &Evidence<'_>) -> Vec<Moment> {
    let mut seen = BTreeSet::new();
    let mut moments = Vec::new();
    for (row, measured) in evidence.rows().iter().enumerate() {
        let (tx, rx) = evidence.modelled().ends(row);
        for end in [tx, rx] {
            if let Some((heading_rad, motion_rad)) = motion(end)
                && seen.insert((measured.run, end.id, measured.time_s.to_bits()))
            {
                let block = evidence.blocks().dependent()[row];
                moments.push(Moment { block, heading_rad, motion_rad });
            }
        }
    }
    moments
}

/// Heading and direction of motion (rad).
fn motion(end: &End) -> Option<(f64, f64)> {
    let [x_mps, y_mps, _] = end.velocity_mps?;
    let is_moving = LEAST_HEADING_MPS < libm::hypot(x_mps, y_mps);
    is_moving.then_some((end.heading_rad?, libm::atan2(y_mps, x_mps)))
}

/// What the motion says of the headings.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ByMotion {
    /// They agree as they stand.
    Standard,
    /// They agree by this convention, with this p-value.
    Other(usize, f64),
    /// Nothing.
    Unknown,
}

fn by_motion(moments: &[Moment]) -> ByMotion {
    if moments.len() < FEWEST_HEADING_MOMENTS {
        return ByMotion::Unknown;
    }
    let mean = |convention: Option<&Convention>| {
        moments.iter().map(|moment| moment.cosine(convention)).sum::<f64>() / moments.len() as f64
    };
    if HEADING_AGREES <= mean(None) {
        return ByMotion::Standard;
    }
    let agrees = CONVENTIONS.iter().position(|convention| HEADING_AGREES <= mean(Some(convention)));
    agrees.map_or(ByMotion::Unknown, |index| {
        let convention = Some(&CONVENTIONS[index]);
        let gain = |moment: &Moment| moment.cosine(convention) - moment.cosine(None);
        let gains = moments.iter().map(|moment| (moment.block, gain(moment)));
        ByMotion::Other(index, p_value_by_blocks(gains))
    })
}

/// Looks for headings by another convention.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    let rows = evidence.rows();
    let has_heading =
        |row: &LinkRow| row.tx_heading_rad.is_finite() || row.rx_heading_rad.is_finite();
    let concerned: Vec<u32> =
        (0..rows.len() as u32).filter(|&row| has_heading(&rows[row as usize])).collect();
    let first = rows[*concerned.first()? as usize].line;
    let motion = by_motion(&moments(evidence));
    // Headings that agree with the motion are right, whatever a wrong antenna pattern makes the radio say.
    if motion == ByMotion::Standard {
        return None;
    }
    let mut best: Option<(usize, f64, f64, f64)> = None;
    for (index, convention) in CONVENTIONS.iter().enumerate() {
        let by_motion = match motion {
            ByMotion::Other(other, p_value) if other == index => Some(p_value),
            // The motion is evidence of one convention against all others.
            ByMotion::Other(..) => continue,
            _ => None,
        };
        let changed: Vec<LinkRow> = rows.iter().map(|row| converted(row, convention)).collect();
        let Some(other) = evidence.alternative(&changed, true) else { continue };
        let (gain, p_value) = evidence.gain(&other, &|_| true);
        let share = evidence.share_removed(&other, &|_| true);
        let p_value = match by_motion {
            // What the radio says may confirm the motion, not refute it.
            Some(by_motion) => by_motion.min(p_value),
            None if convention.is_clockwise => p_value,
            // A counter-clockwise convention differs by a constant angle, as an antenna mounted otherwise does.
            None => continue,
        };
        // The motion shows that all headings are wrong, also those on which no reading depends.
        let share = if by_motion.is_some() { 1.0 } else { share };
        if best.is_none_or(|(_, most, ..)| most < gain) {
            best = Some((index, gain, p_value, share));
        }
    }
    let (index, _, p_value, share) = best?;
    let convention = &CONVENTIONS[index];
    let replaced = concerned.iter().map(|&row| (row, converted(&rows[row as usize], convention)));
    let replaced: Vec<(u32, LinkRow)> = replaced.collect();
    Some(Defect {
        name: NAME,
        p_value: (HEADING_TESTS * p_value).min(1.0),
        share,
        estimates: Vec::new(),
        nodes: Vec::new(),
        runs: Vec::new(),
        n_rows: replaced.len(),
        first_line: first,
        clause: format!(
            "headings count {}, where counter-clockwise from east is expected",
            convention.words
        ),
        correction: Correction { replaced, ..Correction::default() },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodes that drive in all directions; `said`: the heading for a direction (rad).
    fn driving(said: impl Fn(f64) -> f64) -> Vec<Moment> {
        (0..200)
            .map(|k| {
                let motion_rad = wrapped(2.4 * f64::from(k));
                // Nobody drives exactly ahead.
                let aside_rad = 0.05 * libm::sin(f64::from(k));
                Moment { block: k / 10, heading_rad: said(motion_rad) + aside_rad, motion_rad }
            })
            .collect()
    }

    #[test]
    fn headings_of_each_convention_are_told_by_the_motion() {
        assert_eq!(by_motion(&driving(|motion| motion + 0.3)), ByMotion::Standard);
        let found = |said: fn(f64) -> f64| match by_motion(&driving(said)) {
            ByMotion::Other(index, p_value) if p_value < 1e-6 => Some(CONVENTIONS[index].words),
            _ => None,
        };
        assert_eq!(found(|motion| FRAC_PI_2 - motion), Some("clockwise from north"));
        assert_eq!(found(|motion| -motion), Some("clockwise from east"));
        assert_eq!(found(|motion| motion - FRAC_PI_2), Some("counter-clockwise from north"));
        // Nodes that drive sideways, and such whose heading has nothing to do with the motion.
        assert_eq!(found(|motion| motion + FRAC_PI_2 + 0.9), None);
        assert_eq!(found(|motion| 3.7 * motion), None);
    }

    #[test]
    fn few_moments_of_motion_show_nothing() {
        let moments = driving(|motion| -motion);
        assert_eq!(by_motion(&moments[..FEWEST_HEADING_MOMENTS - 1]), ByMotion::Unknown);
        assert!(matches!(
            by_motion(&moments[..FEWEST_HEADING_MOMENTS]),
            ByMotion::Unknown | ByMotion::Other(..)
        ));
    }

    #[test]
    fn directions_are_wrapped() {
        assert!((wrapped(1.5 * PI) + FRAC_PI_2).abs() < 1e-12);
        assert!((wrapped(-1.5 * PI) - FRAC_PI_2).abs() < 1e-12);
    }
}
