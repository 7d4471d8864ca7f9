//! All kernels of a network, for one precision.

use std::sync::Arc;

use gpu::{Device, Source};

use super::backward::{self, Backward, MlpBackward};
use super::edges_backward::{self, EdgesBackward};
use super::forward::{self, MlpForward};
use super::gradient::{self, Gradient};
use super::launcher::{Launcher, Rows};
use super::muon;
use super::optimiser::{self, Optimiser};
use super::resident_or_streamed::Residence;
use super::segment::{self, Segment};
use super::weights::{self, Weights};
use crate::cuda::error::CudaError;
use crate::network::Precision;

/// All kernels of a network.
#[derive(Debug)]
pub(in crate::cuda) struct Kernels {
    pub launcher: Arc<Launcher>,
    pub weights: Weights,
    pub forward: MlpForward,
    backward: MlpBackward,
    edges_backward: Option<EdgesBackward>,
    pub gradient: Gradient,
    pub segment: Segment,
    pub optimiser: Optimiser,
}

impl Kernels {
    /// Compiles what is not in the cache.
    pub fn load(device: &Arc<Device>, precision: Precision) -> Result<Self, CudaError> {
        let launcher = &Arc::new(Launcher::new(device, precision)?);
        Ok(Self {
            weights: Weights::load(launcher)?,
            forward: MlpForward::load(launcher)?,
            backward: MlpBackward::load(launcher)?,
            edges_backward: EdgesBackward::load(launcher)?,
            gradient: Gradient::load(launcher)?,
            segment: Segment::load(launcher)?,
            optimiser: Optimiser::load(launcher)?,
            launcher: launcher.clone(),
        })
    }

    /// Whether the backward pass of edges computes the gradients of their weights too.
    pub fn fused(&self) -> bool {
        self.edges_backward.is_some()
    }

    /// Differentiates MLPs of edges side by side, with the same sizes of weights and blocks.
    pub fn backward_edges(&self, items: &[Backward], rows: Rows) -> Result<(), CudaError> {
        match &self.edges_backward {
            Some(kernel) => kernel.edges_backward(items),
            None => self.backward.of_edges(items, rows),
        }
    }

    /// Differentiates MLPs of nodes side by side.
    pub fn backward_nodes(&self, items: &[Backward], rows: Rows) -> Result<(), CudaError> {
        self.backward.of_nodes(items, rows)
    }
}

/// The sources of a network's kernels for a GPU with `shared` bytes of shared memory for a block; those that take the
/// compiler longest come first.
pub fn network_sources(precision: Precision, shared: usize) -> Vec<Source> {
    let in_two = [forward::source, backward::source];
    let in_two = in_two
        .into_iter()
        .flat_map(|source| Residence::BOTH.map(|residence| source(precision, shared, residence)));
    let others = [
        weights::source,
        edges_backward::source,
        gradient::source,
        segment::source,
        optimiser::source,
        muon::source,
    ];
    in_two.chain(others.map(|source| source(precision, shared))).collect()
}
