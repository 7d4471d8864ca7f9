//! Walls, fixed barriers and moving plates.

mod common;

use common::*;
use mpm::{
    Domain, DruckerPrager, DruckerPragerParameters, Friction, Numerics, Obstacle, Points, Solver,
    Transfer, Vec2, Walls,
};
use rstest::rstest;

fn fixed(min: Vec2, max: Vec2, faces: Walls) -> Obstacle {
    Obstacle { min, max, faces, velocity: Vec2::zeros(), start: 0.0 }
}

fn solver(size: Vec2, gravity: Vec2, obstacles: Vec<Obstacle>) -> Solver {
    let domain = Domain { size, walls: Walls::default(), cell: 0.1 };
    Solver::new(domain, Numerics::default(), gravity, obstacles).unwrap()
}

/// A box that spans the domain with its top on a node line is a floor, bit for bit.
#[test]
fn a_face_on_a_node_line_is_a_wall() {
    let run = |lift: f64| {
        let floor =
            fixed(Vec2::new(-1.0, -1.0), Vec2::new(9.0, lift), Walls::all(Friction::Coulomb(0.4)));
        let walls = Walls { bottom: Friction::Coulomb(0.4), ..Walls::default() };
        let domain = Domain { size: Vec2::new(4.0, 3.0), walls, cell: 0.125 };
        let obstacles = if lift > 0.0 { vec![floor] } else { vec![] };
        let mut solver =
            Solver::new(domain, Numerics::default(), Vec2::new(0.0, -GRAVITY), obstacles).unwrap();
        let law = DruckerPragerParameters::default();
        let mut points = Points::rectangle(
            Vec2::new(0.0, lift),
            Vec2::new(1.0, 1.0 + lift),
            0.0625,
            law.density,
        );
        let mut material = DruckerPrager::new(law, &points.stress).unwrap();
        for _ in 0..1500 {
            solver.advance(&mut points, &mut material, 2.0e-4).unwrap();
        }
        points
    };
    // Powers of two as cell and lift: coordinates differ by an exact number.
    let (wall, floor) = (run(0.0), run(0.5));
    let worst = wall
        .position
        .iter()
        .zip(&floor.position)
        .map(|(a, b)| (b - a - Vec2::new(0.0, 0.5)).norm())
        .fold(0.0, f64::max);
    println!("largest difference {worst:.1e} m");
    assert!(worst < 1.0e-9, "{worst}");
}

/// A heap between two barriers presses equally on both, and all momentum is booked.
#[test]
fn a_symmetric_pile_presses_equally_on_both_barriers() {
    let faces = Walls::all(Friction::Coulomb(0.3));
    let barriers = vec![
        fixed(Vec2::new(0.5, 0.0), Vec2::new(0.8, 0.5), faces),
        fixed(Vec2::new(3.2, 0.0), Vec2::new(3.5, 0.5), faces),
    ];
    let gravity = Vec2::new(0.0, -GRAVITY);
    let mut solver = solver(Vec2::new(4.0, 2.0), gravity, barriers);
    let law = DruckerPragerParameters::default();
    let mut points = Points::rectangle(Vec2::new(1.5, 0.0), Vec2::new(2.5, 1.5), 0.05, law.density);
    let mut material = DruckerPrager::new(law, &points.stress).unwrap();
    let before = solver.budget(&points);
    for _ in 0..10_000 {
        solver.advance(&mut points, &mut material, 2.0e-4).unwrap();
    }
    let after = solver.budget(&points);
    let [left, right] = [0, 1].map(|k| after.contact.obstacle_impulse[k]);
    println!("impulses {left:?} {right:?}, projected {}", after.contact.projected);
    assert!(left.x > 0.0 && (left.x + right.x).abs() < 0.02 * left.x);
    assert!((left.y - right.y).abs() < 0.05 * left.x);
    let given = after.contact.wall_impulse + left + right + gravity * (after.mass * solver.time());
    let error = (after.momentum - before.momentum - given).norm();
    assert!(error < 1.0e-7 * after.mass * GRAVITY * solver.time(), "{error}");
    // At rest in the end: the pile settled, some of it over the barriers.
    assert!(after.kinetic_energy < 1.0e-3 * before.potential_energy);
    // None inside.
    for x in &points.position {
        assert!(!(x.y < 0.5 && ((x.x > 0.5 && x.x < 0.8) || (x.x > 3.2 && x.x < 3.5))), "{x}");
    }
}

/// What flows along the top of a box passes its edge, and what falls down its side passes the
/// corner: the corner does not catch it. Nodes that belong to the other face brake the layer of
/// points next to the box a little, up to a cell and a half from the edge.
#[rstest]
#[case::over_the_top(Vec2::new(0.8, 0.5), Vec2::new(1.0, 0.0), 1.0e-9)]
#[case::down_the_side(Vec2::new(1.5, 1.2), Vec2::new(0.0, -1.0), 0.15)]
fn corners_let_material_slide_past(
    #[case] from: Vec2,
    #[case] velocity: Vec2,
    #[case] braked: f64,
) {
    let block = fixed(Vec2::new(0.5, 0.0), Vec2::new(1.5, 0.5), Walls::default());
    let mut solver = solver(Vec2::new(4.0, 2.0), Vec2::zeros(), vec![block]);
    let mut points = Points::rectangle(from, from + Vec2::new(0.2, 0.2), 0.05, 1000.0);
    points.velocity.fill(velocity);
    let start = points.position.clone();
    for _ in 0..500 {
        solver.advance(&mut points, &mut Dust, 2.0e-3).unwrap();
    }
    let worst = points
        .position
        .iter()
        .zip(&start)
        .map(|(x, x0)| (x - x0 - velocity).norm())
        .fold(0.0, f64::max);
    println!("largest lag {worst:.2e} m");
    assert!(worst < braked);
}

/// A plate that starts to move into elastic material at rest moves it along: in the end the block
/// has the plate's velocity on average, the impulse is its momentum, and the work is `impulse * v`.
#[test]
fn a_plate_pushes_a_block_and_books_its_work() {
    let v = Vec2::new(0.2, 0.0);
    let plate = Obstacle {
        min: Vec2::new(0.2, 0.0),
        max: Vec2::new(0.5, 1.0),
        faces: Walls::default(),
        velocity: v,
        start: 0.1,
    };
    let mut solver = solver(Vec2::new(4.0, 1.0), Vec2::zeros(), vec![plate]);
    let mut points = Points::rectangle(Vec2::new(0.5, 0.2), Vec2::new(0.9, 0.6), 0.05, 1000.0);
    let mut material = elastic(1.0e6, 0.0);
    let mut advance = |steps: usize, solver: &mut Solver, points: &mut Points| {
        for _ in 0..steps {
            solver.advance(points, &mut material, 5.0e-4).unwrap();
        }
    };
    advance(199, &mut solver, &mut points);
    assert!(points.velocity.iter().all(|v| v.norm() == 0.0), "at rest until the plate starts");
    advance(4000, &mut solver, &mut points);
    let place = solver.obstacles_at(solver.time()).next().unwrap();
    assert!((place.min.x - (0.2 + 0.2 * (solver.time() - 0.1))).abs() < 1.0e-12);
    let budget = solver.budget(&points);
    let impulse = budget.contact.obstacle_impulse[0];
    assert!((impulse - budget.momentum).norm() < 1.0e-6 * impulse.norm());
    assert!((budget.contact.plate_work - impulse.dot(&v)).abs() < 1.0e-6 * impulse.norm());
    // An elastic block bounces off at up to twice the plate's speed.
    let speed = budget.momentum.x / budget.mass;
    println!("block {speed:.3} m/s, plate 0.2 m/s, projected {}", budget.contact.projected);
    assert!((0.2..=0.41).contains(&speed));
    assert!(points.position.iter().all(|x| x.x >= place.max.x));
}

/// A gate that is lifted lets a column collapse; before, the column stands.
#[test]
fn a_gate_holds_a_column_until_it_is_lifted() {
    let gate = Obstacle {
        min: Vec2::new(1.0, 0.0),
        max: Vec2::new(1.3, 2.0),
        faces: Walls::default(),
        velocity: Vec2::new(0.0, 20.0),
        start: 0.5,
    };
    let mut solver = solver(Vec2::new(6.0, 2.0), Vec2::new(0.0, -GRAVITY), vec![gate]);
    let law = DruckerPragerParameters::default();
    let mut points = Points::rectangle(Vec2::zeros(), Vec2::new(1.0, 1.0), 0.05, law.density);
    let mut material = DruckerPrager::new(law, &points.stress).unwrap();
    let front = |points: &Points| points.position.iter().map(|x| x.x).fold(0.0, f64::max);
    for _ in 0..2500 {
        solver.advance(&mut points, &mut material, 2.0e-4).unwrap();
    }
    assert!(front(&points) <= 1.0);
    for _ in 0..2500 {
        solver.advance(&mut points, &mut material, 2.0e-4).unwrap();
    }
    assert!(front(&points) > 1.5, "{}", front(&points));
}

/// Points that cross a wall are put back onto it, stop there, and are counted.
#[test]
fn escaped_points_are_put_back_and_counted() {
    let mut solver = {
        let numerics = Numerics { transfer: Transfer::Flip { rate: 0.0 }, ..Numerics::default() };
        smooth_box(Vec2::new(1.0, 1.0), 0.1, numerics, Vec2::zeros())
    };
    let mut points = Points::default();
    points.push(Vec2::new(0.002, 0.5), 2.0, 0.01);
    points.velocity[0] = Vec2::new(-5.0, 0.3);
    while solver.ledger().projected == 0 {
        solver.advance(&mut points, &mut Dust, 0.01).unwrap();
        assert!(solver.time() < 5.0);
    }
    assert_eq!(points.position[0].x, 0.0);
    assert_eq!(points.velocity[0].x, 0.0);
    assert!((points.velocity[0].y - 0.3).abs() < 1.0e-12);
    assert!((solver.ledger().wall_impulse - Vec2::new(10.0, 0.0)).norm() < 1.0e-12);
}
