//! How much a report computes.

use clap::ValueEnum;
use serde::Serialize;

/// How much to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Suite {
    /// Small cases: minutes on two cores.
    Quick,
    /// Everything, for a GPU.
    Full,
}

impl Suite {
    /// One of two values, for this suite.
    pub fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}
