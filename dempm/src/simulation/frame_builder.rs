//! Header and frames of a trajectory from a simulation.

use std::collections::BTreeMap;

use mpm::Mat2;

use super::discs::{PointMeans, grid_nodes};
use super::driver::Simulation;
use super::model::Model;
use crate::fronts::{CONNECTED_DEPTH, connected_front, mass_front};
use crate::scene::{self, Precision};
use crate::trajectory::{
    self, Field, Frame, GrainFrame, GridFrame, Header, StaticGrains, StaticGrid,
};

impl Simulation {
    /// The header of the trajectory of a run that began at `created` (UTC, ISO 8601).
    pub fn header(&self, created: String) -> Header {
        let scene = &self.scene;
        let [width, height] = scene.domain.size;
        let text = str::to_owned;
        let mut parameters = BTreeMap::new();
        let mut precision = "f64";
        // Stress scales with 1/thickness, cost with discs and substeps.
        match &scene.material {
            scene::Material::Rve(rve) => {
                let p = &rve.parameters;
                if rve.precision == Precision::F32 {
                    precision = "f32 (DEM), f64 (MPM)";
                }
                parameters.insert(text("rve_discs"), p.discs as f64);
                parameters.insert(text("rve_thickness"), p.grains.thickness);
                let substeps = p.grains.substeps(scene.step) as f64;
                parameters.insert(text("rve_step"), scene.step / substeps);
                parameters.insert(text("rve_substeps"), substeps);
            }
            scene::Material::Discs(discs) => {
                if discs.precision == Precision::F32 {
                    precision = "f32";
                }
            }
            scene::Material::MuI(_) | scene::Material::Elastic(_) => {}
        }
        if let Model::Discs(discs) = &self.model {
            parameters.extend(discs.parameters(&self.points));
        }
        Header {
            title: scene.title.clone(),
            scene: scene.text.clone(),
            seed: scene.seed,
            created,
            versions: BTreeMap::from([(text("dempm"), text(env!("CARGO_PKG_VERSION")))]),
            device: self.device.clone(),
            precision: text(precision),
            material: text(scene.material.name()),
            domain: scene.domain.size,
            gravity: scene.gravity,
            grid_cell: scene.domain.cell,
            point_spacing: scene.domain.spacing(),
            time_step: scene.step,
            frame_interval: scene.frame_interval,
            parameters,
            walls: vec![
                [0.0, 0.0, 0.0, height],
                [width, 0.0, width, height],
                [0.0, 0.0, width, 0.0],
                [0.0, height, width, height],
            ],
        }
    }

    /// Properties of the points that never change.
    pub fn static_points(&self) -> trajectory::Points {
        let column = self.scene.points().column;
        trajectory::Points { mass: self.points.mass.clone(), column }
    }

    /// The present state with the fields that the scene asks for.
    pub fn frame(&self) -> Frame {
        let points = &self.points;
        let wanted = |field| self.scene.fields.contains(&field);
        Frame {
            time: self.time(),
            position: points.position.iter().map(|&x| x.into()).collect(),
            velocity: points.velocity.iter().map(|&v| v.into()).collect(),
            stress: wanted(Field::Stress).then(|| {
                let rows = |s: &Mat2| [(0, 0), (0, 1), (1, 0), (1, 1)].map(|k| s[k] as f32);
                points.stress.iter().map(rows).collect()
            }),
            solid_fraction: wanted(Field::SolidFraction)
                .then(|| self.of_grains(|rve| rve.solid_fraction, |means| &means.solid_fraction))
                .flatten(),
            coordination: wanted(Field::Coordination)
                .then(|| self.of_grains(|rve| rve.coordination, |means| &means.coordination))
                .flatten(),
            inertial_number: wanted(Field::InertialNumber).then(|| {
                let (diameter, density) = self.scene.material.grain();
                let of_point = |(l, stress): (&Mat2, &Mat2)| {
                    let pressure = -0.5 * stress.trace();
                    dem::inertial_number(l, pressure, diameter, density) as f32
                };
                points.velocity_gradient.iter().zip(&points.stress).map(of_point).collect()
            }),
            boxes: self.boxes(),
            budget: self.budget(),
            grains: self.grain_frame(),
            grid: self.grid_frame(),
        }
    }

    /// Properties of the grains that never change, if the scene asks for grains.
    pub fn static_grains(&self) -> Option<StaticGrains> {
        match &self.model {
            Model::Discs(discs) if self.scene.grains_every > 0 => {
                let column = self.scene.points().column;
                Some(discs.static_grains(self.scene.grains_every, &column))
            }
            Model::Discs(_) | Model::Mpm(_) => None,
        }
    }

    /// The grains, if this is a frame with grains.
    fn grain_frame(&self) -> Option<GrainFrame> {
        let every = self.scene.grains_every;
        match &self.model {
            Model::Discs(discs) if every > 0 => {
                let frame = self.frames_so_far() - 1;
                frame.is_multiple_of(every).then(|| discs.grain_frame())
            }
            Model::Discs(_) | Model::Mpm(_) => None,
        }
    }

    /// The grid of continuum fields, if the scene asks for it.
    pub fn static_grid(&self) -> Option<StaticGrid> {
        match &self.model {
            Model::Discs(_) => {
                self.scene.grid.as_ref().map(|output| grid_nodes(output, self.scene.domain.size))
            }
            Model::Mpm(_) => None,
        }
    }

    /// The continuum fields, if the scene asks for them.
    fn grid_frame(&self) -> Option<GridFrame> {
        match &self.model {
            Model::Discs(discs) => Some(discs.grid_frame(&self.static_grid()?)),
            Model::Mpm(_) => None,
        }
    }

    /// A quantity of the grains of every point; `None` for a continuum law.
    fn of_grains(
        &self,
        of_packing: impl Fn(&dem::RveState) -> f64,
        of_discs: impl Fn(&PointMeans) -> &[f64],
    ) -> Option<Vec<f32>> {
        match &self.model {
            Model::Mpm(mpm) => {
                Some(mpm.rve_states()?.iter().map(|state| of_packing(state) as f32).collect())
            }
            Model::Discs(discs) => {
                Some(of_discs(discs.means()).iter().map(|&value| value as f32).collect())
            }
        }
    }

    /// Obstacles and plate at the present time.
    fn boxes(&self) -> Vec<[f64; 4]> {
        let now = |o: mpm::Obstacle| o.at(self.time());
        let corners = |o: mpm::Obstacle| [o.min.x, o.min.y, o.max.x, o.max.y];
        self.scene.rigid_boxes().into_iter().map(now).map(corners).collect()
    }

    /// Scalars of the whole scene: front and height, and those of the model.
    fn budget(&self) -> BTreeMap<String, f64> {
        let points = &self.points;
        let largest = |k: usize| points.position.iter().map(|x| x[k]).fold(f64::MIN, f64::max);
        let mut scalars = match &self.model {
            Model::Mpm(mpm) => mpm.budget(points, self.scene.step),
            Model::Discs(discs) => discs.budget(points),
        };
        let position: Vec<[f64; 2]> = points.position.iter().map(|&x| x.into()).collect();
        scalars.insert("front_99".to_owned(), mass_front(&position, &points.mass));
        if let Some(front) = self.connected_front() {
            scalars.insert("front_connected".to_owned(), front);
        }
        scalars.insert("front".to_owned(), largest(0));
        scalars.insert("max_height".to_owned(), largest(1));
        scalars
    }

    /// The foremost x (m) connected to the pile; `None` without grains.
    pub(crate) fn connected_front(&self) -> Option<f64> {
        let (diameter, density) = self.scene.material.grain();
        match &self.model {
            Model::Discs(discs) => Some(discs.connected_front()),
            Model::Mpm(_) if diameter > 0.0 => {
                let points = self.points.position.iter().zip(&self.points.mass);
                let solid: Vec<_> = points.map(|(x, mass)| (x.x, mass / density)).collect();
                Some(connected_front(&solid, CONNECTED_DEPTH * diameter))
            }
            Model::Mpm(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    /// A frame shows the plate where it is, once moved.
    #[test]
    fn a_plate_is_recorded_where_it_is() {
        let text = r#"
            duration = 0.01
            frame_interval = 0.005
            [domain]
            size = [1.0, 0.75]
            [[column]]
            size = [0.25, 0.25]
            [plate]
            corner = [0.0, 0.375]
            size = [0.25, 0.25]
            velocity = [0.0, -0.5]
            start = 0.001
            [material]
            kind = "mu-i"
        "#;
        let mut simulation = Simulation::new(Scene::parse(text, "test.toml").unwrap()).unwrap();
        let frame = simulation.frame();
        assert_eq!(frame.boxes, [[0.0, 0.375, 0.25, 0.625]]);
        // All of the column is one piece.
        assert_eq!(frame.budget["front_connected"], frame.budget["front"]);
        for _ in 0..50 {
            simulation.advance().unwrap();
        }
        let [[_, bottom, _, top]] = simulation.frame().boxes[..] else { panic!("one box") };
        assert!((bottom - 0.373).abs() < 1.0e-12 && (top - 0.623).abs() < 1.0e-12, "{bottom}");
    }
}
