//! Predictions that end a rollout.

/// A prediction without physical meaning, or a device that failed.
///
/// The texts are also the `failed: ...` status of trajectory files and the `failure` column of
/// evaluation tables.
#[derive(Clone, Debug, PartialEq, thiserror::Error, miette::Diagnostic)]
pub enum RolloutError {
    /// A position is NaN or infinite.
    #[error("frame {frame}: the predicted position of point {point} is not finite")]
    NotFinite {
        /// Number of the frame, from the first initial frame.
        frame: usize,
        /// Index of the point.
        point: usize,
    },
    /// A point is farther outside the domain than one connection radius.
    #[error("frame {frame}: point {point} leaves the domain by {distance:.3} m")]
    Left {
        /// Number of the frame, from the first initial frame.
        frame: usize,
        /// Index of the point.
        point: usize,
        /// Distance to the domain, m.
        distance: f64,
    },
    /// Points are [crowded](crate::diagnostics::CrowdingLimit) as no material can be.
    #[error(
        "frame {frame}: points are pressed together ({neighbours:.0} neighbours on average, {plane:.0} \
         if they filled the plane)"
    )]
    Crowded {
        /// Number of the frame, from the first initial frame.
        frame: usize,
        /// Mean number of neighbours of a point.
        neighbours: f64,
        /// The same for points that fill the plane at their initial spacing.
        plane: f64,
    },
    /// The GPU, its driver or the thread that drives it failed.
    #[error("the rollout on the GPU: {message}")]
    Device {
        /// The error of the device.
        message: String,
    },
}
