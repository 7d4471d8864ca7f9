//! The two kernels of a pass through MLPs: one keeps all weights of an MLP in the shared memory of a
//! block, the other streams them through it.

use std::sync::Arc;

use gpu::{Function, Kernel, Source};

use super::launcher::Launcher;
use super::tile::{Word, stream_shared, vector_bytes};
use crate::cuda::error::CudaError;
use crate::network::Precision;

/// Kernels for weights that are resident in shared memory (`R`) and for streamed ones (`S`).
#[derive(Debug)]
pub(super) struct ResidentOrStreamed<R: Kernel, S: Kernel> {
    pub launcher: Arc<Launcher>,
    pub resident: Function<R>,
    pub streamed: Function<S>,
    /// Shared memory of a block through which weights are streamed (bytes).
    pub stream_shared: usize,
}

impl<R: Kernel, S: Kernel> ResidentOrStreamed<R, S> {
    /// Compiles `source`, which is given the precision and the shared memory of a block (bytes).
    pub fn load(
        launcher: &Arc<Launcher>,
        source: fn(Precision, usize) -> Source,
    ) -> Result<Self, CudaError> {
        let (precision, shared) = (launcher.precision, launcher.shared);
        let stream_shared = stream_shared(precision, shared);
        let module = launcher.load(&source(precision, shared))?;
        Ok(Self {
            resident: launcher.kernel(&module)?.with_shared(shared)?,
            streamed: launcher.kernel(&module)?.with_shared(stream_shared)?,
            stream_shared,
            launcher: launcher.clone(),
        })
    }

    /// Shared memory (bytes) in which the weights of the largest MLP are resident, if a block has so much.
    /// `sizes` are the words of an MLP's weights and its vectors of 128 float32.
    pub fn resident_shared(&self, sizes: impl Iterator<Item = (i32, usize)>) -> Option<usize> {
        let bytes = |(units, vectors)| vector_bytes(vectors) + size_of::<Word>() * units as usize;
        sizes.map(bytes).max().filter(|bytes| *bytes <= self.launcher.shared)
    }
}
