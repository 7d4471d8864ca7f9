//! Means over the grains of material points.

use std::f64::consts::PI;

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use super::coarse_grain::{CoarseGraining, free_share};
use super::members::Members;
use super::packed::GrainState;

/// What surrounds the grains, which densities beside it are corrected for.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// Width and height of the domain (m).
    pub size: [f64; 2],
    /// Lower left and upper right corners of boxes (m).
    pub boxes: Vec<[[f64; 2]; 2]>,
    /// Out-of-plane thickness (m).
    pub thickness: f64,
    /// Width of the coarse graining (m).
    pub width: f64,
}

/// The mean over the grains of one point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointMean {
    /// Centre of mass (m).
    pub position: Vector2<f64>,
    /// Of the centre of mass (m/s).
    pub velocity: Vector2<f64>,
    /// Per metre of depth (kg/m).
    pub mass: f64,
    /// Area (m²) that the grains occupy.
    pub volume: f64,
    /// Of the mean flow around the grains (1/s).
    pub velocity_gradient: Matrix2<f64>,
    /// Cauchy stress with its kinetic part (Pa), tension positive.
    pub stress: Matrix2<f64>,
    /// Area of the grains over the area that they occupy.
    pub solid_fraction: f64,
    /// Contacts per grain.
    pub coordination: f64,
}

/// Grains of a point at which the flow around them is evaluated, about.
pub(crate) const SAMPLES: usize = 16;

/// The means over the grains of all points, in these states. The same bits for any number of threads.
pub fn point_means(
    states: &[GrainState],
    members: &Members,
    around: &Surroundings,
) -> Vec<PointMean> {
    let graining = CoarseGraining::new(states, around.thickness, around.width);
    let mean = |point| PointMean::of(members.of(point), states, &graining, around);
    (0..members.points()).into_par_iter().map(mean).collect()
}

impl PointMean {
    /// The mean over some grains. They occupy their area over the solid fraction around them, which is evaluated,
    /// with the velocity gradient, at a few of them; the stress is that of Love (1927) and Weber (1966) over this
    /// volume, with the motion about the mean velocity.
    fn of(
        members: &[u32],
        states: &[GrainState],
        graining: &CoarseGraining,
        around: &Surroundings,
    ) -> Self {
        let (mut mass, mut area, mut contacts) = (0.0, 0.0, 0.0);
        let (mut moment, mut momentum) = (Vector2::zeros(), Vector2::zeros());
        let (mut virial, mut flux) = (Matrix2::zeros(), Matrix2::zeros());
        for &grain in members {
            let grain = &states[grain as usize];
            let velocity = Vector2::from(grain.v);
            mass += grain.mass;
            area += PI * grain.r * grain.r;
            contacts += f64::from(grain.contacts);
            moment += grain.mass * Vector2::from(grain.x);
            momentum += grain.mass * velocity;
            virial += grain.virial;
            flux += grain.mass * velocity * velocity.transpose();
        }
        let (mut sampled, mut occupied, mut gradient) = (0.0, 0.0, Matrix2::zeros());
        for &grain in members.iter().step_by(members.len().div_ceil(SAMPLES)) {
            let grain = &states[grain as usize];
            let flow = graining.flow_at(grain.x);
            let free = free_share(grain.x, around.width, around.size, &around.boxes);
            let own = PI * grain.r * grain.r;
            sampled += own;
            occupied += own * free / flow.solid_fraction;
            gradient += own * flow.velocity_gradient;
        }
        let volume = area * occupied / sampled;
        let velocity = momentum / mass;
        let pressure: Matrix2<f64> = virial + flux - momentum * velocity.transpose();
        Self {
            position: moment / mass,
            velocity,
            mass: mass / around.thickness,
            volume,
            velocity_gradient: gradient / sampled,
            // Compression is positive in the DEM, tension at points.
            stress: -0.5 * (pressure + pressure.transpose()) / (volume * around.thickness),
            solid_fraction: area / volume,
            coordination: contacts / members.len() as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 0.01;

    /// A square of touching grains in the middle of a lattice that rotates as a whole: closed forms of all means.
    #[test]
    fn a_rotating_square_has_its_means() {
        let (n, spin, thickness) = (20, 0.7, 0.5);
        let virial = Matrix2::new(4.0, 1.0, 1.0, 2.0);
        let side = 2.0 * RADIUS * f64::from(n);
        let inside = |k: i32| (0..n).contains(&k);
        let mut states = Vec::new();
        let mut point_of = Vec::new();
        for (j, i) in (-n..2 * n).flat_map(|j| (-n..2 * n).map(move |i| (j, i))) {
            let branch = [i, j].map(|k| RADIUS * (1.0 + 2.0 * f64::from(k)));
            let (x, v) = (branch.map(|x| x + side), [-spin * branch[1], spin * branch[0]]);
            let (r, mass, contacts) = (RADIUS, 3.0, 4);
            states.push(GrainState { x, v, r, mass, contacts, virial, ..GrainState::default() });
            point_of.push(u32::from(!(inside(i) && inside(j))));
        }
        let around = Surroundings {
            size: [3.0 * side; 2],
            // Far from the point.
            boxes: vec![[[2.5 * side, 0.0], [3.0 * side, side]]],
            thickness,
            width: 3.0 * RADIUS,
        };
        let mean = point_means(&states, &Members::new(2, &point_of), &around)[0];

        let grains = f64::from(n * n);
        assert!((mean.position - Vector2::repeat(1.5 * side)).norm() < 1e-12);
        assert!((mean.velocity - 0.5 * side * spin * Vector2::new(-1.0, 1.0)).norm() < 1e-12);
        assert!((mean.mass / (3.0 * grains / thickness) - 1.0).abs() < 1e-12);
        assert!((mean.coordination - 4.0).abs() < 1e-12);
        // A square lattice; the Gaussian resolves single grains to half a per cent.
        assert!((mean.solid_fraction / (0.25 * PI) - 1.0).abs() < 5e-3, "{mean:?}");
        assert!((mean.volume / (side * side) - 1.0).abs() < 5e-3, "{mean:?}");
        let rotation = Matrix2::new(0.0, -spin, spin, 0.0);
        assert!((mean.velocity_gradient - rotation).norm() < 0.05 * spin, "{mean:?}");
        // Contacts, and the rotation about the centre: m spin² (n² - 1) d² / 12 along either axis.
        let spread = (side * side - 4.0 * RADIUS * RADIUS) / 12.0;
        let kinetic = 3.0 * spin * spin * spread * Matrix2::identity();
        let expected = -grains * (virial + kinetic) / (mean.volume * thickness);
        assert!((mean.stress - expected).norm() < 1e-9 * expected.norm(), "{mean:?} {expected}");
    }
}
