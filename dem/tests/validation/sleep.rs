//! Packings that make no DEM step where their answer is known.

use std::f64::consts::PI;

use dem::RveParameters;
use dem::element::Element;
use nalgebra::Matrix2;

use crate::common::{DENSE, packing, parameters, settle};

/// Share of its stress within which the answer of a packing counts as known.
const SHARE: f64 = 0.05;

/// A packing under 20 kPa that has come to rest, to sleep from now on.
fn element(sleep_stress: f64) -> Element<f64> {
    let p = parameters(20.0e3, DENSE);
    let mut element = Element::new(packing(&p, 1), &p, 1e-4).unwrap();
    settle(&mut element, 0.02);
    element.parameters.sleep_stress = sleep_stress;
    element
}

/// Strain rate (1/s) of slow biaxial compression, 1e-6 a macro step.
const SLOW: Matrix2<f64> = Matrix2::new(5.0e-3, 0.0, 0.0, -1.0e-2);

/// The stress is that of the last DEM step to round-off, and grains do not move, as nothing deforms the packing.
#[test]
fn at_rest_a_packing_sleeps_and_its_stress_stays() {
    let mut element = element(SHARE);
    // Nothing is known before the first step, and what is known is right after the second.
    (0..2).for_each(|_| element.advance(&Matrix2::zeros()).unwrap());
    let (discs, stress) = (element.rve.packing.discs.clone(), element.state.stress);
    for _ in 0..1000 {
        element.advance(&Matrix2::zeros()).unwrap();
        assert!(element.state.asleep);
        assert!((element.state.stress - stress).norm() <= 1e-12 * stress.norm());
    }
    assert_eq!(element.rve.packing.discs, discs);
}

/// `dsigma = -c (2 kn tr(eps) I + 2 (kn + kt) dev eps)`, `c = Z phi / (4 pi t)`, and dashpots of `2 zeta sqrt(m kn / 2)`
/// in the normal direction, in a frame that turns with the packing.
#[test]
fn asleep_it_answers_as_its_springs_and_dashpots() {
    let mut element = element(SHARE);
    (0..2).for_each(|_| element.advance(&Matrix2::zeros()).unwrap());
    let start = element.state;
    let l = Matrix2::new(-2.0e-2, 3.0e-2, -1.0e-2, 1.0e-2);
    let steps = 20;
    for _ in 0..steps {
        element.advance(&l).unwrap();
        assert!(element.state.asleep);
    }
    let g = &element.parameters.grains;
    let c = start.coordination * start.solid_fraction / (4.0 * PI * g.thickness);
    let response = |bulk: f64, shear: f64, strain: Matrix2<f64>| {
        let volumetric = Matrix2::identity() * (0.5 * strain.trace());
        -c * (2.0 * bulk * volumetric + 2.0 * shear * (strain - volumetric))
    };
    let d = 0.5 * (l + l.transpose());
    let (kn, kt) = (g.normal_stiffness, g.tangential_stiffness);
    let eta = 2.0 * g.damping_ratio * (0.5 * g.disc_mass(0.5 * g.mean_diameter()) * kn).sqrt();
    let time = f64::from(steps) * 1e-4;
    let angle = -2.0e-2 * time;
    let turned = Matrix2::new(0.0, -angle, angle, 0.0);
    let expected = start.stress
        + response(2.0 * kn, kn + kt, d * time)
        + response(2.0 * eta, eta, d)
        + turned * start.stress
        - start.stress * turned;
    // Terms of second order in a strain of 1e-4 are left out.
    let tolerance = 1e-3 * (expected - start.stress).norm();
    assert!((element.state.stress - expected).norm() < tolerance, "{}", element.state.stress);
    let area = start.area * (l.trace() * time).exp();
    assert!((element.state.area / area - 1.0).abs() < 1e-12);
    assert!((element.rve.area() / area - 1.0).abs() < 1e-12);
}

/// Slow compression to a strain of 5e-4, half of what 20 kPa compress elastically: asleep most of the time the packing
/// has the same cell, and its stress is off by no more than two of the shares that it may be off at any time.
#[test]
fn strain_is_not_lost_asleep() {
    let (mut sleeper, mut awake) = (element(SHARE), element(0.0));
    let steps = 500;
    let mut asleep = 0;
    for _ in 0..steps {
        sleeper.advance(&SLOW).unwrap();
        awake.advance(&SLOW).unwrap();
        asleep += i32::from(sleeper.state.asleep);
    }
    assert!(asleep > steps / 2, "{asleep}");
    // One that moves too far is computed, and follows to where the other one is.
    for element in [&mut sleeper, &mut awake] {
        element.advance(&Matrix2::new(0.0, 0.0, 0.0, -5.0)).unwrap();
    }
    assert!(!sleeper.state.asleep);
    let [a, b] = [&sleeper, &awake].map(|element| element.rve.packing.cell.h);
    assert!((a - b).norm() < 1e-12 * b.norm());
    for element in [&mut sleeper, &mut awake] {
        settle(element, 0.02);
    }
    let error = (sleeper.state.stress - awake.state.stress).norm() / awake.state.stress.norm();
    println!("asleep in {asleep} of {steps} steps; stress {error:.4} off");
    assert!(error < 2.0 * SHARE, "{error}");
}

/// A shear of 3e-4 a macro step would change the stress by `2 G 3e-4 / sqrt(2) = 3 kPa`, more than a hundredth of what it is at
/// any time: the packing never sleeps, and nothing changes.
#[test]
fn flow_never_sleeps() {
    let (mut sleeper, mut awake) = (element(0.01), element(0.0));
    for _ in 0..500 {
        let shear = Matrix2::new(0.0, 3.0, 0.0, 0.0);
        sleeper.advance(&shear).unwrap();
        awake.advance(&shear).unwrap();
        assert_eq!(sleeper.state, awake.state);
    }
    assert_eq!(sleeper.rve.packing, awake.rve.packing);
}

/// An audited packing is computed in every step, bit by bit like one without sleep, and tells the error of sleep.
#[test]
fn an_audited_packing_is_computed_in_every_step() {
    let (mut audited, mut awake) = (element(SHARE), element(0.0));
    audited.rve.sleep.audited = true;
    let mut most = 0.0_f64;
    for _ in 0..200 {
        audited.advance(&SLOW).unwrap();
        awake.advance(&SLOW).unwrap();
        assert!(!audited.state.asleep);
        assert_eq!(audited.state.stress, awake.state.stress);
        most = most.max(audited.state.audit / awake.state.stress.norm());
    }
    println!("largest error asleep {most:.4}");
    assert!(most > 0.0 && most < 3.0 * SHARE, "{most}");
}

/// Apart from each other discs need no DEM step until they are brought closer.
#[test]
fn packings_without_contacts_sleep_while_they_expand() {
    let p = RveParameters { free_solid_fraction: 0.0, ..parameters(20.0e3, DENSE) };
    let mut element = Element::new(packing(&p, 1), &p, 1e-4).unwrap();
    for _ in 0..100 {
        element.advance(&(Matrix2::identity() * 5.0)).unwrap();
    }
    settle(&mut element, 0.02);
    for _ in 0..100 {
        element.advance(&(Matrix2::identity() * 5.0)).unwrap();
    }
    assert_eq!(element.state.coordination, 0.0);
    element.parameters.sleep_stress = SHARE;
    let mut asleep = 0;
    for _ in 0..100 {
        element.advance(&(Matrix2::identity() * 0.5)).unwrap();
        asleep += i32::from(element.state.asleep);
    }
    // Each sleep may expand by 0.01, in 200 steps.
    assert!(asleep >= 98, "{asleep}");
    // Back beyond where the last sleep began, grains may touch and are computed.
    for _ in 0..20 {
        element.advance(&(Matrix2::identity() * -5.0)).unwrap();
    }
    while element.strain.trace() > 0.0 {
        element.advance(&(Matrix2::identity() * -5.0)).unwrap();
        assert!(!element.state.asleep);
    }
    assert!(element.state.stress.trace() > 0.0);
}
