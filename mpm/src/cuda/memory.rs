//! Points, grid and obstacles in device memory.

use cudarc::driver::{CudaSlice, CudaStream, DevicePtr, DeviceRepr, ValidAsZeroBits};
use gpu::{Device, Error};

use super::view::{
    BinsView, DeviceView, NO_FAILURE, PLACED, flat_ledger, flat_matrices, flat_obstacles,
    flat_vectors, frictions, stencil_bytes,
};
use crate::{Points, Scheme, Solver};

/// The arrays behind a [`DeviceView`]: vectors and matrices as rows of numbers.
pub(super) struct Memory {
    /// `Clock` of `mpm.cuh`: step, failure, running.
    pub clock: CudaSlice<u64>,
    obstacle: CudaSlice<f64>,
    placed: CudaSlice<f64>,
    pub position: CudaSlice<f64>,
    pub velocity: CudaSlice<f64>,
    pub affine_velocity: CudaSlice<f64>,
    mass: CudaSlice<f64>,
    pub volume: CudaSlice<f64>,
    pub velocity_gradient: CudaSlice<f64>,
    pub stress: CudaSlice<f64>,
    stencil: CudaSlice<u8>,
    pub fault: CudaSlice<i32>,
    node_mass: CudaSlice<f64>,
    node_momentum: CudaSlice<f64>,
    node_old_velocity: CudaSlice<f64>,
    node_velocity: CudaSlice<f64>,
    node_approach: CudaSlice<f64>,
    pub node_ledger: CudaSlice<f64>,
    pub point_ledger: CudaSlice<f64>,
    /// What contacts have done since the start, in the order of the ledgers of nodes and points.
    pub ledger: CudaSlice<f64>,
    bins: Bins,
    cell_bins: Bins,
    cell_sum: CudaSlice<f64>,
}

/// Points sorted by cells.
struct Bins {
    cell: CudaSlice<i32>,
    head: CudaSlice<u64>,
    next: CudaSlice<i32>,
    first: CudaSlice<u64>,
    successor: CudaSlice<i32>,
}

impl Memory {
    pub fn new(device: &Device, solver: &Solver, points: &Points) -> Result<Self, Error> {
        let (shape, numerics) = (&solver.shape, solver.numerics());
        let (n, nodes) = (points.len(), shape.columns * shape.rows);
        // What a run without the cell average never touches takes no memory.
        let averaged = if numerics.cell_average_volumetric { 1 } else { 0 };
        let cells = averaged * shape.cells[0] * shape.cells[1];
        let ledger = flat_ledger(solver.ledger());
        Ok(Self {
            clock: device.upload(&[0, NO_FAILURE, 1])?,
            obstacle: upload(device, &flat_obstacles(&solver.obstacles))?,
            placed: zeros(device, 2 * PLACED * solver.obstacles.len())?,
            position: upload(device, &flat_vectors(&points.position))?,
            velocity: upload(device, &flat_vectors(&points.velocity))?,
            affine_velocity: upload(device, &flat_matrices(&points.affine))?,
            mass: upload(device, &points.mass)?,
            volume: upload(device, &points.volume)?,
            velocity_gradient: upload(device, &flat_matrices(&points.velocity_gradient))?,
            stress: upload(device, &flat_matrices(&points.stress))?,
            stencil: zeros(device, n * stencil_bytes(numerics.basis.width()))?,
            fault: zeros(device, n)?,
            node_mass: zeros(device, nodes)?,
            node_momentum: zeros(device, 2 * nodes)?,
            node_old_velocity: zeros(device, 2 * nodes)?,
            node_velocity: zeros(device, 2 * nodes)?,
            node_approach: zeros(device, 2 * nodes)?,
            node_ledger: zeros(device, ledger.len() * nodes)?,
            point_ledger: zeros(device, ledger.len() * n)?,
            ledger: upload(device, &ledger)?,
            bins: Bins::new(device, n, nodes)?,
            cell_bins: Bins::new(device, averaged * n, cells)?,
            cell_sum: zeros(device, 2 * cells)?,
        })
    }

    /// The argument of kernels that advance points of this total `mass` (kg/m) by steps of `dt`
    /// (s), of which `first_step` are done.
    pub fn view(
        &self,
        stream: &CudaStream,
        solver: &Solver,
        (points, mass): (usize, f64),
        dt: f64,
        first_step: usize,
    ) -> DeviceView {
        let (shape, numerics) = (&solver.shape, solver.numerics());
        DeviceView {
            cell: shape.cell,
            size: shape.size.into(),
            dt,
            gravity: solver.gravity().into(),
            cutoff: numerics.cutoff(mass, points),
            pic_share: numerics.transfer.pic_share(dt),
            friction: frictions(&solver.domain().walls),
            first_step: first_step as u64,
            columns: shape.columns as i32,
            rows: shape.rows as i32,
            cells: shape.cells.map(|n| n as i32),
            points: points as i32,
            obstacles: solver.obstacles.len() as i32,
            affine: i32::from(numerics.transfer.affine()),
            // `Phase` of `mpm.cuh`.
            stress_phase: if numerics.scheme == Scheme::Usf { 0 } else { 2 },
            clock: address(&self.clock, stream),
            obstacle: address(&self.obstacle, stream),
            placed: address(&self.placed, stream),
            position: address(&self.position, stream),
            velocity: address(&self.velocity, stream),
            affine_velocity: address(&self.affine_velocity, stream),
            mass: address(&self.mass, stream),
            volume: address(&self.volume, stream),
            velocity_gradient: address(&self.velocity_gradient, stream),
            stress: address(&self.stress, stream),
            stencil: address(&self.stencil, stream),
            fault: address(&self.fault, stream),
            node_mass: address(&self.node_mass, stream),
            node_momentum: address(&self.node_momentum, stream),
            node_old_velocity: address(&self.node_old_velocity, stream),
            node_velocity: address(&self.node_velocity, stream),
            node_approach: address(&self.node_approach, stream),
            node_ledger: address(&self.node_ledger, stream),
            point_ledger: address(&self.point_ledger, stream),
            bins: self.bins.view(stream),
            cell_bins: self.cell_bins.view(stream),
            cell_sum: address(&self.cell_sum, stream),
        }
    }
}

impl Bins {
    fn new(device: &Device, points: usize, cells: usize) -> Result<Self, Error> {
        Ok(Self {
            cell: zeros(device, points)?,
            head: zeros(device, cells)?,
            next: zeros(device, points)?,
            first: zeros(device, cells)?,
            successor: zeros(device, points)?,
        })
    }

    fn view(&self, stream: &CudaStream) -> BinsView {
        BinsView {
            cell: address(&self.cell, stream),
            head: address(&self.head, stream),
            next: address(&self.next, stream),
            first: address(&self.first, stream),
            successor: address(&self.successor, stream),
        }
    }
}

/// CUDA has no empty memory: one entry stands for none.
pub(super) fn upload(device: &Device, values: &[f64]) -> Result<CudaSlice<f64>, Error> {
    device.upload(if values.is_empty() { &[0.0] } else { values })
}

fn zeros<T: DeviceRepr + ValidAsZeroBits>(
    device: &Device,
    len: usize,
) -> Result<CudaSlice<T>, Error> {
    device.zeros(len.max(1))
}

/// The arrays are never moved, so their addresses stay good.
pub(super) fn address<T>(slice: &CudaSlice<T>, stream: &CudaStream) -> u64 {
    slice.device_ptr(stream).0
}
