//! Pushforward on the device. The kernel is `push_forward.cu`, its CPU twin
//! [`Draft::push_forward`](crate::data::Examples::push_forward).

use std::sync::Arc;

use cudarc::driver::{CudaFunction, CudaSlice, PushKernelArg};
use gpu::{Device, Error};

use super::launch::each;
use crate::data::Unrolling;

/// The source of the kernel.
pub const PUSH_FORWARD_SOURCE: &str = include_str!("push_forward.cu");

/// Windows that the network moves on before it learns from them.
pub struct PushForward {
    device: Arc<Device>,
    kernel: CudaFunction,
    /// The last two frames of the windows, and those around the step to learn.
    last_two: CudaSlice<f64>,
    truth: CudaSlice<f64>,
    /// Mean of the accelerations of each window.
    mean: CudaSlice<f64>,
    std: [f64; 2],
    /// What the network says of the windows: normalised accelerations, points x 2.
    pub said: CudaSlice<f32>,
}

impl PushForward {
    /// With room for so many windows and coordinates.
    ///
    /// # Errors
    /// Too little memory, or no compiler.
    pub fn new(device: &Arc<Device>, windows: usize, values: usize) -> Result<Self, Error> {
        let module = device.module("push_forward.cu", PUSH_FORWARD_SOURCE, &[])?;
        Ok(Self {
            kernel: module.load_function("push_forward")?,
            last_two: device.zeros(2 * values)?,
            truth: device.zeros(2 * values)?,
            mean: device.zeros(2 * windows)?,
            std: [1.0; 2],
            said: device.zeros(values)?,
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

    /// Queues a step with what was [said](Self::said): of `positions`, some frames x `values`
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
        let (frames, count) = (frames as u32, values as u32);
        let [std_x, std_y] = self.std;
        let mut launch = self.device.stream().launch_builder(&self.kernel);
        launch.arg(&count).arg(&frames).arg(window).arg(&self.mean).arg(&std_x).arg(&std_y);
        launch.arg(&self.said).arg(&mut self.last_two).arg(positions).arg(&self.truth);
        // SAFETY: the argument types are those of the kernel, and the arrays as long as it expects.
        unsafe {
            match targets {
                Some(targets) => launch.arg(targets).launch(each(values)),
                None => launch.arg(&0_u64).launch(each(values)),
            }
        }?;
        Ok(())
    }
}
