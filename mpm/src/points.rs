//! Material points.

use serde::{Deserialize, Serialize};

use crate::grid::Shape;
use crate::{Error, Mat2, Vec2};

/// Material points as a structure of arrays: entry `p` of every array belongs to point `p`.
///
/// Per unit thickness. The arrays are the whole state the solver keeps from step to step, so
/// writing them (with the material and [`Solver::time`](crate::Solver::time)) is a checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Points {
    /// Position (m).
    pub position: Vec<Vec2>,
    /// Velocity (m/s).
    pub velocity: Vec<Vec2>,
    /// Affine velocity matrix `C` of APIC (1/s): the velocity near the point is `v + C (x - x_p)`.
    /// Zero under transfers without an affine part.
    pub affine: Vec<Mat2>,
    /// Mass (kg/m); constant.
    pub mass: Vec<f64>,
    /// Current volume (m²); kept by the material.
    pub volume: Vec<f64>,
    /// Velocity gradient `L_ij = dv_i/dx_j` of the latest step (1/s).
    pub velocity_gradient: Vec<Mat2>,
    /// Cauchy stress (Pa), tension positive; kept by the material.
    pub stress: Vec<Mat2>,
}

impl Points {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Adds a point at rest and free of stress.
    pub fn push(&mut self, position: Vec2, mass: f64, volume: f64) {
        self.position.push(position);
        self.velocity.push(Vec2::zeros());
        self.affine.push(Mat2::zeros());
        self.mass.push(mass);
        self.volume.push(volume);
        self.velocity_gradient.push(Mat2::zeros());
        self.stress.push(Mat2::zeros());
    }

    /// Fills the box from `min` to `max` (m) with points at the centres of squares of about
    /// `spacing` (m), row by row from the bottom; the spacing is adjusted to divide the box, so
    /// that the mass is exact. Half a cell is the usual spacing (2 x 2 points a cell).
    pub fn rectangle(min: Vec2, max: Vec2, spacing: f64, density: f64) -> Self {
        let mut points = Self::default();
        let extent = max - min;
        let (columns, rows) = ((extent.x / spacing).round(), (extent.y / spacing).round());
        let step = Vec2::new(extent.x / columns, extent.y / rows);
        let volume = step.x * step.y;
        for j in 0..rows as usize {
            for i in 0..columns as usize {
                let centre = Vec2::new(i as f64 + 0.5, j as f64 + 0.5);
                points.push(min + centre.component_mul(&step), density * volume, volume);
            }
        }
        points
    }

    /// Appends another set of points.
    pub fn append(&mut self, mut other: Self) {
        self.position.append(&mut other.position);
        self.velocity.append(&mut other.velocity);
        self.affine.append(&mut other.affine);
        self.mass.append(&mut other.mass);
        self.volume.append(&mut other.volume);
        self.velocity_gradient.append(&mut other.velocity_gradient);
        self.stress.append(&mut other.stress);
    }

    /// Current density of a point (kg/m³): `m / V`.
    pub fn density(&self, point: usize) -> f64 {
        self.mass[point] / self.volume[point]
    }

    /// Whether the solver can take the points on; gives their total mass (kg/m).
    pub(crate) fn check(&self, shape: &Shape) -> Result<f64, Error> {
        self.check_lengths()?;
        let mut total = 0.0;
        for (point, ((x, v), &mass)) in
            self.position.iter().zip(&self.velocity).zip(&self.mass).enumerate()
        {
            if !(mass.is_finite() && mass > 0.0) {
                return Err(Error::Mass { point, mass });
            }
            if !(x.x.is_finite() && x.y.is_finite() && v.x.is_finite() && v.y.is_finite()) {
                return Err(Error::NotFinite { point, position: *x, velocity: *v });
            }
            if !shape.contains(x) {
                return Err(Error::OutsideDomain { point, position: *x, size: shape.size });
            }
            total += mass;
        }
        Ok(total)
    }

    fn check_lengths(&self) -> Result<(), Error> {
        let expected = self.len();
        for (field, found) in [
            ("velocity", self.velocity.len()),
            ("affine", self.affine.len()),
            ("mass", self.mass.len()),
            ("volume", self.volume.len()),
            ("velocity_gradient", self.velocity_gradient.len()),
            ("stress", self.stress.len()),
        ] {
            if found != expected {
                return Err(Error::Length { field, expected, found });
            }
        }
        Ok(())
    }
}
