//! Properties that hold for any points.

mod common;

use common::*;
use mpm::{Basis, Mat2, Numerics, Points, Scheme, Solver, Transfer, Vec2};
use proptest::prelude::*;

const BASES: [Basis; 4] = [Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic];
/// A point on a face of linear functions pulls at nodes that have none of its mass; their force is
/// dropped and their velocity unknown. No such trouble where gradients vanish with the values.
const SMOOTH: [Basis; 3] = [Basis::Gimp, Basis::Quadratic, Basis::Cubic];
const TRANSFERS: [Transfer; 4] = [
    Transfer::FlipApic { rate: 500.0 },
    Transfer::Flip { rate: 10.0 },
    Transfer::Apic,
    Transfer::Pic,
];

/// A coordinate in cells; often exactly on a node, a cell centre or the edge of a uGIMP domain.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        0.0..20.0,
        (0..=20_i32).prop_map(f64::from),
        (0..80_i32).prop_map(|k| f64::from(k) * 0.25),
    ]
}

/// Points anywhere in a box of 20 x 20 cells of 0.1 m, walls included.
fn points() -> impl Strategy<Value = Points> {
    let number = || -1.0..1.0;
    let point = (
        coordinate(),
        coordinate(),
        0.1..10.0,
        [number(), number()],
        [number(), number(), number(), number()],
    );
    prop::collection::vec(point, 1..60).prop_map(|list| {
        let mut points = Points::default();
        for (x, y, mass, v, c) in list {
            // Multiplying by the cell may round past the wall.
            points.push(Vec2::new((x * 0.1).min(2.0), (y * 0.1).min(2.0)), mass, 2.5e-3);
            *points.velocity.last_mut().unwrap() = Vec2::from(v);
            *points.affine.last_mut().unwrap() = Mat2::from_row_slice(&c);
        }
        points
    })
}

fn solver(basis: Basis, scheme: Scheme, transfer: Transfer) -> Solver {
    let numerics = Numerics { basis, scheme, transfer, mass_cutoff: 0.0, ..Numerics::default() };
    smooth_box(Vec2::new(2.0, 2.0), 0.1, numerics, Vec2::zeros())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    /// `sum S = 1`, `sum dS = 0`, `sum S i = x`, `sum dS i = 1`: constants and linear fields are exact.
    #[test]
    fn the_basis_reproduces_linear_fields(x in coordinate()) {
        for basis in BASES {
            let shape = basis.evaluate(x);
            let sum = |f: &[f64; 4], g: &dyn Fn(f64) -> f64| {
                f.iter().enumerate().map(|(k, v)| v * g((shape.first + k as i64) as f64)).sum::<f64>()
            };
            let one = |_: f64| 1.0;
            let node = |i: f64| i;
            prop_assert!((sum(&shape.value, &one) - 1.0).abs() < 1e-14);
            prop_assert!(sum(&shape.gradient, &one).abs() < 1e-14);
            prop_assert!((sum(&shape.value, &node) - x).abs() < 1e-13);
            prop_assert!((sum(&shape.gradient, &node) - 1.0).abs() < 1e-13);
            // The affine weights differentiate linear fields exactly as well.
            prop_assert!(sum(&shape.affine, &one).abs() < 1e-13);
            prop_assert!((sum(&shape.affine, &node) - 1.0).abs() < 1e-13);
            prop_assert!(shape.value.iter().all(|&s| s >= 0.0));
            prop_assert!(shape.value[basis.width()..].iter().all(|&s| s == 0.0));
        }
    }

    /// The gradient is the derivative of the value (central difference).
    #[test]
    fn gradients_are_derivatives(x in 1.0..19.0) {
        let h = 1.0e-6;
        for basis in BASES {
            let (a, b, c) = (basis.evaluate(x - h), basis.evaluate(x), basis.evaluate(x + h));
            if a.first == c.first {
                for k in 0..4 {
                    let slope = (c.value[k] - a.value[k]) / (2.0 * h);
                    // The second derivative of uGIMP functions jumps by 1 / 2l = 2.
                    prop_assert!((slope - b.gradient[k]).abs() < 1e-5, "{basis:?} {x}: {slope} {}", b.gradient[k]);
                }
            }
        }
    }

    /// Mapping to the grid and back keeps momentum; walls and projections book what they take.
    #[test]
    fn momentum_is_conserved(points in points(), scheme in 0..3_usize) {
        let scheme = [Scheme::Musl, Scheme::Usl, Scheme::Usf][scheme];
        for basis in SMOOTH {
            for transfer in TRANSFERS {
                let mut points = points.clone();
                let mut solver = solver(basis, scheme, transfer);
                let before = solver.budget(&points);
                let mut material = elastic(1.0e3, 0.3);
                for _ in 0..3 {
                    solver.advance(&mut points, &mut material, 1.0e-4).unwrap();
                }
                let after = solver.budget(&points);
                let error = after.momentum - before.momentum - after.contact.wall_impulse;
                prop_assert!(error.norm() < 1e-12 * before.mass, "{basis:?} {transfer:?}: {error}");
            }
        }
    }

    /// A linear velocity field `v = v0 + A x` passes through the grid unchanged under transfers with
    /// an affine part, and its gradient is A, for any arrangement of points off the walls.
    #[test]
    fn affine_transfers_carry_linear_velocity_fields(mut points in points(), a in prop::array::uniform4(-1.0..1.0)) {
        let a = Mat2::from_row_slice(&a);
        for x in &mut points.position {
            *x = *x * 0.5 + Vec2::new(0.5, 0.5);
        }
        let field = |x: &Vec2| Vec2::new(0.3, -0.2) + a * x;
        points.velocity = points.position.iter().map(field).collect();
        points.affine.fill(a);
        for basis in SMOOTH {
            for scheme in [Scheme::Musl, Scheme::Usl, Scheme::Usf] {
                for transfer in [Transfer::Apic, Transfer::default()] {
                    let mut moved = points.clone();
                    solver(basis, scheme, transfer).advance(&mut moved, &mut Dust, 1.0e-4).unwrap();
                    for p in 0..points.len() {
                        prop_assert!((moved.velocity[p] - points.velocity[p]).norm() < 1e-12);
                        prop_assert!((moved.velocity_gradient[p] - a).norm() < 1e-9);
                        prop_assert!((moved.affine[p] - a).norm() < 1e-9);
                        let expected = points.position[p] + points.velocity[p] * 1.0e-4;
                        prop_assert!((moved.position[p] - expected).norm() < 1e-14);
                    }
                }
            }
        }
    }

    /// Points on nodes, faces, walls and corners move, and stay in the box.
    #[test]
    fn no_point_leaves_the_box(points in points()) {
        for basis in BASES {
            let mut points = points.clone();
            let mut solver = solver(basis, Scheme::Musl, Transfer::Flip { rate: 0.0 });
            for _ in 0..30 {
                solver.advance(&mut points, &mut Dust, 0.02).unwrap();
            }
            prop_assert!(points.position.iter().all(|x| x.min() >= 0.0 && x.max() <= 2.0));
        }
    }

    /// Averaging `tr L` over cells keeps its volume-weighted mean and the deviator.
    #[test]
    fn cell_averaging_keeps_the_total_volume_rate(points in points()) {
        let run = |cell_average_volumetric| {
            let mut points = points.clone();
            let numerics = Numerics { cell_average_volumetric, ..Numerics::default() };
            let mut solver = smooth_box(Vec2::new(2.0, 2.0), 0.1, numerics, Vec2::zeros());
            solver.advance(&mut points, &mut Dust, 1.0e-4).unwrap();
            points.velocity_gradient
        };
        let (plain, averaged) = (run(false), run(true));
        let total = |l: &[Mat2]| l.iter().map(|l| l.trace()).sum::<f64>();
        prop_assert!((total(&plain) - total(&averaged)).abs() < 1e-9);
        for (a, b) in plain.iter().zip(&averaged) {
            let change = b - a;
            prop_assert!(change[(0, 1)] == 0.0 && change[(1, 0)] == 0.0);
            prop_assert!((change[(0, 0)] - change[(1, 1)]).abs() < 1e-10);
        }
    }
}
