//! Packings as CSV: the cell as `H,hxx,hxy,hyx,hyy`, then one disc `x,y,r` a line (m).

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use dem::{Cell, Packing, PlainDisc, RveParameters};
use nalgebra::Matrix2;

/// Most discs of a packing.
const MOST_DISCS: usize = 1 << 16;

/// A packing file that cannot be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PackingError {
    /// The file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The packing file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A line is wrong.
    #[error("{}, line {line}: {problem}", path.display())]
    Line {
        /// The packing file.
        path: PathBuf,
        /// Number of the line, counted from 1.
        line: usize,
        /// What is wrong with it.
        problem: String,
    },
}

/// A packing as CSV, in the shortest decimals that read back exactly.
pub fn packing_csv(packing: &Packing<f64>) -> String {
    let h = packing.cell.h;
    let mut text = format!("H,{},{},{},{}\n", h[(0, 0)], h[(0, 1)], h[(1, 0)], h[(1, 1)]);
    for d in packing.plain_discs() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{},{}", d.x[0], d.x[1], d.r);
    }
    text
}

/// Reads a packing, with disc masses from the parameters.
///
/// # Errors
/// If the file cannot be read or a line is wrong.
pub fn read_packing(path: &Path, p: &RveParameters) -> Result<Packing<f64>, PackingError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| PackingError::Read { path: path.to_owned(), source })?;
    let wrong = |line: usize, problem: &str| PackingError::Line {
        path: path.to_owned(),
        line,
        problem: problem.to_owned(),
    };
    let numbers = |line: usize, text: &str, count: usize| -> Result<Vec<f64>, PackingError> {
        let numbers: Vec<f64> = text
            .split(',')
            .filter_map(|x| x.trim().parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        if numbers.len() == count && text.split(',').count() == count {
            Ok(numbers)
        } else {
            Err(wrong(line, &format!("expected {count} numbers separated by commas")))
        }
    };
    let mut lines = text.lines();
    let header = lines
        .next()
        .and_then(|line| line.strip_prefix("H,"))
        .ok_or_else(|| wrong(1, "expected the cell as H,hxx,hxy,hyx,hyy"))?;
    let cell = Cell { h: Matrix2::from_row_slice(&numbers(1, header, 4)?) };
    if cell.area() <= 0.0 || cell.inverse().is_none() {
        return Err(wrong(1, "the cell vectors must span a positive area"));
    }
    let mut discs = Vec::new();
    for (k, line) in lines.enumerate() {
        let n = numbers(k + 2, line, 3)?;
        if n[2] <= 0.0 {
            return Err(wrong(k + 2, "the radius must be positive"));
        }
        discs.push(PlainDisc { x: [n[0], n[1]], r: n[2] });
    }
    if discs.is_empty() || discs.len() > MOST_DISCS {
        return Err(wrong(2, &format!("expected 1 to {MOST_DISCS} discs")));
    }
    Ok(Packing::new(cell, &discs, |r| p.disc_mass(r)))
}
