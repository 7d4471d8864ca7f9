//! D9. A rigid rotation of a loaded RVE turns its stress and does nothing else.

use std::f64::consts::FRAC_PI_2;

use dem::element::Element;
use nalgebra::Matrix2;
use rstest::rstest;

use crate::common::{DENSE, packing, parameters, settle};

/// A packing at rest after a shear strain of 2 %: the stress is anisotropic.
fn sheared(rolling_friction: f64) -> Element<f64> {
    let mut p = parameters(20.0e3, DENSE);
    p.grains.rolling_friction = rolling_friction;
    let mut element = Element::new(packing(&p, 1), &p, 1e-4).unwrap();
    for _ in 0..200 {
        element.advance(&Matrix2::new(0.0, 1.0, 0.0, 0.0)).unwrap();
    }
    settle(&mut element, 0.2);
    element.advance(&Matrix2::zeros()).unwrap();
    element
}

/// Turns by a right angle with `drive(w)` in place of the spin; relative stress error and area
/// change.
fn quarter_turn(rolling_friction: f64, w: f64, drive: impl Fn(f64) -> Matrix2<f64>) -> (f64, f64) {
    let mut element = sheared(rolling_friction);
    let (before, area) = (element.state.stress, element.state.area);
    let steps = (FRAC_PI_2 / w / 1e-4).ceil();
    element.macro_step = FRAC_PI_2 / w / steps;
    for _ in 0..steps as usize {
        element.advance(&drive(w)).unwrap();
    }
    element.advance(&Matrix2::zeros()).unwrap();
    let turn = Matrix2::new(0.0, -1.0, 1.0, 0.0);
    let expected = turn * before * turn.transpose();
    let error = (element.state.stress - expected).norm() / before.norm();
    (error, element.state.area / area - 1.0)
}

/// Stress to 1e-4, area to 1e-9.
#[rstest]
#[case(0.0, 1.0)]
#[case(0.0, 10.0)]
#[case(0.0, 50.0)]
#[case(0.3, 10.0)]
fn a_quarter_turn_turns_the_stress(#[case] rolling_friction: f64, #[case] w: f64) {
    let (error, drift) = quarter_turn(rolling_friction, w, |w| Matrix2::new(0.0, -w, w, 0.0));
    println!("w = {w}: stress error {error:.1e}, area drift {drift:.1e}");
    assert!(error < 1e-4, "{error:.1e}");
    assert!(drift.abs() < 1e-9, "{drift:.1e}");
}

/// The same with the update that many codes use, `h += L dt h` per DEM step: the area grows by
/// `w² dt` per second, and a dense packing answers with its bulk stiffness.
///
/// `exp(L' dt) = I + L dt` for `L' = log(I + L dt) / dt`, which for a spin `w` is the spin
/// `atan(w dt) / dt` and the expansion `ln(1 + w² dt²) / (2 dt)`.
#[test]
fn an_euler_update_is_not_objective() {
    let p = parameters(20.0e3, DENSE);
    let (error, drift) = quarter_turn(0.0, 10.0, |w| {
        let dt = 1e-4 / p.grains.substeps(1e-4) as f64;
        let spin = (w * dt).atan() / dt;
        let expansion = (w * dt).powi(2).ln_1p() / (2.0 * dt);
        Matrix2::new(expansion, -spin, spin, expansion)
    });
    println!("Euler update, w = 10: stress error {error:.1e}, area drift {drift:.1e}");
    assert!(error > 1e-2, "{error:.1e}");
    assert!(drift > 1e-4, "{drift:.1e}");
}
