//! Disc-steps per second of a whole scene: a column that has collapsed for 0.3 s.
//!
//! `cargo bench -p dem`; the larger column takes some tens of seconds to prepare.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use dem::Grains;
use dem::assembly::{Assembly, Boundary, ColumnBox, Faces, Floor, on_cpu, prepare_column};

const GRAVITY: [f64; 2] = [0.0, -9.81];
const STEPS: usize = 100;

/// A square column of this side (m), 0.3 s after its gate has vanished.
fn collapse(side: f64) -> Assembly<f32> {
    let grains = Grains::default();
    let boundary = Boundary {
        corner: [0.0; 2],
        size: [4.0 * side, 2.0 * side],
        walls: Faces::default(),
        floor: Floor::Rough,
        boxes: vec![],
        seed: 7,
    };
    let place = ColumnBox { corner: [0.0; 2], size: [side; 2], loaded: true };
    let packed =
        prepare_column::<f32>(&grains, &boundary, GRAVITY, &place, 1, &mut on_cpu).unwrap();
    let dt = grains.step();
    let mut scene = Assembly::new(&grains, &boundary, GRAVITY, dt, &packed).unwrap();
    scene.advance((0.3 / dt) as usize).unwrap();
    scene
}

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("assembly");
    group.sample_size(10);
    for side in [0.3, 1.0] {
        let scene = collapse(side);
        group.throughput(Throughput::Elements((scene.len() * STEPS) as u64));
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut scene = scene.clone();
            let name = format!("{threads} threads");
            group.bench_function(BenchmarkId::new(name, scene.len()), |bencher| {
                bencher.iter(|| pool.install(|| scene.advance(STEPS).unwrap()));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, steps);
criterion_main!(benches);
