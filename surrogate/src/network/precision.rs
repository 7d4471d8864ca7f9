//! Precision of a network's arithmetic.

use serde::{Deserialize, Serialize};

/// Precision of matrix products. Sums, LayerNorm, the optimiser and the master weights are in
/// float32 either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// States are stored in float32; on a GPU, products are split into float16 or bfloat16 parts.
    F32,
    /// States are stored and multiplied in bfloat16 on the tensor cores of a GPU.
    Bf16,
}
