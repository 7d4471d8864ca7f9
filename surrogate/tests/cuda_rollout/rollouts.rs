//! Rollouts, frame by frame.

use burn::backend::Flex;
use dempm::scene::{Plate, Rectangle, Scene};
use rstest::rstest;
use surrogate::cuda::{BLOCK, Capacity, CudaNetwork, CudaRollout, Frames, Motion, Start};
use surrogate::diagnostics::CrowdingLimit;
use surrogate::features::{Obstacle, Window};
use surrogate::network::parameters::weights;
use surrogate::network::{Model, ModelConfig, Precision};
use surrogate::rollout::{Constraints, RolloutError};
use surrogate::simulator::{Simulator, Training};

use crate::fixtures::{FEATURES, normalisation_for, statics};
use crate::scene::{boxes_before, integrate, motion, scene, single, start};
use crate::stand_in::{StandIn, advance, stand_in_config};

/// Rolls a random network out on the device: each frame is what the simulator on the processor makes
/// of those before it.
fn roll_out(config: ModelConfig, precision: Precision, mirror: bool, blocks: usize) {
    let Some(device) = gpu::for_tests() else { return };
    // No box in the way: a rough one holds a point that touches it, and rounding decides which does. A
    // plate within sight moves away faster than the points.
    let place = Rectangle { corner: [0.5, 1.3], size: [1.5, 0.3] };
    let faces = scene().plate.unwrap().faces;
    let plate = Some(Plate { place, velocity: [0.2, 3.0], start: 0.05, faces });
    let scene = Scene { obstacles: Vec::new(), plate, ..scene() };
    // Falling to one side, which the image does to the other.
    let fall = [5e-4, -9.81e-4];
    let motion = Motion { constraints: Constraints::new(&scene), fall, mirror, ..motion() };
    let norm = normalisation_for(&config);
    let model = Model::<Flex>::new(&config, 5, &Default::default());
    let mut window = start(300, config.window(), 0.7);
    let statics = &statics(&config, 300)[..];
    let room = Capacity { points: 1, edges: 1 };
    let mut network = CudaNetwork::new(&device, &config, precision, room, false).unwrap();
    network.set_weights(&weights(&model)).unwrap();
    let start = Start { motion: motion.clone(), window: &window, statics, next: window.len() };
    let mut rollout = CudaRollout::new(&device, &config, &norm, vec![start], network).unwrap();
    let training = Training::untrained(motion.interval, true);
    let simulator = Simulator { mirror, ..Simulator::new(model, config, norm, training) };
    let mut network = simulator.inference();
    let mut obstacles = boxes_before(&motion, window.len());
    // Of the largest acceleration.
    let tolerance = if precision == Precision::F32 { 1e-4 } else { 0.2 };
    let mut frame = window.len();
    for _ in 0..blocks {
        let (frames, failure) = rollout.block().unwrap().remove(0);
        assert_eq!(failure, None);
        for found in frames {
            let positions = &single(&window);
            let (points, seen) = (window[0].len(), &obstacles);
            let seen = Window { positions, points, statics, obstacles: seen };
            let domain = motion.constraints.domain();
            let accelerations = simulator.accelerations(&mut network, &seen, domain, motion.fall);
            obstacles.iter_mut().for_each(Obstacle::advance);
            let largest = accelerations.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
            let expected = integrate(&window, &motion, frame, &accelerations);
            let pairs = found.as_flattened().iter().zip(expected.as_flattened());
            let most = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(most <= tolerance * largest, "frame {frame}: {most:e} of {largest:e} m");
            window.remove(0);
            window.push(found);
            frame += 1;
        }
    }
}

#[rstest]
fn networks_roll_out(
    #[values("baseline", "frame4-msg0-hidden1", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(Precision::F32, Precision::Bf16)] precision: Precision,
) {
    // More frames than it takes until everything comes from CUDA graphs: six and one.
    let config = ModelConfig { gns_layers: 3, ..ModelConfig::named(name).unwrap() };
    roll_out(config, precision, false, 3);
}

#[rstest]
fn mirror_images_and_further_features_roll_out(
    #[values("frame4-msg0-hidden1", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(false, true)] mirror: bool,
) {
    let config = ModelConfig::named(name).unwrap();
    // The kernels take 32 features of a node: with all of these, a GNS sees five frames.
    let frames = config.frames.min(5);
    let config = ModelConfig { frames, node_features: FEATURES.to_vec(), gns_layers: 3, ..config };
    roll_out(config, Precision::F32, mirror, 3);
}

/// Several blocks, most of them CUDA graphs: to the bit what the CPU makes of them. The points start
/// close together, so that the room for edges is too small and grows.
#[rstest]
fn rollouts_match(#[values(1, 200, 600)] points: usize, #[values(1.0, 0.2)] spread: f64) {
    let Some(device) = gpu::for_tests() else { return };
    let config = stand_in_config(4);
    let (scale, motion) = (0.05, motion());
    let mut window = start(points, config.frames, spread);
    let network = StandIn::new(&device, &config, points, scale);
    let norm = normalisation_for(&config);
    let past = Start { motion: motion.clone(), window: &window, statics: &[], next: window.len() };
    let mut rollout = CudaRollout::new(&device, &config, &norm, vec![past], network).unwrap();
    let mut frame = window.len();
    let mut obstacles = boxes_before(&motion, frame);
    for _ in 0..3 {
        let (frames, failure) = rollout.block().unwrap().remove(0);
        assert_eq!((frames.len(), failure), (BLOCK, None));
        for found in frames {
            let expected = advance(&window, &mut obstacles, &motion, frame, scale);
            assert_eq!(found, expected, "frame {frame}");
            window.remove(0);
            window.push(found);
            frame += 1;
        }
    }
}

/// A scene of a rollout of several, as the CPU makes it.
struct Twin {
    motion: Motion,
    window: Vec<Vec<[f64; 2]>>,
    obstacles: Vec<Obstacle>,
    frame: usize,
}

impl Twin {
    fn new(points: usize, spread: f64, motion: Motion) -> Self {
        let window = start(points, 4, spread);
        Self { obstacles: boxes_before(&motion, 4), window, frame: 4, motion }
    }

    /// Points that would all meet at one place so many frames later.
    fn meeting(points: usize, frames: f64, motion: Motion) -> Self {
        let mut twin = Self::new(points, 1.0, motion);
        let places = twin.window[3].clone();
        for (k, frame) in twin.window.iter_mut().enumerate() {
            for (x, place) in frame.iter_mut().zip(&places) {
                let towards = [2.0 - place[0], 1.6 - place[1]];
                *x = [0, 1].map(|axis| place[axis] + towards[axis] * (k as f64 - 3.0) / frames);
            }
        }
        twin
    }

    fn start(&self) -> Start<'_> {
        let (motion, window, next) = (self.motion.clone(), &self.window[..], self.frame);
        Start { motion, window, next, statics: &[] }
    }

    /// Checks a block to the bit.
    fn check(&mut self, (frames, failure): (Frames, Option<RolloutError>), scale: f32) {
        assert_eq!(failure, None);
        for found in frames {
            let expected =
                advance(&self.window, &mut self.obstacles, &self.motion, self.frame, scale);
            assert_eq!(found, expected, "frame {} of {} points", self.frame, found.len());
            self.window.remove(0);
            self.window.push(found);
            self.frame += 1;
        }
    }
}

/// Scenes of different points, boxes and falls, side by side: each is to the bit what the CPU makes of it alone, also
/// after another one is left out.
#[test]
fn scenes_side_by_side_match() {
    let Some(device) = gpu::for_tests() else { return };
    let (config, scale) = (stand_in_config(4), 0.05);
    let free = Scene { obstacles: Vec::new(), plate: None, ..scene() };
    let free = Motion { constraints: Constraints::new(&free), start: 0.3, ..motion() };
    let aside = Motion { fall: [2e-4, -5e-4], ..motion() };
    let mut twins = [
        Twin::new(200, 1.0, motion()),
        Twin::new(1, 1.0, motion()),
        // Close together: the room for edges grows.
        Twin::new(333, 0.2, free),
        Twin::new(64, 0.7, aside),
    ];
    let points = twins.iter().map(|twin| twin.window[0].len()).sum();
    let network = StandIn::new(&device, &config, points, scale);
    let norm = normalisation_for(&config);
    let starts = twins.iter().map(Twin::start).collect();
    let mut rollout = CudaRollout::new(&device, &config, &norm, starts, network).unwrap();
    for _ in 0..3 {
        let blocks = rollout.block().unwrap();
        assert_eq!(blocks.len(), twins.len());
        twins.iter_mut().zip(blocks).for_each(|(twin, block)| twin.check(block, scale));
    }
    assert!(twins.iter().all(|twin| twin.frame == 4 + 3 * BLOCK));
    let keep = [true, true, false, true];
    let mut rollout = rollout.keep(&keep).unwrap();
    for _ in 0..2 {
        let blocks = rollout.block().unwrap();
        assert_eq!(blocks.len(), 3);
        let kept = twins.iter_mut().zip(keep).filter(|(_, keep)| *keep);
        kept.zip(blocks).for_each(|((twin, _), block)| twin.check(block, scale));
    }
}

/// The room for edges becomes too small in the first, second or third block, which is computed again.
#[rstest]
fn room_grows_on_the_way(#[values(8.0, 12.0, 22.0)] frames: f64) {
    let Some(device) = gpu::for_tests() else { return };
    let (config, scale) = (stand_in_config(4), 0.05);
    let mut twins = [Twin::meeting(300, frames, motion()), Twin::new(40, 1.0, motion())];
    let network = StandIn::new(&device, &config, 340, scale);
    let norm = normalisation_for(&config);
    let starts = twins.iter().map(Twin::start).collect();
    let mut rollout = CudaRollout::new(&device, &config, &norm, starts, network).unwrap();
    for _ in 0..4 {
        let blocks = rollout.block().unwrap();
        twins.iter_mut().zip(blocks).for_each(|(twin, block)| twin.check(block, scale));
    }
    assert!(twins.iter().all(|twin| twin.frame == 4 + 4 * BLOCK));
}

/// A scene whose points are crowded fails alone, in the frame in which it does by itself, and so does one that leaves
/// its domain.
#[test]
fn scenes_fail_alone() {
    let Some(device) = gpu::for_tests() else { return };
    let (config, norm) = (stand_in_config(4), normalisation_for(&stand_in_config(4)));
    // Without a network points fly straight on: these meet in the middle, and those leave.
    let still = |fall| Motion { fall, packing: CrowdingLimit::new(0.25, 0.2), ..motion() };
    let meeting = Twin::meeting(150, 30.0, still([0.0; 2]));
    let twins =
        [Twin::new(100, 1.0, still([0.0; 2])), meeting, Twin::new(50, 1.0, still([0.02, 0.0]))];
    let alone = |twin: &Twin| failing(&twin.motion, &twin.window, 0.0).unwrap();
    let (met, left) = (alone(&twins[1]), alone(&twins[2]));
    assert!(matches!(met.1, RolloutError::Crowded { .. }), "{}", met.1);
    assert!(matches!(left.1, RolloutError::Left { .. }), "{}", left.1);

    let network = StandIn::new(&device, &config, 300, 0.0);
    let starts = twins.iter().map(Twin::start).collect();
    let mut rollout = CudaRollout::new(&device, &config, &norm, starts, network).unwrap();
    let mut found: Vec<(Frames, Option<RolloutError>)> = vec![(Vec::new(), None); 3];
    while found[1..].iter().any(|(_, failure)| failure.is_none()) {
        assert!(found[0].0.len() < 100, "no failure");
        let running = found.iter_mut().filter(|(_, failure)| failure.is_none());
        let mut keep = Vec::new();
        for ((frames, end), (more, failure)) in running.zip(rollout.block().unwrap()) {
            frames.extend(more);
            keep.push(failure.is_none());
            *end = failure;
        }
        if keep.contains(&false) {
            rollout = rollout.keep(&keep).unwrap();
        }
    }
    assert_eq!(found[0].1, None);
    assert_eq!(found[1], (met.0, Some(met.1)));
    assert_eq!(found[2], (left.0, Some(left.1)));
}

/// Points that meet have more edges than there is ever room for, so that no scene has any in that frame: what another
/// scene makes of it is not used.
#[test]
fn scenes_beside_a_crowd_keep_their_edges() {
    let Some(device) = gpu::for_tests() else { return };
    let (config, scale) = (stand_in_config(4), 0.05);
    let motion = || Motion { packing: CrowdingLimit::new(0.25, 0.1), ..motion() };
    let mut twin = Twin::new(200, 0.7, motion());
    let meeting = Twin::meeting(300, 4.0, motion());
    let network = StandIn::new(&device, &config, 500, scale);
    let norm = normalisation_for(&config);
    let starts = vec![twin.start(), meeting.start()];
    let mut rollout = CudaRollout::new(&device, &config, &norm, starts, network).unwrap();
    let mut blocks = rollout.block().unwrap();
    let (frames, failure) = blocks.remove(1);
    assert!(frames.len() < BLOCK && matches!(failure, Some(RolloutError::Crowded { .. })));
    assert_eq!(blocks[0].0.len(), frames.len());
    twin.check(blocks.remove(0), scale);
    let mut rollout = rollout.keep(&[true, false]).unwrap();
    for _ in 0..2 {
        twin.check(rollout.block().unwrap().remove(0), scale);
    }
    assert_eq!(twin.frame, 4 + frames.len() + 2 * BLOCK);
}

/// What a rollout gives before it fails, and why it does.
fn failing(
    motion: &Motion,
    window: &[Vec<[f64; 2]>],
    scale: f32,
) -> Option<(Frames, RolloutError)> {
    let device = gpu::for_tests()?;
    let config = stand_in_config(window.len());
    let network = StandIn::new(&device, &config, window[0].len(), scale);
    let norm = normalisation_for(&config);
    let past = Start { motion: motion.clone(), window, statics: &[], next: window.len() };
    let mut rollout = CudaRollout::new(&device, &config, &norm, vec![past], network).unwrap();
    let mut good = Vec::new();
    while good.len() < 100 {
        let (frames, failure) = rollout.block().unwrap().remove(0);
        good.extend(frames);
        if let Some(failure) = failure {
            return Some((good, failure));
        }
    }
    panic!("no failure in 100 frames");
}

#[test]
fn failures_name_frame_and_point() {
    let mut window = start(50, 4, 1.0);
    let Some((good, failure)) = failing(&motion(), &window, f32::INFINITY) else { return };
    assert!(good.is_empty());
    assert_eq!(failure, RolloutError::NotFinite { frame: 4, point: 0 });

    // Free fall along x, in which this point reaches the wall with 0.35 m/frame in frame 26.
    for frame in &mut window {
        frame[7] = [0.12, 1.9];
    }
    let motion = Motion { fall: [0.015, 0.0], ..motion() };
    let Some((good, failure)) = failing(&motion, &window, 0.0) else { return };
    let mut frame = window.len();
    let mut obstacles = boxes_before(&motion, frame);
    for found in good {
        assert_eq!(found, advance(&window, &mut obstacles, &motion, frame, 0.0));
        window.remove(0);
        window.push(found);
        frame += 1;
    }
    let RolloutError::Left { frame: failed, point, distance } = failure else {
        panic!("{failure}")
    };
    assert_eq!(failed, frame);
    let (before, last) = (window[window.len() - 2][point], window[window.len() - 1][point]);
    let beyond = last[0] + (last[0] - before[0] + (1e-4 + 0.015)) - 4.0;
    assert!(beyond > 0.25 && (beyond - distance).abs() < 1e-12, "{beyond} {distance}");
}
