//! A batch of RVEs that lives on a GPU. The kernel is `rve.cu` and the files it is put together from.

use std::sync::Arc;

use cudarc::driver::sys::CUfunction_attribute;
use cudarc::driver::{
    CudaFunction, CudaSlice, CudaStream, DevicePtr, DeviceRepr, LaunchConfig, sys,
};
use gpu::{Device, How, argument};
use nalgebra::Matrix2;

use super::error::{CudaError, RveFailure};
use super::real::CudaReal;
use super::shape::{Room, Shape};
use super::state::{Header, HostState, State};
use crate::batch::RveBatch;
use crate::error::Failure;
use crate::parameters::RveParameters;
use crate::real::Real;
use crate::rve::{RveState, Substepping};

/// Joins sources, so that the compiler's messages name the file and line.
macro_rules! sources {
    ($($file:literal),*) => {
        concat!($("#line 1 \"", $file, "\"\n", include_str!($file)),*)
    };
}

/// The source of the kernel.
pub const RVE_SOURCE: &str = sources!(
    "batch.cuh",
    "queue.cuh",
    "copies.cuh",
    "shared.cuh",
    "cell.cuh",
    "position.cuh",
    "macro_step.cuh",
    "neighbours.cuh",
    "list.cuh",
    "substeps.cuh",
    "rve.cu"
);

/// Narrowest Verlet skin, that of an RVE nearly at rest, as a fraction of the widest.
const LEAST_SKIN: f64 = 0.1;

/// RVEs of equal parameters on a GPU: the twin of [`RveBatch`].
///
/// State stays on the device between macro steps. On one device the result of an RVE is
/// reproducible bit by bit and depends neither on the others nor on a download and upload in
/// between.
#[derive(Debug)]
pub struct CudaRveBatch<R: CudaReal> {
    device: Arc<Device>,
    kernel: CudaFunction,
    parameters: RveParameters,
    shape: Shape,
    rves: usize,
    header: CudaSlice<Header>,
    state: CudaSlice<State>,
    position: CudaSlice<[R::Fraction; 2]>,
    motion: CudaSlice<[R; 4]>,
    reference: CudaSlice<[R::Fraction; 2]>,
    seated: CudaSlice<u16>,
    rows: CudaSlice<[u16; 4]>,
    neighbour: CudaSlice<u32>,
    pair: CudaSlice<[R; 2]>,
    tangential: CudaSlice<R>,
    incoming: CudaSlice<u16>,
    disc: CudaSlice<[R; 4]>,
    velocity_gradient: CudaSlice<f64>,
    failed: CudaSlice<i32>,
    turn: CudaSlice<[u32; 2]>,
    queue: CudaSlice<u32>,
}

/// What a kernel takes of a multiprocessor.
#[derive(Clone, Copy, Debug)]
pub struct KernelResources {
    pub threads: usize,
    pub registers: usize,
    /// Local memory of a thread (bytes): arrays of the rare search, and spilled registers.
    pub local_bytes: usize,
    /// Shared memory of a block (bytes).
    pub shared_bytes: usize,
    /// Blocks (RVEs) at a time on one multiprocessor.
    pub blocks: usize,
}

impl<R: CudaReal> CudaRveBatch<R> {
    /// Copies a batch to the GPU.
    ///
    /// # Errors
    /// RVEs of different numbers of discs, or of more than fit; too little memory; no compiler.
    pub fn upload(device: &Arc<Device>, batch: &RveBatch<R>) -> Result<Self, CudaError> {
        Self::upload_with_room(device, batch, Room::Usual)
    }

    /// As [`upload`](Self::upload), with room for the lists of neighbours. Results do not depend on it.
    ///
    /// # Errors
    /// As [`upload`](Self::upload).
    pub fn upload_with_room(
        device: &Arc<Device>,
        batch: &RveBatch<R>,
        room: Room,
    ) -> Result<Self, CudaError> {
        let discs = batch.fresh.discs.len();
        let rves = batch.rves.len();
        let shape = Shape::new::<R>(&batch.parameters, discs, device.limits()?, room)?;
        let host = HostState::from_batch(batch, &shape)?;
        device.reserve(HostState::<R>::bytes(&shape, rves))?;
        Ok(Self {
            kernel: load(device, &shape)?,
            parameters: batch.parameters.clone(),
            shape,
            rves,
            state: device.upload(&vec![State::default(); rves])?,
            header: device.upload(&host.header)?,
            position: device.upload(&host.position)?,
            motion: device.upload(&host.motion)?,
            reference: device.upload(&host.reference)?,
            seated: device.upload(&host.seated)?,
            rows: device.upload(&host.rows)?,
            neighbour: device.upload(&host.neighbour)?,
            pair: device.upload(&host.pair)?,
            tangential: device.upload(&host.tangential)?,
            incoming: device.upload(&host.incoming)?,
            disc: device.upload(&host.disc)?,
            velocity_gradient: device.zeros(4 * rves)?,
            failed: device.upload(&[i32::MAX])?,
            turn: device.upload(&(0..rves as u32).map(|k| [k, k]).collect::<Vec<_>>())?,
            queue: device.zeros(4)?,
            device: device.clone(),
        })
    }

    /// Copies the batch back, after all queued work.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn download(&self) -> Result<RveBatch<R>, CudaError> {
        let stream = self.device.stream();
        let mut host = HostState {
            header: stream.clone_dtoh(&self.header)?,
            position: stream.clone_dtoh(&self.position)?,
            motion: stream.clone_dtoh(&self.motion)?,
            reference: stream.clone_dtoh(&self.reference)?,
            seated: stream.clone_dtoh(&self.seated)?,
            rows: stream.clone_dtoh(&self.rows)?,
            neighbour: stream.clone_dtoh(&self.neighbour)?,
            pair: stream.clone_dtoh(&self.pair)?,
            tangential: stream.clone_dtoh(&self.tangential)?,
            incoming: stream.clone_dtoh(&self.incoming)?,
            disc: stream.clone_dtoh(&self.disc)?,
        };
        Ok(host.make_batch(&self.parameters, &self.shape))
    }

    pub fn len(&self) -> usize {
        self.rves
    }

    pub fn is_empty(&self) -> bool {
        self.rves == 0
    }

    /// State of each RVE after the last launch.
    pub fn device_states(&self) -> &CudaSlice<State> {
        &self.state
    }

    /// The lowest index of an RVE that failed so far; larger than all indices while none has.
    pub fn failed(&self) -> &CudaSlice<i32> {
        &self.failed
    }

    /// Queues one macro step of `dt` (s) under the velocity gradients (1/s; xx, xy, yx, yy of each
    /// RVE) found in device memory when the step runs. Does not wait; may be captured in a graph.
    /// The other methods see the step done if `stream` is that of the [`Device`].
    ///
    /// An RVE that fails stands still from then on; see [`check`](Self::check).
    ///
    /// # Errors
    /// The launch was refused.
    pub fn launch(
        &mut self,
        stream: &CudaStream,
        dt: f64,
        velocity_gradient: &impl DevicePtr<f64>,
    ) -> Result<(), CudaError> {
        let (gradient, _synchronised) = velocity_gradient.device_ptr(stream);
        self.launch_at(stream, dt, gradient)
    }

    fn launch_at(
        &self,
        stream: &CudaStream,
        dt: f64,
        gradient: sys::CUdeviceptr,
    ) -> Result<(), CudaError> {
        if self.rves == 0 {
            return Ok(());
        }
        let arrays = Arrays {
            header: address(&self.header, stream),
            state: address(&self.state, stream),
            position: address(&self.position, stream),
            motion: address(&self.motion, stream),
            reference: address(&self.reference, stream),
            seated: address(&self.seated, stream),
            rows: address(&self.rows, stream),
            neighbour: address(&self.neighbour, stream),
            pair: address(&self.pair, stream),
            tangential: address(&self.tangential, stream),
            incoming: address(&self.incoming, stream),
            disc: address(&self.disc, stream),
            failed: address(&self.failed, stream),
            turn: address(&self.turn, stream),
            queue: address(&self.queue, stream),
        };
        let parameters = Parameters::<R>::new(&self.parameters, dt, self.rves);
        let config = LaunchConfig {
            grid_dim: (self.rves as u32, 1, 1),
            block_dim: (self.shape.threads as u32, 1, 1),
            shared_mem_bytes: self.shape.shared_bytes as u32,
        };
        let arguments = [argument(&arrays), argument(&parameters), argument(&gradient)];
        // SAFETY: the argument types are laid out as those of `rve_advance`, the arrays as long as
        // it expects, and the gradients by the caller's slice.
        let how = How { early: true, urgent: false };
        Ok(unsafe { self.device.launch(how, stream, &self.kernel, config, &arguments) }?)
    }

    /// Advances RVE `p` by `dt` (s) under `velocity_gradient[p]` (1/s) into `states[p]` and waits:
    /// as [`RveBatch::advance`].
    ///
    /// # Errors
    /// The RVE of lowest index that failed.
    pub fn advance(
        &mut self,
        dt: f64,
        velocity_gradient: &[Matrix2<f64>],
        states: &mut [RveState],
    ) -> Result<(), CudaError> {
        let row_major: Vec<f64> = velocity_gradient
            .iter()
            .flat_map(|l| [l[(0, 0)], l[(0, 1)], l[(1, 0)], l[(1, 1)]])
            .collect();
        let stream = self.device.stream().clone();
        stream.memcpy_htod(&row_major, &mut self.velocity_gradient)?;
        let gradient = address(&self.velocity_gradient, &stream);
        self.launch_at(&stream, dt, gradient)?;
        self.check()?;
        for (state, new) in states.iter_mut().zip(self.states()?) {
            *state = new;
        }
        Ok(())
    }

    /// States after the last macro step, once it is done.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn states(&self) -> Result<Vec<RveState>, CudaError> {
        let states = self.device.stream().clone_dtoh(&self.state)?;
        Ok(states.into_iter().map(RveState::from).collect())
    }

    /// Waits for all queued macro steps and reports the RVE of lowest index that failed in one.
    ///
    /// # Errors
    /// That failure, or one of a kernel.
    pub fn check(&self) -> Result<(), CudaError> {
        let stream = self.device.stream();
        let failed = stream.clone_dtoh(&self.failed)?[0];
        let Ok(rve) = usize::try_from(failed) else { return Ok(()) };
        if rve >= self.rves { Ok(()) } else { Err(self.failure(rve)?) }
    }

    /// Why and when an RVE failed that [`failed`](Self::failed) names, once queued work is done.
    ///
    /// # Errors
    /// A failure of the device.
    pub fn failure(&self, rve: usize) -> Result<CudaError, CudaError> {
        let stream = self.device.stream();
        let header = stream.clone_dtoh(&self.header.slice(rve..=rve))?[0];
        let overlap = stream.clone_dtoh(&self.state.slice(rve..=rve))?[0].relative_overlap;
        // `Status` of `batch.cuh`.
        let failure = match header.status {
            2 => RveFailure::Packing(Failure::Overlap(overlap)),
            3 => RveFailure::ListFull { rows: self.shape.rows },
            4 => RveFailure::SlotsFull { slots: self.shape.slots },
            _ => RveFailure::Packing(Failure::NotFinite),
        };
        Ok(CudaError::Rve { rve, step: header.steps as usize, failure })
    }

    /// What the kernel takes of a multiprocessor.
    ///
    /// # Errors
    /// The driver refuses to tell.
    pub fn resources(&self) -> Result<KernelResources, CudaError> {
        let count = |n: i32| usize::try_from(n).unwrap_or(0);
        let blocks = self.kernel.occupancy_max_active_blocks_per_multiprocessor(
            self.shape.threads as u32,
            self.shape.shared_bytes,
            None,
        )?;
        Ok(KernelResources {
            threads: self.shape.threads,
            registers: count(self.kernel.num_regs()?),
            local_bytes: count(self.kernel.local_size_bytes()?),
            shared_bytes: self.shape.shared_bytes,
            blocks: blocks as usize,
        })
    }
}

fn load(device: &Device, shape: &Shape) -> Result<CudaFunction, CudaError> {
    let kernel =
        device.module("rve.cu", RVE_SOURCE, &shape.defines())?.load_function("rve_advance")?;
    kernel.set_attribute(
        CUfunction_attribute::CU_FUNC_ATTRIBUTE_MAX_DYNAMIC_SHARED_SIZE_BYTES,
        shape.shared_bytes as i32,
    )?;
    Ok(kernel)
}

fn address<T>(slice: &CudaSlice<T>, stream: &CudaStream) -> sys::CUdeviceptr {
    slice.device_ptr(stream).0
}

/// `Batch` of `batch.cuh`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrays {
    pub header: u64,
    pub state: u64,
    pub position: u64,
    pub motion: u64,
    pub reference: u64,
    pub seated: u64,
    pub rows: u64,
    pub neighbour: u64,
    pub pair: u64,
    pub tangential: u64,
    pub incoming: u64,
    pub disc: u64,
    pub failed: u64,
    pub turn: u64,
    pub queue: u64,
}

// SAFETY: device addresses, in the order of `batch.cuh`.
unsafe impl DeviceRepr for Arrays {}

/// `Parameters` of `batch.cuh`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameters<R> {
    dt: f64,
    stress_weight: f64,
    least_skin: f64,
    skin: f64,
    free_solid_fraction: f64,
    thin_width: f64,
    overlap_limit: f64,
    step: R,
    normal_stiffness: R,
    spring: R,
    dashpot: R,
    friction: R,
    local_damping: R,
    rves: u32,
    substeps: u32,
    samples: u32,
    kinetic: u32,
}

// SAFETY: plain numbers without padding, laid out as in `batch.cuh`.
unsafe impl<R: CudaReal> DeviceRepr for Parameters<R> {}

impl<R: Real> Parameters<R> {
    pub fn new(p: &RveParameters, dt: f64, rves: usize) -> Self {
        let sub = Substepping::<R>::new(p, dt);
        let skin = p.skin * p.radius_max;
        Self {
            dt: sub.dt,
            stress_weight: 1.0 / (p.thickness * sub.samples as f64),
            least_skin: LEAST_SKIN * skin,
            skin,
            free_solid_fraction: p.free_solid_fraction,
            thin_width: p.thin_width * p.mean_diameter(),
            overlap_limit: p.overlap_limit,
            step: sub.law.dt,
            normal_stiffness: sub.law.normal_stiffness,
            spring: sub.law.tangential_stiffness * sub.law.dt,
            dashpot: R::from_f64(2.0) * sub.law.damping_ratio,
            friction: sub.law.friction,
            local_damping: sub.law.local_damping,
            rves: rves as u32,
            substeps: sub.substeps as u32,
            samples: sub.samples as u32,
            kinetic: u32::from(p.kinetic_stress),
        }
    }
}
