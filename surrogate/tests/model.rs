//! The networks, their inputs and their files.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use burn::backend::{Autodiff, Flex};
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{DType, Tensor, TensorData};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstest::rstest;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use surrogate::config::{ModelConfig, ModelKind, PAPER_NETWORKS};
use surrogate::features::{Normalisation, Window, WindowInput, window_input};
use surrogate::graph::{RadiusGraph, radius_graph};
use surrogate::model::Model;
use surrogate::weights::{self, WeightsError};

type Cpu = Flex;
type Train = Autodiff<Flex>;

/// Positions of a random cloud that shears and shrinks, so that some edges come and others go.
/// Multiples of 2^-14 in the unit box, so that shifts by whole numbers are exact.
fn cloud(points: usize, dimensions: usize, frames: usize, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let start: Vec<f32> = (0..points * dimensions).map(|_| rng.random_range(0.02..0.98)).collect();
    let drift: Vec<f32> = start.iter().map(|_| rng.random_range(-0.01..0.01)).collect();
    let mut positions = Vec::new();
    for frame in 0..frames {
        positions.extend(start.iter().zip(&drift).map(|(x, v)| {
            let x = x + frame as f32 * (v + 0.01 * (0.5 - x));
            (x * 16384.0).round() / 16384.0
        }));
    }
    positions
}

fn unit_box(dimensions: usize) -> Vec<[f64; 2]> {
    vec![[0.0, 1.0]; dimensions]
}

fn normalisation(dimensions: usize) -> Normalisation {
    Normalisation {
        velocity_mean: (0..dimensions).map(|k| 0.001 * k as f64).collect(),
        velocity_std: vec![0.01; dimensions],
        acceleration_mean: vec![1.0 / 3.0; dimensions],
        acceleration_std: vec![0.1; dimensions],
    }
}

/// A small relative of a named network.
fn small(name: &str, dimensions: usize) -> ModelConfig {
    let config = ModelConfig::named(name).unwrap();
    ModelConfig { dimensions, width: 8, gns_layers: 2, frames: 3, ..config }
}

fn input<B: Backend>(config: &ModelConfig, windows: &[(&[f32], usize)]) -> WindowInput<B> {
    let windows: Vec<Window> =
        windows.iter().map(|&(positions, points)| Window { positions, points }).collect();
    let d = config.dimensions;
    window_input(&windows, config, &normalisation(d), &unit_box(d), &Default::default())
}

fn model<B: Backend>(config: &ModelConfig) -> Model<B> {
    Model::new(config, 7, &Default::default())
}

fn values<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f64> {
    tensor.into_data().iter::<f64>().collect()
}

fn close(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    let error = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(error <= tolerance, "differs by {error}");
}

/// A scalar that depends on every output: sum of c_i a_i with c_i = 1, 2, 3, ...
fn weighted_sum<B: Backend>(output: Tensor<B, 2>) -> Tensor<B, 1> {
    let [points, dimensions] = output.dims();
    let weights: Vec<f32> = (1..=points * dimensions).map(|i| i as f32 / 10.0).collect();
    let data = TensorData::new(weights, [points, dimensions]);
    let weights = Tensor::from_data(data, (&output.device(), output.dtype()));
    (output * weights).sum()
}

// ---- sizes ---------------------------------------------------------------------------------

#[rstest]
#[case("baseline", 1_425_282)]
#[case("hidden1", 1_062_018)]
#[case("msg1", 1_276_546)]
#[case("msg0", 1_127_810)]
#[case("msg0-hidden1", 830_594)]
#[case("frame4", 1_127_810)]
#[case("frame4-msg0-hidden1", 599_170)]
#[case("frame4-msg1", 979_074)]
#[case("frame4-hidden1", 830_594)]
#[case("frame4-msg1-hidden1-edgemsg", 748_802)]
fn parameter_counts_are_those_of_table_6(#[case] name: &str, #[case] count: usize) {
    assert!(PAPER_NETWORKS.contains(&name));
    let config = ModelConfig::named(name).unwrap();
    assert_eq!(config.parameter_count(), count);
    assert_eq!(model::<Cpu>(&config).num_params(), count);
}

#[rstest]
fn the_count_holds_in_3d_and_for_the_gns(#[values("baseline", "gns")] name: &str) {
    for dimensions in [2, 3] {
        let config = ModelConfig { dimensions, ..ModelConfig::named(name).unwrap() };
        assert_eq!(model::<Cpu>(&config).num_params(), config.parameter_count());
    }
}

#[test]
fn invalid_configurations_are_refused() {
    let default = ModelConfig::default;
    assert_eq!(default().validate(), Ok(()));
    assert!(ModelConfig::named("no such network").is_none());
    for wrong in [
        ModelConfig { dimensions: 1, ..default() },
        ModelConfig { width: usize::MAX, ..default() },
        ModelConfig { hidden_layers: 0, ..default() },
        ModelConfig { frames: 1, ..default() },
        ModelConfig { gns_layers: 0, ..default() },
        ModelConfig { leaky_slope: f64::NAN, ..default() },
        ModelConfig { connection_radius: 0.0, ..default() },
    ] {
        wrong.validate().unwrap_err();
    }
}

#[test]
fn weights_depend_on_the_seed_alone() {
    let config = small("baseline", 2);
    let positions = cloud(20, 2, 3, 1);
    let run = |seed| {
        let model = Model::<Cpu>::new(&config, seed, &Default::default());
        values(model.forward(&input(&config, &[(&positions, 20)])))
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

// ---- gradients -----------------------------------------------------------------------------

/// Smallest share of non-zero entries among the gradients of all parameters.
struct NonZero<'a> {
    gradients: &'a <Train as AutodiffBackend>::Gradients,
    tensors: usize,
    share: f64,
}

impl ModuleVisitor<Train> for NonZero<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<Train, D>>) {
        let gradient = values(param.val().grad(self.gradients).expect("a gradient"));
        assert!(gradient.iter().all(|g| g.is_finite()));
        let non_zero = gradient.iter().filter(|&&g| g != 0.0).count();
        self.tensors += 1;
        self.share = self.share.min(non_zero as f64 / gradient.len() as f64);
    }
}

#[rstest]
#[case("baseline", 2, 1.0)]
#[case("baseline", 3, 1.0)]
#[case("msg0-hidden1", 2, 1.0)]
#[case("frame4-msg1-hidden1-edgemsg", 2, 1.0)]
#[case("frame4-msg1-hidden1-edgemsg", 3, 1.0)]
#[case("gns", 2, 0.1)] // ReLU: some units rest
#[case("gns", 3, 0.1)]
fn every_parameter_learns(#[case] name: &str, #[case] dimensions: usize, #[case] share: f64) {
    let config = small(name, dimensions);
    let positions = cloud(60, dimensions, 3, 2);
    let model = model::<Train>(&config);
    let output = model.forward(&input(&config, &[(&positions, 60)]));
    assert_eq!(output.dims(), [60, dimensions]);
    let gradients = weighted_sum(output).backward();
    let mut visitor = NonZero { gradients: &gradients, tensors: 0, share: 1.0 };
    model.visit(&mut visitor);
    assert!(visitor.tensors > 20 && visitor.share >= share, "share {}", visitor.share);
}

/// A tensor of float64 in the shape of another.
fn float64<B: Backend, const D: usize>(values: Vec<f64>, like: &Tensor<B, D>) -> Tensor<B, D> {
    Tensor::from_data(TensorData::new(values, like.dims()), (&like.device(), DType::F64))
}

struct ToFloat64;

impl<B: Backend> ModuleMapper<B> for ToFloat64 {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        param.map(|tensor| float64(values(tensor.clone()), &tensor).require_grad())
    }
}

/// Adds `step` to the parameters along a fixed direction, of tensor number `only`.
struct Nudge {
    only: usize,
    step: f64,
    tensor: usize,
}

/// The direction of a [`Nudge`]: neither 0 nor along any symmetry.
fn direction(length: usize) -> Vec<f64> {
    (0..length).map(|i| (1.0 + i as f64).sin()).collect()
}

impl<B: Backend> ModuleMapper<B> for Nudge {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        self.tensor += 1;
        if self.tensor != self.only + 1 {
            return param;
        }
        param.map(|tensor| {
            let before = values(tensor.clone());
            let along = direction(before.len());
            let after = before.iter().zip(along).map(|(x, d)| x + self.step * d).collect();
            float64(after, &tensor)
        })
    }
}

/// Derivative of the loss along [`direction`], for each parameter tensor.
struct Along<'a> {
    gradients: &'a <Train as AutodiffBackend>::Gradients,
    slopes: Vec<f64>,
}

impl ModuleVisitor<Train> for Along<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<Train, D>>) {
        let gradient = values(param.val().grad(self.gradients).expect("a gradient"));
        let along = direction(gradient.len());
        self.slopes.push(gradient.iter().zip(along).map(|(g, d)| g * d).sum());
    }
}

#[rstest]
fn gradients_are_finite_differences(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
) {
    let config = small(name, 2);
    let positions = cloud(25, 2, 3, 3);
    let mut input = input::<Train>(&config, &[(&positions, 25)]);
    for frame in &mut input.frames {
        frame.nodes = frame.nodes.clone().cast(DType::F64);
        frame.edges = frame.edges.clone().cast(DType::F64);
    }
    let model = model::<Train>(&config).map(&mut ToFloat64);
    let output = model.forward(&input);
    assert_eq!(output.dtype(), DType::F64);
    let gradients = weighted_sum(output).backward();
    let mut along = Along { gradients: &gradients, slopes: Vec::new() };
    model.visit(&mut along);
    let loss = |only, step| {
        let nudged = model.clone().map(&mut Nudge { only, step, tensor: 0 });
        values(weighted_sum(nudged.forward(&input)))[0]
    };
    let step = 1e-6;
    let mut worst: f64 = 0.0;
    for (only, slope) in along.slopes.iter().enumerate() {
        let difference = (loss(only, step) - loss(only, -step)) / (2.0 * step);
        worst = worst.max((difference - slope).abs() / (1.0 + slope.abs()));
    }
    println!("{name}: {} tensors, worst {worst:e}", along.slopes.len());
    assert!(worst < 1e-6, "{worst}");
}

// ---- what message passing does --------------------------------------------------------------

#[test]
fn edge_states_change_in_every_layer() {
    let config = small("baseline", 2);
    let positions = cloud(40, 2, 3, 4);
    let input = input::<Cpu>(&config, &[(&positions, 40)]);
    let Model::Tgnns(network) = model::<Cpu>(&config) else { panic!("not a TGNNS") };
    let graph = &input.frames[2];
    let mut nodes = network.node_encoder_later.forward(graph.nodes.clone());
    let mut edges = network.edge_encoder_later.forward(graph.edges.clone());
    for layer in network.frame_layers[2..].iter().chain(&network.message_layers) {
        let before = values(edges.clone());
        (nodes, edges) = layer.forward(nodes, edges, graph);
        let change =
            values(edges.clone()).iter().zip(&before).map(|(a, b)| (a - b).abs()).sum::<f64>();
        assert!(change / before.len() as f64 > 0.01, "mean change {change}");
    }
}

#[rstest]
fn order_of_points_does_not_matter(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(2, 3)] dimensions: usize,
) {
    let config = small(name, dimensions);
    let points = 50;
    let positions = cloud(points, dimensions, 3, 5);
    let order: Vec<usize> = (0..points).map(|i| (i * 17 + 5) % points).collect();
    let permute = |frame: &[f64]| -> Vec<f64> {
        order.iter().flat_map(|&i| frame[i * dimensions..(i + 1) * dimensions].to_vec()).collect()
    };
    let permuted: Vec<f32> = positions
        .chunks(points * dimensions)
        .flat_map(|frame| {
            let frame: Vec<f64> = frame.iter().map(|&x| f64::from(x)).collect();
            permute(&frame)
        })
        .map(|x| x as f32)
        .collect();
    let model = model::<Cpu>(&config);
    let straight = values(model.forward(&input(&config, &[(&positions, points)])));
    let other = values(model.forward(&input(&config, &[(&permuted, points)])));
    close(&permute(&straight), &other, 2e-5);
}

#[rstest]
fn place_does_not_matter(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(2, 3)] dimensions: usize,
) {
    let config = small(name, dimensions);
    let points = 40;
    let here = cloud(points, dimensions, 3, 6);
    let there: Vec<f32> = here.iter().map(|x| x + 2.0).collect();
    let model = model::<Cpu>(&config);
    let run = |positions: &[f32], bounds: [f64; 2]| {
        let window = [Window { positions, points }];
        let norm = normalisation(dimensions);
        let bounds = vec![bounds; dimensions];
        let input = window_input(&window, &config, &norm, &bounds, &Default::default());
        values(model.forward(&input))
    };
    // The walls move along: the same numbers, to the bit.
    assert_eq!(run(&here, [0.0, 1.0]), run(&there, [2.0, 3.0]));
    // No walls in reach.
    assert_eq!(run(&here, [-8.0, 16.0]), run(&there, [-8.0, 16.0]));
    assert_ne!(run(&here, [0.0, 1.0]), run(&here, [-8.0, 16.0]));
}

#[rstest]
fn windows_of_a_batch_do_not_meet(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
) {
    let config = small(name, 2);
    let (a, b, one) = (cloud(30, 2, 3, 8), cloud(45, 2, 3, 9), cloud(1, 2, 3, 10));
    let model = model::<Cpu>(&config);
    let run = |windows: &[(&[f32], usize)]| values(model.forward(&input(&config, windows)));
    let apart = [run(&[(&a, 30)]), run(&[(&one, 1)]), run(&[(&b, 45)])].concat();
    close(&run(&[(&a, 30), (&one, 1), (&b, 45)]), &apart, 1e-5);
}

#[rstest]
fn large_graphs_are_computed_in_blocks_without_a_trace(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
) {
    let config = ModelConfig { connection_radius: 0.5, ..small(name, 2) };
    let points = 200;
    let positions = cloud(points, 2, 3, 14);
    // Blocks are for inference only: training does without.
    let inference = input::<Cpu>(&config, &[(&positions, points)]);
    assert!(inference.frames[0].sender.dims()[0] > 2 * 4096);
    let training = input::<Train>(&config, &[(&positions, points)]);
    let a = values(model::<Cpu>(&config).forward(&inference));
    let b = values(model::<Train>(&config).forward(&training));
    close(&a, &b, 1e-5);
}

#[rstest]
fn points_without_neighbours_have_accelerations_and_gradients(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(2, 3)] dimensions: usize,
) {
    let config = small(name, dimensions);
    for points in [1, 2] {
        // Far from one another, or alone.
        let frame: Vec<f32> = (0..points * dimensions).map(|i| 0.1 + 0.4 * i as f32).collect();
        let positions = frame.repeat(3);
        let model = model::<Train>(&config);
        let output = model.forward(&input(&config, &[(&positions, points)]));
        assert_eq!(output.dims(), [points, dimensions]);
        assert!(values(output.clone()).iter().all(|a| a.is_finite()));
        weighted_sum(output).backward();
    }
}

// ---- features ------------------------------------------------------------------------------

#[test]
fn features_of_two_points_by_hand() {
    let config = ModelConfig { frames: 2, ..small("baseline", 2) };
    // Point 0 moves by (0.01, 0) and point 1 by (0, 0.02); r = 0.25.
    let positions = [0.5, 0.5, 0.5, 0.6, 0.51, 0.5, 0.5, 0.62];
    let input = input::<Cpu>(&config, &[(&positions, 2)]);
    let [first, later] = [&input.frames[0], &input.frames[1]];
    close(&values(first.nodes.clone()), &[0.0; 8], 0.0);
    // Edges 1 -> 0 and 0 -> 1: direction from receiver to sender, distance / r.
    assert_eq!(values(first.receiver.clone().float()), [0.0, 1.0]);
    assert_eq!(values(first.sender.clone().float()), [1.0, 0.0]);
    close(&values(first.edges.clone()), &[0.0, 1.0, 0.4, 0.0, -1.0, 0.4], 1e-6);
    // Velocity mean (0, 0.001), std 0.01.
    let nodes = [1.0, -0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.9, 0.0, 0.0, 0.0, 0.0];
    close(&values(later.nodes.clone()), &nodes, 1e-5);
    let length = (0.01f64.powi(2) + 0.12f64.powi(2)).sqrt();
    let (x, y, distance) = (-0.01 / length, 0.12 / length, length / 0.25);
    let edges = [-1.0, 2.0, x, y, distance, 1.0, -2.0, -x, -y, distance];
    close(&values(later.edges.clone()), &edges, 1e-5);
}

#[test]
fn walls_in_reach_and_the_gns_features() {
    // 0.1 from the lower x wall, 0.05 from the upper y wall; moves by (0.01, 0).
    let positions = [0.09, 0.95, 0.10, 0.95];
    let features = |kind| {
        let config = ModelConfig { kind, frames: 2, ..small("baseline", 2) };
        let input = input::<Cpu>(&config, &[(&positions, 1)]);
        values(input.frames[input.frames.len() - 1].nodes.clone())
    };
    close(&features(ModelKind::Tgnns), &[1.0, -0.1, 0.4, 0.0, 0.0, 0.2], 1e-5);
    close(&features(ModelKind::Gns), &[1.0, -0.1, 0.4, 1.0, 1.0, 0.2], 1e-5);
}

#[test]
fn persistent_edges_are_matched() {
    let config = small("frame4-msg1-hidden1-edgemsg", 2);
    let (a, b) = (cloud(60, 2, 3, 11), cloud(30, 2, 3, 12));
    let input = input::<Cpu>(&config, &[(&a, 60), (&b, 30)]);
    assert!(input.frames[0].persistence.is_none());
    let pairs = |k: usize| -> Vec<(i64, i64)> {
        let frame = &input.frames[k];
        let ints = |t: Tensor<Cpu, 1, burn::tensor::Int>| t.into_data().iter::<i64>().collect();
        let (v, w): (Vec<i64>, Vec<i64>) =
            (ints(frame.receiver.clone()), ints(frame.sender.clone()));
        v.into_iter().zip(w).collect()
    };
    for k in [1, 2] {
        let (before, now) = (pairs(k - 1), pairs(k));
        let edges = input.frames[k].persistence.as_ref().unwrap();
        let list = |t: &Tensor<Cpu, 1, burn::tensor::Int>| -> Vec<usize> {
            t.to_data().iter::<i64>().map(|i| i as usize).collect()
        };
        let (persistent, previous) = (list(&edges.persistent), list(&edges.previous));
        let (new, place) = (list(&edges.new), list(&edges.place));
        assert!(!new.is_empty() && !persistent.is_empty() && before.len() > persistent.len());
        assert!(persistent.iter().zip(&previous).all(|(&e, &p)| now[e] == before[p]));
        assert!(new.iter().all(|&e| !before.contains(&now[e])));
        let parted = [persistent, new].concat();
        assert!((0..now.len()).all(|e| parted[place[e]] == e));
        assert_eq!(parted.len(), now.len());
    }
}

// ---- graphs --------------------------------------------------------------------------------

fn brute_force(positions: &[f32], dimensions: usize, radius: f32) -> RadiusGraph {
    let (mut start, mut sender) = (vec![0], Vec::new());
    let points: Vec<&[f32]> = positions.chunks(dimensions).collect();
    for (v, x) in points.iter().enumerate() {
        for (w, y) in points.iter().enumerate() {
            let square: f32 = x.iter().zip(*y).map(|(a, b)| (a - b) * (a - b)).sum();
            if v != w && square <= radius * radius {
                sender.push(w as u32);
            }
        }
        start.push(sender.len() as u32);
    }
    RadiusGraph { start, sender }
}

fn coordinates() -> impl Strategy<Value = (usize, Vec<f32>)> {
    let coordinate = prop_oneof![
        8 => (-40i32..40).prop_map(|i| i as f32 / 16.0), // duplicates, distances equal to r
        4 => -3.0f32..3.0,
        1 => -1e4f32..1e4, // isolated
    ];
    (1usize..=3).prop_flat_map(move |dimensions| {
        let points =
            prop::collection::vec(prop::collection::vec(coordinate.clone(), dimensions), 0..120);
        points.prop_map(move |points| (dimensions, points.concat()))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn graphs_are_those_of_brute_force(
        (dimensions, positions) in coordinates(),
        radius in prop_oneof![Just(0.25f32), Just(1.0), Just(1e-3), Just(1e5), 0.01f32..3.0],
    ) {
        let graph = radius_graph(&positions, dimensions, radius);
        prop_assert_eq!(graph, brute_force(&positions, dimensions, radius));
    }

    #[test]
    fn graphs_survive_any_coordinates(
        positions in prop::collection::vec(any::<f32>(), 0..40),
        radius in any::<f32>(),
    ) {
        let positions = &positions[..positions.len() / 2 * 2];
        radius_graph(positions, 2, radius);
    }
}

#[test]
fn graph_of_the_papers_column() {
    // 48 x 48 points at 1/16 m: those at exactly 0.25 m are neighbours.
    let positions: Vec<f32> =
        (0..48 * 48).flat_map(|i| [(i % 48) as f32 / 16.0, (i / 48) as f32 / 16.0]).collect();
    let graph = radius_graph(&positions, 2, 0.25);
    assert_eq!(graph, brute_force(&positions, 2, 0.25));
    let middle = 24 * 48 + 24;
    assert_eq!(graph.start[middle + 1] - graph.start[middle], 48);
    println!("{} edges", graph.edges());
}

// ---- files ---------------------------------------------------------------------------------

fn saved(path: &Path, config: &ModelConfig) -> Model<Cpu> {
    let model = model::<Cpu>(config);
    let extra = BTreeMap::from([("step".to_string(), "12".to_string())]);
    let norm = normalisation(config.dimensions);
    weights::save(path, &model, config, &norm, extra).unwrap();
    model
}

fn load(path: &Path) -> Result<Model<Cpu>, WeightsError> {
    weights::load(path, &Default::default()).map(|loaded| loaded.0)
}

/// All parameters in order.
#[derive(Default)]
struct Bits(Vec<u32>);

impl<B: Backend> ModuleVisitor<B> for Bits {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        self.0.extend(param.val().into_data().iter::<f32>().map(f32::to_bits));
    }
}

fn bits<B: Backend>(model: &Model<B>) -> Vec<u32> {
    let mut bits = Bits::default();
    model.visit(&mut bits);
    bits.0
}

#[rstest]
fn weights_survive_a_file_to_the_bit(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(2, 3)] dimensions: usize,
) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let config = ModelConfig { connection_radius: 0.1 + 0.2, ..small(name, dimensions) };
    let model = saved(&path, &config);
    let (loaded, loaded_config, norm, extra) =
        weights::load::<Train>(&path, &Default::default()).unwrap();
    assert_eq!(bits(&loaded), bits(&model));
    assert_eq!((loaded_config, norm), (config.clone(), normalisation(dimensions)));
    assert_eq!(extra["step"], "12");
    // A loaded network learns.
    let positions = cloud(30, dimensions, 3, 2);
    let output = loaded.forward(&input(&config, &[(&positions, 30)]));
    let gradients = weighted_sum(output).backward();
    let mut visitor = NonZero { gradients: &gradients, tensors: 0, share: 1.0 };
    loaded.visit(&mut visitor);
    assert!(visitor.tensors > 20);
    // Files are the same to the byte.
    let again = folder.path().join("again.safetensors");
    saved(&again, &config);
    assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(&again).unwrap());
}

#[test]
fn a_normalisation_that_divides_by_zero_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let config = small("baseline", 2);
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let norm = Normalisation { velocity_std: vec![0.1, wrong], ..normalisation(2) };
        weights::save(&path, &model::<Cpu>(&config), &config, &norm, BTreeMap::new()).unwrap();
        assert!(matches!(load(&path), Err(WeightsError::Value { .. })), "{wrong}");
    }
}

#[test]
fn damaged_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    assert!(matches!(load(&path), Err(WeightsError::Io { .. })));
    saved(&path, &small("baseline", 2));
    let whole = std::fs::read(&path).unwrap();
    let check = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        load(&path)
    };
    for length in (0..whole.len()).step_by(whole.len() / 97) {
        assert!(matches!(check(&whole[..length]), Err(WeightsError::Format { .. })), "{length}");
    }
    check(b"not a safetensors file at all").unwrap_err();
    // Any damage to the header is an error or harmless, never a panic.
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let header = 8 + u64::from_le_bytes(whole[..8].try_into().unwrap()) as usize;
    for _ in 0..400 {
        let mut bytes = whole.clone();
        bytes[rng.random_range(0..header)] = rng.random();
        let _ = check(&bytes);
    }
    check(&whole).unwrap();
}

/// Name, type and shape of a tensor of a rewritten file.
type Header = (String, Dtype, Vec<usize>);

/// Rewrites a weights file with other metadata and tensors; `F64` keeps a tensor's type.
fn rewrite(
    path: &Path,
    metadata: impl Fn(&str) -> Option<String>,
    tensor: impl Fn(&str, Vec<usize>) -> Option<Header>,
) {
    let bytes = std::fs::read(path).unwrap();
    let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let json = metadata(&header.metadata().as_ref().unwrap()["surrogate"]);
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let views: Vec<_> = file
        .iter()
        .filter_map(|(name, view)| {
            let (new, dtype, shape) = tensor(name, view.shape().to_vec())?;
            let dtype = if dtype == Dtype::F64 { view.dtype() } else { dtype };
            Some((new, TensorView::new(dtype, shape, view.data()).unwrap()))
        })
        .collect();
    let metadata = json.map(|json| [("surrogate".to_string(), json)].into());
    let written = safetensors::serialize(views, metadata).unwrap();
    std::fs::write(path, written).unwrap();
}

#[test]
fn wrong_tensors_are_errors_that_name_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let same = |json: &str| Some(json.to_string());
    let weight = "node_fusion.linears.0.weight";
    let kept = |name: &str, shape| Some((name.to_string(), Dtype::F64, shape));
    let check = |metadata: &dyn Fn(&str) -> Option<String>,
                 tensor: &dyn Fn(&str, Vec<usize>) -> Option<Header>| {
        saved(&path, &small("baseline", 2));
        rewrite(&path, metadata, tensor);
        load(&path).map(drop)
    };
    check(&same, &kept).unwrap();
    let transposed = |name: &str, mut shape: Vec<usize>| {
        if name == weight {
            shape.reverse();
        }
        kept(name, shape)
    };
    let error = check(&same, &transposed).unwrap_err();
    assert!(matches!(&error, WeightsError::Shape { name, .. } if name == weight), "{error}");
    let renamed = |name: &str, shape| kept(if name == weight { "other" } else { name }, shape);
    let error = check(&same, &renamed).unwrap_err();
    assert!(matches!(&error, WeightsError::Missing { name, .. } if name == weight), "{error}");
    let dropped = |name: &str, shape| if name == weight { None } else { kept(name, shape) };
    assert!(matches!(check(&same, &dropped), Err(WeightsError::Size { .. })));
    let unnamed = |name: &str, shape| kept(name, shape).filter(|_| !name.contains("velocity_std"));
    assert!(matches!(check(&same, &unnamed), Err(WeightsError::Missing { .. })));
    let integers = |name: &str, shape: Vec<usize>| {
        let dtype = if name.starts_with("normalisation") { Dtype::I64 } else { Dtype::F64 };
        Some((name.to_string(), dtype, shape))
    };
    assert!(matches!(check(&same, &integers), Err(WeightsError::Shape { .. })));
    assert!(matches!(check(&|_| None, &kept), Err(WeightsError::Metadata { .. })));
    let garbage = |_: &str| Some("{}".to_string());
    assert!(matches!(check(&garbage, &kept), Err(WeightsError::Metadata { .. })));
    let newer = |json: &str| Some(json.replace("\"format\":1", "\"format\":2"));
    assert!(matches!(check(&newer, &kept), Err(WeightsError::Metadata { .. })));
    let wider = |json: &str| Some(json.replace("\"width\":8", "\"width\":4096"));
    assert!(matches!(check(&wider, &kept), Err(WeightsError::Size { .. })));
    let absurd = |json: &str| Some(json.replace("\"width\":8", "\"width\":9999999999"));
    assert!(matches!(check(&absurd, &kept), Err(WeightsError::Config { .. })));
}

// ---- an implementation in numpy --------------------------------------------------------------

/// Writes a network, its input and output, which `numpy_forward.py` computes from the names and
/// shapes that docs/weights.md promises.
#[rstest]
fn numpy_gets_the_same_accelerations(
    #[values("baseline", "msg0-hidden1", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
) {
    let python = |arguments: &[&str]| Command::new("python3").args(arguments).output();
    if !python(&["-c", "import numpy, safetensors.numpy"]).is_ok_and(|o| o.status.success()) {
        println!("skipped: python3 has no numpy or no safetensors");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let config = small(name, 2);
    let model = saved(&path, &config);
    let positions = cloud(50, 2, 3, 13);
    let input = input::<Cpu>(&config, &[(&positions, 50)]);
    let mut tensors: Vec<(String, Vec<usize>, Vec<u8>)> = Vec::new();
    let mut push = |name: String, shape: &[usize], values: Vec<f64>| {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        tensors.push((name, shape.to_vec(), bytes));
    };
    for (k, frame) in input.frames.iter().enumerate() {
        push(format!("nodes{k}"), &frame.nodes.dims(), values(frame.nodes.clone()));
        push(format!("edges{k}"), &frame.edges.dims(), values(frame.edges.clone()));
        let edges = frame.sender.dims();
        push(format!("sender{k}"), &edges, values(frame.sender.clone().float()));
        push(format!("receiver{k}"), &edges, values(frame.receiver.clone().float()));
    }
    let output = model.forward(&input);
    push("output".into(), &output.dims(), values(output));
    let views = tensors.iter().map(|(name, shape, data)| {
        (name, TensorView::new(Dtype::F64, shape.clone(), data).unwrap())
    });
    let example = folder.path().join("example.safetensors");
    safetensors::serialize_to_file(views, None, &example).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/numpy_forward.py");
    let arguments = [&script, &path, &example].map(|p| p.to_str().unwrap());
    let result = python(&arguments).unwrap();
    let text = String::from_utf8_lossy(&result.stdout);
    assert!(result.status.success(), "{text}{}", String::from_utf8_lossy(&result.stderr));
    println!("{name}: {text}");
    assert!(text.trim().parse::<f64>().unwrap() < 1e-5, "{text}");
}
