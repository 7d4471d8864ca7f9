//! What message passing does, and what it must not see.

use rstest::rstest;
use surrogate::features::{Window, window_input};
use surrogate::network::{Model, ModelConfig};

use super::{Cpu, Train, close, cloud, input, model, normalisation, small, values, weighted_sum};

#[test]
fn edge_states_change_in_every_layer() {
    let config = small("baseline");
    let positions = cloud(40, 3, 4);
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
) {
    let config = small(name);
    let points = 50;
    let positions = cloud(points, 3, 5);
    let order: Vec<usize> = (0..points).map(|i| (i * 17 + 5) % points).collect();
    let permute = |frame: &[f64]| -> Vec<f64> {
        order.iter().flat_map(|&i| frame[2 * i..2 * i + 2].to_vec()).collect()
    };
    let permuted: Vec<f32> = positions
        .chunks(2 * points)
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
fn place_does_not_matter(#[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str) {
    let config = small(name);
    let points = 40;
    let here = cloud(points, 3, 6);
    let there: Vec<f32> = here.iter().map(|x| x + 2.0).collect();
    let model = model::<Cpu>(&config);
    let run = |positions: &[f32], bounds: [f64; 2]| {
        let window = [Window { positions, points, statics: &[], obstacles: &[] }];
        let norm = normalisation();
        let bounds = [bounds; 2];
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
    let config = small(name);
    let (a, b, one) = (cloud(30, 3, 8), cloud(45, 3, 9), cloud(1, 3, 10));
    let model = model::<Cpu>(&config);
    let run = |windows: &[(&[f32], usize)]| values(model.forward(&input(&config, windows)));
    let apart = [run(&[(&a, 30)]), run(&[(&one, 1)]), run(&[(&b, 45)])].concat();
    close(&run(&[(&a, 30), (&one, 1), (&b, 45)]), &apart, 1e-5);
}

#[rstest]
fn large_graphs_are_computed_in_blocks_without_a_trace(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
) {
    let config = ModelConfig { connection_radius: 0.5, ..small(name) };
    let points = 200;
    let positions = cloud(points, 3, 14);
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
) {
    let config = small(name);
    for points in [1, 2] {
        // Far from one another, or alone.
        let frame: Vec<f32> = (0..2 * points).map(|i| 0.1 + 0.4 * i as f32).collect();
        let positions = frame.repeat(3);
        let model = model::<Train>(&config);
        let output = model.forward(&input(&config, &[(&positions, points)]));
        assert_eq!(output.dims(), [points, 2]);
        assert!(values(output.clone()).iter().all(|a| a.is_finite()));
        weighted_sum(output).backward();
    }
}
