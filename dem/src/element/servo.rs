//! Servo control of stresses: proportional-integral control of the strain rates along x and y.
//!
//! As the servo of wall velocities of Cundall & Strack (1979), Géotechnique 29, 47, but of the strain rates
//! of a periodic cell, and with an integral term against lasting errors.

use nalgebra::Matrix2;

use super::stage::{Axis, Control};
use crate::parameters::RveParameters;

/// Proportional gain (1/s) on the stress error over `kn / t`. The stiffness of a packing is about
/// `kn / t`, so stresses approach their target with a time constant of about `1 / GAIN`.
const GAIN: f64 = 500.0;
/// Gain on the stress error over its target, in units of the imposed shear rate. A rapid flow
/// answers with its inertial stiffness, some 30 times its pressure, far below `kn / t`: without
/// this term it would need a strain of 25 to find its density.
const SHEAR_GAIN: f64 = 0.05;
/// Integral gain (1/s). Without it a dilating packing, which needs a lasting strain rate, would
/// keep a stress error of `rate / GAIN` in units of `kn / t`: 4 % in a biaxial test at 20 kPa.
/// A quarter of the proportional gain would be critical damping; this is well below.
const INTEGRAL: f64 = 50.0;
/// Fastest strain rate (1/s) per axis, or the imposed rates if these are faster.
const MAX_RATE: f64 = 1.0;

/// The part of the strain rates that integral action has built up (1/s).
#[derive(Debug, Default)]
pub struct Servo {
    integral: [f64; 2],
}

impl Servo {
    /// The velocity gradient for the next `dt` (s), from the stress (compression positive).
    pub fn velocity_gradient(
        &mut self,
        control: &Control,
        stress: &Matrix2<f64>,
        p: &RveParameters,
        dt: f64,
    ) -> Matrix2<f64> {
        let imposed = |axis: Axis| match axis {
            Axis::Rate(rate) => rate.abs(),
            Axis::Pressure(_) => 0.0,
        };
        let fastest =
            [imposed(control.xx), imposed(control.yy), control.xy.abs(), control.yx.abs()]
                .into_iter()
                .fold(MAX_RATE, f64::max);
        let pressure = 0.5 * stress.trace();
        let compliance = p.grains.thickness / p.grains.normal_stiffness;
        let shear = control.xy.abs() + control.yx.abs();
        let mut rate = |k: usize, axis: Axis| match axis {
            Axis::Rate(rate) => rate,
            // Hardly any contact yet: proportional control would crawl.
            Axis::Pressure(target) if pressure < 0.1 * target => -MAX_RATE,
            Axis::Pressure(target) => {
                let gain = GAIN * compliance + SHEAR_GAIN * shear / target;
                let error = stress[(k, k)] - target;
                let rate = gain * error + self.integral[k];
                // Integrating all of a large error would drive the approach faster, into looser
                // packings.
                let small = error.clamp(-0.1 * target, 0.1 * target);
                self.integral[k] += gain * INTEGRAL * small * dt;
                rate.clamp(-fastest, fastest)
            }
        };
        Matrix2::new(rate(0, control.xx), control.xy, control.yx, rate(1, control.yy))
    }
}
