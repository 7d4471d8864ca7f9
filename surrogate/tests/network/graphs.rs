//! Graphs against brute force.

use proptest::prelude::*;
use surrogate::features::{RadiusGraph, radius_graph};

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
