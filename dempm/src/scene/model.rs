//! The validated content of a scene file.

use dem::assembly::Floor;
use dem::cuda::Room;
use dem::{Grains, RveParameters};
use mpm::{DruckerPragerParameters, Numerics, Walls};
use serde::{Deserialize, Serialize};

use super::Problem;
use crate::trajectory::Field;

/// A validated scene. All units are SI; the plane is (x, y), lengths out of plane are per metre.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name of the file for messages.
    pub name: String,
    /// The text of the file, as stored in the trajectory.
    pub text: String,
    /// Title of the scene.
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
    /// The domain with its walls and background grid.
    pub domain: Domain,
    /// Rectangles of material at time zero; at least one.
    pub columns: Vec<Column>,
    /// Rigid boxes that never move.
    pub obstacles: Vec<Obstacle>,
    /// A rigid box with a prescribed velocity.
    pub plate: Option<Plate>,
    /// The material of all points.
    pub material: Material,
    /// Initial stress of the points.
    pub initial_stress: InitialStress,
    /// Numerics of the material point method.
    pub numerics: Numerics,
    /// Optional fields of the trajectory; positions and velocities are always in it.
    pub fields: Vec<Field>,
    /// Frames from one with the grains themselves to the next; 0 for none. Scenes of discs only.
    pub grains_every: usize,
    /// Continuum fields of the grains on a grid. Scenes of discs only.
    pub grid: Option<GridOutput>,
    /// Whether a run ends when everything has come to rest.
    pub stop_at_rest: bool,
    /// How its model was chosen, if it was.
    pub choice: Option<Chosen>,
    /// Doubtful but allowed settings.
    pub warnings: Vec<Problem>,
}

/// A model that was chosen by its expected distance from the grains computed one by one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Chosen {
    /// Name of the model.
    pub model: String,
    /// The distance that was asked for (m).
    pub within: f64,
    /// The distance to expect (m); `None` if nothing like the scene was measured.
    pub expected: Option<f64>,
    /// Nine of ten distances are smaller (m).
    pub bound: Option<f64>,
}

/// A grid for coarse-grained fields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridOutput {
    /// Width of the coarse graining (m).
    pub width: f64,
    /// Distance between nodes (m).
    pub spacing: f64,
}

impl GridOutput {
    /// Nodes along x and y in a domain of `size` (m) and three widths around it.
    pub fn nodes(&self, size: [f64; 2]) -> [f64; 2] {
        size.map(|length| ((length + 6.0 * self.width) / self.spacing).ceil())
    }
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
    /// Where points start; those of discs on a square lattice.
    pub point_layout: PointLayout,
    /// Contact with the four walls.
    pub walls: Walls,
}

/// Where the points of a column start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointLayout {
    /// At the centres of squares.
    Square,
    /// The same with rows shifted by a quarter of the spacing, alternately to the left and to the right: where material
    /// stretches, points of one row fill the gaps between those of the next.
    Staggered,
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
    /// The rectangle.
    pub place: Rectangle,
    /// Initial velocity of all its points (m/s).
    pub velocity: [f64; 2],
}

/// A rigid box at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstacle {
    /// The rectangle that it fills.
    pub place: Rectangle,
    /// Contact on its four sides.
    pub faces: Walls,
}

/// A rigid box at rest until `start`, then moving at a constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plate {
    /// Place until `start`.
    pub place: Rectangle,
    /// Velocity from `start` on (m/s).
    pub velocity: [f64; 2],
    /// Time at which it begins to move (s).
    pub start: f64,
    /// Contact on its four sides.
    pub faces: Walls,
}

impl Plate {
    /// The rectangle of the plate at `time` (s).
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

/// The model of the material.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// Every grain of the scene as a disc; points only sum them up.
    Discs(Discs),
    /// A DEM packing in every point.
    Rve(Rve),
    /// In-plane Drucker-Prager plasticity with rate-dependent friction.
    MuI(DruckerPragerParameters),
    /// Linear elasticity.
    Elastic(Elastic),
}

impl Material {
    /// The name in scene files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Discs(_) => "discs",
            Self::Rve(_) => "rve",
            Self::MuI(_) => "mu-i",
            Self::Elastic(_) => "elastic",
        }
    }

    /// The grains, in models that have them.
    pub fn grains(&self) -> Option<&Grains> {
        match self {
            Self::Discs(discs) => Some(&discs.grains),
            Self::Rve(rve) => Some(&rve.parameters.grains),
            Self::MuI(_) | Self::Elastic(_) => None,
        }
    }
}

/// Every grain of the scene as a disc.
#[derive(Clone, Debug, PartialEq)]
pub struct Discs {
    /// The grains, their contacts and their preparation.
    pub grains: Grains,
    /// The floor below them.
    pub floor: Floor,
    /// Whether grains at rest hold their places until a force on them changes.
    pub sleep: bool,
    /// Precision of the DEM.
    pub precision: Precision,
}

/// A DEM packing in every point.
#[derive(Clone, Debug, PartialEq)]
pub struct Rve {
    /// Parameters of the discs, their contacts and their preparation.
    pub parameters: RveParameters,
    /// Number of different packings, of which each point gets one at random.
    pub packings: usize,
    /// Precision of the DEM.
    pub precision: Precision,
    /// Capacity of neighbour lists on a GPU.
    pub neighbours: Room,
}

impl Rve {
    /// The seeds of its packings in a scene with this seed.
    pub fn seeds(&self, scene: u64) -> impl Iterator<Item = u64> {
        (0..self.packings as u64).map(move |k| (scene << 16) + k)
    }
}

/// Floating-point precision of the DEM.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// Single precision
    F32,
    /// Double precision
    F64,
}

/// Initial stress of the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialStress {
    /// Vertical stress `rho g depth` in resting columns; see
    /// [`Points::depth`](super::Points::depth).
    Ladder,
    /// The preparation pressure of the packing everywhere; zero for a continuum law.
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
    /// Density and stiffness of about a packing of the default discs.
    fn default() -> Self {
        Self { density: 2173.0, young_modulus: 1.0e7, poisson_ratio: 0.2 }
    }
}
