//! Backward pass of MLPs: gradients of all linears' outputs and of the inputs.

use std::sync::Arc;

use gpu::{ConstPointer, Pointer, Source, checks, cuda_struct, definitions, files, kernel};

use super::geometry::{WARP, blocks};
use super::gradient::Product;
use super::launcher::{Launcher, Rows};
use super::resident_or_streamed::{Residence, ResidentOrStreamed};
use super::tile::{Stored, Word, network_source, stream_threads, vector_bytes};
use crate::cuda::error::CudaError;
use crate::network::Precision;

/// Most MLPs of a launch.
pub(super) const BACKWARD_BATCH: usize = 8;

cuda_struct! {
    /// An MLP to differentiate.
    #[derive(Default)]
    pub(in crate::cuda) struct Backward {
        /// Number of rows.
        pub count: ConstPointer<u32>,
        /// The gradient of the output is the sum of up to four; each may be null: rows
        /// `output_index[k]` (or k) of this one,
        pub output: ConstPointer<Stored>,
        pub output_index: ConstPointer<u32>,
        /// rows of this one in float32,
        pub output32: Pointer<f32>,
        /// x_0 W_0 + x_1 W_1 with packed and transposed weights (the sum with `output32` goes there
        /// if bit 0 of `accumulate` is set),
        pub parts: [ConstPointer<Stored>; 2],
        pub part_weights: ConstPointer<Word>,
        /// and rows `gathered_index[k]` of this one.
        pub gathered: ConstPointer<f32>,
        pub gathered_index: ConstPointer<u32>,
        /// If not null, rows count where it is `NONE` (`select_none` = 1) or is not (0).
        pub selection: ConstPointer<u32>,
        /// Saved by the forward pass: activations of the hidden layers, `stride` numbers apart,
        pub hidden: ConstPointer<Stored>,
        pub stride: u64,
        /// output before LayerNorm's scale and shift, and the reciprocal standard deviation.
        pub normal: ConstPointer<Stored>,
        pub deviation: ConstPointer<f32>,
        /// Matrices of the hidden layers, the last first, then of x_0 and x_1: packed and
        /// transposed, or plain for `edges_backward`.
        pub weights: ConstPointer<Word>,
        /// All weights of the network, of which LayerNorm's scale is read.
        pub parameters: ConstPointer<f32>,
        /// Products for the gradients of the weights, which `edges_backward` computes.
        pub products: ConstPointer<Product>,
        /// Gradients of the linears' outputs, `stride` numbers apart, the first linear's first.
        pub linear: Pointer<Stored>,
        /// Gradients of x_0 and x_1, if not null; added to what is there if bit 0 or 1 of
        /// `accumulate` is set.
        pub input32: [Pointer<f32>; 2],
        /// The gradient of x_0 as it is stored.
        pub input: Pointer<Stored>,
        /// Gradients of LayerNorm's scale and shift, 128 each for each block.
        pub norm_sums: Pointer<f32>,
        /// Gradients of the first linear's outputs, summed over runs of rows with the same
        /// `gathered_index` (`edges_backward`).
        pub sums: Pointer<f32>,
        /// Words of `weights`.
        pub units: i32,
        pub select_none: i32,
        /// Offset in `parameters` of LayerNorm's scale; -1 for none.
        pub norm: i32,
        /// Hidden layers.
        pub layers: i32,
        /// Columns of states that are not padding.
        pub width: i32,
        pub accumulate: i32,
        /// Number of `products`.
        pub product_count: i32,
        /// Blocks that share the rows.
        pub blocks: i32,
        /// Slope of LeakyReLU for negative arguments.
        pub slope: f32,
    }

    /// MLPs of a launch.
    #[derive(Default)]
    pub(super) struct BackwardBatch {
        item: [Backward; BACKWARD_BATCH],
    }
}

impl BackwardBatch {
    /// As many MLPs as a launch takes.
    pub fn new(items: &[Backward]) -> Self {
        let mut batch = Self::default();
        batch.item[..items.len()].copy_from_slice(items);
        batch
    }
}

kernel! {
    /// MLPs whose weights fit into shared memory.
    struct Resident: mlp_backward {
        batch: BackwardBatch,
    }

    /// MLPs whose weights are streamed through shared memory.
    struct Streamed: mlp_backward_streamed {
        batch: BackwardBatch,
    }
}

/// The source of one of the kernels.
pub(super) fn source(precision: Precision, shared: usize, residence: Residence) -> Source {
    let definitions = definitions![Product, Backward, BackwardBatch];
    let checks = match residence {
        Residence::Resident => checks![Resident],
        Residence::Streamed => checks![Streamed],
    };
    let text = [&definitions, files!["backward.cu"], &checks].concat();
    residence.of(network_source("backward.cu", &text, precision, shared))
}

/// Differentiates MLPs.
#[derive(Debug)]
pub(in crate::cuda) struct MlpBackward(ResidentOrStreamed<Resident, Streamed>);

impl MlpBackward {
    pub fn load(launcher: &Arc<Launcher>) -> Result<Self, CudaError> {
        ResidentOrStreamed::load(launcher, source).map(Self)
    }

    /// MLPs of edges side by side, with the same sizes of weights and the same blocks.
    pub fn of_edges(&self, items: &[Backward], rows: Rows) -> Result<(), CudaError> {
        let kernels = &self.0;
        let launcher = &kernels.launcher;
        let sizes = items.iter().map(|item| (item.units, 1));
        let resident = kernels.resident_shared(sizes);
        let Some(shared) = resident else {
            return self.streamed("backward, edges", items, rows, false);
        };
        let threads = launcher.precision.threads();
        // Each warp sums up the gradients of LayerNorm's scale and shift.
        let sums = vector_bytes(2 * (threads / WARP) as usize);
        for part in items.chunks(BACKWARD_BATCH) {
            let grid = [part[0].blocks as usize, part.len()];
            // No PDL: it costs more than it saves.
            let launch = blocks(grid, threads).shared(shared.max(sums));
            let arguments = Resident { batch: BackwardBatch::new(part) };
            let kernel = &kernels.resident;
            // SAFETY: the pointers of the items are to live buffers for their rows.
            unsafe { launcher.launch("backward, edges", kernel, launch, &arguments)? };
        }
        Ok(())
    }

    /// MLPs of nodes side by side, with the same blocks.
    pub fn of_nodes(&self, items: &[Backward], rows: Rows) -> Result<(), CudaError> {
        self.streamed("backward, nodes", items, rows, true)
    }

    fn streamed(
        &self,
        name: &'static str,
        items: &[Backward],
        rows: Rows,
        early: bool,
    ) -> Result<(), CudaError> {
        let kernels = &self.0;
        for part in items.chunks(BACKWARD_BATCH) {
            let count = part[0].blocks as usize;
            let launch = blocks([count, part.len()], stream_threads(rows.max, count));
            let launch = launch.shared(kernels.stream_shared).early(early);
            let arguments = Streamed { batch: BackwardBatch::new(part) };
            // SAFETY: the pointers of the items are to live buffers for their rows.
            unsafe { kernels.launcher.launch(name, &kernels.streamed, launch, &arguments)? };
        }
        Ok(())
    }
}
