//! The RVE batch on a GPU as a material of the MPM: the twin of `rve_material.rs` of the CPU.

use std::sync::Arc;
use std::time::Duration;

use cudarc::driver::sys::CUstreamCaptureStatus;
use cudarc::driver::{CudaEvent, CudaSlice, PinnedHostSlice};
use dem::RveState;
use dem::cuda::{CudaError as RveError, Room, State, Tensor};
use gpu::ranks::Ranks;
use gpu::{
    ConstPointer, Device, Function, Pointer, checks, cuda_struct, definitions, files, kernel,
};
use mpm::cuda::{CudaError, CudaMaterial, Mpm, Queue};
use mpm::{MaterialError, Numerics};

use super::ranked_batch::RankedRveBatch;
use super::timer::{elapsed, timer};
use crate::simulation::rve_material::{Batch, RveMaterial, Tally};

cuda_struct! {
    /// Counts over all steps of events of one packing at the limits of the method.
    struct DeviceTally {
        free_steps: u64,
        thin_steps: u64,
        dense_steps: u64,
        overlap_steps: u64,
        searches: u64,
        /// Largest overlap over the smaller radius.
        max_overlap: f64,
        /// Smallest width of the cell (m).
        min_width: f64,
    }
}

kernel! {
    /// From the states of the packings to stress and volume of the points; a thread a point.
    struct RveResponse: rve_response {
        m: Mpm,
        /// State of each packing.
        states: ConstPointer<State>,
        /// The first packing that failed of every `chunk` packings, counted within them.
        failed: ConstPointer<i32>,
        chunk: i32,
        /// Of each point (m).
        volume_per_area: ConstPointer<f64>,
        /// Of each packing.
        tally: Pointer<DeviceTally>,
        /// Larger overlaps over the smaller radius are counted.
        overlap_warning: f64,
    }
}

/// The source of the kernel.
pub fn source() -> String {
    let structs = definitions![Tensor, State, DeviceTally];
    [&mpm::cuda::header(), &structs, files!("rve_material.cu"), &checks![RveResponse]].concat()
}

/// Preprocessor definitions for it.
pub fn defines() -> Vec<String> {
    mpm::cuda::defines(&Numerics::default())
}

/// The packings of all points on a GPU.
pub(super) struct CudaRveMaterial {
    device: Arc<Device>,
    batch: DeviceBatch,
    response: Function<RveResponse>,
    volume_per_area: CudaSlice<f64>,
    tally: CudaSlice<DeviceTally>,
    /// Copies of states and counts, for a frame.
    frame_states: PinnedHostSlice<State>,
    frame_tally: PinnedHostSlice<DeviceTally>,
    /// Counts before the upload.
    earlier: Tally,
    overlap_warning: f64,
    /// Before and after the packings in the last step queued outside of a graph.
    events: [CudaEvent; 2],
}

/// The batch in the precision of the scene.
enum DeviceBatch {
    F32(RankedRveBatch<f32>),
    F64(RankedRveBatch<f64>),
}

/// Does the same with a batch of either precision.
macro_rules! with_batch {
    ($batch:expr, $name:ident => $call:expr) => {
        match $batch {
            DeviceBatch::F32($name) => $call,
            DeviceBatch::F64($name) => $call,
        }
    };
}

impl CudaRveMaterial {
    /// Copies the packings to a GPU; with `ranks` those of this rank.
    ///
    /// # Errors
    /// When they do not fit or a kernel cannot be compiled.
    pub fn new(
        device: &Arc<Device>,
        rve: &RveMaterial,
        room: Room,
        ranks: Option<&Arc<Ranks>>,
    ) -> Result<Self, RveError> {
        let batch = match rve.batch.as_ref() {
            Batch::F32(batch) => {
                DeviceBatch::F32(RankedRveBatch::upload(device, batch, room, ranks)?)
            }
            Batch::F64(batch) => {
                DeviceBatch::F64(RankedRveBatch::upload(device, batch, room, ranks)?)
            }
        };
        let module = device.module("rve_material.cu", &source(), &defines())?;
        let packings = rve.volume_per_area.len();
        let none = DeviceTally {
            free_steps: 0,
            thin_steps: 0,
            dense_steps: 0,
            overlap_steps: 0,
            searches: 0,
            max_overlap: 0.0,
            min_width: f64::INFINITY,
        };
        let states = with_batch!(&batch, batch => batch.device_states().len());
        Ok(Self {
            frame_states: device.pinned(states)?,
            frame_tally: device.pinned(packings)?,
            batch,
            response: Function::load(device, &module)?,
            volume_per_area: device.upload(&rve.volume_per_area)?,
            tally: device.upload(&vec![none; packings])?,
            earlier: rve.tally,
            overlap_warning: rve.parameters().grains.overlap_warning,
            events: timer(device)?,
            device: device.clone(),
        })
    }

    /// Queues copies of states and counts.
    pub fn queue_fetch(&mut self) -> Result<(), CudaError> {
        let (stream, states) = (self.device.stream(), &mut self.frame_states);
        with_batch!(&self.batch, batch => stream.memcpy_dtoh(batch.device_states(), states))?;
        Ok(stream.memcpy_dtoh(&self.tally, &mut self.frame_tally)?)
    }

    /// Takes the copies, `steps` steps after the last time. The caller has waited for the stream.
    pub fn fetched(&self, rve: &mut RveMaterial, steps: usize) -> Result<(), CudaError> {
        // Several ranks have room for a few more.
        let states = self.frame_states.as_slice()?.iter().take(rve.states.len());
        rve.states = states.copied().map(RveState::from).collect();
        let made = rve.tally.steps + (steps * rve.states.len()) as u64;
        rve.tally = Tally { steps: made, ..self.earlier };
        let total = &mut rve.tally;
        for tally in self.frame_tally.as_slice()? {
            total.free_steps += tally.free_steps;
            total.thin_steps += tally.thin_steps;
            total.dense_steps += tally.dense_steps;
            total.overlap_steps += tally.overlap_steps;
            total.searches += tally.searches;
            total.max_overlap = total.max_overlap.max(tally.max_overlap);
            total.min_width = total.min_width.min(tally.min_width);
        }
        Ok(())
    }

    /// Copies back the packings themselves; of several ranks only the first gets them.
    pub fn fetch_packings(&self, rve: &mut RveMaterial) -> Result<(), CudaError> {
        let fetched = match &self.batch {
            DeviceBatch::F32(batch) => batch.download().map_err(device_error)?.map(Batch::F32),
            DeviceBatch::F64(batch) => batch.download().map_err(device_error)?.map(Batch::F64),
        };
        if let Some(batch) = fetched {
            rve.batch = Arc::new(batch);
        }
        Ok(())
    }

    /// Of the packings in the last step queued outside of a graph.
    pub fn time(&self) -> Result<Duration, gpu::Error> {
        elapsed(&self.events)
    }

    /// From velocity gradients to the states of all packings.
    ///
    /// On several GPUs each launches its own slice, and the states of all packings are gathered
    /// before this returns: all else is small and done on each.
    fn queue_packings(&mut self, queue: &Queue) -> Result<(), CudaError> {
        let Queue { stream, dt, ref velocity_gradient, .. } = *queue;
        let timed =
            stream.capture_status()? == CUstreamCaptureStatus::CU_STREAM_CAPTURE_STATUS_NONE;
        if timed {
            self.events[0].record(stream)?;
        }
        with_batch!(&mut self.batch, batch => batch.launch(dt, velocity_gradient))
            .map_err(device_error)?;
        if timed {
            self.events[1].record(stream)?;
        }
        Ok(())
    }

    fn queue_response(&mut self, queue: &Queue) -> Result<(), CudaError> {
        let stream = queue.stream;
        let (states, failed, chunk) = with_batch!(&self.batch, batch => (
            ConstPointer::to(batch.device_states(), stream),
            ConstPointer::to(batch.failed(), stream),
            batch.chunk() as i32,
        ));
        let arguments = RveResponse {
            m: *queue.mpm,
            states,
            failed,
            chunk,
            volume_per_area: ConstPointer::to(&self.volume_per_area, stream),
            tally: Pointer::to(&self.tally, stream),
            overlap_warning: self.overlap_warning,
        };
        // SAFETY: a thread, a packing and an entry of each array a point.
        unsafe { queue.over_points(&self.response, &arguments) }
    }
}

impl CudaMaterial for CudaRveMaterial {
    fn queue_update(&mut self, queue: &Queue) -> Result<(), CudaError> {
        self.queue_packings(queue)?;
        self.queue_response(queue)
    }

    fn failure(&self, point: usize) -> Result<MaterialError, CudaError> {
        let reason = with_batch!(&self.batch, batch => batch.failure(point));
        Ok(MaterialError::Point { point, reason: reason.map_err(device_error)? })
    }
}

/// An error of a batch that is uploaded and advanced by the device: all others are its states.
fn device_error(error: RveError) -> CudaError {
    match error {
        RveError::Gpu(error) => error.into(),
        other => gpu::Error::Driver(other.to_string()).into(),
    }
}
