//! Features of frames and batches, to the bit.

use burn::backend::Flex;
use cudarc::driver::CudaSlice;
use gpu::Device;
use surrogate::cuda::{BatchBuilder, FrameBuilder, FrameInput, HostWindows, NewFrame};
use surrogate::data::Batch;
use surrogate::features::{Normalisation, Window, window_input};
use surrogate::network::{DIMENSIONS, ModelConfig};

use crate::fixtures::{normalisation_for, obstacles, random, readers, rows, statics};

/// Positions of frames of a cloud that drifts.
fn drifting(points: usize, frames: usize, seed: u64) -> Vec<f32> {
    let start = random(points, DIMENSIONS, 1.0, seed);
    let drift = random(points, DIMENSIONS, 0.02, seed + 100);
    (0..frames)
        .flat_map(|k| start.iter().zip(&drift).map(move |(x, v)| x + k as f32 * (v - 0.01)))
        .collect()
}

/// Compares features to the bit.
fn check_frames(
    device: &Device,
    frames: &[FrameInput],
    windows: &[Window],
    config: &ModelConfig,
    norm: &Normalisation,
    bounds: &[[f64; 2]],
) {
    let expected = window_input::<Flex>(windows, config, norm, bounds, &Default::default());
    assert_eq!(frames.len(), expected.frames.len());
    for (found, expected) in frames.iter().zip(&expected.frames) {
        let mut node = device.stream().clone_dtoh(&found.node).unwrap();
        let mut edge = device.stream().clone_dtoh(&found.edge).unwrap();
        let (nodes, edges) = (rows(&expected.nodes), rows(&expected.edges));
        node.truncate(nodes.len());
        edge.truncate(edges.len());
        assert_eq!(node, nodes);
        assert_eq!(edge, edges);
    }
}

#[test]
fn features_match() {
    // As many as the longest window.
    const FRAMES: usize = 5;
    let Some(device) = gpu::for_tests() else { return };
    let bounds = vec![[0.0, 1.0]; DIMENSIONS];
    let sizes = [150, 300];
    let windows: Vec<Vec<f32>> = sizes
        .iter()
        .enumerate()
        .map(|(k, &n)| {
            let mut window = drifting(n, FRAMES, k as u64);
            // Two points at one place in all frames.
            for frame in window.chunks_exact_mut(n * DIMENSIONS) {
                frame.copy_within(0..DIMENSIONS, DIMENSIONS);
            }
            window
        })
        .collect();
    let at = |k: usize| -> CudaSlice<f32> {
        let parts = windows
            .iter()
            .zip(sizes)
            .map(|(window, n)| &window[k * n * DIMENSIONS..(k + 1) * n * DIMENSIONS]);
        device.upload(&parts.collect::<Vec<_>>().concat()).unwrap()
    };
    let positions: Vec<_> = (0..FRAMES).map(at).collect();
    for config in readers() {
        let norm = normalisation_for(&config);
        let mut builder = FrameBuilder::new(&device, &config, &norm, &bounds, &sizes, 1).unwrap();
        let statics = sizes.map(|points| statics(&config, points));
        builder.set_statics(&statics.concat()).unwrap();
        let obstacles = [Vec::new(), obstacles(&config)];
        builder.set_obstacles(&obstacles).unwrap();
        let oldest = FRAMES - config.window();
        let frames: Vec<FrameInput> = (FRAMES - config.graphs()..FRAMES)
            .map(|k| {
                let mut frame = builder.allocate(450 * 449).unwrap();
                // A GNS knows all frames, a TGNNS the one before, if there is one.
                let known = if config.graphs() == 1 { 3 } else { (k + 4 - FRAMES).min(2) };
                let past: Vec<_> = positions[oldest..=k].iter().map(|x| x.as_view()).collect();
                let back = FRAMES - 1 - k;
                let mut new = [NewFrame { past: &past, known, back, frame: &mut frame }];
                builder.graphs(&mut new).unwrap();
                builder.features(&mut new).unwrap();
                frame
            })
            .collect();
        let windows: Vec<Window> = windows
            .iter()
            .zip(sizes)
            .zip(&statics)
            .zip(&obstacles)
            .map(|(((positions, points), statics), obstacles)| {
                let positions = &positions[oldest * points * DIMENSIONS..];
                Window { positions, points, statics, obstacles }
            })
            .collect();
        check_frames(&device, &frames, &windows, &config, &norm, &bounds);
    }
}

#[test]
fn batches_match() {
    let Some(device) = gpu::for_tests() else { return };
    let bounds = [[0.0, 1.0]; 2];
    // Of the last one more frames than are made in one launch.
    let long = ModelConfig { frames: 9, ..ModelConfig::default() };
    for config in readers().into_iter().chain([long]) {
        let norm = normalisation_for(&config);
        let mut builder = BatchBuilder::new(&device, &config, &norm, &bounds).unwrap();
        // More edges than there is room for at first, smaller and larger ones, each place twice.
        for sizes in [[200, 350], [40, 30], [350, 200], [7, 400], [200, 350]] {
            let batch = Batch {
                windows: (0..2).map(|k| drifting(sizes[k], config.window(), k as u64)).collect(),
                points: sizes.to_vec(),
                statics: sizes.iter().map(|&points| statics(&config, points)).collect(),
                obstacles: vec![obstacles(&config), Vec::new()],
                targets: random(sizes.iter().sum(), DIMENSIONS, 1.0, 8),
            };
            let host = HostWindows::new(batch.clone(), None);
            let made = builder.make(&host, |_, _| panic!("nothing is moved on")).unwrap();
            assert_eq!(made.values, batch.targets.len());
            let targets = device.stream().clone_dtoh(&made.targets).unwrap();
            assert_eq!(targets[..made.values], batch.targets);
            let windows: Vec<Window> = (0..2)
                .map(|k| Window {
                    positions: &batch.windows[k],
                    points: sizes[k],
                    statics: &batch.statics[k],
                    obstacles: &batch.obstacles[k],
                })
                .collect();
            check_frames(&device, &made.frames, &windows, &config, &norm, &bounds);
        }
    }
}
