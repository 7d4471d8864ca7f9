//! Charts of the paths of element tests: stress, friction and volume over the shear strain.

use std::path::{Path, PathBuf};

use dem::element::Row;
use files::{WriteError, write_atomically};
use plot::{Anchor, Canvas, Curve, Graph, PlotError, series_colour};

use super::shorten::shortened;
use crate::element::PathColumns;

/// A path that could not be drawn.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PathError {
    /// The file cannot be read.
    #[error("{}: cannot read it", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not the path of an element test.
    #[error("{}: {problem}", path.display())]
    #[diagnostic(help("`dempm element` writes the paths that can be drawn"))]
    NotAPath {
        /// The file.
        path: PathBuf,
        /// What it lacks.
        problem: String,
    },
    /// Drawing failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plot(#[from] PlotError),
    /// The file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
    /// The image cannot be written as PNG.
    #[error("cannot write the PNG")]
    Encode(#[from] image::ImageError),
}

/// A state of a path in the quantities of the charts.
#[derive(Clone, Copy, Debug, PartialEq)]
struct State {
    /// Shear strain: the difference of the principal strains.
    strain: f64,
    /// Mean stress, compression positive (Pa).
    mean: f64,
    /// Shear stress: half the difference of the principal stresses (Pa).
    shear: f64,
    /// Solid fraction.
    solid_fraction: f64,
}

/// A chart: name and unit of its quantity, and the quantity.
type Quantity = (&'static str, fn(&State) -> f64);

const CHARTS: [Quantity; 4] = [
    ("shear stress (s1 − s2) / 2 (kPa)", |s| 1e-3 * s.shear),
    ("mean stress (s1 + s2) / 2 (kPa)", |s| 1e-3 * s.mean),
    // Without stress there is no friction.
    ("sin φ = (s1 − s2) / (s1 + s2)", |s| if s.mean > 0.0 { s.shear / s.mean } else { f64::NAN }),
    ("solid fraction", |s| s.solid_fraction),
];

/// Writes a PNG of four charts, `width` pixels wide, with a line for each path (CSV, as `dempm element` writes it).
///
/// # Errors
/// If a file is not a path, or the picture cannot be written.
pub fn draw_paths(paths: &[PathBuf], width: u32, output: &Path) -> Result<(), PathError> {
    let read: Vec<Vec<State>> = paths.iter().map(|path| read(path)).collect::<Result<_, _>>()?;
    let width = f64::from(width);
    let font = 9.5 + 0.0065 * width;
    let (gap, top) = (6.4 * font, 3.0 * font);
    let size = [0.5 * (width - 2.0 * gap - 1.2 * font), 0.27 * width];
    let height = top + 2.0 * (size[1] + 4.2 * font);
    let mut canvas = Canvas::new(width as u32, height.ceil() as u32)?;
    canvas.draw(|pen| {
        let mut x = gap;
        for (k, path) in paths.iter().enumerate() {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            let room = width - x - 2.5 * font;
            if room < 2.0 * font {
                break;
            }
            let name = shortened(pen, &name.replace(char::is_control, " "), font, room);
            pen.line(
                &[[x, 1.4 * font], [x + 1.6 * font, 1.4 * font]],
                0.2 * font,
                series_colour(k),
            )?;
            pen.text(&name, [x + 2.1 * font, 1.4 * font], font, Anchor::Left)?;
            x += pen.text_width(&name, font) + 4.0 * font;
        }
        for (index, (name, of)) in CHARTS.into_iter().enumerate() {
            let left = gap + (index % 2) as f64 * (size[0] + gap);
            let top = top + (index / 2) as f64 * (size[1] + 4.2 * font);
            let curve = |(k, path): (usize, &Vec<State>)| Curve {
                colour: series_colour(k),
                points: path.iter().map(|state| (state.strain, of(state))).collect(),
            };
            let curves: Vec<Curve> = read.iter().enumerate().map(curve).collect();
            Graph {
                frame: [[left, top], [left + size[0], top + size[1]]],
                font,
                x: "shear strain e1 − e2",
                y: name,
                curves: &curves,
                marks: &[],
                // A volume changes little.
                from_zero: index < 3,
            }
            .draw(pen)?;
        }
        Ok(())
    })?;
    let image = canvas.finish();
    write_atomically(output, |temporary| {
        Ok(image.save_with_format(temporary, image::ImageFormat::Png)?)
    })
}

/// Reads a path.
fn read(path: &Path) -> Result<Vec<State>, PathError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| PathError::Read { path: path.to_owned(), source })?;
    states(&text).map_err(|problem| PathError::NotAPath { path: path.to_owned(), problem })
}

/// The states of a CSV; a sentence about what is wrong with it otherwise.
fn states(text: &str) -> Result<Vec<State>, String> {
    let mut lines = text.lines();
    let columns = PathColumns::of(lines.next().unwrap_or_default())
        .map_err(|name| format!("no column `{name}`, so it is not the path of an element test"))?;
    let states = lines.enumerate().map(|(k, line)| {
        let Row { strain, stress, solid_fraction, .. } = columns
            .row(line)
            .map_err(|error| format!("row {}, column `{}`: {error}", k + 1, error.column))?;
        Ok(State {
            strain: (strain.m11 - strain.m22).hypot(strain.m12 + strain.m21),
            mean: -0.5 * stress.trace(),
            shear: 0.5 * (stress.m11 - stress.m22).hypot(stress.m12 + stress.m21),
            solid_fraction,
        })
    });
    states.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str =
        "t,exx,exy,eyx,eyy,sxx,sxy,syx,syy,solid_fraction,coordination,inertial_number\n";

    /// Biaxial compression: principal stresses of 10 and 30 kPa, so p = 20 kPa, q = 10 kPa and sin φ = 1/2; strains of
    /// 0.02 and -0.03, so a shear strain of 0.05.
    #[test]
    fn invariants_are_those_of_the_principal_axes() {
        assert_eq!(Row::COLUMNS.join(",") + "\n", HEADER);
        let row = "1,0.02,0,0,-0.03,-10e3,0,0,-30e3,0.8,4,1e-3";
        let [state] = states(&format!("{HEADER}{row}\n")).unwrap()[..] else { panic!("one row") };
        assert!((state.strain - 0.05).abs() < 1e-12);
        assert_eq!((state.mean, state.shear, state.solid_fraction), (20e3, 10e3, 0.8));
        assert_eq!(CHARTS[2].1(&state), 0.5);
        // The same state with axes turned by 45 degrees: pure shear about the mean.
        let turned = "1,-0.005,-0.025,-0.025,-0.005,-20e3,-10e3,-10e3,-20e3,0.8,4,1e-3";
        let [other] = states(&format!("{HEADER}{turned}\n")).unwrap()[..] else {
            panic!("one row")
        };
        assert!((other.strain - 0.05).abs() < 1e-12);
        assert_eq!((other.mean, other.shear), (20e3, 10e3));
    }

    #[test]
    fn other_tables_are_told_apart() {
        let error = |text: &str| states(text).unwrap_err();
        assert!(error("case,frame,time\n").contains("no column `t`"));
        let broken = format!("{HEADER}1,0,0,0,0,-1,x,0,-1,0.8,4,0\n");
        assert!(error(&broken).contains("row 1, column `sxy`: `x` is not a number"));
        assert!(error(&format!("{HEADER}1,0,0\n")).contains("column `eyx`"));
    }
}
