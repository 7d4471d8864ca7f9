//! The two kernels of a pass through MLPs: one keeps all weights of an MLP in the shared memory of a
//! block, the other streams them through it.

use std::sync::Arc;

use gpu::{Function, Kernel, Source};

use super::launcher::Launcher;
use super::tile::{Word, stream_shared, vector_bytes};
use crate::cuda::error::CudaError;
use crate::network::Precision;

/// Where a kernel has its weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Residence {
    /// All in shared memory.
    Resident,
    /// They pass through it.
    Streamed,
}

impl Residence {
    /// Both, in sources of their own: each takes the compiler seconds.
    pub(super) const BOTH: [Self; 2] = [Self::Resident, Self::Streamed];

    /// The source with the one kernel.
    pub(super) fn of(self, source: Source) -> Source {
        source.define("STREAMED", usize::from(self == Self::Streamed))
    }
}

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
    /// Compiles `source`, which is given the precision, the shared memory of a block (bytes) and which of the two
    /// kernels it is for.
    pub fn load(
        launcher: &Arc<Launcher>,
        source: fn(Precision, usize, Residence) -> Source,
    ) -> Result<Self, CudaError> {
        let (precision, shared) = (launcher.precision, launcher.shared);
        let stream_shared = stream_shared(precision, shared);
        let load = |residence| launcher.load(&source(precision, shared, residence));
        let (resident, streamed) = (load(Residence::Resident)?, load(Residence::Streamed)?);
        Ok(Self {
            resident: launcher.kernel(&resident)?.with_shared(shared)?,
            streamed: launcher.kernel(&streamed)?.with_shared(stream_shared)?,
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
