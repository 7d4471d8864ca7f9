//! Features of nodes and edges.

use burn::module::Module;
use burn::tensor::Tensor;
use rstest::rstest;
use surrogate::features::{Normalisation, Obstacle, Window, surfaces, window_input};
use surrogate::network::{ModelConfig, ModelKind, NodeFeature};

use super::{
    Cpu, NonZero, Train, UNIT_BOX, close, cloud, input, model, normalisation, small, values,
    weighted_sum,
};

#[test]
fn features_of_two_points_by_hand() {
    let config = ModelConfig { frames: 2, ..small("baseline") };
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
        let config = ModelConfig { kind, frames: 2, ..small("baseline") };
        let input = input::<Cpu>(&config, &[(&positions, 1)]);
        values(input.frames[input.frames.len() - 1].nodes.clone())
    };
    close(&features(ModelKind::Tgnns), &[1.0, -0.1, 0.4, 0.0, 0.0, 0.2], 1e-5);
    close(&features(ModelKind::Gns), &[1.0, -0.1, 0.4, 1.0, 1.0, 0.2], 1e-5);
}

#[test]
fn persistent_edges_are_matched() {
    let config = small("frame4-msg1-hidden1-edgemsg");
    let (a, b) = (cloud(60, 3, 11), cloud(30, 3, 12));
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

/// The two frames before those of the network are there for the accelerations.
#[rstest]
fn accelerations_follow_from_three_frames(#[values("baseline", "gns")] name: &str) {
    let plain = ModelConfig { frames: 2, connection_radius: 0.2, ..small(name) };
    let config = ModelConfig { node_features: vec![NodeFeature::Acceleration], ..plain.clone() };
    assert_eq!([plain.window(), config.window()], [2, 4]);
    let norm = Normalisation {
        features_mean: vec![0.0; 2],
        features_std: vec![0.5, 0.25],
        ..normalisation()
    };
    // Falls from the second frame on, and moves to the right in the last one.
    let positions = [0.5, 0.75, 0.5, 0.75, 0.5, 0.625, 0.625, 0.375];
    let window = [Window { positions: &positions, points: 1, statics: &[], obstacles: &[] }];
    let whole = window_input::<Cpu>(&window, &config, &norm, &UNIT_BOX, &Default::default());
    let bare = input::<Cpu>(&plain, &[(&positions[4..], 1)]);
    let accelerations = [[0.0, -0.5], [0.25, -0.5]];
    assert_eq!(whole.frames.len(), plain.graphs());
    let newest = &accelerations[2 - plain.graphs()..];
    for ((with, without), acceleration) in whole.frames.iter().zip(&bare.frames).zip(newest) {
        let mut expected = values(without.nodes.clone());
        expected.extend(acceleration);
        close(&values(with.nodes.clone()), &expected, 1e-6);
    }
    let output = model::<Cpu>(&config).forward(&whole);
    assert_eq!(output.dims(), [1, 2]);
}

#[rstest]
fn further_features_follow_the_others(#[values("baseline", "gns")] name: &str) {
    let plain = ModelConfig { frames: 2, connection_radius: 0.2, ..small(name) };
    let features = vec![
        NodeFeature::InitialSolidFraction,
        NodeFeature::Overburden,
        NodeFeature::InitialStress,
    ];
    let config = ModelConfig { node_features: features, ..plain.clone() };
    let norm = Normalisation {
        features_mean: vec![0.8, 1.0, 100.0, 0.0],
        features_std: vec![0.1, 2.0, 10.0, 5.0],
        ..normalisation()
    };
    // Point 1 is above point 0, and beside it in the second frame.
    let positions = [0.5, 0.5, 0.5, 0.6, 0.5, 0.5, 0.7, 0.6];
    let statics = [0.9, 120.0, 10.0, 0.7, 100.0, 0.0];
    let window = [Window { positions: &positions, points: 2, statics: &statics, obstacles: &[] }];
    let whole = window_input::<Cpu>(&window, &config, &norm, &UNIT_BOX, &Default::default());
    let bare = input::<Cpu>(&plain, &[(&positions, 2)]);
    let loads: &[[f64; 2]] = if name == "gns" { &[[0.0, 0.0]] } else { &[[1.0, 0.0], [0.0, 0.0]] };
    for ((with, without), load) in whole.frames.iter().zip(&bare.frames).zip(loads) {
        let columns = without.nodes.dims()[1];
        let (with, without) = (values(with.nodes.clone()), values(without.nodes.clone()));
        for (point, (fraction, stress)) in
            [(1.0, [2.0, 2.0]), (-1.0, [0.0, 0.0])].iter().enumerate()
        {
            let mut expected = without[point * columns..(point + 1) * columns].to_vec();
            expected.extend([*fraction, (load[point] - 1.0) / 2.0]);
            expected.extend(stress);
            close(&with[point * expected.len()..(point + 1) * expected.len()], &expected, 1e-5);
        }
    }
    // They enter through the node encoders alone: F_n0 and F_n1, or the GNS's only one.
    let encoders = if name == "gns" { 1 } else { 2 };
    assert_eq!(config.parameter_count(), plain.parameter_count() + encoders * 4 * plain.width);
    let output = model::<Cpu>(&config).forward(&whole);
    assert_eq!(output.dims(), [2, 2]);
}

/// Faces of obstacles are walls for the points in front of them, and for no others.
#[rstest]
fn faces_of_obstacles_are_walls(#[values("baseline", "gns")] name: &str) {
    let plain = ModelConfig { frames: 2, connection_radius: 0.2, ..small(name) };
    let seeing = ModelConfig { obstacles: true, ..plain.clone() };
    let obstacle = Obstacle::fixed([[0.4, 0.1], [0.6, 0.5]]);
    // Only fixed boxes are walls.
    let plate = Obstacle { velocity: [1e-9, 0.0], ..Obstacle::fixed([[0.0; 2], [1.0; 2]]) };
    let boxes = [plate, obstacle];
    let far = if name == "gns" { 1.0 } else { 0.0 };
    // Left, right, below, above: in radii.
    for (place, walls) in [
        ([0.35, 0.3], [far, 0.25, far, far]),
        ([0.7, 0.3], [0.5, far, far, far]),
        ([0.5, 0.6], [far, far, 0.5, far]),
        ([0.5, 0.05], [far, far, 0.25, 0.25]),
        // On a face, and a rounding error inside.
        ([0.4, 0.3], [far, 0.0, far, far]),
        ([0.5, 0.499_999_9], [far, far, 0.0, far]),
        // Beyond a corner.
        ([0.35, 0.55], [far; 4]),
    ] {
        let positions = [place, place].concat();
        for (config, seen) in [(&seeing, &boxes[..]), (&seeing, &[]), (&plain, &boxes)] {
            let window =
                [Window { positions: &positions, points: 1, statics: &[], obstacles: seen }];
            let norm = normalisation();
            let whole = window_input::<Cpu>(&window, config, &norm, &UNIT_BOX, &Default::default());
            let newest = values(whole.frames[whole.frames.len() - 1].nodes.clone());
            let floor: f64 = if place[1] < 0.2 { f64::from(place[1]) / 0.2 } else { far };
            let expected = match config.obstacles && !seen.is_empty() {
                true => walls,
                false => [far, far, floor, far],
            };
            close(&newest[2..], &expected, 1e-5);
        }
    }
}

/// Each frame has the surfaces as they are in it, and every parameter learns from them.
#[rstest]
fn surfaces_are_those_of_the_frame(#[values("baseline", "gns")] name: &str) {
    let plain = ModelConfig { frames: 3, connection_radius: 0.2, ..small(name) };
    let config = ModelConfig { node_features: vec![NodeFeature::Surfaces], ..plain.clone() };
    let norm = Normalisation {
        features_mean: vec![0.0; 10],
        features_std: [vec![1.0; 7], vec![0.01; 2], vec![1.0]].concat(),
        ..normalisation()
    };
    let plate = Obstacle {
        corners: [[0.3, 1.2], [0.6, 1.3]],
        velocity: [0.01, -0.1],
        elapsed: 5.0,
        friction: [0.5; 4],
    };
    let fixed = Obstacle { friction: [0.3; 4], ..Obstacle::fixed([[0.4, 0.1], [0.6, 0.5]]) };
    let obstacles = [fixed, plate];
    let positions = cloud(40, 3, 16);
    let window =
        [Window { positions: &positions, points: 40, statics: &[], obstacles: &obstacles }];
    let whole = window_input::<Train>(&window, &config, &norm, &UNIT_BOX, &Default::default());
    let bare = input::<Cpu>(&plain, &[(&positions, 40)]);
    let backs = (0..plain.graphs()).rev();
    for ((with, without), back) in whole.frames.iter().zip(&bare.frames).zip(backs) {
        let now = &positions[(2 - back) * 80..(3 - back) * 80];
        let expected = surfaces(now, &obstacles, back, 0.2);
        let columns = without.nodes.dims()[1];
        let (with, without) = (values(with.nodes.clone()), values(without.nodes.clone()));
        for point in 0..40 {
            let row = &with[point * (columns + 10)..(point + 1) * (columns + 10)];
            close(&row[..columns], &without[point * columns..(point + 1) * columns], 1e-6);
            let seen = expected[10 * point..10 * (point + 1)].iter().enumerate();
            let scaled = seen.map(|(k, &x)| f64::from(x) / norm.features_std[k]);
            close(&row[columns..], &scaled.collect::<Vec<_>>(), 1e-5);
        }
    }
    let model = model::<Train>(&config);
    let gradients = weighted_sum(model.forward(&whole)).backward();
    let mut visitor = NonZero { gradients: &gradients, tensors: 0, share: 1.0 };
    model.visit(&mut visitor);
    // ReLU: some units rest.
    let share = if name == "gns" { 0.1 } else { 1.0 };
    assert!(visitor.share >= share, "{}", visitor.share);
}

/// A wall out of reach is at one radius instead of none.
#[test]
fn walls_can_be_clamped() {
    let config =
        ModelConfig { frames: 2, connection_radius: 0.2, clamped_walls: true, ..small("baseline") };
    let found = input::<Cpu>(&config, &[(&[0.1, 0.5, 0.1, 0.5], 1)]);
    close(&values(found.frames[0].nodes.clone()), &[0.5, 1.0, 1.0, 1.0], 1e-5);
}
