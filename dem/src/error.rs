//! Failures of packings.

/// Why one RVE could not be advanced.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The integration diverged.
    #[error(
        "a position, velocity or force is not finite; the DEM step or the macro step is too large for this motion"
    )]
    NotFinite,
    /// Two discs overlap by this part of the smaller radius, which is beyond the limit.
    #[error(
        "two discs overlap by {0:.2} of the smaller radius; the packing is compressed beyond what the contact stiffness can carry"
    )]
    Overlap(f64),
}

/// A failure of a batch or of a preparation.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Error {
    /// An RVE of a batch failed.
    #[error("RVE {rve}: {failure}")]
    Rve {
        /// Its index.
        rve: usize,
        /// Why.
        failure: Failure,
    },
    /// A packing could not be prepared.
    #[error("preparing the packing (seed {seed}): {reason}")]
    Preparation {
        /// Seed of the packing.
        seed: u64,
        /// Why.
        reason: String,
    },
}
