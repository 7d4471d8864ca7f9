//! Curves of element tests: tables of laboratories, and those that `dempm element` writes.
//!
//! Signs are those of soil mechanics: compression and contraction are positive. Strains are those of the initial
//! length or area, 1 - l / l0.

use std::path::Path;

use dem::element::Row;

use super::error::CalibrationError;
use super::quantity::Quantity;
use crate::element::PathColumns;

/// Points of a curve: the abscissa, and one value of each ordinate.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Curve {
    pub x: Vec<f64>,
    pub y: Vec<Vec<f64>>,
}

/// Least number of points of a curve.
const FEWEST: usize = 3;

/// Reads the abscissa and those of the ordinates that a table has.
pub(super) fn read(
    path: &Path,
    abscissa: Quantity,
    ordinates: &[Quantity],
) -> Result<(Curve, Vec<Quantity>), CalibrationError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| CalibrationError::Read { path: path.to_owned(), source })?;
    let error = |line: usize, problem: String| {
        Err(CalibrationError::Data { path: path.to_owned(), line, problem })
    };
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(k, line)| (k + 1, line.trim().trim_start_matches('\u{feff}')))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let Some((header_line, header)) = lines.next() else {
        return error(1, "the table is empty".into());
    };
    if let Ok(columns) = PathColumns::of(header) {
        let rows = element_rows(path, &columns, lines)?;
        let curve = of_rows(&rows, abscissa, ordinates);
        return Ok((curve, ordinates.to_vec()));
    }
    let separator = [';', '\t'].into_iter().find(|&c| header.contains(c)).unwrap_or(',');
    let mut columns = Vec::new();
    for title in header.split(separator) {
        match column(title, abscissa, ordinates) {
            Ok(column) => columns.push(column),
            Err(problem) => return error(header_line, problem),
        }
    }
    let place = |quantity| {
        columns.iter().position(|column| column.is_some_and(|(found, _)| found == quantity))
    };
    let Some(x_column) = place(abscissa) else {
        let wanted = format!("{} with {}", abscissa.name(), abscissa.units());
        return error(header_line, format!("there is no column {wanted}"));
    };
    let found: Vec<(Quantity, usize)> =
        ordinates.iter().filter_map(|&quantity| Some((quantity, place(quantity)?))).collect();
    if found.is_empty() {
        let names: Vec<_> = ordinates.iter().map(|quantity| quantity.name()).collect();
        return error(header_line, format!("there is no column {}", names.join(" or ")));
    }
    let mut curve = Curve { x: Vec::new(), y: vec![Vec::new(); found.len()] };
    for (line, text) in lines {
        let cells: Vec<&str> = text.split(separator).map(str::trim).collect();
        if cells.len() != columns.len() {
            let problem = format!("{} values for {} columns", cells.len(), columns.len());
            return error(line, problem);
        }
        let value = |place: usize| match (cells[place].parse::<f64>(), columns[place]) {
            (Ok(value), Some((_, factor))) if value.is_finite() => Ok(value * factor),
            _ => Err(format!("`{}` is not a number", cells[place])),
        };
        let x = match value(x_column) {
            Ok(x) => x,
            Err(problem) => return error(line, problem),
        };
        if curve.x.last().is_some_and(|&last| x < last) {
            let problem = format!("{} falls; a curve has no unloading", abscissa.name());
            return error(line, problem);
        }
        curve.x.push(x);
        for (values, &(_, place)) in curve.y.iter_mut().zip(&found) {
            match value(place) {
                Ok(y) => values.push(y),
                Err(problem) => return error(line, problem),
            }
        }
    }
    if curve.x.len() < FEWEST {
        return error(header_line, format!("{} points are too few", curve.x.len()));
    }
    Ok((curve, found.into_iter().map(|(quantity, _)| quantity).collect()))
}

/// The quantity of a column and the factor of its unit; `None` for columns that no test knows.
fn column(
    title: &str,
    abscissa: Quantity,
    ordinates: &[Quantity],
) -> Result<Option<(Quantity, f64)>, String> {
    let title = title.trim();
    let (name, unit) = match title.split_once('[') {
        Some((name, rest)) => (name.trim(), rest.trim_end().strip_suffix(']')),
        None => (title, None),
    };
    let known = std::iter::once(abscissa).chain(ordinates.iter().copied());
    let Some(quantity) = known.into_iter().find(|quantity| quantity.name() == name) else {
        return Ok(None);
    };
    let factor = unit.and_then(|unit| quantity.factor(unit.trim()));
    factor
        .map(|factor| Some((quantity, factor)))
        .ok_or_else(|| format!("the column `{title}` needs its unit: {name} {}", quantity.units()))
}

/// Rows of a path that `dempm element` has written.
fn element_rows<'a>(
    path: &Path,
    columns: &PathColumns,
    lines: impl Iterator<Item = (usize, &'a str)>,
) -> Result<Vec<Row>, CalibrationError> {
    let error = |line, problem| CalibrationError::Data { path: path.to_owned(), line, problem };
    let rows: Vec<Row> = lines
        .map(|(line, text)| {
            let count = text.split(',').count();
            if count != Row::COLUMNS.len() {
                return Err(error(line, format!("{count} values for 12 columns")));
            }
            columns.row(text).map_err(|problem| error(line, problem.to_string()))
        })
        .collect::<Result<_, _>>()?;
    if rows.len() < FEWEST {
        return Err(error(1, format!("{} points are too few", rows.len())));
    }
    Ok(rows)
}

/// The curve of a path. Its strains count from the first row. Stresses of a row are means over its interval, so strains
/// are those of the middle of it.
pub(super) fn of_rows(rows: &[Row], abscissa: Quantity, ordinates: &[Quantity]) -> Curve {
    let Some(start) = rows.first() else { return Curve::default() };
    let before = std::iter::once(start).chain(rows);
    let middles: Vec<Row> = before
        .zip(rows)
        .map(|(a, b)| Row { strain: 0.5 * (a.strain + b.strain) - start.strain, ..*b })
        .collect();
    let value = |row: &Row, quantity| {
        let e = row.strain;
        let shortening = |logarithmic: f64| 1.0 - logarithmic.exp();
        match quantity {
            Quantity::AxialStrain => shortening(e[(1, 1)]),
            Quantity::ShearStrain => e[(0, 1)],
            Quantity::VolumetricStrain => shortening(e.trace()),
            Quantity::DeviatoricStress => row.stress[(0, 0)] - row.stress[(1, 1)],
            Quantity::ShearStress => row.stress[(0, 1)],
            Quantity::AxialStress => -row.stress[(1, 1)],
        }
    };
    let of = |quantity| middles.iter().map(|row| value(row, quantity)).collect();
    Curve { x: of(abscissa), y: ordinates.iter().copied().map(of).collect() }
}

impl Curve {
    /// The same with an abscissa that never falls: fluctuations keep its largest value so far.
    pub fn rising(mut self) -> Self {
        for k in 1..self.x.len() {
            self.x[k] = self.x[k].max(self.x[k - 1]);
        }
        self
    }

    /// At most `points` points: means over as many equal parts of the abscissa.
    pub fn reduced(&self, points: usize) -> Self {
        let (Some(&first), Some(&last)) = (self.x.first(), self.x.last()) else {
            return self.clone();
        };
        if self.x.len() <= points {
            return self.clone();
        }
        let part =
            |x: f64| (((x - first) / (last - first) * points as f64) as usize).min(points - 1);
        let mut reduced = Self { x: Vec::new(), y: vec![Vec::new(); self.y.len()] };
        for k in 0..points {
            let within: Vec<usize> = (0..self.x.len()).filter(|&n| part(self.x[n]) == k).collect();
            let mean = |values: &[f64]| {
                within.iter().map(|&n| values[n]).sum::<f64>() / within.len() as f64
            };
            if !within.is_empty() {
                reduced.x.push(mean(&self.x));
                for (values, y) in reduced.y.iter_mut().zip(&self.y) {
                    values.push(mean(y));
                }
            }
        }
        reduced
    }

    /// Ordinate `k` at `x`, linear between points; that of the nearest end outside of them.
    pub fn at(&self, k: usize, x: f64) -> f64 {
        let after = self.x.partition_point(|&a| a < x);
        let y = &self.y[k];
        if after == 0 {
            return y[0];
        }
        if after == self.x.len() {
            return y[after - 1];
        }
        let share = (x - self.x[after - 1]) / (self.x[after] - self.x[after - 1]);
        y[after - 1] + share * (y[after] - y[after - 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: [Quantity; 2] = [Quantity::DeviatoricStress, Quantity::VolumetricStrain];

    fn table(text: &str) -> Result<(Curve, Vec<Quantity>), String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("b.csv");
        std::fs::write(&path, text).unwrap();
        let name = format!("{}, ", path.display());
        read(&path, Quantity::AxialStrain, &WANTED).map_err(|e| e.to_string().replace(&name, ""))
    }

    #[test]
    fn a_table_of_a_laboratory_is_read_in_its_units() {
        let text = "# sand, 100 kPa\naxial_strain [%],p [kPa],deviatoric_stress [kPa]\n\
                    0,100,0\n1,150,80.5\n2,160,90\n";
        let (curve, found) = table(text).unwrap();
        for separator in [";", "\t"] {
            assert_eq!(table(&text.replace(',', separator)).unwrap().0, curve);
        }
        assert_eq!(found, [Quantity::DeviatoricStress]);
        assert_eq!(curve.x, [0.0, 0.01, 0.02]);
        assert_eq!(curve.y, [[0.0, 80.5e3, 90.0e3]]);
        assert_eq!(curve.at(0, 0.005), 40.25e3);
        assert_eq!((curve.at(0, -1.0), curve.at(0, 1.0)), (0.0, 90.0e3));
        let reduced = curve.reduced(2);
        assert_eq!(reduced.x, [0.0, 0.015]);
        assert_eq!(reduced.y, [[0.0, 85.25e3]]);
    }

    #[test]
    fn problems_name_their_line() {
        for (text, problem) in [
            ("", "line 1: the table is empty"),
            (
                "axial_strain,deviatoric_stress [kPa]\n",
                "line 1: the column `axial_strain` needs its unit: axial_strain [-] or [%]",
            ),
            (
                "\naxial_strain [%],deviatoric_stress [psi]\n",
                "line 2: the column `deviatoric_stress [psi]` needs its unit: deviatoric_stress [Pa], [kPa] or [MPa]",
            ),
            (
                "strain [%],deviatoric_stress [kPa]\n",
                "line 1: there is no column axial_strain with [-] or [%]",
            ),
            (
                "axial_strain [%],q [kPa]\n",
                "line 1: there is no column deviatoric_stress or volumetric_strain",
            ),
            ("axial_strain [%],deviatoric_stress [kPa]\n0,1\n1,x\n", "line 3: `x` is not a number"),
            (
                "axial_strain [%],deviatoric_stress [kPa]\n0,1\n1\n",
                "line 3: 1 values for 2 columns",
            ),
            (
                "axial_strain [%],deviatoric_stress [kPa]\n0,1\n2,3\n1,2\n",
                "line 4: axial_strain falls; a curve has no unloading",
            ),
            (
                "axial_strain [%],deviatoric_stress [kPa]\n0,1\n2,3\n",
                "line 1: 2 points are too few",
            ),
        ] {
            assert_eq!(table(text).unwrap_err(), problem);
        }
    }

    #[test]
    fn a_path_of_an_element_test_is_a_curve() {
        let row = |e: f64, s: f64| format!("0,0.01,0,0,{e},-1e5,0,0,{s},0.8,4,1e-3\n");
        let header = Row::COLUMNS.join(",") + "\n";
        let (curve, _) =
            table(&[header, row(0.0, -1e5), row(-0.1, -2e5), row(-0.2, -3e5)].concat()).unwrap();
        assert_eq!(curve.y[0], [0.0, 1e5, 2e5]);
        assert!((curve.x[1] - (1.0 - (-0.05_f64).exp())).abs() < 1e-12, "the middle of a row");
        assert_eq!(curve.x, curve.y[1], "width is constant: area shrinks as height");
    }
}
