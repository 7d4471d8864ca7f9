//! Names and shapes of the datasets.

use hdf5::file::FileAccessBuilder;

use super::frame::{Frame, FrameShape};

/// The attribute `format` of every trajectory file.
pub const FORMAT: &str = "DEMPM trajectory";
/// The attribute `format_version` of files written by this version.
pub const FORMAT_VERSION: u64 = 1;

pub(super) const TIME: &str = "time";
pub(super) const MASS: &str = "points/mass";
pub(super) const COLUMN: &str = "points/column";
pub(super) const WALLS: &str = "boundary/walls";
pub(super) const BOXES: &str = "boundary/boxes";
pub(super) const BUDGET: &str = "budget";
pub(super) const WALL_TIME: &str = "wall_time";
pub(super) const WARNINGS: &str = "warnings";
pub(super) const REST_TIME: &str = "rest_time";

/// Turns HDF5's file locks off. No file is changed under its own name, so there is nothing to lock. A
/// lock can outlive its owner (a process forked while the file is open inherits it), and network file
/// systems often have none.
pub(crate) fn unlocked(access: &mut FileAccessBuilder) -> &mut FileAccessBuilder {
    access.file_locking(false)
}

/// A quantity at every point and frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Position, m.
    Position,
    /// Velocity, m/s.
    Velocity,
    /// Cauchy stress, Pa, tension positive.
    Stress,
    /// Solid fraction.
    SolidFraction,
    /// Coordination number.
    Coordination,
    /// Inertial number.
    InertialNumber,
}

impl Field {
    /// All fields, in the order of lists.
    pub const ALL: [Self; 6] = [
        Self::Position,
        Self::Velocity,
        Self::Stress,
        Self::SolidFraction,
        Self::Coordination,
        Self::InertialNumber,
    ];
    /// Fields that a scene may omit.
    pub const OPTIONAL: [Self; 4] =
        [Self::Stress, Self::SolidFraction, Self::Coordination, Self::InertialNumber];

    /// The name of the dataset.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Stress => "stress",
            Self::SolidFraction => "solid_fraction",
            Self::Coordination => "coordination",
            Self::InertialNumber => "inertial_number",
        }
    }

    /// The names of the components; one for a scalar.
    pub const fn components(self) -> &'static [&'static str] {
        match self {
            Self::Position | Self::Velocity => &["x", "y"],
            Self::Stress => &["xx", "xy", "yx", "yy"],
            Self::SolidFraction | Self::Coordination | Self::InertialNumber => &[""],
        }
    }

    /// The unit; empty for a pure number.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Position => "m",
            Self::Velocity => "m/s",
            Self::Stress => "Pa",
            Self::SolidFraction | Self::Coordination | Self::InertialNumber => "",
        }
    }

    /// The shape of the dataset: (frames, points) for a scalar, else (frames, points, components).
    pub fn shape(self, frames: usize, points: usize) -> Vec<usize> {
        match self.components().len() {
            1 => vec![frames, points],
            components => vec![frames, points, components],
        }
    }
}

impl Frame {
    /// The shape that the frames of this trajectory share.
    pub(super) fn shape(&self) -> FrameShape {
        let mut fields = Vec::new();
        for field in Field::OPTIONAL {
            let present = match field {
                Field::Stress => self.stress.is_some(),
                _ => self.scalar(field).is_some(),
            };
            if present {
                fields.push(field.name());
            }
        }
        FrameShape {
            fields,
            boxes: self.boxes.len(),
            budget: self.budget.keys().cloned().collect(),
        }
    }

    /// A scalar field, one value a point; `None` if it is absent or not a scalar.
    pub fn scalar(&self, field: Field) -> Option<&[f32]> {
        match field {
            Field::SolidFraction => self.solid_fraction.as_deref(),
            Field::Coordination => self.coordination.as_deref(),
            Field::InertialNumber => self.inertial_number.as_deref(),
            Field::Position | Field::Velocity | Field::Stress => None,
        }
    }

    /// Mutable access to an optional scalar field's place.
    pub(super) fn scalar_mut(&mut self, field: Field) -> Option<&mut Option<Vec<f32>>> {
        match field {
            Field::SolidFraction => Some(&mut self.solid_fraction),
            Field::Coordination => Some(&mut self.coordination),
            Field::InertialNumber => Some(&mut self.inertial_number),
            Field::Position | Field::Velocity | Field::Stress => None,
        }
    }
}
