//! A scene as the data that a network has learnt from.

use dempm::choose::discs_on_grids;
use dempm::scene::Scene;

use crate::diagnostics::FlowState;
use crate::simulator::Simulator;

/// Kind of material of scenes as discs.
const DISCS: &str = "discs";

/// The scene whose first frames a network continues: one with another material as discs, if it has learnt from discs.
pub(super) fn scene_to_start_from(simulator: &Simulator, scene: &Scene) -> Scene {
    let learnt_from_discs = simulator.training.material.as_deref() == Some(DISCS);
    if learnt_from_discs && scene.material.name() != DISCS {
        discs_on_grid_of_training(simulator, scene)
    } else {
        scene.clone()
    }
}

/// The scene as discs, averaged over squares that give points as many neighbours as in training. The scene itself if it
/// cannot be computed as discs.
pub(crate) fn discs_on_grid_of_training(simulator: &Simulator, scene: &Scene) -> Scene {
    let interval = simulator.training.frame_interval;
    let radius = simulator.config.connection_radius;
    let excess = |scene: &Scene| {
        let points = &scene.points().position[..];
        let neighbours = FlowState::measure([points; 3], interval, radius).neighbours;
        let range = simulator.training.range.as_ref();
        range.map_or(0.0, |range| range.excess_of_neighbours(neighbours))
    };
    let grids = discs_on_grids(scene).into_iter().map(|scene| (excess(&scene), scene));
    let nearest = grids.min_by(|(a, _), (b, _)| a.total_cmp(b));
    nearest.map_or_else(|| scene.clone(), |(_, scene)| scene)
}
