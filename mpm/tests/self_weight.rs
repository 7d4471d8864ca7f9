//! A column under its own weight, at rest.

mod common;

use std::f64::consts::PI;

use common::*;
use mpm::{Basis, Elastic, Numerics, Points, Scheme, Vec2, WallContact};
use rstest::rstest;

struct Column {
    height: f64,
    density: f64,
    young: f64,
}

/// Points after the column settled, and their initial heights. Velocity is damped at twice the
/// first frequency: critical for the first mode, which is then gone after a few periods.
fn settle(
    column: &Column,
    numerics: Numerics,
    cell: f64,
    points_per_cell: usize,
) -> (Points, Vec<f64>) {
    let Column { height, density, young } = *column;
    let top = (height / cell).ceil() * cell + 2.0 * cell;
    let mut solver = smooth_box(Vec2::new(cell, top), cell, numerics, Vec2::new(0.0, -GRAVITY));
    let spacing = cell / points_per_cell as f64;
    let mut points = Points::rectangle(Vec2::zeros(), Vec2::new(cell, height), spacing, density);
    let start = points.position.iter().map(|x| x.y).collect();
    let mut material: Elastic = elastic(young, 0.0);
    let c = (young / density).sqrt();
    let omega = PI * c / (2.0 * height);
    let dt = 0.3 * cell / c;
    for _ in 0..(4.0 * std::f64::consts::TAU / omega / dt) as usize {
        for v in &mut points.velocity {
            *v *= 1.0 - 2.0 * omega * dt;
        }
        solver.advance(&mut points, &mut material, dt).unwrap();
    }
    (points, start)
}

/// `sigma_yy / (- rho_0 g (H - Y))`, with Y the initial height: 1, as the weight above a point does
/// not depend on the law.
fn relative_stress(column: &Column, points: &Points, start: &[f64]) -> Vec<f64> {
    let weight = |y: f64| -column.density * GRAVITY * (column.height - y);
    points.stress.iter().zip(start).map(|(s, &y)| s[(1, 1)] / weight(y)).collect()
}

/// Relative error of stress (rms over the base stress) further than 0.5 m from base and top.
fn inner_stress_error(column: &Column, basis: Basis, cell: f64) -> f64 {
    let (points, start) = settle(column, flip(basis, Scheme::Musl), cell, 2);
    let ratio = relative_stress(column, &points, &start);
    let inner = |y: f64| y > 0.5 && y < column.height - 0.5;
    let errors: Vec<f64> = start
        .iter()
        .zip(&ratio)
        .filter(|(y, _)| inner(**y))
        .map(|(y, r)| (r - 1.0) * (1.0 - y / column.height))
        .collect();
    rms(errors.into_iter())
}

/// A column of dense grains (3 m, M = 8.5 MPa) settles by `rho g H² / 2M = 11.3 mm` at the top and
/// carries 64 kPa at its base. Splines reach behind walls and disturb the stress in the cells next to them, by up
/// to a quarter in the first one and alternating in sign; four cells away it is gone. (What remains of linear
/// functions and uGIMP is their stress being constant in a cell.)
#[rstest]
#[case(Basis::Linear, WallContact::Nodes, 0.03)]
#[case(Basis::Gimp, WallContact::Nodes, 0.03)]
#[case(Basis::Quadratic, WallContact::Nodes, 0.26)]
#[case(Basis::Cubic, WallContact::Nodes, 0.30)]
#[case(Basis::Linear, WallContact::Points, 0.03)]
#[case(Basis::Gimp, WallContact::Points, 0.03)]
#[case(Basis::Quadratic, WallContact::Points, 0.26)]
#[case(Basis::Cubic, WallContact::Points, 0.30)]
fn a_stiff_column_settles_and_carries_its_weight(
    #[case] basis: Basis,
    #[case] wall_contact: WallContact,
    #[case] at_the_wall: f64,
) {
    let column = Column { height: 3.0, density: 2173.0, young: 8.5e6 };
    let numerics = Numerics { wall_contact, ..flip(basis, Scheme::Musl) };
    let (points, start) = settle(&column, numerics, 0.125, 2);
    let last = points.len() - 1;
    let settlement = start[last] - points.position[last].y;
    let expected = column.density * GRAVITY * column.height.powi(2) / (2.0 * column.young);
    let ratio = relative_stress(&column, &points, &start);
    // Two points a row, two rows a cell.
    let cells: Vec<String> = ratio[..20].iter().step_by(2).map(|r| format!("{r:.3}")).collect();
    println!(
        "{basis:?}, {wall_contact:?}: settlement {:.2} mm of {:.2}, stress from the base up: {}",
        1e3 * settlement,
        1e3 * expected,
        cells.join(" ")
    );
    assert!((settlement / expected - 1.0).abs() < 0.03);
    assert!(ratio[..16].iter().all(|r| (r - 1.0).abs() < at_the_wall));
    assert!(ratio[16..60].iter().all(|r| (r - 1.0).abs() < 0.04));
}

/// Convergence of the stress inside with the cell. A stiff column hardly moves and all bases
/// converge, splines faster than second order. A soft one sinks through many cells: the linear basis
/// gets worse under refinement, the others reach the quadrature error of two points a cell.
#[test]
fn stress_inside_converges_unless_points_cross_cells_of_a_linear_basis() {
    let study = |young: f64, basis: Basis| {
        let column = Column { height: 3.0, density: 2173.0, young };
        let errors = [12.0, 24.0, 48.0].map(|n| inner_stress_error(&column, basis, 3.0 / n));
        println!(
            "M = {young:.1e}, {basis:?}: {:.1e} {:.1e} {:.1e}",
            errors[0], errors[1], errors[2]
        );
        errors
    };
    let order = |e: [f64; 3]| (e[0] / e[2]).log2() / 2.0;
    assert!(order(study(8.5e6, Basis::Gimp)) > 0.9);
    assert!(order(study(8.5e6, Basis::Quadratic)) > 2.0);
    assert!(order(study(8.5e6, Basis::Cubic)) > 2.0);
    let linear = study(4.0e5, Basis::Linear);
    assert!(linear[2] > linear[0] && linear[2] > 0.1);
    assert!(study(4.0e5, Basis::Gimp)[2] < 0.015);
    assert!(study(4.0e5, Basis::Quadratic)[2] < 0.015);
    assert!(study(4.0e5, Basis::Cubic)[2] < 0.003);
}

/// Hydrostatic column, 0.2 m x 0.1 m, rho = 1800, E = 1 MPa, nu = 0 (test of the CB-Geo MPM code):
/// the base stress tends to `- rho g H = -1765.8 Pa`; that code has -1680.2, -1724.6 and -1746.8 Pa
/// at cells of 10, 5 and 2.5 mm with one point a cell, i.e. the stress half a cell above the base.
#[test]
fn the_hydrostatic_column_of_the_literature() {
    let column = Column { height: 0.1, density: 1800.0, young: 1.0e6 };
    for (cell, peer) in [(0.01, -1680.244), (0.005, -1724.583), (0.0025, -1746.791)] {
        let (points, start) = settle(&column, flip(Basis::Linear, Scheme::Usf), cell, 1);
        let (quadratic, _) = settle(&column, flip(Basis::Quadratic, Scheme::Usf), cell, 2);
        let exact = -column.density * GRAVITY * (column.height - start[0]);
        let ours = points.stress[0][(1, 1)];
        println!(
            "cell {cell}: {ours:.2} Pa, peer {peer}, exact at that height {exact:.2}; quadratic {:.2}",
            quadratic.stress[0][(1, 1)]
        );
        assert!((ours / peer - 1.0).abs() < 3.0e-3);
        assert!((ours / exact - 1.0).abs() < 3.0e-3);
    }
}
