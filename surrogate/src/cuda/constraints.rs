//! The boxes of a scene on the device. The kernel's functions are `constraints.cu`, their CPU twin
//! [`Constraints::confine`].

use cudarc::driver::{CudaSlice, DeviceRepr};
use gpu::{Device, Error};
use mpm::Friction;

use crate::rollout::Constraints;

/// `Box` of `constraints.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BoxRecord {
    low: [f64; 2],
    high: [f64; 2],
    velocity: [f64; 2],
    start: f64,
    friction: [f64; 4],
}

// SAFETY: plain numbers without padding, laid out as in `constraints.cu`.
unsafe impl DeviceRepr for BoxRecord {}

/// The boxes on the device, and how many they are.
pub(super) fn upload(
    device: &Device,
    constraints: &Constraints,
) -> Result<(CudaSlice<BoxRecord>, u32), Error> {
    let coefficient = |friction| match friction {
        Friction::Slip => 0.0,
        Friction::Coulomb(mu) => mu,
        Friction::Stick => f64::INFINITY,
    };
    let mut boxes: Vec<BoxRecord> = constraints
        .boxes
        .iter()
        .map(|rigid| BoxRecord {
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
    boxes.resize(boxes.len().max(1), BoxRecord::default());
    Ok((device.upload(&boxes)?, number))
}
