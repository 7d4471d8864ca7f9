//! Momentum balance on the grid.

use std::ops::Range;

use rayon::prelude::*;

use crate::Vec2;
use crate::grid::Node;

/// `v_i = (m v)_i / m_i`; nodes of at most `cutoff` (kg/m) stay at rest.
pub(crate) fn velocity(nodes: &mut [Node], columns: usize, spans: &[Range<usize>], cutoff: f64) {
    for_each(nodes, columns, spans, |node| {
        node.velocity = if node.mass > cutoff { node.momentum / node.mass } else { Vec2::zeros() };
    });
}

/// `v_i^{n+1} = v_i^n + dt (f_i / m_i + g)`.
pub(crate) fn accelerate(
    nodes: &mut [Node],
    columns: usize,
    spans: &[Range<usize>],
    cutoff: f64,
    gravity: Vec2,
    dt: f64,
) {
    for_each(nodes, columns, spans, |node| {
        if node.mass > cutoff {
            node.old_velocity = node.momentum / node.mass;
            node.velocity = node.old_velocity + (node.force / node.mass + gravity) * dt;
        } else {
            node.old_velocity = Vec2::zeros();
            node.velocity = Vec2::zeros();
        }
    });
}

fn for_each(
    nodes: &mut [Node],
    columns: usize,
    spans: &[Range<usize>],
    update: impl Fn(&mut Node) + Sync,
) {
    nodes
        .par_chunks_exact_mut(columns)
        .zip(spans)
        .with_min_len(16)
        .for_each(|(row, span)| row[span.clone()].iter_mut().for_each(&update));
}
