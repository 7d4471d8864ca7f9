//! `metadata.json` of the other programs.

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::error::ImportError;
use crate::dataset::Split;

/// What a trajectory does not say itself.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Metadata {
    /// Smallest and largest x and y, m.
    pub bounds: [[f64; 2]; 2],
    /// Time between frames, s.
    pub interval: f64,
    /// Reach of the graph's edges, m.
    pub radius: f64,
    /// Distance between neighbouring particles at the start, m; not all data sets state it.
    pub spacing: Option<f64>,
}

/// The keys that matter here.
#[derive(Deserialize)]
struct Keys {
    bounds: Vec<[f64; 2]>,
    dt: f64,
    default_connectivity_radius: f64,
    dim: Option<usize>,
    dx: Option<f64>,
    write_every: Option<f64>,
    #[serde(default)]
    periodic_boundary_conditions: Vec<bool>,
}

impl Metadata {
    /// Reads the metadata in `folder` for a split, which may have a section of its own.
    pub fn read(folder: &Path, split: Option<Split>) -> Result<Self, ImportError> {
        let path = &folder.join("metadata.json");
        let text = std::fs::read_to_string(path)
            .map_err(|source| ImportError::NoMetadata { path: path.clone(), source })?;
        let wrong = |source| ImportError::Metadata { path: path.clone(), source };
        let mut json: Value = serde_json::from_str(&text).map_err(wrong)?;
        // As `gns/reading_utils.py`: sections first, else the whole file.
        let section = if split == Some(Split::Test) { "rollout" } else { "train" };
        if let Some(section) = json.get_mut(section) {
            json = section.take();
        }
        let keys: Keys = serde_json::from_value(json).map_err(wrong)?;
        keys.check(path)
    }
}

impl Keys {
    fn check(self, path: &Path) -> Result<Metadata, ImportError> {
        let dimensions = self.dim.unwrap_or(self.bounds.len());
        if dimensions != 2 {
            let place = path.display().to_string();
            return Err(ImportError::Dimensions { place, found: dimensions });
        }
        let wrong = |key, problem: String| ImportError::Key { path: path.to_owned(), key, problem };
        let &[x, y] = &self.bounds[..] else {
            return Err(wrong("bounds", format!("has {} rows, expected 2", self.bounds.len())));
        };
        for [low, high] in [x, y] {
            if !(low.is_finite() && high.is_finite() && low < high) {
                return Err(wrong("bounds", format!("has the row [{low:?}, {high:?}]")));
            }
        }
        if self.periodic_boundary_conditions.contains(&true) {
            let problem = "is true along an axis, but this suite has walls only".to_owned();
            return Err(wrong("periodic_boundary_conditions", problem));
        }
        let interval = self.dt * self.write_every.unwrap_or(1.0);
        for (key, value) in [
            ("dt", interval),
            ("default_connectivity_radius", self.default_connectivity_radius),
            ("dx", self.dx.unwrap_or(1.0)),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(wrong(key, format!("is {value:?}, it must be above 0")));
            }
        }
        Ok(Metadata {
            bounds: [x, y],
            interval,
            radius: self.default_connectivity_radius,
            spacing: self.dx,
        })
    }
}
