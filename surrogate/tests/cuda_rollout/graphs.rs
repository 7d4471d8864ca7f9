//! Graphs, edge by edge.

use cudarc::driver::CudaSlice;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstest::rstest;
use surrogate::cuda::GraphBuilder;
use surrogate::features::{RadiusGraph, radius_graph};
use surrogate::network::DIMENSIONS;

use crate::fixtures::{RADIUS, random};

/// The graphs of several windows side by side.
fn reference(windows: &[Vec<f32>]) -> RadiusGraph {
    let mut whole = RadiusGraph { start: vec![0], sender: Vec::new() };
    for window in windows {
        let graph = radius_graph(window, RADIUS);
        let (points, edges) = (whole.start.len() as u32 - 1, whole.sender.len() as u32);
        whole.start.extend(graph.start[1..].iter().map(|start| start + edges));
        whole.sender.extend(graph.sender.iter().map(|sender| sender + points));
    }
    whole
}

/// Builds the graph of some windows and compares it edge by edge; the room is too small at first.
fn check_graph(windows: &[Vec<f32>]) {
    let Some(device) = gpu::for_tests() else { return };
    let expected = reference(windows);
    let points: Vec<usize> = windows.iter().map(|window| window.len() / DIMENSIONS).collect();
    let mut builder = GraphBuilder::new(&device, RADIUS, &points, 1).unwrap();
    let mut positions = windows.concat();
    let values = positions.len();
    positions.push(0.0); // an empty upload is an error
    let positions = device.upload(&positions).unwrap();
    if expected.edges() > 0 {
        let mut small = builder.allocate(expected.edges() - 1).unwrap();
        builder.build(&mut [(positions.slice(..values), &mut small)]).unwrap();
        assert_eq!(builder.needed().unwrap(), expected.edges());
        let stream = device.stream();
        assert_eq!(stream.clone_dtoh(&small.edges).unwrap(), [0], "no half of a graph");
        assert!(stream.clone_dtoh(&small.start).unwrap().iter().all(|&start| start == 0));
    }
    for capacity in [expected.edges(), 2 * expected.edges() + 100] {
        let mut graph = builder.allocate(capacity).unwrap();
        // The second time over what the first one left.
        for _ in 0..2 {
            builder.build(&mut [(positions.slice(..values), &mut graph)]).unwrap();
        }
        assert_eq!(builder.needed().unwrap(), expected.edges());
        assert_eq!(builder.needed().unwrap(), 0, "since the last call");
        let stream = device.stream();
        let read = |array: &CudaSlice<u32>| {
            let mut list = stream.clone_dtoh(array).unwrap();
            list.truncate(expected.edges());
            list
        };
        assert_eq!(stream.clone_dtoh(&graph.edges).unwrap(), [expected.edges() as u32]);
        let nodes = expected.start.len() - 1;
        assert_eq!(stream.clone_dtoh(&graph.nodes).unwrap(), [nodes as u32]);
        assert_eq!(stream.clone_dtoh(&graph.start).unwrap()[..=nodes], expected.start);
        let (sender, receiver) = (read(&graph.sender), read(&graph.receiver));
        assert_eq!(sender, expected.sender);
        let receivers: Vec<u32> = expected.pairs().map(|(receiver, _)| receiver as u32).collect();
        assert_eq!(receiver, receivers);
        for (edge, &back) in read(&graph.reverse).iter().enumerate() {
            let back = back as usize;
            assert_eq!((sender[back], receiver[back]), (receiver[edge], sender[edge]));
        }
    }
}

#[rstest]
fn graphs_of_random_points(#[values(1, 2, 31, 33, 500, 3000)] points: usize) {
    for (seed, extent) in [(1, 0.3), (2, 2.0), (3, 10.0)] {
        check_graph(&[random(points, DIMENSIONS, extent, seed)]);
    }
}

#[test]
fn graphs_of_special_points() {
    let line = |xs: &[f32]| -> Vec<f32> { xs.iter().flat_map(|&x| [x, 0.5]).collect() };
    check_graph(&[Vec::new()]);
    check_graph(&[line(&[1.0])]);
    // All at one place: each is a neighbour of all.
    check_graph(&[line(&[0.7; 100])]);
    // At exactly the radius, and the next number beyond; on borders of cells, about zero.
    check_graph(&[line(&[1.0, 1.25, 1.5, 1.750_000_1, -0.25, 0.0, 0.25, -0.0])]);
    let width = 0.25 * 1.001;
    let borders: Vec<f32> = (-20..20).map(|k| k as f32 * width).collect();
    check_graph(&[line(&borders)]);
    // Far away and nowhere.
    let far = [f32::NAN, 1.0, 1.1, f32::INFINITY, 1e30, -1e30, 1e9, 1e9, -3e7, -3e7, f32::MAX, 1.2];
    check_graph(&[line(&far)]);
    // 16 cells apart, so that they share buckets.
    check_graph(&[line(&[0.1, 0.1 + 16.0 * width, 0.1 + 8.0 * width, 0.2])]);
    // Dense clusters in a wide domain.
    let mut clusters = random(400, DIMENSIONS, 0.2, 4);
    clusters.extend(random(400, DIMENSIONS, 0.2, 5).iter().map(|x| x + 900.0));
    check_graph(&[clusters]);
}

/// Differences of coordinates of thousands of cells, where single precision could part neighbours by
/// two cells.
#[test]
fn graphs_far_from_the_origin() {
    for shift in [1.0e3, 1.0e4, 1.0e5] {
        let cloud: Vec<f32> = random(2000, DIMENSIONS, 4.0, 6).iter().map(|x| x + shift).collect();
        check_graph(&[cloud]);
    }
}

#[test]
fn graphs_of_batches() {
    let sizes = [300, 0, 1, 2304, 77];
    let windows: Vec<Vec<f32>> =
        sizes.iter().enumerate().map(|(k, &n)| random(n, DIMENSIONS, 2.0, k as u64)).collect();
    check_graph(&windows);
}

/// The paper's scene and larger ones.
#[test]
fn graphs_of_lattices() {
    for (columns, rows) in [(48, 48), (400, 250)] {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let place = |k: usize| (k as f32 + 0.5) / 16.0;
        let lattice = (0..columns * rows).flat_map(|k| [place(k % columns), place(k / columns)]);
        let lattice = lattice.map(|x| x + rng.random_range(-0.02..0.02)).collect();
        check_graph(&[lattice]);
    }
}
