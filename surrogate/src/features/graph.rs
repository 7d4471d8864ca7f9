//! Radius graph of one frame.

use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Directed edges in compressed sparse rows: the senders of receiver `v` are
/// `sender[start[v]..start[v + 1]]`, ascending. All points within the radius, without self edges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RadiusGraph {
    /// First edge of each receiver, and the number of edges at the end (points + 1).
    pub start: Vec<u32>,
    /// Sender of each edge.
    pub sender: Vec<u32>,
}

impl RadiusGraph {
    /// Number of directed edges.
    pub fn edges(&self) -> usize {
        self.sender.len()
    }

    /// Edges as (receiver, sender), ascending.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.start.windows(2).enumerate().flat_map(move |(receiver, row)| {
            self.sender[row[0] as usize..row[1] as usize]
                .iter()
                .map(move |&sender| (receiver, sender as usize))
        })
    }
}

/// Graph of all pairs with |x_w - x_v| <= radius (m, in float32). `positions` (m) are points x 2;
/// points with a coordinate that is not finite have no neighbours.
///
/// ```
/// use surrogate::features::radius_graph;
///
/// // Three points on a line, 1 m apart.
/// let graph = radius_graph(&[0.0, 0.0, 1.0, 0.0, 2.0, 0.0], 1.5);
/// let edges: Vec<_> = graph.pairs().collect();
/// assert_eq!(edges, [(0, 1), (1, 0), (1, 2), (2, 1)]);
/// ```
///
/// # Panics
/// If the number of coordinates is odd.
pub fn radius_graph(positions: &[f32], radius: f32) -> RadiusGraph {
    let (points, rest) = positions.as_chunks::<2>();
    assert!(rest.is_empty(), "two coordinates a point");
    let finite = |x: &[f32; 2]| x.iter().all(|c| c.is_finite());
    let (numbers, inside): (Vec<u32>, Vec<[f32; 2]>) =
        (0..).zip(points).filter(|(_, x)| finite(x)).unzip();
    let tree = ImmutableKdTree::<f32, 2>::new_from_slice(&inside).expect("points fit into u32");
    let mut graph = RadiusGraph { start: vec![0], sender: Vec::new() };
    for (v, x) in (0..).zip(points) {
        let row = graph.sender.len();
        if finite(x) {
            let near = tree.query(x).within::<SquaredEuclidean<f32>>(radius * radius).unsorted();
            let senders = near.execute().into_iter().map(|found| numbers[found.item as usize]);
            graph.sender.extend(senders.filter(|&w| w != v));
        }
        graph.sender[row..].sort_unstable();
        graph.start.push(graph.sender.len() as u32);
    }
    graph
}
