//! Packing of weights in the order in which the tensor cores read them.

use std::sync::Arc;

use cudarc::driver::CudaSlice;
use gpu::{
    ConstPointer, Function, Kernel, Pointer, Source, checks, cuda_struct, definitions, files,
    kernel,
};

use super::geometry::blocks;
use super::launcher::Launcher;
use super::tile::{Word, network_source};
use crate::cuda::error::CudaError;
use crate::network::Precision;

cuda_struct! {
    /// A matrix to pack.
    pub(in crate::cuda) struct Pack {
        /// Offset, in the list of all weights, of element (0, 0) of a row-major matrix.
        pub from: i32,
        /// Columns of that matrix.
        pub stride: i32,
        /// Rows of the part that is not padding.
        pub rows: i32,
        /// Columns of the part that is not padding.
        pub columns: i32,
        /// 1: packs the transposed matrix.
        pub transposed: i32,
        /// Steps of 16 rows: 8 for a matrix of 128 x 128, fewer for features.
        pub steps: i32,
        /// 1: rows are features, in their natural order.
        pub features: i32,
        /// 1: bfloat16; 2: two float16 whose sum is the weight times `WEIGHT_SCALE`.
        pub parts: i32,
        /// 1: bfloat16, row after row as they are.
        pub plain: i32,
        /// First word among the packed weights.
        pub to: i32,
    }
}

kernel! {
    /// Packs matrices.
    struct PackWeights: pack_weights {
        packs: ConstPointer<Pack>,
        /// All weights of the network.
        all: ConstPointer<f32>,
        packed: Pointer<Word>,
    }
}

/// The source of the kernel.
pub(super) fn source(precision: Precision, shared: usize) -> Source {
    let text = [&definitions![Pack], files!["weights.cu"], &checks![PackWeights]].concat();
    network_source("weights.cu", &text, precision, shared)
}

/// Blocks that share a matrix, and their threads.
const BLOCKS: usize = 4;
const THREADS: u32 = 512;

/// Packs weights.
#[derive(Debug)]
pub(in crate::cuda) struct Weights {
    launcher: Arc<Launcher>,
    pack_weights: Function<PackWeights>,
}

impl Weights {
    pub fn load(launcher: &Arc<Launcher>) -> Result<Self, CudaError> {
        let module = launcher.load(&source(launcher.precision, launcher.shared))?;
        Ok(Self { launcher: launcher.clone(), pack_weights: launcher.kernel(&module)? })
    }

    /// Packs the matrices `packs` of all weights (`parameters`).
    pub fn pack_weights(
        &self,
        packs: &CudaSlice<Pack>,
        parameters: &CudaSlice<f32>,
        packed: &CudaSlice<Word>,
    ) -> Result<(), CudaError> {
        let stream = self.launcher.device.stream();
        let launch = blocks([packs.len(), BLOCKS], THREADS);
        let arguments = PackWeights {
            packs: ConstPointer::to(packs, stream),
            all: ConstPointer::to(parameters, stream),
            packed: Pointer::to(packed, stream),
        };
        let (name, kernel) = (PackWeights::NAME, &self.pack_weights);
        // SAFETY: `packed` has room for what the packs say.
        unsafe { self.launcher.launch(name, kernel, launch, &arguments) }
    }
}
