//! The kernel that makes a step of a rollout.

use std::sync::Arc;

use gpu::{
    ConstPointer, Device, Error, Function, Pointer, Source, checks, cuda_struct, definitions,
    files, kernel,
};

use super::constraints::RigidBox;
use super::geometry::one_thread_each;

cuda_struct! {
    /// What stays the same in all steps.
    pub(in crate::cuda) struct Setup {
        /// Scale, mean and free fall of the accelerations (m/frame²).
        pub scale: [f64; 2],
        pub mean: [f64; 2],
        pub fall: [f64; 2],
        /// Width and height of the domain (m).
        pub domain: [f64; 2],
        /// Time of frame 0 and between frames (s).
        pub start: f64,
        pub interval: f64,
        /// Farthest that a point may be beyond the domain (m).
        pub reach: f64,
        pub points: u32,
        pub boxes: u32,
        /// Frames that the history holds, one after the other, in turn.
        pub rows: u32,
        /// 1: the points are followed by their images in a mirror of left and right, which have no
        /// history. An acceleration is the mean of a point's and of the image of its image's.
        pub mirror: u32,
    }

    /// Where the rollout is.
    #[derive(Default)]
    pub(in crate::cuda) struct Clock {
        /// Number of the frame to make, which goes to row `made % rows` of the history.
        pub frame: u32,
        /// Frames made.
        pub made: u32,
        /// Thread blocks that are done with the frame.
        pub blocks: u32,
        pub unused: u32,
    }
}

kernel! {
    /// A step.
    pub(in crate::cuda) struct Step: integrate {
        pub setup: Setup,
        pub boxes: ConstPointer<RigidBox>,
        /// Normalised accelerations of points and images (2 each).
        pub output: ConstPointer<f32>,
        /// The last frames (`rows` x points x 2, m).
        pub history: Pointer<f64>,
        /// Gets the new frame of points and images (2 each, m).
        pub position: Pointer<f32>,
        pub clock: Pointer<Clock>,
        /// Lowest frame << 32 | point of a position that makes no sense (1).
        pub failed: Pointer<u64>,
    }
}

/// The source of the kernel.
pub fn integrate_source() -> Source {
    let definitions = definitions![RigidBox, Setup, Clock];
    let files = files!["constraints.cu", "integrate.cu"];
    let text = [&definitions, files, &checks![Step]].concat();
    Source { name: "integrate.cu", text, defines: Vec::new() }
}

/// The kernel.
#[derive(Debug)]
pub(in crate::cuda) struct Integrate {
    device: Arc<Device>,
    integrate: Function<Step>,
}

impl Integrate {
    pub fn load(device: &Arc<Device>) -> Result<Self, Error> {
        let Source { name, text, defines } = integrate_source();
        let module = device.module(name, &text, &defines)?;
        Ok(Self { integrate: Function::load(device, &module)?, device: device.clone() })
    }

    /// Network output -> acceleration -> semi-implicit Euler -> constraints.
    pub fn integrate(&self, step: &Step) -> Result<(), Error> {
        let launch = one_thread_each(step.setup.points as usize, 1);
        // SAFETY: the pointers are to live buffers of these sizes.
        unsafe { self.integrate.launch(self.device.stream(), launch, step) }
    }
}
