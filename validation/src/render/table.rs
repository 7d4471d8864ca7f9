//! Tables of texts, and their CSV files.

use std::fmt::Write as _;

use files::csv_cell;
use serde::{Deserialize, Serialize};

/// A table of texts. A cell without a value is empty.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Table {
    /// What it shows; unique within the section, since the CSV file is named after it.
    pub title: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// Cells, as many in each row as there are columns.
    pub rows: Vec<Vec<String>>,
    /// Explanation below the table; may be empty.
    pub note: String,
}

impl Table {
    /// A table without rows.
    pub fn new<'a>(title: impl Into<String>, columns: impl IntoIterator<Item = &'a str>) -> Self {
        let columns = columns.into_iter().map(str::to_owned).collect();
        Self { title: title.into(), columns, ..Self::default() }
    }

    /// The same with an explanation below it.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Adds a row; missing cells at its end stay empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        let mut row: Vec<String> = cells.into_iter().map(Into::into).collect();
        row.resize(self.columns.len().max(row.len()), String::new());
        self.rows.push(row);
    }

    /// Adds the rows of another table whose first cell is one of these; columns go by their headings.
    pub fn rows_of(&mut self, other: &Self, first_cells: &[&str]) {
        let places: Vec<Option<usize>> = self
            .columns
            .iter()
            .map(|heading| other.columns.iter().position(|column| column == heading))
            .collect();
        for row in other.rows.iter().filter(|row| first_cells.contains(&row[0].as_str())) {
            let cell = |place: &Option<usize>| place.map_or(String::new(), |k| row[k].clone());
            self.rows.push(places.iter().map(cell).collect());
        }
    }

    /// The table as CSV (RFC 4180) with a line of headings.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_another_table_go_by_headings() {
        let mut table = Table::new("t", ["scene", "b", "c"]);
        table.row(["one", "1", "2"]);
        let mut other = Table::new("t", ["scene", "c", "d"]);
        other.row(["one", "3", "4"]);
        other.row(["two", "5", "6"]);
        table.rows_of(&other, &["two", "three"]);
        assert_eq!(table.rows, [["one", "1", "2"], ["two", "", "5"]]);
    }

    #[test]
    fn cells_with_commas_and_quotes_survive_as_csv() {
        let mut table = Table::new("t", ["a", "b"]);
        table.row(["1,5", "say \"no\""]);
        table.row(["alone"]);
        assert_eq!(table.csv(), "a,b\n\"1,5\",\"say \"\"no\"\"\"\nalone,\n");
    }
}
