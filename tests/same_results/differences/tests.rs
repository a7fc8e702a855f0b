use super::*;

/// What differs between two folders with these files.
fn found(before: &[(&str, &str)], after: &[(&str, &str)]) -> Vec<Difference> {
    let folders = [before, after].map(|contents| {
        let folder = tempfile::tempdir().unwrap();
        for (name, content) in contents {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, content).unwrap();
        }
        folder
    });
    folders_of(&folders).unwrap()
}

fn folders_of(folders: &[tempfile::TempDir; 2]) -> anyhow::Result<Vec<Difference>> {
    super::folders(folders[0].path(), folders[1].path(), &["data.csv".to_owned()].into())
}

/// What differs between two versions of a file: kind and place of each.
fn kinds(name: &str, before: &str, after: &str) -> Vec<(Kind, String)> {
    let found = found(&[(name, before)], &[(name, after)]);
    found.into_iter().map(|difference| (difference.kind, difference.place)).collect()
}

fn one(kind: Kind, place: &str) -> Vec<(Kind, String)> {
    vec![(kind, place.to_owned())]
}

#[test]
fn a_changed_digit_of_an_answer_is_found() {
    let difference = &found(
        &[("c.json", "{\"scores\": [{\"rmse_db\": 2.1234567890123456}]}")],
        &[("c.json", "{\"scores\": [{\"rmse_db\": 2.1234567890123461}]}")],
    )[0];
    assert_eq!(difference.kind, Kind::Number);
    let told = difference.to_string();
    let expected = "c.json /scores/0/rmse_db (number): 2.1234567890123457 -> 2.123456789012346";
    assert!(told.starts_with(expected), "{told}");
    // Types are printed: a count is not a length.
    assert_eq!(kinds("c.json", "{\"n\": 1}", "{\"n\": 1.0}"), one(Kind::Number, "c.json /n"));
    assert_eq!(kinds("c.json", "{\"n\": null}", "{\"n\": 0}"), one(Kind::Name, "c.json /n"));
}

#[test]
fn a_sentence_may_change_a_name_or_a_formula_may_not() {
    let json = |sentence: &str, name: &str, formula: &str| {
        format!("{{\"sentence\": {sentence:?}, \"effect\": {name:?}, \"formula\": {formula:?}}}")
    };
    let before = json("off by 2.5 dB", "wind", "a * x + 1");
    let against = |after: String| kinds("c.json", &before, &after);
    let sentence = "c.json /sentence";
    assert_eq!(against(json("wrong by 2.5 dB", "wind", "a * x + 1")), one(Kind::Wording, sentence));
    assert_eq!(
        against(json("wrong by 2.6 dB", "wind", "a * x + 1")),
        one(Kind::Number, &format!("{sentence} number 1"))
    );
    assert_eq!(
        against(json("off by 2.5 dB", "slip", "a * x + 1")),
        one(Kind::Name, "c.json /effect")
    );
    assert_eq!(
        against(json("off by 2.5 dB", "wind", "a * y + 1")),
        one(Kind::Name, "c.json /formula")
    );
}

#[test]
fn a_missing_file_and_a_missing_value_are_differences() {
    let files = [("a.json", "{\"x\": 1}"), ("b/report.html", "")];
    assert_eq!(found(&files, &files), []);
    let told = |difference: &Difference| (difference.kind, difference.place.clone());
    let gone = found(&files, &files[..1]);
    assert_eq!(gone.iter().map(told).collect::<Vec<_>>(), one(Kind::Missing, "b/report.html"));
    let more = found(&files[1..], &files);
    assert_eq!(more.iter().map(told).collect::<Vec<_>>(), one(Kind::Missing, "a.json"));
    assert_eq!(kinds("a.json", "{\"x\": 1}", "{}"), one(Kind::Missing, "a.json /x"));
    assert_eq!(kinds("a.json", "[1]", "[1, 2]"), one(Kind::Missing, "a.json /1"));
}

#[test]
fn what_is_printed_is_compared_by_its_numbers() {
    let kinds = |before: &str, after: &str| kinds("1-run.stdout.txt", before, after);
    let place = "1-run.stdout.txt";
    assert_eq!(
        kinds("gain 0.5\nrmse 2", "gain of 0.5\nrmse 2"),
        one(Kind::Wording, &format!("{place}:1"))
    );
    let second = one(Kind::Number, &format!("{place} number 2"));
    assert_eq!(kinds("gain 0.5\nrmse 2", "gain of 0.5\nrmse 3"), second);
    assert_eq!(kinds("gain 0.5\nrmse 2", "gain of 0.5"), second);
    // How long it took is not compared, nor how far it was every few seconds.
    let told = |wall: &str| format!("run: 3 s simulated in {wall} s (30 steps/s)\nend");
    assert_eq!(kinds(&told("0.1"), &told("0.2")), []);
    // What is printed as JSON is an answer.
    assert_eq!(
        kinds("{\"a\": 1,\n\"b\": 2}", "{\"a\": 1,\n\"b\": 3}"),
        one(Kind::Number, &format!("{place} /b"))
    );
}

#[test]
fn progress_is_not_compared_and_warnings_are() {
    let kinds =
        |after: &str| kinds("1-run.stderr.txt", "step 16/99\nwarning: 3 rows are odd", after);
    assert_eq!(kinds("step 32/99\nstep 64/99\nwarning: 3 rows are odd"), []);
    assert_eq!(kinds("warning: odd are 3 rows"), one(Kind::Wording, "1-run.stderr.txt"));
    assert_eq!(kinds("warning: 4 rows are odd"), one(Kind::Number, "1-run.stderr.txt number 1"));
    assert_eq!(kinds("step 32/99"), one(Kind::Number, "1-run.stderr.txt number 1"));
}

#[test]
fn where_the_commands_ran_does_not_matter() {
    let folders = ["a", "b"].map(|name| {
        let folder = tempfile::Builder::new().prefix(name).tempdir().unwrap();
        let home = folder.path().canonicalize().unwrap();
        let text = format!("file = {:?}", home.join("places.csv"));
        std::fs::write(folder.path().join("config.toml"), text).unwrap();
        folder
    });
    assert_eq!(folders_of(&folders).unwrap(), []);
}

#[test]
fn pages_are_compared_by_what_they_show_and_draw() {
    let page = |margin: u8, text: &str, x: f64| {
        format!(
            "<style>p {{ margin: {margin}px }}</style><p>{text}</p><svg><path d=\"M{x},2\"/></svg>"
        )
    };
    let kinds = |after: String| kinds("report.html", &page(3, "5 of 6", 1.5), &after);
    assert_eq!(kinds(page(4, "5\n of <b>6</b>", 1.5)), []);
    assert_eq!(kinds(page(3, "5 out of 6", 1.5)), one(Kind::Wording, "report.html"));
    assert_eq!(kinds(page(3, "5 of 7", 1.5)), one(Kind::Number, "report.html number 2"));
    assert_eq!(kinds(page(3, "5 of 6", 1.6)), one(Kind::Number, "report.html pictures number 1"));
}

#[test]
fn recordings_are_promised_to_the_byte() {
    let change = |name: &str, before: &str, after: &str| {
        let path = format!("runs/x/{name}");
        let beside = ("runs/x/provenance.json", "{\"started\": 1}");
        let later = ("runs/x/provenance.json", "{\"started\": 2}");
        let found = found(&[beside, (&path, before)], &[later, (&path, after)]);
        found.into_iter().map(|difference| (difference.kind, difference.place)).collect::<Vec<_>>()
    };
    assert_eq!(change("config.toml", "# a b\nx = 1", "# a b\nx = 1"), []);
    assert_eq!(
        change("config.toml", "# a b\nx = 1", "# a c\nx = 1"),
        one(Kind::Byte, "runs/x/config.toml:1")
    );
    assert_eq!(change("config.toml", "x = 1", "x = 1\n"), one(Kind::Byte, "runs/x/config.toml"));
    assert_eq!(
        change("summary.json", "{\"x\": 1}", "{\"x\": 2}"),
        one(Kind::Number, "runs/x/summary.json /x")
    );
    let reworded = change("summary.json", "{\"x\": \"a b\"}", "{\"x\": \"a c\"}");
    assert!(reworded.iter().any(|(kind, _)| *kind == Kind::Byte), "{reworded:?}");
    // Elsewhere the comments of a file of settings may be worded otherwise, its values not.
    assert_eq!(
        kinds("m.toml", "# a b 1\nx = 1", "# a c 1\nx = 1"),
        one(Kind::Wording, "m.toml comments")
    );
    assert_eq!(kinds("m.toml", "# a b\nx = 1", "# a b\nx = 2"), one(Kind::Number, "m.toml /x"));
    assert_eq!(kinds("m.csv", "a,b\n1,2\n", "a,b\n1,3\n"), one(Kind::Byte, "m.csv:2"));
    assert_eq!(kinds("data.csv", "a,b\n1,2\n", "a,b\n1,3\n"), [], "an input");
}

/// An MCAP file with these messages on one topic.
fn mcap(messages: &[&str]) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut file).unwrap();
    let channel = writer.add_channel(0, "/tf", "json", &Default::default()).unwrap();
    for (sequence, message) in (0..).zip(messages) {
        let log_time = u64::from(sequence) * 100;
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence,
            log_time,
            publish_time: log_time,
        };
        writer.write_to_known_channel(&header, message.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

#[test]
fn the_first_message_that_differs_is_named() {
    let folders = [mcap(&["a1", "b2"]), mcap(&["a1", "b3"])].map(|bytes| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("run.mcap"), bytes).unwrap();
        folder
    });
    let found = folders_of(&folders).unwrap();
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].kind, Kind::Byte);
    assert_eq!(found[0].before, "message 1 on /tf at 100 ns, 2 bytes, from byte 1 [32]");
    assert_eq!(found[0].after, "message 1 on /tf at 100 ns, 2 bytes, from byte 1 [33]");
    let shorter = mcap(&["a1"]);
    let differs = recorded::first_message(&mcap(&["a1", "b2"]), &shorter).unwrap().unwrap();
    assert_eq!(differs.1, "no message 1");
    assert_eq!(recorded::first_message(&shorter, &shorter).unwrap(), None);
}
