//! Whether there are numbers to export.

use super::error::ExportError;
use crate::trajectory::{Field, Trajectory};

/// Refuses positions and velocities that are no numbers, or too large for single precision: other
/// programs would compute with them.
pub(super) fn check_finite(trajectory: &Trajectory) -> Result<(), ExportError> {
    for frame in 0..trajectory.frames() {
        for field in [Field::Position, Field::Velocity] {
            let Some(values) = trajectory.field::<f64>(field, frame..frame + 1)? else { continue };
            let broken = values.iter().position(|&value| !(value as f32).is_finite());
            if let Some(place) = broken {
                return Err(ExportError::NotFinite {
                    path: trajectory.path().to_owned(),
                    field: field.name(),
                    frame,
                    point: place / field.components().len(),
                });
            }
        }
    }
    Ok(())
}
