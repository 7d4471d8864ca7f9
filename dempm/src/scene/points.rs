//! The material points at time zero.

use super::model::{Column, PointLayout, Scene};

/// Material points at time zero: column by column in the order of the file, each row by row from its
/// lower left corner.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Positions (m): in squares of one spacing that fill the columns, one in each; see [`PointLayout`].
    pub position: Vec<[f64; 2]>,
    /// Velocities (m/s).
    pub velocity: Vec<[f64; 2]>,
    /// Index of the column in the scene.
    pub column: Vec<u32>,
    /// Depth (m): the height of resting material above the point. Zero in columns in the air or moving
    /// vertically, as nothing carries their weight.
    pub depth: Vec<f64>,
}

impl Scene {
    /// All material points at time zero.
    pub fn points(&self) -> Points {
        let spacing = self.domain.spacing();
        let resting = self.resting_columns();
        let mut points = Points::default();
        for (index, column) in self.columns.iter().enumerate() {
            let load: Vec<&Column> = if resting[index] {
                self.columns.iter().zip(&resting).filter(|(_, r)| **r).map(|(c, _)| c).collect()
            } else {
                Vec::new()
            };
            let [columns, rows] = self.grid_of(column);
            for (row, along) in (0..rows).flat_map(|row| (0..columns).map(move |k| (row, k))) {
                let [x, y] = column.place.corner;
                let shift = match self.domain.point_layout {
                    PointLayout::Square => 0.0,
                    PointLayout::Staggered if row % 2 == 0 => -0.25,
                    PointLayout::Staggered => 0.25,
                };
                let position =
                    [x + (along as f64 + 0.5 + shift) * spacing, y + (row as f64 + 0.5) * spacing];
                points.position.push(position);
                points.velocity.push(column.velocity);
                points.column.push(index as u32);
                points.depth.push(load.iter().map(|other| height_above(other, position)).sum());
            }
        }
        points
    }

    /// Number of material points.
    pub fn point_count(&self) -> usize {
        self.columns.iter().map(|column| self.grid_of(column).iter().product::<usize>()).sum()
    }

    /// Height of the highest pile of material (m), resting or not.
    pub fn height(&self) -> f64 {
        let resting = self.resting_columns();
        let pile = |index: usize| {
            let column = &self.columns[index];
            let middle =
                [0.5 * (column.place.corner[0] + column.place.end()[0]), column.place.corner[1]];
            let above = self.columns.iter().zip(&resting).filter(|(_, r)| **r);
            above.map(|(other, _)| height_above(other, middle)).sum()
        };
        (0..self.columns.len())
            .map(|k| if resting[k] { pile(k) } else { self.columns[k].place.size[1] })
            .fold(0.0, f64::max)
    }

    /// Initial area of a material point (m²): its volume per metre out of plane.
    pub fn point_area(&self) -> f64 {
        self.domain.spacing().powi(2)
    }

    /// Points of a column along x and y.
    fn grid_of(&self, column: &Column) -> [usize; 2] {
        column.place.size.map(|size| (size / self.domain.spacing()).round() as usize)
    }

    /// For each column, whether it rests on something and does not move vertically.
    pub fn resting_columns(&self) -> Vec<bool> {
        let tolerance = 1.0e-6 * self.domain.spacing();
        let on = |column: &Column, top: f64, from: f64, to: f64| {
            let [left, bottom] = column.place.corner;
            (bottom - top).abs() < tolerance
                && column.place.end()[0].min(to) - left.max(from) > tolerance
        };
        let mut resting = vec![false; self.columns.len()];
        // A column may rest on a later one: repeat until nothing changes.
        loop {
            let before = resting.clone();
            for (index, column) in self.columns.iter().enumerate() {
                let obstacles = self.obstacles.iter().map(|obstacle| obstacle.place);
                let columns = self.columns.iter().zip(&before).filter(|(_, r)| **r);
                let mut supports = obstacles.chain(columns.map(|(other, _)| other.place));
                resting[index] = column.velocity[1] == 0.0
                    && (column.place.corner[1] < tolerance
                        || supports.any(|s| on(column, s.end()[1], s.corner[0], s.end()[0])));
            }
            if resting == before {
                return resting;
            }
        }
    }
}

/// Height (m) of the part of `column` above a point.
fn height_above(column: &Column, [x, y]: [f64; 2]) -> f64 {
    let ([left, bottom], [right, top]) = (column.place.corner, column.place.end());
    if x < left || x > right { 0.0 } else { (top - y.max(bottom)).max(0.0) }
}
