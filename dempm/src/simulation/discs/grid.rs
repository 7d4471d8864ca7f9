//! Continuum fields of grains on a grid (Goldhirsch 2010).

use dem::assembly::{CoarseGraining, GrainState};

use crate::scene::GridOutput;
use crate::trajectory::{GridFrame, StaticGrid};

/// Widths that the grid reaches beyond the domain, as the coarse graining does: it holds all mass.
const MARGIN: f64 = 3.0;

/// The nodes: centres of squares of side `spacing` that cover a domain of `size` (m) and its margin.
pub(in crate::simulation) fn grid_nodes(output: &GridOutput, size: [f64; 2]) -> StaticGrid {
    let margin = MARGIN * output.width;
    let nodes = |length: f64| {
        let count = ((length + 2.0 * margin) / output.spacing).ceil() as usize;
        (0..count).map(|k| (k as f64 + 0.5) * output.spacing - margin).collect()
    };
    StaticGrid { width: output.width, x: nodes(size[0]), y: nodes(size[1]) }
}

/// The fields of grains of a `thickness` (m) at the nodes.
pub(super) fn fields(states: &[GrainState], thickness: f64, grid: &StaticGrid) -> GridFrame {
    let graining = CoarseGraining::new(states, thickness, grid.width);
    let places: Vec<[f64; 2]> =
        grid.y.iter().flat_map(|&y| grid.x.iter().map(move |&x| [x, y])).collect();
    let mut frame = GridFrame::default();
    for field in graining.at_all(&places) {
        frame.density.push(field.density as f32);
        frame.velocity.push([field.velocity.x as f32, field.velocity.y as f32]);
        // Compression is positive in the DEM, tension at points.
        let s = -field.stress;
        frame.stress.push([s[(0, 0)], s[(0, 1)], s[(1, 0)], s[(1, 1)]].map(|s| s as f32));
    }
    frame
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;

    use super::*;

    const THICKNESS: f64 = 0.01;
    const DIAMETER: f64 = 0.01;

    /// A square lattice of touching grains that fills a domain of 0.4 m x 0.3 m.
    fn lattice() -> Vec<GrainState> {
        let grain = |i: i32, j: i32| GrainState {
            x: [(f64::from(i) + 0.5) * DIAMETER, (f64::from(j) + 0.5) * DIAMETER],
            v: [2.0, -1.0],
            r: 0.5 * DIAMETER,
            mass: 1.0e-3,
            virial: Matrix2::new(4.0e-3, 0.0, 0.0, 2.0e-3),
            ..GrainState::default()
        };
        (0..30).flat_map(|j| (0..40).map(move |i| grain(i, j))).collect()
    }

    #[test]
    fn a_uniform_packing_has_its_density_velocity_and_stress() {
        let output = GridOutput { width: 2.0 * DIAMETER, spacing: DIAMETER };
        let grid = grid_nodes(&output, [0.4, 0.3]);
        let fields = fields(&lattice(), THICKNESS, &grid);
        // One grain of mass 1 g in every 1 cm x 1 cm x 1 cm.
        let nodes = grid.y.iter().flat_map(|&y| grid.x.iter().map(move |&x| [x, y]));
        let inside = |x: [f64; 2]| x[0] > 0.07 && x[0] < 0.33 && x[1] > 0.07 && x[1] < 0.23;
        let inner: Vec<usize> =
            nodes.enumerate().filter(|(_, x)| inside(*x)).map(|(k, _)| k).collect();
        assert!(inner.len() > 300);
        for k in inner {
            assert!((fields.density[k] / 1000.0 - 1.0).abs() < 0.01, "{}", fields.density[k]);
            assert!((fields.velocity[k][0] - 2.0).abs() < 1e-5);
            let [xx, xy, _, yy] = fields.stress[k];
            assert!((xx / -4000.0 - 1.0).abs() < 0.01 && (yy / -2000.0 - 1.0).abs() < 0.01);
            assert!(xy.abs() < 1.0);
        }
    }

    #[test]
    fn the_grid_holds_all_mass_and_momentum() {
        for (width, spacing) in [(2.0, 1.0), (3.0, 3.0), (1.0, 0.7)] {
            let output = GridOutput { width: width * DIAMETER, spacing: spacing * DIAMETER };
            let grid = grid_nodes(&output, [0.4, 0.3]);
            let fields = fields(&lattice(), THICKNESS, &grid);
            let volume = (spacing * DIAMETER).powi(2) * THICKNESS;
            let mass: f64 = fields.density.iter().map(|rho| f64::from(*rho) * volume).sum();
            assert!((mass / 1.2 - 1.0).abs() < 5e-3, "{mass} at {width}, {spacing}");
            for k in 0..2 {
                let of_node = fields.density.iter().zip(&fields.velocity);
                let momentum: f64 = of_node.map(|(rho, v)| f64::from(rho * v[k]) * volume).sum();
                assert!((momentum / ([2.0, -1.0][k] * mass) - 1.0).abs() < 1e-5);
            }
        }
    }
}
