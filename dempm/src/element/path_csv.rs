//! Paths of element tests as CSV.

use dem::element::Row;

/// The rows of a path under the names of their columns; stresses are tension positive.
pub fn path_csv(rows: &[Row]) -> String {
    let mut text = Row::COLUMNS.join(",") + "\n";
    for row in rows {
        let values: Vec<String> = row.values().iter().map(|x| format!("{x:.9e}")).collect();
        text += &values.join(",");
        text += "\n";
    }
    text
}
