//! The Drucker–Prager / mu(I) law on one point, and collapses with it.

mod common;

use common::*;
use mpm::{
    Basis, Domain, DruckerPrager, DruckerPragerParameters, Friction, Mat2, Material, Numerics,
    Points, Solver, Transfer, Vec2, Walls,
};

/// One point driven by a constant velocity gradient.
fn drive(
    material: &mut DruckerPrager,
    stress: &mut Mat2,
    volume: &mut f64,
    l: Mat2,
    dt: f64,
    steps: usize,
) {
    for _ in 0..steps {
        material
            .update(dt, &[l], std::slice::from_mut(stress), std::slice::from_mut(volume))
            .unwrap();
    }
}

fn at_pressure(law: DruckerPragerParameters, p: f64) -> (DruckerPrager, Mat2) {
    let stress = Mat2::identity() * -p;
    (DruckerPrager::new(law, &[stress]).unwrap(), stress)
}

/// In steady simple shear `tau / p = sin phi(I)` (the shear plane is a plane of extreme shear when
/// flow is isochoric and coaxial). Another code's periodic packings, which the default law is not fitted to, have 0.282,
/// 0.296, 0.404 and 0.53 at I = 0.0011, 0.011, 0.109 and 0.328; means over packings scatter by 0.01.
#[test]
fn steady_shear_follows_mu_of_i() {
    let law = DruckerPragerParameters::default();
    let p = 20.0e3;
    for (inertial, dem) in [(0.0011, 0.282), (0.011, 0.296), (0.109, 0.404), (0.328, 0.53)] {
        let rate = inertial / (law.grain_diameter * (law.grain_density / p).sqrt());
        let (mut material, mut stress) = at_pressure(law, p);
        drive(
            &mut material,
            &mut stress,
            &mut 1.0,
            Mat2::new(0.0, rate, 0.0, 0.0),
            1e-3 / rate,
            2000,
        );
        let ratio = stress[(0, 1)] / p;
        assert!((-0.5 * stress.trace() / p - 1.0).abs() < 1e-12, "isochoric shear keeps pressure");
        // q / p is sin phi exactly; a little of it is in the normal stress difference.
        let q =
            (0.25 * (stress[(0, 0)] - stress[(1, 1)]).powi(2) + stress[(0, 1)].powi(2)).sqrt() / p;
        println!("I = {inertial}: tau/p {ratio:.4}, q/p {q:.4}, DEM {dem}");
        assert!((q - law.friction(inertial)).abs() < 1e-12);
        assert!((q - dem).abs() < 0.01);
        assert!((ratio - q).abs() < 0.002);
    }
}

/// Below yield the law is Hooke's: `dsigma_xx = (K + G) deps`, `dsigma_yy = (K - G) deps`.
#[test]
fn small_strain_is_elastic() {
    let law = DruckerPragerParameters::default();
    let (mut material, mut stress) = at_pressure(law, 1.0e5);
    drive(&mut material, &mut stress, &mut 1.0, Mat2::new(-1.0, 0.0, 0.0, 0.0), 1e-6, 100);
    let (k, g) = (law.bulk_modulus, law.shear_modulus);
    assert!((stress[(0, 0)] + 1.0e5 + (k + g) * 1e-4).abs() < 1e-6);
    assert!((stress[(1, 1)] + 1.0e5 + (k - g) * 1e-4).abs() < 1e-6);
}

/// Pulled apart by 1 % and pushed back: free of stress until the gap is closed, then elastic again.
#[test]
fn a_gap_must_be_closed_before_stress_returns() {
    let law = DruckerPragerParameters::default();
    let (mut material, mut stress) = at_pressure(law, 0.0);
    let mut volume = 2.0;
    let l = Mat2::identity();
    drive(&mut material, &mut stress, &mut volume, l, 1e-4, 50);
    assert_eq!(stress, Mat2::zeros());
    assert!((material.volume_strain()[0] - 0.01).abs() < 1e-12);
    // V = V0 exp(int tr L dt).
    assert!((volume / (2.0 * 0.01_f64.exp()) - 1.0).abs() < 1e-12);
    drive(&mut material, &mut stress, &mut volume, -l, 1e-4, 49);
    assert_eq!(stress, Mat2::zeros());
    drive(&mut material, &mut stress, &mut volume, -l, 1e-4, 2);
    assert!((stress[(0, 0)] / (-law.bulk_modulus * 2e-4) - 1.0).abs() < 1e-9);
}

/// A rigid quarter turn turns the stress and nothing else.
#[test]
fn the_law_is_objective() {
    let stress = Mat2::new(-30e3, 2e3, 2e3, -20e3);
    let mut material = DruckerPrager::new(DruckerPragerParameters::default(), &[stress]).unwrap();
    let (mut turned, mut volume) = (stress, 1.0);
    let steps = 1000;
    let dt = 1e-4;
    let w = std::f64::consts::FRAC_PI_2 / (steps as f64 * dt);
    drive(&mut material, &mut turned, &mut volume, Mat2::new(0.0, -w, w, 0.0), dt, steps);
    let r = Mat2::new(0.0, -1.0, 1.0, 0.0);
    assert!((turned - r * stress * r.transpose()).norm() < 1e-6 * stress.norm());
    assert_eq!(volume, 1.0);
}

/// Front and height at the wall of a settled heap, and energies along the way.
struct Heap {
    front: f64,
    height: f64,
    peak_kinetic: f64,
    kinetic: f64,
    potential: f64,
    speed: f64,
}

struct Run {
    width: f64,
    height: f64,
    size: Vec2,
    cell: f64,
    law: DruckerPragerParameters,
    numerics: Numerics,
    floor: Friction,
    gravity: Vec2,
    dt: f64,
    time: f64,
}

impl Run {
    /// A column against a smooth wall, in a box of 16 m with cells of 0.125 m, for 3 s.
    fn new(width: f64, height: f64, law: DruckerPragerParameters) -> Self {
        Self {
            width,
            height,
            size: Vec2::new(16.0, 4.0),
            cell: 0.125,
            law,
            numerics: Numerics::default(),
            floor: Friction::Coulomb(0.5),
            gravity: Vec2::new(0.0, -GRAVITY),
            dt: 2.0e-4,
            time: 3.0,
        }
    }

    fn collapse(self) -> Heap {
        let Self { width, height, size, cell, law, numerics, floor, gravity, dt, time } = self;
        let walls = Walls { bottom: floor, ..Walls::default() };
        let mut solver =
            Solver::new(Domain { size, walls, cell }, numerics, gravity, vec![]).unwrap();
        let mut points =
            Points::rectangle(Vec2::zeros(), Vec2::new(width, height), cell / 2.0, law.density);
        let mut material = DruckerPrager::new(law, &points.stress).unwrap();
        let start = solver.budget(&points).potential_energy.abs();
        let (mut peak_kinetic, mut speed) = (0.0_f64, 0.0_f64);
        for n in 0..(time / dt).round() as usize {
            solver.advance(&mut points, &mut material, dt).unwrap();
            if n % 50 == 0 {
                peak_kinetic = peak_kinetic.max(solver.budget(&points).kinetic_energy / start);
                speed = points.velocity.iter().map(|v| v.norm()).fold(speed, f64::max);
            }
        }
        let end = solver.budget(&points);
        Heap {
            front: points.position.iter().map(|x| x.x).fold(0.0, f64::max),
            height: points.position.iter().filter(|x| x.x < cell).map(|x| x.y).fold(0.0, f64::max),
            peak_kinetic,
            kinetic: end.kinetic_energy / start,
            potential: end.potential_energy / start,
            speed,
        }
    }
}

/// Collapse of a block of 0.20 m x 0.15 m on a bed tilted by 10 degrees: rho = 1000, E = 1 MPa,
/// nu = 0.3, M = tan 30 degrees, smooth left wall, base without slip, 1.4 s; the MPM code Matter
/// ends at max x = 0.56 m.
#[test]
fn a_block_on_a_tilted_bed_ends_where_a_peer_code_does() {
    let (e, nu, m) = (1.0e6, 0.3, 30.0_f64.to_radians().tan());
    let g = e / (2.0 * (1.0 + nu));
    let law = DruckerPragerParameters {
        bulk_modulus: e / (3.0 * (1.0 - 2.0 * nu)) + g / 3.0,
        shear_modulus: g,
        density: 1000.0,
        ..DruckerPragerParameters::default()
    };
    let (sin, cos) = 10.0_f64.to_radians().sin_cos();
    let gravity = Vec2::new(sin, -cos) * GRAVITY;
    let size = Vec2::new(0.8, 0.2);
    let law = law.with_constant_friction(m);
    let run = Run {
        size,
        cell: 0.005,
        floor: Friction::Stick,
        gravity,
        dt: 4.0e-5,
        time: 1.4,
        ..Run::new(0.2, 0.15, law)
    };
    let heap = run.collapse();
    println!("front {:.4} m of 0.56, KE {:.1e}", heap.front, heap.kinetic);
    assert!((heap.front - 0.56).abs() < 0.011 && heap.kinetic < 1.0e-6);
}

/// A column of 3 m x 3 m. An independent MPM code with the same law at constant sin phi = 0.28 and
/// FLIP at 1 1/s has its front at 11.6 m (uGIMP 11.75 m), a peak of kinetic energy of 0.13 and a final
/// potential energy of 0.36 of the initial one, and speeds up to 6.5 m/s (uGIMP 7.3 m/s). A front of
/// single points is chaotic: half a metre is its scatter.
#[test]
#[ignore = "a minute: cargo test -p mpm --release --test granular -- --ignored --nocapture"]
fn a_square_column_collapses_as_in_another_code() {
    let law = DruckerPragerParameters::default().with_constant_friction(0.28);
    let flip = Transfer::Flip { rate: 1.0 };
    for (basis, transfer, front, speed) in [
        (Basis::Quadratic, flip, 11.6, 6.5),
        (Basis::Gimp, flip, 11.75, 7.3),
        (Basis::Quadratic, Transfer::default(), 12.0, 6.8),
    ] {
        let numerics = Numerics { basis, transfer, ..Numerics::default() };
        let heap = Run { numerics, ..Run::new(3.0, 3.0, law) }.collapse();
        println!(
            "{basis:?} {transfer:?}: front {:.2} m, height {:.2} m, peak KE {:.3}, end KE {:.1e}, PE {:.3}, {:.2} m/s",
            heap.front, heap.height, heap.peak_kinetic, heap.kinetic, heap.potential, heap.speed
        );
        assert!((heap.front - front).abs() < 0.5);
        assert!((heap.peak_kinetic - 0.13).abs() < 0.015);
        assert!((heap.potential - 0.36).abs() < 0.015);
        assert!((heap.speed - speed).abs() < 0.5);
    }
}

/// A small collapse for every run of the tests: it spreads, stops, and loses energy only.
#[test]
fn a_small_column_collapses_and_stops() {
    let law = DruckerPragerParameters::default();
    let size = Vec2::new(3.0, 1.0);
    let heap =
        Run { size, cell: 0.05, time: 1.6, dt: 2.0e-4, ..Run::new(0.5, 0.5, law) }.collapse();
    println!(
        "runout {:.2}, height {:.2} of the width, KE {:.1e}",
        heap.front / 0.5 - 1.0,
        heap.height / 0.5,
        heap.kinetic
    );
    // Discs in the plane: runouts of 2 to 3.3 widths are found in experiments and DEM.
    assert!((1.8..3.3).contains(&(heap.front / 0.5 - 1.0)));
    assert!((0.45..0.75).contains(&(heap.height / 0.5)));
    assert!(heap.kinetic < 1.0e-4 && heap.potential < 0.5);
}
