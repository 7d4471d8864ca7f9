//! What all kernels of a network share: sizes of tiles and matrices, and the texts that their
//! sources begin with (`ptx.cuh`, `tile.cuh`).

use cudarc::driver::{DeviceRepr, ValidAsZeroBits};
use gpu::{CudaName, Source, cuda_types, files};

use crate::network::Precision;

/// Columns of a state; narrower networks are padded with zeros.
pub(in crate::cuda) const WIDTH: usize = 128;
/// Size of a packed matrix of 128 x 128 two-byte numbers, in [`Word`]s.
pub(in crate::cuda) const MATRIX_WORDS: usize = 2048;
/// Most hidden layers of an MLP: their biases fit beside a matrix in shared memory.
pub(in crate::cuda) const MAX_HIDDEN_LAYERS: usize = 16;
/// Vectors beside the hidden layers' biases: the last bias, and scale and shift of two LayerNorms.
pub(super) const OTHER_VECTORS: usize = 5;

/// Threads of a team of warps, which multiply together (`TEAM` of `tile.cuh`).
const TEAM_THREADS: u32 = 128;
/// Most threads of a block through which weights are streamed.
const STREAM_THREADS: u32 = 256;
/// Most vectors of 128 float32 beside the streamed weights: biases and LayerNorms, or sums of a
/// LayerNorm's gradients.
const STREAM_VECTORS: usize = MAX_HIDDEN_LAYERS + OTHER_VECTORS;
/// Most matrices of a ring: more would only keep other blocks out.
const MAX_RING: usize = 4;

cuda_types! {
    /// A number of a state as it is stored: float32 or bfloat16 ([`Precision::stored_bytes`]).
    pub(in crate::cuda) type Stored;
}

/// 16 bytes of packed weights.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
pub(in crate::cuda) struct Word([u32; 4]);

impl CudaName for Word {
    const NAME: &'static str = "uint4";
}
// SAFETY: four plain numbers.
unsafe impl DeviceRepr for Word {}
// SAFETY: as above.
unsafe impl ValidAsZeroBits for Word {}

impl Precision {
    /// Two-byte numbers whose sum is a factor of a product.
    pub(in crate::cuda) fn parts(self) -> usize {
        match self {
            Self::F32 => 2,
            Self::Bf16 => 1,
        }
    }

    /// Bytes of a [`Stored`] number.
    pub(in crate::cuda) fn stored_bytes(self) -> usize {
        2 * self.parts()
    }

    /// Threads of a block that keeps an MLP's weights: as many as there are registers for.
    pub(super) fn threads(self) -> u32 {
        match self {
            Self::F32 => 256,
            Self::Bf16 => 512,
        }
    }

    /// Bytes of a packed matrix.
    fn matrix_bytes(self) -> usize {
        size_of::<Word>() * MATRIX_WORDS * self.parts()
    }
}

/// Bytes of `count` vectors of 128 float32.
pub(super) fn vector_bytes(count: usize) -> usize {
    count * WIDTH * size_of::<f32>()
}

/// Matrices that fit into the ring through which weights are streamed, given the shared memory of a
/// block (bytes).
fn ring(precision: Precision, shared: usize) -> usize {
    let free = shared - vector_bytes(STREAM_VECTORS);
    (free / precision.matrix_bytes()).clamp(1, MAX_RING)
}

/// Shared memory (bytes) of a block through which weights are streamed.
pub(super) fn stream_shared(precision: Precision, shared: usize) -> usize {
    ring(precision, shared) * precision.matrix_bytes() + vector_bytes(STREAM_VECTORS)
}

/// Threads of a block through which weights are streamed: as many teams as have rows.
pub(super) fn stream_threads(rows: usize, blocks: usize) -> u32 {
    let teams = rows.div_ceil(ROWS_OF_TEAM).div_ceil(blocks).max(1) as u32;
    (teams * TEAM_THREADS).min(STREAM_THREADS)
}

/// Rows that a team takes through an MLP at once: 16 of each of its four warps.
pub(super) const ROWS_OF_TEAM: usize = 64;

/// The source `name` of a network's kernels with `text` behind what all share, for a GPU with so much
/// shared memory for a block (bytes).
pub(super) fn network_source(
    name: &'static str,
    text: &str,
    precision: Precision,
    shared: usize,
) -> Source {
    Source {
        name,
        text: [files!["ptx.cuh", "tile.cuh"], text].concat(),
        defines: vec![
            format!("STREAM_THREADS={STREAM_THREADS}"),
            format!("RING={}", ring(precision, shared)),
            format!("PARTS={}", precision.parts()),
            format!("THREADS={}", precision.threads()),
        ],
    }
}
