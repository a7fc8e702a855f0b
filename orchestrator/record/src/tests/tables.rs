//! The tables of the made-up run.

use super::*;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::{Field, Row};

fn rows(dir: &Path, file: &str) -> Vec<Row> {
    let reader = SerializedFileReader::new(fs::File::open(dir.join(file)).unwrap()).unwrap();
    reader.get_row_iter(None).unwrap().map(Result::unwrap).collect()
}

fn column(row: &Row, name: &str) -> Field {
    row.get_column_iter().find(|(column, _)| *column == name).unwrap().1.clone()
}

#[test]
fn steps_hold_every_agent_from_the_beginning() {
    let out = tempfile::tempdir().unwrap();
    let run = finished(out.path(), header("run"));
    let rows = rows(&run.dir, "steps.parquet");
    assert_eq!(rows.len(), N * (STEPS as usize + 1));
    assert_eq!(json!(run.summary)["files"]["steps.parquet"]["rows"], rows.len());
    let row = &rows[N * 3 + 1];
    assert_eq!(column(row, "step"), Field::ULong(3));
    assert_eq!(column(row, "time_ns"), Field::ULong(3 * STEP_NS));
    assert_eq!(column(row, "agent"), Field::UInt(1));
    assert_eq!(column(row, "alive"), Field::Bool(true));
    assert_eq!(column(row, "x_m"), Field::Double(1.0 + 0.2 * 3.0));
    assert_eq!(column(row, "vx_mps"), Field::Null);
    assert_eq!(column(row, "n_heard"), Field::UInt(3));
    assert_eq!(column(&rows[6], "alive"), Field::Bool(false));
}

#[test]
fn packets_and_motes_hold_what_the_network_said() {
    let out = tempfile::tempdir().unwrap();
    let dir = finished(out.path(), header("run")).dir;
    let packets = rows(&dir, "transmissions.parquet");
    assert_eq!(packets.len(), 6 * STEPS as usize);
    assert_eq!(column(&packets[7], "sender"), Field::UInt(1));
    assert_eq!(column(&packets[7], "end_ns"), Field::ULong(STEP_NS + 12_000_000));
    assert_eq!(column(&packets[7], "payload_bytes"), Field::UInt(3));
    assert_eq!(column(&packets[7], "n_receivers"), Field::UInt(3));
    let motes = rows(&dir, "motes.parquet");
    assert_eq!(motes.len(), N * (STEPS as usize + 1));
    assert_eq!(column(&motes[0], "alive"), Field::Bool(true));
    assert_eq!(column(&motes[0], "rank"), Field::Null);
}

#[test]
fn links_are_those_asked_for() {
    let recorded = |links: Links| {
        let out = tempfile::tempdir().unwrap();
        let mut header = header("run");
        header.output.links = links;
        let dir = finished(out.path(), header).dir;
        dir.join("links.parquet").exists().then(|| rows(&dir, "links.parquet"))
    };
    assert_eq!(recorded(Links::None), None);

    // 0 and 5 hear two others, 1 and 4 three, 2 and 3 four.
    let heard = recorded(Links::Heard).unwrap();
    assert_eq!(heard.len(), 18 * STEPS as usize);
    let row = &heard[2];
    assert_eq!((column(row, "sender"), column(row, "receiver")), (Field::UInt(0), Field::UInt(1)));
    assert_eq!(column(row, "distance_m"), Field::Double(1.0));
    assert_eq!(column(row, "rssi_dbm"), Field::Float(-62.0));
    assert_eq!(column(row, "received_ns"), Field::ULong(2_000_000));
    assert_eq!(column(row, "hops"), Field::UInt(1));

    let all = recorded(Links::All).unwrap();
    assert_eq!(all.len(), 6 * 5 * STEPS as usize);
    let received: Vec<&Row> =
        all.iter().filter(|row| column(row, "received") == Field::Bool(true)).collect();
    assert_eq!(received.len(), heard.len());
    assert!(
        received.iter().zip(&heard).all(|(a, b)| column(a, "rssi_dbm") == column(b, "rssi_dbm"))
    );
    let missed = all.iter().find(|row| column(row, "received") == Field::Bool(false)).unwrap();
    assert_eq!(column(missed, "rssi_dbm"), Field::Null);

    // 360 links, each with chance 0.5: outside 180 +- 4 standard deviations (38) once in 16,000 seeds.
    let sample = recorded(Links::Sample { fraction: 0.5 }).unwrap();
    assert!((142..=218).contains(&sample.len()), "{}", sample.len());
    assert!(sample.iter().all(|row| all.contains(row)));
    assert_eq!(recorded(Links::Sample { fraction: 1.0 }).unwrap(), all);
}

#[test]
fn tables_can_hold_every_few_steps_and_the_log_still_holds_all() {
    let out = tempfile::tempdir().unwrap();
    let mut header = header("run");
    header.output.every_steps = 5;
    let dir = finished(out.path(), header).dir;
    let mut steps: Vec<Field> =
        rows(&dir, "steps.parquet").iter().map(|row| column(row, "step")).collect();
    steps.dedup();
    assert_eq!(steps, [Field::ULong(0), Field::ULong(5), Field::ULong(10)]);
    assert_eq!(verify(&dir).unwrap().steps, STEPS);
}

#[test]
fn the_data_dictionary_names_every_column() {
    let dictionary = include_str!("../../../../docs/outputs.md");
    for table in TABLES {
        assert!(dictionary.contains(&format!("`{}`", table.file)), "{}", table.file);
        for column in table.columns {
            let row = format!("| `{}` | {} | ", column.name, column.kind.name());
            assert!(dictionary.contains(&row), "{}: {row}", table.file);
            assert!(dictionary.contains(column.doc), "{}: {}", table.file, column.doc);
            assert!(dictionary.contains(column.null_when), "{}: {}", table.file, column.null_when);
        }
    }
}
