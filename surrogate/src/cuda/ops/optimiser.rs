//! The loss, the gradient of the weights from all blocks' sums, and Adam's step.

use std::sync::Arc;

use cudarc::driver::{CudaSlice, CudaStream};
use gpu::{
    ConstPointer, Function, Kernel, Launch, Pointer, Source, checks, cuda_struct, definitions,
    files, kernel,
};

use super::geometry::blocks;
use super::launcher::Launcher;
use super::tile::{WIDTH, network_source};
use crate::cuda::error::CudaError;
use crate::network::Precision;

/// Numbers behind the gradient: the sums of squared errors and of squared targets, or of the losses of
/// groups and of ones; their ratio is the loss.
pub(in crate::cuda) const LOSS_SUMS: usize = 2;

/// Rows of weights that a block adds up.
const REDUCE_ROWS: usize = 4;
/// Threads of the block that computes the loss (`LOSS_THREADS` of `optimiser.cu`), and of Adam's.
const LOSS_THREADS: u32 = 1024;
const ADAM_THREADS: u32 = 256;

cuda_struct! {
    /// A part of the list of all weights, and the sums of which its gradient consists.
    #[derive(Default)]
    pub(in crate::cuda) struct Target {
        /// `count` slices of `size` numbers, of which `rows` x `columns` from `first` on, in rows of
        /// 128, are added up.
        pub sums: ConstPointer<f32>,
        /// If the product was one with x in place of scale x + shift (`norm` >= 0): the sums of dZ,
        /// `shift_count` slices.
        pub shift_sums: ConstPointer<f32>,
        pub count: i32,
        pub size: i32,
        pub first: i32,
        pub rows: i32,
        pub columns: i32,
        pub shift_count: i32,
        /// Offset in the list of weights of the scale, and of the shift `width` on; -1 for none.
        pub norm: i32,
        pub width: i32,
        /// Offset in the list of weights.
        pub to: i32,
    }
}

kernel! {
    /// Targets to add up.
    struct ReduceGradient: reduce_gradient {
        targets: ConstPointer<Target>,
        /// All weights of the network.
        parameters: ConstPointer<f32>,
        /// The gradient, in the order of the weights.
        gradient: Pointer<f32>,
    }

    /// What the loss is computed from, and where to.
    pub(in crate::cuda) struct Loss: loss_gradient {
        /// Accelerations a of the network and a* to learn (nodes x `columns`).
        pub output: ConstPointer<f32>,
        pub target: ConstPointer<f32>,
        /// Number of nodes up to the end of each of `groups` groups.
        pub ends: ConstPointer<u32>,
        pub groups: i32,
        pub columns: i32,
        /// Gradient of sum (a - a*)² with respect to a, in rows of 128.
        pub gradient: Pointer<f32>,
        /// [`LOSS_SUMS`]: sum (a - a*)² and sum (a*² + `floor`²).
        pub sums: Pointer<f32>,
        pub floor: f32,
        /// 1: divides gradient and sums of each group by its second sum.
        pub relative: i32,
    }

    /// A step of Adam. Lists are as long as that of the weights.
    pub(in crate::cuda) struct Adam: adam {
        pub weights: Pointer<f32>,
        /// Moving averages of the gradient and of its square,
        pub mean: Pointer<f32>,
        pub square: Pointer<f32>,
        /// and of the weights, if not null.
        pub average: Pointer<f32>,
        /// The gradient, with the sums of the loss behind it.
        pub gradient: ConstPointer<f32>,
        /// Learning rate, 1 - beta^n of both averages, decay of the average of the weights.
        pub rates: ConstPointer<f32>,
        /// Marks the weights that Muon updates, if not null.
        pub muon: ConstPointer<u8>,
        /// Number of weights.
        pub count: i32,
        /// Ring of losses, number of steps so far, and length of the ring.
        pub losses: Pointer<f32>,
        pub counter: Pointer<u32>,
        pub ring: u32,
    }
}

/// The source of the kernels.
pub(super) fn source(precision: Precision, shared: usize) -> Source {
    let checks = checks![ReduceGradient, Loss, Adam];
    let text = [&definitions![Target], files!["optimiser.cu"], &checks].concat();
    network_source("optimiser.cu", &text, precision, shared).define("REDUCE_ROWS", REDUCE_ROWS)
}

/// Computes losses and steps.
#[derive(Debug)]
pub(in crate::cuda) struct Optimiser {
    launcher: Arc<Launcher>,
    reduce_gradient: Function<ReduceGradient>,
    loss_gradient: Function<Loss>,
    adam: Function<Adam>,
}

impl Optimiser {
    pub fn load(launcher: &Arc<Launcher>) -> Result<Self, CudaError> {
        let module = launcher.load(&source(launcher.precision, launcher.shared))?;
        Ok(Self {
            reduce_gradient: launcher.kernel(&module)?,
            loss_gradient: launcher.kernel(&module)?,
            adam: launcher.kernel(&module)?,
            launcher: launcher.clone(),
        })
    }

    /// Adds up `count` targets, on the device's stream unless another one is given.
    pub fn reduce_gradient(
        &self,
        stream: Option<&Arc<CudaStream>>,
        targets: ConstPointer<Target>,
        count: usize,
        parameters: &CudaSlice<f32>,
        gradient: &CudaSlice<f32>,
    ) -> Result<(), CudaError> {
        let own = self.launcher.device.stream();
        let arguments = ReduceGradient {
            targets,
            parameters: ConstPointer::to(parameters, own),
            gradient: Pointer::to(gradient, own),
        };
        let launch = blocks([WIDTH / REDUCE_ROWS, count], (REDUCE_ROWS * WIDTH) as u32);
        let (launch, stream) = (launch.early(stream.is_none()), stream.unwrap_or(own));
        let (name, kernel) = (ReduceGradient::NAME, &self.reduce_gradient);
        // SAFETY: the pointers of the targets are to live buffers.
        unsafe { self.launcher.launch_on(stream, name, kernel, launch, &arguments) }
    }

    /// The loss and its gradient.
    pub fn loss_gradient(&self, arguments: &Loss) -> Result<(), CudaError> {
        let launch = blocks([1, 1], LOSS_THREADS).early(true);
        // SAFETY: live buffers of these sizes.
        unsafe { self.launcher.launch(Loss::NAME, &self.loss_gradient, launch, arguments) }
    }

    /// A step of Adam; the loss goes where the counter says.
    pub fn adam(&self, arguments: &Adam) -> Result<(), CudaError> {
        let launch = Launch::each(arguments.count as usize, ADAM_THREADS);
        // SAFETY: live buffers of this size.
        unsafe { self.launcher.launch(Adam::NAME, &self.adam, launch, arguments) }
    }
}
