//! Columns of grains that collapse: run-out and the slope that is left.

use dem::Grains;
use dem::assembly::{
    Assembly, Boundary, ColumnBox, Faces, Floor, GrainState, on_cpu, prepare_column,
};

use super::line::Line;
use crate::fronts::mass_front;

/// A column at rest against a smooth wall, on a floor of grains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnTest {
    /// Width and height (m).
    pub size: [f64; 2],
}

/// The pile that a column leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pile {
    /// (L - L0) / L0.
    pub run_out: f64,
    /// Slope of its flank (degrees).
    pub slope: f64,
}

const GRAVITY: f64 = 9.81;
/// Length of the domain, in widths of the column and as much in heights.
const FREE: f64 = 6.0;
/// Duration in sqrt(height / g): columns stop after 3 to 4.
const DURATION: f64 = 6.0;
/// Parts of the largest height between which the slope of the flank is taken.
const FLANK: [f64; 2] = [0.2, 0.8];

/// Lets a column of grains collapse.
///
/// # Errors
/// The column cannot be filled, or a grain fails; the reason.
pub fn collapse(grains: &Grains, test: &ColumnTest, seed: u64) -> Result<Pile, String> {
    let [width, height] = test.size;
    let boundary = Boundary {
        corner: [0.0; 2],
        size: [width + FREE * (width + height), 2.0 * height + 10.0 * grains.radius_max],
        walls: Faces::default(),
        floor: Floor::Rough,
        boxes: Vec::new(),
        seed,
    };
    let gravity = [0.0, -GRAVITY];
    let place = ColumnBox { corner: [0.0; 2], size: test.size, loaded: true };
    let packed = prepare_column::<f32>(grains, &boundary, gravity, &place, seed, &mut on_cpu)
        .map_err(|error| error.to_string())?;
    let dt = grains.step();
    let mut assembly = Assembly::<f32>::new(grains, &boundary, gravity, dt, &packed)
        .map_err(|error| error.to_string())?;
    let duration = DURATION * (height / GRAVITY).sqrt();
    assembly.advance((duration / dt).ceil() as usize).map_err(|error| error.to_string())?;
    let states = assembly.states();
    let positions: Vec<[f64; 2]> = states.iter().map(|grain| grain.x).collect();
    let masses: Vec<f64> = states.iter().map(|grain| grain.mass).collect();
    let front = mass_front(&positions, &masses);
    Ok(Pile { run_out: (front - width) / width, slope: slope(&states, grains) })
}

/// Slope (degrees) of the line through the surface of the flank.
fn slope(states: &[GrainState], grains: &Grains) -> f64 {
    // The highest grain of every strip of three diameters.
    let strip = 3.0 * grains.mean_diameter();
    let mut surface: Vec<[f64; 2]> = Vec::new();
    for grain in states {
        let k = (grain.x[0].max(0.0) / strip) as usize;
        if surface.len() <= k {
            surface.resize(k + 1, [0.0; 2]);
        }
        let top = grain.x[1] + grain.r;
        if top > surface[k][1] {
            surface[k] = [(k as f64 + 0.5) * strip, top];
        }
    }
    let highest = surface.iter().map(|x| x[1]).fold(0.0, f64::max);
    let flank =
        surface.iter().filter(|x| (FLANK[0] * highest..=FLANK[1] * highest).contains(&x[1]));
    let steepness = flank.copied().collect::<Line>().slope();
    if steepness.is_finite() { (-steepness).atan().to_degrees() } else { 90.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangular_pile_has_its_slope() {
        let grains = Grains::default();
        let tangent = 0.4;
        let states: Vec<GrainState> = (0..10_000)
            .map(|k| [2.5e-3 * f64::from(k % 200), 2.5e-3 * f64::from(k / 200)])
            .filter(|x| x[1] < 0.12 - tangent * x[0])
            .map(|x| GrainState { x, r: 2.5e-3, ..GrainState::default() })
            .collect();
        // Strips are 9 steps of the raster wide, the surface is known to a step.
        assert!((slope(&states, &grains).to_radians().tan() - tangent).abs() < 0.03);
    }
}
