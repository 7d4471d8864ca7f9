//! Points to grid: mass, momentum and internal force of the nodes.

use rayon::prelude::*;

use crate::bins::Bins;
use crate::grid::Node;
use crate::stencil::Stencil;
use crate::{Mat2, PARALLEL_GRAIN, Points, Vec2};

/// The mapping from points to nodes: sorted points and their basis functions.
pub(crate) struct Mapping<'a> {
    pub bins: &'a Bins,
    pub stencils: &'a [Stencil],
    pub cell: f64,
    pub columns: usize,
    /// Sums of each bin over its own nodes, before nodes add them up.
    pub patches: &'a mut Vec<f64>,
}

/// `m_i = sum S_ip m_p` and `(m v)_i = sum S_ip m_p (v_p + C_p (x_i - x_p))`, the affine part when
/// the transfer has one.
pub(crate) fn mass_and_momentum<const W: usize>(
    map: &mut Mapping,
    points: &Points,
    affine: bool,
    nodes: &mut [Node],
) {
    map.sum::<W, 3, _>(
        nodes,
        |p| {
            let (m, v, c) = point_momentum(points, affine, p);
            move |s: f64, _, offset: Vec2| {
                let q = (v + c * offset) * s;
                [m * s, q.x, q.y]
            }
        },
        |node, [mass, x, y]| {
            node.mass = mass;
            node.momentum = Vec2::new(x, y);
        },
    );
}

/// `(m v)_i` alone, for the second mapping of MUSL.
pub(crate) fn momentum<const W: usize>(
    map: &mut Mapping,
    points: &Points,
    affine: bool,
    nodes: &mut [Node],
) {
    map.sum::<W, 2, _>(
        nodes,
        |p| {
            let (_, v, c) = point_momentum(points, affine, p);
            move |s: f64, _, offset: Vec2| {
                let q = (v + c * offset) * s;
                [q.x, q.y]
            }
        },
        |node, [x, y]| node.momentum = Vec2::new(x, y),
    );
}

/// Internal force `f_i = - sum V_p (sigma_p - rho_p (w tr L_p)² I) grad S_ip`, the second term, with the `shock_width` `w` (m),
/// under compression only.
pub(crate) fn internal_force<const W: usize>(
    map: &mut Mapping,
    points: &Points,
    shock_width: f64,
    nodes: &mut [Node],
) {
    map.sum::<W, 2, _>(
        nodes,
        |p| {
            let jump = shock_width * points.velocity_gradient[p].trace().min(0.0);
            let shock = Mat2::from_diagonal_element(points.mass[p] * jump * jump);
            let tension = shock - points.stress[p] * points.volume[p];
            move |_, gradient: Vec2, _| {
                let f = tension * gradient;
                [f.x, f.y]
            }
        },
        |node, [x, y]| node.force = Vec2::new(x, y),
    );
}

/// `m`, `m v` and `m C` of a point.
fn point_momentum(points: &Points, affine: bool, p: usize) -> (f64, Vec2, Mat2) {
    let m = points.mass[p];
    let c = if affine { points.affine[p] * m } else { Mat2::zeros() };
    (m, points.velocity[p] * m, c)
}

impl Mapping<'_> {
    /// Sums `K` numbers over the points that each node sees.
    ///
    /// `term(p)` gives the function of `(S_ip, grad S_ip, x_i - x_p)` to sum; `store` puts a sum
    /// into its node. Each bin first sums its points into a patch of `W x W` nodes; each node then
    /// adds the patches that cover it. Both orders are fixed.
    fn sum<const W: usize, const K: usize, T>(
        &mut self,
        nodes: &mut [Node],
        term: impl Fn(usize) -> T + Sync,
        store: impl Fn(&mut Node, [f64; K]) + Sync,
    ) where
        T: Fn(f64, Vec2, Vec2) -> [f64; K],
    {
        let size = W * W * K;
        // Enough for one point a bin, whatever K: no allocation when points spread out.
        self.patches.reserve((self.stencils.len() * W * W * 3).saturating_sub(self.patches.len()));
        self.patches.resize(self.bins.len() * size, 0.0);

        let (bins, stencils, cell, columns) = (self.bins, self.stencils, self.cell, self.columns);
        self.patches
            .par_chunks_exact_mut(size)
            .enumerate()
            .with_min_len(PARALLEL_GRAIN / 4)
            .for_each(|(bin, patch)| {
                let mut sum = [[[0.0; K]; W]; W];
                for &p in bins.points(bin) {
                    let stencil = &stencils[p as usize];
                    let term = term(p as usize);
                    for (b, row) in sum.iter_mut().enumerate() {
                        for (a, total) in row.iter_mut().enumerate() {
                            let part = term(
                                stencil.value(a, b),
                                stencil.gradient(a, b),
                                stencil.offset(a, b, cell),
                            );
                            for k in 0..K {
                                total[k] += part[k];
                            }
                        }
                    }
                }
                patch.copy_from_slice(sum.as_flattened().as_flattened());
            });

        let patches = &*self.patches;
        nodes.par_chunks_exact_mut(columns).zip(bins.spans()).enumerate().with_min_len(4).for_each(
            |(row, (nodes, span))| {
                for column in span.clone() {
                    let mut total = [0.0; K];
                    for b in 0..W.min(row + 1) {
                        for a in 0..W.min(column + 1) {
                            let Some(bin) = bins.at((row - b) * columns + column - a) else {
                                continue;
                            };
                            let part = &patches[bin * size + (b * W + a) * K..][..K];
                            for k in 0..K {
                                total[k] += part[k];
                            }
                        }
                    }
                    store(&mut nodes[column], total);
                }
            },
        );
    }
}
