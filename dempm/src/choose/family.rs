//! The kinds of models that can be chosen.

use serde::{Deserialize, Serialize};

/// A kind of model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// Every grain as a disc; larger discs also belong to it.
    Discs,
    /// A packing in every point.
    Rve,
    /// The mu(I) law.
    MuI,
    /// A network, whose error is its own statement.
    Learned,
}

impl Family {
    /// All families whose errors are measured.
    pub const ALL: [Self; 3] = [Self::Discs, Self::Rve, Self::MuI];

    /// The name in scene files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Discs => "discs",
            Self::Rve => "rve",
            Self::MuI => "mu-i",
            Self::Learned => "learned",
        }
    }

    /// The measured family of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|family| family.name() == name)
    }
}
