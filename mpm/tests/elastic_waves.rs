//! Elastic waves in bars and columns against one-dimensional wave theory.

mod common;

use std::f64::consts::PI;

use common::*;
use mpm::{Basis, Domain, Obstacle, Points, Scheme, Solver, Vec2, Walls};
use rstest::rstest;

/// A bar of length L = 25 m, E = 100 Pa, rho = 1 kg/m³, held at one end, starts with
/// `v = v0 sin(pi x / 2L)`: its first mode, `omega = (pi / 2L) sqrt(E / rho)`, period 10 s
/// (Bardenhagen 2002, J. Comput. Phys. 180, 383). Its mean velocity is
/// `(2 v0 / pi) cos(omega t)`. The held end is the middle of a free bar of 50 m.
#[rstest]
fn an_axial_bar_vibrates_in_its_first_mode(
    #[values(Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic)] basis: Basis,
    #[values(Scheme::Musl, Scheme::Usf)] scheme: Scheme,
) {
    let (length, young, v0, dt) = (25.0, 100.0, 0.1, 0.02);
    let mut solver = smooth_box(Vec2::new(60.0, 3.0), 1.0, flip(basis, scheme), Vec2::zeros());
    let middle = 30.0;
    let mut points = Points::rectangle(
        Vec2::new(middle - length, 1.0),
        Vec2::new(middle + length, 2.0),
        0.5,
        1.0,
    );
    let k = PI / (2.0 * length);
    for (x, v) in points.position.iter().zip(&mut points.velocity) {
        v.x = v0 * (k * (x.x - middle)).sin();
    }
    let right: Vec<usize> = (0..points.len()).filter(|&p| points.position[p].x > middle).collect();
    let mut material = elastic(young, 0.0);

    let energy = |points: &Points| {
        (0..points.len())
            .map(|p| {
                let strain_energy = points.stress[p].norm_squared() / (2.0 * young);
                0.5 * points.mass[p] * points.velocity[p].norm_squared()
                    + strain_energy * points.volume[p]
            })
            .sum::<f64>()
    };
    let start = energy(&points);
    let omega = k * young.sqrt();
    let amplitude = 2.0 * v0 / PI;
    let steps = (10.0 * 10.0 / dt) as usize;
    let (mut error, mut lowest, mut highest) = (0.0_f64, start, start);
    for n in 1..=steps {
        solver.advance(&mut points, &mut material, dt).unwrap();
        let mean = right.iter().map(|&p| points.velocity[p].x).sum::<f64>() / right.len() as f64;
        error = error.max((mean - amplitude * (omega * n as f64 * dt).cos()).abs());
        lowest = lowest.min(energy(&points));
        highest = highest.max(energy(&points));
    }
    let drift = energy(&points) / start - 1.0;
    println!(
        "{basis:?} {scheme:?}: velocity error {:.2e}, energy drift {drift:.2e} in [{:.4}, {:.4}]",
        error / amplitude,
        lowest / start,
        highest / start
    );
    // Ten periods, 20 pi: an error of 0.1 is a frequency off by 0.16 %.
    assert!(error < 0.1 * amplitude);
    // Velocity is half a step behind stress: the sum swings by omega dt / 2 = 0.6 %.
    assert!(drift.abs() < 0.002);
    assert!(lowest > 0.99 * start && highest < 1.01 * start);
}

/// Gravity is switched on at once over a column of height H: the base stress is a triangular wave
/// between 0 and `2 rho g H` of period `4 H / c`, as the wave runs up and down twice. The base stress
/// is the momentum that the floor gives, over windows of a fiftieth of the period.
#[test]
fn sudden_gravity_makes_the_base_stress_swing_between_zero_and_twice_the_weight() {
    let (height, cell, density, young) = (3.0, 0.0625, 2173.0, 8.5e6_f64);
    let numerics = flip(Basis::Quadratic, Scheme::Usf);
    let mut solver = smooth_box(Vec2::new(cell, 4.0), cell, numerics, Vec2::new(0.0, -GRAVITY));
    let mut points = Points::rectangle(Vec2::zeros(), Vec2::new(cell, height), cell / 2.0, density);
    let mut material = elastic(young, 0.0);
    let period = 4.0 * height / (young / density).sqrt();
    let (windows, steps) = (50, 40);
    let dt = period / (windows * steps) as f64;
    let mut base = Vec::new();
    for _ in 0..windows {
        let before = solver.ledger().wall_impulse.y;
        for _ in 0..steps {
            solver.advance(&mut points, &mut material, dt).unwrap();
        }
        let force = (solver.ledger().wall_impulse.y - before) / (steps as f64 * dt);
        base.push(force / (density * GRAVITY * height * cell));
    }
    let time = |k: usize| (k as f64 + 0.5) / windows as f64;
    let error =
        rms(base.iter().enumerate().map(|(k, s)| s - 2.0 * (1.0 - (2.0 * time(k) - 1.0).abs())));
    let (peak, largest) =
        base.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    println!("peak {largest:.3} at {:.3} of a period, rms error {error:.3}", time(peak));
    assert!((largest - 2.0).abs() < 0.06);
    assert!((time(peak) - 0.5).abs() < 0.03);
    assert!(error < 0.05);
}

/// A body between smooth plates that meets a wall at speed v0 (or is met by a plate) carries a wave
/// of stress `rho c v0` that moves at `c = sqrt(M / rho)` into it.
#[rstest]
#[case::wall(false)]
#[case::plate(true)]
fn an_impact_sends_a_step_of_stress_at_the_wave_speed(#[case] plate: bool) {
    let (length, cell, density) = (2.0, 0.02, 2000.0);
    let mut material = elastic(1.0e7, 0.25);
    let modulus = material.parameters().wave_modulus();
    let c = (modulus / density).sqrt();
    let v0 = 1.0e-4 * c;
    let origin = if plate { 0.2 } else { 0.0 };
    let obstacles = if plate {
        let faces = Walls::default();
        vec![Obstacle {
            min: Vec2::zeros(),
            max: Vec2::new(origin, 2.0 * cell),
            faces,
            velocity: Vec2::new(v0, 0.0),
            start: 0.0,
        }]
    } else {
        vec![]
    };
    let domain = Domain { size: Vec2::new(3.0, 2.0 * cell), walls: Walls::default(), cell };
    let numerics = flip(Basis::Quadratic, Scheme::Musl);
    let mut solver = Solver::new(domain, numerics, Vec2::zeros(), obstacles).unwrap();
    let mut points = Points::rectangle(
        Vec2::new(origin, 0.0),
        Vec2::new(origin + length, 2.0 * cell),
        cell / 2.0,
        density,
    );
    if !plate {
        points.velocity.fill(Vec2::new(-v0, 0.0));
    }
    let dt = 0.3 * cell / c;
    let t = 0.5 * length / c;
    let start: Vec<f64> = points.position.iter().map(|x| x.x - origin).collect();
    for _ in 0..(t / dt).round() as usize {
        solver.advance(&mut points, &mut material, dt).unwrap();
    }
    let step = density * c * v0;
    let compression = |p: usize| -points.stress[p][(0, 0)] / step;
    let row: Vec<usize> = (0..points.len() / 4).collect();
    let half = row.iter().rev().find(|&&p| compression(p) > 0.5).map(|&p| start[p]).unwrap();
    // Dispersion spreads the front and makes its middle lag, but keeps the area under it.
    let front = row.iter().map(|&p| compression(p) * 0.5 * cell).sum::<f64>();
    println!("half height {:.2} cells late", (solver.time() * c - half) / cell);
    let plateau: Vec<f64> = row
        .iter()
        .filter(|&&p| start[p] > 0.2 && start[p] < 0.6)
        .map(|&p| compression(p))
        .collect();
    let mean = plateau.iter().sum::<f64>() / plateau.len() as f64;
    println!(
        "plate {plate}: front at {front:.4} m of {:.4} (cell {cell}), plateau {mean:.4}",
        solver.time() * c
    );
    assert!((front - solver.time() * c).abs() < cell, "the front is within a cell");
    assert!((mean - 1.0).abs() < 0.01, "the stress behind it is rho c v0");
}
