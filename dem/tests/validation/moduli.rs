//! D7, D17. Stiffness of packings: mean field, static and over time.

use dem::element::Element;
use dem::{Grains, Packing, RveParameters};
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rstest::rstest;

use crate::common::{DENSE, LOOSE, MEDIUM, expect, packing, parameters, settle, stepwise};

/// One contact as a linear spring pair: normal and tangent, branch and arms.
struct Spring {
    i: usize,
    j: usize,
    n: Vector2<f64>,
    t: Vector2<f64>,
    branch: Vector2<f64>,
    arms: [f64; 2],
}

fn springs(packing: &Packing<f64>) -> Vec<Spring> {
    packing
        .contacts()
        .map(|c| {
            let n = c.branch.normalize();
            let arm = |k: usize| packing.discs[k].r - 0.5 * c.overlap;
            Spring {
                i: c.i,
                j: c.j,
                n,
                t: Vector2::new(-n.y, n.x),
                branch: c.branch,
                arms: [arm(c.i), arm(c.j)],
            }
        })
        .collect()
}

/// Stress per strain (N/m, i.e. times thickness) of affinely moved contacts (Voigt; Kruyt and
/// Rothenburg): `sum_c (kn n.E l n + kt t.E l t) (x) l / A`, symmetrised.
fn voigt(packing: &Packing<f64>, p: &RveParameters, strain: &Matrix2<f64>) -> Matrix2<f64> {
    let mut sum = Matrix2::zeros();
    for s in springs(packing) {
        let d = strain * s.branch;
        let f = s.n * (p.grains.normal_stiffness * s.n.dot(&d))
            + s.t * (p.grains.tangential_stiffness * s.t.dot(&d));
        sum += f * s.branch.transpose();
    }
    (sum + sum.transpose()) / (2.0 * packing.cell.area())
}

/// The same after the discs have moved and turned to equilibrium, by a linear solution of the
/// whole packing: an implementation that shares nothing with the time integration.
fn relaxed(packing: &Packing<f64>, p: &RveParameters, strain: &Matrix2<f64>) -> Matrix2<f64> {
    let n = 3 * packing.discs.len();
    let scale = 1.0 / p.grains.mean_diameter();
    let springs = springs(packing);
    // Rows: what a unit of each unknown (two displacements, rotation times mean diameter) adds to
    // the normal and tangential deformation of a contact.
    let columns = |s: &Spring| {
        let rows = |axis: Vector2<f64>, turn: f64| {
            [
                (3 * s.i, -axis.x),
                (3 * s.i + 1, -axis.y),
                (3 * s.i + 2, -turn * s.arms[0] * scale),
                (3 * s.j, axis.x),
                (3 * s.j + 1, axis.y),
                (3 * s.j + 2, -turn * s.arms[1] * scale),
            ]
        };
        [
            (p.grains.normal_stiffness, s.n, rows(s.n, 0.0)),
            (p.grains.tangential_stiffness, s.t, rows(s.t, 1.0)),
        ]
    };
    let mut matrix = DMatrix::<f64>::zeros(n, n);
    let mut load = DVector::<f64>::zeros(n);
    for s in &springs {
        let affine = strain * s.branch;
        for (k, axis, row) in columns(s) {
            for (a, x) in row {
                load[a] -= k * x * axis.dot(&affine);
                for (b, y) in row {
                    matrix[(a, b)] += k * x * y;
                }
            }
        }
    }
    // Rattlers and the translation of all discs have no stiffness.
    for a in 0..n {
        matrix[(a, a)] += 1e-8 * p.grains.normal_stiffness;
    }
    let x = matrix.cholesky().expect("positive definite").solve(&load);
    let mut sum = Matrix2::zeros();
    for s in &springs {
        let affine = strain * s.branch;
        for (k, axis, row) in columns(s) {
            let d = axis.dot(&affine) + row.iter().map(|(a, y)| x[*a] * y).sum::<f64>();
            sum += axis * (k * d) * s.branch.transpose();
        }
    }
    (sum + sum.transpose()) / (2.0 * packing.cell.area())
}

/// Bulk and shear modulus from a stress response.
fn bulk_and_shear(p: &RveParameters, response: impl Fn(&Matrix2<f64>) -> Matrix2<f64>) -> [f64; 2] {
    let bulk = response(&Matrix2::identity()).trace() / 4.0;
    let stretch = response(&Matrix2::new(1.0, 0.0, 0.0, -1.0));
    let shear = response(&Matrix2::new(0.0, 1.0, 1.0, 0.0));
    let g = (stretch[(0, 0)] - stretch[(1, 1)]) / 8.0 + shear[(0, 1)] / 4.0;
    [bulk, g].map(|m| m / p.grains.normal_stiffness)
}

/// The same packing with sticking contacts, at rest.
fn sticking(pressure: f64, friction: f64) -> (Element<f64>, RveParameters) {
    let prepared = parameters(pressure, friction);
    let p =
        RveParameters { grains: Grains { friction: 1e6, ..prepared.grains }, ..prepared.clone() };
    let mut element = stepwise(packing(&prepared, 1), &p);
    settle(&mut element, 0.05);
    (element, p)
}

/// Stress change (N/m) per strain after a strain of 1e-6 in one DEM step.
fn instant(element: &Element<f64>, strain: &Matrix2<f64>) -> Matrix2<f64> {
    let mut element = element.clone();
    let before = element.state.stress;
    element.advance(&(strain * (1e-6 / element.macro_step))).unwrap();
    element.advance(&Matrix2::zeros()).unwrap();
    (before - element.state.stress) * element.parameters.grains.thickness / 1e-6
}

/// The first answer of a packing is the mean-field one, to terms of the order of the overlap.
#[test]
fn the_instant_response_is_voigt() {
    let (element, p) = sticking(10.0e3, DENSE);
    // Neither the dashpots' answer to the strain rate nor what moves within the step (it grows
    // with the step squared) is part of the formula.
    let p =
        RveParameters { grains: Grains { damping_ratio: 0.0, step_factor: 0.02, ..p.grains }, ..p };
    let element = stepwise(element.rve.packing, &p);
    for strain in [
        Matrix2::new(1.0, 0.0, 0.0, 0.0),
        Matrix2::new(0.0, 0.0, 0.0, 1.0),
        Matrix2::new(0.0, 0.5, 0.5, 0.0),
    ] {
        let theory = voigt(&element.rve.packing, &p, &strain);
        let error = (instant(&element, &strain) - theory).norm() / theory.norm();
        println!("differs from Voigt by {error:.1e}");
        assert!(error < 5e-3, "{error:.1e}");
    }
}

/// D7. Bulk and shear moduli over kn: slow DEM probing against the linear solution of the same
/// packing (1 % for K, 3 % for G; 6 % for the small
/// G of loose packings, of which the prestress, left out of the solution, is 1 %), and both against the values of another code for packings made
/// alike at kn / (p t) = 1333 (K 0.478, 0.415, 0.274 ± 10 %, G 0.376, 0.284, 0.085 ± 15 %, loose
/// within a factor of 1.6: its fabric scatters).
#[rstest]
#[case::dense(DENSE, [0.478, 0.376], [0.05, 0.06], 0.03)]
#[case::medium(MEDIUM, [0.415, 0.284], [0.05, 0.06], 0.03)]
#[case::loose(LOOSE, [0.274, 0.085], [0.06, 0.05], 0.06)]
fn static_moduli(
    #[case] friction: f64,
    #[case] table: [f64; 2],
    #[case] tolerance: [f64; 2],
    #[case] shear_error: f64,
) {
    let (element, p) = sticking(10.0e3, friction);
    let packing = &element.rve.packing;
    println!("phi {:.4}, Z {:.2}", packing.solid_fraction(), element.state.coordination);
    let affine = bulk_and_shear(&p, |e| voigt(packing, &p, e));
    let linear = bulk_and_shear(&p, |e| relaxed(packing, &p, e));
    let probed = bulk_and_shear(&p, |e| {
        let mut probe = element.clone();
        let strain = 1e-6;
        let before = probe.state.stress;
        let steps = 400;
        for _ in 0..steps {
            probe.advance(&(e * (strain / f64::from(steps) / probe.macro_step))).unwrap();
        }
        settle(&mut probe, 0.1);
        (before - probe.state.stress) * p.grains.thickness / strain
    });
    for (k, name) in ["K", "G"].into_iter().enumerate() {
        println!(
            "{name}/kn: Voigt {:.3}, linear {:.3}, DEM {:.3}",
            affine[k], linear[k], probed[k]
        );
        expect(&format!("{name} DEM / linear"), probed[k] / linear[k], 1.0, [0.01, shear_error][k]);
        expect(&format!("{name} / kn"), probed[k], table[k], tolerance[k]);
    }
}

/// D17. A uniaxial strain ramp of 0.1 ms is answered by the Voigt modulus, and relaxes within
/// 0.5 ms to the static one.
#[test]
fn an_affine_ramp_is_answered_by_the_voigt_modulus() {
    let p = parameters(20.0e3, DENSE);
    let mut element = stepwise(packing(&p, 1), &p);
    settle(&mut element, 0.05);
    let strain = 1e-5;
    let up = Matrix2::new(0.0, 0.0, 0.0, -1.0);
    let theory = -voigt(&element.rve.packing, &p, &up)[(1, 1)] / p.grains.normal_stiffness;
    let before = element.state.stress[(1, 1)];
    let modulus = |e: &Element<f64>| {
        (e.state.stress[(1, 1)] - before) * p.grains.thickness / strain / p.grains.normal_stiffness
    };
    let steps = p.grains.substeps(1e-4);
    for _ in 0..steps {
        element.advance(&(up * (strain / steps as f64 / element.macro_step))).unwrap();
    }
    let ramp = modulus(&element);
    let hold = |element: &mut Element<f64>, duration: f64| {
        for _ in 0..(duration / element.macro_step) as usize {
            element.advance(&Matrix2::zeros()).unwrap();
        }
    };
    hold(&mut element, 5e-4);
    let held = modulus(&element);
    hold(&mut element, 0.1);
    let rest = modulus(&element);
    println!("M/kn: Voigt {theory:.3}, ramp {ramp:.3}, after 0.5 ms {held:.3}, at rest {rest:.3}");
    expect("ramp / Voigt", ramp / theory, 1.0, 0.06);
    expect("held / Voigt", held / theory, 0.92 / 1.13, 0.05);
    expect("rest / Voigt", rest / theory, 0.94 / 1.13, 0.05);
}
