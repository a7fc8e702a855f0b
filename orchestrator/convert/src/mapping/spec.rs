//! The keys of mapping files.

use crate::formats::BUILT_IN;
use crate::tables::COLUMNS_SPEC;
use proto::config::{
    Choice, Default, Field, Kind, Lists, Range, Registry, TableSpec, Tag, Variants,
};

/// The key that says which table is written.
pub(super) const TABLE: &str = "table";

/// The key that sums up link samples.
pub(super) const AGGREGATE_S: &str = "aggregate_s";

/// The key that makes lost packets of gaps.
pub(super) const LOST_FROM_GAPS: &str = "lost_from_gaps";

/// The keys of a mapping file.
pub const SPEC: TableSpec = TableSpec {
    doc: "A mapping file: how logs become a table of measurements.",
    fields: &[
        Field {
            key: TABLE,
            doc: "The table to write.",
            kind: Kind::Choice(&[
                Choice { name: "links", doc: "Link samples, or an aggregated link table." },
                Choice { name: "robots", doc: "Robot samples." },
                Choice { name: "packets", doc: "Packets from end to end." },
            ]),
            default: Default::Required,
        },
        Field {
            key: "start",
            doc: "Origin of times: a date, an epoch time (s), or \"as-written\". By default, dates and epoch times count \
                  from the first row of each run, or from the start that the log states; smaller times stay as they are.",
            kind: Kind::Either(&[Kind::Number(Range::ANY), Kind::Text]),
            default: Default::Absent,
        },
        Field {
            key: "origin_deg",
            doc: "Latitude and longitude (degrees) of x = 0, y = 0. By default, the first fix.",
            kind: Kind::List { of: &Kind::Number(Range::closed(-180.0, 180.0)), min: 2, max: 2 },
            default: Default::Absent,
        },
        Field {
            key: "names",
            doc: "Numbers of nodes or robots by their name in the log: `{ gateway = 0, \"00:12\" = 1 }`. Other names get the numbers that \
                  follow, in natural order. By default, whole numbers stay as they are.",
            kind: Kind::Anything,
            default: Default::Absent,
        },
        Field {
            key: AGGREGATE_S,
            doc: "Links: sums up link samples over periods of this length (s), by run, sender, receiver and channel, into an aggregated \
                  table: rows with frames, pdr and the mean reading, as `--given-rssi` requires them.",
            kind: Kind::Number(Range::closed(1e-3, 1e9)),
            default: Default::Absent,
        },
        Field {
            key: LOST_FROM_GAPS,
            doc: "Packets: adds a row with an empty received_s for each sequence number that is missing between two packets of a source, \
                  created at a time interpolated between them. Where the numbers begin anew, nothing is added. Requires the column sequence.",
            kind: Kind::Bool,
            default: Default::Bool(false),
        },
        Field {
            key: "input",
            doc: "The logs. Rows of the table are the rows of the first input; further inputs are joined onto them.",
            kind: Kind::Tables(&INPUT_SPEC),
            default: Default::Required,
        },
    ],
    tag: None,
};

const INPUT_SPEC: TableSpec = TableSpec {
    doc: "Log files of one format.",
    fields: &[
        Field {
            key: "files",
            doc: "Path of the log, relative to the mapping file. `*` and `?` stand for any characters: each file is then a run of its own, \
                  in natural order. Files of further inputs belong to the run in whose file name `*` stands for the same text.",
            kind: Kind::Text,
            default: Default::Required,
        },
        Field {
            key: "columns",
            doc: "Source of each column of the table.",
            kind: Kind::Table(&COLUMNS_SPEC),
            default: Default::Table,
        },
        Field {
            key: "covariates",
            doc: "Further columns, by the name that they get, with its unit as suffix: `{ temperature_c = \"Temp\" }`.",
            kind: Kind::Anything,
            default: Default::Absent,
        },
        Field {
            key: "cumulative",
            doc: "Whether frames and received_frames count from the start of the log; each row then gets the difference from the row before of \
                  the same link and channel.",
            kind: Kind::Bool,
            default: Default::Bool(false),
        },
        Field {
            key: "join",
            doc: "Which row of a further input goes with a row of the first.",
            kind: Kind::Choice(&[
                Choice {
                    name: LATEST,
                    doc: "The last one before it, as for the command in force.",
                },
                Choice { name: "nearest", doc: "The one nearest in time." },
                Choice {
                    name: "interpolated",
                    doc: "The one before and the one after, interpolated linearly; angles along the shorter arc.",
                },
            ]),
            default: Default::Text(LATEST),
        },
        Field {
            key: "within_s",
            doc: "How far in time the joined row may be (s). Rows of the first input without one are rejected, unless nodes are joined: \
                  then their places stay empty.",
            kind: Kind::Number(Range::above(0.0, 1e9)),
            default: Default::Number(1.0),
        },
    ],
    tag: Some(&Tag {
        key: "format",
        doc: "The format of the log.",
        default: Some("csv"),
        variants: Variants::List(FORMATS),
    }),
};

const LATEST: &str = "latest";
const FORMATS: &str = "formats";
pub(super) const AS_WRITTEN: &str = "as-written";

/// The lists that the keys of a mapping file choose from.
#[must_use]
pub fn lists() -> Lists {
    Lists::default().with(FORMATS, &Registry::new(BUILT_IN))
}
