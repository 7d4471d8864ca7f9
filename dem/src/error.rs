//! What can go wrong in a packing.

/// Why one RVE could not be advanced.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    #[error(
        "a position, velocity or force is not finite; the DEM step or the macro step is too large for this motion"
    )]
    NotFinite,
    #[error(
        "two discs overlap by {0:.2} of the smaller radius; the packing is compressed beyond what the contact stiffness can carry"
    )]
    Overlap(f64),
}

/// A failure of a batch or of a preparation.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("RVE {rve}: {failure}")]
    Rve { rve: usize, failure: Failure },
    #[error("preparing the packing (seed {seed}): {reason}")]
    Preparation { seed: u64, reason: String },
}
