//! Points and frames of a trajectory.

use std::collections::BTreeMap;

use super::grains::GrainFrame;
use super::grid::GridFrame;

/// Properties of the material points that never change. All arrays have one entry a point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Mass per metre out of plane, kg/m.
    pub mass: Vec<f64>,
    /// The column (or other body of the scene) that a point belongs to.
    pub column: Vec<u32>,
}

/// The state at one time. Arrays over points have one entry a point, in the order of [`Points`].
///
/// Optional fields and the keys of `budget` are decided by the first frame of a trajectory; every
/// later frame has the same.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Physical time, s.
    pub time: f64,
    /// Positions, m.
    pub position: Vec<[f64; 2]>,
    /// Velocities, m/s.
    pub velocity: Vec<[f64; 2]>,
    /// In-plane Cauchy stress (xx, xy, yx, yy), Pa, tension positive.
    pub stress: Option<Vec<[f32; 4]>>,
    /// Area of discs over area of the packing.
    pub solid_fraction: Option<Vec<f32>>,
    /// Mean number of contacts per disc.
    pub coordination: Option<Vec<f32>>,
    /// Inertial number, shear rate times grain size times sqrt(density / pressure).
    pub inertial_number: Option<Vec<f32>>,
    /// Obstacles, plates and gates as (x min, y min, x max, y max), m. Always the same number in
    /// the same order; one that is absent at this time (a lifted gate) is NaN.
    pub boxes: Vec<[f64; 4]>,
    /// Scalars of the whole scene, such as `kinetic_energy` (J/m), `front` or `max_height` (m).
    pub budget: BTreeMap<String, f64>,
    /// Grains to write; a frame that is read has none, see
    /// [`Trajectory::grain_frame`](super::Trajectory::grain_frame).
    pub grains: Option<GrainFrame>,
    /// Fields on a grid to write; likewise, see [`Trajectory::grid_frame`](super::Trajectory::grid_frame).
    pub grid: Option<GridFrame>,
}

/// Properties that all frames of a trajectory share.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FrameShape {
    /// Dataset names of the optional fields, in the order of [`super::Field::OPTIONAL`].
    pub fields: Vec<&'static str>,
    /// Number of boxes.
    pub boxes: usize,
    /// Names of the scalars.
    pub budget: Vec<String>,
}

impl FrameShape {
    /// The difference to `other`, if any.
    pub fn difference(&self, other: &Self) -> Option<String> {
        if self.fields != other.fields {
            Some(format!("fields {:?}, expected {:?}", other.fields, self.fields))
        } else if self.boxes != other.boxes {
            Some(format!("{} boxes, expected {}", other.boxes, self.boxes))
        } else if self.budget != other.budget {
            Some(format!("scalars {:?}, expected {:?}", other.budget, self.budget))
        } else {
            None
        }
    }
}
