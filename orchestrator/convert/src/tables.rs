//! The tables that logs become, and their columns.

use measure::table::DataTable;
use measure::{Rejected, links, packets, robots, time_of_day};
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

const fn column(
    name: &'static str,
    content: Content,
    tables: &'static [TableKind],
    doc: &'static str,
) -> Column {
    Column { name, content, tables, is_intermediate: false, doc }
}

const fn intermediate(
    name: &'static str,
    content: Content,
    tables: &'static [TableKind],
    doc: &'static str,
) -> Column {
    Column { is_intermediate: true, ..column(name, content, tables, doc) }
}

use Content::{Heading, Label, Number, Time};
const LINKS: &[TableKind] = &[TableKind::Links];
const ROBOTS: &[TableKind] = &[TableKind::Robots];
const PACKETS: &[TableKind] = &[TableKind::Packets];
const PLACED: &[TableKind] = &[TableKind::Links, TableKind::Robots];
const ALL: &[TableKind] = &[TableKind::Links, TableKind::Robots, TableKind::Packets];

/// All columns, in the order in which tables have them.
pub const COLUMNS: &[Column] = &[
    column(
        "run",
        Number,
        ALL,
        "Number of the campaign. By default, runs are numbered by file if there are several.",
    ),
    column(
        "time_s",
        Time,
        ALL,
        "Time of the row; in a table of packets, when the packet was created. A number, or a date (ISO 8601).",
    ),
    column(
        time_of_day::START,
        Number,
        ALL,
        "Epoch time (s) from which time_s counts. By default it is written where the log or `start` states it: times are dates or epoch \
             times, or the header has a date. State it where the log counts from its own beginning.",
    ),
    column("tx", Label, LINKS, "Links: the node that sends, by number or name."),
    column("rx", Label, LINKS, "Links: the node that may receive, by number or name."),
    column("channel", Number, LINKS, "Links: IEEE 802.15.4 channel, 11 to 26."),
    column("tx_x_m", Number, LINKS, "Links: x of the sender (m, east)."),
    column("tx_y_m", Number, LINKS, "Links: y of the sender (m, north)."),
    column("tx_z_m", Number, LINKS, "Links: height of the sender above ground (m)."),
    column("rx_x_m", Number, LINKS, "Links: x of the receiver (m, east)."),
    column("rx_y_m", Number, LINKS, "Links: y of the receiver (m, north)."),
    column("rx_z_m", Number, LINKS, "Links: height of the receiver above ground (m)."),
    column(
        "tx_heading_rad",
        Heading,
        LINKS,
        "Links: where the sender faces (rad, from +x towards +y).",
    ),
    column(
        "rx_heading_rad",
        Heading,
        LINKS,
        "Links: where the receiver faces (rad, from +x towards +y).",
    ),
    column(
        "rssi_dbm",
        Number,
        LINKS,
        "Links: received signal strength (dBm); of an aggregated row, the mean.",
    ),
    column(
        "received",
        Number,
        LINKS,
        "Link samples: 1 if the frame was received, 0 if it was lost.",
    ),
    column("frames", Number, LINKS, "Aggregated links: frames sent."),
    column("pdr", Number, LINKS, "Aggregated links: fraction of the frames received, 0 to 1."),
    column(
        "rssi_sd_db",
        Number,
        LINKS,
        "Aggregated links: standard deviation of the received signal strength (dB).",
    ),
    intermediate(
        "received_frames",
        Number,
        LINKS,
        "Aggregated links: frames received or acknowledged; divided by `frames` it gives `pdr`.",
    ),
    column("agent", Label, ROBOTS, "Robots: the robot, by number or name."),
    // In a table of links those of a node, which join onto both ends.
    column("x_m", Number, PLACED, "Robots and places of nodes: x (m, east)."),
    column("y_m", Number, PLACED, "Robots and places of nodes: y (m, north)."),
    column(
        "z_m",
        Number,
        PLACED,
        "Robots and places of nodes: z (m); of nodes, the height above ground.",
    ),
    column(
        "heading_rad",
        Heading,
        PLACED,
        "Robots and places of nodes: heading (rad, from +x towards +y).",
    ),
    intermediate(
        "latitude_deg",
        Number,
        PLACED,
        "Robots and places of nodes: latitude (degrees), which gives x_m and y_m together with longitude_deg.",
    ),
    intermediate(
        "longitude_deg",
        Number,
        PLACED,
        "Robots and places of nodes: longitude (degrees).",
    ),
    intermediate(
        "node",
        Label,
        LINKS,
        "Links: the node that a row of places belongs to. The input is joined onto senders and receivers.",
    ),
    column("cmd_vx_mps", Number, ROBOTS, "Robots: commanded velocity along x (m/s)."),
    column("cmd_vy_mps", Number, ROBOTS, "Robots: commanded velocity along y (m/s)."),
    column("cmd_vz_mps", Number, ROBOTS, "Robots: commanded velocity along z (m/s)."),
    column("cmd_speed_mps", Number, ROBOTS, "Robots: commanded speed (m/s)."),
    column(
        "cmd_yaw_rate_radps",
        Number,
        ROBOTS,
        "Robots: commanded yaw rate (rad/s), of a unicycle.",
    ),
    column("cmd_steer_rad", Number, ROBOTS, "Robots: commanded steering angle (rad), of a car."),
    column("cmd_ax_mps2", Number, ROBOTS, "Robots: commanded acceleration along x (m/s²)."),
    column("cmd_ay_mps2", Number, ROBOTS, "Robots: commanded acceleration along y (m/s²)."),
    column(
        "cmd_az_mps2",
        Number,
        ROBOTS,
        "Robots: commanded acceleration along z (m/s²), which is 0 at hover.",
    ),
    column("cmd_thrust_n", Number, ROBOTS, "Robots: commanded thrust (N), of a quadrotor."),
    column(
        "cmd_roll_rad",
        Number,
        ROBOTS,
        "Robots: commanded roll (rad), positive with the right side down.",
    ),
    column(
        "cmd_pitch_rad",
        Number,
        ROBOTS,
        "Robots: commanded pitch (rad), positive with the nose down.",
    ),
    column("cmd_yaw_rad", Heading, ROBOTS, "Robots: commanded yaw (rad, from +x towards +y)."),
    column(
        "source",
        Label,
        PACKETS,
        "Packets: the node that created the packet, by number or name.",
    ),
    column(
        "destination",
        Label,
        PACKETS,
        "Packets: the node that the packet is for, by number or name.",
    ),
    column("received_s", Time, PACKETS, "Packets: time of arrival; empty if the packet was lost."),
    column("hops", Number, PACKETS, "Packets: number of hops."),
    column("payload_bytes", Number, PACKETS, "Packets: size of the payload (bytes)."),
    column(
        "sequence",
        Number,
        PACKETS,
        "Packets: sequence number, in which gaps show lost packets.",
    ),
];

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
}

/// The keys of `columns`: one for each of [`COLUMNS`].
pub(crate) const COLUMNS_SPEC: TableSpec = TableSpec {
    doc: "Source of each column of the table: the name of a column of the log, a number that is the same in every row, a \
          table with column and unit, or a list of columns: [seconds, nanoseconds] for a time, and a quaternion [x, y, z, w] \
          for a heading.",
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
