//! What sections show where they lack a network.

use crate::render::block::Block;
use crate::studies::sweep::Sweep;

/// The block for learned simulators without a model.
pub fn no_model() -> Block {
    Block::missing(
        "Learned simulators",
        "no model was found.",
        "`surrogate train` makes one; `--models` takes its folder.",
    )
}

/// Networks that a scene leaves out.
pub fn left_out(sweep: &Sweep) -> Option<Block> {
    let names = sweep.outside.join(", ");
    (!names.is_empty()).then(|| {
        Block::text(format!("Left out, as the scene lies outside of their training data: {names}."))
    })
}
