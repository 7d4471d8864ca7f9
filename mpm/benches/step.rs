//! Points advanced per second: one MUSL step of a mu(I) column with quadratic splines.
//!
//! `cargo bench -p mpm`

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mpm::{
    Domain, DruckerPrager, DruckerPragerParameters, Friction, Numerics, Points, Solver, Vec2, Walls,
};

/// A 3 m x 3 m column in a 10 m box; 2 x 2 points a cell of 0.125 m are 2304.
fn step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    for cell in [0.125, 0.03125] {
        let law = DruckerPragerParameters::default();
        let walls = Walls { bottom: Friction::Coulomb(0.5), ..Walls::default() };
        let domain = Domain { size: Vec2::new(10.0, 10.0), walls, cell };
        let mut points =
            Points::rectangle(Vec2::zeros(), Vec2::new(3.0, 3.0), cell / 2.0, law.density);
        let mut material = DruckerPrager::new(law, &points.stress).unwrap();
        let mut solver =
            Solver::new(domain, Numerics::default(), Vec2::new(0.0, -9.81), vec![]).unwrap();
        group.throughput(Throughput::Elements(points.len() as u64));
        group.bench_function(BenchmarkId::new("quadratic", points.len()), |bencher| {
            bencher.iter(|| solver.advance(&mut points, &mut material, 1.0e-5).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, step);
criterion_main!(benches);
