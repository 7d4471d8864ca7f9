//! Cells only a few discs wide, where a disc meets several images of its neighbours and itself.

use std::collections::HashMap;

use dem::element::Element;
use dem::{Cell, Forces, Grains, Packing, PlainDisc, Rve, RveParameters, Substepping, consolidate};
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;
use rstest::rstest;

fn parameters(discs: usize) -> RveParameters {
    RveParameters { discs, thin_width: 0.0, free_solid_fraction: 0.0, ..RveParameters::default() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Forces and stress of discs thrown at random into a cell down to 0.4 discs wide equal the
    /// sums over all images out to ±40 periods.
    #[test]
    fn forces_equal_the_sum_over_all_images(
        width in 4e-3..3e-2f64,
        length in 3e-2..1e-1f64,
        skew in -2.0..2.0f64,
        turn in 0.0..6.3f64,
        places in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64, 2.5e-3..5e-3f64), 1..12),
    ) {
        let rotation = Matrix2::new(turn.cos(), -turn.sin(), turn.sin(), turn.cos());
        let cell = Cell { h: rotation * Matrix2::new(width, skew * width, 0.0, length) };
        let discs: Vec<PlainDisc> = places
            .iter()
            .map(|&(a, b, r)| PlainDisc { x: (cell.h * Vector2::new(a, b)).into(), r })
            .collect();
        let p = RveParameters { grains: Grains { overlap_limit: f64::INFINITY, ..parameters(discs.len()).grains }, kinetic_stress: false, ..parameters(discs.len()) };
        let packing = Packing::<f64>::new(cell, &discs, |r| p.grains.disc_mass(r));
        let mut forces = Forces::default();
        // One step much shorter than anything: forces at the initial positions.
        let sub = Substepping::new(&p, 1e-12);
        let state = Rve::new(packing.clone())
            .advance(&Matrix2::zeros(), &p, &sub, &packing, &mut forces)
            .unwrap();

        let mut expected = vec![Vector2::zeros(); discs.len()];
        let mut virial = Matrix2::zeros();
        let mut contacts = 0.0;
        for (i, a) in discs.iter().enumerate() {
            for (j, b) in discs.iter().enumerate() {
                for k in -40..=40 {
                    for m in -40..=40 {
                        if i == j && (k, m) == (0, 0) {
                            continue;
                        }
                        let shift = cell.h * Vector2::new(f64::from(k), f64::from(m));
                        let branch = Vector2::from(b.x) - Vector2::from(a.x) + shift;
                        let overlap = a.r + b.r - branch.norm();
                        if overlap > 0.0 {
                            let f = branch.normalize() * (p.grains.normal_stiffness * overlap);
                            // Each contact is met from both sides: count halves.
                            expected[i] -= f;
                            virial += 0.5 * f * branch.transpose();
                            contacts += 0.5;
                        }
                    }
                }
            }
        }
        let scale = virial.norm().max(1e-9);
        prop_assert!((state.coordination * discs.len() as f64 / 2.0 - contacts).abs() < 1e-9);
        for (f, e) in forces.on_disc.iter().zip(&expected) {
            prop_assert!((Vector2::new(f[0], f[1]) - e).norm() < 1e-9 * scale / 1e-2, "{:?} {}", f, e);
        }
        let stress = virial / (cell.area() * p.grains.thickness);
        prop_assert!((state.stress - stress).norm() < 1e-9 * stress.norm().max(1e-9));
    }
}

/// The packing repeated `nx` x `ny` times in a larger cell, without history.
fn repeated(packing: &Packing<f64>, nx: i32, ny: i32, p: &RveParameters) -> Packing<f64> {
    let h = packing.cell.h;
    let discs: Vec<PlainDisc> = (0..nx * ny)
        .flat_map(|k| {
            let shift = h * Vector2::new(f64::from(k % nx), f64::from(k / nx));
            packing
                .plain_discs()
                .into_iter()
                .map(move |d| PlainDisc { x: [d.x[0] + shift.x, d.x[1] + shift.y], ..d })
        })
        .collect();
    let cell = Cell { h: h * Matrix2::new(f64::from(nx), 0.0, 0.0, f64::from(ny)) };
    Packing::new(cell, &discs, |r| p.grains.disc_mass(r))
}

/// A packing of 1, 2, 5 or 12 discs (a disc alone touches only itself) and the same packing
/// repeated until the cell is wide enough for the ordinary search follow the same stress path
/// under shear, also past reductions of the lattice, which the two cells meet at different strains.
///
/// Round-off grows in a packing, and once a repeated packing has lost its symmetry it is another
/// one; the strain is as large as that allows.
#[rstest]
#[case(1, [6, 12], 0.8)]
#[case(2, [6, 4], 0.15)]
#[case(5, [3, 6], 0.3)]
#[case(12, [2, 3], 0.1)]
fn a_thin_cell_equals_its_repetition(
    #[case] discs: usize,
    #[case] times: [i32; 2],
    #[case] strain: f64,
) {
    let mut p = parameters(discs);
    p.preparation.pressure = 20.0e3;
    let thin = consolidate(&p, 3).unwrap();
    let wide = repeated(&thin, times[0], times[1], &p);
    let thin = repeated(&thin, 1, 1, &p);
    let mut elements = [thin, wide].map(|packing| Element::new(packing, &p, 1e-4).unwrap());
    let l = Matrix2::new(0.0, 20.0, 0.0, 0.0);
    let mut largest: f64 = 0.0;
    let mut scale: f64 = 0.0;
    while elements[0].strain[(0, 1)] < strain {
        elements.iter_mut().for_each(|e| e.advance(&l).unwrap());
        let [a, b] = [0, 1].map(|k: usize| elements[k].state);
        scale = scale.max(a.stress.norm());
        largest = largest.max((a.stress - b.stress).norm());
        assert!((a.solid_fraction - b.solid_fraction).abs() < 1e-12);
    }
    println!("{discs} discs: stress differs by {:.1e} of its largest", largest / scale);
    assert!(scale > 1e3, "the packing carries no stress");
    assert!(largest < 1e-6 * scale, "{:.1e}", largest / scale);
}

/// A cell thinner than `thin_width` mean diameters takes volume and spin only, and says so; it still
/// carries stress and follows the imposed area.
#[test]
fn a_thin_cell_is_not_thinned_further() {
    let p = crate::common::parameters(20.0e3, crate::common::DENSE);
    let mut element = Element::new(crate::common::packing(&p, 1), &p, 1e-4).unwrap();
    let l = Matrix2::new(100.0, 0.0, 0.0, -100.0);
    let area = element.state.area;
    let mut widths = HashMap::new();
    for _ in 0..300 {
        element.advance(&l).unwrap();
        widths.insert(element.state.thin, element.state.min_width);
    }
    assert!(element.thin_steps > 0 && element.thin_steps < 300);
    let limit = p.thin_width * p.grains.mean_diameter();
    assert!(widths[&true] > 0.98 * limit, "{} m", widths[&true]);
    assert!((element.state.area / area - 1.0).abs() < 1e-9);
    assert!(element.state.stress.trace() > 0.0);
}
