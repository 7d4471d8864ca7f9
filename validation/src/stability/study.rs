//! What a study finds, as plain data.

use super::outcome::Outcome;
use super::threshold::Threshold;

/// How much is done: for a first look in seconds, or to the tolerance that is published.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    Quick,
    Full,
}

impl Size {
    /// One of two values.
    pub fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}

/// A method pushed until it fails.
#[derive(Clone, Debug, Default)]
pub struct Study {
    /// Short name, for files.
    pub name: &'static str,
    pub title: &'static str,
    /// What was run, and what counts as failure.
    pub method: String,
    pub findings: Vec<Finding>,
    pub maps: Vec<Map>,
    pub charts: Vec<Chart>,
    pub pictures: Vec<Picture>,
}

/// One threshold.
#[derive(Clone, Debug)]
pub struct Finding {
    /// What was pushed.
    pub case: String,
    /// The parameter, with its unit.
    pub parameter: &'static str,
    pub measured: Threshold,
    /// The same by theory, and by which.
    pub theory: Option<(f64, &'static str)>,
    /// The end of a run just beyond the threshold (at its end, if there was none).
    pub beyond: Outcome,
}

/// Outcomes over two parameters.
#[derive(Clone, Debug)]
pub struct Map {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    /// `outcomes[row][column]` at `y.values[row]` and `x.values[column]`.
    pub outcomes: Vec<Vec<Outcome>>,
    /// The border by theory: name and `(x, y)`.
    pub theory: Option<(String, Vec<[f64; 2]>)>,
}

/// The values of one parameter.
#[derive(Clone, Debug)]
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
#[derive(Clone, Debug)]
pub struct Chart {
    pub title: String,
    pub x: String,
    pub y: String,
    pub log: [bool; 2],
    pub curves: Vec<Curve>,
}

#[derive(Clone, Debug)]
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
#[derive(Clone, Debug, Default)]
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
#[derive(Debug, thiserror::Error)]
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
