//! A hexagonal lattice of equal discs, where the mean field is exact.
//!
//! Per unit thickness, with `d = 2 r - delta`: `p = sqrt(3) kn delta / d`,
//! `C1111 = sqrt(3)/4 (3 kn + kt)`, `C1122 = sqrt(3)/4 (kn - kt)`, `C1212 = sqrt(3)/4 (kn + kt)`.

use dem::element::Element;
use dem::{Cell, Grains, Packing, PlainDisc, RveParameters};
use nalgebra::Matrix2;
use rstest::rstest;

use crate::common::{expect, stepwise};

const R: f64 = 3.75e-3;

fn parameters() -> RveParameters {
    RveParameters {
        grains: Grains {
            radius_min: R,
            radius_max: R,
            friction: 1e6,
            tangential_stiffness: 0.4e5,
            ..Grains::default()
        },
        free_solid_fraction: 0.0,
        ..RveParameters::default()
    }
}

/// 8 x 8 discs with centres `d` apart.
fn lattice(p: &RveParameters, d: f64) -> Element<f64> {
    let row = 3.0_f64.sqrt() / 2.0 * d;
    let cell = Cell { h: Matrix2::new(8.0 * d, 0.0, 0.0, 8.0 * row) };
    let discs: Vec<PlainDisc> = (0..64)
        .map(|k| {
            let (i, j) = (f64::from(k % 8), f64::from(k / 8));
            PlainDisc { x: [(i + 0.5 * (j % 2.0)) * d, j * row], r: R }
        })
        .collect();
    stepwise(Packing::new(cell, &discs, |r| p.grains.disc_mass(r)), p)
}

#[rstest]
#[case(1e-2)]
#[case(1e-4)]
fn pressure(#[case] relative_overlap: f64) {
    let p = parameters();
    let delta = relative_overlap * 2.0 * R;
    let d = 2.0 * R - delta;
    let element = lattice(&p, d);
    let theory = 3.0_f64.sqrt() * p.grains.normal_stiffness * delta / d / p.grains.thickness;
    let s = element.state.stress;
    assert!((s - Matrix2::identity() * theory).norm() < 1e-9 * theory, "{s} {theory}");
    expect("coordination", element.state.coordination, 6.0, 0.0);
}

/// Moduli by one small affine strain. Terms of the order of the overlap (1e-4) are not in the
/// formulas.
#[test]
fn moduli() {
    let p = parameters();
    let (kn, kt) = (p.grains.normal_stiffness, p.grains.tangential_stiffness);
    let strain = 1e-6;
    let response = |l: Matrix2<f64>| {
        let mut element = lattice(&p, 2.0 * R * (1.0 - 1e-4));
        let before = element.state.stress;
        element.advance(&(l * (strain / element.macro_step))).unwrap();
        element.advance(&Matrix2::zeros()).unwrap();
        (before - element.state.stress) * p.grains.thickness / strain
    };
    let factor = 3.0_f64.sqrt() / 4.0;
    let stretch = response(Matrix2::new(1.0, 0.0, 0.0, 0.0));
    expect("C1111", stretch[(0, 0)] / (factor * (3.0 * kn + kt)), 1.0, 1e-3);
    expect("C1122", stretch[(1, 1)] / (factor * (kn - kt)), 1.0, 1e-3);
    // Engineering shear 1: sxy = C1212.
    let shear = response(Matrix2::new(0.0, 1.0, 0.0, 0.0));
    expect("C1212", shear[(0, 1)] / (factor * (kn + kt)), 1.0, 1e-3);
    let bulk = response(Matrix2::identity());
    expect("K2D", bulk.trace() / 4.0 / (3.0_f64.sqrt() / 2.0 * kn), 1.0, 1e-3);
}

/// Without contacts there is no stress, not even a rounded one.
#[test]
fn separated_lattice_has_no_stress() {
    let mut element = lattice(&parameters(), 2.0 * R * 1.001);
    element.advance(&Matrix2::zeros()).unwrap();
    assert_eq!(element.state.stress, Matrix2::zeros());
    assert_eq!(element.state.coordination, 0.0);
}

/// Six turns of the lattice turn its (sheared, so anisotropic) stress and change nothing else.
#[test]
fn rotation_turns_the_stress() {
    let p = parameters();
    let mut element = lattice(&p, 2.0 * R * (1.0 - 1e-3));
    element.advance(&(Matrix2::new(0.0, 2e-4, 0.0, -1e-4) / element.macro_step)).unwrap();
    element.advance(&Matrix2::zeros()).unwrap();
    let before = element.state.stress;
    let angle = 6.0 * std::f64::consts::TAU + 0.7;
    let steps = 2000;
    let w = angle / f64::from(steps) / element.macro_step;
    for _ in 0..steps {
        element.advance(&Matrix2::new(0.0, -w, w, 0.0)).unwrap();
    }
    element.advance(&Matrix2::zeros()).unwrap();
    let turn = Matrix2::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos());
    let expected = turn * before * turn.transpose();
    let error = (element.state.stress - expected).norm() / before.norm();
    println!("relative stress error {error:.1e}");
    assert!(error < 1e-7, "{error:.1e}");
}
