//! Which grains belong to which material point.

use serde::{Deserialize, Serialize};

/// The grains of every point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Members {
    /// Grains of point `p`: `grain[start[p]..start[p + 1]]`.
    start: Vec<u32>,
    /// Indices of grains, point by point.
    grain: Vec<u32>,
}

impl Members {
    /// Of so many points, from the point of every grain.
    pub fn new(points: usize, point_of: &[u32]) -> Self {
        let mut start = vec![0; points + 1];
        for &point in point_of {
            start[point as usize + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut next = start.clone();
        let mut grain = vec![0; point_of.len()];
        for (index, &point) in point_of.iter().enumerate() {
            let place = &mut next[point as usize];
            grain[*place as usize] = index as u32;
            *place += 1;
        }
        Self { start, grain }
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.start.len() - 1
    }

    /// Indices of the grains of a point.
    pub fn of(&self, point: usize) -> &[u32] {
        &self.grain[self.start[point] as usize..self.start[point + 1] as usize]
    }

    /// The point of every grain.
    pub fn point_of(&self) -> Vec<u32> {
        let mut point_of = vec![0; self.grain.len()];
        for point in 0..self.points() {
            for &grain in self.of(point) {
                point_of[grain as usize] = point as u32;
            }
        }
        point_of
    }

    /// The first point without grains.
    pub fn first_empty(&self) -> Option<usize> {
        (0..self.points()).find(|&point| self.of(point).is_empty())
    }

    /// Where the grains of each point begin, and the grains point by point.
    pub(crate) fn rows(&self) -> (&[u32], &[u32]) {
        (&self.start, &self.grain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grains_are_listed_point_by_point() {
        let point_of = [2, 0, 2, 3, 0];
        let members = Members::new(4, &point_of);
        assert_eq!(
            [0, 1, 2, 3].map(|p| members.of(p).to_vec()),
            [vec![1, 4], vec![], vec![0, 2], vec![3]]
        );
        assert_eq!((members.point_of(), members.first_empty()), (point_of.to_vec(), Some(1)));
    }
}
