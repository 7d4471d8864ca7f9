//! What sections show where data or models are missing.

use std::path::PathBuf;

use crate::models::Model;
use crate::render::block::Block;

/// How to get the trajectories of the paper.
pub(super) const MAKE_DATA: &str =
    "`dempm dataset paper -o DATA` makes them; `--data DATA` takes them.";

/// Blocks for missing trajectories and missing models; none if both are there.
pub(super) fn absent(cases: &[(String, PathBuf)], models: &[Model], set: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    if cases.is_empty() {
        blocks.push(Block::missing(
            "This comparison",
            format!("there are no such trajectories in `{set}/` of the data."),
            MAKE_DATA,
        ));
    }
    if models.is_empty() {
        blocks.push(Block::missing(
            "This comparison",
            "no such model was found.",
            "`surrogate train configs/paper/NAME-data1.toml` trains one; `--models` takes its folder.",
        ));
    }
    blocks
}
