//! Grid to points: velocity, affine matrix and position.

use rayon::prelude::*;

use crate::grid::Node;
use crate::stencil::Stencil;
use crate::{Mat2, PARALLEL_GRAIN, Points, Transfer, Vec2};

/// With the PIC share `s` of the transfer ([`Transfer`]):
///
/// ```text
/// v_p <- (1 - s) (v_p + sum S_ip (v_i^{n+1} - v_i^n)) + s sum S_ip v_i^{n+1}
/// C_p <- sum S_ip v_i^{n+1} (x) D^-1 (x_i - x_p)             (affine transfers)
/// x_p <- x_p + dt sum S_ip v_i^{n+1}
/// ```
pub(crate) fn transfer<const W: usize>(
    transfer: Transfer,
    nodes: &[Node],
    columns: usize,
    stencils: &[Stencil],
    points: &mut Points,
    dt: f64,
) {
    let share = transfer.pic_share(dt);
    let affine = transfer.affine();
    (&mut points.position, &mut points.velocity, &mut points.affine, stencils)
        .into_par_iter()
        .with_min_len(PARALLEL_GRAIN)
        .for_each(|(position, velocity, matrix, stencil)| {
            let mut pic = Vec2::zeros();
            let mut increment = Vec2::zeros();
            let mut c = Mat2::zeros();
            for b in 0..W {
                let row = &nodes[stencil.node + b * columns..][..W];
                for (a, node) in row.iter().enumerate() {
                    let s = stencil.value(a, b);
                    pic += node.velocity * s;
                    increment += (node.velocity - node.old_velocity) * s;
                    c += node.velocity * stencil.affine(a, b).transpose();
                }
            }
            *velocity = (*velocity + increment) * (1.0 - share) + pic * share;
            *matrix = if affine { c } else { Mat2::zeros() };
            *position += pic * dt;
        });
}
