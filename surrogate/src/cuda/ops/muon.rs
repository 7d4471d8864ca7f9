//! A step of Muon.

use std::sync::Arc;

use cudarc::driver::CudaSlice;
use gpu::{
    ConstPointer, Function, Kernel, Launch, Pointer, Source, checks, cuda_struct, definitions,
    files, kernel,
};

use super::launcher::Launcher;
use super::tile::{WIDTH, network_source};
use crate::cuda::error::CudaError;
use crate::network::Precision;
use crate::network::parameters::HiddenMatrix;

/// Threads of a block (`MUON_THREADS` of `muon.cu`).
const THREADS: u32 = 256;
/// Shared memory of a block (bytes): three matrices of 128 x 128.
const SHARED: usize = 3 * WIDTH * WIDTH * size_of::<f32>();

cuda_struct! {
    /// A matrix of at most 128 columns in the list of weights, row by row.
    pub(in crate::cuda) struct Matrix {
        pub start: i32,
        pub rows: i32,
        pub columns: i32,
    }
}

kernel! {
    /// A step of Muon. Lists are as long as that of the weights.
    pub(in crate::cuda) struct MuonStep: muon {
        pub matrices: ConstPointer<Matrix>,
        pub weights: Pointer<f32>,
        /// Moving averages of the gradient,
        pub mean: Pointer<f32>,
        /// and of the weights, if not null.
        pub average: Pointer<f32>,
        /// The gradient, with the sums of the loss behind it.
        pub gradient: ConstPointer<f32>,
        /// As those of Adam.
        pub rates: ConstPointer<f32>,
        /// Number of weights.
        pub count: i32,
    }
}

/// The source of the kernel.
pub(super) fn source(precision: Precision, shared: usize) -> Source {
    let text = [&definitions![Matrix], files!["muon.cu"], &checks![MuonStep]].concat();
    network_source("muon.cu", &text, precision, shared)
}

/// Updates matrices.
#[derive(Debug)]
pub(in crate::cuda) struct Muon {
    launcher: Arc<Launcher>,
    muon: Function<MuonStep>,
    matrices: CudaSlice<Matrix>,
    marks: CudaSlice<u8>,
}

impl Muon {
    /// For these matrices of `count` weights.
    pub fn load(
        launcher: &Arc<Launcher>,
        matrices: &[HiddenMatrix],
        count: usize,
    ) -> Result<Self, CudaError> {
        if launcher.shared < SHARED {
            return Err(CudaError::Muon { needed: SHARED >> 10, found: launcher.shared >> 10 });
        }
        let module = launcher.load(&source(launcher.precision, launcher.shared))?;
        let mut marks = vec![0; count];
        matrices.iter().for_each(|matrix| marks[matrix.range()].fill(1));
        let matrices: Vec<_> = matrices
            .iter()
            .map(|&HiddenMatrix { start, rows, columns }| Matrix {
                start: start as i32,
                rows: rows as i32,
                columns: columns as i32,
            })
            .collect();
        Ok(Self {
            launcher: launcher.clone(),
            muon: launcher.kernel(&module)?.with_shared(SHARED)?,
            matrices: launcher.device.upload(&matrices)?,
            marks: launcher.device.upload(&marks)?,
        })
    }

    /// A one for each weight of the matrices, a zero for all others.
    pub fn marks(&self) -> ConstPointer<u8> {
        ConstPointer::to(&self.marks, self.launcher.device.stream())
    }

    /// The matrices.
    pub fn matrices(&self) -> ConstPointer<Matrix> {
        ConstPointer::to(&self.matrices, self.launcher.device.stream())
    }

    /// A step.
    pub fn step(&self, arguments: &MuonStep) -> Result<(), CudaError> {
        let launch = Launch::blocks(self.matrices.len() as u32, THREADS).shared(SHARED);
        // SAFETY: live buffers of these sizes.
        unsafe { self.launcher.launch(MuonStep::NAME, &self.muon, launch, arguments) }
    }
}
