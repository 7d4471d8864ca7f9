//! The explicit MPM step on a GPU: the twin of `solver.rs` of the CPU.

use std::sync::Arc;

use cudarc::driver::{CudaEvent, CudaFunction, CudaSlice, CudaStream, LaunchConfig, PushKernelArg};
use gpu::{Argument, Device, How, argument};

use super::error::CudaError;
use super::frame::FrameCopy;
use super::material::CudaMaterial;
use super::memory::Memory;
use super::source::{SOURCE, defines};
use super::view::{DeviceView, NO_FAILURE, ledger, set_matrices, set_vectors};
use crate::{Error, Mat2, Numerics, Points, Scheme, Solver, Vec2};

/// Threads of a block, one for each point or 16 for each node.
const BLOCK: usize = 128;
/// Threads that work on one node (`LANES` of `p2g.cu`).
const LANES: usize = 16;
/// Threads of a sum over a ledger: a power of two.
pub(super) const SUM_THREADS: usize = 256;

/// All kernels are small, and the packings of the scene wait for them: they go before those of others.
const IN_A_ROW: How = How { early: true, urgent: true };
/// For a kernel that follows several others.
const AFTER_SEVERAL: How = How { early: false, urgent: true };

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
    view: DeviceView,
    scheme: Scheme,
    cell_average: bool,
    points: usize,
    nodes: usize,
    /// Steps made before the upload.
    first_step: usize,
    size: Vec2,
}

/// What a material has its kernels work on.
pub struct Queue<'a> {
    pub device: &'a Device,
    pub stream: &'a CudaStream,
    /// The step (s).
    pub dt: f64,
    /// Number of points.
    pub points: usize,
    /// Argument of kernels that include [`HEADER`](super::HEADER).
    pub view: &'a DeviceView,
    /// Velocity gradients of all points (1/s): xx, xy, yx, yy of each.
    pub velocity_gradient: &'a CudaSlice<f64>,
}

impl Queue<'_> {
    /// Queues a kernel with one thread a point, which begins with `point_of_thread`.
    ///
    /// # Errors
    /// The launch was refused.
    ///
    /// # Safety
    /// As [`Device::launch`].
    pub unsafe fn over_points(
        &self,
        kernel: &CudaFunction,
        arguments: &[Argument<'_>],
    ) -> Result<(), CudaError> {
        let config = threads(self.points);
        // SAFETY: the caller's.
        Ok(unsafe { self.device.launch(IN_A_ROW, self.stream, kernel, config, arguments) }?)
    }
}

struct Kernels {
    begin_step: CudaFunction,
    evaluate_basis: CudaFunction,
    sort_bins: CudaFunction,
    p2g: CudaFunction,
    p2g_mass_and_momentum: CudaFunction,
    p2g_internal_force: CudaFunction,
    p2g_velocity: CudaFunction,
    g2p: CudaFunction,
    velocity_gradient: CudaFunction,
    cell_push: CudaFunction,
    cell_sort: CudaFunction,
    cell_sums: CudaFunction,
    cell_average: CudaFunction,
    sum_ledger: CudaFunction,
}

impl Kernels {
    fn load(device: &Device, numerics: &Numerics) -> Result<Self, CudaError> {
        let module = device.module("mpm.cu", SOURCE, &defines(numerics))?;
        let function = |name: &str| module.load_function(name);
        Ok(Self {
            begin_step: function("begin_step")?,
            evaluate_basis: function("evaluate_basis")?,
            sort_bins: function("sort_bins")?,
            p2g: function("p2g")?,
            p2g_mass_and_momentum: function("p2g_mass_and_momentum")?,
            p2g_internal_force: function("p2g_internal_force")?,
            p2g_velocity: function("p2g_velocity")?,
            g2p: function("g2p")?,
            velocity_gradient: function("velocity_gradient")?,
            cell_push: function("cell_push")?,
            cell_sort: function("cell_sort")?,
            cell_sums: function("cell_sums")?,
            cell_average: function("cell_average")?,
            sum_ledger: function("sum_ledger")?,
        })
    }
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
        let view = memory.view(device.stream(), solver, (points.len(), mass), dt, step);
        let event = || device.context().new_event(None);
        let queued = Self {
            kernels: Kernels::load(device, numerics)?,
            beside: device.context().new_stream()?,
            from: event()?,
            until: event()?,
            frame: FrameCopy::new(device, &memory)?,
            memory,
            view,
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
        let kernels = &self.kernels;
        self.launch(AFTER_SEVERAL, self.device.stream(), &kernels.begin_step, one_warp())?;
        if self.scheme == Scheme::Usf {
            self.over_nodes(&kernels.p2g_mass_and_momentum)?;
            self.queue_velocity_gradient()?;
            self.queue_material(material)?;
            self.over_nodes(&kernels.p2g_internal_force)?;
            self.over_points(&kernels.g2p)?;
            return self.queue_bins(self.device.stream());
        }
        self.over_nodes(&kernels.p2g)?;
        self.over_points(&kernels.g2p)?;
        if self.scheme == Scheme::Musl {
            self.over_nodes(&kernels.p2g_velocity)?;
        }
        self.queue_velocity_gradient()?;
        // While the material is at work: points are where they will be in the next step.
        self.from.record(self.device.stream())?;
        self.beside.wait(&self.from)?;
        self.queue_bins(&self.beside)?;
        self.until.record(&self.beside)?;
        self.queue_material(material)?;
        Ok(self.device.stream().wait(&self.until)?)
    }

    /// What the next step begins with: basis functions at the points, and the points in bins.
    fn queue_bins(&self, stream: &CudaStream) -> Result<(), CudaError> {
        let Kernels { evaluate_basis, sort_bins, .. } = &self.kernels;
        self.launch(AFTER_SEVERAL, stream, evaluate_basis, threads(self.points))?;
        self.launch(IN_A_ROW, stream, sort_bins, threads(self.points))
    }

    fn queue_velocity_gradient(&self) -> Result<(), CudaError> {
        let kernels = &self.kernels;
        self.over_points(&kernels.velocity_gradient)?;
        if self.cell_average {
            self.over_points(&kernels.cell_push)?;
            self.over_points(&kernels.cell_sort)?;
            self.over_points(&kernels.cell_sums)?;
            self.over_points(&kernels.cell_average)?;
        }
        Ok(())
    }

    fn queue_material(&self, material: &mut dyn CudaMaterial) -> Result<(), CudaError> {
        material.queue_update(&Queue {
            device: &self.device,
            stream: self.device.stream(),
            dt: self.view.dt,
            points: self.points,
            view: &self.view,
            velocity_gradient: &self.memory.velocity_gradient,
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
        let clock = frame.clock.as_slice()?;
        let step = self.first_step + clock[0] as usize;
        if clock[1] != NO_FAILURE {
            let source = self.failure((clock[1] & 0xffff_ffff) as usize, material)?;
            return Err(CudaError::Step { step, source });
        }
        set_vectors(&mut points.position, frame.position.as_slice()?);
        set_vectors(&mut points.velocity, frame.velocity.as_slice()?);
        set_matrices(&mut points.affine, frame.affine_velocity.as_slice()?);
        set_matrices(&mut points.velocity_gradient, frame.velocity_gradient.as_slice()?);
        set_matrices(&mut points.stress, frame.stress.as_slice()?);
        points.volume.copy_from_slice(&frame.volume.as_slice()?[..self.points]);
        solver
            .set_ledger(ledger(frame.ledger.as_slice()?))
            .map_err(|source| CudaError::Step { step, source })
    }

    /// Why a point failed. It is where it was when it did.
    fn failure(&self, point: usize, material: &dyn CudaMaterial) -> Result<Error, CudaError> {
        let stream = self.device.stream();
        let row = |array: &CudaSlice<f64>, n: usize| {
            stream.clone_dtoh(&array.slice(n * point..n * point + n))
        };
        let memory = &self.memory;
        let position = Vec2::from_vec(row(&memory.position, 2)?);
        // `Fault` of `mpm.cuh`.
        Ok(match stream.clone_dtoh(&memory.fault.slice(point..=point))?[0] {
            1 => {
                let velocity = Vec2::from_vec(row(&memory.velocity, 2)?);
                Error::NotFinite { point, position, velocity }
            }
            2 => Error::OutsideDomain { point, position, size: self.size },
            3 => {
                let stress = Mat2::from_row_slice(&row(&memory.stress, 4)?);
                Error::Response { point, stress, volume: row(&memory.volume, 1)?[0] }
            }
            4 => material.failure(point)?.into(),
            inside => Error::InsideObstacle { point, position, obstacle: (inside - 5) as usize },
        })
    }

    fn over_points(&self, kernel: &CudaFunction) -> Result<(), CudaError> {
        self.launch(IN_A_ROW, self.device.stream(), kernel, threads(self.points))
    }

    fn over_nodes(&self, kernel: &CudaFunction) -> Result<(), CudaError> {
        self.launch(IN_A_ROW, self.device.stream(), kernel, threads(LANES * self.nodes))
    }

    fn launch(
        &self,
        how: How,
        stream: &CudaStream,
        kernel: &CudaFunction,
        config: LaunchConfig,
    ) -> Result<(), CudaError> {
        let arguments = [argument(&self.view)];
        // SAFETY: the kernels of the solver take its view, whose arrays live as long as it does.
        Ok(unsafe { self.device.launch(how, stream, kernel, config, &arguments) }?)
    }

    fn sum_ledger(&self, entries: &CudaSlice<f64>, slots: usize) -> Result<(), CudaError> {
        let (slots, total) = (slots as i32, &self.memory.ledger);
        let mut launch = self.device.stream().launch_builder(&self.kernels.sum_ledger);
        launch.arg(entries).arg(&slots).arg(total);
        // SAFETY: `entries` has as many rows of `slots` as `total` has entries, one block each.
        unsafe {
            launch.launch(LaunchConfig {
                grid_dim: (total.len() as u32, 1, 1),
                block_dim: (SUM_THREADS as u32, 1, 1),
                shared_mem_bytes: 0,
            })
        }?;
        Ok(())
    }
}

fn threads(count: usize) -> LaunchConfig {
    LaunchConfig {
        grid_dim: (count.div_ceil(BLOCK).max(1) as u32, 1, 1),
        block_dim: (BLOCK as u32, 1, 1),
        shared_mem_bytes: 0,
    }
}

fn one_warp() -> LaunchConfig {
    LaunchConfig { grid_dim: (1, 1, 1), block_dim: (32, 1, 1), shared_mem_bytes: 0 }
}
