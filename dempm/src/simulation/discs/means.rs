//! Means over the grains of every point.

use std::f64::consts::PI;

use dem::assembly::{CoarseGraining, GrainState, free_share};
use mpm::{Mat2, Points, Vec2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::members::Members;

/// Means of points that are no properties of [`Points`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointMeans {
    /// Area of the grains over the area that they occupy.
    pub solid_fraction: Vec<f64>,
    /// Contacts per grain.
    pub coordination: Vec<f64>,
}

/// What surrounds the grains, which densities beside it are corrected for.
pub(super) struct Surroundings {
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
struct Mean {
    position: Vec2,
    velocity: Vec2,
    mass: f64,
    volume: f64,
    velocity_gradient: Mat2,
    stress: Mat2,
    solid_fraction: f64,
    coordination: f64,
}

impl PointMeans {
    /// Brings points up to date with the states of their grains: position, velocity, mass, stress, volume and
    /// velocity gradient.
    pub(super) fn update(
        members: &Members,
        states: &[GrainState],
        around: &Surroundings,
        points: &mut Points,
    ) -> Self {
        let graining = CoarseGraining::new(states, around.thickness, around.width);
        let means: Vec<Mean> = (0..points.len())
            .into_par_iter()
            .map(|p| Mean::of(members.of(p), states, &graining, around))
            .collect();
        for (p, mean) in means.iter().enumerate() {
            points.position[p] = mean.position;
            points.velocity[p] = mean.velocity;
            points.mass[p] = mean.mass;
            points.volume[p] = mean.volume;
            points.velocity_gradient[p] = mean.velocity_gradient;
            points.stress[p] = mean.stress;
        }
        Self {
            solid_fraction: means.iter().map(|mean| mean.solid_fraction).collect(),
            coordination: means.iter().map(|mean| mean.coordination).collect(),
        }
    }
}

/// Grains of a point at which the flow around them is evaluated, about.
const SAMPLES: usize = 16;

impl Mean {
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
        let (mut moment, mut momentum) = (Vec2::zeros(), Vec2::zeros());
        let (mut virial, mut flux) = (Mat2::zeros(), Mat2::zeros());
        for &grain in members {
            let grain = &states[grain as usize];
            let velocity = Vec2::from(grain.v);
            mass += grain.mass;
            area += PI * grain.r * grain.r;
            contacts += f64::from(grain.contacts);
            moment += grain.mass * Vec2::from(grain.x);
            momentum += grain.mass * velocity;
            virial += grain.virial;
            flux += grain.mass * velocity * velocity.transpose();
        }
        let (mut sampled, mut occupied, mut gradient) = (0.0, 0.0, Mat2::zeros());
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
        let pressure = virial + flux - momentum * velocity.transpose();
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
