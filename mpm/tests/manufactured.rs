//! Order of accuracy by a manufactured solution (Wallstedt & Guilkey 2008, J. Comput. Phys. 227,
//! 9628), in one dimension.
//!
//! A bar `X in [-1/2, 3/2]`, rho_0 = E = 1, c = 1, of the law `P = (E/2)(F - 1/F)`, moves as
//! `u = A sin(pi X) sin(c pi t)`. With `F = 1 + A pi cos(pi X) sin(c pi t)` this needs the body
//! force `b = (c² pi² u / 2)(1/F² - 1)`. The ends are where `F = 1`: free, and no wall takes part.

mod common;

use std::f64::consts::PI;

use common::*;
use mpm::{Basis, Mat2, Material, MaterialError, Points, Scheme, Vec2};

/// `sigma = P` for a bar of constant width, with F kept by every point.
struct NeoHookeanBar {
    stretch: Vec<f64>,
}

impl Material for NeoHookeanBar {
    fn update(
        &mut self,
        dt: f64,
        velocity_gradient: &[Mat2],
        stress: &mut [Mat2],
        volume: &mut [f64],
    ) -> Result<(), MaterialError> {
        for (p, f) in self.stretch.iter_mut().enumerate() {
            let step = 1.0 + dt * velocity_gradient[p][(0, 0)];
            *f *= step;
            volume[p] *= step;
            stress[p][(0, 0)] = 0.5 * (*f - 1.0 / *f);
        }
        Ok(())
    }

    fn wave_modulus(&self, _: usize) -> f64 {
        1.0
    }
}

/// Rms error of displacement over the amplitude at `c pi t = 3 pi / 2`, when it is largest for the
/// second time.
fn error(basis: Basis, amplitude: f64, cells: usize, points_per_cell: f64) -> f64 {
    let cell = 1.0 / cells as f64;
    // The bar begins a third of a cell off a node line: nothing is aligned.
    let shift = 1.0 + cell / 3.0;
    let mut solver =
        smooth_box(Vec2::new(4.0, cell), cell, flip(basis, Scheme::Musl), Vec2::zeros());
    let mut points = Points::rectangle(
        Vec2::new(shift - 0.5, 0.0),
        Vec2::new(shift + 1.5, cell),
        cell / points_per_cell,
        1.0,
    );
    let start: Vec<f64> = points.position.iter().map(|x| x.x - shift).collect();
    let steps = (1.5 / (0.1 * cell)).round() as usize;
    let dt = 1.5 / steps as f64;
    // Leapfrog: velocities live half a step before positions.
    for (v, x) in points.velocity.iter_mut().zip(&start) {
        v.x = amplitude * PI * (PI * x).sin() * (PI * 0.5 * dt).cos();
    }
    let mut material = NeoHookeanBar { stretch: vec![1.0; points.len()] };
    for n in 0..steps {
        let swing = (PI * n as f64 * dt).sin();
        for (v, x) in points.velocity.iter_mut().zip(&start) {
            let u = amplitude * (PI * x).sin() * swing;
            let f = 1.0 + amplitude * PI * (PI * x).cos() * swing;
            v.x += dt * 0.5 * PI * PI * u * (1.0 / (f * f) - 1.0);
        }
        solver.advance(&mut points, &mut material, dt).unwrap();
    }
    let wrong = points
        .position
        .iter()
        .zip(&start)
        .map(|(x, x0)| x.x - shift - x0 + amplitude * (PI * x0).sin());
    rms(wrong) / amplitude
}

/// Errors at these numbers of cells per metre, and the orders between them.
fn study(
    basis: Basis,
    amplitude: f64,
    points_per_cell: f64,
    cells: &[usize],
) -> (Vec<f64>, Vec<f64>) {
    let errors: Vec<f64> =
        cells.iter().map(|&n| error(basis, amplitude, n, points_per_cell)).collect();
    let orders: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
    let shown: Vec<String> = errors.iter().map(|e| format!("{e:.1e}")).collect();
    println!(
        "A = {amplitude}, {basis:?}, {points_per_cell} points a cell: {} orders {orders:.2?}",
        shown.join(" ")
    );
    (errors, orders)
}

/// While no point crosses a cell face, every basis is of second order at least.
#[test]
fn all_bases_converge_while_points_stay_in_their_cells() {
    for basis in [Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic] {
        let (_, orders) = study(basis, 1.0e-4, 2.0, &[8, 16, 32]);
        assert!(orders[1] > 1.8);
    }
}

/// Strains of a third and crossing: the linear basis gets worse with every refinement. The others
/// are of second order until the quadrature error of their points shows, which is of order
/// `1 / dx` in the force: soon for uGIMP and quadratic splines with 2 points a cell, later with 4,
/// latest for cubic splines (Steffen, Kirby & Berzins 2008, IJNME 76, 922).
#[test]
fn smooth_bases_converge_down_to_their_quadrature_error_when_points_cross_cells() {
    let cells = [8, 16, 32];
    let (linear, orders) = study(Basis::Linear, 0.1, 2.0, &cells);
    assert!(orders.iter().all(|&o| o < 0.0));
    for basis in [Basis::Gimp, Basis::Quadratic] {
        let (errors, orders) = study(basis, 0.1, 2.0, &cells);
        assert!(orders[0] > 0.5 && errors[2] < 0.1 * linear[2]);
    }
    let (_, orders) = study(Basis::Quadratic, 0.1, 4.0, &cells);
    assert!(orders.iter().all(|&o| o > 1.7));
    let (_, orders) = study(Basis::Cubic, 0.1, 2.0, &cells);
    assert!(orders.iter().all(|&o| o > 1.9));
}
