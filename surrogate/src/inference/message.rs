//! Message passing, block by block: the only array over all edges is the states that the next layer
//! needs.

use burn::tensor::backend::Backend;
use multiversion::multiversion;
use rayon::prelude::*;

use super::mlp::{Block, Mlp};
use crate::network;

/// Edges of a block, unless a single node receives more.
const EDGES: usize = 128;

/// Edges in compressed sparse rows, by receiver.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Edges {
    /// First edge of each receiver, and the number of edges at the end.
    pub start: Vec<usize>,
    /// Sender of each edge.
    pub sender: Vec<u32>,
}

impl Edges {
    /// Ranges of receivers with about [`EDGES`] edges each.
    fn parts(&self) -> Vec<std::ops::Range<usize>> {
        let nodes = self.start.len() - 1;
        let mut parts = Vec::new();
        let mut first = 0;
        for node in 0..nodes {
            if node + 1 == nodes || self.start[node + 2] - self.start[first] > EDGES {
                parts.push(first..node + 1);
                first = node + 1;
            }
        }
        parts
    }
}

/// Twin of [`network::MessageLayer`].
pub(super) struct MessageLayer {
    message: Mlp,
    update: Mlp,
}

impl MessageLayer {
    pub fn new<B: Backend>(layer: &network::MessageLayer<B>, slope: f64) -> Self {
        Self { message: Mlp::new(&layer.message, slope), update: Mlp::new(&layer.update, slope) }
    }

    /// New node states from node states (nodes x width) and edge states (edges x width), which the
    /// messages replace if wanted.
    pub fn forward(&self, nodes: &[f32], mut states: EdgeStates, edges: &Edges) -> Vec<f32> {
        let width = self.message.width();
        let number = nodes.len() / width;
        // Its first linear acts on [h_w, h_v, h_e] as W_w h_w + W_v h_v + W_e h_e.
        let product = |first: usize, bias: &[f32]| {
            let mut out = bias.repeat(number);
            out.par_chunks_mut(EDGES * width).zip(nodes.par_chunks(EDGES * width)).for_each(
                |(out, rows)| self.message.add_first(first, rows, rows.len() / width, out),
            );
            out
        };
        let of_sender = product(0, &vec![0.0; width]);
        let of_receiver = product(width, self.message.first_bias());

        let parts = edges.parts();
        let mut received = vec![0.0; number * width];
        let mut rest = &mut received[..];
        let work: Vec<_> = parts
            .into_iter()
            .map(|receivers| {
                let (mine, others) =
                    std::mem::take(&mut rest).split_at_mut(receivers.len() * width);
                rest = others;
                let count = edges.start[receivers.end] - edges.start[receivers.start];
                (receivers, mine, states.take(count * width))
            })
            .collect();
        work.into_par_iter().for_each_init(Block::default, |block, (receivers, sums, states)| {
            let first = edges.start[receivers.start];
            let count = edges.start[receivers.end] - first;
            if count == 0 {
                return;
            }
            let senders = &edges.sender[first..first + count];
            let starts = &edges.start[receivers.start..=receivers.end];
            let of_receiver = &of_receiver[receivers.start * width..receivers.end * width];
            block.values.resize(count * width, 0.0);
            gather(&mut block.values, &of_sender, of_receiver, senders, starts);
            self.message.add_first(2 * width, states.read(), count, &mut block.values);
            self.message.after_first(count, block);
            scatter(sums, &block.values, starts);
            if let EdgeStates::Replaced(states) = states {
                states.copy_from_slice(&block.values);
            }
        });
        self.update.forward(&[nodes, &received], number)
    }
}

/// Edge states (edges x width), kept or replaced by messages.
pub(super) enum EdgeStates<'a> {
    Kept(&'a [f32]),
    Replaced(&'a mut [f32]),
}

impl<'a> EdgeStates<'a> {
    /// Splits off the first `numbers` values.
    fn take(&mut self, numbers: usize) -> EdgeStates<'a> {
        match self {
            Self::Kept(states) => {
                let (mine, rest) = states.split_at(numbers);
                *states = rest;
                EdgeStates::Kept(mine)
            }
            Self::Replaced(states) => {
                let (mine, rest) = std::mem::take(states).split_at_mut(numbers);
                *states = rest;
                EdgeStates::Replaced(mine)
            }
        }
    }

    fn read(&self) -> &[f32] {
        match self {
            Self::Kept(states) => states,
            Self::Replaced(states) => states,
        }
    }
}

/// Sums the contributions of both ends of each edge.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2+fma"))]
fn gather(
    values: &mut [f32],
    of_sender: &[f32],
    of_receiver: &[f32],
    senders: &[u32],
    starts: &[usize],
) {
    let width = values.len() / senders.len();
    let mut edges = values.chunks_exact_mut(width).zip(senders);
    for (receiver, row) in starts.windows(2).zip(of_receiver.chunks_exact(width)) {
        for (values, &sender) in edges.by_ref().take(receiver[1] - receiver[0]) {
            let sender = &of_sender[sender as usize * width..][..width];
            for ((x, a), b) in values.iter_mut().zip(sender).zip(row) {
                *x = a + b;
            }
        }
    }
}

/// Adds the messages to the sums of their receivers.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2+fma"))]
fn scatter(sums: &mut [f32], messages: &[f32], starts: &[usize]) {
    let width = sums.len() / (starts.len() - 1);
    let mut messages = messages.chunks_exact(width);
    for (receiver, sum) in starts.windows(2).zip(sums.chunks_exact_mut(width)) {
        for message in messages.by_ref().take(receiver[1] - receiver[0]) {
            for (x, m) in sum.iter_mut().zip(message) {
                *x += m;
            }
        }
    }
}
