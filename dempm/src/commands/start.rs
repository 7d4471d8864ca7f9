//! The prepared state of a trajectory: a profile of its first frame over the height.

use std::fmt::Write;

use serde::Serialize;

use crate::trajectory::{Field, Result, Trajectory};

/// Most layers of a profile.
const LAYERS: usize = 10;

/// Sums over the points of a horizontal layer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sums {
    points: usize,
    solid_fraction: f64,
    coordination: f64,
    /// Horizontal and vertical normal stress (Pa), tension positive.
    stress: [f64; 2],
}

/// Means over the points of a horizontal layer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Layer {
    /// Lower and upper end (m).
    height: [f64; 2],
    solid_fraction: f64,
    coordination: f64,
    /// Vertical stress (Pa), tension positive.
    stress_yy: f64,
    /// Horizontal over vertical stress.
    k0: f64,
}

/// Solid fraction, coordination number, vertical stress and K0 over the height of the first frame, from the lowest layer
/// to the highest; empty without these fields.
pub(super) fn start_profile(trajectory: &Trajectory) -> Result<Vec<Layer>> {
    let fields = [Field::Stress, Field::SolidFraction, Field::Coordination];
    let recorded = |field: &Field| trajectory.fields().any(|f| f == *field);
    if trajectory.frames() == 0 || !fields.iter().all(recorded) {
        return Ok(Vec::new());
    }
    let height: Vec<f64> = trajectory.frame(0)?.position.iter().map(|x| x[1]).collect();
    let values = |field: Field| -> Result<Vec<f64>> {
        let values = trajectory.field::<f64>(field, 0..1)?;
        Ok(values.map_or_else(Vec::new, |values| values.into_iter().collect()))
    };
    let [stress, solid_fraction, coordination] = fields;
    let (stress, coordination) = (values(stress)?, values(coordination)?);
    let solid_fraction = values(solid_fraction)?;
    let top = height.iter().copied().fold(f64::MIN, f64::max);
    let bottom = height.iter().copied().fold(f64::MAX, f64::min);
    // Layers hold whole rows of points.
    let spacing = trajectory.header().point_spacing;
    let rows = ((top - bottom) / spacing).round() + 1.0;
    let count = (rows as usize).clamp(1, LAYERS);
    let mut layers = vec![Sums::default(); count];
    for (point, y) in height.iter().enumerate() {
        let row = ((y - bottom) / spacing).round();
        let layer = &mut layers[((row / rows * count as f64) as usize).min(count - 1)];
        layer.points += 1;
        layer.solid_fraction += solid_fraction[point];
        layer.coordination += coordination[point];
        layer.stress[0] += stress[4 * point];
        layer.stress[1] += stress[4 * point + 3];
    }
    Ok(means(&layers, bottom - 0.5 * spacing, rows * spacing / count as f64))
}

/// The means of layers from the lowest to the highest, each `step` (m) high, above `bottom` (m).
fn means(layers: &[Sums], bottom: f64, step: f64) -> Vec<Layer> {
    let filled = layers.iter().enumerate().filter(|(_, layer)| layer.points > 0);
    let layer = |(k, layer): (usize, &Sums)| {
        let mean = |sum: f64| sum / layer.points as f64;
        Layer {
            height: [k, k + 1].map(|k| bottom + k as f64 * step),
            solid_fraction: mean(layer.solid_fraction),
            coordination: mean(layer.coordination),
            stress_yy: mean(layer.stress[1]),
            k0: layer.stress[0] / layer.stress[1],
        }
    };
    filled.map(layer).collect()
}

/// The table of a profile, one line a layer from the top; empty without layers.
pub(super) fn table(layers: &[Layer]) -> String {
    if layers.is_empty() {
        return String::new();
    }
    let mut text = format!(
        "\n{:<24}{:>14}{:>14}{:>14}{:>8}\n",
        "start, height [m]", "solid fraction", "coordination", "sigma_yy [Pa]", "K0"
    );
    for layer in layers.iter().rev() {
        let Layer { height: [low, high], solid_fraction, coordination, stress_yy, k0 } = layer;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<24}{solid_fraction:>14.3}{coordination:>14.2}{stress_yy:>14.0}{k0:>8.2}",
            format!("{low:.3} to {high:.3}"),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_listed_from_the_top() {
        let lower =
            Sums { points: 2, solid_fraction: 1.68, coordination: 7.8, stress: [-1800.0, -2000.0] };
        let upper =
            Sums { points: 1, solid_fraction: 0.8, coordination: 3.5, stress: [-90.0, -100.0] };
        let text = table(&means(&[lower, Sums::default(), upper], 0.0, 0.1));
        let lines: Vec<Vec<&str>> =
            text.lines().skip(2).map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(lines[0], ["0.200", "to", "0.300", "0.800", "3.50", "-100", "0.90"]);
        assert_eq!(lines[1], ["0.000", "to", "0.100", "0.840", "3.90", "-1000", "0.90"]);
        assert_eq!(lines.len(), 2);
    }
}
