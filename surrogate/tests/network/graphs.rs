//! Graphs against brute force.

use proptest::prelude::*;
use surrogate::features::{RadiusGraph, radius_graph};

fn brute_force(positions: &[f32], radius: f32) -> RadiusGraph {
    let (mut start, mut sender) = (vec![0], Vec::new());
    let points: Vec<&[f32]> = positions.chunks(2).collect();
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

fn coordinates() -> impl Strategy<Value = Vec<f32>> {
    let coordinate = prop_oneof![
        8 => (-40i32..40).prop_map(|i| i as f32 / 16.0), // duplicates, distances equal to r
        4 => -3.0f32..3.0,
        1 => -1e4f32..1e4, // isolated
    ];
    prop::collection::vec([coordinate.clone(), coordinate], 0..120)
        .prop_map(|points| points.concat())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn graphs_are_those_of_brute_force(
        positions in coordinates(),
        radius in prop_oneof![Just(0.25f32), Just(1.0), Just(1e-3), Just(1e5), 0.01f32..3.0],
    ) {
        let graph = radius_graph(&positions, radius);
        prop_assert_eq!(graph, brute_force(&positions, radius));
    }

    #[test]
    fn graphs_survive_any_coordinates(
        positions in prop::collection::vec(any::<f32>(), 0..40),
        radius in any::<f32>(),
    ) {
        let positions = &positions[..positions.len() / 2 * 2];
        radius_graph(positions, radius);
    }
}

#[test]
fn graph_of_the_papers_column() {
    // 48 x 48 points at 1/16 m: those at exactly 0.25 m are neighbours.
    let positions: Vec<f32> =
        (0..48 * 48).flat_map(|i| [(i % 48) as f32 / 16.0, (i / 48) as f32 / 16.0]).collect();
    let graph = radius_graph(&positions, 0.25);
    assert_eq!(graph, brute_force(&positions, 0.25));
    let middle = 24 * 48 + 24;
    assert_eq!(graph.start[middle + 1] - graph.start[middle], 48);
    println!("{} edges", graph.edges());
}
