//! The explicit MPM step on a GPU: the twin of `solver.rs` of the CPU.

use std::sync::Arc;

use cudarc::driver::{CudaEvent, CudaSlice, CudaStream, DeviceRepr};
use gpu::{Device, Function, Kernel, Launch, Pointer};

use super::abi::{Fault, Mpm, NO_FAILURE};
use super::bins::{EvaluateBasis, SortBins};
use super::budget::{SUM_THREADS, SumLedger};
use super::cell_average::{CellAverage, CellPush, CellSort, CellSums};
use super::density::CorrectDensity;
use super::error::CudaError;
use super::frame::FrameCopy;
use super::g2p::G2p;
use super::kernels::Kernels;
use super::ledger;
use super::material::CudaMaterial;
use super::memory::Memory;
use super::obstacle::BeginStep;
use super::p2g::{LANES, P2g, P2gInternalForce, P2gMassAndMomentum, P2gVelocity};
use super::queue::{Queue, each};
use super::velocity_gradient::VelocityGradient;
use crate::{Error, Points, Scheme, Solver, Vec2};

/// Points, background grid and time on a GPU: the twin of [`Solver`].
pub struct CudaSolver {
    device: Arc<Device>,
    kernels: Kernels,
    memory: Memory,
    /// Work beside that of the device's stream, from when until when.
    beside: Arc<CudaStream>,
    from: CudaEvent,
    until: CudaEvent,
    frame: FrameCopy,
    /// Argument of the kernels.
    mpm: Mpm,
    scheme: Scheme,
    cell_average: bool,
    points: usize,
    nodes: usize,
    /// Steps made before the upload.
    first_step: usize,
    size: Vec2,
}

impl CudaSolver {
    /// Copies points to a GPU, where steps of `dt` (s) advance them through the grid, walls and
    /// obstacles of `solver`. `step` of them are done; the time is `step * dt`.
    ///
    /// # Errors
    /// Points or a step that the CPU would refuse; too little memory; no compiler.
    pub fn new(
        device: &Arc<Device>,
        solver: &Solver,
        points: &Points,
        dt: f64,
        step: usize,
    ) -> Result<Self, CudaError> {
        let refused = |source| CudaError::Step { step, source };
        if !(dt.is_finite() && dt > 0.0) {
            return Err(refused(Error::Step(dt)));
        }
        let mass = points.check(&solver.shape).map_err(refused)?;
        let numerics = solver.numerics();
        let memory = Memory::new(device, solver, points)?;
        let mpm = memory.argument(device.stream(), solver, (points.len(), mass), dt, step);
        let event = || device.context().new_event(None);
        let queued = Self {
            kernels: Kernels::load(device, numerics)?,
            beside: device.context().new_stream()?,
            from: event()?,
            until: event()?,
            frame: FrameCopy::new(device, &memory)?,
            memory,
            mpm,
            scheme: numerics.scheme,
            cell_average: numerics.cell_average_volumetric,
            points: points.len(),
            nodes: solver.shape.columns * solver.shape.rows,
            first_step: step,
            size: solver.shape.size,
            device: device.clone(),
        };
        queued.queue_bins(device.stream())?;
        Ok(queued)
    }

    /// Queues one step on the stream of the [`Device`]. Does not wait; may be captured in a graph.
    ///
    /// A point that fails stops the run: from the next step on nothing moves. See
    /// [`fetch`](Self::fetch).
    ///
    /// # Errors
    /// A launch was refused.
    pub fn queue_step(&self, material: &mut dyn CudaMaterial) -> Result<(), CudaError> {
        let (kernels, m, stream) = (&self.kernels, self.mpm, self.device.stream());
        // SAFETY: a warp, the arrays of the solver.
        unsafe {
            kernels.begin_step.launch(stream, Launch::blocks(1, 32).urgent(), &BeginStep { m })
        }?;
        if self.scheme == Scheme::Usf {
            self.over_nodes(&kernels.p2g_mass_and_momentum, &P2gMassAndMomentum { m })?;
            self.queue_velocity_gradient()?;
            self.queue_material(material)?;
            self.over_nodes(&kernels.p2g_internal_force, &P2gInternalForce { m })?;
            self.over_points(&kernels.g2p, &G2p { m })?;
            return self.queue_bins(stream);
        }
        self.over_nodes(&kernels.p2g, &P2g { m })?;
        self.over_points(&kernels.g2p, &G2p { m })?;
        if self.scheme == Scheme::Musl {
            self.over_nodes(&kernels.p2g_velocity, &P2gVelocity { m })?;
        }
        self.queue_velocity_gradient()?;
        // While the material is at work: points are where they will be in the next step.
        self.from.record(stream)?;
        self.beside.wait(&self.from)?;
        self.queue_bins(&self.beside)?;
        self.until.record(&self.beside)?;
        self.queue_material(material)?;
        Ok(stream.wait(&self.until)?)
    }

    /// Prepares the next step: basis functions at the points, and the points in bins.
    fn queue_bins(&self, stream: &CudaStream) -> Result<(), CudaError> {
        let (Kernels { evaluate_basis, sort_bins, .. }, m) = (&self.kernels, self.mpm);
        let points = each(self.points);
        // SAFETY: a thread a point, the arrays of the solver. The first follows several kernels.
        unsafe {
            evaluate_basis.launch(stream, points.early(false), &EvaluateBasis { m })?;
            sort_bins.launch(stream, points, &SortBins { m })?;
        }
        Ok(())
    }

    fn queue_velocity_gradient(&self) -> Result<(), CudaError> {
        let (kernels, m) = (&self.kernels, self.mpm);
        self.over_points(&kernels.velocity_gradient, &VelocityGradient { m })?;
        if self.cell_average {
            self.over_points(&kernels.cell_push, &CellPush { m })?;
            self.over_points(&kernels.cell_sort, &CellSort { m })?;
            self.over_points(&kernels.cell_sums, &CellSums { m })?;
            self.over_points(&kernels.cell_average, &CellAverage { m })?;
        }
        if m.density_rate > 0.0 {
            self.over_points(&kernels.correct_density, &CorrectDensity { m })?;
        }
        Ok(())
    }

    fn queue_material(&self, material: &mut dyn CudaMaterial) -> Result<(), CudaError> {
        material.queue_update(&Queue {
            stream: self.device.stream(),
            dt: self.mpm.dt,
            points: self.points,
            mpm: &self.mpm,
            velocity_gradient: self.memory.velocity_gradients(),
        })
    }

    /// Waits for all queued steps and copies points, and what contacts have done, back to the CPU.
    ///
    /// # Errors
    /// As [`fetched`](Self::fetched).
    pub fn fetch(
        &mut self,
        points: &mut Points,
        solver: &mut Solver,
        material: &dyn CudaMaterial,
    ) -> Result<(), CudaError> {
        self.queue_fetch()?;
        self.device.stream().synchronize()?;
        self.fetched(points, solver, material)
    }

    /// Queues copies of the points, and of what contacts have done, as they are after the steps
    /// queued so far. [`fetched`](Self::fetched) takes them.
    ///
    /// # Errors
    /// A failure of the device.
    pub fn queue_fetch(&mut self) -> Result<(), CudaError> {
        let Memory { node_ledger, point_ledger, .. } = &self.memory;
        self.sum_ledger(node_ledger, self.nodes)?;
        self.sum_ledger(point_ledger, self.points)?;
        Ok(self.frame.queue(self.device.stream(), &self.memory)?)
    }

    /// Takes the copies. The caller has waited for the stream after [`queue_fetch`](Self::queue_fetch);
    /// steps queued since then may go on.
    ///
    /// # Errors
    /// The failure of the first step that failed, in the words of the CPU; nothing is taken then.
    pub fn fetched(
        &self,
        points: &mut Points,
        solver: &mut Solver,
        material: &dyn CudaMaterial,
    ) -> Result<(), CudaError> {
        let frame = &self.frame;
        let clock = frame.clock.as_slice()?[0];
        let step = self.first_step + clock.step as usize;
        if clock.failure != NO_FAILURE {
            let source = self.failure((clock.failure & 0xffff_ffff) as usize, material)?;
            return Err(CudaError::Step { step, source });
        }
        copy(&mut points.position, frame.position.as_slice()?);
        copy(&mut points.velocity, frame.velocity.as_slice()?);
        copy(&mut points.affine, frame.affine_velocity.as_slice()?);
        copy(&mut points.velocity_gradient, frame.velocity_gradient.as_slice()?);
        copy(&mut points.stress, frame.stress.as_slice()?);
        points.volume.copy_from_slice(&frame.volume.as_slice()?[..self.points]);
        solver
            .set_ledger(ledger::from_flat(frame.ledger.as_slice()?))
            .map_err(|source| CudaError::Step { step, source })
    }

    /// Why a point failed. It is where it was when it did.
    fn failure(&self, point: usize, material: &dyn CudaMaterial) -> Result<Error, CudaError> {
        let memory = &self.memory;
        let position = self.entry(&memory.position, point)?.into();
        Ok(match self.entry(&memory.fault, point)? {
            Fault::NOT_FINITE => {
                let velocity = self.entry(&memory.velocity, point)?.into();
                Error::NotFinite { point, position, velocity }
            }
            Fault::OUTSIDE_DOMAIN => Error::OutsideDomain { point, position, size: self.size },
            Fault::BAD_RESPONSE => {
                let stress = self.entry(&memory.stress, point)?.into();
                Error::Response { point, stress, volume: self.entry(&memory.volume, point)? }
            }
            Fault::MATERIAL => material.failure(point)?.into(),
            fault => {
                let obstacle = (fault - Fault::INSIDE_OBSTACLE) as usize;
                Error::InsideObstacle { point, position, obstacle }
            }
        })
    }

    /// One entry of an array.
    fn entry<T: DeviceRepr + Copy>(
        &self,
        array: &CudaSlice<T>,
        index: usize,
    ) -> Result<T, CudaError> {
        Ok(self.device.stream().clone_dtoh(&array.slice(index..=index))?[0])
    }

    fn over_points<K: Kernel>(&self, kernel: &Function<K>, arguments: &K) -> Result<(), CudaError> {
        // SAFETY: a thread a point, the arrays of the solver.
        Ok(unsafe { kernel.launch(self.device.stream(), each(self.points), arguments) }?)
    }

    fn over_nodes<K: Kernel>(&self, kernel: &Function<K>, arguments: &K) -> Result<(), CudaError> {
        // SAFETY: `LANES` threads a node, the arrays of the solver.
        Ok(unsafe { kernel.launch(self.device.stream(), each(LANES * self.nodes), arguments) }?)
    }

    fn sum_ledger(&self, entries: &CudaSlice<f64>, slots: usize) -> Result<(), CudaError> {
        let (stream, total) = (self.device.stream(), &self.memory.ledger);
        let launch = Launch::blocks(total.len() as u32, SUM_THREADS);
        let arguments = SumLedger {
            ledger: Pointer::to(entries, stream),
            slots: slots as i32,
            total: Pointer::to(total, stream),
        };
        // SAFETY: `entries` has as many rows of `slots` as `total` has entries, one block each.
        Ok(unsafe { self.kernels.sum_ledger.launch(stream, launch, &arguments) }?)
    }
}

/// Copies as many entries as there are points: the GPU has one even without points.
fn copy<A: Copy + Into<B>, B>(to: &mut [B], from: &[A]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = (*from).into());
}
