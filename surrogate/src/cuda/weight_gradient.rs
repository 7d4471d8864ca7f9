//! The gradient of the weights: products of the linears' inputs with the gradients of their
//! outputs, in shares that are added up in a fixed order.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use cudarc::driver::{CudaEvent, CudaSlice, CudaStream};
use gpu::{ConstPointer, Device, Pointer};

use super::activations::{MlpActivations, NORM_SUMS};
use super::error::CudaError;
use super::layout::Input;
use super::network::{CudaNetwork, FrameView};
use super::ops::forward::NO_OFFSET;
use super::ops::gradient::Product;
use super::ops::optimiser::{LOSS_SUMS, Target};
use super::ops::tile::{Stored, WIDTH};
use super::products::{EDGE_BLOCKS, NODE_BLOCKS, Part};

/// Numbers of a block's share of a product.
const WEIGHT_SHARE: usize = WIDTH * WIDTH;

/// The gradients of all weights, and what it takes to compute them.
#[derive(Debug)]
pub struct WeightGradient {
    /// In the order of the weights, then the sums of the loss ([`LOSS_SUMS`]).
    pub gradient: CudaSlice<f32>,
    /// Those of edges that the backward pass leaves to be added up, then the others.
    targets: CudaSlice<Target>,
    /// The number of the former.
    edge_targets: usize,
    /// Shares of the products: [`WEIGHT_SHARE`] numbers for weights and 128 for biases, each.
    weight_sums: CudaSlice<f32>,
    bias_sums: CudaSlice<f32>,
    /// Adds up sums of edges while the nodes' products go on: from one event to the other.
    side_stream: Arc<CudaStream>,
    ready: CudaEvent,
    done: CudaEvent,
}

/// The products of a step on certain frames.
#[derive(Debug)]
pub struct Products {
    /// Over edges, those of an application of an MLP from the last linear to the first; then over
    /// nodes.
    products: CudaSlice<Product>,
    /// How many of them are over edges.
    edges: usize,
    /// Applications of MLPs to edges, by the gradients of their linears' outputs, and their products.
    applications: Vec<(Pointer<Stored>, Range<usize>)>,
}

impl WeightGradient {
    /// For the network with the activations that it has now.
    pub fn new(network: &CudaNetwork) -> Result<Self, CudaError> {
        let device = network.device();
        let mut parts = network.parts(&[]);
        let assigned = assign(&mut parts, |_, _| (Pointer::NULL, Pointer::NULL));
        let weight_sums = device.zeros(assigned.weight * WEIGHT_SHARE)?;
        let bias_sums = device.zeros(assigned.bias * WIDTH)?;
        let mut targets = network.norm_targets();
        let sums = [network.pointer(&weight_sums), network.pointer(&bias_sums)];
        targets.extend(network.weight_targets(&assigned, sums));
        // Those of edges first.
        let fused = network.kernels.fused();
        let (edges, others): (Vec<_>, Vec<_>) =
            targets.into_iter().partition(|(of_edges, _)| fused && *of_edges);
        let edge_targets = edges.len();
        let targets: Vec<Target> =
            edges.into_iter().chain(others).map(|(_, target)| target).collect();
        Ok(Self {
            gradient: device.zeros(network.layout.parameters + LOSS_SUMS)?,
            targets: device.upload(&targets)?,
            edge_targets,
            side_stream: device.context().new_stream()?,
            ready: device.context().new_event(None)?,
            done: device.context().new_event(None)?,
            weight_sums,
            bias_sums,
        })
    }

    /// The products for frames.
    pub fn products(
        &self,
        network: &CudaNetwork,
        views: &[FrameView],
    ) -> Result<Products, CudaError> {
        let device = network.device();
        let weights = Pointer::to(&self.weight_sums, device.stream());
        let biases = Pointer::to(&self.bias_sums, device.stream());
        let mut parts = network.parts(views);
        assign(&mut parts, |weight, bias| {
            (weights.offset(weight * WEIGHT_SHARE), biases.offset(bias * WIDTH))
        });
        // The long ones first, which stay in order.
        parts.sort_by_key(|part| part.application.is_none());
        let mut applications = Vec::<(Pointer<Stored>, Range<usize>)>::new();
        let mut edges = 0;
        for application in parts.iter().map_while(|part| part.application) {
            match applications.iter_mut().find(|(other, _)| *other == application) {
                Some((_, range)) => range.end += 1,
                None => applications.push((application, edges..edges + 1)),
            }
            edges += 1;
        }
        let products: Vec<Product> = parts.into_iter().map(|part| part.product).collect();
        Ok(Products { products: device.upload(&products)?, edges, applications })
    }

    /// Begins to add up what the backward pass has left of edges, beside what is queued next.
    pub fn reduce_edges(&self, network: &CudaNetwork) -> Result<(), CudaError> {
        if self.edge_targets == 0 {
            return Ok(());
        }
        self.ready.record(network.device().stream())?;
        self.side_stream.wait(&self.ready)?;
        self.reduce(network, Some(&self.side_stream), 0..self.edge_targets)?;
        Ok(self.done.record(&self.side_stream)?)
    }

    /// Computes the gradient of the weights, or what the backward pass left of it, and waits for
    /// [`reduce_edges`](Self::reduce_edges).
    pub fn compute(&self, network: &CudaNetwork, products: &Products) -> Result<(), CudaError> {
        let device = network.device();
        let (first, blocks) =
            if network.kernels.fused() { (products.edges, NODE_BLOCKS) } else { (0, EDGE_BLOCKS) };
        let count = products.products.len() - first;
        let all = products.from(first, device);
        network.kernels.gradient.weight_gradient(all, count, blocks)?;
        self.reduce(network, None, self.edge_targets..self.targets.len())?;
        if self.edge_targets > 0 {
            device.stream().wait(&self.done)?;
        }
        Ok(())
    }

    fn reduce(
        &self,
        network: &CudaNetwork,
        stream: Option<&Arc<CudaStream>>,
        range: Range<usize>,
    ) -> Result<(), CudaError> {
        let targets = network.pointer(&self.targets).offset(range.start);
        network.kernels.optimiser.reduce_gradient(
            stream,
            targets,
            range.len(),
            &network.parameters,
            &self.gradient,
        )
    }
}

impl Products {
    /// The products of an application of an MLP to edges, and their number; none over nodes.
    pub fn of(&self, saved: &MlpActivations, device: &Device) -> (ConstPointer<Product>, usize) {
        let application = saved.linear_gradients;
        match self.applications.iter().find(|(other, _)| *other == application) {
            Some((_, range)) => (self.from(range.start, device), range.len()),
            None => (ConstPointer::NULL, 0),
        }
    }

    /// The products from this number on.
    fn from(&self, number: usize, device: &Device) -> ConstPointer<Product> {
        ConstPointer::to(&self.products, device.stream()).offset(number)
    }
}

/// Shares of a part of the weights.
#[derive(Clone, Copy, Debug)]
struct Shares {
    weight: usize,
    bias: usize,
    /// As [`Part::norm`].
    norm: i32,
    /// Of products over edges.
    edges: bool,
}

/// Shares of all parts of the weights.
struct Assigned {
    /// The number of all shares of weights, and of biases.
    weight: usize,
    bias: usize,
    /// By MLP, linear and input.
    shares: BTreeMap<(usize, usize, usize), Shares>,
}

/// Gives the products of each part of the weights neighbouring shares; `pointers` are to the shares
/// of weights and of biases of that number.
fn assign(
    parts: &mut [Part],
    pointers: impl Fn(usize, usize) -> (Pointer<f32>, Pointer<f32>),
) -> Assigned {
    let mut parts: Vec<&mut Part> = parts.iter_mut().collect();
    parts.sort_by_key(|part| (part.mlp, part.linear, part.input));
    let mut all = Assigned { weight: 0, bias: 0, shares: BTreeMap::new() };
    for part in parts {
        let (norm, edges) = (part.norm, part.application.is_some());
        let none = Shares { weight: 0, bias: 0, norm, edges };
        let shares = all.shares.entry((part.mlp, part.linear, part.input)).or_insert(none);
        debug_assert!(shares.norm == norm && shares.edges == edges, "one LayerNorm for all");
        let blocks = part.product.blocks as usize;
        let (weight, bias) = pointers(all.weight, all.bias);
        part.product.weight = weight;
        shares.weight += blocks;
        all.weight += blocks;
        if part.has_bias {
            part.product.bias = bias;
            shares.bias += blocks;
            all.bias += blocks;
        }
    }
    all
}

impl CudaNetwork {
    /// What the gradients of weights and biases are added up of, and whether over edges.
    /// `weight_sums` and `bias_sums` are those of all shares.
    fn weight_targets(
        &self,
        assigned: &Assigned,
        [mut weight_sums, mut bias_sums]: [ConstPointer<f32>; 2],
    ) -> Vec<(bool, Target)> {
        let mut targets = Vec::new();
        for (&(mlp, linear, input), shares) in &assigned.shares {
            let m = &self.layout.mlps[mlp];
            let (rows, row) = match (linear, m.inputs.get(input)) {
                (0, Some(Input::Features(count))) => (*count, m.first_row(input)),
                (0, _) => (m.width, m.first_row(input)),
                _ => (m.width, 0),
            };
            let columns = m.outputs(linear);
            let weight = Target {
                sums: weight_sums,
                shift_sums: bias_sums,
                count: shares.weight as i32,
                size: WEIGHT_SHARE as i32,
                rows: rows as i32,
                columns: columns as i32,
                shift_count: shares.bias as i32,
                norm: shares.norm,
                width: m.width as i32,
                to: (m.weight(linear) + row * columns) as i32,
                ..Target::default()
            };
            targets.push((shares.edges, weight));
            weight_sums = weight_sums.offset(shares.weight * WEIGHT_SHARE);
            if shares.bias > 0 {
                let bias = Target {
                    sums: bias_sums,
                    count: shares.bias as i32,
                    size: WIDTH as i32,
                    rows: 1,
                    columns: columns as i32,
                    norm: NO_OFFSET,
                    to: m.bias(linear) as i32,
                    ..Target::default()
                };
                targets.push((shares.edges, bias));
                bias_sums = bias_sums.offset(shares.bias * WIDTH);
            }
        }
        targets
    }

    /// What the gradients of LayerNorms' scales and shifts are added up of, and whether over edges.
    fn norm_targets(&self) -> Vec<(bool, Target)> {
        let layout = &self.layout;
        let of_edges = |mlp| {
            let messages = layout.layers.iter().map(|layer| layer.message);
            let edges =
                [layout.edge_first, layout.edge_later].into_iter().chain(layout.edge_fusion);
            edges.chain(messages).any(|edge| edge == mlp)
        };
        let mut targets = Vec::new();
        for (&mlp, sums) in &self.activations.norm_sums {
            let m = &layout.mlps[mlp];
            // Scale, then shift.
            for kind in 0..2 {
                let target = Target {
                    sums: sums.sums.into(),
                    count: sums.blocks as i32,
                    size: NORM_SUMS as i32,
                    first: (kind * WIDTH) as i32,
                    rows: 1,
                    columns: m.columns as i32,
                    norm: NO_OFFSET,
                    to: (m.scale() + kind * m.columns) as i32,
                    ..Target::default()
                };
                targets.push((of_edges(mlp), target));
            }
        }
        targets
    }
}
