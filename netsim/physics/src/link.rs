//! What physics may ask about a link: its two ends, its channel, its moment, and what stands around it.
//!
//! The same description serves a running simulation, where agents are everywhere, and a row of measurements, where
//! little more than two positions is known.

pub use super::end::{End, distance_squared_m2};
use super::nearest::{Grid, Nearest};
use super::standard::o_qpsk_2450;
use proto::site::Site;
use proto::types::Covariate;

/// Speed of light in vacuum (m/s), exact by definition of the metre.
pub const SPEED_OF_LIGHT_MPS: f64 = 299_792_458.0;

/// Centre frequency (Hz) of an IEEE 802.15.4 channel of the 2.4 GHz band, 11 to 26: 2405 + 5 (k − 11) MHz
/// (IEEE Std 802.15.4-2006, § 6.1.2.1).
#[must_use]
pub fn channel_hz(channel: u8) -> f64 {
    o_qpsk_2450::CHANNELS.centre_hz(channel)
}

/// Numbers beside the geometry: temperature, battery, whatever a file or a robot simulator brings.
#[derive(Clone, Copy, Debug, Default)]
pub enum Covariates<'a> {
    /// None are known.
    #[default]
    None,
    /// One value per agent and name.
    Agents(&'a [Covariate]),
    /// The columns of one row of measurements: `temperature_c`, or `tx_temperature_c` and `rx_temperature_c`.
    Row(&'a [(String, f64)]),
    /// As [`Covariates::Row`], the names apart.
    Columns {
        /// Names of the columns.
        names: &'a [String],
        /// Their values, one each; NaN where one is missing.
        values: &'a [f64],
    },
}

impl Covariates<'_> {
    /// The value in the first column of a row whose name is wanted. `None` where there is no row, or none so named.
    #[must_use]
    pub fn column(&self, wanted: &dyn Fn(&str) -> bool) -> Option<f64> {
        match self {
            Self::None | Self::Agents(_) => None,
            Self::Row(columns) => {
                columns.iter().find(|(column, _)| wanted(column)).map(|&(_, value)| value)
            }
            Self::Columns { names, values } => {
                let index = names.iter().position(|column| wanted(column))?;
                values.get(index).copied().filter(|value| !value.is_nan())
            }
        }
    }
}

/// Which end of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The sender.
    Sender,
    /// The receiver.
    Receiver,
}

/// What stands around all links of a moment.
#[derive(Clone, Debug, Default)]
pub struct Scene<'a> {
    /// Walls and obstacles, where they are now.
    pub site: Option<&'a Site>,
    /// Every radio that is on, the ends of links among them. Bodies may block, and neighbours may be counted.
    pub agents: &'a [End],
    /// Who is near whom, where a model asked for it: see [`super::Model::prepare`].
    pub nearest: Option<Nearest>,
    /// The agents by place, where a model asked for it.
    pub grid: Option<Grid>,
    /// Values of further columns of measurements, or of numbers that robots bring, by name.
    pub covariates: Covariates<'a>,
    /// The measured run, where measurements are compared with the model.
    pub run: Option<u32>,
}

/// A link at a moment: everything that a physical effect may depend on.
#[derive(Clone, Copy, Debug)]
pub struct Link<'a> {
    /// The sender: position, heading and motion.
    pub sender: End,
    /// The receiver: position, heading and motion.
    pub receiver: End,
    /// Distance between the antennas (m), at least `min_distance_m`.
    pub distance_m: f64,
    /// IEEE 802.15.4 channel, 11 to 26, if it is known.
    pub channel: Option<u8>,
    /// Centre frequency (Hz) of the channel, or of the carrier where no channel is known.
    pub frequency_hz: f64,
    /// When the frame begins (ns).
    pub time_ns: u64,
    /// Surroundings of the link: walls, foliage, terrain and other nodes.
    pub scene: &'a Scene<'a>,
}

impl Link<'_> {
    /// Wavelength (m).
    #[must_use]
    pub fn wavelength_m(&self) -> f64 {
        SPEED_OF_LIGHT_MPS / self.frequency_hz
    }

    /// A named number at one end: of the agent there, or of the row with `tx_` or `rx_` before the name or without.
    #[must_use]
    pub fn covariate(&self, name: &str, side: Side) -> Option<f64> {
        match self.scene.covariates {
            Covariates::None => None,
            Covariates::Agents(columns) => {
                let id = match side {
                    Side::Sender => self.sender.id,
                    Side::Receiver => self.receiver.id,
                };
                let column = columns.iter().find(|column| column.name == name)?;
                column.values.get(id.index()).copied()
            }
            Covariates::Row(_) | Covariates::Columns { .. } => {
                let prefix = match side {
                    Side::Sender => "tx_",
                    Side::Receiver => "rx_",
                };
                let value_in = |wanted: &dyn Fn(&str) -> bool| self.scene.covariates.column(wanted);
                value_in(&|column| column.strip_prefix(prefix) == Some(name))
                    .or_else(|| value_in(&|column| column == name))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::ids::MoteId;

    #[test]
    fn channels_11_and_26_lie_at_2405_and_2480_mhz() {
        assert_eq!(channel_hz(11), 2.405e9);
        assert_eq!(channel_hz(26), 2.480e9);
    }

    #[test]
    fn a_row_names_an_end_by_prefix_and_otherwise_serves_both() {
        let names = ["tx_temperature_c".to_owned(), "temperature_c".to_owned()];
        let covariates = Covariates::Columns { names: &names, values: &[20.0, 5.0] };
        let scene = Scene { covariates, ..Scene::default() };
        let link = Link {
            sender: End::new(MoteId(0), [0.0; 3]),
            receiver: End::new(MoteId(1), [1.0, 0.0, 0.0]),
            distance_m: 1.0,
            channel: None,
            frequency_hz: 2.44e9,
            time_ns: 0,
            scene: &scene,
        };
        assert_eq!(link.covariate("temperature_c", Side::Sender), Some(20.0));
        assert_eq!(link.covariate("temperature_c", Side::Receiver), Some(5.0));
        assert_eq!(link.covariate("battery_v", Side::Receiver), None);
    }
}
