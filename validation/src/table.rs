//! Tables, as HTML and as CSV.

use std::fmt::Write as _;

use dempm::dataset::quoted;
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
            let cells: Vec<String> = row.iter().map(|cell| quoted(cell)).collect();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{}", cells.join(","));
        }
        text
    }
}

/// A number for people: three significant digits, exponents where zeros would pile up.
pub fn number(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if !value.is_finite() => String::new(),
        0.0 => "0".to_owned(),
        _ if !(1e-3..1e5).contains(&size) => format!("{value:.1e}"),
        _ => {
            let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
            trimmed(format!("{value:.decimals$}"))
        }
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

fn trimmed(number: String) -> String {
    if number.contains('.') {
        number.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        number
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
    fn numbers_are_short() {
        let texts = [0.0, 3.0, 0.0625, 2.345, 123.4, 1.23e-6, 921_600.0, f64::NAN].map(number);
        assert_eq!(texts, ["0", "3", "0.0625", "2.35", "123", "1.2e-6", "9.2e5", ""]);
        assert_eq!([0.25, 42.0, 3000.0].map(seconds), ["0.25 s", "42 s", "50 min"]);
    }
}
