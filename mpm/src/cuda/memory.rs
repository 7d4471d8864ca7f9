//! Points, grid and obstacles in device memory.

use cudarc::driver::{CudaSlice, CudaStream, CudaView, DeviceRepr, ValidAsZeroBits};
use gpu::{ConstPointer, Device, Error, Pointer};

use super::abi::{
    self, Approach, Clock, Matrix, Mpm, NO_FAILURE, Obstacle, Phase, Placed, Vector, frictions,
    stencil_bytes,
};
use super::ledger;
use crate::{Points, Scheme, Solver};

/// The arrays of [`Mpm`].
pub(super) struct Memory {
    pub clock: CudaSlice<Clock>,
    obstacle: CudaSlice<Obstacle>,
    placed: CudaSlice<Placed>,
    pub position: CudaSlice<Vector>,
    pub velocity: CudaSlice<Vector>,
    pub affine_velocity: CudaSlice<Matrix>,
    mass: CudaSlice<f64>,
    pub volume: CudaSlice<f64>,
    pub velocity_gradient: CudaSlice<Matrix>,
    pub stress: CudaSlice<Matrix>,
    /// Bytes of `Stencil`s.
    stencil: CudaSlice<u8>,
    pub fault: CudaSlice<i32>,
    node_mass: CudaSlice<f64>,
    node_area: CudaSlice<f64>,
    node_momentum: CudaSlice<Vector>,
    node_old_velocity: CudaSlice<Vector>,
    node_velocity: CudaSlice<Vector>,
    node_approach: CudaSlice<Approach>,
    pub node_ledger: CudaSlice<f64>,
    pub point_ledger: CudaSlice<f64>,
    /// Impulses and work of contacts since the start, in the order of the ledgers of nodes and points.
    pub ledger: CudaSlice<f64>,
    bins: Bins,
    cell_bins: Bins,
    cell_sum: CudaSlice<Vector>,
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
        // Arrays of the cell average are empty without it.
        let averaged = if numerics.cell_average_volumetric { 1 } else { 0 };
        let cells = averaged * shape.cells[0] * shape.cells[1];
        let ledger = ledger::flat(solver.ledger());
        Ok(Self {
            clock: device.upload(&[Clock { step: 0, failure: NO_FAILURE, running: 1 }])?,
            obstacle: upload(device, &converted(&solver.obstacles))?,
            placed: zeros(device, 2 * solver.obstacles.len())?,
            position: upload(device, &converted(&points.position))?,
            velocity: upload(device, &converted(&points.velocity))?,
            affine_velocity: upload(device, &converted(&points.affine))?,
            mass: upload(device, &points.mass)?,
            volume: upload(device, &points.volume)?,
            velocity_gradient: upload(device, &converted(&points.velocity_gradient))?,
            stress: upload(device, &converted(&points.stress))?,
            stencil: zeros(device, n * stencil_bytes(numerics.basis.width()))?,
            fault: zeros(device, n)?,
            node_mass: zeros(device, nodes)?,
            node_area: upload(device, &solver.node_areas)?,
            node_momentum: zeros(device, nodes)?,
            node_old_velocity: zeros(device, nodes)?,
            node_velocity: zeros(device, nodes)?,
            node_approach: zeros(device, nodes)?,
            node_ledger: zeros(device, ledger.len() * nodes)?,
            point_ledger: zeros(device, ledger.len() * n)?,
            ledger: upload(device, &ledger)?,
            bins: Bins::new(device, n, nodes)?,
            cell_bins: Bins::new(device, averaged * n, cells)?,
            cell_sum: zeros(device, cells)?,
        })
    }

    /// The argument of kernels that advance points of this total `mass` (kg/m) by steps of `dt`
    /// (s), of which `first_step` are done.
    pub fn argument(
        &self,
        stream: &CudaStream,
        solver: &Solver,
        (points, mass): (usize, f64),
        dt: f64,
        first_step: usize,
    ) -> Mpm {
        let (shape, numerics) = (&solver.shape, solver.numerics());
        Mpm {
            cell: shape.cell,
            width: shape.size.x,
            height: shape.size.y,
            dt,
            gravity_x: solver.gravity().x,
            gravity_y: solver.gravity().y,
            cutoff: numerics.cutoff(mass, points),
            pic_share: numerics.transfer.pic_share(dt),
            density_rate: numerics.density_correction,
            shock_width: numerics.shock_width * shape.cell,
            friction: frictions(&solver.domain().walls),
            first_step: first_step as u64,
            columns: shape.columns as i32,
            rows: shape.rows as i32,
            cells_x: shape.cells[0] as i32,
            cells_y: shape.cells[1] as i32,
            points: points as i32,
            obstacles: solver.obstacles.len() as i32,
            affine: i32::from(numerics.transfer.affine()),
            stress_phase: match numerics.scheme {
                Scheme::Usf => Phase::STRESS_FIRST,
                Scheme::Musl | Scheme::Usl => Phase::STRESS_LAST,
            },
            clock: Pointer::to(&self.clock, stream),
            obstacle: ConstPointer::to(&self.obstacle, stream),
            placed: Pointer::to(&self.placed, stream),
            position: Pointer::to(&self.position, stream),
            velocity: Pointer::to(&self.velocity, stream),
            affine_velocity: Pointer::to(&self.affine_velocity, stream),
            mass: ConstPointer::to(&self.mass, stream),
            volume: Pointer::to(&self.volume, stream),
            velocity_gradient: Pointer::to(&self.velocity_gradient, stream),
            stress: Pointer::to(&self.stress, stream),
            stencil: Pointer::to(&self.stencil, stream).cast(),
            fault: Pointer::to(&self.fault, stream),
            node_mass: Pointer::to(&self.node_mass, stream),
            node_area: ConstPointer::to(&self.node_area, stream),
            node_momentum: Pointer::to(&self.node_momentum, stream),
            node_old_velocity: Pointer::to(&self.node_old_velocity, stream),
            node_velocity: Pointer::to(&self.node_velocity, stream),
            node_approach: Pointer::to(&self.node_approach, stream),
            node_ledger: Pointer::to(&self.node_ledger, stream),
            point_ledger: Pointer::to(&self.point_ledger, stream),
            bins: self.bins.pointers(stream),
            cells: self.cell_bins.pointers(stream),
            cell_sum: Pointer::to(&self.cell_sum, stream),
        }
    }
}

impl Memory {
    /// Velocity gradients of the points, as rows of four numbers.
    pub fn velocity_gradients(&self) -> CudaView<'_, f64> {
        let numbers = 4 * self.velocity_gradient.len();
        // SAFETY: a `Matrix` is four `f64`.
        unsafe { self.velocity_gradient.transmute(numbers) }.expect("as long as the matrices")
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

    fn pointers(&self, stream: &CudaStream) -> abi::Bins {
        abi::Bins {
            cell: Pointer::to(&self.cell, stream),
            head: Pointer::to(&self.head, stream),
            next: Pointer::to(&self.next, stream),
            first: Pointer::to(&self.first, stream),
            successor: Pointer::to(&self.successor, stream),
        }
    }
}

/// Values of the CPU's solver as values of the kernels.
fn converted<'a, A, B: From<&'a A>>(values: &'a [A]) -> Vec<B> {
    values.iter().map(B::from).collect()
}

/// CUDA has no empty memory: one entry stands for none.
pub(super) fn upload<T: DeviceRepr + Default>(
    device: &Device,
    values: &[T],
) -> Result<CudaSlice<T>, Error> {
    let none = [T::default()];
    device.upload(if values.is_empty() { &none } else { values })
}

fn zeros<T: DeviceRepr + ValidAsZeroBits>(
    device: &Device,
    len: usize,
) -> Result<CudaSlice<T>, Error> {
    device.zeros(len.max(1))
}
