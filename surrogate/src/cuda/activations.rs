//! Device memory for the states of a batch: what the forward pass computes, and what the backward
//! pass needs of it.

use std::collections::BTreeMap;
use std::sync::Arc;

use cudarc::driver::CudaSlice;
use gpu::{Device, Pointer};

use super::error::CudaError;
use super::layout::{Layout, Mlp};
use super::ops::launcher::Launcher;
use super::ops::tile::{Stored, WIDTH};
use super::support::Capacity;

/// Numbers of a block's sums of the gradients of a LayerNorm's scale and shift.
pub const NORM_SUMS: usize = 2 * WIDTH;
/// Rows of a tile, of which messages are summed before they are summed for each node.
const TILE_ROWS: usize = 16;

/// What an MLP saves for its backward pass, and what that leaves for the gradients of the weights. All
/// null in a network that is not trained, but for what others read.
#[derive(Clone, Copy, Debug, Default)]
pub struct MlpActivations {
    /// Activations of the hidden layers (rows x 128), `stride` numbers apart.
    pub hidden: Pointer<Stored>,
    /// Gradients of the linears' outputs (rows x 128), `stride` numbers apart.
    pub linear_gradients: Pointer<Stored>,
    pub stride: usize,
    /// Output before LayerNorm's scale and shift (rows x 128),
    pub normal: Pointer<Stored>,
    /// and the reciprocal standard deviation (rows).
    pub deviation: Pointer<f32>,
    /// Sums of the gradients of scale and shift, [`NORM_SUMS`] for each of `blocks`.
    pub norm_sums: Pointer<f32>,
    /// Blocks that share the rows in the backward pass.
    pub blocks: usize,
    /// The number of the first of them among the blocks of all applications of the MLP.
    first_block: usize,
}

/// The states of one frame. Rows are nodes or edges, of 128 columns.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameActivations {
    /// The encoded nodes,
    pub node: Pointer<Stored>,
    /// and these joined with the node states of the frame before.
    pub fused: Pointer<Stored>,
    /// The encoded edges; null if readers apply LayerNorm's scale and shift themselves.
    pub edge: Pointer<Stored>,
    pub node_encoder: MlpActivations,
    pub edge_encoder: MlpActivations,
    pub node_fusion: MlpActivations,
    pub edge_fusion: MlpActivations,
    /// Index of each edge in the frame before, and of that frame's edges in this one.
    pub previous: Pointer<u32>,
    pub next: Pointer<u32>,
    /// Gradients of the encoded nodes and edges.
    pub node_gradient: Pointer<f32>,
    pub edge_gradient: Pointer<Stored>,
}

/// The states of one message-passing layer. Rows are nodes or edges, of 128 columns.
#[derive(Clone, Copy, Debug, Default)]
pub struct LayerActivations {
    pub message: MlpActivations,
    pub update: MlpActivations,
    /// First linear of the message: the parts of sender and receiver,
    pub sender: Pointer<Stored>,
    pub receiver: Pointer<Stored>,
    /// and their gradients.
    pub sender_gradient: Pointer<Stored>,
    pub receiver_gradient: Pointer<Stored>,
    /// The messages before LayerNorm's scale and shift, summed for each node and tile of 16 edges,
    pub sums: Pointer<f32>,
    /// and the sum of a node's messages.
    pub received: Pointer<Stored>,
    /// Node states after the layer,
    pub node: Pointer<Stored>,
    /// and edge states; null if readers apply LayerNorm's scale and shift themselves.
    pub edge: Pointer<Stored>,
}

/// Gradients that the backward pass hands from layer to layer (rows x 128).
#[derive(Clone, Copy, Debug, Default)]
pub struct StateGradients {
    /// Of the network's output.
    pub output: Pointer<f32>,
    /// Of node states: a layer reads one and writes the other.
    pub node: [Pointer<f32>; 2],
    /// Of the sums of messages.
    pub received: Pointer<f32>,
    /// Of edge states: a layer reads one and writes the other.
    pub edge: [Pointer<Stored>; 2],
}

impl StateGradients {
    /// The buffer of edges' gradients that is not this one.
    pub fn other_edge(&self, edge: Pointer<Stored>) -> Pointer<Stored> {
        self.edge[usize::from(edge == self.edge[0])]
    }
}

/// Sums of the gradients of a LayerNorm's scale and shift, [`NORM_SUMS`] for each block of each
/// application.
#[derive(Clone, Copy, Debug, Default)]
pub struct NormSums {
    pub sums: Pointer<f32>,
    pub blocks: usize,
}

/// All device memory that depends on the size of a batch.
#[derive(Debug)]
pub struct Activations {
    pub capacity: Capacity,
    /// The frames of a window, the oldest first.
    pub frames: Vec<FrameActivations>,
    pub layers: Vec<LayerActivations>,
    pub decoder: MlpActivations,
    /// In training, the sums of the gradients of each MLP with LayerNorm.
    pub norm_sums: BTreeMap<usize, NormSums>,
    /// Of a network in training.
    pub gradients: Option<StateGradients>,
    memory: Memory,
}

impl Activations {
    /// Allocates memory for batches of at most this size. `training`: for the backward pass too.
    pub fn new(
        layout: &Layout,
        launcher: &Launcher,
        capacity: Capacity,
        training: bool,
    ) -> Result<Self, CudaError> {
        let capacity = Capacity { points: capacity.points.max(1), edges: capacity.edges.max(1) };
        let memory = Memory { device: launcher.device.clone(), slices: Vec::new() };
        let norm_blocks = BTreeMap::new();
        let mut allocator = Allocator { layout, launcher, capacity, training, norm_blocks, memory };
        let mut frames = allocator.frames()?;
        let mut layers = allocator.layers()?;
        let decoder = allocator.mlp(layout.decoder, capacity.points, 1)?;
        let norm_sums = allocator.norm_sums(&mut frames, &mut layers)?;
        let gradients = if training { Some(allocator.gradients()?) } else { None };
        let memory = allocator.memory;
        Ok(Self { capacity, frames, layers, decoder, norm_sums, gradients, memory })
    }

    /// Frees the memory.
    pub fn clear(&mut self) {
        self.memory.slices.clear();
    }
}

/// Owns the memory that all pointers are to.
#[derive(Debug)]
struct Memory {
    device: Arc<Device>,
    slices: Vec<CudaSlice<u8>>,
}

impl Memory {
    fn allocate<T>(&mut self, bytes: usize) -> Result<Pointer<T>, CudaError> {
        let slice = self.device.zeros::<u8>(bytes)?;
        let pointer = Pointer::to(&slice, self.device.stream()).cast();
        self.slices.push(slice);
        Ok(pointer)
    }
}

struct Allocator<'a> {
    layout: &'a Layout,
    launcher: &'a Launcher,
    capacity: Capacity,
    training: bool,
    /// Blocks of all applications so far of an MLP with LayerNorm.
    norm_blocks: BTreeMap<usize, usize>,
    memory: Memory,
}

impl Allocator<'_> {
    /// Stored states.
    fn states(&mut self, rows: usize) -> Result<Pointer<Stored>, CudaError> {
        self.memory.allocate(rows * WIDTH * self.launcher.precision.stored_bytes())
    }

    /// States in float32.
    fn states32(&mut self, rows: usize) -> Result<Pointer<f32>, CudaError> {
        self.numbers(rows * WIDTH)
    }

    /// Numbers of four bytes.
    fn numbers<T>(&mut self, count: usize) -> Result<Pointer<T>, CudaError> {
        self.memory.allocate(count * size_of::<T>())
    }

    /// For one application of an MLP. `together`: applications that share a launch of the backward
    /// pass.
    fn mlp(
        &mut self,
        mlp: usize,
        rows: usize,
        together: usize,
    ) -> Result<MlpActivations, CudaError> {
        if !self.training {
            return Ok(MlpActivations::default());
        }
        let Mlp { layers, norm, .. } = self.layout.mlps[mlp];
        let mut saved = MlpActivations {
            hidden: self.states(layers * rows)?,
            linear_gradients: self.states((layers + 1) * rows)?,
            stride: rows * WIDTH,
            blocks: self.launcher.blocks(rows, together),
            ..MlpActivations::default()
        };
        if norm {
            saved.normal = self.states(rows)?;
            saved.deviation = self.numbers(rows)?;
            let blocks = self.norm_blocks.entry(mlp).or_default();
            saved.first_block = *blocks;
            *blocks += saved.blocks;
        }
        Ok(saved)
    }

    /// For the sums of LayerNorms' gradients, next to each other for each MLP.
    fn norm_sums(
        &mut self,
        frames: &mut [FrameActivations],
        layers: &mut [LayerActivations],
    ) -> Result<BTreeMap<usize, NormSums>, CudaError> {
        let mut all = BTreeMap::new();
        for (mlp, blocks) in self.norm_blocks.clone() {
            let sums = self.numbers(NORM_SUMS * blocks)?;
            all.insert(mlp, NormSums { sums, blocks });
        }
        let assign = |mlp: usize, saved: &mut MlpActivations| {
            if let Some(all) = all.get(&mlp) {
                saved.norm_sums = all.sums.offset(NORM_SUMS * saved.first_block);
            }
        };
        let layout = self.layout;
        for (k, frame) in frames.iter_mut().enumerate() {
            let (node, edge) = layout.encoders(k);
            assign(node, &mut frame.node_encoder);
            assign(edge, &mut frame.edge_encoder);
            if k > 0 {
                assign(layout.node_fusion, &mut frame.node_fusion);
                if let Some(fusion) = layout.edge_fusion {
                    assign(fusion, &mut frame.edge_fusion);
                }
            }
        }
        for (layer, mlps) in layers.iter_mut().zip(&layout.layers) {
            assign(mlps.message, &mut layer.message);
            assign(mlps.update, &mut layer.update);
        }
        Ok(all)
    }

    fn frames(&mut self) -> Result<Vec<FrameActivations>, CudaError> {
        let (layout, Capacity { points, edges }) = (self.layout, self.capacity);
        let mut frames = Vec::<FrameActivations>::new();
        for k in 0..layout.frames {
            let (node, edge) = layout.encoders(k);
            let fusion = layout.edge_fusion.filter(|_| k > 0);
            // Without training later frames share what does not depend on their place in the window;
            // `edgemsg` writes joined states over the encoded ones.
            let shared = if self.training { None } else { frames.get(1).copied() };
            let encoded = shared.filter(|_| fusion.is_none());
            let mut frame = FrameActivations {
                node: match encoded {
                    Some(encoded) => encoded.node,
                    None => self.states(points)?,
                },
                node_encoder: self.mlp(node, points, layout.frames)?,
                edge_encoder: self.mlp(edge, edges, layout.frames)?,
                ..FrameActivations::default()
            };
            if self.training {
                frame.node_gradient = self.states32(points)?;
                frame.edge_gradient = self.states(edges)?;
            }
            if k > 0 {
                frame.fused = self.states(points)?;
                frame.node_fusion = self.mlp(layout.node_fusion, points, 1)?;
            }
            if let Some(fusion) = fusion {
                frame.edge_fusion = self.mlp(fusion, edges, 1)?;
                frame.previous = match shared {
                    Some(shared) => shared.previous,
                    None => self.numbers(edges)?,
                };
                if self.training {
                    frame.next = self.numbers(edges)?;
                }
            }
            if let Some(encoded) = encoded {
                frame.edge = encoded.edge;
            } else if layout.residual || fusion.is_some() || !self.training {
                frame.edge = self.states(edges)?;
            }
            frames.push(frame);
        }
        Ok(frames)
    }

    fn layers(&mut self) -> Result<Vec<LayerActivations>, CudaError> {
        let (layout, Capacity { points, edges }) = (self.layout, self.capacity);
        let mut layers = Vec::<LayerActivations>::new();
        for (k, mlps) in layout.layers.iter().enumerate() {
            let mut layer = LayerActivations {
                message: self.mlp(mlps.message, edges, 1)?,
                update: self.mlp(mlps.update, points, 1)?,
                sender: self.states(points)?,
                receiver: self.states(points)?,
                // A sum for each tile, and one more for each node that begins in the middle of one.
                sums: self.states32(edges.div_ceil(TILE_ROWS) + points)?,
                received: self.states(points)?,
                node: self.states(points)?,
                ..LayerActivations::default()
            };
            if self.training {
                layer.sender_gradient = self.states(points)?;
                layer.receiver_gradient = self.states(points)?;
            }
            // `edgemsg` reads the messages of several layers with one MLP, so that scale and shift
            // cannot be left to the reader.
            if k + 1 < layout.layers.len() && layout.reads_messages(k + 1) {
                if layout.residual || layout.edge_fusion.is_some() {
                    layer.edge = self.states(edges)?;
                } else if !self.training {
                    layer.message.normal = self.states(edges)?;
                }
            }
            layers.push(layer);
        }
        Ok(layers)
    }

    fn gradients(&mut self) -> Result<StateGradients, CudaError> {
        let Capacity { points, edges } = self.capacity;
        Ok(StateGradients {
            output: self.states32(points)?,
            node: [self.states32(points)?, self.states32(points)?],
            received: self.states32(points)?,
            edge: [self.states(edges)?, self.states(edges)?],
        })
    }
}
