//! A batch of RVEs in device memory.

use std::sync::Arc;

use cudarc::driver::{CudaSlice, CudaStream, DevicePtr};
use gpu::{ConstPointer, Device, Function, Launch, Pointer};
use nalgebra::Matrix2;

use super::abi::{
    Batch, Disc, Header, Motion, Parameters, Position, Queue, Rows, State, Status, Tensor, Turn,
    Vector,
};
use super::arrays::Arrays;
use super::error::{CudaError, RveFailure};
use super::real::CudaReal;
use super::rve::{RveAdvance, load};
use super::shape::{Room, Shape};
use crate::batch::RveBatch;
use crate::error::Failure;
use crate::parameters::RveParameters;
use crate::state::RveState;

/// RVEs of equal parameters on a GPU: the twin of [`RveBatch`].
///
/// State stays on the device between macro steps. On one device the result of an RVE is
/// reproducible bit by bit and depends neither on the others nor on a download and upload in
/// between.
#[derive(Debug)]
pub struct CudaRveBatch<R: CudaReal> {
    device: Arc<Device>,
    kernel: Function<RveAdvance<R>>,
    parameters: RveParameters,
    shape: Shape,
    rves: usize,
    header: CudaSlice<Header>,
    state: CudaSlice<State>,
    position: CudaSlice<Position<R>>,
    motion: CudaSlice<Motion<R>>,
    reference: CudaSlice<Position<R>>,
    seated: CudaSlice<u16>,
    rows: CudaSlice<Rows>,
    neighbour: CudaSlice<u32>,
    pair: CudaSlice<Vector<R>>,
    spring: CudaSlice<R>,
    incoming: CudaSlice<u16>,
    disc: CudaSlice<Disc<R>>,
    /// Parameters of each RVE, if they are unequal.
    each: CudaSlice<Parameters<R>>,
    velocity_gradient: CudaSlice<Tensor>,
    failed: CudaSlice<i32>,
    turn: CudaSlice<Turn>,
    queue: CudaSlice<Queue>,
}

/// Resources that the kernel takes.
#[derive(Clone, Copy, Debug)]
pub struct KernelResources {
    /// Threads of a block.
    pub threads: usize,
    /// Registers of a thread.
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
        let discs = batch.fresh[0].discs.len();
        let shape = Shape::new::<R>(&batch.parameters, discs, device.limits()?, room)?;
        Self::upload_with_shape(device, batch, shape)
    }

    /// As [`upload`](Self::upload), of RVEs that have parameters of their own: [`advance_each`](Self::advance_each)
    /// takes them, and the parameters of the batch only tell the room for lists and whether contacts resist rolling.
    pub(super) fn upload_unequal(
        device: &Arc<Device>,
        batch: &RveBatch<R>,
    ) -> Result<Self, CudaError> {
        let discs = batch.fresh[0].discs.len();
        let shape = Shape::unequal::<R>(&batch.parameters, discs, device.limits()?)?;
        Self::upload_with_shape(device, batch, shape)
    }

    fn upload_with_shape(
        device: &Arc<Device>,
        batch: &RveBatch<R>,
        shape: Shape,
    ) -> Result<Self, CudaError> {
        let rves = batch.rves.len();
        let host = Arrays::from_batch(batch, &shape)?;
        device.reserve(Arrays::<R>::bytes(&shape, rves + batch.fresh.len()))?;
        let turns: Vec<Turn> = (0..rves as u32).map(|k| Turn { even: k, odd: k }).collect();
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
            spring: device.upload(&host.spring)?,
            incoming: device.upload(&host.incoming)?,
            disc: device.upload(&host.disc)?,
            each: device.zeros(if shape.unequal { rves } else { 1 })?,
            velocity_gradient: device.zeros(rves)?,
            failed: device.upload(&[i32::MAX])?,
            turn: device.upload(&turns)?,
            queue: device.zeros(1)?,
            device: device.clone(),
        })
    }

    /// Copies the batch back, after all queued work.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn download(&self) -> Result<RveBatch<R>, CudaError> {
        let stream = self.device.stream();
        let mut host = Arrays {
            header: stream.clone_dtoh(&self.header)?,
            position: stream.clone_dtoh(&self.position)?,
            motion: stream.clone_dtoh(&self.motion)?,
            reference: stream.clone_dtoh(&self.reference)?,
            seated: stream.clone_dtoh(&self.seated)?,
            rows: stream.clone_dtoh(&self.rows)?,
            neighbour: stream.clone_dtoh(&self.neighbour)?,
            pair: stream.clone_dtoh(&self.pair)?,
            spring: stream.clone_dtoh(&self.spring)?,
            incoming: stream.clone_dtoh(&self.incoming)?,
            disc: stream.clone_dtoh(&self.disc)?,
        };
        Ok(host.make_batch(&self.parameters, &self.shape, self.rves))
    }

    /// Number of RVEs.
    pub fn len(&self) -> usize {
        self.rves
    }

    /// Whether there are no RVEs.
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
        let gradient = ConstPointer::to(velocity_gradient, stream).cast();
        self.launch_at(stream, dt, gradient)
    }

    fn launch_at(
        &self,
        stream: &CudaStream,
        dt: f64,
        velocity_gradient: ConstPointer<Tensor>,
    ) -> Result<(), CudaError> {
        if self.rves == 0 {
            return Ok(());
        }
        let batch = Batch {
            header: Pointer::to(&self.header, stream),
            state: Pointer::to(&self.state, stream),
            position: Pointer::to(&self.position, stream),
            motion: Pointer::to(&self.motion, stream),
            reference: Pointer::to(&self.reference, stream),
            seated: Pointer::to(&self.seated, stream),
            rows: Pointer::to(&self.rows, stream),
            neighbour: Pointer::to(&self.neighbour, stream),
            pair: Pointer::to(&self.pair, stream),
            spring: Pointer::to(&self.spring, stream),
            incoming: Pointer::to(&self.incoming, stream),
            disc: ConstPointer::to(&self.disc, stream),
            failed: Pointer::to(&self.failed, stream),
            turn: Pointer::to(&self.turn, stream),
            queue: Pointer::to(&self.queue, stream),
            each: ConstPointer::to(&self.each, stream),
        };
        let p = Parameters::new(&self.parameters, dt, self.rves);
        let launch = Launch::blocks(self.rves as u32, self.shape.threads as u32)
            .shared(self.shape.shared_bytes)
            .early(true);
        let arguments = RveAdvance { batch, p, velocity_gradient };
        // SAFETY: the arrays are as long as the shape says, and the gradients as the caller's slice.
        Ok(unsafe { self.kernel.launch(stream, launch, &arguments) }?)
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
        let gradients: Vec<Tensor> = velocity_gradient.iter().map(Tensor::from).collect();
        let stream = self.device.stream().clone();
        stream.memcpy_htod(&gradients, &mut self.velocity_gradient)?;
        self.launch_at(&stream, dt, ConstPointer::to(&self.velocity_gradient, &stream))?;
        self.check()?;
        for (state, new) in states.iter_mut().zip(self.states()?) {
            *state = new;
        }
        Ok(())
    }

    /// Advances each RVE of an [unequal](Self::upload_unequal) batch by a macro step of its own, and waits. RVEs that
    /// failed stand still.
    pub(super) fn advance_each(
        &mut self,
        each: &[Parameters<R>],
        velocity_gradient: &[Tensor],
    ) -> Result<Vec<State>, CudaError> {
        let stream = self.device.stream().clone();
        stream.memcpy_htod(each, &mut self.each)?;
        stream.memcpy_htod(velocity_gradient, &mut self.velocity_gradient)?;
        self.launch_at(&stream, 1.0, ConstPointer::to(&self.velocity_gradient, &stream))?;
        Ok(stream.clone_dtoh(&self.state)?)
    }

    /// Why each RVE failed that did.
    pub(super) fn failures(&self) -> Result<Vec<Option<RveFailure>>, CudaError> {
        let stream = self.device.stream();
        if stream.clone_dtoh(&self.failed)?[0] == i32::MAX {
            return Ok(vec![None; self.rves]);
        }
        let headers = stream.clone_dtoh(&self.header)?;
        let states = stream.clone_dtoh(&self.state)?;
        let failure = |(header, state): (&Header, &State)| {
            (header.status != Status::OK).then(|| self.reason(header, state))
        };
        Ok(headers.iter().zip(&states).map(failure).collect())
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
        let state = stream.clone_dtoh(&self.state.slice(rve..=rve))?[0];
        let failure = self.reason(&header, &state);
        Ok(CudaError::Rve { rve, step: header.steps as usize, failure })
    }

    /// Why an RVE failed.
    fn reason(&self, header: &Header, state: &State) -> RveFailure {
        match header.status {
            Status::OVERLAP => RveFailure::Packing(Failure::Overlap(state.relative_overlap)),
            Status::LIST_FULL => RveFailure::ListFull { rows: self.shape.rows },
            Status::SLOTS_FULL => RveFailure::SlotsFull { slots: self.shape.slots },
            _ => RveFailure::Packing(Failure::NotFinite),
        }
    }

    /// Resources that the kernel takes.
    ///
    /// # Errors
    /// The driver refuses to tell.
    pub fn resources(&self) -> Result<KernelResources, CudaError> {
        let count = |n: i32| usize::try_from(n).unwrap_or(0);
        let kernel = self.kernel.function();
        let blocks = kernel.occupancy_max_active_blocks_per_multiprocessor(
            self.shape.threads as u32,
            self.shape.shared_bytes,
            None,
        )?;
        Ok(KernelResources {
            threads: self.shape.threads,
            registers: count(kernel.num_regs()?),
            local_bytes: count(kernel.local_size_bytes()?),
            shared_bytes: self.shape.shared_bytes,
            blocks: blocks as usize,
        })
    }
}
