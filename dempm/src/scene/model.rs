//! What a scene says: the validated content of a scene file.

use dem::RveParameters;
use dem::cuda::Room;
use mpm::{DruckerPragerParameters, Numerics, Walls};
use serde::{Deserialize, Serialize};

use super::Problem;
use crate::trajectory::Field;

/// A validated scene. All units are SI; the plane is (x, y), lengths out of plane are per metre.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name of the file, as shown in messages.
    pub name: String,
    /// The text of the file, as stored in the trajectory.
    pub text: String,
    /// What people call the scene.
    pub title: String,
    /// Seed of the random numbers: packings and their assignment to points.
    pub seed: u64,
    /// Gravity (m/s²).
    pub gravity: [f64; 2],
    /// Physical time simulated (s), a whole number of frame intervals.
    pub duration: f64,
    /// Macro step of the material point method (s).
    pub step: f64,
    /// Time between frames (s), a whole number of steps.
    pub frame_interval: f64,
    /// The box around everything, and the background grid in it.
    pub domain: Domain,
    /// Rectangles of material at the start; at least one.
    pub columns: Vec<Column>,
    /// Rigid boxes that never move.
    pub obstacles: Vec<Obstacle>,
    /// A rigid box with a prescribed velocity.
    pub plate: Option<Plate>,
    /// What the points are made of.
    pub material: Material,
    /// How points start: with the stress of the ground they lie in, or without.
    pub initial_stress: InitialStress,
    /// Numerics of the material point method.
    pub numerics: Numerics,
    /// Optional fields of the trajectory; positions and velocities are always in it.
    pub fields: Vec<Field>,
    /// What is doubtful but allowed.
    pub warnings: Vec<Problem>,
}

/// The domain `[0, size_x] x [0, size_y]`, its walls and its background grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Domain {
    /// Width and height (m), a whole number of cells each.
    pub size: [f64; 2],
    /// Edge of a square cell of the background grid (m).
    pub cell: f64,
    /// Material points per cell along each direction.
    pub points_per_cell: usize,
    /// Contact with the four walls.
    pub walls: Walls,
}

/// An axis-parallel rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Lower left corner (m).
    pub corner: [f64; 2],
    /// Width and height (m).
    pub size: [f64; 2],
}

impl Rectangle {
    /// Upper right corner (m).
    pub fn end(&self) -> [f64; 2] {
        [self.corner[0] + self.size[0], self.corner[1] + self.size[1]]
    }

    /// Whether the two share an area more than `tolerance` (m) wide and high.
    pub fn overlaps(&self, other: &Self, tolerance: f64) -> bool {
        let (end, other_end) = (self.end(), other.end());
        (0..2).all(|k| end[k].min(other_end[k]) - self.corner[k].max(other.corner[k]) > tolerance)
    }
}

/// A rectangle filled with material points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    pub place: Rectangle,
    /// Velocity of all its points at the start (m/s).
    pub velocity: [f64; 2],
}

/// A rigid box at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstacle {
    pub place: Rectangle,
    pub faces: Walls,
}

/// A rigid box that stands still until `start` and then moves at a constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plate {
    /// Place until `start`.
    pub place: Rectangle,
    /// Velocity from `start` on (m/s).
    pub velocity: [f64; 2],
    /// Time at which it begins to move (s).
    pub start: f64,
    pub faces: Walls,
}

impl Plate {
    /// Where the plate is at `time` (s).
    pub fn at(&self, time: f64) -> Rectangle {
        let moved = (time - self.start).max(0.0);
        let [x, y] = self.place.corner;
        let [u, v] = self.velocity;
        Rectangle { corner: [x + u * moved, y + v * moved], size: self.place.size }
    }

    /// Its velocity at `time` (m/s).
    pub fn velocity_at(&self, time: f64) -> [f64; 2] {
        if time < self.start { [0.0; 2] } else { self.velocity }
    }
}

/// What the material points are made of.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// A DEM packing in every point.
    Rve(Rve),
    /// In-plane Drucker-Prager plasticity with rate-dependent friction.
    MuI(DruckerPragerParameters),
    /// Linear elasticity.
    Elastic(Elastic),
}

impl Material {
    /// As written in scene files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Rve(_) => "rve",
            Self::MuI(_) => "mu-i",
            Self::Elastic(_) => "elastic",
        }
    }
}

/// A DEM packing in every point.
#[derive(Clone, Debug, PartialEq)]
pub struct Rve {
    pub parameters: RveParameters,
    /// Number of different packings; each point gets one of them.
    pub packings: usize,
    /// Precision of the DEM.
    pub precision: Precision,
    /// Room for lists of neighbours on a GPU.
    pub neighbours: Room,
}

/// Floating-point precision of packings.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// Single precision
    F32,
    /// Double precision
    F64,
}

/// Stress of the points at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialStress {
    /// Vertical stress `rho g depth` in columns that stand on something; see
    /// [`Points::depth`](super::Points::depth).
    Ladder,
    /// The same small stress everywhere (the preparation pressure of the packing, else zero).
    None,
}

/// Linear elasticity in plane strain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Elastic {
    /// Bulk density (kg/m³).
    pub density: f64,
    /// Young's modulus (Pa).
    pub young_modulus: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
}

impl Default for Elastic {
    /// About as heavy and as stiff as a packing of the default discs.
    fn default() -> Self {
        Self { density: 2173.0, young_modulus: 1.0e7, poisson_ratio: 0.2 }
    }
}
