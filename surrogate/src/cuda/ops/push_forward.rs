//! The kernel of pushforward. Its CPU twin is
//! [`Examples::push_forward`](crate::data::Examples::push_forward).

use std::sync::Arc;

use gpu::{ConstPointer, Device, Error, Function, Pointer, Source, checks, files, kernel};

use super::geometry::one_thread_each;

kernel! {
    /// Windows to move on by a frame. A value is a coordinate of a point.
    pub(in crate::cuda) struct PushForward: push_forward {
        /// Number of values of a frame, and frames of a window.
        pub values: u32,
        pub frames: u32,
        /// Window of each point.
        pub window: ConstPointer<u32>,
        /// Mean of the accelerations of each window (2), and their standard deviation (m/frame²).
        pub mean: ConstPointer<f64>,
        pub std_x: f64,
        pub std_y: f64,
        /// Normalised accelerations that the network predicts (values).
        pub predicted: ConstPointer<f32>,
        /// The last two frames of the windows (2 x values, m), which are moved on,
        pub last: Pointer<f64>,
        /// as are all frames (frames x values, m).
        pub positions: Pointer<f32>,
        /// The two frames around the step to learn (2 x values, m).
        pub truth: ConstPointer<f64>,
        /// Gets the normalised accelerations to learn (values), if not null.
        pub targets: Pointer<f32>,
    }
}

/// The source of the kernel.
pub fn push_forward_source() -> Source {
    let text = [files!["push_forward.cu"], &checks![PushForward]].concat();
    Source { name: "push_forward.cu", text, defines: Vec::new() }
}

/// The kernel.
#[derive(Debug)]
pub(in crate::cuda) struct PushForwardKernel {
    device: Arc<Device>,
    push_forward: Function<PushForward>,
}

impl PushForwardKernel {
    pub fn load(device: &Arc<Device>) -> Result<Self, Error> {
        let Source { name, text, defines } = push_forward_source();
        let module = device.module(name, &text, &defines)?;
        Ok(Self { push_forward: Function::load(device, &module)?, device: device.clone() })
    }

    /// Moves windows on.
    pub fn push_forward(&self, windows: &PushForward) -> Result<(), Error> {
        let launch = one_thread_each(windows.values as usize, 1);
        // SAFETY: the pointers are to live buffers of these sizes.
        unsafe { self.push_forward.launch(self.device.stream(), launch, windows) }
    }
}
