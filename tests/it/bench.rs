//! Speed through the real processes: that it is measured. How fast it is, no test asks.

use serde_json::Value;
use tests::{folder, orchestrator, said};

#[test]
fn rows_come_with_what_two_empty_calls_take() {
    let folder = folder();
    let args =
        ["bench", "--table", "propagation", "--agents", "5", "--steps", "20", "--json", "b.json"];
    let output = orchestrator(&args, folder.path());
    let said = said(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("unit disk 3 m"), "{said}");
    assert!(said.contains("Two empty calls"), "{said}");
    let text = std::fs::read_to_string(folder.path().join("b.json")).unwrap();
    let json: Value = serde_json::from_str(&text).unwrap();
    let exchange_ms = json["exchange_ms"].as_f64().unwrap();
    assert!(0.0 < exchange_ms, "{json:#}");
    let rows = json["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 3, "{json:#}");
    for row in rows {
        assert_eq!(row["steps"], 20, "{json:#}");
        assert!(0.0 < row["median_ms"].as_f64().unwrap(), "{json:#}");
    }
}
