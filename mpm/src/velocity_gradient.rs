//! Velocity gradients of the points.

use rayon::prelude::*;

use crate::grid::Node;
use crate::stencil::Stencil;
use crate::{Mat2, PARALLEL_GRAIN};

/// `L_p = sum v_i (x) grad S_ip` (1/s), so `L_ij = dv_i/dx_j`.
pub(crate) fn velocity_gradient<const W: usize>(
    nodes: &[Node],
    columns: usize,
    stencils: &[Stencil],
    gradient: &mut [Mat2],
) {
    gradient.par_iter_mut().zip(stencils).with_min_len(PARALLEL_GRAIN).for_each(|(l, stencil)| {
        *l = Mat2::zeros();
        for b in 0..W {
            let row = &nodes[stencil.node + b * columns..][..W];
            for (a, node) in row.iter().enumerate() {
                *l += node.velocity * stencil.gradient(a, b).transpose();
            }
        }
    });
}
