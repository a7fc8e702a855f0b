//! A file of measurements with its defects corrected.

use measure::links::LinkRow;
use measure::table::DataTable;
use study::defects::{Correction, Defect, PREFIX};
use study::links::LinkStudy;

/// A defect of which no corrected file can be written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{PREFIX}{name} cannot be corrected in a file: {reason}")]
pub struct NotCorrectable {
    /// The kind of defect.
    pub name: &'static str,
    /// Why not.
    pub reason: &'static str,
}

/// A corrected file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CorrectedData {
    /// The file's text: CSV with the columns of the measured file.
    pub csv: String,
    /// Rows that were written.
    pub n_rows: usize,
    /// Rows that were changed.
    pub n_changed: usize,
    /// Rows that were left out because of a defect.
    pub n_left_out: usize,
    /// Rows that the reader rejects, duplicates among them, which are not written either.
    pub n_rejected: usize,
}

/// The columns of a row that a correction may change, and their values.
fn values(row: &LinkRow) -> [(&'static str, f64); 12] {
    [
        ("time_s", row.time_s),
        ("tx", f64::from(row.tx)),
        ("rx", f64::from(row.rx)),
        ("channel", row.channel.map_or(f64::NAN, f64::from)),
        ("tx_x_m", row.tx_m[0]),
        ("tx_y_m", row.tx_m[1]),
        ("tx_z_m", row.tx_m[2]),
        ("rx_x_m", row.rx_m[0]),
        ("rx_y_m", row.rx_m[1]),
        ("rx_z_m", row.rx_m[2]),
        ("tx_heading_rad", row.tx_heading_rad),
        ("rx_heading_rad", row.rx_heading_rad),
    ]
}

/// The measured file with all defects corrected. `study`: that of the measurements as they are, read from `table`.
///
/// # Errors
///
/// A defect of which no corrected file can be written.
pub(crate) fn corrected_data(
    table: &DataTable,
    study: &LinkStudy,
    defects: &[Defect],
) -> Result<CorrectedData, NotCorrectable> {
    for defect in defects {
        if let Some(reason) = defect.correction.refusal {
            return Err(NotCorrectable { name: defect.name, reason });
        }
    }
    let correction = super::defects::joint_correction(defects);
    let Correction { left_out, replaced, .. } = &correction;
    let rows = &study.rows.links.rows;
    let mut csv = table.names().join(",");
    csv.push('\n');
    let (mut n_rows, mut n_changed) = (0, 0);
    for (index, row) in rows.iter().enumerate() {
        let number = index as u32;
        if left_out.binary_search(&number).is_ok() {
            continue;
        }
        let changed = replaced.binary_search_by_key(&number, |(row, _)| *row);
        let changed = changed.ok().map(|place| &replaced[place].1);
        n_rows += 1;
        n_changed += usize::from(changed.is_some());
        let cell = |name: &String| {
            let measured = table.column(name).unwrap_or_default()[row.line - table.line(0)];
            // Heights that the configuration gives are no part of the file: only what differs is written.
            let value = changed.and_then(|changed| {
                let both = values(changed).into_iter().zip(values(row));
                let mut differing =
                    both.filter(|((_, new), (_, old))| new.to_bits() != old.to_bits());
                differing.find(|((known, _), _)| known == name).map(|((_, new), _)| new)
            });
            let value = value.unwrap_or(measured);
            if value.is_finite() { value.to_string() } else { String::new() }
        };
        csv.push_str(&table.names().iter().map(cell).collect::<Vec<_>>().join(","));
        csv.push('\n');
    }
    Ok(CorrectedData {
        csv,
        n_rows,
        n_changed,
        n_left_out: left_out.len(),
        n_rejected: study.rows.links.n_rows - rows.len(),
    })
}
