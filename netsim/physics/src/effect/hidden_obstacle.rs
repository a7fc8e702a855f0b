//! Something in the way that no map shows.

use super::{Effect, Entry};
use crate::link::Link;
use crate::sight::Path;
use proto::config::{Kind, Problem, Range, Section};
use proto::effect::{Catalogued, Level, Need, Search};
use proto::site::{Obstacle, Wall};

const POINT: Kind = Kind::List { of: &Kind::Number(Range::PLACE), min: 2, max: 2 };

/// `kind = "hidden-obstacle"`.
pub const ENTRY: Entry = Entry::new::<Keys>(check, |table, _| {
    let Keys { loss_db, from_m, to_m, centre_m, radius_m } = Keys::read(table);
    let extent = match (from_m.zip(to_m), centre_m.zip(radius_m)) {
        (Some((from_m, to_m)), _) => {
            Extent::Piece(Wall { from_m, to_m, height_m: None, material: None })
        }
        (None, Some((centre_m, radius_m))) => Extent::Disc(Obstacle {
            name: None,
            centre_m,
            radius_m,
            height_m: None,
            material: None,
        }),
        (None, None) => return None,
    };
    Some(Box::new(HiddenObstacle { loss_db, extent }))
});

/// An unmapped obstacle that attenuates all links that cross it: a straight segment (from_m, to_m) or a disc (centre_m, radius_m).
///
/// # Mechanism
///
/// A cupboard, a tank, a parked car or an unmapped wall obstructs every link that crosses it.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI - loss_db where the straight path, seen from above, touches the piece from from_m to to_m or the disc about
/// centre_m
/// ```
///
/// # Source
///
/// J. Wilson, N. Patwari, Radio tomographic imaging with wireless networks, IEEE Trans. Mobile Computing 9 (2010) 621; loss per
/// crossing as for walls (Motley and Keenan 1988).
///
/// # Validity
///
/// It has unlimited height and attenuates every link that touches it by the same loss. Use one effect per obstacle.
///
/// # Trace
///
/// All links that cross one place are weak, whatever their ends.
#[derive(Catalogued, Section)]
#[effect(
    name = "hidden-obstacle",
    makes = HiddenObstacle,
    needs = &[Need::Positions, Need::Readings],
    example = "loss_db = 8.0\nfrom_m = [10.0, -2.0]\nto_m = [10.0, 2.0]\n",
    level = Level::Place,
    generalises = &["wall-attenuation", "vegetation", "diffraction"],
    search = Search::Places,
    is_repeatable = true,
)]
struct Keys {
    /// Loss per crossing (dB).
    #[key(range = 0.0..=100.0)]
    #[fit(
        unit = "dB",
        range = 0.0..=40.0,
        starts = [5.0],
        step = 0.05,
        null = 0.0,
        plausible = 0.1..=60.0,
        source = "ITU-R P.2040: from thin plasterboard to reinforced concrete",
    )]
    loss_db: f64,
    /// One end of the segment (x, y in m).
    #[key(kind = POINT)]
    from_m: Option<[f64; 2]>,
    /// The other end of the segment (x, y in m).
    #[key(kind = POINT)]
    to_m: Option<[f64; 2]>,
    /// Centre of the disc (x, y in m).
    #[key(kind = POINT)]
    centre_m: Option<[f64; 2]>,
    /// Radius of the disc (m).
    #[key(range = Range::LENGTH)]
    radius_m: Option<f64>,
}

fn check(table: &toml::Table, path: &str, problems: &mut Vec<Problem>) {
    let has = ["from_m", "to_m", "centre_m", "radius_m"].map(|key| table.contains_key(key));
    match has {
        [true, true, false, false] => {
            if table["from_m"] == table["to_m"] {
                problems.push(
                    Problem::new(
                        format!("{path}.to_m"),
                        "must differ from from_m, because the segment has a length",
                    )
                    .value(&table["to_m"]),
                );
            }
        }
        [false, false, true, true] => {}
        _ => problems.push(Problem::new(
            path,
            "must have either from_m and to_m (a segment), or centre_m and radius_m (a disc)",
        )),
    }
}

/// Where a hidden obstacle stands.
#[derive(Clone, Debug, PartialEq)]
pub enum Extent {
    /// Along a straight piece.
    Piece(Wall),
    /// Within a disc.
    Disc(Obstacle),
}

/// An attenuator that is on no map.
///
/// # Model
///
/// RSSI′ = RSSI − L for links whose direct path, seen from above, touches it: a wall of Motley and Keenan (1988) found by
/// what the links that cross it lose, as in radio tomographic imaging (Wilson and Patwari 2010).
///
/// # Validity
///
/// It has no top, takes the same from every link that touches it, and nothing from those that pass close by.
#[derive(Clone, Debug, PartialEq)]
pub struct HiddenObstacle {
    /// Loss per crossing (dB).
    pub loss_db: f64,
    /// Where it stands.
    pub extent: Extent,
}

impl Effect for HiddenObstacle {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        let path = Path::direct(link);
        let is_cut = match &self.extent {
            Extent::Piece(wall) => path.is_cut_by_wall(wall),
            Extent::Disc(obstacle) => path.is_cut_by_obstacle(obstacle),
        };
        if is_cut { -self.loss_db } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::{along_x, made, problems};
    use crate::link::Scene;

    #[test]
    fn it_takes_its_loss_from_the_links_that_touch_it() {
        let scene = Scene::default();
        for (keys, crosses, misses) in [
            ("from_m = [5.0, -1.0]\nto_m = [5.0, 1.0]", 10.0, 4.9),
            ("centre_m = [5.0, 2.0]\nradius_m = 2.0", 10.0, 4.9),
            ("centre_m = [5.0, 0.0]\nradius_m = 1.0", 4.0, 3.9),
        ] {
            let effect = made(ENTRY.variant.name, &format!("loss_db = 7.5\n{keys}"));
            assert_eq!(effect.contribution_db(&along_x(crosses, 1.0, None, &scene)), -7.5);
            assert_eq!(effect.contribution_db(&along_x(misses, 1.0, None, &scene)), 0.0);
        }
    }

    #[test]
    fn it_is_a_piece_or_a_disc() {
        for keys in ["", "from_m = [1, 2]", "from_m = [1, 2]\nradius_m = 2", "centre_m = [0, 0]"] {
            let problems = problems(ENTRY.variant.name, &format!("loss_db = 1\n{keys}"));
            assert!(problems.contains("must have either from_m and to_m"), "{keys}: {problems}");
        }
        let same = problems(ENTRY.variant.name, "loss_db = 1\nfrom_m = [1, 2]\nto_m = [1, 2]");
        assert!(same.contains("to_m: must differ from from_m"), "{same}");
    }
}
