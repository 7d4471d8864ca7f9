//! The boxes of a scene on the device. Functions of a kernel are `constraints.cu`, their CPU twin
//! [`Constraints::confine`].

use cudarc::driver::CudaSlice;
use gpu::{Device, Error, cuda_struct};
use mpm::Friction;

use crate::rollout::Constraints;

cuda_struct! {
    /// A rigid box.
    #[derive(Default)]
    pub(in crate::cuda) struct RigidBox {
        /// Lower and upper corner (m) until `start` (s),
        pub low: [f64; 2],
        pub high: [f64; 2],
        /// and velocity (m/s) from then on.
        pub velocity: [f64; 2],
        pub start: f64,
        /// Coefficients of friction of the faces: left, right, bottom, top; infinite: no sliding.
        pub friction: [f64; 4],
    }
}

/// The boxes on the device, and their number.
pub(in crate::cuda) fn upload(
    device: &Device,
    constraints: &Constraints,
) -> Result<(CudaSlice<RigidBox>, u32), Error> {
    let coefficient = |friction| match friction {
        Friction::Slip => 0.0,
        Friction::Coulomb(mu) => mu,
        Friction::Stick => f64::INFINITY,
    };
    let mut boxes: Vec<RigidBox> = constraints
        .boxes
        .iter()
        .map(|rigid| RigidBox {
            low: rigid.place.corner,
            high: rigid.place.end(),
            velocity: rigid.velocity,
            start: rigid.start,
            friction: [rigid.faces.left, rigid.faces.right, rigid.faces.bottom, rigid.faces.top]
                .map(coefficient),
        })
        .collect();
    let number = boxes.len() as u32;
    // An empty allocation is an error.
    boxes.resize(boxes.len().max(1), RigidBox::default());
    Ok((device.upload(&boxes)?, number))
}
