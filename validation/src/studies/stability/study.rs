//! What a study finds, as plain data.

use serde::{Deserialize, Deserializer, Serialize};

use super::outcome::Outcome;
use super::threshold::Threshold;
use crate::context::Suite;

/// One of two values: for a first look in seconds, or to the tolerance that is published.
pub fn pick<T>(suite: Suite, quick: T, full: T) -> T {
    match suite {
        Suite::Quick => quick,
        Suite::Full => full,
    }
}

/// A method pushed until it fails.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// What was run, and what counts as failure.
    pub method: String,
    pub findings: Vec<Finding>,
    pub maps: Vec<Map>,
    pub charts: Vec<Chart>,
    pub pictures: Vec<Picture>,
    /// What follows from the numbers, or remains unexplained.
    pub notes: Vec<String>,
    /// The model that was pushed, if it is one.
    pub of: Option<String>,
}

impl Study {
    /// Adds the name of a model to all titles, which have to be unique in a section.
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
    /// What was pushed.
    pub case: String,
    /// The parameter, with its unit.
    pub parameter: String,
    pub measured: Threshold,
    /// The same by theory, and by which.
    pub theory: Option<(f64, String)>,
    /// The end of a run just beyond the threshold (at its end, if there was none).
    pub beyond: Outcome,
}

/// Outcomes over two parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Map {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    /// `outcomes[row][column]` at `y.values[row]` and `x.values[column]`.
    pub outcomes: Vec<Vec<Outcome>>,
    /// A measured number to go with each outcome, NaN where there is none; may be empty.
    #[serde(deserialize_with = "with_gaps")]
    pub numbers: Vec<Vec<f64>>,
    /// How to read it, and the theory it is compared with.
    pub caption: String,
}

/// Reads NaN, which JSON has not and writes as null.
fn with_gaps<'de, D: Deserializer<'de>>(file: D) -> Result<Vec<Vec<f64>>, D::Error> {
    let rows = Vec::<Vec<Option<f64>>>::deserialize(file)?.into_iter();
    Ok(rows.map(|row| row.into_iter().map(|x| x.unwrap_or(f64::NAN)).collect()).collect())
}

/// The values of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Name with unit.
    pub label: String,
    pub values: Vec<f64>,
    /// Names of the values, where they are no numbers to plot.
    pub names: Option<Vec<String>>,
}

impl Axis {
    pub fn new(label: impl Into<String>, values: Vec<f64>) -> Self {
        Self { label: label.into(), values, names: None }
    }

    /// Values that have names instead of numbers.
    pub fn named(label: impl Into<String>, names: Vec<String>) -> Self {
        let values = (0..names.len()).map(|k| k as f64).collect();
        Self { label: label.into(), values, names: Some(names) }
    }
}

/// Curves over one parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    pub title: String,
    pub x: String,
    pub y: String,
    pub log: [bool; 2],
    pub curves: Vec<Curve>,
    /// How to read it.
    pub caption: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    pub name: String,
    pub points: Vec<[f64; 2]>,
    /// Drawn as a line without marks.
    pub theory: bool,
}

impl Curve {
    pub fn measured(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), points, theory: false }
    }

    pub fn theory(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), points, theory: true }
    }
}

/// Points or discs at one moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    pub title: String,
    /// What the colour shows, with unit.
    pub colour: String,
    pub position: Vec<[f64; 2]>,
    pub value: Vec<f64>,
    /// Radius of each disc (m), or one for all.
    pub radius: Vec<f64>,
    /// Rigid boxes (x min, y min, x max, y max), m.
    pub boxes: Vec<[f64; 4]>,
    /// What is shown (x min, y min, x max, y max), m.
    pub window: [f64; 4],
    /// Positions to compare with, drawn grey beneath.
    pub reference: Vec<[f64; 2]>,
}

/// A study that could not be made.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum StudyError {
    #[error(transparent)]
    Dem(#[from] dem::Error),
    #[error(transparent)]
    Element(#[from] dem::element::StageError),
    #[error(transparent)]
    Mpm(#[from] mpm::Error),
    #[error(transparent)]
    Material(#[from] mpm::MaterialError),
    #[error("{name}: {reason}")]
    Scene { name: String, reason: String },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Else a study with such a map would be made anew with every report.
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
