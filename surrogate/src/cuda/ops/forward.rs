//! Forward pass of MLPs: linears, LeakyReLU and LayerNorm in one kernel. The plain twin is
//! [`crate::network`].

use std::sync::Arc;

use gpu::{ConstPointer, Pointer, Source, checks, cuda_struct, definitions, files, kernel};

use super::geometry::blocks;
use super::launcher::{Launcher, Rows};
use super::resident_or_streamed::{Residence, ResidentOrStreamed};
use super::tile::{OTHER_VECTORS, Stored, Word, network_source, stream_threads};
use crate::cuda::error::CudaError;
use crate::network::Precision;

/// Most MLPs of a launch.
pub(in crate::cuda) const FORWARD_BATCH: usize = 16;

/// No offset among the weights: there is no such bias or LayerNorm.
pub(in crate::cuda) const NO_OFFSET: i32 = -1;

cuda_struct! {
    /// An MLP on rows of 128 columns: a linear of up to two matrices, of features and of gathered
    /// rows, then LeakyReLU and linear for each hidden layer, then LayerNorm.
    #[derive(Default)]
    pub(in crate::cuda) struct Forward {
        /// Number of rows.
        pub count: ConstPointer<u32>,
        /// Inputs x_0 and x_1 (rows x 128) of x_0 W_0 + x_1 W_1; each may be null.
        pub x: [ConstPointer<Stored>; 2],
        /// If not null, row k of x_0 is row `index[k]`.
        pub index: ConstPointer<u32>,
        /// Inputs of few columns (rows x `feature_count`), if not null.
        pub features: ConstPointer<f32>,
        /// Rows `added_index[k]` of these are added to row k of the first linear, if not null.
        pub added: [ConstPointer<Stored>; 2],
        pub added_index: [ConstPointer<u32>; 2],
        /// Packed matrices: of x_0, x_1 and the features, then of the hidden layers.
        pub weights: ConstPointer<Word>,
        /// All weights of the network, of which biases and LayerNorms are read.
        pub parameters: ConstPointer<f32>,
        /// Activations of the hidden layers, `stride` numbers apart; like all outputs, it may be
        /// null.
        pub hidden: Pointer<Stored>,
        pub stride: u64,
        /// Output before LayerNorm's scale and shift,
        pub normal: Pointer<Stored>,
        /// and the reciprocal standard deviation that LayerNorm multiplied by (rows).
        pub deviation: Pointer<f32>,
        /// Output with `residual` added. Rows whose `index` is `NONE` are not written.
        pub output: Pointer<Stored>,
        /// Added to the output, if not null.
        pub residual: ConstPointer<Stored>,
        /// Output in float32, added to what is there if `accumulate`.
        pub output32: Pointer<f32>,
        /// The first `columns` (at most 8) of the output alone (rows x `columns`).
        pub narrow: Pointer<f32>,
        /// Output before LayerNorm's scale and shift, summed over the rows of a tile of 16 that have
        /// the same receiver (`added_index[1]`), which ascend from row to row. The sum of receiver v
        /// in tile k is row k + v.
        pub sums: Pointer<f32>,
        /// Words of the packed matrices.
        pub units: i32,
        /// Features, numbers from one row of them to the next, and steps of 16 columns that they
        /// take.
        pub feature_count: i32,
        pub feature_stride: i32,
        pub feature_steps: i32,
        /// Offset in `parameters` of the first bias ([`NO_OFFSET`] for none), from one hidden layer's
        /// to the next, and of the last one.
        pub bias: i32,
        pub bias_stride: i32,
        pub last_bias: i32,
        /// Offset in `parameters` of LayerNorm's scale, which its shift follows.
        pub norm: i32,
        /// The same of a LayerNorm whose scale and shift are yet to be applied to x_0.
        pub input_norm: i32,
        /// Hidden layers.
        pub layers: i32,
        /// Columns of states that are not padding.
        pub width: i32,
        /// Columns of the output that are not padding.
        pub columns: i32,
        /// 1: adds to `output32`.
        pub accumulate: i32,
        /// Slope of LeakyReLU for negative arguments.
        pub slope: f32,
    }

    /// MLPs of a launch.
    #[derive(Default)]
    struct ForwardBatch {
        item: [Forward; FORWARD_BATCH],
    }
}

kernel! {
    /// MLPs whose weights fit into shared memory.
    struct Resident: mlp_forward {
        batch: ForwardBatch,
    }

    /// MLPs whose weights are streamed through shared memory.
    struct Streamed: mlp_forward_streamed {
        batch: ForwardBatch,
    }
}

/// The source of one of the kernels.
pub(super) fn source(precision: Precision, shared: usize, residence: Residence) -> Source {
    let definitions = definitions![Forward, ForwardBatch];
    let checks = match residence {
        Residence::Resident => checks![Resident],
        Residence::Streamed => checks![Streamed],
    };
    let text = [&definitions, files!["forward.cu"], &checks].concat();
    residence.of(network_source("forward.cu", &text, precision, shared))
}

/// Computes MLPs.
#[derive(Debug)]
pub(in crate::cuda) struct MlpForward(ResidentOrStreamed<Resident, Streamed>);

impl MlpForward {
    pub fn load(launcher: &Arc<Launcher>) -> Result<Self, CudaError> {
        ResidentOrStreamed::load(launcher, source).map(Self)
    }

    /// MLPs side by side, with the same sizes of weights. A block keeps all weights of its MLP in
    /// shared memory if they fit, or else streams them through it.
    pub fn mlp_forward(&self, items: &[Forward], rows: Rows) -> Result<(), CudaError> {
        let kernels = &self.0;
        let launcher = &kernels.launcher;
        let name = if rows.edges { "forward, edges" } else { "forward, nodes" };
        let sizes = items.iter().map(|item| (item.units, item.layers as usize + OTHER_VECTORS));
        let resident = kernels.resident_shared(sizes);
        for part in items.chunks(FORWARD_BATCH) {
            let mut batch = ForwardBatch::default();
            for (to, from) in batch.item.iter_mut().zip(part) {
                *to = *from;
                if !launcher.saves_activations() {
                    (to.hidden, to.deviation) = (Pointer::NULL, Pointer::NULL);
                }
            }
            // Each MLP has its share of the multiprocessors.
            let count = launcher.blocks(rows.max, part.len());
            let grid = [count, part.len()];
            // SAFETY: the pointers of the items are to live buffers for `rows` rows.
            unsafe {
                match resident {
                    Some(shared) => {
                        let launch = blocks(grid, launcher.precision.threads());
                        let launch = launch.shared(shared).early(true);
                        let arguments = Resident { batch };
                        launcher.launch(name, &kernels.resident, launch, &arguments)?;
                    }
                    None => {
                        let launch = blocks(grid, stream_threads(rows.max, count));
                        let launch = launch.shared(kernels.stream_shared).early(true);
                        let arguments = Streamed { batch };
                        launcher.launch(name, &kernels.streamed, launch, &arguments)?;
                    }
                }
            }
        }
        Ok(())
    }
}
