//! Cells of the tables that compare with the paper.

use crate::text::number;

/// Ours over the paper's; empty unless both are known.
pub(super) fn ratio(paper: Option<f64>, ours: Option<f64>) -> String {
    match (paper, ours) {
        (Some(paper), Some(ours)) => number(ours / paper),
        _ => String::new(),
    }
}
