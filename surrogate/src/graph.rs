//! Neighbours of points: the radius graph of one frame.

/// Directed edges in compressed rows by receiver: the senders of receiver `v` are
/// `sender[start[v]..start[v + 1]]`, ascending. All points within the radius, no cap, no self edges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RadiusGraph {
    /// First edge of each receiver, and the number of edges at the end (points + 1).
    pub start: Vec<u32>,
    /// Sender of each edge.
    pub sender: Vec<u32>,
}

impl RadiusGraph {
    pub fn edges(&self) -> usize {
        self.sender.len()
    }

    /// Edges as (receiver, sender), in order.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.start.windows(2).enumerate().flat_map(move |(receiver, row)| {
            self.sender[row[0] as usize..row[1] as usize]
                .iter()
                .map(move |&sender| (receiver, sender as usize))
        })
    }
}

/// Graph of all pairs with |x_w - x_v| <= radius (in float32). `positions` is points x dimensions;
/// a point with a coordinate that is not finite has no neighbours.
///
/// # Panics
/// If `dimensions` is 0 or above 3, or `positions` is not a multiple of it.
pub fn radius_graph(positions: &[f32], dimensions: usize, radius: f32) -> RadiusGraph {
    assert!((1..=3).contains(&dimensions) && positions.len().is_multiple_of(dimensions));
    let cells = CellList::new(positions, dimensions, radius);
    let points = positions.len() / dimensions;
    let mut start = Vec::with_capacity(points + 1);
    let mut sender = Vec::new();
    start.push(0);
    for (v, x) in positions.chunks_exact(dimensions).enumerate() {
        let row = sender.len();
        cells.visit_near(x, |w| {
            let y = &positions[w * dimensions..(w + 1) * dimensions];
            if w != v && distance_squared(x, y) <= radius * radius {
                sender.push(w as u32);
            }
        });
        sender[row..].sort_unstable();
        start.push(sender.len() as u32);
    }
    RadiusGraph { start, sender }
}

/// |x - y|^2; the same to the bit for (x, y) and (y, x), so that graphs are symmetric.
fn distance_squared(x: &[f32], y: &[f32]) -> f32 {
    x.iter().zip(y).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Points sorted into square cells at least as wide as the radius, so that neighbours lie in
/// adjacent cells.
struct CellList {
    lower: Vec<f32>,
    side: Vec<f32>,
    cells: Vec<usize>,
    /// First entry of `points` for each cell, and their number at the end.
    start: Vec<usize>,
    points: Vec<usize>,
}

impl CellList {
    fn new(positions: &[f32], dimensions: usize, radius: f32) -> Self {
        let finite = |x: &[f32]| x.iter().all(|c| c.is_finite());
        let inside = || positions.chunks_exact(dimensions).filter(|x| finite(x));
        // No more cells than points in each direction's share, however far points have flown.
        let most = ((positions.len() / dimensions) as f64).powf(1.0 / dimensions as f64).ceil();
        let mut list = Self {
            lower: Vec::new(),
            side: Vec::new(),
            cells: Vec::new(),
            start: Vec::new(),
            points: Vec::new(),
        };
        for k in 0..dimensions {
            let lower = inside().map(|x| x[k]).fold(f32::INFINITY, f32::min);
            let upper = inside().map(|x| x[k]).fold(f32::NEG_INFINITY, f32::max);
            let extent = (f64::from(upper) - f64::from(lower)).max(0.0);
            // Wider than the radius by more than the rounding of a cell's index.
            let side = (1.001 * f64::from(radius)).max(extent / most.max(1.0));
            list.lower.push(lower);
            list.side.push(side as f32);
            list.cells.push((extent / side) as usize + 2);
        }
        let count: usize = list.cells.iter().product();
        let cell_of: Vec<Option<usize>> = positions
            .chunks_exact(dimensions)
            .map(|x| finite(x).then(|| list.flat(&list.cell(x))))
            .collect();
        list.start = vec![0; count + 1];
        for cell in cell_of.iter().flatten() {
            list.start[cell + 1] += 1;
        }
        for cell in 0..count {
            list.start[cell + 1] += list.start[cell];
        }
        let mut next = list.start.clone();
        list.points = vec![0; list.start[count]];
        for (point, cell) in cell_of.iter().enumerate() {
            if let Some(cell) = *cell {
                list.points[next[cell]] = point;
                next[cell] += 1;
            }
        }
        list
    }

    fn cell(&self, x: &[f32]) -> Vec<usize> {
        (0..x.len())
            .map(|k| (((x[k] - self.lower[k]) / self.side[k]) as usize).min(self.cells[k] - 1))
            .collect()
    }

    fn flat(&self, cell: &[usize]) -> usize {
        cell.iter().zip(&self.cells).rev().fold(0, |flat, (c, n)| flat * n + c)
    }

    /// Calls `visit` with every point of the cells at and around `x`.
    fn visit_near(&self, x: &[f32], mut visit: impl FnMut(usize)) {
        if !x.iter().all(|c| c.is_finite()) {
            return;
        }
        let cell = self.cell(x);
        let range = |k: usize| match cell.get(k) {
            Some(&c) => c.saturating_sub(1)..(c + 2).min(self.cells[k]),
            None => 0..1,
        };
        let mut stride = [1, 0, 0];
        for k in 1..cell.len() {
            stride[k] = stride[k - 1] * self.cells[k - 1];
        }
        for c2 in range(2) {
            for c1 in range(1) {
                let row = c2 * stride[2] + c1 * stride[1];
                let c0 = range(0);
                // Cells of a row are adjacent, and so are their points.
                let points = self.start[row + c0.start]..self.start[row + c0.end];
                self.points[points].iter().for_each(|&w| visit(w));
            }
        }
    }
}
