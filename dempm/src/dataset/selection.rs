//! Parts of a data set, as named by `--only`.

use std::str::FromStr;

use clap::ValueEnum;

use super::case::Case;
use super::split::Split;

/// A split or some of its cases: `test`, `test/col2x2`, `test/col*`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    split: Split,
    name: String,
    /// Whether `name` is only the beginning of the names.
    begins: bool,
}

impl FromStr for Selection {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (split, name) = text.split_once('/').unwrap_or((text, "*"));
        let split = Split::from_str(split, false).map_err(
            |_| "valid: train, valid, test, or scenes of one, such as test/col2x2 or test/col*",
        )?;
        let (name, begins) = match name.strip_suffix('*') {
            Some(beginning) => (beginning, true),
            None => (name, false),
        };
        Ok(Self { split, name: name.to_owned(), begins })
    }
}

impl std::fmt::Display for Selection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}{}", self.split.name(), self.name, if self.begins { "*" } else { "" })
    }
}

impl Selection {
    /// Whether the case is selected.
    pub fn has(&self, case: &Case) -> bool {
        self.split == case.split
            && if self.begins { case.name.starts_with(&self.name) } else { case.name == self.name }
    }
}
