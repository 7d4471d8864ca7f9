//! Whole simulations on a GPU against the same on the CPU.
//!
//! Without a GPU these tests say so and pass, unless `DEMPM_REQUIRE_GPU=1`.

use std::error::Error as _;
use std::path::Path;
use std::sync::Arc;

use dempm::run::{Monitor, checkpoint};
use dempm::scene::Scene;
use dempm::simulation::cuda;
use dempm::simulation::{ModelState, MpmState, SceneMaterial, Simulation, SimulationError, State};
use dempm::trajectory::Frame;
use gpu::{Device, compile};
use mpm::{Mat2, Vec2};
use rstest::rstest;
use tempfile::TempDir;

/// Small packings that fail early.
const RVE: &str = "[rve]\ndiscs = 60\nmax_solid_fraction = 100\n[grains]\noverlap_limit = 1";

/// A small column that collapses over a barrier under a plate, 50 steps a frame.
fn scene(material: &str, numerics: &str) -> Scene {
    let text = format!(
        r#"
        duration = 0.05
        frame_interval = 0.005
        [domain]
        size = [1.0, 0.75]
        cell = 0.125
        walls = {{ left = "slip", right = 0.2, bottom = 0.5, top = "slip" }}
        [[column]]
        size = [0.25, 0.375]
        velocity = [1.0, -0.5]
        [[obstacle]]
        corner = [0.25, 0.0]
        size = [0.25, 0.25]
        faces = {{ left = 0.3, right = "slip", bottom = 0.5, top = 0.5 }}
        [plate]
        corner = [0.0, 0.375]
        size = [0.25, 0.25]
        velocity = [0.0, -0.5]
        start = 0.00225
        [material]
        kind = "{material}"
        {precision}
        {rve}
        [numerics]
        {numerics}
        [output]
        fields = ["stress"]
        "#,
        precision = if material == "rve" { "precision = \"f64\"" } else { "" },
        rve = if material == "rve" { RVE } else { "" },
    );
    Scene::parse(&text, "test.toml").unwrap()
}

/// A copy of the state by way of a checkpoint.
fn copy(directory: &Path, scene: &Scene, state: &State) -> State {
    let path = directory.join("copy.ckpt");
    checkpoint::write(&path, &scene.text, state, &Monitor::default()).unwrap();
    checkpoint::read(&path, &scene.text).unwrap().0
}

/// The same start on the CPU and on the GPU.
fn twins(scene: &Scene, device: &Arc<Device>, directory: &Path) -> [Simulation; 2] {
    let cpu = Simulation::new(scene.clone()).unwrap();
    let state = copy(directory, scene, &cpu.state());
    let mut gpu = Simulation::resume(scene.clone(), state).unwrap();
    gpu.move_to(device, None).unwrap();
    [cpu, gpu]
}

fn mpm_state(simulation: &Simulation) -> MpmState {
    let ModelState::Mpm(state) = simulation.state().model else { panic!("not the MPM") };
    state
}

fn next_frame(simulation: &mut Simulation) -> Result<Frame, SimulationError> {
    let frames = simulation.frames_so_far();
    while simulation.frames_so_far() == frames {
        simulation.advance()?;
    }
    Ok(simulation.frame())
}

fn assert_frames_close(gpu: &Frame, cpu: &Frame, tolerance: f64) {
    assert_eq!(gpu.time, cpu.time);
    assert_eq!(gpu.boxes, cpu.boxes);
    let far = |a: &[[f64; 2]], b: &[[f64; 2]]| {
        let pairs = a.as_flattened().iter().zip(b.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let [x, v] = [far(&gpu.position, &cpu.position), far(&gpu.velocity, &cpu.velocity)];
    assert!(x <= 1.0e-3 * tolerance, "positions differ by {x:e} m");
    assert!(v <= tolerance, "velocities differ by {v:e} m/s");
    assert_eq!(gpu.budget.keys().collect::<Vec<_>>(), cpu.budget.keys().collect::<Vec<_>>());
    for (name, expected) in &cpu.budget {
        let found = gpu.budget[name];
        let scale = expected.abs().max(1.0);
        assert!((found - expected).abs() <= 10.0 * tolerance * scale, "{name}: {found} {expected}");
    }
}

/// Round-off (1e-13 of 1 m/s) grows in a packing by at most a factor of ten in 20 steps, less in a
/// continuum law; positions feel a difference of velocities for a millisecond.
const TOLERANCE: f64 = 1.0e-6;

#[rstest]
#[case("rve", "")]
#[case("rve", "wall_contact = \"points\"")]
#[case("rve", "scheme = \"usf\"\nbasis = \"gimp\"\ncell_average = true")]
#[case("mu-i", "")]
#[case("mu-i", "scheme = \"usl\"\nbasis = \"cubic\"")]
#[case("elastic", "transfer = \"apic\"")]
fn a_collapse_is_that_of_the_cpu(#[case] material: &str, #[case] numerics: &str) {
    let Some(device) = gpu::for_tests() else { return };
    let directory = TempDir::new().unwrap();
    let scene = scene(material, numerics);
    let [mut cpu, mut gpu] = twins(&scene, &device, directory.path());
    for _ in 0..3 {
        let expected = next_frame(&mut cpu).unwrap();
        assert_frames_close(&next_frame(&mut gpu).unwrap(), &expected, TOLERANCE);
    }
    cpu.record().unwrap();
    gpu.record().unwrap();
    let (a, b) = (mpm_state(&gpu), mpm_state(&cpu));
    assert_eq!((gpu.step, a.ledger.projected), (cpu.step, b.ledger.projected));
    match (&a.material, &b.material) {
        (SceneMaterial::Rve(a), SceneMaterial::Rve(b)) => {
            let counts = |t: dempm::simulation::Tally| {
                [t.steps, t.free_steps, t.thin_steps, t.overlap_steps]
            };
            assert_eq!(counts(a.tally), counts(b.tally));
            let limits = |t: dempm::simulation::Tally| Vec2::new(t.max_overlap, t.min_width);
            let (a_limits, b_limits) = (limits(a.tally), limits(b.tally));
            assert!((a_limits - b_limits).norm() <= TOLERANCE * b_limits.norm());
            // Each twin searches neighbours when its own bound says so.
            assert!(a.tally.searches > 0);
            assert!(gpu.wall_time["rve"] > 0.0);
        }
        (SceneMaterial::MuI(a), SceneMaterial::MuI(b)) => {
            let pairs = a.volume_strain().iter().zip(b.volume_strain());
            assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1.0e-9);
        }
        (SceneMaterial::Elastic(a), SceneMaterial::Elastic(b)) => assert_eq!(a, b),
        _ => panic!("materials of different kinds"),
    }
    assert!(gpu.wall_time["mpm"] > 0.0);
}

/// A run on the GPU, which went on while its frames were looked at, and one that was stopped at a frame and resumed
/// from its checkpoint: their frames are the same, bit by bit.
fn whole_and_resumed(scene: Scene, device: &Arc<Device>) -> [Simulation; 2] {
    let directory = TempDir::new().unwrap();
    let [_, mut whole] = twins(&scene, device, directory.path());
    let [_, mut stopped] = twins(&scene, device, directory.path());
    whole.advance_and(true).unwrap();
    assert_eq!(whole.frame(), next_frame(&mut stopped).unwrap());
    stopped.record().unwrap();
    let state = copy(directory.path(), &scene, &stopped.state());
    let mut resumed = Simulation::resume(scene, state).unwrap();
    resumed.move_to(device, None).unwrap();
    for last in [false, false, true] {
        whole.advance_and(!last).unwrap();
        assert_eq!(whole.frame(), next_frame(&mut resumed).unwrap());
    }
    [whole, resumed]
}

/// A run on the GPU that is stopped at a frame and resumed from its checkpoint is the
/// uninterrupted one, bit by bit, which went on while its frames were looked at.
#[rstest]
fn a_resumed_run_is_bitwise_the_same(#[values("rve", "mu-i", "elastic")] material: &str) {
    let Some(device) = gpu::for_tests() else { return };
    let [mut whole, mut resumed] = whole_and_resumed(scene(material, ""), &device);
    whole.record().unwrap();
    resumed.record().unwrap();
    assert_eq!(whole.points, resumed.points);
    let (whole, resumed) = (mpm_state(&whole), mpm_state(&resumed));
    assert_eq!(whole.ledger, resumed.ledger);
    if let (SceneMaterial::Rve(a), SceneMaterial::Rve(b)) = (&whole.material, &resumed.material) {
        assert_eq!((a.states(), a.tally), (b.states(), b.tally));
    }
}

/// A checkpoint of the CPU, also between two frames, goes on on the GPU, and back.
#[rstest]
fn checkpoints_change_places(#[values("rve", "mu-i")] material: &str) {
    let Some(device) = gpu::for_tests() else { return };
    let directory = TempDir::new().unwrap();
    let scene = scene(material, "");
    let [mut cpu, _] = twins(&scene, &device, directory.path());
    (0..7).for_each(|_| cpu.advance().unwrap());
    cpu.record().unwrap();
    let state = copy(directory.path(), &scene, &cpu.state());
    let mut gpu = Simulation::resume(scene.clone(), state).unwrap();
    gpu.move_to(&device, None).unwrap();
    let expected = next_frame(&mut cpu).unwrap();
    assert_frames_close(&next_frame(&mut gpu).unwrap(), &expected, TOLERANCE);

    gpu.record().unwrap();
    let state = copy(directory.path(), &scene, &gpu.state());
    let mut back = Simulation::resume(scene, state).unwrap();
    let expected = next_frame(&mut cpu).unwrap();
    assert_frames_close(&next_frame(&mut back).unwrap(), &expected, TOLERANCE);
}

/// Some three hundred discs, 50 steps a frame.
fn discs(precision: &str) -> Scene {
    let text = format!(
        r#"
        duration = 0.05
        frame_interval = 0.005
        [domain]
        size = [0.5, 0.25]
        cell = 0.0625
        [[column]]
        size = [0.125, 0.125]
        velocity = [0.3, 0.0]
        [plate]
        corner = [0.0, 0.1875]
        size = [0.0625, 0.0625]
        velocity = [0.0, -2.0]
        start = 0.00225
        [material]
        kind = "discs"
        precision = "{precision}"
        "#
    );
    Scene::parse(&text, "discs.toml").unwrap()
}

#[test]
fn discs_are_those_of_the_cpu() {
    let Some(device) = gpu::for_tests() else { return };
    let directory = TempDir::new().unwrap();
    let [mut cpu, mut gpu] = twins(&discs("f64"), &device, directory.path());
    for _ in 0..2 {
        let expected = next_frame(&mut cpu).unwrap();
        assert_frames_close(&next_frame(&mut gpu).unwrap(), &expected, TOLERANCE);
    }
}

/// As packings.
#[rstest]
fn a_resumed_run_of_discs_is_bitwise_the_same(#[values("f32", "f64")] precision: &str) {
    let Some(device) = gpu::for_tests() else { return };
    whole_and_resumed(discs(precision), &device);
}

/// Columns prepared on a GPU rest as those of the CPU do.
#[test]
fn columns_are_prepared_on_a_gpu() {
    let Some(device) = gpu::for_tests() else { return };
    let scene = discs("f32");
    let mean = |values: Option<Vec<f32>>| {
        let values = values.unwrap();
        values.iter().sum::<f32>() / values.len() as f32
    };
    let start = |device| Simulation::prepare(scene.clone(), device, None).unwrap().frame();
    let (cpu, gpu) = (start(None), start(Some(&device)));
    assert!((mean(cpu.solid_fraction) - mean(gpu.solid_fraction)).abs() < 0.02);
    assert!((mean(cpu.coordination) - mean(gpu.coordination)).abs() < 0.5);
}

/// The message with its causes.
fn words(error: &SimulationError) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text += &format!(": {cause}");
        source = cause.source();
    }
    text
}

/// A point or packing that fails in the middle of a frame ends the run in the words of the CPU,
/// with the same point and step.
#[rstest]
#[case("rve", 3)]
#[case("elastic", 0)]
#[case("mu-i", 0)]
fn failures_are_those_of_the_cpu(#[case] material: &str, #[case] point: usize) {
    let Some(device) = gpu::for_tests() else { return };
    let directory = TempDir::new().unwrap();
    let mut scene = scene(material, "");
    if material == "rve" {
        // Reached before the packing is so dense that the GPU has no room for its neighbours.
        let text = scene.text.replace("overlap_limit = 1", "overlap_limit = 0.3");
        scene = Scene::parse(&text, "test.toml").unwrap();
    }
    let mut start = Simulation::new(scene.clone()).unwrap();
    let points = &mut start.points;
    if material == "rve" {
        // A packing that is pressed together until its discs overlap too far.
        points.affine[point] = Mat2::identity() * -2.0e4;
    } else {
        points.velocity.fill(Vec2::new(3.0e3, 4.0e3));
    }
    let run = |device: Option<&Arc<Device>>| {
        let state = copy(directory.path(), &scene, &start.state());
        let mut simulation = Simulation::resume(scene.clone(), state).unwrap();
        if let Some(device) = device {
            simulation.move_to(device, None).unwrap();
        }
        words(&next_frame(&mut simulation).expect_err("it fails"))
    };
    let (gpu, cpu) = (run(Some(&device)), run(None));
    // Positions differ by round-off, and the GPU looks at overlaps after all substeps.
    let start = |text: &str| {
        text.split(" by ").next().unwrap_or_default().split('(').take(2).collect::<String>()
    };
    assert!(cpu.contains("point ") && cpu.contains("step "), "{cpu}");
    assert_eq!(start(&gpu), start(&cpu));
}

/// Without a GPU too: the kernel compiles for the GPUs it is meant for.
#[test]
fn the_kernel_compiles() {
    if !gpu::nvrtc_for_tests() {
        return;
    }
    for architecture in ["sm_80", "sm_90a"] {
        let cubin = compile("rve_material.cu", &cuda::source(), architecture, &cuda::defines());
        assert!(!cubin.unwrap().is_empty());
    }
}
