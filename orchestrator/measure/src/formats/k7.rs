//! K7: traces of link quality, as the 6TiSCH simulator reads them. They begin with a line of JSON.

use super::{Content, Format};
use crate::DataError;
use crate::table::DataTable;
use proto::bounds::K7_BYTES;
use std::path::Path;

/// The format.
pub const FORMAT: Format =
    Format { name: "K7", recognises: |_, begin| begin.first() == Some(&b'{'), read };

/// Nanoseconds of a day: runs of a K7 trace.
const NS_PER_DAY: u64 = 86_400_000_000_000;

fn read(path: &Path, content: Content<'_>) -> Result<DataTable, DataError> {
    let bytes = K7_BYTES
        .read(content)
        .map_err(|source| DataError::Read { path: path.to_owned(), source })?;
    let trace = physics::k7::read(&bytes).map_err(|complaints| DataError::Format {
        path: path.to_owned(),
        message: complaints.first().map_or_else(String::new, ToString::to_string),
    })?;
    Ok(DataTable { path: path.to_owned(), first_line: 3, ..table_of(&trace) })
}

/// The rows of a K7 trace as an aggregated link table.
fn table_of(trace: &physics::k7::K7) -> DataTable {
    let column_of =
        |value: &dyn Fn(&physics::k7::Row) -> f64| trace.rows.iter().map(value).collect();
    let columns: [(&str, Vec<f64>); 8] = [
        ("time_s", column_of(&|row| row.from_ns as f64 * 1e-9)),
        // Days since the first row, so that each has its own number.
        ("run", column_of(&|row| 1.0 + (row.from_ns / NS_PER_DAY) as f64)),
        ("tx", column_of(&|row| f64::from(row.src))),
        ("rx", column_of(&|row| f64::from(row.dst))),
        ("channel", column_of(&|row| row.channel.map_or(f64::NAN, f64::from))),
        ("rssi_dbm", column_of(&|row| row.rssi_dbm.unwrap_or(f64::NAN))),
        ("pdr", column_of(&|row| row.pdr)),
        ("frames", column_of(&|row| row.tx_count.map_or(100.0, f64::from))),
    ];
    let (names, columns) =
        columns.into_iter().map(|(name, column)| (name.to_owned(), column)).unzip();
    DataTable::of_columns(names, columns)
}
