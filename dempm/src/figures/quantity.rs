//! Quantities that the colours can show.

use super::error::FigureError;
use crate::trajectory::{Field, Frame, Trajectory};

/// A scalar at every point.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Magnitude of the velocity
    Speed,
    /// Horizontal velocity
    VelocityX,
    /// Vertical velocity
    VelocityY,
    /// Mean in-plane stress, compression positive
    Pressure,
    /// Stress component xy
    ShearStress,
    /// Stress component xx, tension positive
    StressXx,
    /// Stress component yy, tension positive
    StressYy,
    /// Area of grains over area of the packing
    SolidFraction,
    /// Contacts a grain
    Coordination,
    /// Inertial number
    InertialNumber,
    /// Distance from the place in the first frame
    Displacement,
    /// The column that a point belongs to
    Column,
}

impl Quantity {
    /// Name and unit for the colour bar.
    pub(super) const fn label(self) -> (&'static str, &'static str) {
        match self {
            Self::Speed => ("speed", "m/s"),
            Self::VelocityX => ("horizontal velocity", "m/s"),
            Self::VelocityY => ("vertical velocity", "m/s"),
            Self::Pressure => ("pressure", "Pa"),
            Self::ShearStress => ("shear stress σxy", "Pa"),
            Self::StressXx => ("stress σxx, tension positive", "Pa"),
            Self::StressYy => ("stress σyy, tension positive", "Pa"),
            Self::SolidFraction => ("solid fraction", ""),
            Self::Coordination => ("coordination number", ""),
            Self::InertialNumber => ("inertial number", ""),
            Self::Displacement => ("displacement", "m"),
            Self::Column => ("column", ""),
        }
    }

    /// Whether both signs occur, so that zero belongs in the middle of the colours.
    pub(super) const fn is_signed(self) -> bool {
        matches!(self, Self::VelocityX | Self::VelocityY | Self::ShearStress)
    }

    /// The field of the file that it is computed from.
    const fn field(self) -> Field {
        match self {
            Self::Speed | Self::VelocityX | Self::VelocityY => Field::Velocity,
            Self::Pressure | Self::ShearStress | Self::StressXx | Self::StressYy => Field::Stress,
            Self::SolidFraction => Field::SolidFraction,
            Self::Coordination => Field::Coordination,
            Self::InertialNumber => Field::InertialNumber,
            Self::Displacement | Self::Column => Field::Position,
        }
    }
}

/// Computes a quantity at all points of a frame.
pub(super) struct Evaluator {
    quantity: Quantity,
    /// Initial positions (m), for displacements only.
    position: Vec<[f64; 2]>,
    column: Vec<u32>,
}

impl Evaluator {
    /// Reads what is needed besides a frame, and checks that the file has the quantity.
    pub(super) fn new(trajectory: &Trajectory, quantity: Quantity) -> Result<Self, FigureError> {
        let field = quantity.field();
        if !trajectory.fields().any(|present| present == field) {
            return Err(FigureError::NoField {
                path: trajectory.path().to_owned(),
                field: field.name(),
                quantity: quantity.label().0,
            });
        }
        let position = match quantity {
            Quantity::Displacement => trajectory.frame(0)?.position,
            _ => Vec::new(),
        };
        Ok(Self { quantity, position, column: trajectory.points().column.clone() })
    }

    /// The value at every point of a frame.
    pub(super) fn values(&self, frame: &Frame) -> Vec<f64> {
        let velocity = |of: fn(&[f64; 2]) -> f64| frame.velocity.iter().map(of).collect();
        let stress = |of: fn(&[f64; 4]) -> f64| {
            let stress = frame.stress.as_deref().unwrap_or_default();
            stress.iter().map(|s| of(&s.map(f64::from))).collect()
        };
        let scalar = |field| {
            frame.scalar(field).unwrap_or_default().iter().map(|&value| f64::from(value)).collect()
        };
        match self.quantity {
            Quantity::Speed => velocity(|v| v[0].hypot(v[1])),
            Quantity::VelocityX => velocity(|v| v[0]),
            Quantity::VelocityY => velocity(|v| v[1]),
            Quantity::Pressure => stress(|[xx, _, _, yy]| -0.5 * (xx + yy)),
            Quantity::ShearStress => stress(|[_, xy, yx, _]| 0.5 * (xy + yx)),
            Quantity::StressXx => stress(|s| s[0]),
            Quantity::StressYy => stress(|s| s[3]),
            Quantity::SolidFraction => scalar(Field::SolidFraction),
            Quantity::Coordination => scalar(Field::Coordination),
            Quantity::InertialNumber => scalar(Field::InertialNumber),
            Quantity::Displacement => std::iter::zip(&frame.position, &self.position)
                .map(|(now, then)| (now[0] - then[0]).hypot(now[1] - then[1]))
                .collect(),
            Quantity::Column => self.column.iter().map(|&column| f64::from(column)).collect(),
        }
    }
}
