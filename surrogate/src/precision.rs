//! Precision of a network's arithmetic.

use serde::{Deserialize, Serialize};

/// Precision of a network's states and products. Weights, sums, LayerNorm and the optimiser are
/// float32 in either.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// float32; on a GPU products of pairs of float16 or bfloat16
    F32,
    /// bfloat16, on the tensor cores of a GPU
    Bf16,
}
