//! Points that stand closer together than their volumes allow.

use rayon::prelude::*;

use crate::basis::{Basis, SUPPORT};
use crate::grid::{GHOSTS, Node, Shape};
use crate::stencil::Stencil;
use crate::{Mat2, PARALLEL_GRAIN};

/// Overlap of volumes that is left alone: points in disorder seem to overlap by some hundredths.
pub(crate) const SLACK: f64 = 0.05;
/// Samples of a basis function in a cell: the areas of nodes are right to 1e-5.
const SAMPLES: usize = 64;

/// The area of the domain that belongs to each node (m²): the integral of its basis function, `h²` but at walls.
pub(crate) fn node_areas(basis: Basis, shape: &Shape) -> Vec<f64> {
    let [along_x, along_y] = shape.cells.map(|cells| {
        let mut length = vec![0.0; cells + 1 + 2 * GHOSTS];
        for sample in 0..cells * SAMPLES {
            let x = (sample as f64 + 0.5) / SAMPLES as f64;
            let functions = basis.evaluate(x);
            for k in 0..SUPPORT {
                if let Some(length) =
                    length.get_mut((functions.first + (GHOSTS + k) as i64) as usize)
                {
                    *length += functions.value[k] * shape.cell / SAMPLES as f64;
                }
            }
        }
        length
    });
    along_y.iter().flat_map(|y| along_x.iter().map(move |x| x * y)).collect()
}

/// Compresses the material of points where the grid is denser than it.
///
/// The volume of a point follows from its own strain, its place from the grid: in long shear flows points gather
/// while each of their volumes says that there is room. With the density of the grid at a point,
/// `rho_p = sum m_i S_ip / sum A_i S_ip`, the volumes there overlap by `e_p = rho_p V_p / m_p - 1`. Where that is
/// more than the slack `s`,
///
/// `L_p <- L_p - rate (e_p - s) I / 2`,
///
/// so that the material is compressed, its pressure rises and pushes the points apart. At a free surface `e_p` is
/// negative, and nothing is done.
pub(crate) fn correct_density<const W: usize>(
    rate: f64,
    nodes: &[Node],
    areas: &[f64],
    columns: usize,
    stencils: &[Stencil],
    (mass, volume): (&[f64], &[f64]),
    gradient: &mut [Mat2],
) {
    let points = gradient.par_iter_mut().zip(stencils).zip(mass).zip(volume);
    points.with_min_len(PARALLEL_GRAIN).for_each(|(((l, stencil), mass), volume)| {
        let [mut sum, mut area] = [0.0; 2];
        for b in 0..W {
            let first = stencil.node + b * columns;
            for (a, (node, room)) in
                nodes[first..][..W].iter().zip(&areas[first..][..W]).enumerate()
            {
                sum += node.mass * stencil.value(a, b);
                area += room * stencil.value(a, b);
            }
        }
        let excess = sum * volume / (mass * area) - 1.0 - SLACK;
        if excess > 0.0 {
            let correction = 0.5 * rate * excess;
            l[(0, 0)] -= correction;
            l[(1, 1)] -= correction;
        }
    });
}
