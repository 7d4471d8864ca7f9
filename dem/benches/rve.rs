//! Disc-steps per second of one core in steady shear, neighbour searches included.
//!
//! `cargo bench -p dem`; criterion reports elements, which are discs times DEM steps, per second.

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use dem::{Packing, Real, Rve, RveBatch, RveParameters, RveState, prepare};
use nalgebra::Matrix2;

/// RVEs per batch: more state than the caches next to one core hold.
const RVES: usize = 64;
const MACRO_STEP: f64 = 1.0e-4;

fn steady_shear<R: Real>(c: &mut Criterion, p: &RveParameters, packing: &Packing<f64>) {
    // One thread: what matters is a core; RVEs are independent.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let mut group = c.benchmark_group(format!("steady_shear/{}", R::NAME));
    group.sampling_mode(SamplingMode::Flat).sample_size(20);
    group.throughput(Throughput::Elements((RVES * p.discs * p.substeps(MACRO_STEP)) as u64));
    for rate in [0.5, 5.0, 50.0] {
        let fresh: Packing<R> = packing.convert();
        let rves = vec![Rve::new(fresh.clone()); RVES];
        let mut batch = RveBatch { parameters: p.clone(), rves, fresh };
        let shear = [Matrix2::new(0.0, rate, 0.0, 0.0); RVES];
        let mut states = [RveState::default(); RVES];
        let mut step = || {
            pool.install(|| batch.advance(MACRO_STEP, &shear, &mut states)).expect("sound packing");
        };
        // Past the start of shear, where neighbours do not change yet.
        (0..50).for_each(|_| step());
        group.bench_function(format!("{rate}_per_s"), |b| b.iter(&mut step));
    }
    group.finish();
}

fn rve(c: &mut Criterion) {
    let p = RveParameters::default();
    let packing = prepare(&p, 1, &[20.0e3]).expect("a packing").ladder.remove(0).packing;
    steady_shear::<f32>(c, &p, &packing);
    steady_shear::<f64>(c, &p, &packing);
}

criterion_group!(benches, rve);
criterion_main!(benches);
