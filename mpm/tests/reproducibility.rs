//! The same bits: for any number of threads, and after a restart.

mod common;

use common::*;
use mpm::{
    Basis, Domain, DruckerPrager, DruckerPragerParameters, Friction, Numerics, Obstacle, Points,
    Solver, Vec2, Walls,
};
use rstest::rstest;

const DT: f64 = 2.0e-4;

/// A column that collapses onto a barrier while a plate pushes it.
fn scene(basis: Basis) -> (Solver, Points, DruckerPrager) {
    let law = DruckerPragerParameters::default();
    let walls = Walls { bottom: Friction::Coulomb(0.5), ..Walls::default() };
    let faces = Walls::all(Friction::Coulomb(0.3));
    let barrier = Obstacle {
        min: Vec2::new(2.0, 0.0),
        max: Vec2::new(2.2, 0.3),
        faces,
        velocity: Vec2::zeros(),
        start: 0.0,
    };
    let plate = Obstacle {
        min: Vec2::new(-0.1, 0.0),
        max: Vec2::new(0.2, 3.0),
        faces,
        velocity: Vec2::new(0.5, 0.0),
        start: 0.05,
    };
    let domain = Domain { size: Vec2::new(4.0, 3.0), walls, cell: 0.1 };
    let numerics =
        Numerics { basis, cell_average_volumetric: basis == Basis::Gimp, ..Numerics::default() };
    let solver =
        Solver::new(domain, numerics, Vec2::new(0.0, -GRAVITY), vec![barrier, plate]).unwrap();
    let points = Points::rectangle(Vec2::new(0.2, 0.0), Vec2::new(1.2, 1.5), 0.05, law.density);
    let material = DruckerPrager::new(law, &points.stress).unwrap();
    (solver, points, material)
}

fn run(solver: &mut Solver, points: &mut Points, material: &mut DruckerPrager, steps: usize) {
    for _ in 0..steps {
        solver.advance(points, material, DT).unwrap();
    }
}

#[rstest]
fn any_number_of_threads_gives_the_same_bits(
    #[values(Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic)] basis: Basis,
) {
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (mut solver, mut points, mut material) = scene(basis);
            run(&mut solver, &mut points, &mut material, 1500);
            (points, solver.ledger().clone(), material)
        })
    };
    let one = with_threads(1);
    for threads in [2, 3, 7] {
        assert!(one == with_threads(threads), "{threads} threads");
    }
}

/// Points, material, time and ledger are the whole state.
#[test]
fn a_restart_continues_with_the_same_bits() {
    let (mut solver, mut points, mut material) = scene(Basis::Quadratic);
    run(&mut solver, &mut points, &mut material, 600);
    let checkpoint =
        postcard::to_stdvec(&(&points, &material, solver.time(), solver.ledger())).unwrap();
    run(&mut solver, &mut points, &mut material, 600);

    let (mut again, ..) = scene(Basis::Quadratic);
    let (mut points2, mut material2, time, ledger): (Points, DruckerPrager, f64, mpm::Ledger) =
        postcard::from_bytes(&checkpoint).unwrap();
    again.set_time(time);
    again.set_ledger(ledger).unwrap();
    run(&mut again, &mut points2, &mut material2, 600);

    assert!(points == points2 && material == material2);
    assert_eq!(solver.time(), again.time());
    assert_eq!(solver.ledger(), again.ledger());
}
