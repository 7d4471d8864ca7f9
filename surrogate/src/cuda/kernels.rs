//! The compiled kernels and what they take, laid out as in the sources.

use std::ffi::c_void;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use cudarc::driver::sys::{
    CUfunction_attribute, CUlaunchAttribute, CUlaunchAttributeID, CUlaunchAttributeValue,
    CUlaunchConfig, cuLaunchKernelEx,
};
use cudarc::driver::{CudaFunction, CudaModule, CudaStream, DeviceRepr, LaunchConfig};
use gpu::Device;

use super::arguments::{Address, Backward, Forward, Receive};
use super::error::CudaError;
use super::network::{MOST_LAYERS, View};
use super::profile::Profile;
use crate::network::Precision;

/// Columns of a state.
pub const WIDTH: usize = 128;
/// A packed matrix of 128 x 128 two-byte numbers, in words of 16 bytes.
pub const UNIT: usize = 2048;

impl Precision {
    /// Matrices of two-byte numbers whose sum is a matrix of numbers.
    pub fn parts(self) -> usize {
        match self {
            Self::F32 => 2,
            Self::Bf16 => 1,
        }
    }

    /// Bytes of a stored number.
    pub fn bytes(self) -> usize {
        2 * self.parts()
    }

    /// Threads of a block that takes rows through an MLP: as many as there are registers for.
    fn threads(self) -> u32 {
        match self {
            Self::F32 => 256,
            Self::Bf16 => 512,
        }
    }
}

macro_rules! source {
    ($($file:literal),*) => {
        concat!(include_str!("ptx.cuh"), include_str!("tile.cuh"), $(include_str!($file)),*)
    };
}

/// Names and texts of the kernels' sources.
pub const SOURCES: [(&str, &str); 7] = [
    ("weights.cu", source!("weights.cu")),
    ("forward.cu", source!("forward.cu")),
    ("backward.cu", source!("product.cuh", "backward.cuh", "backward.cu")),
    ("edges_backward.cu", source!("product.cuh", "backward.cuh", "edges_backward.cu")),
    ("gradient.cu", source!("product.cuh", "gradient.cu")),
    ("segment.cu", source!("segment.cu")),
    ("optimiser.cu", source!("optimiser.cu")),
];

/// Threads of a block through which weights pass, at most, and of a team of its warps.
const STREAM_THREADS: u32 = 256;
const TEAM_THREADS: u32 = 128;
/// Vectors of 128 f32 beside them: biases and LayerNorms, or sums of a LayerNorm's gradients.
const STREAM_VECTORS: usize = MOST_LAYERS + 5;

/// Matrices that are in shared memory, or on their way there, while weights pass through it: as many as
/// there is room for, but more than four would only keep others out.
fn ring(precision: Precision, shared: usize) -> usize {
    let room = shared - STREAM_VECTORS * WIDTH * 4;
    (room / (16 * UNIT * precision.parts())).clamp(1, 4)
}

/// Definitions that the sources need on a GPU with so many bytes of shared memory for a block.
pub fn defines(precision: Precision, shared: usize) -> Vec<String> {
    vec![
        format!("STREAM_THREADS={STREAM_THREADS}"),
        format!("RING={}", ring(precision, shared)),
        format!("PARTS={}", precision.parts()),
        format!("THREADS={}", precision.threads()),
        format!("FORWARD_BATCH={FORWARD_BATCH}"),
        format!("RECEIVE_BATCH={RECEIVE_BATCH}"),
        format!("REDUCE_ROWS={REDUCE_ROWS}"),
        format!("EDGES_SHARED={EDGES_SHARED}"),
    ]
}

/// Pointers to the arguments of a kernel.
macro_rules! arguments {
    ($($argument:ident),*) => { [$((&raw const $argument).cast_mut().cast::<c_void>()),*] };
}

/// What the rows of a launch are.
#[derive(Clone, Copy, Debug)]
pub struct Rows {
    /// Edges, or nodes.
    pub edges: bool,
    /// How many there may be: kernels look on the device for how many there are.
    pub most: usize,
}

/// MLPs of one forward launch, and of one backward launch; sums of one launch.
pub const FORWARD_BATCH: usize = 16;
pub const BACKWARD_BATCH: usize = 8;
pub const RECEIVE_BATCH: usize = 8;
/// Rows of weights that a block adds up.
const REDUCE_ROWS: usize = 4;

#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct ForwardBatch([Forward; FORWARD_BATCH]);

#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct BackwardBatch([Backward; BACKWARD_BATCH]);

#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct ReceiveBatch([Receive; RECEIVE_BATCH]);

// SAFETY: plain numbers, laid out as in the sources.
unsafe impl DeviceRepr for ReceiveBatch {}
// SAFETY: as above.
unsafe impl DeviceRepr for ForwardBatch {}
// SAFETY: as above.
unsafe impl DeviceRepr for BackwardBatch {}

/// All kernels, for one precision.
#[derive(Debug)]
pub struct Kernels {
    pub device: Arc<Device>,
    pub precision: Precision,
    /// Multiprocessors of the GPU.
    pub processors: u32,
    /// Times of launches, if they are wanted.
    pub profile: Profile,
    /// Bytes of a block, and of one through which weights pass.
    shared: usize,
    stream_shared: usize,
    /// Whether the GPU can begin a kernel while the one before ends.
    early: bool,
    /// The next launch is the first of a pass: the weights and numbers of rows may be new, which
    /// kernels read as soon as they begin.
    first: AtomicBool,
    /// MLPs keep what gradients need.
    keep: AtomicBool,
    pack: CudaFunction,
    forward: CudaFunction,
    forward_streamed: CudaFunction,
    backward: CudaFunction,
    backward_streamed: CudaFunction,
    /// In bf16 on Hopper.
    edges_backward: Option<CudaFunction>,
    product: CudaFunction,
    product_shared: usize,
    receive: CudaFunction,
    collect: CudaFunction,
    same: CudaFunction,
    reduce: CudaFunction,
    loss: CudaFunction,
    adam: CudaFunction,
}

impl Kernels {
    /// Compiles what is not in the cache.
    pub fn load(device: &Arc<Device>, precision: Precision) -> Result<Self, CudaError> {
        // What the driver keeps of a block's shared memory is not in the limit.
        let shared = device.limits()?.shared_per_block;
        let defines = defines(precision, shared);
        let modules = SOURCES
            .iter()
            .map(|(name, source)| device.module(name, source, &defines))
            .collect::<Result<Vec<Arc<CudaModule>>, _>>()?;
        let [weights, forward, backward, edges, gradient, segment, optimiser] = &modules[..] else {
            unreachable!("seven sources")
        };
        let hopper = device.architecture() == "sm_90a";
        let product_shared = product_shared(precision, hopper);
        let stream_shared =
            ring(precision, shared) * 16 * UNIT * precision.parts() + STREAM_VECTORS * WIDTH * 4;
        let with_shared = |module: &Arc<CudaModule>, name: &str, bytes: usize| {
            let kernel = module.load_function(name)?;
            kernel.set_attribute(
                CUfunction_attribute::CU_FUNC_ATTRIBUTE_MAX_DYNAMIC_SHARED_SIZE_BYTES,
                bytes as i32,
            )?;
            Ok::<_, CudaError>(kernel)
        };
        let processors = device.context().attribute(
            cudarc::driver::sys::CUdevice_attribute::CU_DEVICE_ATTRIBUTE_MULTIPROCESSOR_COUNT,
        )?;
        Ok(Self {
            pack: weights.load_function("pack_weights")?,
            forward: with_shared(forward, "mlp_forward", shared)?,
            forward_streamed: with_shared(forward, "mlp_forward_streamed", stream_shared)?,
            backward: with_shared(backward, "mlp_backward", shared)?,
            backward_streamed: with_shared(backward, "mlp_backward_streamed", stream_shared)?,
            edges_backward: if precision == Precision::Bf16 && hopper {
                Some(with_shared(edges, "edges_backward", EDGES_SHARED)?)
            } else {
                None
            },
            product: with_shared(gradient, "weight_gradient", product_shared)?,
            product_shared,
            receive: segment.load_function("receive")?,
            collect: segment.load_function("collect")?,
            same: segment.load_function("same_edges")?,
            reduce: optimiser.load_function("reduce_gradient")?,
            loss: optimiser.load_function("loss_gradient")?,
            adam: optimiser.load_function("adam")?,
            processors: processors as u32,
            device: device.clone(),
            precision,
            profile: Profile::default(),
            shared,
            stream_shared,
            early: device.context().compute_capability()?.0 >= 9,
            first: AtomicBool::new(true),
            keep: AtomicBool::new(true),
        })
    }

    pub fn pack(
        &self,
        packs: Address,
        count: usize,
        parameters: Address,
        packed: Address,
    ) -> Result<(), CudaError> {
        let arguments = arguments![packs, parameters, packed];
        let config = config([count as u32, 4], 512, 0);
        // SAFETY: the addresses are those of `count` packs, of the weights and of the room that
        // the packs were laid out for.
        unsafe { self.launch("pack", &self.pack, arguments, config, false) }
    }

    /// Begins a pass through the network: its first kernel waits for all that was queued before.
    /// `keep`: with all that gradients need, if there is room for it.
    pub fn begin(&self, keep: bool) {
        self.first.store(true, Ordering::Relaxed);
        self.keep.store(keep, Ordering::Relaxed);
    }

    /// Launches a kernel. `early`: it waits itself for the one before (`wait_for_kernel_before` of
    /// ptx.cuh), and until then reads only what does not change during a pass (weights, numbers of
    /// rows), so that it can begin while that one ends.
    ///
    /// # Safety
    /// As for any kernel, and `arguments` are pointers to what it takes.
    unsafe fn launch<const N: usize>(
        &self,
        name: &'static str,
        kernel: &CudaFunction,
        arguments: [*mut c_void; N],
        config: LaunchConfig,
        early: bool,
    ) -> Result<(), CudaError> {
        // SAFETY: the caller's.
        unsafe { self.launch_on(self.device.stream(), name, kernel, arguments, config, early) }
    }

    /// The same on any stream.
    ///
    /// # Safety
    /// As [`launch`](Self::launch).
    unsafe fn launch_on<const N: usize>(
        &self,
        stream: &Arc<CudaStream>,
        name: &'static str,
        kernel: &CudaFunction,
        mut arguments: [*mut c_void; N],
        config: LaunchConfig,
        early: bool,
    ) -> Result<(), CudaError> {
        let early = self.early && early && !self.first.swap(false, Ordering::Relaxed);
        let mut attribute = CUlaunchAttribute {
            id: CUlaunchAttributeID::CU_LAUNCH_ATTRIBUTE_PROGRAMMATIC_STREAM_SERIALIZATION,
            pad: [0; 4],
            value: CUlaunchAttributeValue { programmaticStreamSerializationAllowed: 1 },
        };
        let launch = CUlaunchConfig {
            gridDimX: config.grid_dim.0,
            gridDimY: config.grid_dim.1,
            gridDimZ: config.grid_dim.2,
            blockDimX: config.block_dim.0,
            blockDimY: config.block_dim.1,
            blockDimZ: config.block_dim.2,
            sharedMemBytes: config.shared_mem_bytes,
            hStream: stream.cu_stream(),
            attrs: &raw mut attribute,
            numAttrs: u32::from(early),
        };
        self.profile.around(name, stream, || {
            // SAFETY: the caller's; the pointers are to what is alive here.
            unsafe {
                let (kernel, none) = (kernel.cu_function(), std::ptr::null_mut());
                cuLaunchKernelEx(&raw const launch, kernel, arguments.as_mut_ptr(), none)
            }
            .result()?;
            Ok(())
        })
    }

    /// Blocks of an MLP launch on at most `rows` rows, if so many MLPs are computed together. A
    /// multiprocessor has four tensor cores, so four warps of 16 rows take no longer than one, and
    /// fewer blocks fetch fewer weights.
    pub fn blocks(&self, rows: usize, together: usize) -> usize {
        (self.processors as usize / together).min(rows.div_ceil(64)).max(1)
    }

    /// Shared memory for `units` (in words of 16 bytes) of weights and `vectors` of 128 f32, if there
    /// is so much.
    fn fit(&self, units: i32, vectors: usize) -> Option<usize> {
        let bytes = vectors * WIDTH * 4 + 16 * units as usize;
        (bytes <= self.shared).then_some(bytes)
    }

    /// MLPs side by side, with the same sizes of weights.
    pub fn forward(&self, items: &[Forward], rows: Rows) -> Result<(), CudaError> {
        let name = if rows.edges { "forward, edges" } else { "forward, nodes" };
        let fit = items.iter().map(|item| self.fit(item.units, item.layers as usize + 5));
        let fit = fit.collect::<Option<Vec<_>>>().and_then(|bytes| bytes.into_iter().max());
        for part in items.chunks(FORWARD_BATCH) {
            let mut batch = ForwardBatch::default();
            for (to, from) in batch.0.iter_mut().zip(part) {
                *to = *from;
                if !self.keep.load(Ordering::Relaxed) {
                    (to.hidden, to.deviation) = (0, 0);
                }
            }
            // Of the multiprocessors, each MLP has its share.
            let blocks = self.blocks(rows.most, part.len());
            let (kernel, config) = match fit {
                Some(shared) => {
                    let grid = [blocks as u32, part.len() as u32];
                    (&self.forward, config(grid, self.precision.threads(), shared))
                }
                None => (&self.forward_streamed, self.streamed(rows.most, blocks, part.len())),
            };
            // SAFETY: the addresses in the items are those of live buffers for `rows` rows.
            unsafe { self.launch(name, kernel, arguments![batch], config, true)? };
        }
        Ok(())
    }

    /// Blocks through which weights pass, with as many teams as have rows.
    fn streamed(&self, rows: usize, blocks: usize, together: usize) -> LaunchConfig {
        let teams = rows.div_ceil(64).div_ceil(blocks).max(1) as u32;
        let threads = (teams * TEAM_THREADS).min(STREAM_THREADS);
        config([blocks as u32, together as u32], threads, self.stream_shared)
    }

    /// MLPs of edges side by side, with the same sizes of weights and `blocks` that share the rows.
    pub fn backward_edges(&self, items: &[Backward], rows: Rows) -> Result<(), CudaError> {
        let fit = items.iter().map(|item| self.fit(item.units, 1));
        let fit = fit.collect::<Option<Vec<_>>>().and_then(|bytes| bytes.into_iter().max());
        let threads = self.precision.threads();
        // Sums of LayerNorm's parameters, 256 of each warp.
        let sums = threads as usize / 32 * 256 * 4;
        for part in items.chunks(BACKWARD_BATCH) {
            let grid = [part[0].blocks as u32, part.len() as u32];
            let (kernel, config) = match (&self.edges_backward, fit) {
                (Some(kernel), _) => (kernel, config(grid, EDGES_THREADS, EDGES_SHARED)),
                (None, Some(shared)) => (&self.backward, config(grid, threads, shared.max(sums))),
                (None, None) => {
                    let config = self.streamed(rows.most, part[0].blocks as usize, part.len());
                    (&self.backward_streamed, config)
                }
            };
            // Early, it takes longer by more than its beginning.
            // SAFETY: the addresses in the items are those of live buffers for their rows.
            unsafe { self.launch_backward("backward, edges", kernel, part, config, false)? };
        }
        Ok(())
    }

    /// MLPs of nodes side by side, whose rows `blocks` share.
    pub fn backward_nodes(&self, items: &[Backward], rows: Rows) -> Result<(), CudaError> {
        for part in items.chunks(BACKWARD_BATCH) {
            let config = self.streamed(rows.most, part[0].blocks as usize, part.len());
            let kernel = &self.backward_streamed;
            // SAFETY: as above.
            unsafe { self.launch_backward("backward, nodes", kernel, part, config, true)? };
        }
        Ok(())
    }

    /// As many MLPs as one launch takes.
    ///
    /// # Safety
    /// The addresses in the items are those of live buffers for their rows.
    unsafe fn launch_backward(
        &self,
        name: &'static str,
        kernel: &CudaFunction,
        items: &[Backward],
        config: LaunchConfig,
        early: bool,
    ) -> Result<(), CudaError> {
        let mut batch = BackwardBatch::default();
        batch.0[..items.len()].copy_from_slice(items);
        // SAFETY: the caller's.
        unsafe { self.launch(name, kernel, arguments![batch], config, early) }
    }

    /// Whether the backward pass of edges gives the gradients of the weights on its way.
    pub fn fused(&self) -> bool {
        self.edges_backward.is_some()
    }

    pub fn products(
        &self,
        products: Address,
        count: usize,
        blocks: usize,
    ) -> Result<(), CudaError> {
        let threads = 256 * self.precision.parts() as u32;
        let config = config([blocks as u32, count as u32], threads, self.product_shared);
        // SAFETY: the addresses in the products are those of live buffers.
        unsafe { self.launch("products", &self.product, arguments![products], config, true) }
    }

    /// Messages of each node's edges, added.
    pub fn receive(&self, items: &[Receive], nodes: Rows) -> Result<(), CudaError> {
        for part in items.chunks(RECEIVE_BATCH) {
            let mut batch = ReceiveBatch::default();
            batch.0[..part.len()].copy_from_slice(part);
            let grid = [(nodes.most as u32).div_ceil(4), part.len() as u32];
            let config = config(grid, 128, 0);
            // SAFETY: live buffers for the graphs' points and edges.
            unsafe { self.launch("receive", &self.receive, arguments![batch], config, true)? };
        }
        Ok(())
    }

    /// An edge quantity, added over each node's outgoing and incoming edges; the sums of runs of the
    /// latter may be there already.
    pub fn collect(
        &self,
        view: &View,
        nodes: Rows,
        [edge, sums]: [Address; 2],
        [sent, received]: [Address; 2],
    ) -> Result<(), CudaError> {
        let config = config([(nodes.most as u32).div_ceil(4), 1], 128, 0);
        let View { start, reverse, nodes, .. } = *view;
        let arguments = arguments![start, reverse, nodes, edge, sums, sent, received];
        // Its blocks would only be in the way if they began before the messages are done with.
        // SAFETY: as above.
        unsafe { self.launch("collect", &self.collect, arguments, config, false) }
    }

    /// For each edge of a graph (its count, senders and receivers), the same one of another (its
    /// starts and senders).
    pub fn same_edges(
        &self,
        graph: [Address; 3],
        other: [Address; 2],
        same: Address,
    ) -> Result<(), CudaError> {
        let ([edges, sender, receiver], [other_start, other_sender]) = (graph, other);
        let arguments = arguments![edges, sender, receiver, other_start, other_sender, same];
        let config = config([4 * self.processors, 1], 256, 0);
        // SAFETY: as above.
        unsafe { self.launch("same_edges", &self.same, arguments, config, true) }
    }

    /// Adds up `count` targets; on a stream of its own if there is one.
    pub fn reduce(
        &self,
        stream: Option<&Arc<CudaStream>>,
        targets: Address,
        count: usize,
        parameters: Address,
        gradient: Address,
    ) -> Result<(), CudaError> {
        let arguments = arguments![targets, parameters, gradient];
        let rows = (WIDTH / REDUCE_ROWS) as u32;
        let config = config([rows, count as u32], (REDUCE_ROWS * WIDTH) as u32, 0);
        let (early, stream) = (stream.is_none(), stream.unwrap_or(self.device.stream()));
        // SAFETY: the addresses in the targets are those of live buffers.
        unsafe { self.launch_on(stream, "reduce", &self.reduce, arguments, config, early) }
    }

    /// Sums of squared errors and of squared targets, each with `floor`² more, over nodes x columns
    /// numbers, and the gradient of the first in rows of 128; `nodes` is their number on the device.
    /// `relative`: the loss instead, its gradient, and 1.
    pub fn loss(
        &self,
        [output, target]: [Address; 2],
        nodes: Address,
        columns: usize,
        [gradient, sums]: [Address; 2],
        floor: f32,
        relative: bool,
    ) -> Result<(), CudaError> {
        let (columns, relative) = (columns as i32, i32::from(relative));
        let arguments = arguments![output, target, nodes, columns, gradient, sums, floor, relative];
        // SAFETY: live buffers of these sizes.
        unsafe { self.launch("loss", &self.loss, arguments, config([1, 1], 1024, 0), true) }
    }

    /// Adam on `count` weights: weights, averages of gradients and of their squares, average of
    /// the weights (or 0), gradient and the sums of the loss behind it, rates. The loss goes into
    /// the ring of `room` losses where the counter says.
    pub fn adam(
        &self,
        lists: [Address; 6],
        count: usize,
        [losses, counter]: [Address; 2],
        room: usize,
    ) -> Result<(), CudaError> {
        let [weights, mean, square, average, gradient, rates] = lists;
        let config = config([(count as u32).div_ceil(256), 1], 256, 0);
        let (count, room) = (count as i32, room as u32);
        let arguments = arguments![
            weights, mean, square, average, gradient, rates, count, losses, counter, room
        ];
        // SAFETY: live buffers of this size.
        unsafe { self.launch("adam", &self.adam, arguments, config, false) }
    }
}

/// Threads of a block of `edges_backward`, and its shared memory: two matrices of 128 rows, eight tiles
/// of 64, all of 256 bytes, and some vectors.
const EDGES_THREADS: u32 = 512;
const EDGES_SHARED: usize = (2 * 128 + 8 * 64) * 256 + (9 << 10);

/// Shared memory of `weight_gradient`: in each stage two tiles of 64 rows of 256 bytes for each part.
fn product_shared(precision: Precision, hopper: bool) -> usize {
    let stages = match (precision, hopper) {
        (Precision::Bf16, _) => 3,
        (Precision::F32, true) => 2,
        (Precision::F32, false) => 1,
    };
    stages * 2 * precision.parts() * 64 * 256
}

fn config(grid: [u32; 2], threads: u32, shared: usize) -> LaunchConfig {
    LaunchConfig {
        grid_dim: (grid[0], grid[1], 1),
        block_dim: (threads, 1, 1),
        shared_mem_bytes: shared as u32,
    }
}
