//! Failures of assemblies.

/// Why an assembly could not be made or advanced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AssemblyError {
    /// A grain cannot be where it is.
    #[error(
        "DEM step {step}: grain {grain} at ({:.4}, {:.4}) m {failure}", position[0], position[1]
    )]
    Grain {
        /// DEM steps since the start.
        step: u64,
        /// Its index; grains of a rough floor come last.
        grain: usize,
        /// Its position (m).
        position: [f64; 2],
        /// Why.
        failure: GrainFailure,
    },
    /// The processor on which grains settle failed.
    #[error("{0}")]
    Device(String),
    /// A column could not be filled with grains.
    #[error("filling the column at ({:.3}, {:.3}) m with grains: {reason}", corner[0], corner[1])]
    Preparation {
        /// Its lower left corner (m).
        corner: [f64; 2],
        /// Why.
        reason: String,
    },
}

/// Why a grain cannot be advanced.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum GrainFailure {
    /// The integration diverged.
    #[error("has a position or velocity that is not finite; the DEM step is too large")]
    NotFinite,
    /// It overlaps another grain by this part of the smaller radius, which is beyond the limit.
    #[error(
        "overlaps another by {0:.2} of the smaller radius, which is beyond what the contact stiffness can carry"
    )]
    Overlap(f64),
    /// Its centre lies inside a wall or box.
    #[error(
        "has been pushed through a wall or into a box; the impact is too fast for the contact stiffness"
    )]
    Leak,
    /// It starts outside of the domain.
    #[error("starts outside of the domain")]
    Outside,
}
