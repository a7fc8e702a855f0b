//! Link samples from what a run has left: who sent, who might have heard, where both were.

use super::Format;
use crate::DataError;
use crate::memory::Memory;
use crate::table::{CELL_BYTES, DataTable};
use input::Reading;
use input::result::ResultFolder;
use numbers::power::square;
use std::collections::BTreeMap;
use std::path::Path;

/// The format: the folder of a run.
pub const FORMAT: Format = Format {
    name: "the folder of a run",
    recognises: |path, _| path.is_dir(),
    read: |path, content| links(path, content.reading(), content.uncounted().1),
};

/// Memory of a row that is made (bytes): 13 numbers and its place.
const BYTES_OF_ROW: usize = 14 * CELL_BYTES;
/// Memory in which a place is found by its step and agent (bytes).
const BYTES_OF_STEP: usize = 4 * CELL_BYTES;

/// Link samples of a run: every transmission and agent that might hear it which `links.parquet` has, with the places in
/// `steps.parquet`. What went over several hops is no link, and left out.
///
/// # Errors
///
/// The folder is no run's, its links were not recorded, or its files are not what the run wrote.
fn links(folder: &Path, reading: Reading, mut memory: Memory) -> Result<DataTable, DataError> {
    let format = |message: String| DataError::Format { path: folder.to_owned(), message };
    for name in ["links.parquet", "steps.parquet"] {
        if !folder.join(name).is_file() {
            return Err(format(format!(
                "is not the folder of a run with {name}; record the run with [output] links = \"all\" (or \"sample\") and \
                 steps = true"
            )));
        }
    }
    let run = &ResultFolder::open(folder, reading)?;
    let links = DataTable::of_result(run, "links.parquet", memory.left())?;
    let n_links = links.n_rows();
    let what = format_args!("{n_links} rows of links, and the places of their ends");
    memory.take(2 * links.n_bytes() + (BYTES_OF_ROW * n_links) as u64, what).map_err(format)?;
    let steps = DataTable::of_result(run, "steps.parquet", memory.left())?;
    let of_steps = 2 * steps.n_bytes() + (BYTES_OF_STEP * steps.n_rows()) as u64;
    memory.take(of_steps, what).map_err(format)?;
    let column = |table: &'_ DataTable, name: &str| -> Result<Vec<f64>, DataError> {
        let found = table.column(name).map(<[f64]>::to_vec);
        found.ok_or_else(|| {
            format(format!("its tables have no column {name}, so it is not a run of this program"))
        })
    };
    let [step, agent] = ["step", "agent"].map(|name| column(&steps, name));
    let (step, agent) = (step?, agent?);
    let places = ["x_m", "y_m", "z_m", "heading_rad"].map(|name| column(&steps, name));
    let [x_m, y_m, z_m, heading_rad] = places;
    let state = [x_m?, y_m?, z_m?, heading_rad?];
    let row_of: BTreeMap<(u64, u64), usize> =
        (0..steps.n_rows()).map(|row| ((step[row] as u64, agent[row] as u64), row)).collect();

    let sent = ["step", "sender", "receiver", "sent_ns", "received", "rssi_dbm"]
        .map(|name| column(&links, name));
    let [step, sender, receiver, sent_ns, received, rssi_dbm] = sent;
    let (step, sender, receiver) = (step?, sender?, receiver?);
    let (sent_ns, received, rssi_dbm) = (sent_ns?, received?, rssi_dbm?);
    let distance_m = column(&links, "distance_m")?;
    let hops = column(&links, "hops")?;
    let is_direct = |row: usize| hops[row].is_nan() || hops[row] <= 1.0;
    let mut direct: Vec<usize> = (0..links.n_rows())
        .filter(|&row| is_direct(row) && (received[row] == 0.0 || rssi_dbm[row].is_finite()))
        .collect();
    direct.sort_by(|&a, &b| sent_ns[a].total_cmp(&sent_ns[b]).then(a.cmp(&b)));
    // Whether the network had the agents where they were when a step ended, or when it began: as the distances say.
    let place = |back: u64, row: usize, agent: f64, part: usize| -> f64 {
        let key = ((step[row] as u64).saturating_sub(back), agent as u64);
        row_of.get(&key).map_or(f64::NAN, |&at| state[part][at])
    };
    let misfit = |back: u64| -> f64 {
        direct
            .iter()
            .step_by(direct.len() / 1000 + 1)
            .map(|&row| {
                let squares = (0..3).map(|part| {
                    let ends =
                        [sender[row], receiver[row]].map(|agent| place(back, row, agent, part));
                    square(ends[0] - ends[1])
                });
                (squares.sum::<f64>().sqrt() - distance_m[row]).abs()
            })
            .filter(|misfit| misfit.is_finite())
            .sum()
    };
    let back = u64::from(misfit(1) < misfit(0));
    let picked = |values: &[f64]| -> Vec<f64> { direct.iter().map(|&row| values[row]).collect() };
    let coordinate = |agents: &[f64], part: usize| -> Vec<f64> {
        direct.iter().map(|&row| place(back, row, agents[row], part)).collect()
    };
    let mut columns: Vec<(&str, Vec<f64>)> = vec![
        ("time_s", direct.iter().map(|&row| sent_ns[row] * 1e-9).collect()),
        ("tx", picked(&sender)),
        ("rx", picked(&receiver)),
    ];
    for (k, [tx, rx]) in
        [["tx_x_m", "rx_x_m"], ["tx_y_m", "rx_y_m"], ["tx_z_m", "rx_z_m"]].into_iter().enumerate()
    {
        columns.push((tx, coordinate(&sender, k)));
        columns.push((rx, coordinate(&receiver, k)));
    }
    columns.push(("tx_heading_rad", coordinate(&sender, 3)));
    columns.push(("rx_heading_rad", coordinate(&receiver, 3)));
    columns.push(("rssi_dbm", picked(&rssi_dbm)));
    columns.push(("received", picked(&received)));
    let (names, columns) = columns.into_iter().map(|(name, c)| (name.to_owned(), c)).unzip();
    let mut table = DataTable::of_columns(names, columns);
    folder.clone_into(&mut table.path);
    table.sha256 = links.sha256;
    Ok(table)
}
