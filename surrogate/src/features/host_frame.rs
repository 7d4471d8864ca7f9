//! Graphs and features of the windows of a batch in host memory.

use std::cmp::Ordering;

use burn::tensor::backend::Backend;
use burn::tensor::{Int, Tensor, TensorData};

use super::graph::RadiusGraph;
use super::input::{FrameInput, Persistence};

/// Features and edges of a frame, in host memory.
#[derive(Clone, Debug)]
pub struct HostFrame {
    /// Points of all windows together.
    pub points: usize,
    /// Columns of a node and of an edge.
    pub columns: [usize; 2],
    /// Node features, points x columns.
    pub nodes: Vec<f32>,
    /// Edge features, edges x columns.
    pub edges: Vec<f32>,
    /// Edges as (receiver, sender), ascending.
    pub pairs: Vec<(i32, i32)>,
}

impl HostFrame {
    pub(super) fn new(
        points: usize,
        nodes: Vec<f32>,
        edges: Vec<f32>,
        graph: &RadiusGraph,
        columns: [usize; 2],
    ) -> Self {
        let pairs = graph.pairs().map(|(receiver, sender)| (receiver as i32, sender as i32));
        Self { points, columns, nodes, edges, pairs: pairs.collect() }
    }

    /// The graphs of several windows as one graph without edges between them.
    pub(super) fn side_by_side(parts: Vec<HostFrame>, columns: [usize; 2]) -> Self {
        let mut whole =
            Self { points: 0, columns, nodes: Vec::new(), edges: Vec::new(), pairs: Vec::new() };
        for part in parts {
            let offset = whole.points as i32;
            whole.points += part.points;
            whole.nodes.extend(part.nodes);
            whole.edges.extend(part.edges);
            whole.pairs.extend(part.pairs.iter().map(|(v, w)| (v + offset, w + offset)));
        }
        whole
    }

    pub(super) fn to_device<B: Backend>(
        &self,
        previous: Option<&HostFrame>,
        device: &B::Device,
    ) -> FrameInput<B> {
        let columns = self.columns;
        FrameInput {
            nodes: matrix(&self.nodes, [self.points, columns[0]], device),
            edges: matrix(&self.edges, [self.pairs.len(), columns[1]], device),
            sender: indices(self.pairs.iter().map(|pair| pair.1), device),
            receiver: indices(self.pairs.iter().map(|pair| pair.0), device),
            persistence: previous.map(|previous| self.persistence(previous, device)),
        }
    }

    /// Matches the edges with those of the previous frame; both lists are ascending.
    fn persistence<B: Backend>(&self, before: &HostFrame, device: &B::Device) -> Persistence<B> {
        let (mut persistent, mut previous, mut new) = (Vec::new(), Vec::new(), Vec::new());
        let mut old = 0;
        for (edge, pair) in self.pairs.iter().enumerate() {
            while before.pairs.get(old).is_some_and(|p| p.cmp(pair) == Ordering::Less) {
                old += 1;
            }
            if before.pairs.get(old) == Some(pair) {
                persistent.push(edge as i32);
                previous.push(old as i32);
            } else {
                new.push(edge as i32);
            }
        }
        let mut place = vec![0; self.pairs.len()];
        for (k, &edge) in persistent.iter().chain(&new).enumerate() {
            place[edge as usize] = k as i32;
        }
        Persistence {
            persistent: indices(persistent, device),
            previous: indices(previous, device),
            new: indices(new, device),
            place: indices(place, device),
        }
    }
}

fn matrix<B: Backend>(values: &[f32], shape: [usize; 2], device: &B::Device) -> Tensor<B, 2> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), device)
}

fn indices<B: Backend>(
    values: impl IntoIterator<Item = i32>,
    device: &B::Device,
) -> Tensor<B, 1, Int> {
    let values: Vec<i32> = values.into_iter().collect();
    let length = values.len();
    Tensor::from_data(TensorData::new(values, [length]), device)
}
