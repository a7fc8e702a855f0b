//! The hidden effects of a link campaign: what each does to each row at a given strength.

use super::Truth;
use super::draws::Draws;
use super::field::{Kernel, pair_field};
use super::geometry::{Point, crossing, distance, foot, share_inside, touches};
use super::hidden::Hidden;
use super::radio;
use super::world::{Row, World, rounded};
use std::f64::consts::TAU;

/// An effect whose shape is drawn, and whose strength is not yet.
pub(crate) struct Effect {
    pub(crate) hidden: Hidden,
    /// Per row, what it adds at strength 1 (dB), where that is proportional to strength.
    unit: Vec<f64>,
    /// Parameters that do not follow from its strength.
    shape: Vec<(&'static str, f64)>,
    /// Choices that are no numbers.
    choices: Vec<(&'static str, String)>,
    /// Two standard normal draws per row, for fading.
    scattered: Vec<[f64; 2]>,
}

/// What an effect does to the rows. Empty: nothing of that kind.
#[derive(Clone, Debug, Default)]
pub(crate) struct Change {
    /// Added to the received power, per row (dB).
    pub(crate) power_db: Vec<f64>,
    /// What of it is a random draw.
    pub(crate) random: Option<Random>,
    /// Probability that a frame is lost for another reason than its strength, per row.
    pub(crate) loss: Vec<f64>,
    /// Another curve of reception.
    pub(crate) curve: Option<Curve>,
    /// Another register.
    pub(crate) register: Option<Register>,
}

/// The law of a random contribution.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Random {
    /// Per sender and receiver: variances (dB²).
    Nodes([f64; 2]),
    /// Per unordered pair.
    Pairs(Kernel),
    /// Per frame and receiver: Rician with this K (dB).
    Fading(f64),
}

/// Reception over received power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Curve {
    /// The table, to the right by this much (dB).
    Table(f64),
    /// Logistic: the power of one half (dBm) and its scale (dB).
    Logistic(f64, f64),
}

impl Curve {
    /// Probability of reception at a received power (dBm).
    pub(crate) fn probability(self, power_dbm: f64) -> f64 {
        match self {
            Self::Table(shift_db) => radio::table(power_dbm - shift_db),
            Self::Logistic(half_dbm, width_db) => {
                1.0 / (1.0 + (-(power_dbm - half_dbm) / width_db).exp())
            }
        }
    }
}

/// What is read at a received power: compressed above some level, then shifted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Register {
    saturation_dbm: f64,
    slope: f64,
    shift_db: f64,
}

impl Register {
    /// One that reads what is received.
    pub(crate) const EXACT: Self =
        Self { saturation_dbm: f64::INFINITY, slope: 1.0, shift_db: 0.0 };

    /// The reading (dBm), not yet rounded, at a received power.
    pub(crate) fn reading(self, power_dbm: f64) -> f64 {
        let above = (power_dbm - self.saturation_dbm).max(0.0);
        power_dbm - (1.0 - self.slope) * above + self.shift_db
    }

    /// The received power (dBm) of a reading.
    pub(crate) fn power(self, reading_dbm: f64) -> f64 {
        let compressed = reading_dbm - self.shift_db;
        let above = (compressed - self.saturation_dbm).max(0.0);
        compressed + above * (1.0 / self.slope - 1.0)
    }
}

impl Effect {
    /// Draws the shape of an effect.
    pub(crate) fn new(hidden: Hidden, seed: u64, world: &World) -> Self {
        let mut draws = Draws::new(seed, &format!("effect {hidden:?}"));
        let mut effect = Self {
            hidden,
            unit: Vec::new(),
            shape: Vec::new(),
            choices: Vec::new(),
            scattered: Vec::new(),
        };
        effect.draw(&mut draws, world);
        effect
    }

    fn draw(&mut self, draws: &mut Draws, world: &World) {
        let each = |of: &dyn Fn(&Row) -> f64| world.rows.iter().map(of).collect::<Vec<f64>>();
        let middle_s = world.duration_s / 2.0;
        match self.hidden {
            Hidden::SystemGain => {
                self.unit = vec![if draws.chance(0.5) { 1.0 } else { -1.0 }; world.rows.len()];
                let register_only = draws.chance(0.25);
                self.choices.push(("register_only", register_only.to_string()));
            }
            Hidden::PathLossExponent => {
                self.shape.push(("reference_distance_m", 1.0));
                self.unit = each(&|row| -10.0 * row.distance_m().max(1.0).log10());
            }
            Hidden::TwoRayGround => {
                let polarization = if draws.chance(0.5) { "vertical" } else { "horizontal" };
                self.choices.push(("polarization", polarization.to_owned()));
            }
            Hidden::WallAttenuation => self.unit = each(&|row| -walls_crossed(world, row)),
            Hidden::HiddenScreen => self.draw_screen(draws, world),
            Hidden::HiddenDisc => self.draw_disc(draws, world),
            Hidden::Vegetation => {
                self.unit = each(&|row| {
                    let [a, b] = [row.tx_at.plane_m, row.rx_at.plane_m];
                    let share: f64 =
                        world.foliage.iter().map(|polygon| share_inside(a, b, polygon)).sum();
                    -row.distance_m() * share
                });
            }
            Hidden::BodyBlocking => {
                let radius_m = rounded(draws.between(0.3, 0.6), 2);
                self.shape.push(("blocker_radius_m", radius_m));
                self.unit = each(&|row| -blockers(world, row, radius_m));
            }
            Hidden::AntennaPattern => {
                let boresight_rad = rounded(draws.between(-3.0, 3.0), 2);
                self.shape.push(("boresight_rad", boresight_rad));
                let still: Vec<f64> = (0..world.n_fixed).map(|_| draws.between(0.0, TAU)).collect();
                self.unit = each(&|row| cardioids(row, boresight_rad, &still));
            }
            Hidden::NodeOffset => {
                let ratio = draws.between(0.6, 1.4);
                self.shape.push(("rx_per_tx", ratio));
                let offsets: Vec<[f64; 2]> =
                    (0..world.n_nodes).map(|_| [draws.normal(), ratio * draws.normal()]).collect();
                self.unit = each(&|row| offsets[row.tx][0] + offsets[row.rx][1]);
            }
            Hidden::Shadowing => {
                let decorrelation_m = rounded(draws.between(4.0, 15.0), 1);
                self.shape.push(("decorrelation_m", decorrelation_m));
                self.unit =
                    pair_field(world, Kernel::Place { variance: 1.0, decorrelation_m }, draws);
            }
            Hidden::Multipath => {
                let coherence_mhz = rounded(draws.between(4.0, 20.0), 1);
                self.shape.push(("coherence_mhz", coherence_mhz));
                let kernel = Kernel::Frequency { variance: 1.0, coherence_mhz };
                self.unit = pair_field(world, kernel, draws);
            }
            Hidden::FastFading => {
                self.scattered =
                    world.rows.iter().map(|_| [draws.normal(), draws.normal()]).collect();
            }
            Hidden::Interference => {
                self.shape.push(("centre_mhz", [2412.0, 2437.0, 2462.0][draws.below(3)]));
                self.shape.push(("width_mhz", 22.0));
            }
            Hidden::ReceptionCurve => {
                self.shape.push(("width_db", rounded(draws.between(0.4, 2.5), 2)));
            }
            Hidden::ReceiverNonlinearity => {
                self.shape.push(("slope", rounded(draws.between(0.1, 0.4), 2)));
            }
            Hidden::Temperature => {
                self.shape.push(("reference_c", 25.0));
                self.unit = each(&|row| 25.0 - row.temperature_c);
            }
            Hidden::BatterySag => {
                let n_sagging = world.n_nodes / 3 + draws.below(3);
                let mut nodes = draws.order(world.n_nodes);
                nodes.truncate(n_sagging);
                nodes.sort_unstable();
                self.unit = each(&|row| {
                    if nodes.contains(&row.tx) { -row.time_s / 3600.0 } else { 0.0 }
                });
                self.choices.push(("nodes", format!("{nodes:?}")));
            }
            Hidden::NoiseFloor
            | Hidden::MotionFading
            | Hidden::Diffraction
            | Hidden::HumidityLoss => {}
            Hidden::HumiditySquared => {
                self.unit = each(&|row| -((row.humidity_pct - 60.0) / 10.0).powi(2));
            }
            Hidden::Sinusoid => {
                let phase = draws.between(0.0, TAU);
                self.unit = each(&|row| (1.5 * TAU * row.time_s / world.duration_s + phase).sin());
            }
            Hidden::SenderSpeed => self.unit = each(&|row| -row.tx_at.speed_mps),
            Hidden::Dust => self.unit = each(&|row| (60.0 - row.dust_ugm3) / 10.0),
            Hidden::Step => {
                let from_s = middle_s * draws.between(0.7, 1.3);
                self.unit = each(&|row| if row.time_s < from_s { 0.0 } else { -1.0 });
            }
            Hidden::EastGradient => {
                let sign = if draws.chance(0.5) { 0.1 } else { -0.1 };
                self.unit = each(&|row| sign * (row.rx_at.plane_m[0] - world.extent_m[0] / 2.0));
            }
        }
    }

    /// A screen: of some places, that where nearest to a third of the paths cross it.
    fn draw_screen(&mut self, draws: &mut Draws, world: &World) {
        let screens = (0..40).map(|_| {
            let centre = world.extent_m.map(|extent_m| draws.between(0.2, 0.8) * extent_m);
            let half_m = draws.between(4.0, 12.0);
            let (sin, cos) = draws.between(0.0, TAU).sin_cos();
            [-half_m, half_m].map(|along_m| {
                [rounded(centre[0] + along_m * cos, 2), rounded(centre[1] + along_m * sin, 2)]
            })
        });
        let blocked = |screen: &[Point; 2]| {
            blocked(world, |a, b| crossing(a, b, screen[0], screen[1]).is_some())
        };
        let [from, to] = nearest_to_a_third(screens, blocked);
        self.unit = blocked(&[from, to]);
        self.shape.extend([("from_x_m", from[0]), ("from_y_m", from[1])]);
        self.shape.extend([("to_x_m", to[0]), ("to_y_m", to[1])]);
    }

    /// A disc: of some places, that where nearest to a third of the paths touch it. No fixed node is in it.
    fn draw_disc(&mut self, draws: &mut Draws, world: &World) {
        let fixed = &world.frames[0][..world.n_fixed];
        let discs = (0..40).map(|_| {
            let centre =
                world.extent_m.map(|extent_m| rounded(draws.between(0.2, 0.8) * extent_m, 2));
            let clear_m = fixed.iter().map(|at| distance(at.plane_m, centre)).fold(7.0, f64::min);
            (centre, rounded((clear_m - 0.5).max(0.1), 2))
        });
        let blocked = |&(centre, radius_m): &(Point, f64)| {
            blocked(world, |a, b| touches(a, b, centre, radius_m))
        };
        let (centre, radius_m) = nearest_to_a_third(discs, blocked);
        self.unit = blocked(&(centre, radius_m));
        self.shape.extend([("centre_x_m", centre[0]), ("centre_y_m", centre[1])]);
        self.shape.push(("radius_m", radius_m));
    }

    fn shape(&self, name: &str) -> f64 {
        let found = self.shape.iter().find(|(other, _)| *other == name);
        found.unwrap_or_else(|| panic!("{:?} has no {name}", self.hidden)).1
    }

    fn has_chosen(&self, name: &str, value: &str) -> bool {
        self.choices.iter().any(|(other, chosen)| *other == name && chosen == value)
    }

    /// Strengths to try, the weakest first.
    pub(crate) fn strengths(&self) -> Vec<f64> {
        let steps = |from: f64, to: f64, n: u32| {
            (0..=n).map(|k| from + (to - from) * f64::from(k) / f64::from(n)).collect()
        };
        match self.hidden {
            Hidden::FastFading => steps(0.0, 45.0, 45),
            Hidden::Interference => steps(0.0, 0.98, 14),
            Hidden::NoiseFloor => steps(0.0, 20.0, 20),
            Hidden::ReceptionCurve => steps(-6.0, 15.0, 42),
            Hidden::ReceiverNonlinearity => steps(0.0, 60.0, 60),
            Hidden::MotionFading => steps(0.0, 40.0, 20),
            Hidden::Diffraction => steps(0.3, 8.0, 40),
            Hidden::HumidityLoss => steps(0.0, 3.0, 20),
            Hidden::TwoRayGround => (0..40).map(|k| 79.0 * 0.65_f64.powi(39 - k)).collect(),
            _ => (0..60).map(|k| 0.001 * 1.2_f64.powi(k)).collect(),
        }
    }

    /// What it does at a strength.
    pub(crate) fn change(&self, strength: f64, world: &World) -> Change {
        let each = |of: &dyn Fn(&Row) -> f64| world.rows.iter().map(of).collect::<Vec<f64>>();
        let mut change = Change::default();
        match self.hidden {
            Hidden::TwoRayGround => {
                let vertical = self.has_chosen("polarization", "vertical");
                change.power_db = each(&|row| {
                    let heights = [row.tx_at.z_m, row.rx_at.z_m];
                    radio::two_ray_db(
                        row.planar_m(),
                        heights,
                        row.channel,
                        1.0 + strength,
                        vertical,
                    )
                });
            }
            Hidden::Diffraction => {
                change.power_db = each(&|row| -edges_db(world, row, strength));
            }
            Hidden::FastFading => {
                let k_factor_db = 30.0 - strength;
                let fading = |&pair: &[f64; 2]| radio::rician_db(k_factor_db, pair);
                change.power_db = self.scattered.iter().map(fading).collect();
                change.random = Some(Random::Fading(k_factor_db));
            }
            Hidden::Interference => {
                let half_mhz = self.shape("width_mhz") / 2.0;
                let centre_mhz = self.shape("centre_mhz");
                change.loss = each(&|row| {
                    let off_mhz = (radio::centre_mhz(row.channel) - centre_mhz).abs();
                    if off_mhz <= half_mhz { strength } else { 0.0 }
                });
            }
            Hidden::MotionFading => {
                change.loss = each(&|row| {
                    radio::motion_loss(relative_speed_mps(row), row.channel, 20.0 - strength)
                });
            }
            Hidden::HumidityLoss => {
                change.loss =
                    each(&|row| (strength * (row.humidity_pct - 35.0) / 50.0).clamp(0.0, 0.98));
            }
            Hidden::NoiseFloor => change.curve = Some(Curve::Table(strength)),
            Hidden::ReceptionCurve => {
                change.curve = Some(Curve::Logistic(-93.6 + strength, self.shape("width_db")));
            }
            Hidden::ReceiverNonlinearity => {
                let saturation_dbm = -40.0 - strength;
                let slope = self.shape("slope");
                change.register = Some(Register { saturation_dbm, slope, shift_db: 0.0 });
            }
            Hidden::SystemGain if self.has_chosen("register_only", "true") => {
                let shift_db = strength * self.unit[0];
                change.register = Some(Register { shift_db, ..Register::EXACT });
            }
            _ => {
                change.power_db = self.unit.iter().map(|unit| strength * unit).collect();
                let variance = strength * strength;
                change.random = match self.hidden {
                    Hidden::NodeOffset => {
                        Some(Random::Nodes([variance, variance * self.shape("rx_per_tx").powi(2)]))
                    }
                    Hidden::Shadowing => {
                        let decorrelation_m = self.shape("decorrelation_m");
                        Some(Random::Pairs(Kernel::Place { variance, decorrelation_m }))
                    }
                    Hidden::Multipath => {
                        let coherence_mhz = self.shape("coherence_mhz");
                        Some(Random::Pairs(Kernel::Frequency { variance, coherence_mhz }))
                    }
                    _ => None,
                };
            }
        }
        change
    }

    /// What was hidden, in the terms of the catalogue. `size`: how large it became.
    pub(crate) fn truth(&self, strength: f64, size: f64) -> Truth {
        let mut parameters = self.shape.clone();
        match self.hidden {
            Hidden::SystemGain => parameters.push(("gain_db", strength * self.unit[0])),
            Hidden::PathLossExponent => parameters.push(("exponent", 2.0 + strength)),
            Hidden::TwoRayGround => parameters.push(("relative_permittivity", 1.0 + strength)),
            Hidden::WallAttenuation
            | Hidden::HiddenScreen
            | Hidden::HiddenDisc
            | Hidden::BodyBlocking => parameters.push(("loss_db", strength)),
            Hidden::Vegetation => parameters.push(("db_per_m", -strength)),
            Hidden::AntennaPattern => parameters.push(("front_to_back_db", strength)),
            Hidden::NodeOffset => {
                parameters =
                    vec![("tx_sd_db", strength), ("rx_sd_db", strength * self.shape("rx_per_tx"))];
            }
            Hidden::Shadowing | Hidden::Multipath => parameters.push(("sd_db", strength)),
            Hidden::FastFading => parameters.push(("k_factor_db", 30.0 - strength)),
            Hidden::Interference => parameters.push(("duty", strength)),
            Hidden::NoiseFloor => parameters.push(("shift_db", strength)),
            Hidden::ReceptionCurve => parameters.push(("p50_dbm", -93.6 + strength)),
            Hidden::ReceiverNonlinearity => parameters.push(("saturation_dbm", -40.0 - strength)),
            Hidden::Temperature => parameters.push(("db_per_c", -strength)),
            Hidden::BatterySag => parameters.push(("db_per_hour", -strength)),
            Hidden::MotionFading => parameters.push(("rician_k_db", 20.0 - strength)),
            Hidden::Diffraction => parameters.push(("scale", 1.0)),
            Hidden::HumiditySquared
            | Hidden::Sinusoid
            | Hidden::SenderSpeed
            | Hidden::Dust
            | Hidden::Step
            | Hidden::EastGradient
            | Hidden::HumidityLoss => parameters.push(("coefficient", strength)),
        }
        Truth {
            effect: self.hidden.effect(),
            covariates: self.hidden.covariates(),
            parameters,
            choices: self.choices.clone(),
            size,
        }
    }
}

/// Of some places the one that blocks nearest to a third of the paths.
fn nearest_to_a_third<T>(places: impl Iterator<Item = T>, blocked: impl Fn(&T) -> Vec<f64>) -> T {
    let off = |place: &T| {
        let unit = blocked(place);
        (unit.iter().sum::<f64>() / unit.len() as f64 + 1.0 / 3.0).abs()
    };
    let scored = places.map(|place| (off(&place), place));
    scored.min_by(|a, b| a.0.total_cmp(&b.0)).expect("some places").1
}

/// Per row -1 where the direct path is blocked, else 0.
fn blocked(world: &World, is_blocked: impl Fn(Point, Point) -> bool) -> Vec<f64> {
    let one = |row: &Row| is_blocked(row.tx_at.plane_m, row.rx_at.plane_m);
    world.rows.iter().map(|row| if one(row) { -1.0 } else { 0.0 }).collect()
}

/// Mapped walls that the direct path crosses.
fn walls_crossed(world: &World, row: &Row) -> f64 {
    let [a, b] = [row.tx_at.plane_m, row.rx_at.plane_m];
    let walls = world.walls.iter();
    walls.filter(|wall| crossing(a, b, wall.from_m, wall.to_m).is_some()).count() as f64
}

/// Other nodes whose body, of this radius, reaches into the first Fresnel zone in the plane, between the ends.
fn blockers(world: &World, row: &Row, radius_m: f64) -> f64 {
    let [a, b] = [row.tx_at.plane_m, row.rx_at.plane_m];
    let length_m = distance(a, b);
    let wavelength_m = radio::wavelength_m(row.channel);
    let all = world.frames[row.frame].iter().enumerate();
    all.filter(|&(node, at)| {
        let (off_m, along) = foot(a, b, at.plane_m);
        let from_ends_m = [along * length_m, (1.0 - along) * length_m];
        node != row.tx
            && node != row.rx
            && (0.0..=1.0).contains(&along)
            && off_m < radius_m + radio::fresnel_m(from_ends_m, wavelength_m)
    })
    .count() as f64
}

/// Two cardioids of 1 dB from front to back. `still`: headings of those that report none.
pub(crate) fn cardioids(row: &Row, boresight_rad: f64, still: &[f64]) -> f64 {
    let [a, b] = [row.tx_at.plane_m, row.rx_at.plane_m];
    let bearing = (b[1] - a[1]).atan2(b[0] - a[0]);
    let loss = |bearing: f64, node: usize, heading: Option<f64>| {
        let heading = heading.unwrap_or_else(|| still[node]);
        -0.5 * (1.0 - (bearing - heading - boresight_rad).cos())
    };
    loss(bearing, row.tx, row.tx_at.heading_rad)
        + loss(bearing + TAU / 2.0, row.rx, row.rx_at.heading_rad)
}

/// Loss over the tops of the mapped walls (dB).
fn edges_db(world: &World, row: &Row, height_m: f64) -> f64 {
    let [a, b] = [row.tx_at.plane_m, row.rx_at.plane_m];
    let length_m = row.distance_m();
    let wavelength_m = radio::wavelength_m(row.channel);
    let loss = |along: f64| {
        let path_m = row.tx_at.z_m + along * (row.rx_at.z_m - row.tx_at.z_m);
        let from_ends_m = [along * length_m, (1.0 - along) * length_m];
        radio::knife_edge_db(radio::nu(height_m - path_m, from_ends_m, wavelength_m))
    };
    world.walls.iter().filter_map(|wall| crossing(a, b, wall.from_m, wall.to_m)).map(loss).sum()
}

/// How fast the ends move against each other (m/s).
fn relative_speed_mps(row: &Row) -> f64 {
    let [tx, rx] = [row.tx_at, row.rx_at].map(|at| {
        let (sin, cos) = at.heading_rad.unwrap_or(0.0).sin_cos();
        [at.speed_mps * cos, at.speed_mps * sin]
    });
    distance(tx, rx)
}
