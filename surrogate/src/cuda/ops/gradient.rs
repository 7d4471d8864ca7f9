//! Gradients of linears' weights and biases: products of their inputs with the gradients of their
//! outputs.

use std::sync::Arc;

use gpu::{
    ConstPointer, Function, Kernel, Pointer, Source, checks, cuda_struct, definitions, files,
    kernel,
};

use super::geometry::blocks;
use super::launcher::Launcher;
use super::tile::{Stored, network_source};
use crate::cuda::error::CudaError;
use crate::network::Precision;

cuda_struct! {
    /// The gradient of a linear's weights, X^T dZ, and of its bias, the column sums of dZ. The rows
    /// are shared out among blocks, whose sums `reduce_gradient` adds up in a fixed order.
    #[derive(Default)]
    pub(in crate::cuda) struct Product {
        /// Number of rows.
        pub count: ConstPointer<u32>,
        /// X (rows x 128); row k is row `index[k]` if `index` is not null.
        pub x: ConstPointer<Stored>,
        pub index: ConstPointer<u32>,
        /// X (rows x `feature_count`), if `x` is null.
        pub features: ConstPointer<f32>,
        /// dZ (rows x 128).
        pub dz: ConstPointer<Stored>,
        /// Sums of each block: 128 x 128,
        pub weight: Pointer<f32>,
        /// and 128, if not null.
        pub bias: Pointer<f32>,
        pub feature_count: i32,
        /// Blocks that share the rows.
        pub blocks: i32,
    }
}

kernel! {
    /// Products of a launch.
    struct WeightGradient: weight_gradient {
        products: ConstPointer<Product>,
    }
}

/// The source of the kernel.
pub(super) fn source(precision: Precision, shared: usize) -> Source {
    let definitions = definitions![Product];
    let checks = checks![WeightGradient];
    let text = [files!["matrix.cuh"], &definitions, files!["gradient.cu"], &checks].concat();
    network_source("gradient.cu", &text, precision, shared)
}

/// Rows of a tile in shared memory, and bytes of one of them in each part.
const TILE_ROWS: usize = 64;
const ROW_BYTES: usize = 256;
/// Threads of a block for each part of a number.
const THREADS_PER_PART: u32 = 256;

/// Computes gradients of weights.
#[derive(Debug)]
pub(in crate::cuda) struct Gradient {
    launcher: Arc<Launcher>,
    weight_gradient: Function<WeightGradient>,
    /// Shared memory of a block (bytes).
    shared: usize,
}

impl Gradient {
    pub fn load(launcher: &Arc<Launcher>) -> Result<Self, CudaError> {
        let precision = launcher.precision;
        let stages = match (precision, launcher.is_hopper()) {
            (Precision::Bf16, _) => 3,
            (Precision::F32, true) => 2,
            (Precision::F32, false) => 1,
        };
        // X and dZ of each stage.
        let shared = stages * 2 * precision.parts() * TILE_ROWS * ROW_BYTES;
        let module = launcher.load(&source(precision, launcher.shared))?;
        let weight_gradient = launcher.kernel(&module)?.with_shared(shared)?;
        Ok(Self { launcher: launcher.clone(), weight_gradient, shared })
    }

    /// `count` products, each of which at most `most_blocks` blocks share.
    pub fn weight_gradient(
        &self,
        products: ConstPointer<Product>,
        count: usize,
        most_blocks: usize,
    ) -> Result<(), CudaError> {
        let threads = THREADS_PER_PART * self.launcher.precision.parts() as u32;
        let launch = blocks([most_blocks, count], threads).shared(self.shared).early(true);
        let (name, kernel) = (WeightGradient::NAME, &self.weight_gradient);
        // SAFETY: the pointers of the products are to live buffers.
        unsafe { self.launcher.launch(name, kernel, launch, &WeightGradient { products }) }
    }
}
