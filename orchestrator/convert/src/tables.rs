//! The tables that logs become, and their columns.

use measure::table::DataTable;
use measure::{Rejected, links, packets, robots};
use proto::config::{Choice, Default, Field, Key as _, OneOf, Section, TableSpec};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A table of measurements.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TableKind {
    /// Link samples, or an aggregated link table.
    Links,
    /// Robot samples.
    Robots,
    /// Packets from end to end.
    Packets,
}

/// What the values of a column are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// A number.
    Number,
    /// A time.
    Time,
    /// A node or a robot, by number or name.
    Label,
    /// A heading, which a log may write as a quaternion.
    Heading,
}

/// A column that a mapping can fill.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its name.
    pub name: &'static str,
    /// What its values are.
    pub content: Content,
    /// The tables that have it.
    tables: &'static [TableKind],
    /// It is computed with, and not written.
    pub is_intermediate: bool,
    /// What a mapping should know of it.
    doc: &'static str,
}

use Content::{Heading, Label, Number, Time};
const LINKS: &[TableKind] = &[TableKind::Links];
const ROBOTS: &[TableKind] = &[TableKind::Robots];
const PACKETS: &[TableKind] = &[TableKind::Packets];
const PLACED: &[TableKind] = &[TableKind::Links, TableKind::Robots];
const NUMBERED: &[TableKind] = &[TableKind::Links, TableKind::Packets];
const ALL: &[TableKind] = &[TableKind::Links, TableKind::Robots, TableKind::Packets];

/// Columns by the tables that have them, each with its content. A comment is what a mapping should know of it.
macro_rules! columns {
    ($(in $tables:ident {
        $($(#[doc = $doc:literal])+ $name:ident: $content:ident $(, intermediate = $is:literal)?;)+
    })+) => {
        /// All columns, in the order in which tables have them.
        pub const COLUMNS: &[Column] = &[$($(Column {
            name: stringify!($name),
            content: $content,
            tables: $tables,
            is_intermediate: [$($is,)? false][0],
            doc: concat!($($doc),+).trim_ascii_start(),
        },)+)+];
    };
}

columns! {
    in ALL {
        /// Number of the campaign. By default, runs are numbered by file if there are several.
        run: Number;
        /// Time of the row; in a table of packets, when the packet was created. A number, or a date (ISO 8601).
        time_s: Time;
        /// Epoch time (s) from which time_s counts. By default it is written where the log or `start` states it: times are
        /// dates or epoch times, or the header has a date. State it where the log counts from its own beginning.
        start_epoch_s: Number;
    }
    in LINKS {
        /// Links: the node that sends, by number or name.
        tx: Label;
        /// Links: the node that may receive, by number or name.
        rx: Label;
        /// Links: IEEE 802.15.4 channel, 11 to 26.
        channel: Number;
        /// Links: x of the sender (m, east).
        tx_x_m: Number;
        /// Links: y of the sender (m, north).
        tx_y_m: Number;
        /// Links: height of the sender above ground (m).
        tx_z_m: Number;
        /// Links: x of the receiver (m, east).
        rx_x_m: Number;
        /// Links: y of the receiver (m, north).
        rx_y_m: Number;
        /// Links: height of the receiver above ground (m).
        rx_z_m: Number;
        /// Links: where the sender faces (rad, from +x towards +y).
        tx_heading_rad: Heading;
        /// Links: where the receiver faces (rad, from +x towards +y).
        rx_heading_rad: Heading;
        /// Links: received signal strength (dBm); of an aggregated row, the mean.
        rssi_dbm: Number;
        /// Link samples: 1 if the frame was received, 0 if it was lost.
        received: Number;
        /// Aggregated links: frames sent.
        frames: Number;
        /// Aggregated links: fraction of the frames received, 0 to 1.
        pdr: Number;
        /// Aggregated links: standard deviation of the received signal strength (dB).
        rssi_sd_db: Number;
        /// Aggregated links: frames received or acknowledged; divided by `frames` it gives `pdr`.
        received_frames: Number, intermediate = true;
    }
    in ROBOTS {
        /// Robots: the robot, by number or name.
        agent: Label;
    }
    in PLACED {
        // In a table of links those of a node, which join onto both ends.
        /// Robots and places of nodes: x (m, east).
        x_m: Number;
        /// Robots and places of nodes: y (m, north).
        y_m: Number;
        /// Robots and places of nodes: z (m); of nodes, the height above ground.
        z_m: Number;
        /// Robots and places of nodes: heading (rad, from +x towards +y).
        heading_rad: Heading;
        /// Robots and places of nodes: latitude (degrees), which gives x_m and y_m together with longitude_deg.
        latitude_deg: Number, intermediate = true;
        /// Robots and places of nodes: longitude (degrees).
        longitude_deg: Number, intermediate = true;
    }
    in LINKS {
        /// Links: the node that a row of places belongs to. The input is joined onto senders and receivers.
        node: Label, intermediate = true;
    }
    in ROBOTS {
        /// Robots: commanded velocity along x (m/s).
        cmd_vx_mps: Number;
        /// Robots: commanded velocity along y (m/s).
        cmd_vy_mps: Number;
        /// Robots: commanded velocity along z (m/s).
        cmd_vz_mps: Number;
        /// Robots: commanded speed (m/s).
        cmd_speed_mps: Number;
        /// Robots: commanded yaw rate (rad/s), of a unicycle.
        cmd_yaw_rate_radps: Number;
        /// Robots: commanded steering angle (rad), of a car.
        cmd_steer_rad: Number;
        /// Robots: commanded acceleration along x (m/s²).
        cmd_ax_mps2: Number;
        /// Robots: commanded acceleration along y (m/s²).
        cmd_ay_mps2: Number;
        /// Robots: commanded acceleration along z (m/s²), which is 0 at hover.
        cmd_az_mps2: Number;
        /// Robots: commanded thrust (N), of a quadrotor.
        cmd_thrust_n: Number;
        /// Robots: commanded roll (rad), positive with the right side down.
        cmd_roll_rad: Number;
        /// Robots: commanded pitch (rad), positive with the nose down.
        cmd_pitch_rad: Number;
        /// Robots: commanded yaw (rad, from +x towards +y).
        cmd_yaw_rad: Heading;
    }
    in PACKETS {
        /// Packets: the node that created the packet, by number or name.
        source: Label;
        /// Packets: the node that the packet is for, by number or name.
        destination: Label;
        /// Packets: time of arrival; empty if the packet was lost.
        received_s: Time;
        /// Packets: number of hops.
        hops: Number;
        /// Packets: size of the payload (bytes).
        payload_bytes: Number;
    }
    in NUMBERED {
        /// Packets and link samples: sequence number, in which gaps show lost packets and frames. Of links, the sender's number of the
        /// frame, which all receivers could have received.
        sequence: Number;
    }
}

/// What a column is filled from, as a mapping states it.
#[derive(OneOf)]
pub(crate) enum SourceKey {
    /// A column of the log.
    Column(String),
    /// The same number in every row.
    Constant(f64),
    /// Several columns of the log.
    Columns(#[key(length = 2..=4)] Vec<String>),
    /// A column of the log with its unit.
    Table(SourceKeys),
}

/// A column of the log with its unit.
#[derive(Section)]
pub(crate) struct SourceKeys {
    /// Name of the column in the log.
    pub(crate) column: String,
    /// Unit of the log, such as ms, deg, km/h, -dBm or percent. By default it is read from the name of the log's column (`speed_kmh`,
    /// `yaw [deg]`), and otherwise it is the unit of the table.
    pub(crate) unit: Option<String>,
    /// The value is multiplied by this.
    #[key(default = 1.0)]
    pub(crate) scale: f64,
    /// This is added to the value after the multiplication, in the unit of the table.
    #[key(default = 0.0)]
    pub(crate) offset: f64,
    /// The sign of the value: "negative" makes 73 and -73 both -73, where a log drops minus signs.
    #[key(default = Sign::AsWritten)]
    pub(crate) sign: Sign,
    /// The least and the greatest value, in the unit of the table. Values outside are missing, as a reading of 127 that stands for none.
    pub(crate) within: Option<[f64; 2]>,
}

/// The sign of the values of a column.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// As the log has it.
    AsWritten,
    /// All values are negative.
    Negative,
}

/// The keys of `columns`: one for each of [`COLUMNS`].
pub(crate) const COLUMNS_SPEC: TableSpec = TableSpec {
    doc: "Source of each column of the table: the name of a column of the log, a number that is the same in every row, a \
          table with column and unit, or a list of columns: [seconds, nanoseconds] or [date, time of day] for a time, and a \
          quaternion [x, y, z, w] for a heading.",
    fields: &{
        let mut fields = [key(&COLUMNS[0]); COLUMNS.len()];
        let mut at = 1;
        while at < COLUMNS.len() {
            fields[at] = key(&COLUMNS[at]);
            at += 1;
        }
        fields
    },
    tag: None,
};

const fn key(column: &Column) -> Field {
    Field { key: column.name, doc: column.doc, kind: SourceKey::KIND, default: Default::Absent }
}

/// The column of a name, if it is no covariate.
#[must_use]
pub fn known(name: &str) -> Option<&'static Column> {
    COLUMNS.iter().find(|column| column.name == name)
}

impl Column {
    /// Whether a table has it, as an input of a mapping.
    #[must_use]
    pub fn is_of(&self, table: TableKind) -> bool {
        self.tables.contains(&table)
    }
}

/// What the reader of a table of measurements finds in it.
pub(crate) struct Verdict {
    /// Lines of the rows that can be used.
    pub used: Vec<usize>,
    /// Rows that cannot, by reason.
    pub rejected: Vec<Rejected>,
}

impl TableKind {
    /// Names of the columns that a mapping can fill.
    pub fn columns(self) -> impl Iterator<Item = &'static str> {
        COLUMNS.iter().filter(move |column| column.is_of(self)).map(|column| column.name)
    }

    /// The columns that a table with these columns lacks.
    pub(crate) fn lacking(self, names: &[String]) -> Vec<String> {
        let table = DataTable::of_columns(names.to_vec(), vec![Vec::new(); names.len()]);
        match self {
            Self::Links => links::has_shape(&table).err(),
            Self::Robots => robots::CommandKind::of_table(&table).err(),
            Self::Packets => packets::has_shape(&table).err(),
        }
        .unwrap_or_default()
    }

    /// Has the commands' own reader read a table.
    ///
    /// # Errors
    ///
    /// Why no row of it can be used.
    pub(crate) fn read(self, table: &DataTable) -> Result<Verdict, String> {
        match self {
            Self::Links => links::read(table).map(|links| Verdict {
                used: links.rows.iter().map(|row| row.line).collect(),
                rejected: links.rejected,
            }),
            Self::Robots => robots::read(table).map(|robots| Verdict {
                used: robots.samples.iter().map(|sample| sample.line).collect(),
                rejected: robots.rejected,
            }),
            // Campaigns are compared one at a time; here their rows are judged together.
            Self::Packets => packets::read(&without_runs(table)).map(|packets| Verdict {
                used: packets.packets.iter().map(|packet| packet.line).collect(),
                rejected: packets.rejected,
            }),
        }
    }
}

fn without_runs(table: &DataTable) -> DataTable {
    let columns: BTreeMap<&String, Vec<f64>> = table
        .names()
        .iter()
        .filter(|name| *name != "run")
        .filter_map(|name| Some((name, table.column(name)?.to_vec())))
        .collect();
    let (names, columns) = columns.into_iter().map(|(name, column)| (name.clone(), column)).unzip();
    DataTable::of_columns(names, columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_table_lacks_is_what_the_commands_ask_for() {
        let names =
            |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        assert!(
            TableKind::Packets
                .lacking(&names(&["time_s", "source", "destination", "received_s"]))
                .is_empty()
        );
        assert_eq!(
            TableKind::Robots.lacking(&names(&[
                "time_s",
                "agent",
                "x_m",
                "cmd_vx_mps",
                "cmd_vy_mps"
            ])),
            ["y_m"]
        );
    }
}
