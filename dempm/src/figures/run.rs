//! One of the runs that a picture shows.

use super::average::over_cells;
use super::bodies::Bodies;
use super::error::FigureError;
use super::options::{Average, Options};
use super::quantity::{Evaluator, Quantity};
use crate::trajectory::{Frame, Trajectory};

/// A run and the quantity that its colours show.
pub(super) struct Run<'a> {
    pub bodies: Bodies<'a>,
    /// The name in the picture.
    pub name: String,
    evaluator: Evaluator,
    radii: Vec<f64>,
    average: Option<Average>,
}

impl<'a> Run<'a> {
    pub(super) fn new(
        trajectory: &'a Trajectory,
        name: String,
        quantity: Quantity,
        options: &Options,
    ) -> Result<Self, FigureError> {
        let bodies = Bodies::of(trajectory, options.grains)?;
        if bodies.are_grains() && options.average.is_some() {
            return Err(FigureError::AverageOfGrains);
        }
        let evaluator = Evaluator::new(&bodies, quantity)?;
        let average = options.average.filter(|_| !quantity.is_class());
        Ok(Self { radii: bodies.radii(), bodies, name, evaluator, average })
    }

    /// Radii of points or grains (m).
    pub(super) fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// The quantity at the points or grains of a frame.
    pub(super) fn values(&self, frame: &Frame) -> Vec<f64> {
        let values = self.evaluator.values(frame);
        match self.average {
            None => values,
            Some(Average::Cell) => {
                let trajectory = self.bodies.trajectory;
                let (mass, cell) = (&trajectory.points().mass, trajectory.header().grid_cell);
                over_cells(&values, &frame.position, mass, cell)
            }
        }
    }
}

/// The names of runs in a picture: those of their files, or their paths where names are alike.
pub(super) fn names(trajectories: &[Trajectory]) -> Vec<String> {
    let stem = |trajectory: &Trajectory| {
        trajectory.path().file_stem().unwrap_or_default().to_string_lossy().into_owned()
    };
    let stems: Vec<String> = trajectories.iter().map(stem).collect();
    let alike = |name: &String| stems.iter().filter(|other| *other == name).count() > 1;
    let name = |(trajectory, stem): (&Trajectory, &String)| match alike(stem) {
        true => trajectory.path().with_extension("").display().to_string(),
        false => stem.clone(),
    };
    trajectories.iter().zip(&stems).map(name).collect()
}
