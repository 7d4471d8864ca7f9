//! The networks on a GPU against their Burn twins, which tests/model.rs checks.
//!
//! Without a GPU these tests say so and pass, unless `DEMPM_REQUIRE_GPU=1`.

use burn::tensor::{Tensor, TensorData};
use gpu::{Device, compile};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstest::rstest;
use surrogate::cuda::{
    Capacity, CudaError, CudaNetwork, CudaTrainer, FrameInput, HostInput, Rates, Targets,
    network_sources, upload,
};
use surrogate::features::{
    Normalisation, Obstacle, Window, WindowInput, host_frames, window_input,
};
use surrogate::network::Model;
use surrogate::network::burn_backend::{CpuAutodiff, device};
use surrogate::network::parameters::{gradients, weights, with_weights};
use surrogate::network::{ModelConfig, NodeFeature, PAPER_NETWORKS, Precision, feature_columns};

/// Sizes of a test.
#[derive(Clone, Debug)]
struct Case {
    config: ModelConfig,
    /// Points of each window.
    windows: Vec<usize>,
    /// Of the points' places and motion.
    seed: u64,
}

impl Case {
    fn new(name: &str, windows: &[usize]) -> Self {
        let config = ModelConfig::named(name).unwrap();
        let config = ModelConfig { gns_layers: 3, ..config };
        Self { config, windows: windows.to_vec(), seed: 3 }
    }

    fn points(&self) -> usize {
        self.windows.iter().sum()
    }

    /// Clusters and a few points apart, moving, so that degrees differ and edges come and go.
    fn positions(&self, frames: usize) -> Vec<Vec<f32>> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let d = self.config.dimensions;
        let window = |&points: &usize| {
            let start: Vec<f32> = (0..points * d)
                .map(|k| match k / d % 5 {
                    0 => rng.random_range(0.0..6.0),
                    1 => rng.random_range(1.0..1.2),
                    _ => rng.random_range(2.0..2.8),
                })
                .collect();
            let drift: Vec<f32> = start.iter().map(|_| rng.random_range(-0.02..0.02)).collect();
            let at = |k: usize| start.iter().zip(&drift).map(move |(x, v)| x + k as f32 * v);
            (0..frames).flat_map(at).collect()
        };
        self.windows.iter().map(window).collect()
    }

    fn normalisation(&self) -> Normalisation {
        let d = self.config.dimensions;
        Normalisation {
            velocity_mean: vec![0.001; d],
            velocity_std: vec![0.01; d],
            acceleration_mean: vec![0.0; d],
            acceleration_std: vec![1.0; d],
            features_mean: vec![0.1; self.config.further_node_features()],
            features_std: vec![0.5; self.config.further_node_features()],
        }
    }

    /// The input for both twins.
    fn input(&self) -> (WindowInput<CpuAutodiff>, Vec<HostInput>) {
        let positions = self.positions(self.config.window());
        let [_, columns] = feature_columns(&self.config.node_features, self.config.dimensions);
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut random = |&points: &usize| -> Vec<f32> {
            (0..points * columns).map(|_| rng.random_range(-1.0..1.0)).collect()
        };
        let statics: Vec<_> = self.windows.iter().map(&mut random).collect();
        // In the midst of the points.
        let fixed = Obstacle { friction: [0.5; 4], ..Obstacle::fixed([[2.3, 2.3], [2.5, 2.5]]) };
        let plate = Obstacle { velocity: [0.02, -0.03], elapsed: 9.0, ..fixed };
        let obstacles = &[fixed, plate];
        let windows: Vec<Window> = positions
            .iter()
            .zip(&self.windows)
            .zip(&statics)
            .map(|((positions, &points), statics)| Window { positions, points, statics, obstacles })
            .collect();
        let bounds = vec![[0.0, 6.0]; self.config.dimensions];
        let norm = self.normalisation();
        let frames = host_frames(&windows, &self.config, &norm, &bounds);
        let input = window_input(&windows, &self.config, &norm, &bounds, &device());
        (input, frames.into_iter().map(HostInput::from).collect())
    }

    /// A network all of whose weights are random, those of LayerNorm and biases too.
    fn model(&self) -> Model<CpuAutodiff> {
        let model = Model::new(&self.config, 5, &device());
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let list: Vec<f32> =
            weights(&model).iter().map(|w| w + rng.random_range(-0.05..0.05)).collect();
        with_weights(model, &list)
    }

    fn target(&self) -> Vec<f32> {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        (0..self.points() * self.config.dimensions).map(|_| rng.random_range(-1.0..1.0)).collect()
    }
}

fn capacity(frames: &[HostInput]) -> Capacity {
    Capacity {
        points: frames.iter().map(|f| f.points).max().unwrap(),
        // More than needed, as in use.
        edges: frames.iter().map(|f| f.sender.len()).max().unwrap() + 37,
    }
}

fn uploaded(device: &std::sync::Arc<Device>, frames: &[HostInput]) -> Vec<FrameInput> {
    let room = capacity(frames).edges;
    frames.iter().map(|frame| upload(device, frame, room).unwrap()).collect()
}

fn norm(list: &[f32]) -> f64 {
    list.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt()
}

fn distance(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let difference: Vec<f32> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    norm(&difference)
}

fn list<const D: usize>(tensor: Tensor<CpuAutodiff, D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

/// Output, loss and gradient in Burn.
fn reference(
    case: &Case,
    input: &WindowInput<CpuAutodiff>,
    model: &Model<CpuAutodiff>,
) -> (Vec<f32>, f32, Vec<f32>) {
    let shape = [case.points(), case.config.dimensions];
    let target =
        Tensor::<CpuAutodiff, 2>::from_data(TensorData::new(case.target(), shape), &device());
    let output = model.forward(input);
    let scale = target.clone().powi_scalar(2).sum().clamp_min(1e-12);
    let loss = (output.clone() - target).powi_scalar(2).sum() / scale;
    let gradient = gradients(model, &loss.backward());
    (list(output), loss.into_scalar(), gradient)
}

/// Errors of values and of the gradient relative to their norms, from rounding: 2^-22 in sums of two
/// f16, 2^-9 in bf16, in each of up to 60 linears in a row. In bf16 rounding changes the sign of one
/// argument of LeakyReLU in some hundred, and with it the gradient.
fn tolerance(precision: Precision) -> [f64; 2] {
    match precision {
        Precision::F32 => [5e-6, 1e-5],
        Precision::Bf16 => [2e-2, 0.15],
    }
}

/// How far the gradient moves when rounding changes the sign of arguments of LeakyReLU: the most of
/// several networks whose weights are off by up to 2e-6 of themselves, which moves outputs by as much
/// as rounding may. Without such arguments the gradient moves no more than the outputs.
fn kinks(case: &Case) -> f64 {
    let (input, _) = case.input();
    let (.., gradient) = reference(case, &input, &case.model());
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut moved = || {
        let mut list = weights(&case.model());
        list.iter_mut().for_each(|w| *w *= 1.0 + rng.random_range(-2e-6..2e-6));
        let model = with_weights(case.model(), &list);
        distance(&reference(case, &input, &model).2, &gradient) / norm(&gradient).max(1e-30)
    };
    (0..4).map(|_| moved()).fold(0.0, f64::max)
}

/// Twice what kinks may do is added to the tolerance of the gradient in f32; that of bf16 has room for
/// them.
fn compare(case: &Case, precision: Precision) {
    if gpu::for_tests().is_none() {
        return;
    }
    let kinked = precision == Precision::F32 && case.config.leaky_slope != 1.0;
    compare_within(case, precision, if kinked { 2.0 * kinks(case) } else { 0.0 });
}

/// Compares output, loss and gradient; `kinks` is added to the tolerance of the gradient.
fn compare_within(case: &Case, precision: Precision, kinks: f64) {
    let Some(device) = gpu::for_tests() else { return };
    let (input, frames) = case.input();
    let (output, loss, gradient) = reference(case, &input, &case.model());
    let room = capacity(&frames);
    let frames = uploaded(&device, &frames);
    let weights = weights(&case.model());

    let mut trainer =
        CudaTrainer::new(&device, &case.config, precision, room, false, None).unwrap();
    let zeros = vec![0.0; weights.len()];
    trainer.restore(&weights, [&zeros, &zeros], None).unwrap();
    let target = device.upload(&case.target()).unwrap();
    let (found_loss, found) = trainer.gradient(&frames, Targets::of_all(&target, &frames)).unwrap();
    let found_output = {
        let mut network = CudaNetwork::new(&device, &case.config, precision, room, false).unwrap();
        network.set_weights(&weights).unwrap();
        let output = network.forward(&frames).unwrap();
        device.stream().clone_dtoh(output).unwrap()
    };
    let [most, mut most_gradient] = tolerance(precision);
    most_gradient += kinks;
    let count = output.len();
    let relative =
        |found: &[f32], expected: &[f32]| distance(found, expected) / norm(expected).max(1e-30);
    let errors = [
        relative(&found_output[..count], &output),
        relative(&[found_loss], &[loss]),
        relative(&found, &gradient),
    ];
    let name = (case.config.kind, case.config.frames, case.config.message_layers);
    println!(
        "{name:?} {precision:?} slope {} hidden {} edgemsg {} {}D {:?} points: output {:.1e} \
         loss {:.1e} gradient {:.1e} of {most_gradient:.1e}",
        case.config.leaky_slope,
        case.config.hidden_layers,
        case.config.edge_message,
        case.config.dimensions,
        case.windows,
        errors[0],
        errors[1],
        errors[2]
    );
    assert!(errors[0] <= most && errors[1] <= most && errors[2] <= most_gradient, "{errors:?}");
    // Parts by themselves: a wrong small one must not hide behind large ones.
    const PART: usize = 997;
    let typical = norm(&gradient) * (PART as f64 / gradient.len() as f64).sqrt();
    for (k, (found, expected)) in found.chunks(PART).zip(gradient.chunks(PART)).enumerate() {
        let error = distance(found, expected) / norm(expected).max(0.1 * typical);
        assert!(error <= 10.0 * most_gradient, "weights from {}: {error:e}", PART * k);
    }
}

#[rstest]
fn paper_networks(#[values(Precision::F32, Precision::Bf16)] precision: Precision) {
    for name in PAPER_NETWORKS {
        compare(&Case::new(name, &[70, 33]), precision);
    }
}

/// Without the kinks of LeakyReLU the gradient is as precise as the values.
#[test]
fn without_kinks() {
    for name in ["baseline", "frame4-msg1-hidden1-edgemsg"] {
        let mut case = Case::new(name, &[70, 33]);
        case.config.leaky_slope = 1.0;
        compare(&case, Precision::F32);
    }
}

/// Nor do kinks matter where rounding changes the sign of no argument. In a graph of so few points a
/// million arguments are not so near to 0, but for some: the first of the graphs is taken in which the
/// gradient of the Burn model moves no more with its weights than without kinks.
#[test]
fn far_from_kinks() {
    if gpu::for_tests().is_none() {
        return;
    }
    for name in PAPER_NETWORKS {
        let graphs = (0..20).map(|seed| Case { seed, ..Case::new(name, &[20]) });
        let case = graphs.into_iter().find(|case| kinks(case) < 1.5e-5).expect("a graph");
        compare_within(&case, Precision::F32, 0.0);
    }
}

#[rstest]
fn the_gns(#[values(Precision::F32, Precision::Bf16)] precision: Precision) {
    compare(&Case::new("gns", &[50, 20]), precision);
}

#[rstest]
fn residual_layers(#[values(Precision::F32, Precision::Bf16)] precision: Precision) {
    for name in ["msg0", "frame4-msg1-hidden1-edgemsg"] {
        let mut case = Case::new(name, &[50, 20]);
        case.config.residual_layers = 3;
        compare(&case, precision);
    }
}

/// All further features at once: more columns than one product takes.
#[rstest]
fn many_features(
    #[values("frame4", "gns")] name: &str,
    #[values(Precision::F32, Precision::Bf16)] precision: Precision,
) {
    let mut case = Case::new(name, &[60, 33]);
    case.config.frames = 4;
    case.config.node_features = vec![
        NodeFeature::Acceleration,
        NodeFeature::Surfaces,
        NodeFeature::Material,
        NodeFeature::Overburden,
        NodeFeature::InitialStress,
    ];
    assert!(case.config.first_node_features() > 16);
    compare(&case, precision);
}

/// One point, no edges, many edges, other widths and depths, ReLU-like slopes.
#[test]
fn unusual_sizes() {
    let base = Case::new("frame4-msg1", &[1]);
    compare(&base, Precision::F32);
    compare(&Case { windows: vec![1, 1, 1], ..base.clone() }, Precision::F32);
    for (width, hidden_layers, slope, windows) in
        [(32, 1, 0.1, vec![40, 3]), (8, 3, 0.0, vec![17]), (100, 4, 0.3, vec![50])]
    {
        let config = ModelConfig {
            width,
            hidden_layers,
            leaky_slope: slope,
            message_layers: 1,
            frames: 3,
            ..base.config.clone()
        };
        compare(&Case { config, windows, ..base.clone() }, Precision::F32);
    }
    let mut dense = Case { windows: vec![150], ..base };
    dense.config.connection_radius = 0.6;
    compare(&dense, Precision::F32);
}

/// Frame after frame the network gives what it gives for each window by itself, to the bit.
#[rstest]
#[case("baseline")]
#[case("frame4-msg1-hidden1-edgemsg")]
#[case("gns")]
fn frame_after_frame(#[case] name: &str, #[values(0, 2)] residual_layers: usize) {
    let Some(device) = gpu::for_tests() else { return };
    let mut case = Case::new(name, &[60]);
    case.config.residual_layers = residual_layers;
    let frames = case.config.frames;
    let positions = &case.positions(frames + 3)[0];
    let stride = 60 * case.config.dimensions;
    let bounds = vec![[0.0, 6.0]; case.config.dimensions];
    let room = Capacity { points: 60, edges: 60 * 60 };
    let input = |window: &[f32]| -> Vec<HostInput> {
        let windows = [Window { positions: window, points: 60, statics: &[], obstacles: &[] }];
        let host = host_frames(&windows, &case.config, &case.normalisation(), &bounds);
        host.into_iter().map(HostInput::from).collect()
    };
    // Frames with features of later ones: the last of a window that ends with them.
    let later = |end: usize| {
        let mut window = positions[..(end + 1) * stride].to_vec();
        while window.len() < frames * stride {
            window.splice(0..0, window[..stride].to_vec());
        }
        let window = input(&window[window.len() - frames * stride..]);
        upload(&device, window.last().unwrap(), room.edges).unwrap()
    };
    let all: Vec<FrameInput> = (0..frames + 3).map(later).collect();
    let mut network =
        CudaNetwork::new(&device, &case.config, Precision::Bf16, room, false).unwrap();
    network.set_weights(&weights(&case.model())).unwrap();
    let rolling: Vec<Vec<f32>> = (0..all.len())
        .map(|k| {
            let output = network.advance(&all[k], &all[k.saturating_sub(1)]).unwrap();
            device.stream().clone_dtoh(output).unwrap()
        })
        .collect();
    for (end, found) in rolling.iter().enumerate().skip(frames - 1) {
        let window = input(&positions[(end + 1 - frames) * stride..(end + 1) * stride]);
        let window: Vec<FrameInput> =
            window.iter().map(|frame| upload(&device, frame, room.edges).unwrap()).collect();
        let expected = network.forward(&window).unwrap();
        assert_eq!(found, &device.stream().clone_dtoh(expected).unwrap());
        assert!(found.iter().all(|a| a.is_finite()) && found.iter().any(|a| *a != 0.0));
    }
}

/// Adam and the average of the weights move as on the CPU, also when the batch changes its size,
/// and twice in the same way to the bit.
#[rstest]
fn steps(#[values(Precision::F32, Precision::Bf16)] precision: Precision) {
    let Some(device) = gpu::for_tests() else { return };
    let case = Case::new("frame4-msg0-hidden1", &[40, 20]);
    let start = weights(&case.model());
    let (_, frames) = case.input();
    let room = capacity(&frames);
    let frames = uploaded(&device, &frames);
    let target = device.upload(&case.target()).unwrap();
    let small = Case { windows: vec![9], ..case.clone() };
    let (_, small_frames) = small.input();
    let small_frames = uploaded(&device, &small_frames);
    let small_target = device.upload(&small.target()).unwrap();
    let run = || {
        let mut trainer =
            CudaTrainer::new(&device, &case.config, precision, room, true, None).unwrap();
        let zeros = vec![0.0; start.len()];
        trainer.restore(&start, [&zeros, &zeros], Some(&start)).unwrap();
        let mut expected = start.clone();
        let mut average = start.clone();
        let (mut mean, mut square) = (zeros.clone(), zeros);
        let mut losses = Vec::new();
        for n in 1..=4 {
            let (frames, target) =
                if n == 3 { (&small_frames, &small_target) } else { (&frames, &target) };
            let targets = Targets::of_all(target, frames);
            let (loss, gradient) = trainer.gradient(frames, targets).unwrap();
            losses.push(loss);
            let correction = |beta: f64| (1.0 - beta.powi(n)) as f32;
            let corrections = [correction(0.9), correction(0.999)];
            let rates = Rates { rate: 1e-3, corrections, decay: 0.8 };
            trainer.step(frames, targets, rates).unwrap();
            let moments = mean.iter_mut().zip(&mut square);
            for ((w, g), (m, s)) in expected.iter_mut().zip(&gradient).zip(moments) {
                *m = 0.9 * *m + 0.1 * g;
                *s = 0.999 * *s + 0.001 * g * g;
                *w -= 1e-3 * (*m / corrections[0]) / ((*s / corrections[1]).sqrt() + 1e-8);
            }
            for (a, w) in average.iter_mut().zip(&expected) {
                *a = 0.8 * *a + 0.2 * w;
            }
        }
        let [weights, .., found_average] = trainer.download().unwrap();
        // A weight moves by 1e-3 a step at most.
        let error =
            |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(error(&weights, &expected) < 2e-5, "{}", error(&weights, &expected));
        assert!(error(&found_average, &average) < 2e-5);
        assert!(error(&weights, &start) > 2e-3);
        assert_eq!(trainer.losses(4).unwrap(), losses);
        (weights, losses)
    };
    let (weights, losses) = run();
    assert!(losses[3] < losses[0]);
    assert_eq!(run(), (weights, losses));
}

#[test]
fn what_does_not_fit_is_refused() {
    let Some(device) = gpu::for_tests() else { return };
    let case = Case::new("frame4-msg0-hidden1", &[20]);
    let room = Capacity { points: 19, edges: 20 };
    let wide = ModelConfig { width: 129, ..case.config.clone() };
    let error = CudaNetwork::new(&device, &wide, Precision::F32, room, false).unwrap_err();
    assert!(matches!(error, CudaError::Unsupported { key: "width", .. }), "{error}");
    let mut network = CudaNetwork::new(&device, &case.config, Precision::F32, room, false).unwrap();
    let (_, frames) = case.input();
    let error = network.forward(&uploaded(&device, &frames)).unwrap_err();
    assert!(matches!(error, CudaError::Capacity { .. }), "{error}");
    assert!(upload(&device, &frames[0], 0).is_err());
    assert!(network.set_weights(&[0.0]).is_err());
}

/// Needs NVRTC, but no GPU.
#[rstest]
#[case::without_products_of_warp_groups("sm_80")]
#[case::with_them("sm_90a")]
fn kernels_compile(#[case] architecture: &str) {
    if !gpu::nvrtc_for_tests() {
        return;
    }
    for precision in [Precision::F32, Precision::Bf16] {
        for source in network_sources(precision, 227 << 10) {
            compile(source.name, &source.text, architecture, &source.defines).unwrap();
        }
    }
}
