//! The CUDA batch against its CPU twin.
//!
//! Without a GPU these tests say so and pass, unless `DEMPM_REQUIRE_GPU=1`.

use std::sync::OnceLock;

use dem::cuda::{CudaError, CudaReal, CudaRveBatch, Room, RveFailure, Shape, source};
use dem::{
    Cell, Failure, Packing, PlainDisc, Real, Rve, RveBatch, RveParameters, RveState, consolidate,
};
use gpu::{Limits, compile};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstest::rstest;

/// Macro step (s): 8 substeps with the default parameters.
const DT: f64 = 1.0e-4;

/// Discs on a jittered lattice, in random motion, many of them overlapping.
fn random_packing<R: Real>(discs: usize, seed: u64, p: &RveParameters) -> Packing<R> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let columns = (discs as f64).sqrt().ceil() as usize;
    let spacing = 1.9 * 0.5 * (p.grains.radius_min + p.grains.radius_max);
    let plain: Vec<PlainDisc> = (0..discs)
        .map(|k| {
            let mut jitter = || rng.random_range(-0.1..0.1);
            PlainDisc {
                x: [
                    spacing * ((k % columns) as f64 + jitter()),
                    spacing * ((k / columns) as f64 + jitter()),
                ],
                r: rng.random_range(p.grains.radius_min..=p.grains.radius_max),
            }
        })
        .collect();
    let cell = Cell::square(spacing * columns as f64);
    let mut packing = Packing::new(cell, &plain, |r| p.grains.disc_mass(r));
    for d in &mut packing.discs {
        let mut velocity = |scale: f64| R::from_f64(rng.random_range(-scale..scale));
        d.u = [velocity(0.3), velocity(0.3)];
        d.w = velocity(100.0);
    }
    packing
}

/// A dense packing of 100 discs at 2 kPa, prepared once.
fn dense<R: Real>() -> (RveParameters, Packing<R>) {
    static PACKING: OnceLock<Packing<f64>> = OnceLock::new();
    let p = RveParameters { discs: 100, ..RveParameters::default() };
    let packing = PACKING.get_or_init(|| consolidate(&p, 7).unwrap());
    (p.clone(), packing.convert())
}

/// The same, of grains that resist rolling.
fn rolling<R: Real>() -> (RveParameters, Packing<R>) {
    let (mut p, packing) = dense();
    p.grains.rolling_friction = 0.2;
    (p, packing)
}

fn batch<R: Real>(p: &RveParameters, packings: &[Packing<R>]) -> RveBatch<R> {
    RveBatch {
        parameters: p.clone(),
        rves: packings.iter().cloned().map(Rve::new).collect(),
        fresh: vec![packings[0].clone()],
    }
}

fn random_gradient(rng: &mut ChaCha8Rng, rate: f64) -> Matrix2<f64> {
    Matrix2::from_fn(|_, _| rng.random_range(-rate..rate))
}

/// Largest differences of positions (m), velocities (m/s) and spins (1/s) of two packings.
fn difference<R: Real>(a: &Packing<R>, b: &Packing<R>) -> [f64; 3] {
    let mut most = [0.0_f64; 3];
    for (a_disc, b_disc) in a.discs.iter().zip(&b.discs) {
        let ds = [0, 1].map(|k| R::nearest(a_disc.s[k], b_disc.s[k]).to_f64() * R::UNIT);
        let du = [0, 1].map(|k| (b_disc.u[k] - a_disc.u[k]).to_f64());
        most[0] = most[0].max((a.cell.h * Vector2::from(ds)).norm());
        most[1] = most[1].max(Vector2::from(du).norm());
        most[2] = most[2].max((b_disc.w - a_disc.w).to_f64().abs());
    }
    most
}

/// Tangential and rolling forces of all contacts, by pair.
fn springs<R: Real>(packing: &Packing<R>) -> Vec<(usize, usize, f64, f64)> {
    let mut forces: Vec<_> = packing
        .contacts()
        .filter(|c| c.tangential != 0.0 || c.rolling != 0.0)
        .map(|c| (c.i, c.j, c.tangential, c.rolling))
        .collect();
    forces.sort_by(|a, b| a.partial_cmp(b).unwrap());
    forces
}

fn assert_close(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{what}: {found:e} on the GPU, {expected:e} on the CPU (tolerance {tolerance:e})"
    );
}

fn assert_states_close(gpu: &RveState, cpu: &RveState, tolerance: f64) {
    let scale = cpu.stress.norm().max(1.0);
    assert_close("stress", (gpu.stress - cpu.stress).norm(), 0.0, tolerance * scale);
    assert_close("area", gpu.area, cpu.area, 1.0e-12 * cpu.area);
    assert_close("solid fraction", gpu.solid_fraction, cpu.solid_fraction, 1.0e-12);
    if cpu.min_width.is_finite() {
        assert_close("width", gpu.min_width, cpu.min_width, 1.0e-12 * cpu.min_width);
    } else {
        assert_eq!(gpu.min_width, cpu.min_width);
    }
    let overlap_tolerance = tolerance * cpu.relative_overlap.max(0.01);
    assert_close("overlap", gpu.relative_overlap, cpu.relative_overlap, overlap_tolerance);
    let flags = |s: &RveState| [s.free, s.thin, s.dense];
    assert_eq!(flags(gpu), flags(cpu));
}

/// One DEM step of random packings: forces, stress and motion agree to round-off.
fn one_substep<R: CudaReal>(discs: usize, rolling_friction: f64, epsilon: f64) {
    let Some(device) = gpu::for_tests() else { return };
    let mut p = RveParameters { discs, free_solid_fraction: 0.0, ..RveParameters::default() };
    p.grains.rolling_friction = rolling_friction;
    let dt = p.grains.step();
    let packings: Vec<Packing<R>> = (0..3).map(|seed| random_packing(discs, seed, &p)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(discs as u64);
    let gradients: Vec<_> = packings.iter().map(|_| random_gradient(&mut rng, 20.0)).collect();

    let mut cpu = batch(&p, &packings);
    let mut twin = CudaRveBatch::upload(&device, &cpu).unwrap();
    let mut cpu_states = vec![RveState::default(); packings.len()];
    let mut gpu_states = cpu_states.clone();
    // The second step also has tangential forces and a spin to take along.
    for step in 1..=2 {
        cpu.advance(dt, &gradients, &mut cpu_states).unwrap();
        twin.advance(dt, &gradients, &mut gpu_states).unwrap();
        let gpu = twin.download().unwrap();
        for k in 0..packings.len() {
            let growth = f64::from(step * step);
            // Forces reach 100 N, speeds 3 m/s and spins 1000 1/s.
            let [x, u, w] = difference(&cpu.rves[k].packing, &gpu.rves[k].packing);
            assert_close("position", x, 0.0, growth * (2.0 * R::UNIT + 3.0 * dt * epsilon));
            assert_close("velocity", u, 0.0, growth * 3.0 * epsilon);
            assert_close("spin", w, 0.0, growth * 1000.0 * epsilon);
            assert_states_close(&gpu_states[k], &cpu_states[k], growth * epsilon);
            assert_eq!(gpu_states[k].coordination, cpu_states[k].coordination);
        }
    }
}

#[rstest]
fn one_substep_matches(
    #[values(1, 2, 3, 5, 31, 32, 33, 100, 257, 400, 512, 1000, 1024)] discs: usize,
) {
    // A contact's overlap is a difference of lengths a hundred times larger.
    one_substep::<f64>(discs, 0.0, 1.0e-13);
    one_substep::<f32>(discs, 0.0, 3.0e-5);
}

#[rstest]
fn one_substep_with_rolling_resistance_matches(#[values(2, 33, 100, 400, 900)] discs: usize) {
    one_substep::<f64>(discs, 0.2, 1.0e-13);
    one_substep::<f32>(discs, 0.2, 3.0e-5);
}

/// Runs both twins along a path of velocity gradients and compares after every macro step.
fn compare_path<R: CudaReal>(
    p: &RveParameters,
    packing: &Packing<R>,
    path: impl Fn(usize) -> Matrix2<f64>,
    steps: usize,
    tolerance: impl Fn(usize) -> f64,
) -> Option<Vec<RveState>> {
    let device = gpu::for_tests()?;
    let mut cpu = batch(p, std::slice::from_ref(packing));
    let mut twin = CudaRveBatch::upload(&device, &cpu).unwrap();
    let mut cpu_state = vec![RveState::default()];
    let mut gpu_state = cpu_state.clone();
    let mut states = Vec::new();
    for step in 0..steps {
        let l = [path(step)];
        cpu.advance(DT, &l, &mut cpu_state).unwrap();
        twin.advance(DT, &l, &mut gpu_state).unwrap();
        assert_states_close(&gpu_state[0], &cpu_state[0], tolerance(step));
        states.push(gpu_state[0]);
    }
    Some(states)
}

/// Shear, compression and rotation of a dense packing. In f64 differences grow from round-off.
#[test]
fn element_path_in_f64() {
    let (p, packing) = dense::<f64>();
    let path = |step: usize| {
        let phase = step as f64 * 0.1;
        Matrix2::new(-0.5, 4.0 * phase.cos(), 8.0 * phase.sin(), 0.3)
    };
    compare_path(&p, &packing, path, 100, |_| 1.0e-8);
    let (p, packing) = rolling::<f64>();
    compare_path(&p, &packing, path, 100, |_| 1.0e-8);
}

/// In f32 the overlaps of the packing, 1e-5 m, are resolved to 1e-9 m; contacts that open and
/// slide at slightly other moments make the difference grow.
#[test]
fn element_path_in_f32() {
    let (p, packing) = dense::<f32>();
    let path = |_| Matrix2::new(-0.5, 2.0, 0.0, 0.3);
    compare_path(&p, &packing, path, 40, |step| 1.0e-3 * (1.0 + step as f64));
}

/// Shear through a lattice reduction and several searches.
#[test]
fn lattice_reduction() {
    for (p, packing) in [dense::<f64>(), rolling::<f64>()] {
        let states = compare_path(
            &p,
            &packing,
            |_| Matrix2::new(0.0, 150.0, 0.0, 0.0),
            50,
            |step| 1.0e-9 * 1.5_f64.powi(step as i32).min(1.0e6),
        );
        if let Some(states) = states {
            assert!(states.iter().map(|s| s.searches).sum::<u32>() >= 3);
        }
    }
}

/// A cell so thin that discs meet several images of each other and of themselves.
fn thin_packing<R: Real>(p: &RveParameters, width: f64) -> Packing<R> {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let discs: Vec<PlainDisc> = (0..p.discs)
        .map(|k| PlainDisc {
            x: [rng.random_range(0.0..width), 4.5e-3 * (k as f64 + 0.5)],
            r: rng.random_range(2.5e-3..3.5e-3),
        })
        .collect();
    let length = 4.5e-3 * p.discs as f64;
    Packing::new(Cell { h: Matrix2::new(width, 0.1 * width, 0.0, length) }, &discs, |r| {
        p.grains.disc_mass(r)
    })
}

fn thin_cell<R: CudaReal>(width: f64, rolling_friction: f64, tolerance: f64) {
    let mut p = RveParameters {
        discs: 24,
        thin_width: 0.0,
        free_solid_fraction: 0.0,
        ..RveParameters::default()
    };
    p.grains.rolling_friction = rolling_friction;
    let packing = thin_packing::<R>(&p, width);
    compare_path(
        &p,
        &packing,
        |_| Matrix2::new(3.0, 20.0, -10.0, -3.0),
        12,
        |step| tolerance * 3.0_f64.powi(step as i32),
    );
}

#[rstest]
fn thin_cells(
    #[values(4.6e-3, 8.0e-3, 20.0e-3)] width: f64,
    #[values(0.0, 0.2)] rolling_friction: f64,
) {
    thin_cell::<f64>(width, rolling_friction, 1.0e-12);
    thin_cell::<f32>(width, rolling_friction, 1.0e-4);
}

/// A thin loaded cell is not thinned further.
#[test]
fn thin_cell_is_frozen() {
    let (p, packing) = dense::<f64>();
    let p = RveParameters { thin_width: 30.0, ..p };
    let path = |step: usize| {
        let rate = if step < 5 { 3.0 } else { -3.0 };
        Matrix2::new(rate, 1.0, 0.0, -rate)
    };
    if let Some(states) = compare_path(&p, &packing, path, 10, |_| 1.0e-9) {
        assert!(states.iter().any(|s| s.thin) && !states.iter().all(|s| s.thin));
    }
}

/// A dense cell is not compressed further, and expands again.
#[test]
fn dense_cell_is_frozen() {
    let (p, packing) = dense::<f64>();
    let p = RveParameters { max_solid_fraction: 0.9, ..p };
    let path = |step: usize| {
        let rate = if step < 15 { -50.0 } else { 50.0 };
        Matrix2::new(rate, 3.0, 0.0, rate)
    };
    if let Some(states) = compare_path(&p, &packing, path, 20, |_| 1.0e-7) {
        assert!(states.iter().any(|s| s.dense) && !states.iter().all(|s| s.dense));
        // One macro step compresses by a per cent.
        assert!(states.iter().all(|s| s.solid_fraction < 0.91));
    }
}

/// Expansion until stress-free, and back: both twins restart from the fresh packing.
#[test]
fn free_and_fresh_again() {
    let (p, packing) = dense::<f64>();
    let path = |step: usize| Matrix2::identity() * if step < 12 { 100.0 } else { -120.0 };
    let Some(states) = compare_path(&p, &packing, path, 22, |_| 1.0e-6) else { return };
    assert!(states[11].free);
    assert!(!states[21].free && states[21].stress.trace() > 0.0);
}

/// Each restarts from the fresh packing of its kind, on both.
#[test]
fn free_ones_restart_as_their_kind() {
    let Some(device) = gpu::for_tests() else { return };
    let (p, packing) = dense::<f64>();
    let other = consolidate(&p, 8).unwrap();
    let rve = |kind| Rve { kind, ..Rve::new(packing.clone()) };
    let rves = vec![rve(1), rve(0), rve(1)];
    let mut cpu = RveBatch { parameters: p, rves, fresh: vec![packing.clone(), other] };
    let mut twin = CudaRveBatch::upload(&device, &cpu).unwrap();
    let mut states = [[RveState::default(); 3]; 2];
    for step in 0..22 {
        let l = [Matrix2::identity() * if step < 12 { 100.0 } else { -120.0 }; 3];
        cpu.advance(DT, &l, &mut states[0]).unwrap();
        twin.advance(DT, &l, &mut states[1]).unwrap();
        states[1]
            .iter()
            .zip(&states[0])
            .for_each(|(gpu, cpu)| assert_states_close(gpu, cpu, 1.0e-6));
    }
    let on_gpu = twin.download().unwrap();
    let radii = |packing: &Packing<f64>| packing.discs.iter().map(|d| d.r).collect::<Vec<f64>>();
    for (gpu, cpu) in on_gpu.rves.iter().zip(&cpu.rves) {
        assert_eq!(gpu.kind, cpu.kind);
        assert_eq!(radii(&gpu.packing), radii(&on_gpu.fresh[cpu.kind as usize]));
        assert_eq!(radii(&gpu.packing), radii(&cpu.packing));
    }
}

/// A stress-free cell expands to a hundred times the area of its discs and no further.
#[test]
fn free_cells_do_not_expand_without_bound() {
    let (p, packing) = dense::<f64>();
    let path = |_| Matrix2::identity() * 500.0;
    let Some(states) = compare_path(&p, &packing, path, 100, |_| 1.0e-9) else { return };
    assert!((states[99].solid_fraction - 0.01).abs() < 1e-9, "{:?}", states[99]);
}

/// Every RVE of a large batch is bitwise what it is alone.
#[test]
fn many_are_each_alone() {
    let Some(device) = gpu::for_tests() else { return };
    let (p, packing) = dense::<f32>();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let packings = vec![packing; 40];
    let gradients: Vec<_> = packings.iter().map(|_| random_gradient(&mut rng, 30.0)).collect();
    let run = |packings: &[Packing<f32>], gradients: &[Matrix2<f64>]| {
        let mut twin = CudaRveBatch::upload(&device, &batch(&p, packings)).unwrap();
        let mut states = vec![RveState::default(); packings.len()];
        for _ in 0..20 {
            twin.advance(DT, gradients, &mut states).unwrap();
        }
        (twin.download().unwrap().rves, states)
    };
    let (rves, states) = run(&packings, &gradients);
    for k in [0, 17, 39] {
        let (alone, alone_state) = run(&packings[k..=k], &gradients[k..=k]);
        assert_eq!(alone[0], rves[k]);
        assert_eq!(alone_state[0], states[k]);
    }
}

/// Both discs of a pair must find it, to the last bit of its distance: one search in some thousands
/// has a pair that close to its range.
#[test]
fn thousands_of_searches() {
    let Some(device) = gpu::for_tests() else { return };
    let (p, packing) = dense::<f32>();
    let rves = 2000;
    let mut twin = CudaRveBatch::upload(&device, &batch(&p, &vec![packing; rves])).unwrap();
    let shear = |k: usize| Matrix2::new(0.0, 20.0 + 0.04 * k as f64, 0.0, 0.0);
    let gradients: Vec<_> = (0..rves).map(shear).collect();
    let mut states = vec![RveState::default(); rves];
    let mut searches = 0;
    for _ in 0..40 {
        twin.advance(DT, &gradients, &mut states).unwrap();
        searches += states.iter().map(|s| s.searches).sum::<u32>();
    }
    assert!(searches > 10_000, "{searches}");
}

/// A download and upload at any macro step changes nothing, bit by bit.
fn restart<R: CudaReal>(p: &RveParameters, packing: &Packing<R>, l: Matrix2<f64>) {
    let Some(device) = gpu::for_tests() else { return };
    let mut twin = CudaRveBatch::upload(&device, &batch(p, std::slice::from_ref(packing))).unwrap();
    let mut restarted = CudaRveBatch::upload(&device, &twin.download().unwrap()).unwrap();
    let mut state = vec![RveState::default()];
    let mut restarted_state = state.clone();
    for _ in 0..25 {
        twin.advance(DT, &[l], &mut state).unwrap();
        restarted.advance(DT, &[l], &mut restarted_state).unwrap();
        assert_eq!(state, restarted_state);
        restarted = CudaRveBatch::upload(&device, &restarted.download().unwrap()).unwrap();
    }
    // What is left in the CPU's list besides the state of the packing does not come back.
    let (a, b) = (twin.download().unwrap(), restarted.download().unwrap());
    assert_eq!(a.rves[0].packing.discs, b.rves[0].packing.discs);
    let [a, b] = [a, b].map(|batch| springs(&batch.rves[0].packing));
    assert_eq!(a, b);
    assert_eq!(a.iter().any(|spring| spring.3 != 0.0), p.grains.rolling_friction != 0.0);
}

#[test]
fn restart_is_bitwise() {
    let l = Matrix2::new(-2.0, 60.0, 5.0, 1.0);
    let (p, packing) = dense::<f32>();
    restart(&p, &packing, l);
    let (p, packing) = dense::<f64>();
    restart(&p, &packing, l);
    let (resisting, packing) = rolling::<f32>();
    restart(&resisting, &packing, l);
    let resisting =
        RveParameters { discs: 24, thin_width: 0.0, free_solid_fraction: 0.0, ..resisting };
    restart(&resisting, &thin_packing::<f64>(&resisting, 8.0e-3), l);
    let p = RveParameters { discs: 24, thin_width: 0.0, free_solid_fraction: 0.0, ..p };
    restart(&p, &thin_packing::<f32>(&p, 8.0e-3), l);
    restart(&p, &thin_packing::<f64>(&p, 8.0e-3), l);
}

/// A batch that ran on the GPU goes on equally on the CPU.
#[test]
fn cpu_continues_from_gpu() {
    let Some(device) = gpu::for_tests() else { return };
    let (p, packing) = rolling::<f64>();
    let l = [Matrix2::new(-0.5, 10.0, 0.0, 0.3)];
    let mut cpu = batch(&p, &[packing]);
    let mut twin = CudaRveBatch::upload(&device, &cpu).unwrap();
    let mut cpu_state = vec![RveState::default()];
    let mut gpu_state = cpu_state.clone();
    for _ in 0..10 {
        cpu.advance(DT, &l, &mut cpu_state).unwrap();
        twin.advance(DT, &l, &mut gpu_state).unwrap();
    }
    let mut moved = twin.download().unwrap();
    for _ in 0..10 {
        cpu.advance(DT, &l, &mut cpu_state).unwrap();
        moved.advance(DT, &l, &mut gpu_state).unwrap();
        assert_states_close(&gpu_state[0], &cpu_state[0], 1.0e-9);
    }
}

/// The failure of a batch of three, whose second RVE fails.
fn failure(p: &RveParameters, packing: Packing<f64>, l: Matrix2<f64>) -> Option<RveFailure> {
    let device = gpu::for_tests()?;
    let (_, healthy) = dense::<f64>();
    let batch = batch(p, &[healthy.clone(), packing, healthy]);
    let mut twin = CudaRveBatch::upload(&device, &batch).unwrap();
    let gradients = [Matrix2::zeros(), l, Matrix2::zeros()];
    let mut states = vec![RveState::default(); 3];
    match twin.advance(DT, &gradients, &mut states) {
        Err(CudaError::Rve { rve: 1, step: 1, failure }) => Some(failure),
        other => panic!("{other:?}"),
    }
}

#[test]
fn failures_name_the_rve() {
    let (p, packing) = dense::<f64>();
    let nan = Matrix2::new(f64::NAN, 0.0, 0.0, 0.0);
    if let Some(found) = failure(&p, packing.clone(), nan) {
        assert_eq!(found, RveFailure::Packing(Failure::NotFinite));
    }

    // One disc inside another.
    let mut crushed = packing.clone();
    crushed.discs[50].s = crushed.discs[0].s.map(|s| s.wrapping_add(1 << 40));
    if let Some(found) = failure(&p, crushed, Matrix2::zeros()) {
        assert!(matches!(found, RveFailure::Packing(Failure::Overlap(x)) if x > 1.0), "{found}");
    }

    // All discs within reach of each other.
    let mut crushed = packing;
    crushed.cell.h *= 0.3;
    if let Some(found) = failure(&p, crushed, Matrix2::zeros()) {
        assert!(matches!(found, RveFailure::ListFull { .. }), "{found}");
    }
}

#[test]
fn too_many_discs_are_refused() {
    let p = RveParameters::default();
    let error = Shape::new::<f32>(&p, 1025, Limits::SM_90, Room::Usual).unwrap_err();
    assert!(matches!(error, CudaError::TooManyDiscs { discs: 1025, most: 1024, .. }), "{error}");
    assert!(Shape::new::<f64>(&p, 1024, Limits::SM_90, Room::Usual).is_ok());
}

/// Needs NVRTC, but no GPU.
#[rstest]
#[case("sm_80", Limits::SM_80)]
#[case("sm_90a", Limits::SM_90)]
fn kernels_compile(#[case] architecture: &str, #[case] limits: Limits) {
    if !gpu::nvrtc_for_tests() {
        return;
    }
    let p = RveParameters::default();
    let mut rolling = p.clone();
    rolling.grains.rolling_friction = 0.1;
    for discs in [1, 100, 400, 832] {
        let mut shapes = vec![
            (Shape::new::<f32>(&p, discs, limits, Room::Usual), source::<f32>()),
            (Shape::new::<f64>(&p, discs, limits, Room::Usual), source::<f64>()),
            (Shape::new::<f32>(&p, discs, limits, Room::Ample), source::<f32>()),
            (Shape::new::<f32>(&rolling, discs, limits, Room::Usual), source::<f32>()),
            (Shape::new::<f64>(&rolling, discs, limits, Room::Usual), source::<f64>()),
        ];
        if discs == 100 {
            shapes.push((Shape::unequal::<f32>(&p, discs, limits), source::<f32>()));
            shapes.push((Shape::unequal::<f64>(&rolling, discs, limits), source::<f64>()));
        }
        for (shape, source) in shapes {
            let Ok(shape) = shape else { continue };
            let cubin = compile("rve.cu", &source, architecture, &shape.defines());
            assert!(!cubin.unwrap().is_empty());
        }
    }
}
