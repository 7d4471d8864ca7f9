//! Packings as CSV: the cell as `H,hxx,hxy,hyx,hyy`, then one disc `x,y,r` a line (m).

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use dem::{Cell, Packing, PlainDisc, RveParameters};
use nalgebra::Matrix2;

/// Most discs of a packing.
const MOST_DISCS: usize = 1 << 16;
/// Most bytes that are read: so many discs with all their digits.
const MOST_BYTES: u64 = 1 << 23;
/// Largest number, m.
const LARGEST: f64 = 1.0e5;
/// Radii, m: up to those of scenes.
const RADII: RangeInclusive<f64> = 1.0e-6..=0.5;
/// Area of the discs over that of the cell. A packing deforms from gas to overlapping discs, but bins of
/// the size of its discs must fit into memory.
const SOLID_FRACTION: RangeInclusive<f64> = 0.01..=2.0;

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
    let unreadable = |source| PackingError::Read { path: path.to_owned(), source };
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    let (cell, discs) = parse(&bytes)
        .and_then(|packing| match bytes.len() as u64 > MOST_BYTES {
            true => Err((1 + packing.1.len(), format!("more than {MOST_BYTES} bytes"))),
            false => Ok(packing),
        })
        .map_err(|(line, problem)| PackingError::Line { path: path.to_owned(), line, problem })?;
    Ok(Packing::new(cell, &discs, |r| p.grains.disc_mass(r)))
}

/// Cell and discs. Errors come with the number of their line.
fn parse(bytes: &[u8]) -> Result<(Cell, Vec<PlainDisc>), (usize, String)> {
    let mut lines = bytes.split(|&byte| byte == b'\n').collect::<Vec<_>>();
    // The end of the last line is not a line of its own.
    if lines.last().is_some_and(|line| line.is_empty()) {
        lines.pop();
    }
    let mut lines = lines.into_iter().zip(1..);
    let (first, _) = lines.next().unwrap_or((&[], 1));
    let header = str::from_utf8(first).ok().and_then(|line| line.strip_prefix("H,"));
    let header = header.ok_or_else(|| (1, "expected the cell as H,hxx,hxy,hyx,hyy".to_owned()))?;
    let cell = Cell { h: Matrix2::from_row_slice(&numbers::<4>(header.as_bytes(), 1)?) };
    if cell.area() <= 0.0 || cell.inverse().is_none() {
        return Err((1, "the cell vectors must span a positive area".to_owned()));
    }
    let mut discs = Vec::new();
    for (line, number) in lines {
        if discs.len() == MOST_DISCS {
            return Err((number, format!("more than {MOST_DISCS} discs")));
        }
        let [x, y, r] = numbers(line, number)?;
        if !RADII.contains(&r) {
            let (least, most) = (RADII.start(), RADII.end());
            return Err((number, format!("the radius must be from {least:e} to {most} m")));
        }
        discs.push(PlainDisc { x: [x, y], r });
    }
    if discs.is_empty() {
        return Err((2, "expected a disc as x,y,r".to_owned()));
    }
    let solid = discs.iter().map(|d| PI * d.r * d.r).sum::<f64>() / cell.area();
    if !SOLID_FRACTION.contains(&solid) {
        let (least, most) = (SOLID_FRACTION.start(), SOLID_FRACTION.end());
        let problem = format!(
            "the discs fill {solid:.3e} of the area of the cell, it must be from {least} to {most}"
        );
        return Err((1, problem));
    }
    Ok((cell, discs))
}

/// The numbers of a line, separated by commas.
fn numbers<const N: usize>(line: &[u8], number: usize) -> Result<[f64; N], (usize, String)> {
    let wrong =
        || (number, format!("expected {N} numbers of at most {LARGEST:e}, separated by commas"));
    let text = str::from_utf8(line).map_err(|_| wrong())?;
    let one = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.abs() <= LARGEST);
    // One more than wanted shows that there are too many.
    let numbers: Option<Vec<f64>> = text.splitn(N + 1, ',').map(one).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The line of the first error.
    fn line(text: impl AsRef<[u8]>) -> usize {
        parse(text.as_ref()).unwrap_err().0
    }

    #[test]
    fn any_damage_is_an_error_with_its_line() {
        let good = "H,0.1,0,0,0.1\n0.05,0.05,0.04\n";
        assert!(parse(good.as_bytes()).is_ok());
        for number in ["nan", "inf", "-inf", "1e300", "", "x", "0.05,0.05", "\0"] {
            assert_eq!(line(good.replace("0.05,0.05", &format!("0.05,{number}"))), 2, "{number}");
            assert_eq!(line(good.replace("H,0.1", &format!("H,{number}"))), 1, "{number}");
        }
        for radius in ["0", "-1", "1e-300", "7", "NaN"] {
            assert_eq!(line(good.replace("0.04", radius)), 2, "{radius}");
        }
        for text in [
            "",
            "\n",
            "H",
            "H,",
            "h,1,0,0,1\n",
            "H,0.1,0,0\n",
            "H,0,0,0,0\n",
            "H,0.1,0.1,0.1,0.1\n",
        ] {
            assert_eq!(line(text), 1, "{text:?}");
        }
        assert_eq!(line("H,0.1,0,0,0.1\n"), 2);
        assert_eq!(line("H,0.1,0,0,0.1\n\n"), 2);
        assert_eq!(line(b"H,0.1,0,0,0.1\n0.05,\xff,0.04"), 2);
        // Empty space, and discs upon discs.
        assert_eq!(line(good.replace("0.1", "1000")), 1);
        assert_eq!(line(format!("{good}{}", "0.05,0.05,0.04\n".repeat(9))), 1);
    }

    #[test]
    fn files_without_end_are_refused_early() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("long.csv");
        let read = || read_packing(&path, &RveParameters::default()).unwrap_err().to_string();
        std::fs::write(&path, format!("H,1,0,0,1\n{}", "0.5,0.5,0.001\n".repeat(1_000_000)))
            .unwrap();
        assert!(read().contains("long.csv, line 65538: more than 65536 discs"), "{}", read());
        std::fs::write(&path, format!("H,{}", "1".repeat(MOST_BYTES as usize))).unwrap();
        assert!(read().contains("long.csv, line 1:"), "{}", read());
    }
}
