//! Scene files: the description of a simulation in TOML.
//!
//! The reference of scenes describes every key. Reading takes two passes, each of which reports all
//! problems: keys, types and limits first, then relations between keys (geometry, steps).
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "duration = 3.0\n[domain]\nsize = [10.0, 10.0]\n[[column]]\nsize = [3.0, 3.0]\n";
//! let scene = dempm::scene::Scene::parse(text, "column.toml")?;
//! assert_eq!((scene.point_count(), scene.steps()), (36_864, 17_400));
//! # Ok(())
//! # }
//! ```

mod convert;
mod defaults;
mod estimate;
mod geometry;
mod grains;
mod log;
mod model;
pub(crate) mod moved;
pub(crate) mod parameters;
mod plausibility;
mod points;
mod problem;
pub(crate) mod range;
mod read;
mod reader;
mod stability;
#[cfg(test)]
mod tests;

use std::path::Path;

pub use estimate::{COORDINATION, COURANT, CROSSING, SOLID_FRACTION};
pub use model::{
    Chosen, Column, Discs, Domain, Elastic, GridOutput, InitialStress, Material, Obstacle, Plate,
    PointLayout, Precision, Rectangle, Rve, Scene,
};
pub use points::Points;
pub use problem::{Problem, Problems, SceneError};

use log::Log;
use miette::Severity;

/// Longest scene file, in bytes: an attribute of an HDF5 file, where trajectories keep theirs, holds
/// 64 KiB.
const MAX_BYTES: usize = 60_000;

impl Scene {
    /// Reads and validates a scene file.
    ///
    /// # Errors
    /// If the file cannot be read or the scene is invalid; the error holds all problems.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path)
            .map_err(|source| SceneError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, &path.to_string_lossy())
    }

    /// Reads and validates the text of a scene; `name` names it in messages.
    ///
    /// # Errors
    /// If the scene is invalid; the error holds all problems.
    pub fn parse(text: &str, name: &str) -> Result<Self, SceneError> {
        let log = Log::default();
        let invalid = |problems| SceneError::Invalid(Box::new(Problems::new(name, text, problems)));
        if text.len() > MAX_BYTES {
            let problem = Problem::error(format!("{} bytes are too many", text.len()));
            let help = format!("at most {MAX_BYTES}, as every trajectory holds its scene");
            return Err(invalid(vec![problem.help(help)]));
        }
        let document = read::parse(&log, text);
        let problems = log.take();
        if !problems.is_empty() {
            return Err(invalid(problems));
        }
        let mut scene = read::read(&log, &document, name, text);
        let problems = log.take();
        if !problems.is_empty() {
            return Err(invalid(problems));
        }
        geometry::validate(&scene, &log);
        stability::validate(&scene, &log);
        grains::validate(&scene, &log);
        plausibility::validate(&scene, &log);
        let problems = log.take();
        if problems.iter().any(|problem| problem.severity == Severity::Error) {
            return Err(invalid(problems));
        }
        scene.warnings = problems;
        Ok(scene)
    }

    /// All warnings as one report with their places in the file; `None` without warnings.
    pub fn warning_report(&self) -> Option<miette::Report> {
        let warnings = self.warnings.clone();
        (!warnings.is_empty()).then(|| Problems::new(&self.name, &self.text, warnings).into())
    }

    /// Macro steps of the whole run.
    pub fn steps(&self) -> usize {
        self.frames() * self.steps_per_frame()
    }

    /// Macro steps between two frames.
    pub fn steps_per_frame(&self) -> usize {
        (self.frame_interval / self.step).round() as usize
    }

    /// Frames after the initial one; frame `k` is at `k * frame_interval`.
    pub fn frames(&self) -> usize {
        (self.duration / self.frame_interval).round() as usize
    }
}
