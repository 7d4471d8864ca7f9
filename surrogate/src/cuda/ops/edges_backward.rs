//! Backward pass of edges' MLPs in bfloat16 on Hopper, the gradients of the weights included.

use std::sync::Arc;

use gpu::{Function, Source, checks, definitions, files, kernel};

use super::backward::{BACKWARD_BATCH, Backward, BackwardBatch};
use super::geometry::blocks;
use super::gradient::Product;
use super::launcher::Launcher;
use super::tile::network_source;
use crate::cuda::error::CudaError;
use crate::network::Precision;

/// Threads of a block.
const THREADS: u32 = 512;
/// Shared memory of a block (bytes): two matrices of 128 rows and eight tiles of 64, all of 256 bytes,
/// and some vectors.
const SHARED: usize = (2 * 128 + 8 * 64) * 256 + (9 << 10);

kernel! {
    /// MLPs to differentiate.
    struct Batch: edges_backward {
        batch: BackwardBatch,
    }
}

/// The source of the kernel, which is empty but for bfloat16 on Hopper.
pub(super) fn source(precision: Precision, shared: usize) -> Source {
    let definitions = definitions![Product, Backward, BackwardBatch];
    let text = [
        files!["matrix.cuh"],
        "#if PARTS == 1 && defined(__CUDA_ARCH_FEAT_SM90_ALL)\n",
        &definitions,
        files!["edges_backward.cu"],
        &checks![Batch],
        "#endif\n",
    ];
    let text = text.concat();
    network_source("edges_backward.cu", &text, precision, shared).define("EDGES_SHARED", SHARED)
}

/// Differentiates edges' MLPs.
#[derive(Debug)]
pub(in crate::cuda) struct EdgesBackward {
    launcher: Arc<Launcher>,
    edges_backward: Function<Batch>,
}

impl EdgesBackward {
    /// The kernel, where it exists: in bfloat16 on Hopper.
    pub fn load(launcher: &Arc<Launcher>) -> Result<Option<Self>, CudaError> {
        if launcher.precision != Precision::Bf16 || !launcher.is_hopper() {
            return Ok(None);
        }
        let module = launcher.load(&source(launcher.precision, launcher.shared))?;
        let edges_backward = launcher.kernel(&module)?.with_shared(SHARED)?;
        Ok(Some(Self { launcher: launcher.clone(), edges_backward }))
    }

    /// MLPs side by side, with the same blocks.
    pub fn edges_backward(&self, items: &[Backward]) -> Result<(), CudaError> {
        for part in items.chunks(BACKWARD_BATCH) {
            let grid = [part[0].blocks as usize, part.len()];
            // No PDL: it costs more than it saves.
            let launch = blocks(grid, THREADS).shared(SHARED);
            let (kernel, batch) = (&self.edges_backward, BackwardBatch::new(part));
            // SAFETY: the pointers of the items are to live buffers for their rows.
            unsafe { self.launcher.launch("backward, edges", kernel, launch, &Batch { batch })? };
        }
        Ok(())
    }
}
