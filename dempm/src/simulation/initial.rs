//! Points and model at time zero.

use std::sync::Arc;

use dem::Packing;
use gpu::Device;
use gpu::ranks::Ranks;
use mpm::{Mat2, Points, Vec2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::discs::DiscModel;
use super::error::SimulationError;
use super::model::Model;
use super::mpm_model::MpmModel;
use super::rve_material::RveMaterial;
use super::scene_material::SceneMaterial;
use crate::packings::{self, Ladder};
use crate::scene::{self, InitialStress, Scene};

/// The model of a scene and its points at time zero; discs are prepared on the GPU, if one is given,
/// by several ranks together.
pub(super) fn initial_model(
    scene: &Scene,
    device: Option<&Arc<Device>>,
    ranks: Option<&Ranks>,
) -> Result<(Model, Points), SimulationError> {
    let start = scene.points();
    let area = scene.point_area();
    let mut points = Points::default();
    for x in start.position {
        points.push(Vec2::from(x), scene.material.density() * area, area);
    }
    points.velocity = start.velocity.into_iter().map(Vec2::from).collect();
    let depth: Vec<f64> = match scene.initial_stress {
        InitialStress::Ladder => start.depth,
        InitialStress::None => vec![0.0; points.len()],
    };
    let material = match &scene.material {
        scene::Material::Discs(discs) => {
            let model = DiscModel::new(scene, discs, &mut points, device, ranks)?;
            return Ok((Model::Discs(Box::new(model)), points));
        }
        scene::Material::Rve(rve) => {
            SceneMaterial::Rve(Box::new(rve_material(scene, rve, &depth, &mut points)?))
        }
        scene::Material::MuI(law) => {
            // Isotropic: this law has no memory of a lateral stress ratio.
            let weight = law.density * scene.gravity[1];
            let stress = depth.iter().map(|z| Mat2::identity() * (weight * z));
            points.stress = stress.collect();
            SceneMaterial::MuI(mpm::DruckerPrager::new(*law, &points.stress)?)
        }
        scene::Material::Elastic(law) => SceneMaterial::Elastic(mpm::Elastic::new(law.into())?),
    };
    Ok((Model::Mpm(Box::new(MpmModel::new(scene, material)?)), points))
}

/// One packing per point, from the ladder of a randomly chosen packing of the scene: the rung whose
/// vertical stress is that of the point's depth.
fn rve_material(
    scene: &Scene,
    rve: &scene::Rve,
    depth: &[f64],
    points: &mut Points,
) -> Result<RveMaterial, SimulationError> {
    let (mut depths, rung) = distinct(depth);
    if scene.initial_stress == InitialStress::None {
        // All points start isotropic and need no rungs.
        depths.clear();
    }
    let seeds: Vec<u64> = rve.seeds(scene.seed).collect();
    let g = scene.gravity[1].abs();
    let ladders = packings::ladders(&rve.parameters, &seeds, &depths, g)?;

    let mut rng = ChaCha8Rng::seed_from_u64(scene.seed);
    let mut chosen: Vec<(&Packing<f64>, usize)> = Vec::with_capacity(depth.len());
    for (p, &rung) in rung.iter().enumerate() {
        let kind = rng.random_range(0..ladders.len());
        let ladder: &Ladder = &ladders[kind];
        let (packing, stress) = match scene.initial_stress {
            InitialStress::Ladder => (&ladder.rungs[rung].packing, ladder.rungs[rung].stress),
            InitialStress::None => {
                let pressure = rve.parameters.preparation.pressure;
                (&ladder.isotropic, Mat2::identity() * pressure)
            }
        };
        // Compression is positive in the packing, tension in the MPM.
        points.stress[p] = -stress;
        points.mass[p] = packings::bulk_density(&rve.parameters, packing) * points.volume[p];
        chosen.push((packing, kind));
    }
    let fresh: Vec<&Packing<f64>> = ladders.iter().map(|ladder| &ladder.isotropic).collect();
    let volume = &points.volume;
    Ok(RveMaterial::new(&rve.parameters, rve.precision, &chosen, &fresh, volume))
}

/// The distinct values, ascending, and for each entry the index of its value.
fn distinct(values: &[f64]) -> (Vec<f64>, Vec<usize>) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    // Depths of one row differ by round-off only.
    sorted.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let index =
        |value: &f64| sorted.iter().position(|s| (s - value).abs() < 2e-9).unwrap_or_default();
    let indices = values.iter().map(index).collect();
    (sorted, indices)
}
