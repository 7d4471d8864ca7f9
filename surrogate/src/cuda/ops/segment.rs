//! Sums over the edges of each node, and edges that two graphs share.

use std::sync::Arc;

use gpu::{
    ConstPointer, Function, Kernel, Launch, Pointer, Source, checks, cuda_struct, definitions,
    files, kernel,
};

use super::geometry::{WARP, blocks};
use super::launcher::{Launcher, Rows};
use super::tile::{Stored, network_source};
use crate::cuda::error::CudaError;
use crate::network::Precision;

/// Most sums of a launch.
const RECEIVE_BATCH: usize = 8;

cuda_struct! {
    /// Messages to add up for each node.
    #[derive(Default)]
    pub(in crate::cuda) struct Receive {
        /// Number of nodes.
        pub nodes: ConstPointer<u32>,
        /// First edge of each node (nodes + 1).
        pub start: ConstPointer<u32>,
        /// Sums of the messages x over runs of edges (`Forward::sums`).
        pub sums: ConstPointer<f32>,
        /// All weights of the network.
        pub parameters: ConstPointer<f32>,
        /// For each node the sum of scale x + shift (nodes x 128).
        pub received: Pointer<Stored>,
        /// Offset in `parameters` of LayerNorm's scale, which its shift follows.
        pub norm: i32,
        /// Columns of states that are not padding.
        pub width: i32,
    }

    /// Sums of a launch.
    #[derive(Default)]
    struct ReceiveBatch {
        item: [Receive; RECEIVE_BATCH],
    }
}

kernel! {
    /// Messages to add up.
    struct ReceiveMessages: receive {
        batch: ReceiveBatch,
    }

    /// An edge quantity to add up for each node.
    pub(in crate::cuda) struct Collect: collect {
        /// First edge of each node (nodes + 1), reverse of each edge, number of nodes.
        pub start: ConstPointer<u32>,
        pub reverse: ConstPointer<u32>,
        pub count: ConstPointer<u32>,
        /// The quantity (edges x 128),
        pub x: ConstPointer<Stored>,
        /// and its sums over runs of edges with the same receiver, if not null.
        pub sums: ConstPointer<f32>,
        /// Sums over the edges that a node sends and receives (nodes x 128).
        pub sent: Pointer<Stored>,
        pub received: Pointer<Stored>,
    }

    /// The edges of a graph that another graph shares.
    pub(in crate::cuda) struct SameEdges: same_edges {
        /// Number of edges, and sender and receiver of each.
        pub edges: ConstPointer<u32>,
        pub sender: ConstPointer<u32>,
        pub receiver: ConstPointer<u32>,
        /// First edge of each node of the other graph (nodes + 1), and sender of each edge.
        pub other_start: ConstPointer<u32>,
        pub other_sender: ConstPointer<u32>,
        /// Index of each edge in the other graph, or `NONE`.
        pub same: Pointer<u32>,
    }
}

/// The source of the kernels.
pub(super) fn source(precision: Precision, shared: usize) -> Source {
    let definitions = definitions![Receive, ReceiveBatch];
    let checks = checks![ReceiveMessages, Collect, SameEdges];
    let text = [&definitions, files!["segment.cu"], &checks].concat();
    network_source("segment.cu", &text, precision, shared)
}

/// Threads of a block: one warp a node.
const NODE_THREADS: u32 = 128;
/// Blocks of `same_edges` for each multiprocessor, and their threads.
const SAME_BLOCKS: usize = 4;
const SAME_THREADS: u32 = 256;

/// Adds up edges.
#[derive(Debug)]
pub(in crate::cuda) struct Segment {
    launcher: Arc<Launcher>,
    receive: Function<ReceiveMessages>,
    collect: Function<Collect>,
    same_edges: Function<SameEdges>,
}

impl Segment {
    pub fn load(launcher: &Arc<Launcher>) -> Result<Self, CudaError> {
        let module = launcher.load(&source(launcher.precision, launcher.shared))?;
        Ok(Self {
            receive: launcher.kernel(&module)?,
            collect: launcher.kernel(&module)?,
            same_edges: launcher.kernel(&module)?,
            launcher: launcher.clone(),
        })
    }

    /// A warp for each of at most so many nodes.
    fn warp_each(nodes: Rows, together: usize) -> Launch {
        let warps = (NODE_THREADS / WARP) as usize;
        blocks([nodes.max.div_ceil(warps), together], NODE_THREADS)
    }

    /// For each node the sum of its edges' messages.
    pub fn receive(&self, items: &[Receive], nodes: Rows) -> Result<(), CudaError> {
        for part in items.chunks(RECEIVE_BATCH) {
            let mut batch = ReceiveBatch::default();
            batch.item[..part.len()].copy_from_slice(part);
            let launch = Self::warp_each(nodes, part.len()).early(true);
            let (name, kernel) = (ReceiveMessages::NAME, &self.receive);
            let arguments = ReceiveMessages { batch };
            // SAFETY: the pointers of the items are to live buffers for the graphs' nodes and edges.
            unsafe { self.launcher.launch(name, kernel, launch, &arguments)? };
        }
        Ok(())
    }

    /// For each node the sums of an edge quantity over the edges that it sends and receives.
    pub fn collect(&self, arguments: &Collect, nodes: Rows) -> Result<(), CudaError> {
        // No PDL: blocks that begin early would only be in the way.
        let launch = Self::warp_each(nodes, 1);
        // SAFETY: as above.
        unsafe { self.launcher.launch(Collect::NAME, &self.collect, launch, arguments) }
    }

    /// For each edge of a graph the same edge of another one.
    pub fn same_edges(&self, arguments: &SameEdges) -> Result<(), CudaError> {
        let count = SAME_BLOCKS * self.launcher.multiprocessors;
        let launch = blocks([count, 1], SAME_THREADS).early(true);
        // SAFETY: as above.
        unsafe { self.launcher.launch(SameEdges::NAME, &self.same_edges, launch, arguments) }
    }
}
