//! Windows that the network moves on before it learns from them, on the device. The CPU twin is
//! [`Examples::push_forward`](crate::data::Examples::push_forward).

use std::sync::Arc;

use cudarc::driver::CudaSlice;
use gpu::{ConstPointer, Device, Error, Pointer};

use super::ops::push_forward::{PushForward, PushForwardKernel};
use crate::data::Unrolling;

/// What it takes to move windows on.
pub(super) struct PushedWindows {
    device: Arc<Device>,
    kernel: PushForwardKernel,
    /// The last two frames of the windows, and those around the step to learn.
    last_two: CudaSlice<f64>,
    truth: CudaSlice<f64>,
    /// Mean of the accelerations of each window.
    mean: CudaSlice<f64>,
    std: [f64; 2],
    /// Accelerations that the network predicts for the windows: normalised, points x 2.
    pub predicted: CudaSlice<f32>,
}

impl PushedWindows {
    /// With room for so many windows and coordinates.
    ///
    /// # Errors
    /// Too little memory, or no compiler.
    pub fn new(device: &Arc<Device>, windows: usize, values: usize) -> Result<Self, Error> {
        Ok(Self {
            kernel: PushForwardKernel::load(device)?,
            last_two: device.zeros(2 * values)?,
            truth: device.zeros(2 * values)?,
            mean: device.zeros(2 * windows)?,
            std: [1.0; 2],
            predicted: device.zeros(values)?,
            device: device.clone(),
        })
    }

    /// Takes windows, for which there is room.
    ///
    /// # Errors
    /// The copy was refused.
    pub fn begin(&mut self, windows: &Unrolling) -> Result<(), Error> {
        let stream = self.device.stream();
        for (from, to) in
            [(&windows.last_two, &mut self.last_two), (&windows.truth, &mut self.truth)]
        {
            for (k, frame) in from.iter().enumerate() {
                let mut to = to.slice_mut(k * frame.len()..(k + 1) * frame.len());
                stream.memcpy_htod(frame, &mut to)?;
            }
        }
        stream.memcpy_htod(windows.mean.as_flattened(), &mut self.mean)?;
        self.std = windows.std;
        Ok(())
    }

    /// Queues a step with what was [predicted](Self::predicted): of `positions`, some frames x `values`
    /// coordinates, each frame becomes the one after it. `window` is that of each point. After the last
    /// step `targets` get the normalised accelerations to learn.
    ///
    /// # Errors
    /// The launch was refused.
    pub fn step(
        &mut self,
        window: &CudaSlice<u32>,
        positions: &mut CudaSlice<f32>,
        [frames, values]: [usize; 2],
        targets: Option<&mut CudaSlice<f32>>,
    ) -> Result<(), Error> {
        let stream = self.device.stream();
        self.kernel.push_forward(&PushForward {
            values: values as u32,
            frames: frames as u32,
            window: ConstPointer::to(window, stream),
            mean: ConstPointer::to(&self.mean, stream),
            std_x: self.std[0],
            std_y: self.std[1],
            predicted: ConstPointer::to(&self.predicted, stream),
            last: Pointer::to(&self.last_two, stream),
            positions: Pointer::to(positions, stream),
            truth: ConstPointer::to(&self.truth, stream),
            targets: targets.map_or(Pointer::NULL, |targets| Pointer::to(targets, stream)),
        })
    }
}
