//! Tables, as HTML and as CSV.

use std::fmt::Write as _;

use files::csv_cell;
pub use plot::number;
use serde::{Deserialize, Serialize};

/// A table of texts. A cell that could not be filled is empty, never a guess.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Table {
    /// What it shows; unique within the section, since the name of the CSV file comes from it.
    pub title: String,
    pub columns: Vec<String>,
    pub rows: Vec<Vec<String>>,
    /// What a reader has to know below it; may be empty.
    pub note: String,
}

impl Table {
    pub fn new<'a>(title: impl Into<String>, columns: impl IntoIterator<Item = &'a str>) -> Self {
        let columns = columns.into_iter().map(str::to_owned).collect();
        Self { title: title.into(), columns, ..Self::default() }
    }

    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Adds a row; missing cells at its end are empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        let mut row: Vec<String> = cells.into_iter().map(Into::into).collect();
        row.resize(self.columns.len().max(row.len()), String::new());
        self.rows.push(row);
    }

    /// The table after RFC 4180, with a line of titles.
    pub fn csv(&self) -> String {
        let mut text = String::new();
        for row in std::iter::once(&self.columns).chain(&self.rows) {
            let cells: Vec<String> = row.iter().map(|cell| csv_cell(cell)).collect();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{}", cells.join(","));
        }
        text
    }
}

/// A duration in seconds for people.
pub fn seconds(value: f64) -> String {
    match value {
        _ if !value.is_finite() => String::new(),
        v if v < 1.0 => format!("{v:.2} s"),
        v if v < 10.0 => format!("{v:.1} s"),
        v if v < 600.0 => format!("{v:.0} s"),
        v if v < 36_000.0 => format!("{:.0} min", v / 60.0),
        v => format!("{:.1} h", v / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_with_commas_and_quotes_survive_as_csv() {
        let mut table = Table::new("t", ["a", "b"]);
        table.row(["1,5", "say \"no\""]);
        table.row(["alone"]);
        assert_eq!(table.csv(), "a,b\n\"1,5\",\"say \"\"no\"\"\"\nalone,\n");
    }

    #[test]
    fn durations_are_short() {
        assert_eq!([0.25, 42.0, 3000.0].map(seconds), ["0.25 s", "42 s", "50 min"]);
    }
}
