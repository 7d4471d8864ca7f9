//! A map of two parameters: where a method is stable, warns or fails.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use crate::render::table::Table;

/// How a run with a pair of parameters ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Outcome {
    /// Correct, without a warning.
    Stable,
    /// Correct, with a warning.
    Warned,
    /// Wrong or ended early, with a warning or an error.
    Failed,
    /// Wrong without a warning: a defect.
    Silent,
    /// Not computed.
    Unknown,
}

impl Outcome {
    /// The word for it, a symbol, and the CSS class.
    pub const fn words(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::Stable => ("stable", "●", "stable"),
            Self::Warned => ("warned", "▲", "warned"),
            Self::Failed => ("failed", "✕", "failed"),
            Self::Silent => ("failed silently", "✕?", "silent"),
            Self::Unknown => ("not computed", "·", "unknown"),
        }
    }
}

/// Outcomes over two parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Map {
    /// What was tested; unique within the section.
    pub title: String,
    /// Name with unit of the horizontal parameter, and its values as text.
    pub x: (String, Vec<String>),
    /// Name with unit of the vertical parameter, and its values from top to bottom.
    pub y: (String, Vec<String>),
    /// One row for each value of `y`, one entry for each value of `x`: the outcome, and a measured
    /// number or a word, which may be empty.
    pub cells: Vec<Vec<(Outcome, String)>>,
    /// How to read it, and the theory to compare with.
    pub caption: String,
}

impl Map {
    /// The map as a table, for CSV.
    pub fn table(&self) -> Table {
        let corner = format!("{} \\ {}", self.y.0, self.x.0);
        let columns = std::iter::once(corner.as_str()).chain(self.x.1.iter().map(String::as_str));
        let mut table = Table::new(self.title.clone(), columns);
        for (value, cells) in self.y.1.iter().zip(&self.cells) {
            let words = cells.iter().map(|(outcome, number)| {
                let (word, ..) = outcome.words();
                if number.is_empty() { word.to_owned() } else { format!("{word} ({number})") }
            });
            table.row(std::iter::once(value.clone()).chain(words));
        }
        table
    }

    /// Number of cells with this outcome.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.cells.iter().flatten().filter(|(found, _)| *found == outcome).count()
    }

    /// The legend: symbols and words of the outcomes that occur.
    pub fn legend(&self) -> String {
        let mut text = String::new();
        let all =
            [Outcome::Stable, Outcome::Warned, Outcome::Failed, Outcome::Silent, Outcome::Unknown];
        for outcome in all {
            if self.count(outcome) > 0 {
                let (word, sign, _) = outcome.words();
                let _ = write!(text, "{sign} {word}   ");
            }
        }
        text.trim_end().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_a_table_too() {
        let map = Map {
            title: "step against basis".into(),
            x: ("step".into(), vec!["0.5".into(), "1".into()]),
            y: ("basis".into(), vec!["linear".into()]),
            cells: vec![vec![(Outcome::Stable, String::new()), (Outcome::Failed, "0.8".into())]],
            caption: String::new(),
        };
        assert_eq!(map.table().csv(), "basis \\ step,0.5,1\nlinear,stable,failed (0.8)\n");
        assert_eq!(map.legend(), "● stable   ✕ failed");
    }
}
