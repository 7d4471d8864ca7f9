//! Steps of a rollout on the device. Their CPU twin is
//! [`Rollout::advance`](crate::rollout::Rollout::advance).

use std::sync::Arc;

use cudarc::driver::{CudaEvent, CudaSlice, PinnedHostSlice};
use gpu::{ConstPointer, Device, Error, Pointer};

use super::ops::constraints::{self, RigidBox};
use super::ops::integrate::{Clock, Integrate, Setup, Step};
use crate::diagnostics::CrowdingLimit;
use crate::features::Normalisation;
use crate::network::ModelConfig;
use crate::rollout::{Constraints, RolloutError};

/// Frames that are predicted before the host looks at them.
pub const BLOCK: usize = 8;
/// Frames of the history: a block, and the one before it, whose last two the next step needs.
const ROWS: usize = 2 * BLOCK;
/// The value of `failed` while all positions make sense.
const NO_FAILURE: u64 = u64::MAX;

/// What moves the points besides the network, and when it must end.
#[derive(Clone)]
pub struct Motion {
    /// Walls and boxes.
    pub constraints: Constraints,
    /// Added to the network's accelerations (m/frame²).
    pub fall: [f64; 2],
    /// Time of frame 0 (s).
    pub start: f64,
    /// Time between frames (s).
    pub interval: f64,
    /// Takes the mean of accelerations and of the mirror images of those of the mirrored window
    /// ([`mirrored`](crate::features::mirrored)).
    pub mirror: bool,
    /// How densely points may be packed.
    pub packing: CrowdingLimit,
}

/// Positions of points in double precision, with the last frames of their history.
pub struct Integrator {
    device: Arc<Device>,
    kernel: Integrate,
    setup: Setup,
    boxes: CudaSlice<RigidBox>,
    /// The last [`ROWS`] frames in turn (points x 2, m).
    history: CudaSlice<f64>,
    clock: CudaSlice<Clock>,
    /// As `Step::failed`.
    failed: CudaSlice<u64>,
}

impl Integrator {
    /// For `points` points, at least one, that a network moves.
    ///
    /// # Errors
    /// Too little memory, or no compiler.
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        motion: &Motion,
        points: usize,
    ) -> Result<Self, Error> {
        let pair = |list: &[f64]| [list[0], list[1]];
        let (boxes, number) = constraints::upload(device, &motion.constraints)?;
        let setup = Setup {
            scale: pair(&norm.acceleration_std),
            mean: pair(&norm.acceleration_mean),
            fall: motion.fall,
            domain: motion.constraints.domain(),
            start: motion.start,
            interval: motion.interval,
            reach: config.connection_radius,
            points: points as u32,
            boxes: number,
            rows: ROWS as u32,
            mirror: u32::from(motion.mirror),
        };
        Ok(Self {
            kernel: Integrate::load(device)?,
            setup,
            boxes,
            history: device.zeros(ROWS * 2 * points)?,
            clock: device.upload(&[Clock::default()])?,
            failed: device.upload(&[NO_FAILURE])?,
            device: device.clone(),
        })
    }

    /// Goes on from the positions (m) of the frames `frame` - 2 and `frame` - 1.
    ///
    /// # Errors
    /// The copy failed.
    pub fn begin(&mut self, last_two: [&[[f64; 2]]; 2], frame: usize) -> Result<(), Error> {
        let stream = self.device.stream();
        let values = 2 * self.setup.points as usize;
        for (row, positions) in (ROWS - 2..ROWS).zip(last_two) {
            let mut row = self.history.slice_mut(row * values..(row + 1) * values);
            stream.memcpy_htod(positions.as_flattened(), &mut row)?;
        }
        stream
            .memcpy_htod(&[Clock { frame: frame as u32, ..Clock::default() }], &mut self.clock)?;
        stream.memcpy_htod(&[NO_FAILURE], &mut self.failed)?;
        Ok(())
    }

    /// Queues a step with the network's output, points x 2, of which those of this rollout begin at point `first`;
    /// `position` gets the new frame in single precision. With `mirror`, both have the images of the points behind
    /// the points.
    ///
    /// # Errors
    /// The launch was refused.
    pub fn step(
        &mut self,
        output: &CudaSlice<f32>,
        position: &mut CudaSlice<f32>,
        first: usize,
    ) -> Result<(), Error> {
        let stream = self.device.stream();
        self.kernel.integrate(&Step {
            setup: self.setup,
            boxes: ConstPointer::to(&self.boxes, stream),
            output: ConstPointer::to(output, stream).offset(2 * first),
            history: Pointer::to(&self.history, stream),
            position: Pointer::to(position, stream).offset(2 * first),
            clock: Pointer::to(&self.clock, stream),
            failed: Pointer::to(&self.failed, stream),
        })
    }

    /// Page-locked memory for the results of a block.
    ///
    /// # Errors
    /// Too little memory.
    pub fn landing(&self) -> Result<Landing, Error> {
        let context = self.device.context();
        let values = BLOCK * 2 * self.setup.points as usize;
        // SAFETY: read after a copy has filled it only.
        let landing = unsafe {
            Landing {
                positions: context.alloc_pinned_with_flags(values, 0)?,
                failed: context.alloc_pinned_with_flags(1, 0)?,
                copied: context.new_event(None)?,
            }
        };
        Ok(landing)
    }

    /// Queues the copy of block number `block` of [`BLOCK`] frames since the beginning, which
    /// [`Landing::wait`] waits for.
    ///
    /// # Errors
    /// The copy was refused.
    pub fn copy_block(&self, block: usize, landing: &mut Landing) -> Result<(), Error> {
        let stream = self.device.stream();
        let values = 2 * self.setup.points as usize;
        let row = block % (ROWS / BLOCK) * BLOCK;
        let rows = self.history.slice(row * values..(row + BLOCK) * values);
        stream.memcpy_dtoh(&rows, &mut landing.positions)?;
        stream.memcpy_dtoh(&self.failed, &mut landing.failed)?;
        landing.copied.record(stream)?;
        Ok(())
    }

    /// Waits for the copy of a block, the first frame of which has number `first`, and gives its
    /// frames; fewer if one makes no sense, and why.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn block(
        &self,
        landing: &Landing,
        first: usize,
    ) -> Result<(Frames, Option<RolloutError>), Error> {
        landing.wait()?;
        let positions = landing.positions.as_slice()?;
        let failed = landing.failed.as_slice()?[0];
        let frames = positions.chunks_exact(2 * self.setup.points as usize);
        let mut frames: Frames = frames.map(|frame| frame.as_chunks().0.to_vec()).collect();
        if failed == NO_FAILURE {
            return Ok((frames, None));
        }
        let (frame, point) = ((failed >> 32) as usize, failed as u32 as usize);
        let place = frames[frame - first][point];
        frames.truncate(frame - first);
        Ok((frames, Some(self.failure(frame, point, place))))
    }

    fn failure(&self, frame: usize, point: usize, place: [f64; 2]) -> RolloutError {
        if !place.iter().all(|x| x.is_finite()) {
            return RolloutError::NotFinite { frame, point };
        }
        let domain = self.setup.domain;
        let beyond = [0, 1].map(|k| (-place[k]).max(place[k] - domain[k]));
        RolloutError::Left { frame, point, distance: beyond[0].max(beyond[1]).max(0.0) }
    }
}

/// Where the results of a block arrive on the host, so that the device can go on meanwhile.
pub struct Landing {
    positions: PinnedHostSlice<f64>,
    failed: PinnedHostSlice<u64>,
    /// After the copies: those that the arrays keep themselves are not recorded, since the tracking
    /// of events is off.
    copied: CudaEvent,
}

impl Landing {
    /// Waits for the last copy to here and for all that was queued before it.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn wait(&self) -> Result<(), Error> {
        Ok(self.copied.synchronize()?)
    }
}

impl Drop for Landing {
    fn drop(&mut self) {
        // The memory must not go while a copy to it is under way.
        let _ = self.wait();
    }
}

/// Positions (m) of the points, frame by frame.
pub type Frames = Vec<Vec<[f64; 2]>>;
