//! The cell and the affine part of the motion, exact to round-off (targets of YADE's periodic
//! boundary tests).

use dem::element::Element;
use dem::{Cell, Failure, Packing, PlainDisc, RveParameters, cell};
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

use crate::common::{DENSE, packing, parameters, stepwise};

/// Some discs too far apart to touch, driven as if loaded.
fn gas() -> Element<f64> {
    let p = RveParameters { free_solid_fraction: 0.0, ..RveParameters::default() };
    let discs: Vec<PlainDisc> = (0..9)
        .map(|k| PlainDisc { x: [0.1 * f64::from(k % 3), 0.1 * f64::from(k / 3)], r: 2.5e-3 })
        .collect();
    let packing = Packing::new(Cell::square(0.3), &discs, |r| p.grains.disc_mass(r));
    Element::new(packing, &p, 1e-4).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// `h(t) = exp(L t) h(0)` and `x(t) = exp(L t) x(0)`, up to whole cell vectors, to 1e-12.
    #[test]
    fn cell_and_discs_follow_the_velocity_gradient(l in prop::array::uniform4(-50.0..50.0f64)) {
        let l = Matrix2::new(l[0], l[1], l[2], l[3]);
        let mut element = gas();
        let h0 = element.rve.packing.cell.h;
        let x0 = element.rve.packing.plain_discs();
        let steps = 100;
        for _ in 0..steps {
            element.advance(&l).unwrap();
        }
        let f = cell::exp(&(l * (f64::from(steps) * element.macro_step)));
        let packing = &element.rve.packing;
        // The lattice may have been reduced: its vectors are whole combinations of exp(L t) h.
        let whole = (f * h0).try_inverse().unwrap() * packing.cell.h;
        prop_assert!(whole.iter().all(|w| (w - w.round()).abs() < 1e-12), "{}", whole);
        prop_assert!((whole.determinant() - 1.0).abs() < 1e-12 * whole.norm_squared());
        let inverse = packing.cell.inverse().unwrap();
        for (old, new) in x0.iter().zip(packing.plain_discs()) {
            let s = inverse * (Vector2::from(new.x) - f * Vector2::from(old.x));
            prop_assert!(s.iter().all(|s| (s - s.round()).abs() < 1e-11), "{}", s);
        }
        prop_assert!((packing.cell.area() / h0.determinant() / (l.trace() * 0.01).exp() - 1.0).abs() < 1e-12);
        // The motion is all affine: there is no peculiar velocity, so no kinetic energy.
        prop_assert_eq!(packing.kinetic_energy(), 0.0);
    }
}

/// A peculiar velocity in a deforming cell decays as `du/dt = -L u` (SLLOD): `u = exp(-L t) u(0)`,
/// first order in the DEM step.
#[test]
fn peculiar_velocity_in_a_deforming_cell() {
    let l = Matrix2::new(-1.0, 2.0, 0.5, 0.3);
    let mut element = gas();
    let mut momentum = Vector2::zeros();
    for (k, d) in element.rve.packing.discs.iter_mut().enumerate() {
        // Opposite pairs: no drift to be removed. Equal radii, so equal masses.
        let sign = [1.0, -1.0, 0.0][k % 3];
        d.u = [sign * 0.01, sign * -0.02];
        momentum += Vector2::from(d.u);
    }
    assert_eq!(momentum, Vector2::zeros());
    for _ in 0..1000 {
        element.advance(&l).unwrap();
    }
    let expected = cell::exp(&(l * -0.1)) * Vector2::new(0.01, -0.02);
    let u = Vector2::from(element.rve.packing.discs[0].u);
    assert!((u - expected).norm() < 1e-4 * expected.norm(), "{u} {expected}");
}

/// Reduction renames lattice vectors only. The same discs in a reduced and in an oblique cell have
/// the same stress, contacts and positions up to lattice vectors.
#[test]
fn an_oblique_cell_is_the_same_packing() {
    let p = parameters(20.0e3, DENSE);
    let packing = packing(&p, 1);
    let discs = packing.plain_discs();
    let mass = |r| p.grains.disc_mass(r);
    let h = packing.cell.h;
    let straight = stepwise(Packing::<f64>::new(packing.cell, &discs, mass), &p);
    for skew in [
        Matrix2::new(1.0, 3.0, 0.0, 1.0),
        Matrix2::new(1.0, 0.0, -2.0, 1.0),
        Matrix2::new(2.0, 1.0, 1.0, 1.0),
    ] {
        let oblique = stepwise(Packing::<f64>::new(Cell { h: h * skew }, &discs, mass), &p);
        let error = (oblique.state.stress - straight.state.stress).norm();
        assert!(error < 1e-9 * straight.state.stress.norm(), "{error}");
        assert_eq!(oblique.state.coordination, straight.state.coordination);
        assert!(oblique.state.min_width > 0.8 * straight.state.min_width);
    }
}

/// A step that shears the cell across its reduction changes forces and history no more than the
/// step before it: nothing is lost when the lattice is renamed.
#[test]
fn reduction_keeps_forces_and_history() {
    let p = parameters(20.0e3, DENSE);
    let mut element = stepwise(packing(&p, 1), &p);
    let l = Matrix2::new(0.0, 5.0, 0.0, 0.0);
    let tangential = |e: &Element<f64>| -> Vec<(usize, usize, f64)> {
        let mut list: Vec<_> = e.rve.packing.contacts().map(|c| (c.i, c.j, c.tangential)).collect();
        list.sort_by_key(|c| (c.0, c.1));
        list
    };
    let mut reductions = 0;
    while element.strain[(0, 1)] < 1.7 {
        let before = element.clone();
        element.advance(&l).unwrap();
        let [old, new] = [&before, &element].map(|e| e.rve.packing.cell.h[(0, 1)]);
        if (new - old).abs() < 0.5 * element.rve.packing.cell.h[(0, 0)] {
            continue;
        }
        reductions += 1;
        let kept: Vec<_> = tangential(&before);
        let now = tangential(&element);
        let found = kept
            .iter()
            .filter(|a| a.2 != 0.0)
            .filter(|a| now.iter().any(|b| (a.0, a.1) == (b.0, b.1) && b.2 != 0.0))
            .count();
        let all = kept.iter().filter(|a| a.2 != 0.0).count();
        assert!(all > 300 && all - found <= 3, "{found} of {all} springs kept");
        let jump =
            (element.state.stress - before.state.stress).norm() / element.state.stress.norm();
        assert!(jump < 0.02, "stress jumps by {jump}");
    }
    assert_eq!(reductions, 2);
}

/// A velocity gradient that is not finite, and one that collapses the cell, are errors.
#[test]
fn impossible_motions_are_errors() {
    for bad in [f64::NAN, f64::INFINITY, -1e9] {
        let p = parameters(20.0e3, DENSE);
        let mut element = stepwise(packing(&p, 1), &p);
        let mut outcome = Ok(());
        for _ in 0..3 {
            outcome = outcome.and_then(|()| element.advance(&Matrix2::new(bad, 0.0, 0.0, 0.0)));
        }
        let error = outcome.expect_err("must fail");
        let dem::element::StageError::Failed { failure, .. } = error else { panic!("{error}") };
        assert_eq!(failure, Failure::NotFinite, "L_xx = {bad}");
    }
}
