//! The gradient of the weights: products of the linears' inputs with the gradients of their
//! outputs, in shares that are added up in a fixed order.

use std::collections::BTreeMap;
use std::sync::Arc;

use cudarc::driver::{CudaEvent, CudaSlice, CudaStream, DevicePtr};
use gpu::Device;

use super::arguments::{Address, Product, Target};
use super::error::CudaError;
use super::forward::EdgeState;
use super::kernels::WIDTH;
use super::layout::Input;
use super::network::{CudaNetwork, Features, View};
use super::room::Saved;
use super::trainer::SUMS;

/// Blocks that share the rows of a product over edges, and over nodes.
const EDGE_BLOCKS: usize = 44;
const NODE_BLOCKS: usize = 8;

/// Products of one application of an MLP in the list: the first, and their number.
type Range = (usize, usize);

/// Gradients of all weights, and what it takes to compute them.
#[derive(Debug)]
pub struct Products {
    /// In the order of the weights, then the sums of the loss ([`SUMS`]).
    pub gradient: CudaSlice<f32>,
    /// Those that the backward pass of edges leaves to be added up, then the others, and their numbers.
    targets: CudaSlice<Target>,
    counts: [usize; 2],
    weight_sums: CudaSlice<f32>,
    bias_sums: CudaSlice<f32>,
    /// Adds up sums of edges while the nodes' products go on: from one event to the other.
    aside: Arc<CudaStream>,
    ready: CudaEvent,
    done: CudaEvent,
}

/// The products of a step on certain frames.
#[derive(Debug)]
pub struct List {
    /// Over edges, those of an application of an MLP from the last linear to the first; then over
    /// nodes.
    products: CudaSlice<Product>,
    /// How many of them are over edges.
    edges: usize,
    /// Of applications to edges, by the address of the gradients.
    applications: BTreeMap<Address, Range>,
}

/// A product without a place for its sums, and the part of an MLP whose gradient it is: linear
/// and, of the first, input.
struct Part {
    mlp: usize,
    linear: usize,
    input: usize,
    /// LayerNorm whose scale and shift the product leaves out; -1 for none.
    norm: i32,
    /// Of an application of an MLP to edges, the address of the gradients; 0 over nodes.
    application: Address,
    product: Product,
}

impl Products {
    pub fn new(network: &CudaNetwork, device: &Arc<Device>) -> Result<Self, CudaError> {
        let layout = &network.layout;
        let mut parts = network.parts(&[]);
        let blocks = assign(&mut parts, |_, _| (0, 0));
        let weight_sums = device.zeros(blocks.weight * WIDTH * WIDTH)?;
        let bias_sums = device.zeros(blocks.bias * WIDTH)?;
        let mut targets = network.norm_targets();
        let mut weight_from = at(&weight_sums, device);
        let mut bias_from = at(&bias_sums, device);
        for ((mlp, linear, input), count) in &blocks.shares {
            let m = &layout.mlps[*mlp];
            let (rows, row) = match (linear, m.inputs.get(*input)) {
                (0, Some(Input::Features(count))) => (*count, m.first_row(*input)),
                (0, _) => (m.width, m.first_row(*input)),
                _ => (m.width, 0),
            };
            let columns = m.outputs(*linear);
            let mut add = |target| targets.push((count.edges, target));
            add(Target {
                sums: weight_from,
                shift_sums: bias_from,
                count: count.weight as i32,
                size: (WIDTH * WIDTH) as i32,
                rows: rows as i32,
                columns: columns as i32,
                shift_count: count.bias as i32,
                norm: count.norm,
                width: m.width as i32,
                to: (m.weight(*linear) + row * columns) as i32,
                ..Target::default()
            });
            weight_from += (4 * count.weight * WIDTH * WIDTH) as u64;
            if count.bias > 0 {
                add(Target {
                    sums: bias_from,
                    count: count.bias as i32,
                    size: WIDTH as i32,
                    rows: 1,
                    columns: columns as i32,
                    norm: -1,
                    to: m.bias(*linear) as i32,
                    ..Target::default()
                });
                bias_from += (4 * count.bias * WIDTH) as u64;
            }
        }
        // Those of edges first.
        let fused = network.kernels.fused();
        let (edges, nodes): (Vec<_>, Vec<_>) = targets.into_iter().partition(|t| fused && t.0);
        let counts = [edges.len(), nodes.len()];
        let targets: Vec<Target> = edges.into_iter().chain(nodes).map(|t| t.1).collect();
        Ok(Self {
            gradient: device.zeros(layout.parameters + SUMS)?,
            targets: device.upload(&targets)?,
            counts,
            aside: device.context().new_stream()?,
            ready: device.context().new_event(None)?,
            done: device.context().new_event(None)?,
            weight_sums,
            bias_sums,
        })
    }

    /// Makes the list of products for frames.
    pub fn list(&self, network: &CudaNetwork, views: &[View]) -> Result<List, CudaError> {
        let device = &network.kernels.device;
        let (weights, biases) = (at(&self.weight_sums, device), at(&self.bias_sums, device));
        let mut parts = network.parts(views);
        assign(&mut parts, |weight, bias| {
            (weights + (4 * weight * WIDTH * WIDTH) as u64, biases + (4 * bias * WIDTH) as u64)
        });
        // The long ones first, which stay in order.
        parts.sort_by_key(|part| part.application == 0);
        let edges = parts.iter().take_while(|part| part.application != 0).count();
        let mut applications = BTreeMap::new();
        for (k, part) in parts[..edges].iter().enumerate() {
            applications.entry(part.application).or_insert((k, 0)).1 += 1;
        }
        let products: Vec<Product> = parts.into_iter().map(|part| part.product).collect();
        Ok(List { products: device.upload(&products)?, edges, applications })
    }

    /// Begins to add up what the backward pass has left of edges, beside what is queued next.
    pub fn add_up_edges(&self, network: &CudaNetwork) -> Result<(), CudaError> {
        if self.counts[0] == 0 {
            return Ok(());
        }
        self.ready.record(network.kernels.device.stream())?;
        self.aside.wait(&self.ready)?;
        self.add_up(network, Some(&self.aside), 0..self.counts[0])?;
        Ok(self.done.record(&self.aside)?)
    }

    /// Computes the gradient of the weights, or what the backward pass left of it, and waits for
    /// [`add_up_edges`](Self::add_up_edges).
    pub fn launch(&self, network: &CudaNetwork, list: &List) -> Result<(), CudaError> {
        let device = &network.kernels.device;
        let (first, blocks) =
            if network.kernels.fused() { (list.edges, NODE_BLOCKS) } else { (0, EDGE_BLOCKS) };
        let count = list.products.len() - first;
        network.kernels.products(list.product(first, device), count, blocks)?;
        let [edges, nodes] = self.counts;
        self.add_up(network, None, edges..edges + nodes)?;
        if edges > 0 {
            device.stream().wait(&self.done)?;
        }
        Ok(())
    }

    fn add_up(
        &self,
        network: &CudaNetwork,
        stream: Option<&Arc<CudaStream>>,
        which: std::ops::Range<usize>,
    ) -> Result<(), CudaError> {
        let device = &network.kernels.device;
        let targets = at(&self.targets, device) + (which.start * size_of::<Target>()) as u64;
        let (parameters, gradient) = (at(&network.parameters, device), at(&self.gradient, device));
        network.kernels.reduce(stream, targets, which.len(), parameters, gradient)
    }
}

impl List {
    /// Where the products of an application of an MLP to edges are, and their number.
    pub fn of(&self, saved: &Saved, device: &Device) -> (Address, usize) {
        match self.applications.get(&saved.linear) {
            Some(&(first, count)) => (self.product(first, device), count),
            None => (0, 0),
        }
    }

    fn product(&self, number: usize, device: &Device) -> Address {
        at(&self.products, device) + (number * size_of::<Product>()) as u64
    }
}

/// Shares of sums.
#[derive(Clone, Copy, Debug, Default)]
struct Shares {
    weight: usize,
    bias: usize,
    norm: i32,
    /// Of products over edges.
    edges: bool,
}

struct Assigned {
    weight: usize,
    bias: usize,
    shares: BTreeMap<(usize, usize, usize), Shares>,
}

/// Gives the products of each part of the weights neighbouring shares; `address` is where the
/// shares of that number are.
fn assign(parts: &mut [Part], address: impl Fn(usize, usize) -> (Address, Address)) -> Assigned {
    let mut parts: Vec<&mut Part> = parts.iter_mut().collect();
    parts.sort_by_key(|part| (part.mlp, part.linear, part.input));
    let mut all = Assigned { weight: 0, bias: 0, shares: BTreeMap::new() };
    for part in parts {
        let key = (part.mlp, part.linear, part.input);
        let shares = all.shares.entry(key).or_default();
        debug_assert!(shares.weight == 0 || shares.norm == part.norm, "one LayerNorm for all");
        (shares.norm, shares.edges) = (part.norm, part.application != 0);
        let blocks = part.product.blocks as usize;
        let (weight, bias) = address(all.weight, all.bias);
        part.product.weight = weight;
        shares.weight += blocks;
        all.weight += blocks;
        // Where the bias is wanted it is not zero.
        if part.product.bias != 0 {
            part.product.bias = bias.max(1);
            shares.bias += blocks;
            all.bias += blocks;
        }
    }
    all
}

fn at<T>(slice: &CudaSlice<T>, device: &Device) -> Address {
    slice.device_ptr(device.stream()).0
}

/// What an application of an MLP read.
struct Read<'a> {
    mlp: usize,
    saved: &'a Saved,
    /// Whether its rows are edges, and their number on the device.
    edges: bool,
    count: Address,
    states: Vec<EdgeState>,
    index: Address,
    features: Option<Features>,
}

impl CudaNetwork {
    /// All products of a training step; without views, with addresses of features missing.
    fn parts(&self, views: &[View]) -> Vec<Part> {
        let layout = &self.layout;
        let none = View {
            nodes: 0,
            edges: 0,
            start: 0,
            sender: 0,
            receiver: 0,
            reverse: 0,
            node: Features { at: 0, stride: 0 },
            edge: Features { at: 0, stride: 0 },
        };
        let view = |k: usize| views.get(k.min(layout.frames - 1)).copied().unwrap_or(none);
        let mut parts = Vec::new();
        let plain = |at| EdgeState { at, norm: -1 };
        let nodes = |mlp, saved, states: Vec<Address>, features, view: &View| Read {
            mlp,
            saved,
            edges: false,
            count: view.nodes,
            states: states.into_iter().map(plain).collect(),
            index: 0,
            features,
        };
        for (k, room) in self.room.frames.iter().enumerate() {
            let view = view(k);
            let (node, edge) = match k {
                0 => (layout.node_first, layout.edge_first),
                _ => (layout.node_later, layout.edge_later),
            };
            let read = nodes(node, &room.node_encoder, vec![], Some(view.node), &view);
            self.add_products(&mut parts, &read);
            let edges = |mlp, saved, states, index| Read {
                mlp,
                saved,
                edges: true,
                count: view.edges,
                states,
                index,
                features: Some(view.edge),
            };
            self.add_products(&mut parts, &edges(edge, &room.edge_encoder, vec![], 0));
            if k == 0 {
                continue;
            }
            let states = vec![self.room.layers[k - 1].node, room.node];
            let read = nodes(layout.node_fusion, &room.node_fusion, states, None, &view);
            self.add_products(&mut parts, &read);
            if let Some(fusion) = layout.edge_fusion {
                let states = vec![self.messages(k - 1)];
                let read = edges(fusion, &room.edge_fusion, states, room.previous);
                self.add_products(&mut parts, &read);
            }
        }
        for (k, (mlps, room)) in layout.layers.iter().zip(&self.room.layers).enumerate() {
            let view = view(k);
            let state = self.node_state(k);
            self.add_products(
                &mut parts,
                &Read {
                    mlp: mlps.message,
                    saved: &room.message,
                    edges: true,
                    count: view.edges,
                    states: vec![self.edge_state(k)],
                    index: 0,
                    features: None,
                },
            );
            for (input, dz) in [room.sender_gradient, room.receiver_gradient].iter().enumerate() {
                let product = Product {
                    x: state,
                    dz: *dz,
                    count: view.nodes,
                    blocks: NODE_BLOCKS as i32,
                    ..Product::default()
                };
                let (mlp, application) = (mlps.message, 0);
                parts.push(Part { mlp, linear: 0, input, norm: -1, application, product });
            }
            let states = vec![state, room.received];
            let read = nodes(mlps.update, &room.update, states, None, &view);
            self.add_products(&mut parts, &read);
        }
        let last = self.room.layers[layout.layers.len() - 1].node;
        let read = nodes(layout.decoder, &self.room.decoder, vec![last], None, &view(0));
        self.add_products(&mut parts, &read);
        parts
    }

    /// The products of one application of an MLP, those of the last linear first.
    fn add_products(&self, parts: &mut Vec<Part>, read: &Read) {
        let (m, saved) = (&self.layout.mlps[read.mlp], read.saved);
        let stride = self.kernels.precision.bytes() as u64 * saved.stride;
        let blocks = match (read.edges, self.kernels.fused()) {
            (false, _) => NODE_BLOCKS,
            (true, false) => EDGE_BLOCKS,
            (true, true) => saved.blocks,
        };
        let common = Product { count: read.count, blocks: blocks as i32, ..Product::default() };
        let application = if read.edges { saved.linear } else { 0 };
        for linear in (1..=m.layers).rev() {
            let product = Product {
                x: saved.hidden + (linear as u64 - 1) * stride,
                dz: saved.linear + linear as u64 * stride,
                bias: 1,
                ..common
            };
            parts.push(Part { mlp: read.mlp, linear, input: 0, norm: -1, application, product });
        }
        // The nodes' parts of messages are apart.
        let first = m.inputs.len() - read.states.len() - usize::from(read.features.is_some());
        let mut input = first;
        // Any number but 0 until it is known.
        let bias = |input| Address::from(input == first);
        for (k, state) in read.states.iter().enumerate() {
            let product = Product {
                x: state.at,
                index: if k == 0 { read.index } else { 0 },
                dz: saved.linear,
                bias: bias(input),
                ..common
            };
            let (mlp, norm) = (read.mlp, state.norm);
            parts.push(Part { mlp, linear: 0, input, norm, application, product });
            input += 1;
        }
        if let Some(features) = read.features {
            let product = Product {
                features: features.at,
                feature_count: features.stride as i32,
                dz: saved.linear,
                bias: bias(input),
                ..common
            };
            parts.push(Part { mlp: read.mlp, linear: 0, input, norm: -1, application, product });
        }
    }

    /// Where the gradients of LayerNorms' scales and shifts come from, and whether from edges.
    fn norm_targets(&self) -> Vec<(bool, Target)> {
        let layout = &self.layout;
        let of_edges = |mlp| {
            let messages = layout.layers.iter().map(|layer| layer.message);
            let edges =
                [layout.edge_first, layout.edge_later].into_iter().chain(layout.edge_fusion);
            edges.chain(messages).any(|edge| edge == mlp)
        };
        let mut targets = Vec::new();
        for (mlp, sums) in &self.room.norm_sums {
            let m = &layout.mlps[*mlp];
            for kind in 0..2 {
                let target = Target {
                    sums: sums.at,
                    count: sums.blocks as i32,
                    size: 2 * WIDTH as i32,
                    first: (kind * WIDTH) as i32,
                    rows: 1,
                    columns: m.columns as i32,
                    norm: -1,
                    to: (m.scale() + kind * m.columns) as i32,
                    ..Target::default()
                };
                targets.push((of_edges(*mlp), target));
            }
        }
        targets
    }
}
