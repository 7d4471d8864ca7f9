//! The argument of all kernels, and how things are laid out in device memory.

use cudarc::driver::DeviceRepr;

use crate::friction::Friction;
use crate::{Ledger, Mat2, Obstacle, Vec2, Walls};

/// `Mpm` of `mpm.cuh`: numbers, and addresses of the arrays.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DeviceView {
    pub(super) cell: f64,
    pub(super) size: [f64; 2],
    pub(super) dt: f64,
    pub(super) gravity: [f64; 2],
    pub(super) cutoff: f64,
    pub(super) pic_share: f64,
    pub(super) friction: [f64; 4],
    pub(super) first_step: u64,
    pub(super) columns: i32,
    pub(super) rows: i32,
    pub(super) cells: [i32; 2],
    pub(super) points: i32,
    pub(super) obstacles: i32,
    pub(super) affine: i32,
    pub(super) stress_phase: u32,
    pub(super) clock: u64,
    pub(super) obstacle: u64,
    pub(super) placed: u64,
    pub(super) position: u64,
    pub(super) velocity: u64,
    pub(super) affine_velocity: u64,
    pub(super) mass: u64,
    pub(super) volume: u64,
    pub(super) velocity_gradient: u64,
    pub(super) stress: u64,
    pub(super) stencil: u64,
    pub(super) fault: u64,
    pub(super) node_mass: u64,
    pub(super) node_momentum: u64,
    pub(super) node_old_velocity: u64,
    pub(super) node_velocity: u64,
    pub(super) node_approach: u64,
    pub(super) node_ledger: u64,
    pub(super) point_ledger: u64,
    pub(super) bins: BinsView,
    pub(super) cell_bins: BinsView,
    pub(super) cell_sum: u64,
}

// SAFETY: plain numbers and addresses, laid out as in `mpm.cuh`, which checks the size.
unsafe impl DeviceRepr for DeviceView {}

/// `Bins` of `mpm.cuh`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub(super) struct BinsView {
    pub cell: u64,
    pub head: u64,
    pub next: u64,
    pub first: u64,
    pub successor: u64,
}

/// `Clock::failure` of `mpm.cuh` as long as there is none.
pub(super) const NO_FAILURE: u64 = u64::MAX;

/// Bytes of a `Stencil` of `mpm.cuh`: corner, three sets of weights along two axes, node.
pub(super) const fn stencil_bytes(width: usize) -> usize {
    (2 * 8 + 3 * 2 * width * 8 + 4_usize).next_multiple_of(16)
}

/// Numbers of an `Obstacle` and of a `Placed` of `mpm.cuh`.
pub(super) const OBSTACLE: usize = 11;
pub(super) const PLACED: usize = 10;

pub(super) fn flat_obstacles(obstacles: &[Obstacle]) -> Vec<f64> {
    let flat = |o: &Obstacle| {
        let pairs = [o.min, o.max].into_iter().flat_map(<[f64; 2]>::from);
        let motion = [o.velocity.x, o.velocity.y, o.start];
        pairs.chain(frictions(&o.faces)).chain(motion).collect::<Vec<f64>>()
    };
    obstacles.iter().flat_map(flat).collect()
}

/// Left, right, bottom, top; 0 slips and infinity sticks.
pub(super) fn frictions(walls: &Walls) -> [f64; 4] {
    walls.sides().map(|friction| match friction {
        Friction::Slip => 0.0,
        Friction::Coulomb(mu) => mu,
        Friction::Stick => f64::INFINITY,
    })
}

/// Impulses by the walls and by each obstacle, work of the obstacles, number of projections.
pub(super) fn flat_ledger(ledger: &Ledger) -> Vec<f64> {
    let impulses = [ledger.wall_impulse].into_iter().chain(ledger.obstacle_impulse.iter().copied());
    let last = [ledger.plate_work, ledger.projected as f64];
    impulses.flat_map(<[f64; 2]>::from).chain(last).collect()
}

pub(super) fn ledger(flat: &[f64]) -> Ledger {
    let (impulses, last) = flat.split_at(flat.len() - 2);
    let mut impulses = impulses.chunks_exact(2).map(Vec2::from_column_slice);
    Ledger {
        wall_impulse: impulses.next().unwrap_or_default(),
        obstacle_impulse: impulses.collect(),
        plate_work: last[0],
        // A count: exact in f64 up to 2^53.
        projected: last[1] as u64,
    }
}

pub(super) fn flat_vectors(vectors: &[Vec2]) -> Vec<f64> {
    vectors.iter().flat_map(|v| [v.x, v.y]).collect()
}

/// Row by row.
pub(super) fn flat_matrices(matrices: &[Mat2]) -> Vec<f64> {
    matrices.iter().flat_map(|m| [m[(0, 0)], m[(0, 1)], m[(1, 0)], m[(1, 1)]]).collect()
}

pub(super) fn set_vectors(vectors: &mut [Vec2], flat: &[f64]) {
    for (vector, flat) in vectors.iter_mut().zip(flat.chunks_exact(2)) {
        *vector = Vec2::from_column_slice(flat);
    }
}

pub(super) fn set_matrices(matrices: &mut [Mat2], flat: &[f64]) {
    for (matrix, flat) in matrices.iter_mut().zip(flat.chunks_exact(4)) {
        *matrix = Mat2::from_row_slice(flat);
    }
}
