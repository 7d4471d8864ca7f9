//! The CUDA solver against its CPU twin.
//!
//! Without a GPU these tests say so and pass, unless `DEMPM_REQUIRE_GPU=1`.

use std::sync::Arc;

use gpu::{Device, compile};
use mpm::cuda::{
    CudaDruckerPrager, CudaElastic, CudaError, CudaMaterial, CudaSolver, defines, source,
};
use mpm::{
    Basis, Domain, DruckerPrager, DruckerPragerParameters, Elastic, ElasticParameters, Error,
    Friction, Ledger, Mat2, Material, Numerics, Obstacle, Points, Scheme, Solver, Transfer, Vec2,
    WallContact, Walls,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstest::rstest;

const DT: f64 = 1.0e-4;
const BASES: [Basis; 4] = [Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic];
const TRANSFERS: [Transfer; 4] = [
    Transfer::FlipApic { rate: 500.0 },
    Transfer::Flip { rate: 20.0 },
    Transfer::Apic,
    Transfer::Pic,
];

/// A box with different walls, a barrier between them, and a plate that begins to move in the
/// middle of a step.
fn solver(numerics: Numerics) -> Solver {
    let walls = Walls {
        left: Friction::Stick,
        right: Friction::Coulomb(0.2),
        bottom: Friction::Coulomb(0.5),
        top: Friction::Slip,
    };
    let faces = Walls { left: Friction::Coulomb(0.3), ..walls };
    let barrier = Obstacle {
        min: Vec2::new(0.8, 0.0),
        max: Vec2::new(1.07, 0.41),
        faces,
        velocity: Vec2::zeros(),
        start: 0.0,
    };
    let plate = Obstacle {
        min: Vec2::new(0.3, 0.8),
        max: Vec2::new(0.6, 1.6),
        faces,
        velocity: Vec2::new(0.7, -0.9),
        start: 2.5 * DT,
    };
    let domain = Domain { size: Vec2::new(1.5, 1.2), walls, cell: 0.1 };
    Solver::new(domain, numerics, Vec2::new(0.5, -9.81), vec![barrier, plate]).unwrap()
}

/// Points anywhere in the box, also on its walls and where boxes are about to push them, with
/// random states.
fn random_points(count: usize) -> Points {
    let mut rng = ChaCha8Rng::seed_from_u64(count as u64);
    let mut random = |from: f64, to: f64| rng.random_range(from..to);
    let mut points = Points::default();
    while points.len() < count {
        let mut x = Vec2::new(random(0.0, 1.5), random(0.0, 1.2));
        match points.len() % 40 {
            0 => x.x = 0.0,
            1 => x.x = 1.5,
            2 => x.y = 0.0,
            3 => x.y = 1.2,
            _ => {}
        }
        let inside = |min: [f64; 2], max: [f64; 2]| (0..2).all(|k| x[k] > min[k] && x[k] < max[k]);
        if inside([0.83, -0.1], [1.04, 0.38]) || inside([0.33, 0.83], [0.57, 1.3]) {
            continue;
        }
        points.push(x, random(0.5, 3.0), random(2.0e-4, 1.5e-3));
        let p = points.len() - 1;
        points.velocity[p] = Vec2::new(random(-3.0, 3.0), random(-3.0, 3.0));
        points.affine[p] = Mat2::from_fn(|_, _| random(-5.0, 5.0));
        let shear = random(-2.0e3, 2.0e3);
        points.stress[p] = Mat2::new(random(-9.0e3, 0.0), shear, shear, random(-9.0e3, 0.0));
    }
    points
}

/// Largest difference of two arrays over the largest entry (or `floor`, if that is more).
fn difference<'a>(
    a: impl Iterator<Item = &'a f64>,
    b: impl Iterator<Item = &'a f64>,
    floor: f64,
) -> f64 {
    let (mut most, mut scale) = (0.0_f64, floor);
    for (a, b) in a.zip(b) {
        assert!(a.is_finite() && b.is_finite());
        most = most.max((a - b).abs());
        scale = scale.max(b.abs());
    }
    most / scale
}

fn assert_points_close(gpu: &Points, cpu: &Points, tolerance: f64) {
    let vectors =
        |a: &[Vec2], b: &[Vec2], floor| difference(a.iter().flatten(), b.iter().flatten(), floor);
    let matrices =
        |a: &[Mat2], b: &[Mat2], floor| difference(a.iter().flatten(), b.iter().flatten(), floor);
    for (what, found) in [
        ("position", vectors(&gpu.position, &cpu.position, 1.0)),
        ("velocity", vectors(&gpu.velocity, &cpu.velocity, 1.0)),
        ("affine matrix", matrices(&gpu.affine, &cpu.affine, 10.0)),
        ("velocity gradient", matrices(&gpu.velocity_gradient, &cpu.velocity_gradient, 10.0)),
        ("stress", matrices(&gpu.stress, &cpu.stress, 1.0e3)),
        ("volume", difference(gpu.volume.iter(), cpu.volume.iter(), 1.0e-3)),
    ] {
        assert!(found <= tolerance, "{what}: {found:e}, tolerance {tolerance:e}");
    }
}

fn assert_ledgers_close(gpu: &Ledger, cpu: &Ledger, tolerance: f64) {
    let flat = |l: &Ledger| {
        let bodies = [l.wall_impulse].into_iter().chain(l.obstacle_impulse.iter().copied());
        bodies.flat_map(<[f64; 2]>::from).chain([l.plate_work]).collect::<Vec<_>>()
    };
    let found = difference(flat(gpu).iter(), flat(cpu).iter(), 1.0);
    assert!(found <= tolerance, "ledger: {found:e}: {gpu:?} {cpu:?}");
    assert_eq!(gpu.projected, cpu.projected);
}

/// Runs both twins step by step and compares after each.
fn compare(
    numerics: Numerics,
    points: Points,
    material: &mut dyn Material,
    twin: impl FnOnce(&Arc<Device>) -> Box<dyn CudaMaterial>,
    steps: usize,
    tolerance: impl Fn(usize) -> f64,
) {
    let Some(device) = gpu::for_tests() else { return };
    let (mut cpu, mut cpu_points) = (solver(numerics), points);
    let (mut host, mut gpu_points) = (solver(numerics), cpu_points.clone());
    let mut twin = twin(&device);
    let mut gpu = CudaSolver::new(&device, &host, &gpu_points, DT, 0).unwrap();
    for step in 0..steps {
        cpu.set_time(step as f64 * DT);
        cpu.advance(&mut cpu_points, material, DT).unwrap();
        gpu.queue_step(twin.as_mut()).unwrap();
        gpu.fetch(&mut gpu_points, &mut host, twin.as_ref()).unwrap();
        assert_points_close(&gpu_points, &cpu_points, tolerance(step));
        assert_ledgers_close(host.ledger(), cpu.ledger(), tolerance(step));
    }
    // The case is not void: points met walls, barrier and plate.
    let ledger = cpu.ledger();
    assert!(ledger.projected > 0 && ledger.wall_impulse.norm() > 0.0);
    assert!(ledger.obstacle_impulse.iter().all(|i| i.norm() > 0.0));
    assert!(steps < 4 || ledger.plate_work != 0.0);
}

/// Sums of up to a hundred terms of 1e-16 each; gradients divide by a tenth of a cell's mass, and
/// a light node by its mass: 1e-12 in the first step. Every step may double it.
fn round_off(step: usize) -> f64 {
    1.0e-12 * 2.0_f64.powi(step as i32)
}

#[rstest]
fn random_points_with_mu_i(
    #[values(Scheme::Musl, Scheme::Usl, Scheme::Usf)] scheme: Scheme,
    #[values(false, true)] cell_average_volumetric: bool,
) {
    for basis in BASES {
        for transfer in TRANSFERS {
            let numerics = Numerics {
                basis,
                scheme,
                transfer,
                cell_average_volumetric,
                // Random points leave nodes almost empty; under USL their velocity is noise that
                // differs between the twins by much more than round-off.
                mass_cutoff: 1.0e-3,
                ..Numerics::default()
            };
            let points = random_points(700);
            let mut law =
                DruckerPrager::new(DruckerPragerParameters::default(), &points.stress).unwrap();
            let start = law.clone();
            let twin = |device: &Arc<Device>| -> Box<dyn CudaMaterial> {
                Box::new(CudaDruckerPrager::new(device, &start).unwrap())
            };
            compare(numerics, points, &mut law, twin, 6, round_off);
        }
    }
}

/// Random points overlap: the correction is at work in every step.
#[rstest]
fn random_points_whose_density_is_corrected(
    #[values(Scheme::Musl, Scheme::Usf)] scheme: Scheme,
    #[values(WallContact::Nodes, WallContact::Points)] wall_contact: WallContact,
) {
    for basis in BASES {
        let density_correction = 100.0;
        let mass_cutoff = 1.0e-3;
        let numerics = Numerics {
            basis,
            scheme,
            wall_contact,
            density_correction,
            mass_cutoff,
            ..Numerics::default()
        };
        let law = Elastic::new(ElasticParameters::default()).unwrap();
        let twin = |device: &Arc<Device>| -> Box<dyn CudaMaterial> {
            Box::new(CudaElastic::new(device, &law).unwrap())
        };
        compare(numerics, random_points(700), &mut law.clone(), twin, 6, round_off);
    }
}

/// Walls and boxes that wait for points, and shocks with a width.
#[rstest]
fn random_points_that_meet_walls(#[values(Scheme::Musl, Scheme::Usl, Scheme::Usf)] scheme: Scheme) {
    for basis in BASES {
        let numerics = Numerics {
            basis,
            scheme,
            wall_contact: WallContact::Points,
            shock_width: 2.0,
            mass_cutoff: 1.0e-3,
            ..Numerics::default()
        };
        let law = Elastic::new(ElasticParameters::default()).unwrap();
        let twin = |device: &Arc<Device>| -> Box<dyn CudaMaterial> {
            Box::new(CudaElastic::new(device, &law).unwrap())
        };
        compare(numerics, random_points(700), &mut law.clone(), twin, 6, round_off);
    }
}

#[rstest]
fn random_points_with_elasticity(#[values(Scheme::Musl, Scheme::Usl, Scheme::Usf)] scheme: Scheme) {
    let numerics = Numerics { scheme, mass_cutoff: 1.0e-3, ..Numerics::default() };
    let parameters = ElasticParameters { young_modulus: 1.0e5, poisson_ratio: 0.3 };
    let mut law = Elastic::new(parameters).unwrap();
    let twin = |device: &Arc<Device>| -> Box<dyn CudaMaterial> {
        Box::new(CudaElastic::new(device, &law).unwrap())
    };
    compare(numerics, random_points(700), &mut law.clone(), twin, 6, round_off);
    law = Elastic::new(ElasticParameters::default()).unwrap();
    let twin = |device: &Arc<Device>| -> Box<dyn CudaMaterial> {
        Box::new(CudaElastic::new(device, &law).unwrap())
    };
    compare(numerics, random_points(90), &mut law.clone(), twin, 6, round_off);
}

/// The law's state comes back too.
#[test]
fn volume_strain_is_kept() {
    let Some(device) = gpu::for_tests() else { return };
    let (mut host, mut points) = (solver(Numerics::default()), random_points(300));
    let mut law = DruckerPrager::new(DruckerPragerParameters::default(), &points.stress).unwrap();
    let mut twin = CudaDruckerPrager::new(&device, &law).unwrap();
    let mut gpu = CudaSolver::new(&device, &host, &points, DT, 0).unwrap();
    let before = law.volume_strain().to_vec();
    gpu.queue_step(&mut twin).unwrap();
    gpu.fetch(&mut points, &mut host, &twin).unwrap();
    twin.fetch(&mut law).unwrap();
    for ((new, old), l) in law.volume_strain().iter().zip(before).zip(&points.velocity_gradient) {
        assert!((new - (old + DT * l.trace())).abs() <= 1.0e-15 * (1.0 + old.abs()));
    }
}

/// A run on the GPU is the same bit by bit, also when points and material were fetched and
/// uploaded in between.
#[test]
fn runs_and_restarts_are_bitwise() {
    let Some(device) = gpu::for_tests() else { return };
    let numerics = Numerics { cell_average_volumetric: true, ..Numerics::default() };
    let run = |stops: &[usize]| {
        let mut points = random_points(900);
        let mut law =
            DruckerPrager::new(DruckerPragerParameters::default(), &points.stress).unwrap();
        let mut host = solver(numerics);
        let mut step = 0;
        for &stop in stops {
            let mut twin = CudaDruckerPrager::new(&device, &law).unwrap();
            let mut gpu = CudaSolver::new(&device, &host, &points, DT, step).unwrap();
            // The ledger is summed at frames, here every 10 steps.
            while step < stop {
                (0..10).for_each(|_| gpu.queue_step(&mut twin).unwrap());
                step += 10;
                gpu.fetch(&mut points, &mut host, &twin).unwrap();
                twin.fetch(&mut law).unwrap();
            }
        }
        (points, law, host.ledger().clone())
    };
    let whole = run(&[100]);
    assert!(whole == run(&[100]));
    assert!(whole == run(&[30, 40, 100]));
}

/// Why a run of one step on the GPU, and on the CPU, stops.
fn failures(points: &Points, numerics: Numerics) -> Option<[String; 2]> {
    let device = gpu::for_tests()?;
    let law = DruckerPrager::new(DruckerPragerParameters::default(), &points.stress).unwrap();
    let mut cpu = solver(numerics);
    let expected =
        cpu.advance(&mut points.clone(), &mut law.clone(), DT).expect_err("the CPU fails");
    let mut twin = CudaDruckerPrager::new(&device, &law).unwrap();
    let mut host = solver(numerics);
    let mut gpu = CudaSolver::new(&device, &host, points, DT, 41).unwrap();
    // Further steps after the failure change nothing.
    (0..5).for_each(|_| gpu.queue_step(&mut twin).unwrap());
    match gpu.fetch(&mut points.clone(), &mut host, &twin) {
        Err(CudaError::Step { step, source }) => {
            assert_eq!(step, 42);
            Some([source.to_string(), expected.to_string()])
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_point_that_leaves_the_domain_is_named() {
    let mut points = random_points(400);
    let numerics = Numerics::default();
    for p in [250, 77, 300] {
        points.position[p] = Vec2::new(0.7, 1.15);
        points.velocity[p] = Vec2::new(0.0, 5.0e3);
        points.mass[p] = 1.0e6;
    }
    if let Some([gpu, cpu]) = failures(&points, numerics) {
        // Equal but for round-off in the position.
        let words = |text: &str| text.split('(').next().unwrap_or_default().to_owned();
        assert_eq!(words(&gpu), words(&cpu));
        assert!(gpu.contains("is outside of the domain"), "{gpu}");
    }
}

#[rstest]
fn a_stress_that_is_not_finite_is_named(#[values(Scheme::Musl, Scheme::Usf)] scheme: Scheme) {
    let mut points = random_points(400);
    points.affine[123] = Mat2::identity() * 1.0e300;
    points.velocity[123] = Vec2::new(0.0, 0.0);
    let numerics = Numerics { scheme, ..Numerics::default() };
    if let Some([gpu, cpu]) = failures(&points, numerics) {
        let words = |text: &str| text.split(['(', '[']).next().unwrap_or_default().to_owned();
        assert_eq!(words(&gpu), words(&cpu));
    }
}

#[test]
fn points_that_the_cpu_refuses_are_refused() {
    let Some(device) = gpu::for_tests() else { return };
    let mut points = random_points(10);
    points.position[3].x = 1.6;
    let refused = CudaSolver::new(&device, &solver(Numerics::default()), &points, DT, 0);
    assert!(matches!(
        refused.err(),
        Some(CudaError::Step { source: Error::OutsideDomain { point: 3, .. }, .. })
    ));
}

#[test]
fn no_points_are_no_trouble() {
    let Some(device) = gpu::for_tests() else { return };
    let (mut host, mut points) = (solver(Numerics::default()), Points::default());
    let law = Elastic::new(ElasticParameters::default()).unwrap();
    let mut twin = CudaElastic::new(&device, &law).unwrap();
    let mut gpu = CudaSolver::new(&device, &host, &points, DT, 0).unwrap();
    gpu.queue_step(&mut twin).unwrap();
    gpu.fetch(&mut points, &mut host, &twin).unwrap();
    assert!(points.is_empty());
}

/// Without a GPU too: the kernels compile for the GPUs they are meant for.
#[rstest]
#[case("sm_80")]
#[case("sm_90a")]
fn kernels_compile(#[case] architecture: &str) {
    if !gpu::nvrtc_for_tests() {
        return;
    }
    for basis in BASES {
        for wall_contact in [WallContact::Nodes, WallContact::Points] {
            let numerics = Numerics { basis, wall_contact, ..Numerics::default() };
            let cubin = compile("mpm.cu", &source(), architecture, &defines(&numerics)).unwrap();
            assert!(!cubin.is_empty());
        }
    }
}
