//! Device memory for the states of a batch.

use std::collections::BTreeMap;
use std::sync::Arc;

use cudarc::driver::{CudaSlice, DevicePtr};
use gpu::Device;

use super::arguments::Address;
use super::error::CudaError;
use super::kernels::{Kernels, WIDTH};
use super::layout::{Layout, Mlp};
use super::network::Capacity;

/// What an MLP keeps for its gradient; of a network that is not trained, only what others read.
#[derive(Clone, Copy, Debug, Default)]
pub struct Saved {
    /// Activations of the hidden layers, `stride` numbers apart.
    pub hidden: Address,
    /// Gradients of the linears' outputs, `stride` numbers apart.
    pub linear: Address,
    pub stride: u64,
    /// Output before LayerNorm's scale and shift, and the reciprocal standard deviation.
    pub normal: Address,
    pub deviation: Address,
    /// Sums of the gradients of scale and shift, 256 for each of the blocks that share the rows in
    /// the backward pass.
    pub norm_sums: Address,
    pub blocks: usize,
}

/// The states of one frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameRoom {
    /// The encoded nodes, and them joined with the previous frame's state.
    pub node: Address,
    pub fused: Address,
    /// The encoded edges, if not left to be scaled and shifted by who reads them.
    pub edge: Address,
    pub node_encoder: Saved,
    pub edge_encoder: Saved,
    pub node_fusion: Saved,
    pub edge_fusion: Saved,
    /// Index of each edge in the previous frame, and of the previous frame's edges in this one.
    pub previous: Address,
    pub next: Address,
    /// Gradients of the encoded nodes and edges.
    pub node_gradient: Address,
    pub edge_gradient: Address,
}

/// The states of one message-passing layer.
#[derive(Clone, Copy, Debug, Default)]
pub struct LayerRoom {
    pub message: Saved,
    pub update: Saved,
    /// First linear of the message: the parts of sender and receiver; their gradients.
    pub sender: Address,
    pub receiver: Address,
    pub sender_gradient: Address,
    pub receiver_gradient: Address,
    /// The messages before LayerNorm's scale and shift, added up for each node and tile of 16 edges,
    /// and the sum of messages.
    pub sums: Address,
    pub received: Address,
    /// Node states, and edge states if not left to be scaled and shifted by who reads them.
    pub node: Address,
    pub edge: Address,
}

/// Gradients that are passed on from layer to layer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Passed {
    pub output: Address,
    pub node: [Address; 2],
    pub received: Address,
    pub edge: [Address; 2],
}

impl Passed {
    /// The buffer of edges' gradients that is not this one.
    pub fn other_edge(&self, edge: Address) -> Address {
        self.edge[usize::from(edge == self.edge[0])]
    }
}

/// Sums of the gradients of a LayerNorm's scale and shift, 256 for each block of each application.
#[derive(Clone, Copy, Debug, Default)]
pub struct NormSums {
    pub at: Address,
    pub blocks: usize,
}

/// All device memory that depends on the size of a batch.
#[derive(Debug)]
pub struct Room {
    pub capacity: Capacity,
    pub frames: Vec<FrameRoom>,
    pub layers: Vec<LayerRoom>,
    pub decoder: Saved,
    /// Of each MLP with LayerNorm in training, the sums of its parameters' gradients.
    pub norm_sums: BTreeMap<usize, NormSums>,
    /// Of a network in training.
    pub training: Option<Passed>,
    memory: Memory,
}

impl Room {
    pub fn new(
        device: &Arc<Device>,
        layout: &Layout,
        kernels: &Kernels,
        capacity: Capacity,
        training: bool,
    ) -> Result<Self, CudaError> {
        let capacity = Capacity { points: capacity.points.max(1), edges: capacity.edges.max(1) };
        let bytes = kernels.precision.bytes();
        let memory = Memory { device: device.clone(), slices: Vec::new() };
        let norms = BTreeMap::new();
        let mut maker = Maker { layout, kernels, capacity, bytes, training, norms, memory };
        let mut frames = maker.frames()?;
        let mut layers = maker.layers()?;
        let decoder = maker.saved(layout.decoder, capacity.points, 1)?;
        let norm_sums = maker.norm_sums(&mut frames, &mut layers)?;
        let training = if training { Some(maker.passed()?) } else { None };
        Ok(Self { capacity, frames, layers, decoder, norm_sums, training, memory: maker.memory })
    }

    /// Frees the memory.
    pub fn clear(&mut self) {
        self.memory.slices.clear();
    }
}

#[derive(Debug)]
struct Memory {
    device: Arc<Device>,
    slices: Vec<CudaSlice<u8>>,
}

impl Memory {
    fn take(&mut self, bytes: usize) -> Result<Address, CudaError> {
        let slice = self.device.zeros::<u8>(bytes)?;
        let address = slice.device_ptr(self.device.stream()).0;
        self.slices.push(slice);
        Ok(address)
    }
}

struct Maker<'a> {
    layout: &'a Layout,
    kernels: &'a Kernels,
    capacity: Capacity,
    bytes: usize,
    training: bool,
    /// Blocks of all applications so far of an MLP with LayerNorm.
    norms: BTreeMap<usize, usize>,
    memory: Memory,
}

impl Maker<'_> {
    /// Stored states.
    fn states(&mut self, rows: usize) -> Result<Address, CudaError> {
        self.memory.take(rows * WIDTH * self.bytes)
    }

    /// States in float32.
    fn states32(&mut self, rows: usize) -> Result<Address, CudaError> {
        self.memory.take(4 * rows * WIDTH)
    }

    /// `together`: applications that share a launch of the backward pass.
    fn saved(&mut self, mlp: usize, rows: usize, together: usize) -> Result<Saved, CudaError> {
        if !self.training {
            return Ok(Saved::default());
        }
        let Mlp { layers, norm, .. } = self.layout.mlps[mlp];
        let mut saved = Saved {
            hidden: self.states(layers * rows)?,
            linear: self.states((layers + 1) * rows)?,
            stride: (rows * WIDTH) as u64,
            blocks: self.kernels.blocks(rows, together),
            ..Saved::default()
        };
        if norm {
            saved.normal = self.states(rows)?;
            saved.deviation = self.memory.take(4 * rows)?;
            // For now, the place among the sums of the same MLP.
            let blocks = self.norms.entry(mlp).or_default();
            saved.norm_sums = 1024 * *blocks as u64;
            *blocks += saved.blocks;
        }
        Ok(saved)
    }

    /// Makes room for the sums of LayerNorms' gradients, next to each other for each MLP.
    fn norm_sums(
        &mut self,
        frames: &mut [FrameRoom],
        layers: &mut [LayerRoom],
    ) -> Result<BTreeMap<usize, NormSums>, CudaError> {
        let mut all = BTreeMap::new();
        for (&mlp, &blocks) in &self.norms {
            all.insert(mlp, NormSums { at: self.memory.take(1024 * blocks)?, blocks });
        }
        let place = |mlp: usize, saved: &mut Saved| {
            if let Some(sums) = all.get(&mlp) {
                saved.norm_sums += sums.at;
            }
        };
        let layout = self.layout;
        for (k, frame) in frames.iter_mut().enumerate() {
            let (node, edge) = match k {
                0 => (layout.node_first, layout.edge_first),
                _ => (layout.node_later, layout.edge_later),
            };
            place(node, &mut frame.node_encoder);
            place(edge, &mut frame.edge_encoder);
            if k > 0 {
                place(layout.node_fusion, &mut frame.node_fusion);
                if let Some(fusion) = layout.edge_fusion {
                    place(fusion, &mut frame.edge_fusion);
                }
            }
        }
        for (layer, mlps) in layers.iter_mut().zip(&layout.layers) {
            place(mlps.message, &mut layer.message);
            place(mlps.update, &mut layer.update);
        }
        Ok(all)
    }

    fn frames(&mut self) -> Result<Vec<FrameRoom>, CudaError> {
        let (layout, Capacity { points, edges }) = (self.layout, self.capacity);
        let mut frames = Vec::<FrameRoom>::new();
        for k in 0..layout.frames {
            let (node, edge) = match k {
                0 => (layout.node_first, layout.edge_first),
                _ => (layout.node_later, layout.edge_later),
            };
            let fusion = layout.edge_fusion.filter(|_| k > 0);
            // Without training later frames share what does not depend on their place in the window;
            // `edgemsg` writes joined states over the encoded ones.
            let shared = if self.training { None } else { frames.get(1).copied() };
            let encoded = shared.filter(|_| fusion.is_none());
            let mut frame = FrameRoom {
                node: match encoded {
                    Some(encoded) => encoded.node,
                    None => self.states(points)?,
                },
                node_encoder: self.saved(node, points, layout.frames)?,
                edge_encoder: self.saved(edge, edges, layout.frames)?,
                ..FrameRoom::default()
            };
            if self.training {
                frame.node_gradient = self.states32(points)?;
                frame.edge_gradient = self.states(edges)?;
            }
            if k > 0 {
                frame.fused = self.states(points)?;
                frame.node_fusion = self.saved(layout.node_fusion, points, 1)?;
            }
            if let Some(fusion) = fusion {
                frame.edge_fusion = self.saved(fusion, edges, 1)?;
                frame.previous = match shared {
                    Some(shared) => shared.previous,
                    None => self.memory.take(4 * edges)?,
                };
                if self.training {
                    frame.next = self.memory.take(4 * edges)?;
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

    fn layers(&mut self) -> Result<Vec<LayerRoom>, CudaError> {
        let (layout, Capacity { points, edges }) = (self.layout, self.capacity);
        let mut layers = Vec::<LayerRoom>::new();
        for (k, l) in layout.layers.iter().enumerate() {
            let mut layer = LayerRoom {
                message: self.saved(l.message, edges, 1)?,
                update: self.saved(l.update, points, 1)?,
                sender: self.states(points)?,
                receiver: self.states(points)?,
                // A sum for each tile, and one more for each node that begins in the middle of one.
                sums: self.states32(edges.div_ceil(16) + points)?,
                received: self.states(points)?,
                node: self.states(points)?,
                ..LayerRoom::default()
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

    fn passed(&mut self) -> Result<Passed, CudaError> {
        let Capacity { points, edges } = self.capacity;
        Ok(Passed {
            output: self.states32(points)?,
            node: [self.states32(points)?, self.states32(points)?],
            received: self.states32(points)?,
            edge: [self.states(edges)?, self.states(edges)?],
        })
    }
}
