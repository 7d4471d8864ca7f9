//! Contact with walls and obstacles, as conditions on the grid velocity.

use std::ops::Range;

use rayon::prelude::*;

use crate::bins::Bins;
use crate::friction::{Walls, contact};
use crate::grid::{Approach, Node, Shape};
use crate::obstacle::Placed;
use crate::{Points, Vec2};

/// Walls and obstacles as they stand in this step.
pub(crate) struct Boundary<'a> {
    pub shape: &'a Shape,
    pub walls: &'a Walls,
    pub obstacles: &'a [Placed],
}

impl Boundary<'_> {
    /// Sets how fast nodes on and behind walls and in boxes may approach them in a step of `dt` (s): so that the
    /// nearest point that a node sees comes to touch. A point touches at half the side of a square of its volume.
    pub fn set_approach(
        &self,
        nodes: &mut [Node],
        bins: &Bins,
        width: usize,
        points: &Points,
        dt: f64,
    ) {
        let columns = self.shape.columns;
        nodes.par_chunks_exact_mut(columns).zip(bins.spans()).enumerate().with_min_len(8).for_each(
            |(row, (nodes, span))| {
                for column in span.clone() {
                    if nodes[column].mass == 0.0 {
                        continue;
                    }
                    let seen = || bins.seen_by(row, column, columns, width);
                    let nearest = |distance: &dyn Fn(Vec2) -> f64| {
                        let gap =
                            |p: usize| distance(points.position[p]) - 0.5 * points.volume[p].sqrt();
                        seen().map(gap).fold(f64::INFINITY, f64::min).max(0.0) / dt
                    };
                    nodes[column].approach = self.approach(column, row, nearest);
                }
            },
        );
    }

    /// The approach of a node, where `nearest` gives that of the nearest point by its distance.
    fn approach(
        &self,
        column: usize,
        row: usize,
        nearest: impl Fn(&dyn Fn(Vec2) -> f64) -> f64,
    ) -> Approach {
        let mut approach = Approach::default();
        let place = [column, row].map(|k| self.shape.coordinate(k));
        for axis in 0..2 {
            if place[axis] <= 0 {
                approach.walls[axis] = nearest(&|x| x[axis]);
            } else if place[axis] >= self.shape.cells[axis] as i64 {
                approach.walls[axis] = nearest(&|x| self.shape.size[axis] - x[axis]);
            }
        }
        let x = self.shape.place(place[0], place[1]);
        if let Some(obstacle) = self.obstacles.iter().find(|o| o.holds(&x, self.shape.cell)) {
            approach.obstacle = nearest(&|x| obstacle.distance(&x));
        }
        approach
    }

    /// Applies all contacts to the grid velocity. The momentum they give to the material (kg/s),
    /// by the walls and then by each obstacle, is returned in `impulse`, summed over rows in order.
    pub fn apply(
        &self,
        nodes: &mut [Node],
        spans: &[Range<usize>],
        row_impulse: &mut Vec<Vec2>,
        impulse: &mut [Vec2],
    ) {
        let bodies = 1 + self.obstacles.len();
        row_impulse.clear();
        row_impulse.resize(bodies * self.shape.rows, Vec2::zeros());
        nodes
            .par_chunks_exact_mut(self.shape.columns)
            .zip(spans)
            .zip(row_impulse.par_chunks_exact_mut(bodies))
            .enumerate()
            .with_min_len(8)
            .for_each(|(row, ((nodes, span), impulse))| {
                for column in span.clone() {
                    self.apply_to_node(&mut nodes[column], column, row, impulse);
                }
            });
        impulse.fill(Vec2::zeros());
        for row in row_impulse.chunks_exact(bodies) {
            impulse.iter_mut().zip(row).for_each(|(total, part)| *total += part);
        }
    }

    /// Obstacles first, walls last: a node in a corner between both never enters the wall.
    fn apply_to_node(&self, node: &mut Node, column: usize, row: usize, impulse: &mut [Vec2]) {
        let (i, j) = (self.shape.coordinate(column), self.shape.coordinate(row));
        let (cell, approach) = (self.shape.cell, node.approach);
        for (obstacle, impulse) in self.obstacles.iter().zip(&mut impulse[1..]) {
            let velocity =
                obstacle.contact(&self.shape.place(i, j), node.velocity, cell, approach.obstacle);
            *impulse += (velocity - node.velocity) * node.mass;
            node.velocity = velocity;
        }
        let velocity = self.wall_contact(i, j, node.velocity, approach.walls);
        impulse[0] += (velocity - node.velocity) * node.mass;
        node.velocity = velocity;
    }

    /// All nodes on or behind a wall are clipped: ghost nodes carry material's momentum too. In a
    /// corner both walls act, one after the other; the second only slows what the first left.
    fn wall_contact(&self, i: i64, j: i64, mut v: Vec2, approach: Vec2) -> Vec2 {
        let [nx, ny] = self.shape.cells.map(|n| n as i64);
        let wall = |v, normal: Vec2, approach: f64, friction| {
            contact(v, normal, normal * -approach, friction)
        };
        if i <= 0 {
            v = wall(v, Vec2::x(), approach.x, self.walls.left);
        }
        if i >= nx {
            v = wall(v, -Vec2::x(), approach.x, self.walls.right);
        }
        if j <= 0 {
            v = wall(v, Vec2::y(), approach.y, self.walls.bottom);
        }
        if j >= ny {
            v = wall(v, -Vec2::y(), approach.y, self.walls.top);
        }
        v
    }
}
