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
    /// Its name, as on the command line.
    pub fn name(self) -> &'static str {
        self.pick("quick", "full")
    }

    /// One of two values, for this suite.
    pub fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}
