//! The tables that logs become, and their columns.

use measure::table::DataTable;
use measure::{Rejected, links, packets, robots, time_of_day};
use proto::config::{Default, Field, Kind, TableSpec};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A table of measurements.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
}

const fn column(name: &'static str, content: Content, tables: &'static [TableKind]) -> Column {
    Column { name, content, tables, is_intermediate: false }
}

const fn intermediate(
    name: &'static str,
    content: Content,
    tables: &'static [TableKind],
) -> Column {
    Column { name, content, tables, is_intermediate: true }
}

use Content::{Heading, Label, Number, Time};
const LINKS: &[TableKind] = &[TableKind::Links];
const ROBOTS: &[TableKind] = &[TableKind::Robots];
const PACKETS: &[TableKind] = &[TableKind::Packets];
const PLACED: &[TableKind] = &[TableKind::Links, TableKind::Robots];
const ALL: &[TableKind] = &[TableKind::Links, TableKind::Robots, TableKind::Packets];

/// All columns, in the order in which tables have them.
pub const COLUMNS: &[Column] = &[
    column("run", Number, ALL),
    column("time_s", Time, ALL),
    column(time_of_day::START, Number, ALL),
    column("tx", Label, LINKS),
    column("rx", Label, LINKS),
    column("channel", Number, LINKS),
    column("tx_x_m", Number, LINKS),
    column("tx_y_m", Number, LINKS),
    column("tx_z_m", Number, LINKS),
    column("rx_x_m", Number, LINKS),
    column("rx_y_m", Number, LINKS),
    column("rx_z_m", Number, LINKS),
    column("tx_heading_rad", Heading, LINKS),
    column("rx_heading_rad", Heading, LINKS),
    column("rssi_dbm", Number, LINKS),
    column("received", Number, LINKS),
    column("frames", Number, LINKS),
    column("pdr", Number, LINKS),
    column("rssi_sd_db", Number, LINKS),
    column("agent", Label, ROBOTS),
    // In a table of links those of a node, which join onto both ends.
    column("x_m", Number, PLACED),
    column("y_m", Number, PLACED),
    column("z_m", Number, PLACED),
    column("heading_rad", Heading, PLACED),
    column("cmd_vx_mps", Number, ROBOTS),
    column("cmd_vy_mps", Number, ROBOTS),
    column("cmd_vz_mps", Number, ROBOTS),
    column("cmd_speed_mps", Number, ROBOTS),
    column("cmd_yaw_rate_radps", Number, ROBOTS),
    column("cmd_steer_rad", Number, ROBOTS),
    column("cmd_ax_mps2", Number, ROBOTS),
    column("cmd_ay_mps2", Number, ROBOTS),
    column("cmd_az_mps2", Number, ROBOTS),
    column("cmd_thrust_n", Number, ROBOTS),
    column("cmd_roll_rad", Number, ROBOTS),
    column("cmd_pitch_rad", Number, ROBOTS),
    column("cmd_yaw_rad", Heading, ROBOTS),
    column("source", Label, PACKETS),
    column("destination", Label, PACKETS),
    column("received_s", Time, PACKETS),
    column("hops", Number, PACKETS),
    column("payload_bytes", Number, PACKETS),
    column("sequence", Number, PACKETS),
    intermediate("latitude_deg", Number, PLACED),
    intermediate("longitude_deg", Number, PLACED),
    intermediate("received_frames", Number, LINKS),
    intermediate("node", Label, LINKS),
];

/// A key of `columns`, which the column of the same name is filled from.
const fn key(key: &'static str, doc: &'static str) -> Field {
    Field { key, doc, kind: Kind::Either(SOURCES), default: Default::Absent }
}

/// What a column is filled from.
const SOURCES: &[Kind] = &[
    Kind::Text,
    Kind::Number(proto::config::Range::ANY),
    Kind::List { of: &Kind::Text, min: 2, max: 4 },
    Kind::Table(&SOURCE_SPEC),
];

pub(crate) const SOURCE_SPEC: TableSpec = TableSpec {
    doc: "A column of the log with its unit.",
    fields: &[
        Field {
            key: "column",
            doc: "Name of the column in the log.",
            kind: Kind::Text,
            default: Default::Required,
        },
        Field {
            key: "unit",
            doc: "Unit of the log, such as ms, deg, km/h, -dBm or percent. By default it is read from the name of the log's column \
                  (`speed_kmh`, `yaw [deg]`), and otherwise it is the unit of the table.",
            kind: Kind::Text,
            default: Default::Absent,
        },
        Field {
            key: "scale",
            doc: "The value is multiplied by this.",
            kind: Kind::Number(proto::config::Range::ANY),
            default: Default::Number(1.0),
        },
        Field {
            key: "offset",
            doc: "This is added to the value after the multiplication, in the unit of the table.",
            kind: Kind::Number(proto::config::Range::ANY),
            default: Default::Number(0.0),
        },
    ],
    tag: None,
};

/// The keys of `columns`.
pub(crate) const COLUMNS_SPEC: TableSpec = TableSpec {
    doc: "Source of each column of the table: the name of a column of the log, a number that is the same in every row, a \
          table with column and unit, or a list of columns: [seconds, nanoseconds] for a time, and a quaternion [x, y, z, w] \
          for a heading.",
    fields: &[
        key(
            "run",
            "Number of the campaign. By default, runs are numbered by file if there are several.",
        ),
        key(
            "time_s",
            "Time of the row; in a table of packets, when the packet was created. A number, or a date (ISO 8601).",
        ),
        key(
            time_of_day::START,
            "Epoch time (s) from which time_s counts. By default it is written where the log or `start` states it: times are dates or epoch \
             times, or the header has a date. State it where the log counts from its own beginning.",
        ),
        key("tx", "Links: the node that sends, by number or name."),
        key("rx", "Links: the node that may receive, by number or name."),
        key("channel", "Links: IEEE 802.15.4 channel, 11 to 26."),
        key("tx_x_m", "Links: x of the sender (m, east)."),
        key("tx_y_m", "Links: y of the sender (m, north)."),
        key("tx_z_m", "Links: height of the sender above ground (m)."),
        key("rx_x_m", "Links: x of the receiver (m, east)."),
        key("rx_y_m", "Links: y of the receiver (m, north)."),
        key("rx_z_m", "Links: height of the receiver above ground (m)."),
        key("tx_heading_rad", "Links: where the sender faces (rad, from +x towards +y)."),
        key("rx_heading_rad", "Links: where the receiver faces (rad, from +x towards +y)."),
        key("rssi_dbm", "Links: received signal strength (dBm); of an aggregated row, the mean."),
        key("received", "Link samples: 1 if the frame was received, 0 if it was lost."),
        key("frames", "Aggregated links: frames sent."),
        key("pdr", "Aggregated links: fraction of the frames received, 0 to 1."),
        key(
            "rssi_sd_db",
            "Aggregated links: standard deviation of the received signal strength (dB).",
        ),
        key(
            "received_frames",
            "Aggregated links: frames received or acknowledged; divided by `frames` it gives `pdr`.",
        ),
        key("agent", "Robots: the robot, by number or name."),
        key("x_m", "Robots and places of nodes: x (m, east)."),
        key("y_m", "Robots and places of nodes: y (m, north)."),
        key("z_m", "Robots and places of nodes: z (m); of nodes, the height above ground."),
        key("heading_rad", "Robots and places of nodes: heading (rad, from +x towards +y)."),
        key(
            "latitude_deg",
            "Robots and places of nodes: latitude (degrees), which gives x_m and y_m together with longitude_deg.",
        ),
        key("longitude_deg", "Robots and places of nodes: longitude (degrees)."),
        key(
            "node",
            "Links: the node that a row of places belongs to. The input is joined onto senders and receivers.",
        ),
        key("cmd_vx_mps", "Robots: commanded velocity along x (m/s)."),
        key("cmd_vy_mps", "Robots: commanded velocity along y (m/s)."),
        key("cmd_vz_mps", "Robots: commanded velocity along z (m/s)."),
        key("cmd_speed_mps", "Robots: commanded speed (m/s)."),
        key("cmd_yaw_rate_radps", "Robots: commanded yaw rate (rad/s), of a unicycle."),
        key("cmd_steer_rad", "Robots: commanded steering angle (rad), of a car."),
        key("cmd_ax_mps2", "Robots: commanded acceleration along x (m/s²)."),
        key("cmd_ay_mps2", "Robots: commanded acceleration along y (m/s²)."),
        key("cmd_az_mps2", "Robots: commanded acceleration along z (m/s²), which is 0 at hover."),
        key("cmd_thrust_n", "Robots: commanded thrust (N), of a quadrotor."),
        key("cmd_roll_rad", "Robots: commanded roll (rad), positive with the right side down."),
        key("cmd_pitch_rad", "Robots: commanded pitch (rad), positive with the nose down."),
        key("cmd_yaw_rad", "Robots: commanded yaw (rad, from +x towards +y)."),
        key("source", "Packets: the node that created the packet, by number or name."),
        key("destination", "Packets: the node that the packet is for, by number or name."),
        key("received_s", "Packets: time of arrival; empty if the packet was lost."),
        key("hops", "Packets: number of hops."),
        key("payload_bytes", "Packets: size of the payload (bytes)."),
        key("sequence", "Packets: sequence number, in which gaps show lost packets."),
    ],
    tag: None,
};

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
    /// Its name in mapping files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Links => "links",
            Self::Robots => "robots",
            Self::Packets => "packets",
        }
    }

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
    fn every_column_has_a_key_and_every_key_a_column() {
        let keys: Vec<&str> = COLUMNS_SPEC.fields.iter().map(|field| field.key).collect();
        for column in COLUMNS {
            assert!(keys.contains(&column.name), "{} has no key", column.name);
        }
        for key in keys {
            assert!(known(key).is_some(), "{key} is no column");
        }
    }

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
