//! What sections show where they would need a model.

use crate::render::block::Block;

/// The block for learned simulators without a model.
pub fn no_model() -> Block {
    Block::missing(
        "Learned simulators",
        "no model was found.",
        "`surrogate train` makes one; `--models` takes its folder.",
    )
}
