//! Paths of element tests as CSV.

use dem::element::Row;
use nalgebra::Matrix2;

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

/// Where the columns of a path are in a table, in the order of [`Row::COLUMNS`].
pub(crate) struct PathColumns([usize; Row::COLUMNS.len()]);

/// A cell of a row that is no number.
#[derive(Debug, thiserror::Error)]
#[error("`{cell}` is not a number")]
pub(crate) struct NotANumber<'a> {
    /// Name of its column.
    pub column: &'static str,
    cell: &'a str,
}

impl PathColumns {
    /// Of a table with this header; the name of the first column that it lacks otherwise.
    pub fn of(header: &str) -> Result<Self, &'static str> {
        let names: Vec<&str> = header.split(',').collect();
        let mut places = [0; Row::COLUMNS.len()];
        for (place, column) in places.iter_mut().zip(Row::COLUMNS) {
            *place = names.iter().position(|name| *name == column).ok_or(column)?;
        }
        Ok(Self(places))
    }

    /// The row of a line.
    pub fn row<'a>(&self, line: &'a str) -> Result<Row, NotANumber<'a>> {
        let cells: Vec<&str> = line.split(',').collect();
        let mut values = [0.0; Row::COLUMNS.len()];
        for ((value, &place), column) in values.iter_mut().zip(&self.0).zip(Row::COLUMNS) {
            let cell = cells.get(place).copied().unwrap_or_default();
            *value = cell.trim().parse().map_err(|_| NotANumber { column, cell })?;
        }
        let [t, exx, exy, eyx, eyy, sxx, sxy, syx, syy, solid_fraction, coordination, inertial] =
            values;
        Ok(Row {
            t,
            strain: Matrix2::new(exx, exy, eyx, eyy),
            stress: Matrix2::new(sxx, sxy, syx, syy),
            solid_fraction,
            coordination,
            inertial_number: inertial,
        })
    }
}
