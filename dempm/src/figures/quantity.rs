//! Quantities that the colours can show.

use super::bodies::Bodies;
use super::error::FigureError;
use crate::trajectory::{Field, Frame};

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
    #[value(alias = "solid_fraction")]
    SolidFraction,
    /// Contacts a grain
    Coordination,
    /// Inertial number
    #[value(alias = "inertial_number")]
    InertialNumber,
    /// Distance from the place in the first frame
    Displacement,
    /// The column that a point belongs to
    Column,
    /// Horizontal layer in the first frame, from the bottom up
    Layer,
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
            Self::Layer => ("initial layer", ""),
        }
    }

    /// Whether both signs occur, so that zero belongs in the middle of the colours.
    pub(super) const fn is_signed(self) -> bool {
        matches!(self, Self::VelocityX | Self::VelocityY | Self::ShearStress)
    }

    /// Whether values are class numbers 0, 1, ...
    pub(super) const fn is_class(self) -> bool {
        matches!(self, Self::Column | Self::Layer)
    }

    /// The field of the file that it is computed from.
    const fn field(self) -> Field {
        match self {
            Self::Speed | Self::VelocityX | Self::VelocityY => Field::Velocity,
            Self::Pressure | Self::ShearStress | Self::StressXx | Self::StressYy => Field::Stress,
            Self::SolidFraction => Field::SolidFraction,
            Self::Coordination => Field::Coordination,
            Self::InertialNumber => Field::InertialNumber,
            Self::Displacement | Self::Column | Self::Layer => Field::Position,
        }
    }
}

/// Layers of the initial state.
const LAYERS: f64 = 8.0;

/// Computes a quantity at all points of a frame.
pub(super) struct Evaluator {
    quantity: Quantity,
    /// Initial positions (m), for displacements only.
    position: Vec<[f64; 2]>,
    /// Columns or layers, for these only.
    class: Vec<f64>,
}

impl Evaluator {
    /// Reads what is needed besides a frame, and checks that the file has the quantity.
    pub(super) fn new(bodies: &Bodies<'_>, quantity: Quantity) -> Result<Self, FigureError> {
        let trajectory = bodies.trajectory;
        let field = quantity.field();
        let of_grains =
            matches!(field, Field::Position | Field::Velocity) || quantity == Quantity::Pressure;
        if bodies.are_grains() && !of_grains {
            return Err(FigureError::NotOfGrains(quantity.label().0));
        }
        if !bodies.are_grains() && !trajectory.fields().any(|present| present == field) {
            return Err(FigureError::NoField {
                path: trajectory.path().to_owned(),
                field: field.name(),
                quantity: quantity.label().0,
            });
        }
        let position = match quantity {
            Quantity::Displacement => bodies.frame(0)?.position,
            _ => Vec::new(),
        };
        let class = match quantity {
            Quantity::Column => bodies.column().into_iter().map(f64::from).collect(),
            Quantity::Layer => layers(&bodies.frame(0)?.position),
            _ => Vec::new(),
        };
        Ok(Self { quantity, position, class })
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
            Quantity::Column | Quantity::Layer => self.class.clone(),
        }
    }
}

/// The layer of each position among [`LAYERS`] of equal height; NaN where there is no position.
fn layers(position: &[[f64; 2]]) -> Vec<f64> {
    let heights = || position.iter().map(|x| x[1]).filter(|y| y.is_finite());
    let low = heights().fold(f64::INFINITY, f64::min);
    let high = heights().fold(f64::NEG_INFINITY, f64::max);
    let layer = |y: f64| ((y - low) / (high - low) * LAYERS).floor().clamp(0.0, LAYERS - 1.0);
    position.iter().map(|x| if high > low { layer(x[1]) } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_have_equal_heights() {
        let column: Vec<[f64; 2]> = (0..16).map(|k| [0.5, 1.0 + f64::from(k)]).collect();
        let expected: Vec<f64> = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0].map(|k| [k; 2]).concat();
        assert_eq!(layers(&column), expected);
        assert_eq!(layers(&[[0.0, 2.0]; 2]), [0.0; 2]);
        assert!(layers(&[[0.0, 0.0], [0.0, f64::NAN], [0.0, 1.0]])[1].is_nan());
    }
}
