//! The results of a study, as plain data.

use serde::{Deserialize, Deserializer, Serialize};

use super::outcome::Outcome;
use super::threshold::Threshold;

/// A method pushed until it fails.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// What was run, and what counts as failure.
    pub method: String,
    /// Thresholds.
    pub findings: Vec<Finding>,
    /// Outcomes over two parameters.
    pub maps: Vec<Map>,
    /// Quantities over one parameter.
    pub charts: Vec<Chart>,
    /// Points or discs at one moment.
    pub pictures: Vec<Picture>,
    /// Conclusions, and what remains unexplained.
    pub notes: Vec<String>,
    /// Name of the model, if one was tested.
    pub of: Option<String>,
}

impl Study {
    /// Adds the name of the model to all titles, which have to be unique in a section.
    pub fn name_model(&mut self, name: &str) {
        self.of = Some(name.to_owned());
        let maps = self.maps.iter_mut().map(|map| &mut map.title);
        let charts = self.charts.iter_mut().map(|chart| &mut chart.title);
        let pictures = self.pictures.iter_mut().map(|picture| &mut picture.title);
        maps.chain(charts).chain(pictures).for_each(|title| *title += &format!(" ({name})"));
    }
}

/// One threshold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What was tested.
    pub case: String,
    /// The parameter with its unit.
    pub parameter: String,
    /// The measured threshold.
    pub measured: Threshold,
    /// The threshold by theory, and the formula.
    pub theory: Option<(f64, String)>,
    /// Outcome of a run just beyond the threshold, or of the last run if there is none.
    pub beyond: Outcome,
}

/// Outcomes over two parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Map {
    /// What was tested.
    pub title: String,
    /// Horizontal parameter.
    pub x: Axis,
    /// Vertical parameter.
    pub y: Axis,
    /// `outcomes[row][column]` at `y.values[row]` and `x.values[column]`.
    pub outcomes: Vec<Vec<Outcome>>,
    /// A measured number for each outcome, NaN where there is none; may be empty.
    #[serde(deserialize_with = "with_gaps")]
    pub numbers: Vec<Vec<f64>>,
    /// How to read it, and the theory to compare with.
    pub caption: String,
}

/// Reads null as NaN, which JSON lacks.
fn with_gaps<'de, D: Deserializer<'de>>(file: D) -> Result<Vec<Vec<f64>>, D::Error> {
    let rows = Vec::<Vec<Option<f64>>>::deserialize(file)?.into_iter();
    Ok(rows.map(|row| row.into_iter().map(|x| x.unwrap_or(f64::NAN)).collect()).collect())
}

/// The values of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Name with unit.
    pub label: String,
    /// Values, or indices of the names.
    pub values: Vec<f64>,
    /// Names of the values, if they are not numbers.
    pub names: Option<Vec<String>>,
}

impl Axis {
    /// A parameter with numbers as values.
    pub fn new(label: impl Into<String>, values: Vec<f64>) -> Self {
        Self { label: label.into(), values, names: None }
    }

    /// A parameter with names as values.
    pub fn named(label: impl Into<String>, names: Vec<String>) -> Self {
        let values = (0..names.len()).map(|k| k as f64).collect();
        Self { label: label.into(), values, names: Some(names) }
    }
}

/// Curves over one parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// What it shows.
    pub title: String,
    /// Label of the horizontal axis.
    pub x: String,
    /// Label of the vertical axis.
    pub y: String,
    /// Whether the axes are logarithmic.
    pub log: [bool; 2],
    /// The curves.
    pub curves: Vec<Curve>,
    /// How to read it.
    pub caption: String,
}

/// A curve of a chart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Name in the legend; empty to leave it out.
    pub name: String,
    /// Points (x, y).
    pub points: Vec<[f64; 2]>,
    /// Whether it is theory: a line without marks.
    pub theory: bool,
}

impl Curve {
    /// A measured curve.
    pub fn measured(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), points, theory: false }
    }

    /// A curve by theory.
    pub fn theory(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), points, theory: true }
    }
}

/// Points or discs at one moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// What it shows.
    pub title: String,
    /// The quantity that the colour shows, with unit.
    pub colour: String,
    /// Positions, m.
    pub position: Vec<[f64; 2]>,
    /// Values of the coloured quantity.
    pub value: Vec<f64>,
    /// Radius of each disc, or one for all, m.
    pub radius: Vec<f64>,
    /// Rigid boxes (x min, y min, x max, y max), m.
    pub boxes: Vec<[f64; 4]>,
    /// The part of the plane that is shown (x min, y min, x max, y max), m.
    pub window: [f64; 4],
    /// Positions to compare with, drawn in grey below, m.
    pub reference: Vec<[f64; 2]>,
}

/// Why a study could not be made.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum StudyError {
    /// An error of the DEM.
    #[error(transparent)]
    Dem(#[from] dem::Error),
    /// An error of an element test.
    #[error(transparent)]
    Element(#[from] dem::element::StageError),
    /// An error of the MPM.
    #[error(transparent)]
    Mpm(#[from] mpm::Error),
    /// An error of a material law.
    #[error(transparent)]
    Material(#[from] mpm::MaterialError),
    /// A scene or a model that cannot be used.
    #[error("{name}: {reason}")]
    Scene {
        /// Name of the scene or the file.
        name: String,
        /// Why not.
        reason: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Otherwise every report would repeat a study with such a map.
    #[test]
    fn a_map_with_gaps_can_be_kept() {
        let map = Map {
            title: "map".into(),
            x: Axis::new("x", vec![1.0, 2.0]),
            y: Axis::new("y", vec![3.0]),
            outcomes: vec![vec![Outcome::Stable, Outcome::of(Some("broken".into()), None)]],
            numbers: vec![vec![0.5, f64::NAN]],
            caption: String::new(),
        };
        let kept = serde_json::to_string(&map).unwrap();
        let read: Map = serde_json::from_str(&kept).unwrap();
        assert_eq!(read.numbers[0][0], 0.5);
        assert!(read.numbers[0][1].is_nan());
        assert_eq!(read.outcomes, map.outcomes);
    }
}
