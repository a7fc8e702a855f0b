//! Where two recordings differ.

use anyhow::Context as _;
use bytes::Bytes;
use parquet::file::reader::{FileReader as _, SerializedFileReader};

/// The first message of two MCAP files that differs, if any: topic, schema, number, times and content count, as in
/// [`crate::recording`].
pub(super) fn first_message(
    before: &[u8],
    after: &[u8],
) -> anyhow::Result<Option<(String, String)>> {
    let [mut before, mut after] =
        [mcap::MessageStream::new(before)?, mcap::MessageStream::new(after)?];
    for index in 0.. {
        let [before, after] = [before.next().transpose()?, after.next().transpose()?];
        if before.is_none() && after.is_none() {
            break;
        }
        let seen = |message: &mcap::Message<'_>| {
            let schema = message.channel.schema.as_ref().map(|schema| schema.name.clone());
            let times = (message.sequence, message.log_time, message.publish_time);
            (message.channel.topic.clone(), schema, times, message.data.to_vec())
        };
        let [was, is] = [before.as_ref().map(seen), after.as_ref().map(seen)];
        if was == is {
            continue;
        }
        let at = match (&was, &is) {
            (Some(was), Some(is)) => was.3.iter().zip(&is.3).position(|(a, b)| a != b),
            _ => None,
        };
        let told = |message: &Option<mcap::Message<'_>>| match message {
            None => format!("no message {index}"),
            Some(message) => {
                let from = at.unwrap_or(0);
                let some = &message.data[from.min(message.data.len())..];
                format!(
                    "message {index} on {} at {} ns, {} bytes, from byte {from} {:02x?}",
                    message.channel.topic,
                    message.log_time,
                    message.data.len(),
                    &some[..some.len().min(8)]
                )
            }
        };
        return Ok(Some((told(&before), told(&after))));
    }
    Ok(None)
}

/// The first cell of two Parquet tables that differs, if any: its place, and what it was and is.
pub(super) fn first_cell(
    before: Vec<u8>,
    after: Vec<u8>,
) -> anyhow::Result<Option<(String, String, String)>> {
    let open = |bytes: Vec<u8>| {
        SerializedFileReader::new(Bytes::from(bytes)).context("a Parquet table was expected")
    };
    let [before, after] = [open(before)?, open(after)?];
    let schema = |reader: &SerializedFileReader<Bytes>| {
        let columns = reader.metadata().file_metadata().schema_descr().columns().to_vec();
        let typed = columns.iter().map(|column| (column.name().to_owned(), column.physical_type()));
        typed.collect::<Vec<_>>()
    };
    let [was, is] = [schema(&before), schema(&after)];
    if was != is {
        return Ok(Some(("columns".to_owned(), format!("{was:?}"), format!("{is:?}"))));
    }
    let [mut before, mut after] = [before.get_row_iter(None)?, after.get_row_iter(None)?];
    for row in 0.. {
        let (was, is) = match (before.next().transpose()?, after.next().transpose()?) {
            (None, None) => break,
            (Some(was), Some(is)) => (was, is),
            (was, _) => {
                let told = |is: bool| if is { "a row" } else { "no row" }.to_owned();
                let place = format!("row {row}");
                return Ok(Some((place, told(was.is_some()), told(was.is_none()))));
            }
        };
        for ((name, was), (_, is)) in was.get_column_iter().zip(is.get_column_iter()) {
            // As text, in which a number that is none equals itself.
            let (was, is) = (was.to_string(), is.to_string());
            if was != is {
                return Ok(Some((format!("row {row} {name}"), was, is)));
            }
        }
    }
    Ok(None)
}
