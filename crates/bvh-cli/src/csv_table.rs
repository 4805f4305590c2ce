//! Tables of the program as CSV, in the same form as the tables of the experiments.

use serde::Serialize;

/// Returns a table with one line per row, under the names of the columns, which commas separate.
/// Numbers have the fewest digits that read back as the same number.
pub fn to_bytes<Row: Serialize>(
    columns: &str,
    rows: impl IntoIterator<Item = Row>,
) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(columns.split(','))?;
    for row in rows {
        writer.serialize(row)?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}
