//! Time per macro step of whole scenes.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use miette::bail;

use super::extent::Extent;
use super::markdown::table;
use crate::dataset::paper_scene;
use crate::scene::{Material, Scene};
use crate::simulation::{Model, Simulation};

const COLUMN: &str = include_str!("../../../scenes/column.toml");
const COLUMN_MU_I: &str = include_str!("../../../scenes/column-mu-i.toml");
const DISCS: &str = include_str!("../../../scenes/discs.toml");
/// Scenes of the paper that a GPU is measured with.
const ON_GPU: &[&str] = &["col3x3barriers"];
const ON_GPU_FULL: &[&str] = &["col2x2", "col3x3barriers", "col10x2", "col5x5"];

/// A table of the scenes on the CPU and on the GPU, if there is one.
///
/// # Errors
/// If a scene cannot be simulated or is too short.
pub fn report(
    gpu: Option<&Arc<gpu::Device>>,
    scenes: Vec<(Scene, bool, bool)>,
    extent: Extent,
) -> miette::Result<String> {
    let mut rows = Vec::new();
    for (scene, on_cpu, on_gpu) in scenes {
        if on_cpu {
            rows.push(measure(scene.clone(), None, extent)?);
        }
        if let Some(device) = gpu.filter(|_| on_gpu) {
            rows.push(measure(scene, Some(device), extent)?);
        }
    }
    let head = [
        "scene",
        "model",
        "device",
        "points",
        "discs",
        "steps",
        "ms a step",
        "of it",
        "1e6 disc-steps/s",
        "whole run [s]",
    ];
    Ok(format!(
        "{}\nMeasured over the first steps of each scene and projected to all of them, without \
         preparation and output; faster flow later in a run searches neighbours more often.\n",
        table(&head, &rows)
    ))
}

/// The scenes, with flags for measuring on the CPU and on the GPU.
///
/// # Errors
/// If a chosen scene cannot be read.
pub fn scenes(chosen: &[String], extent: Extent) -> miette::Result<Vec<(Scene, bool, bool)>> {
    if !chosen.is_empty() {
        return chosen.iter().map(|name| Ok((named(name)?, true, true))).collect();
    }
    let mut scenes = vec![
        (Scene::parse(COLUMN, "column.toml")?, true, true),
        (Scene::parse(COLUMN_MU_I, "column-mu-i.toml")?, true, true),
    ];
    for name in if extent.full { ON_GPU_FULL } else { ON_GPU } {
        scenes.push((named(name)?, extent.full, true));
    }
    // Columns of discs take a CPU minutes to prepare.
    scenes.push((Scene::parse(DISCS, "discs.toml")?, extent.full, true));
    for name in ON_GPU {
        scenes.push((as_discs(&named(name)?)?, false, true));
    }
    Ok(scenes)
}

/// The same scene grain by grain.
fn as_discs(scene: &Scene) -> miette::Result<Scene> {
    Ok(Scene::parse(&scene.text.replace("kind = \"rve\"", "kind = \"discs\""), &scene.name)?)
}

/// A scene of the paper by its name, else a file.
fn named(name: &str) -> miette::Result<Scene> {
    match paper_scene(name) {
        Some(text) => Ok(Scene::parse(text, name)?),
        None => Ok(Scene::load(name)?),
    }
}

fn measure(
    scene: Scene,
    device: Option<&Arc<gpu::Device>>,
    extent: Extent,
) -> miette::Result<Vec<String>> {
    let mut simulation = Simulation::prepare(scene, device, None)?;
    if let Some(device) = device {
        simulation.move_to(device, None)?;
    }
    // Warm-up: the first steps search all neighbours. On a GPU each advances by a frame.
    let half = simulation.scene.steps() / 2;
    for _ in 0..10 {
        if simulation.step < half {
            simulation.advance()?;
        }
    }
    simulation.record_wall_time();
    let before = simulation.wall_time.clone();
    let first = simulation.step;
    let start = Instant::now();
    while start.elapsed() < 2 * extent.time && simulation.step < simulation.scene.steps() {
        simulation.advance()?;
    }
    let steps = (simulation.step - first) as f64;
    if steps == 0.0 {
        bail!("{}: too short to be measured", simulation.scene.title);
    }
    let step = start.elapsed().as_secs_f64() / steps;
    simulation.record_wall_time();
    let points = simulation.points.len();
    let discs = match (&simulation.model, &simulation.scene.material) {
        (Model::Discs(discs), _) => discs.discs(),
        (Model::Mpm(_), Material::Rve(rve)) => points * rve.parameters.discs,
        (Model::Mpm(_), _) => 0,
    };
    let rate = simulation.scene.material.grains().map_or_else(
        || "-".to_owned(),
        |grains| {
            let substeps = grains.substeps(simulation.scene.step);
            format!("{:.1}", 1e-6 * (discs * substeps) as f64 / step)
        },
    );
    Ok(vec![
        simulation.scene.title.clone(),
        simulation.scene.material.name().to_owned(),
        simulation.device.clone(),
        points.to_string(),
        discs.to_string(),
        simulation.scene.steps().to_string(),
        format!("{:.3}", 1e3 * step),
        phases(&before, &simulation.wall_time, steps),
        rate,
        format!("{:.1}", step * simulation.scene.steps() as f64),
    ])
}

/// Milliseconds per step of each phase.
fn phases(before: &BTreeMap<String, f64>, after: &BTreeMap<String, f64>, steps: f64) -> String {
    let of_phase = |(phase, time): (&String, &f64)| {
        let time = 1e3 * (time - before.get(phase).copied().unwrap_or_default()) / steps;
        (time > 0.0).then(|| format!("{phase} {time:.3}"))
    };
    after.iter().filter_map(of_phase).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_word_makes_a_scene_of_discs() {
        let scene = as_discs(&named("col3x3barriers").unwrap()).unwrap();
        assert_eq!((scene.material.name(), scene.point_count()), ("discs", 2304));
    }

    #[test]
    fn scenes_are_found_by_name_or_as_files() {
        assert_eq!(named("col5x5").unwrap().point_count(), 6400);
        assert!(named("nowhere.toml").is_err());
    }
}
