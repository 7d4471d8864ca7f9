//! One run of a scene, in memory.

use dempm::scene::Scene;
use dempm::simulation::Simulation;
use miette::IntoDiagnostic;
use mpm::Vec2;

/// Parts of the duration at which runs are compared.
pub const PARTS: [f64; 5] = [0.1, 0.25, 0.5, 0.75, 1.0];

/// What a run leaves.
pub struct Run {
    /// Positions of all points at each of [`PARTS`] (m).
    pub positions: Vec<Vec<Vec2>>,
    /// Mean over [`PARTS`] of the pressure's scatter between points of one cell, see
    /// [`pressure_scatter`].
    pub scatter: f64,
    pub simulation: Simulation,
}

impl Run {
    pub fn new(scene: Scene) -> miette::Result<Self> {
        let (steps, cell) = (scene.steps(), scene.domain.cell);
        let mut simulation = Simulation::new(scene).into_diagnostic()?;
        let (mut positions, mut scatter) = (Vec::new(), 0.0);
        for part in PARTS {
            while simulation.step < (part * steps as f64).round() as usize {
                simulation.advance().into_diagnostic()?;
            }
            positions.push(simulation.points.position.clone());
            scatter += pressure_scatter(&simulation.points, cell) / PARTS.len() as f64;
        }
        Ok(Self { positions, scatter, simulation })
    }

    /// Foremost point (m).
    pub fn front(&self) -> f64 {
        self.simulation.points.position.iter().map(|x| x.x).fold(f64::MIN, f64::max)
    }

    /// Highest point (m).
    pub fn height(&self) -> f64 {
        self.simulation.points.position.iter().map(|x| x.y).fold(f64::MIN, f64::max)
    }

    /// Mean square distance of the points of two runs over the square of `width`, at [`PARTS`].
    pub fn distance(&self, other: &Self, width: f64) -> Vec<String> {
        let mean = |(a, b): (&Vec<Vec2>, &Vec<Vec2>)| {
            let sum: f64 = a.iter().zip(b).map(|(x, y)| (x - y).norm_squared()).sum();
            format!("{:.1e}", sum / a.len() as f64 / (width * width))
        };
        self.positions.iter().zip(&other.positions).map(mean).collect()
    }
}

/// Root mean square deviation of the points' pressures from the mean over their cell, over the
/// mean pressure of all points.
fn pressure_scatter(points: &mpm::Points, cell: f64) -> f64 {
    use std::collections::HashMap;
    let pressure = |p: usize| -0.5 * points.stress[p].trace();
    let mut cells: HashMap<[i64; 2], (f64, f64)> = HashMap::new();
    let key = |x: &Vec2| [(x.x / cell).floor() as i64, (x.y / cell).floor() as i64];
    for (p, x) in points.position.iter().enumerate() {
        let (sum, count) = cells.entry(key(x)).or_default();
        *sum += pressure(p);
        *count += 1.0;
    }
    let n = points.len() as f64;
    let mean = (0..points.len()).map(pressure).sum::<f64>() / n;
    let variance: f64 = points
        .position
        .iter()
        .enumerate()
        .map(|(p, x)| {
            let (sum, count) = cells[&key(x)];
            (pressure(p) - sum / count).powi(2)
        })
        .sum();
    (variance / n).sqrt() / mean
}
