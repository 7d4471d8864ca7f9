//! Launches of a network's kernels on one GPU, and the limits that their geometry follows from.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use cudarc::driver::sys::CUdevice_attribute;
use cudarc::driver::{CudaModule, CudaStream};
use gpu::{Device, Function, Kernel, Launch, Source};

use super::profile::Profile;
use super::tile::ROWS_OF_TEAM;
use crate::cuda::error::CudaError;
use crate::network::Precision;

/// The rows of a launch.
#[derive(Clone, Copy, Debug)]
pub(in crate::cuda) struct Rows {
    /// Edges, or else nodes.
    pub edges: bool,
    /// Most rows that there may be: kernels read the actual number on the device.
    pub max: usize,
}

/// Compiles and launches the kernels of a network.
#[derive(Debug)]
pub(in crate::cuda) struct Launcher {
    pub device: Arc<Device>,
    pub precision: Precision,
    /// Multiprocessors of the GPU.
    pub multiprocessors: usize,
    /// Shared memory of a block (bytes).
    pub shared: usize,
    /// Times of launches, if they are wanted.
    pub profile: Profile,
    /// The next launch is the first of a pass.
    first_of_pass: AtomicBool,
    /// Forward launches save what the backward pass needs.
    saves_activations: AtomicBool,
}

impl Launcher {
    /// For kernels in one precision.
    pub fn new(device: &Arc<Device>, precision: Precision) -> Result<Self, CudaError> {
        let multiprocessors = device
            .context()
            .attribute(CUdevice_attribute::CU_DEVICE_ATTRIBUTE_MULTIPROCESSOR_COUNT)?;
        Ok(Self {
            device: device.clone(),
            precision,
            multiprocessors: multiprocessors as usize,
            // What the driver keeps of a block's shared memory is not in the limit.
            shared: device.limits()?.shared_per_block,
            profile: Profile::default(),
            first_of_pass: AtomicBool::new(true),
            saves_activations: AtomicBool::new(true),
        })
    }

    /// Whether the GPU has `wgmma` and `setmaxnreg`, which need the `sm_90a` target.
    pub fn is_hopper(&self) -> bool {
        self.device.architecture() == "sm_90a"
    }

    /// Compiles a source, unless the result is in the cache, and loads it.
    pub fn load(&self, source: &Source) -> Result<Arc<CudaModule>, CudaError> {
        Ok(self.device.module(source.name, &source.text, &source.defines)?)
    }

    /// Finds a kernel in a module.
    pub fn kernel<K: Kernel>(&self, module: &Arc<CudaModule>) -> Result<Function<K>, CudaError> {
        Ok(Function::load(&self.device, module)?)
    }

    /// Begins a pass through the network. Its first kernel waits for all that was queued before:
    /// weights and numbers of rows may be new, which early kernels read as soon as they begin.
    /// `save_activations`: for a backward pass, if the network has memory for them.
    pub fn begin_pass(&self, save_activations: bool) {
        self.first_of_pass.store(true, Ordering::Relaxed);
        self.saves_activations.store(save_activations, Ordering::Relaxed);
    }

    /// Whether the pass saves what the backward pass needs.
    pub fn saves_activations(&self) -> bool {
        self.saves_activations.load(Ordering::Relaxed)
    }

    /// Queues a kernel on the device's stream; `name` is that of its times in the profile. The first
    /// kernel of a pass is never early.
    ///
    /// # Safety
    /// As [`Function::launch`]. Before it waits for its turn, an early kernel may also read what does
    /// not change during a pass: weights and numbers of rows.
    pub unsafe fn launch<K: Kernel>(
        &self,
        name: &'static str,
        kernel: &Function<K>,
        launch: Launch,
        arguments: &K,
    ) -> Result<(), CudaError> {
        // SAFETY: the caller's.
        unsafe { self.launch_on(self.device.stream(), name, kernel, launch, arguments) }
    }

    /// Queues a kernel on any stream.
    ///
    /// # Safety
    /// As [`launch`](Self::launch).
    pub unsafe fn launch_on<K: Kernel>(
        &self,
        stream: &Arc<CudaStream>,
        name: &'static str,
        kernel: &Function<K>,
        launch: Launch,
        arguments: &K,
    ) -> Result<(), CudaError> {
        let early = launch.early && !self.first_of_pass.swap(false, Ordering::Relaxed);
        self.profile.around(name, stream, || {
            // SAFETY: the caller's.
            Ok(unsafe { kernel.launch(stream, launch.early(early), arguments) }?)
        })
    }

    /// Blocks of an MLP on at most `rows` rows, if `together` MLPs share the multiprocessors. A
    /// multiprocessor has four tensor cores, so that four warps of 16 rows take no longer than one,
    /// and fewer blocks fetch fewer weights.
    pub fn blocks(&self, rows: usize, together: usize) -> usize {
        (self.multiprocessors / together).min(rows.div_ceil(ROWS_OF_TEAM)).max(1)
    }
}
