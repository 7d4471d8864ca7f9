//! The bound on the step against what a step really does.

mod common;

use common::*;
use mpm::{Basis, Mat2, Material, Numerics, Points, Scheme, Vec2};
use rstest::rstest;

/// A block whose points are shaken out of their lattice by up to half their spacing.
fn shaken_block(cell: f64) -> Points {
    let mut points =
        Points::rectangle(Vec2::new(0.33, 0.37), Vec2::new(0.83, 0.87), cell / 2.0, 1000.0);
    for (p, x) in points.position.iter_mut().enumerate() {
        // Low-discrepancy sequence (golden ratio and its square).
        let [a, b] = [0.618_033_988_75, 0.754_877_666_25].map(|r| (p as f64 * r).fract() - 0.5);
        *x += Vec2::new(a, b) * cell * 0.25;
    }
    points
}

/// Whether a block stays at rest (up to round-off noise) over 2000 steps of so many bounds.
fn stable(basis: Basis, scheme: Scheme, bounds: f64) -> bool {
    let cell = 0.1;
    let mut points = shaken_block(cell);
    let mut material = elastic(1.0e6, 0.2);
    let mut solver = smooth_box(Vec2::new(1.2, 1.2), cell, flip(basis, scheme), Vec2::zeros());
    for (p, v) in points.velocity.iter_mut().enumerate() {
        *v = Vec2::new((p as f64).sin(), (p as f64 * 1.7).cos()) * 1.0e-9;
    }
    let dt = bounds * solver.stable_step(&points, &material).unwrap().gershgorin;
    (0..2000).all(|_| {
        solver.advance(&mut points, &mut material, dt).is_ok()
            && points.velocity.iter().all(|v| v.norm() < 1.0e-6)
    })
}

/// Safe below Gershgorin's bound, unstable far above it.
#[rstest]
fn the_bound_is_safe_and_not_far_off(
    #[values(Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic)] basis: Basis,
    #[values(Scheme::Musl, Scheme::Usf, Scheme::Usl)] scheme: Scheme,
) {
    let mut bounds = 1.0;
    while stable(basis, scheme, bounds) {
        bounds *= 1.1;
        assert!(bounds < 10.0, "the bound is far off");
    }
    println!("{basis:?} {scheme:?}: unstable at {bounds:.2} bounds");
    assert!(bounds > 1.0, "unstable below the bound");
}

/// One point in the middle of a linear cell: `grad S` is `1 / 2 dx` along each axis, so
/// `k = V M (1 / sqrt 2 dx)(4 / sqrt 2 dx) = 2 V M / dx²` and `m_i = m / 4`: `dt = 2 / sqrt(k / m_i) =
/// dx / (sqrt 2 c)`, and a root of two less under USL.
#[test]
fn one_point_by_hand() {
    let (cell, modulus) = (0.5, 4.0e6);
    struct Stiff(f64);
    impl Material for Stiff {
        fn update(
            &mut self,
            _: f64,
            _: &[Mat2],
            _: &mut [Mat2],
            _: &mut [f64],
        ) -> Result<(), mpm::MaterialError> {
            Ok(())
        }
        fn wave_modulus(&self, _: usize) -> f64 {
            self.0
        }
    }
    let solver =
        smooth_box(Vec2::new(2.0, 2.0), cell, flip(Basis::Linear, Scheme::Musl), Vec2::zeros());
    let mut points = Points::default();
    points.push(Vec2::new(0.75, 0.75), 250.0, 0.25);
    points.velocity[0] = Vec2::new(3.0, -4.0);
    points.velocity_gradient[0] = Mat2::new(0.0, 2.0, 0.0, 0.0);
    let c = (modulus / 1000.0_f64).sqrt();
    let stable = solver.stable_step(&points, &Stiff(modulus)).unwrap();
    assert!((stable.gershgorin / (cell / (2.0_f64.sqrt() * c)) - 1.0).abs() < 1e-12);
    let usl =
        smooth_box(Vec2::new(2.0, 2.0), cell, flip(Basis::Linear, Scheme::Usl), Vec2::zeros());
    let usl = usl.stable_step(&points, &Stiff(modulus)).unwrap();
    assert!((stable.gershgorin / usl.gershgorin - 2.0_f64.sqrt()).abs() < 1e-12);
    assert!((stable.cfl / (cell / (c + 5.0)) - 1.0).abs() < 1e-12);
    assert!((stable.courant(stable.cfl) - 1.0).abs() < 1e-12);
    assert_eq!((stable.point, stable.speed), (0, 5.0));
    assert!((stable.strain_rate - 2.0_f64.sqrt()).abs() < 1e-12);
}

/// The same point in a shock: with the viscosity `nu = (w h)² |tr L|`, which acts on the velocity before the step, the
/// node is stable while `8 c² dt² / 4 dx² + 8 nu dt / 2 dx² <= 1`.
#[test]
fn the_viscosity_of_a_shock_lowers_the_bound() {
    let (cell, compression, shock_width) = (0.5, 20.0, 3.0);
    let material = elastic(4.0e6, 0.0);
    let numerics = Numerics { shock_width, ..flip(Basis::Linear, Scheme::Musl) };
    let solver = smooth_box(Vec2::new(2.0, 2.0), cell, numerics, Vec2::zeros());
    let mut points = Points::default();
    points.push(Vec2::new(0.75, 0.75), 250.0, 0.25);
    let mut bound = |rate: f64| {
        points.velocity_gradient[0] = Mat2::new(rate, 0.0, 0.0, 0.0);
        solver.stable_step(&points, &material).unwrap().gershgorin
    };
    let (at_rest, expanding, shocked) = (bound(0.0), bound(compression), bound(-compression));
    assert_eq!(at_rest, expanding);
    let (c2, nu) = (4.0e6 / 1000.0, (shock_width * cell).powi(2) * compression);
    let sum = (8.0 * c2 * shocked.powi(2) / 4.0 + 8.0 * nu * shocked / 2.0) / (cell * cell);
    assert!((sum - 1.0).abs() < 1e-12, "{shocked} instead of {at_rest}");
}
